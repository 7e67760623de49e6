"""The poses of a rig on frames: computed by its program, or else by evaluating the scene."""

from collections.abc import Generator, Sequence
from typing import Any

import bpy
import numpy as np

from ..description import driver_rows, equality, reading
from ..native import sinew_native
from ..played import followers, leading


class Poses:
    """Of one rig, of which nothing but the action changes from one call to the next. `why`: why its program is not
    used, a sentence; "" if it is."""

    def __init__(self, context: Any, rig: bpy.types.Object, has_segments: bool) -> None:
        """has_segments: whether the ends of B-bones' segments are wanted, too."""
        self._context, self._rig, self._has_segments = context, rig, has_segments
        self._is_proven = False
        self._read: Any = None
        self._others: list[Any] = []  # rows of curves that are not the rig's own
        self.why = ""

    def steps(
        self, frames: Sequence[int], text: str
    ) -> Generator[tuple[float, str], None, tuple[np.ndarray, np.ndarray]]:
        """Yields (share done, text), and returns the bones' poses (F, B, 4, 4) and the ends of segments (F, S, 4, 4),
        each relative to its bone; both have the same bits either way. The scene's frame may change. Raises ValueError
        if Blender does not evaluate the rig."""
        program = None if self.why else self._program()
        if program is not None and not self._is_proven:
            self._prove(program, frames[len(frames) // 2])
        if program is None or self.why:
            return (yield from self._evaluated(frames, text))
        times = np.array(frames, np.float32)
        yield 0.0, text
        try:
            poses = program.evaluate(times)
            ends = program.segments(times) if self._has_segments else _no_segments(len(frames))
        except ValueError as reason:
            self.why = str(reason)
            return (yield from self._evaluated(frames, text))
        return poses, ends

    def _program(self) -> Any:
        """Returns the program of the rig, or None, and then `why` says why there is none."""
        scene, graph = self._context.scene, self._context.view_layer.depsgraph
        try:
            if scene.render.frame_map_old != scene.render.frame_map_new:
                raise ValueError(f"{scene.name} maps its frames to other times")
            followers.check_place(self._rig)
            if self._read is None:
                self._read = reading.read(self._rig, graph)
                leaders = leading.leaders_of(self._rig, self._read.targets, self._read.outside, graph)
                if leaders:
                    raise ValueError(f"{self._rig.name} follows {leaders[0].rig.name}")
                own = len(list(driver_rows.curves_of(self._rig, self._read.targets)))
                self._others = self._read.description["curves"][own:]
            else:  # only the action is another one
                own_rows = driver_rows.curves_of(self._rig, self._read.targets)
                self._read.description["curves"] = [*own_rows, *self._others]
            return sinew_native.RigProgram(self._read.description, keep_description=False)
        except ValueError as reason:
            self.why = str(reason)
            return None

    def _prove(self, program: Any, frame: int) -> None:
        """Compares the program with Blender on a frame, or sets `why`."""
        bones, _ends = self._at(frame)
        far = equality.distances(program.evaluate(np.array([frame], np.float32))[0], bones)
        self._is_proven = not far.any()
        if not self._is_proven:
            self.why = f"{program.names[int(far.argmax())]} was computed differently by up to {far.max():.3g}"

    def _evaluated(self, frames, text):
        found = []
        for number, frame in enumerate(frames):
            yield number / len(frames), text
            found.append(self._at(frame))
        poses, ends = zip(*found)
        return np.array(poses), np.array(ends)

    def _at(self, frame):
        self._context.scene.frame_set(frame)
        evaluated = self._rig.evaluated_get(self._context.evaluated_depsgraph_get())
        if not evaluated.is_evaluated:
            raise ValueError(
                f"{self._rig.name} is hidden in the viewport, so Blender does not evaluate it: show it first"
            )
        bones = evaluated.pose.bones
        ends = equality.segments_of(bones) if self._has_segments else _no_segments(1)[0]
        return equality.matrices_of(bones), ends


def _no_segments(frames):
    return np.empty((frames, 0, 4, 4), np.float32)
