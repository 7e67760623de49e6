"""Compares what is computed of an armature with Blender before anybody sees it: on frames across the scene's range,
which Blender evaluates in a scene of their own, so that nothing that is shown changes."""

import random
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from statistics import median
from time import perf_counter
from typing import Any

import bpy
import numpy as np

from ..blender import animation, dependencies
from ..host import poses
from ..rig_programs import checking, driven_keys, reading
from . import computing, rigs

NAME = ".Sinew Frames"
MOST_FRAMES = 16
SECONDS = 0.1  # after which no other frame is begun


@dataclass
class Difference:
    """A frame on which Blender's bones are others than those that were computed."""

    frame: float
    blender: np.ndarray  # (B, 4, 4) float32, the poses of all bones
    computed: np.ndarray

    @classmethod
    def between(cls, rig: rigs.Rig, copy: bpy.types.Object, frame: float) -> "Difference":
        """copy: evaluated on that frame."""
        computed = rig.source.program.evaluate(np.array([frame], np.float32))[0]
        return cls(frame, checking.matrices_of(copy.pose.bones), computed)

    def sentence(self, ob: bpy.types.Object) -> str:
        far = checking.distances(self.computed, self.blender)
        bone = int((far > 0).argmax())  # the first, which others follow
        if not far[bone]:
            return f"on frame {self.frame:g}, channels or B-bones of {ob.name} are not those that were computed"
        row, column = divmod(int(np.abs(self.computed[bone] - self.blender[bone]).argmax()), 4)
        numbers = f"{self.computed[bone, row, column]:.9g} instead of {self.blender[bone, row, column]:.9g}"
        return f"on frame {self.frame:g}, {ob.pose.bones[bone].name} of {ob.name} would have {numbers} in its matrix"


def compare(rig: rigs.Rig, scene: bpy.types.Scene) -> bool:
    """Compares a program that was proven on the scene's frame with Blender on others, to the bit. If any differs, there
    is no program. Blender writes the values of an evaluated frame into the originals, so nothing is compared while the
    armature has been edited without a key, and no other frame if keyframes move anything else that it needs. Call it in
    the main thread, outside an evaluation. Returns whether Blender has evaluated, so that freezing.keep_frozen has to
    follow."""
    source, spent, now = rig.source, [], scene.frame_current
    if scene.frame_subframe or animation.unkeyed_path(rig.ob, scene.frame_current_final):
        return False
    source.compared.add(now)
    if any(rigs.has_animation(each) for each in dependencies.used([rig.ob], bpy.data.user_map()) if each != rig.ob):
        return False
    with _on_frames(rig.ob) as evaluated_on:
        try:
            evaluated_on(now)  # which builds relations
            began = perf_counter()
            for frame in _some(scene):
                moment = computing.moment(rig, frame)
                if moment is None:  # so that Blender would disable a driver
                    return True
                start = perf_counter()
                copy = evaluated_on(frame)
                spent.append(1e3 * (perf_counter() - start))
                if not poses.are_posed([(copy, moment.pose)])[0]:
                    rig.difference = Difference.between(rig, copy, frame)
                    rig.source = rigs.Source(refusal=rig.difference.sentence(rig.ob))
                    return True
                source.compared.add(frame)
                if perf_counter() - began > SECONDS:
                    break
        finally:
            evaluated_on(now)
    source.blender_milliseconds = median(spent)
    return True


def _some(scene: bpy.types.Scene) -> list[int]:
    """Returns some frames of the scene's range, in a random order."""
    frames = range(scene.frame_start, scene.frame_end + 1)
    return random.Random().sample(frames, min(len(frames), MOST_FRAMES))


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


def report(rig: rigs.Rig, graph: Any) -> dict[str, Any]:
    """Returns all that is needed to find out why an armature differs, for JSON: its description, and both poses."""
    keyed, found = rigs.keyed(rig, graph), rig.difference
    return {
        "description": reading.read(rig.ob, graph, keyed).description,
        "driven keys": list(map(driven_keys.path_of, range(sum(len(numbers) for _keys, numbers in keyed)))),
        "frame": found.frame,
        "blender": found.blender.tolist(),
        "computed": found.computed.tolist(),
    }
