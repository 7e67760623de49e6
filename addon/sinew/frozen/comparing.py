"""Compares what is computed of an armature with Blender before anybody sees it: on frames across the scene's range,
which Blender evaluates in a scene of their own, so that nothing that is shown changes."""

import random
from collections.abc import Iterator
from contextlib import contextmanager
from statistics import median
from time import perf_counter
from typing import Any

import bpy

from ..blender import animation, dependencies
from ..host import poses
from ..rig_programs import objects
from . import computing, differences, rigs

NAME = ".Sinew Frames"
MOST_FRAMES = 16  # before a rig is accelerated
SECONDS = 0.1  # after which no other frame is begun


def compare(rig: rigs.Rig, scene: bpy.types.Scene, most_frames: int = MOST_FRAMES) -> bool:
    """Compares a program that was proven on the scene's frame with Blender on others, to the bit. If any differs, there
    is no program. Blender writes the values of an evaluated frame into the originals, so nothing is compared while the
    armature, or what it follows, has been edited without a key, and no other frame if keyframes change anything else
    that it needs. Call it in the main thread, outside an evaluation. Returns whether Blender has evaluated, so that
    freezing.keep_frozen has to follow."""
    source, spent, now = rig.source, [], scene.frame_current
    chain, source.is_compared = dependencies.chain(rig.ob), True
    used = [each for each in dependencies.used([rig.ob], bpy.data.user_map()) if rigs.has_animation(each)]
    if scene.frame_subframe or any(animation.unkeyed_path(each, scene.frame_current_final) for each in (*chain, *used)):
        return False
    source.compared.add(now)
    if not all(isinstance(each, bpy.types.Object) and (each in chain or not objects.why_not(each)) for each in used):
        return False
    lacking = [frame for frame in range(scene.frame_start, scene.frame_end + 1) if frame not in source.compared]
    source.is_compared = not lacking
    if not lacking:
        return False
    with _on_frames(rig.ob) as evaluated_on:
        try:
            evaluated_on(now)  # which builds relations
            began = perf_counter()
            for frame in random.Random().sample(lacking, min(len(lacking), most_frames)):
                moment = computing.moment(rig, frame)
                if moment is None:  # so that Blender would disable a driver
                    return True
                start = perf_counter()
                copy = evaluated_on(frame)
                spent.append(1e3 * (perf_counter() - start))
                if not poses.are_posed([(copy, moment.pose)])[0] and not differences.is_near(rig, copy, frame):
                    sentence = differences.note(rig, differences.Difference.between(rig, copy, frame))
                    rig.source = rigs.Source(refusal=sentence)
                    return True
                source.compared.add(frame)
                if perf_counter() - began > SECONDS:
                    break
        finally:
            evaluated_on(now)
    source.blender_milliseconds = median(spent) if spent else source.blender_milliseconds
    return True


@contextmanager
def _on_frames(ob: bpy.types.Object) -> Iterator[Any]:
    """Gives a function that has Blender evaluate an object on a frame and returns its evaluated copy. Nobody's handlers
    see that."""
    own = bpy.data.scenes.new(NAME)
    layer = own.view_layers[0]

    def evaluated_on(frame: int) -> Any:
        own.frame_current = frame
        layer.update()
        return ob.evaluated_get(layer.depsgraph)

    lists = bpy.app.handlers.depsgraph_update_pre, bpy.app.handlers.depsgraph_update_post
    before = [list(each) for each in lists]
    try:
        for each in lists:
            each.clear()
        own.collection.objects.link(ob)
        yield evaluated_on
    finally:
        for each, handlers in zip(lists, before):
            each[:] = handlers
        bpy.data.scenes.remove(own)
