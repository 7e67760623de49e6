"""Inside of Blender: walks, and says what it does.

blender -b --python-exit-code 1 --python tests/blender/walk/run.py -- --seed S (--steps N | --only 3,17) [--without ...]

Step n belongs to walk n // LENGTH, which begins in a scene of its own. Both depend on nothing but the seed and these
numbers. The exit code is 1 after a step behind which something does not hold, and 2 if the walk itself is at fault.
"""

import logging
import sys
import time
import traceback
from itertools import groupby
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import bpy

from walk import (
    animated_steps,
    compare,
    kinds,
    mesh_steps,
    modifier_steps,
    object_steps,
    played_steps,
    rig_steps,
    scene,
    scene_steps,
    sinew_steps,
    weight_steps,
)
from walk.shrink import LENGTH, options_of

STEPS = (
    animated_steps,
    played_steps,
    mesh_steps,
    modifier_steps,
    object_steps,
    rig_steps,
    scene_steps,
    sinew_steps,
    weight_steps,
)  # importing them declares the kinds


REFUSALS = ("cannot use the output Mesh",)  # sentences for people


class Listener(logging.Handler):
    """Keeps what Sinew logs, and the tracebacks that Blender prints."""

    def __init__(self):
        super().__init__()
        self.logged, self.printed, self._stderr = [], "", sys.stderr
        logging.getLogger("sinew").addHandler(self)
        sys.stderr = self

    def emit(self, record):
        trace = "".join(traceback.format_exception(*record.exc_info)) if record.exc_info else ""
        if not any(refusal in record.getMessage() for refusal in REFUSALS):
            self.logged.append(record.getMessage() + "\n" + trace)

    def write(self, text):
        self._stderr.write(text)
        if self.printed or "Traceback" in text:
            self.printed += text

    def flush(self):
        self._stderr.flush()

    def said(self):
        """All that is Sinew's."""
        return "".join(self.logged) + (self.printed if "sinew" in self.printed else "")


def walk(seed, number, steps, without, listener):
    """steps: numbers, in their order; without: names of kinds that are left out."""
    begin = Random(f"{seed} scene {number}")
    scene.new_scene(begin)
    if begin.random() < 0.7:
        sinew_steps.bind_all(begin)
    scene.take_keyframes()  # or the step has values that these would replace
    bpy.ops.ed.undo_push(message="start")
    for step in steps:
        random = Random(f"{seed} step {step}")
        chosen = kinds.choose(random)
        if chosen.__name__ in without:
            continue
        print(f"walk: step {step}: {chosen.__name__}", flush=True)
        played_steps.count_step()
        what = chosen(random)
        print(f"walk:   {what or ''}", flush=True)
        look(listener, Random(f"{seed} look {step}"))
        if chosen not in (scene_steps.undo, scene_steps.redo):
            scene_steps.note_step(step)
            bpy.ops.ed.undo_push(message=chosen.__name__)
            look(listener, Random(f"{seed} look again {step}"))
    unbind_all()
    look(listener, Random(f"{seed} end {number}"))
    compare.assert_given_back()


def look(listener, random):
    """At once, when Sinew has had its mail, and at times when nobody has done anything for a while. What is played is
    not always compared, which has Blender build it anew."""
    bpy.context.view_layer.update()
    if not compare.is_mix_split():
        compare.assert_alike()
    compare.addon_module("main.handlers").look_into_the_mail()  # as a timer does in a window
    bpy.context.view_layer.update()
    compare.assert_alike()
    compare.addon_module("main.handlers").look_into_the_mail()
    compare.assert_copies_follow()
    if random.random() < 0.3:
        compare.assert_bones_are_awaited()
    if random.random() < 0.6:
        played_steps.wait()
    if random.random() < 0.6:
        played_steps.assert_played_as_live()
    compare.assert_alike()
    assert not listener.said(), "it was said: " + listener.said()


def unbind_all():
    scene.leave_modes()
    for ob in [ob for ob in bpy.data.objects if ob.type == "MESH" and ob.sinew.is_bound]:
        compare.addon_module("install.bind").unbind(ob)


def main():
    options = options_of(sys.argv[sys.argv.index("--") + 1 :])
    steps = options.only or range(options.steps)
    listener, start = Listener(), time.time()
    for number, part in groupby(steps, lambda step: step // LENGTH):
        walk(options.seed, number, part, options.without, listener)
    undone = scene_steps.undone
    print(f"walk: {undone['did something']} of {undone['asked for']} undos and redos did something", flush=True)
    began = played_steps.began
    print(f"walk: {began['with an accelerated rig']} of {began['all']} steps began with an accelerated rig", flush=True)
    print(f"walk: rigs {dict(played_steps.looked_at)}, paths {dict(compare.paths)}", flush=True)
    print(f"walk: {len(steps)} steps, seed {options.seed}, {time.time() - start:.0f} s, nothing found", flush=True)


if __name__ == "__main__":
    try:
        main()
    except (AssertionError, kinds.Differ) as error:
        print(f"walk: FAILED: {error}", flush=True)
        sys.exit(1)
