"""How a kind of step is declared: a function with its weight. What it is given by random numbers depends on the step's
own seed alone, so that a step does the same whichever steps before it are left out."""

from random import Random

import bpy

from . import scene

KINDS = {}  # function -> weight


class Differ(Exception):
    """The mesh and its twin were not treated alike."""


def kind(weight):
    """Declares function(random), which may return a word on what it did."""

    def declare(function):
        KINDS[function] = weight
        return function

    return declare


def choose(random):
    return random.choices(list(KINDS), list(KINDS.values()))[0]


def on_pair(weight, in_any_mode=False):
    """Declares function(random, ob, twin)."""

    def declare(function):
        def step(random):
            if not in_any_mode:
                scene.leave_modes()
            found = scene.pairs()
            if found:
                ob, twin = random.choice(found)
                name = ob.name
                function(random, ob, twin)
                return name
            return None

        return kind(weight)(_named(step, function))

    return declare


def on_both(weight, in_any_mode=False, wanted=None):
    """Declares function(random, ob), which is called for a mesh and for its twin with the same random numbers, if
    wanted(ob, twin), asked before either is changed. Blender may refuse what it asks for, then to both."""

    def declare(function):
        def step(random, ob, twin):
            if wanted is not None and not wanted(ob, twin):
                return
            seed, names = random.random(), (ob.name, twin.name)
            refused = [_refusal(function, Random(seed), bpy.data.objects[name]) for name in names]
            if bool(refused[0]) != bool(refused[1]):
                raise Differ(f"Blender refused it to one alone: {refused}")

        return on_pair(weight, in_any_mode)(_named(step, function))

    return declare


def _named(step, function):
    step.__name__ = function.__name__
    return step


def _refusal(function, random, ob):
    try:
        function(random, ob)
    except RuntimeError as error:
        return str(error)
    return ""
