"""Compares what is computed of an armature with Blender before anybody sees it: on frames across the scene's range,
which Blender evaluates elsewhere."""

import random
from collections.abc import Iterator
from itertools import islice
from statistics import median
from time import perf_counter

import bpy

from ..blender import dependencies
from ..description import objects
from ..host import evaluations, poses
from . import changes, computing, differences, elsewhere, rigs

MOST_FRAMES = 16  # before a rig is accelerated
SECONDS = 0.1  # after which no other frame is begun


def lacking(frames: range, compared: set[int]) -> Iterator[int]:
    """Yields the frames that were not compared, in random order. A scene may have a million, so what is not asked for
    takes no time."""
    chance = random.Random()
    if 2 * len(compared) > len(frames):  # to compare these has taken longer than to list the others
        left = [frame for frame in frames if frame not in compared]
        yield from chance.sample(left, len(left))
        return
    moved: dict[int, int] = {}  # of a list of all frames that is shuffled while it is read: what was put elsewhere
    for place in range(len(frames)):
        other = chance.randrange(place, len(frames))
        frame = frames[moved.get(other, other)]
        moved[other] = moved.get(place, place)
        if frame not in compared:
            yield frame


def _is_known(block: bpy.types.ID) -> bool:
    """Whether keyframes of a data-block say where it is, and nothing else does."""
    return isinstance(block, bpy.types.Object) and not objects.why_not(block)


def compare(rig: rigs.Rig, scene: bpy.types.Scene, most_frames: int | None = MOST_FRAMES) -> bool:
    """Compares a program that was proven on the scene's frame with Blender on others, to the bit. If any differs, there
    is no program. Nothing is compared while the armature, or what it follows, has been edited without a key, and no
    other frame if keyframes change anything else that it needs. most_frames: None for all for which there is time.
    Call it in the main thread, outside an evaluation. Returns whether Blender has evaluated, so that
    states.keep_played has to follow."""
    if evaluations.is_job_running():  # which would see the originals on other frames
        return False
    old, new = changes.tempo_of(scene)
    if old != new:  # since the program was read
        changes.drop_all(rig)
        return False
    source, chain = rig.source, dependencies.chain(rig.ob)
    used = elsewhere.animated(chain, scene)
    source.is_compared = True
    if used is None:
        return False
    source.compared.add(scene.frame_current)
    paths = {each.data for each in source.moving if each.type == "CURVE"}
    known = {*paths, *source.data.owners, *chain}
    if not all(each in known or _is_known(each) for each in used):
        return False
    if dependencies.actions_of_lists(block for each in chain for block in dependencies.data_read_by(each)):
        return False  # a scene's, which Blender evaluates only in its own graph
    frames = range(scene.frame_start, scene.frame_end + 1)
    source.is_compared = next(lacking(frames, source.compared), None) is None
    if source.is_compared:
        return False
    own_spent, blender_spent = [], []
    with elsewhere.on_frames([rig.ob], scene) as evaluated_on:
        began = perf_counter()
        for frame in islice(lacking(frames, source.compared), most_frames):
            start = perf_counter()
            moment = computing.moment(rig, frame)
            own_spent.append(1e3 * (perf_counter() - start))
            if moment is None:  # so that Blender would disable a driver
                return True
            start = perf_counter()
            graph = evaluated_on(frame)
            if rigs.is_hidden(rig, graph):
                source.is_compared = True
                return True
            copy = rig.ob.evaluated_get(graph)
            blender_spent.append(1e3 * (perf_counter() - start))
            is_same = poses.are_posed([(copy, moment.pose)])[0] and rigs.is_placed(rig, graph, moment)
            if not is_same and not differences.is_near(rig, copy, frame):
                sentence = differences.note(rig, differences.Difference.between(rig, copy, frame))
                rig.source = rigs.Source(refusal=sentence)
                return True
            source.compared.add(frame)
            if perf_counter() - began > SECONDS:
                break
    source.milliseconds, source.blender_milliseconds = median(own_spent), median(blender_spent)
    return True
