"""The poses of a rig on frames: computed by its program, or else by evaluating the scene."""

from collections.abc import Generator, Sequence
from typing import Any

import bpy
import numpy as np

from ..description import curves as action_curves
from ..description import driver_rows, equality, reading, targets
from ..native import sinew_native
from ..played import followers, leading
from .rig_actions import RigAction


class Poses:
    """Of one rig, of which nothing but the action changes from one call to the next. `why`: why its program is not
    used, a sentence; "" if it is."""

    def __init__(self, context: Any, rig: bpy.types.Object, has_segments: bool, own: Sequence[RigAction]) -> None:
        """has_segments: whether the ends of B-bones' segments are wanted, too. own: the actions that it will play; if
        there are none, it plays what the scene has it play."""
        self._context, self._rig, self._has_segments, self._own = context, rig, has_segments, own
        self._program: Any = None  # with the bones at rest, if there are actions
        self._rows: dict[int, list[Any]] = {}  # of the curves of each action, by its place
        self._refused: dict[int, list[str]] = {}  # why an action, by its place, is not computed
        self._is_proven = False
        self.why = ""

    def steps(
        self, frames: Sequence[int], text: str, place: int
    ) -> Generator[tuple[float, str], None, tuple[np.ndarray, np.ndarray]]:
        """Yields (share done, text), and returns the bones' poses (F, B, 4, 4) and the ends of segments (F, S, 4, 4),
        each relative to its bone; both have the same bits either way. place: of the action that the rig has just begun
        to play. The scene's frame may change. Raises ValueError if Blender does not evaluate the rig."""
        times = np.array(frames, np.float32)
        try:
            program = self._program_of(place, frames[len(frames) // 2])
            yield 0.0, text
            poses = program.evaluate(times)
            ends = program.segments(times) if self._has_segments else _no_segments(len(frames))
        except ValueError as reason:
            self.why = self.why or str(reason)
            return (yield from self._evaluated(frames, text))
        return poses, ends

    def _program_of(self, place: int, frame: int) -> Any:
        """Returns the program of the rig with an action. frame: on which the first is compared with Blender. Raises
        ValueError, of each action again if the rig has no program."""
        if self._program is None:
            self._program = self._read()
        if refused := self._refused.get(place):
            raise ValueError(refused[0])
        program = self._program.edited({}, self._rows[place]) if self._own else self._program
        if not self._is_proven:
            self._prove(program, frame)
        return program

    def _read(self) -> Any:
        """Returns the program of the rig, in which each number that an action keys is as it is now and follows a curve,
        so that no other action needs another program. Raises ValueError if there is none."""
        scene, graph = self._context.scene, self._context.view_layer.depsgraph
        if scene.render.frame_map_old != scene.render.frame_map_new:
            raise ValueError(f"{scene.name} maps its frames to other times")
        followers.check_place(self._rig)
        read = reading.read(self._rig, graph)
        leaders = leading.leaders_of(self._rig, read.targets, read.outside, graph)
        if leaders:
            raise ValueError(f"{self._rig.name} follows {leaders[0].rig.name}")
        description = read.description
        for place, each in enumerate(self._own):
            self._rows[place], self._refused[place] = self._rows_of(each, read.targets)
        refused = {each for own in self._refused.values() for each in own}  # by the action that plays
        description["refused"] = [each for each in description["refused"] if each not in refused]
        keyed = dict.fromkeys((row["path"], row["index"]) for rows in self._rows.values() for row in rows)
        if keyed:
            others = [row for row in description["curves"] if (row["path"], row["index"]) not in keyed]
            plain = sinew_native.RigProgram(description | {"curves": others}, keep_description=False)
            counts = plain.paths
            names = [f"{path}[{index}]" if counts.get(path) != 1 else path for path, index in keyed]
            numbers = plain.values(np.zeros(1, np.float32), names)[0].tolist()
            at_rest = [
                {"path": path, "index": index, "keys": [[0, 0, 0, number, *7 * [0]]]}
                for (path, index), number in zip(keyed, numbers)
            ]
            description["curves"] = [*at_rest, *others]
        return sinew_native.RigProgram(description, keep_description=False)

    def _rows_of(self, each: RigAction, found: targets.Targets) -> tuple[list[Any], list[str]]:
        """Returns the rows of an action's curves, up to one that is refused, and why it is not computed."""
        known, rows = len(found.refused), []
        try:
            curves = action_curves.that_set_anything(self._rig, action_curves.of_slot(*each.played))
            for row in driver_rows.rows_of(self._rig, curves, "", found):
                rows.append(row)
        except ValueError as reason:
            found.refused.append(str(reason))
        refused = found.refused[known:]
        del found.refused[known:]
        return rows, refused

    def _prove(self, program: Any, frame: int) -> None:
        """Compares the program with Blender on a frame. Raises ValueError."""
        bones, _ends = self._at(frame)
        far = equality.distances(program.evaluate(np.array([frame], np.float32))[0], bones)
        if far.any():
            reason = f"{program.names[int(far.argmax())]} was computed differently by up to {far.max():.3g}"
            self._refused = dict.fromkeys(self._rows, [reason])
            raise ValueError(reason)
        self._is_proven = True

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
