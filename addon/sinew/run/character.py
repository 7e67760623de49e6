"""One bound mesh at run time: its plan, its status, and what its graph copies share. Nothing of it is saved.

The .blend holds everything; this is a cache. What was read belongs to the evaluated object of which it was read
(graph_copies.py).
"""

import threading
from collections import deque
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import bpy
import numpy as np

from ..chain import methods, stages
from ..host import modifier_memory
from ..plan import plans, runs, ways
from . import graph_copies, switching
from .graph_copies import GraphCopy
from .mesh_reading import Shared
from .planning import Planning

RECENT_FRAMES = 10  # whose times are shown
MOST_SKIPPED = 32  # evaluations, after many failures in a row
# Modes in which Blender's tools do not need to know which vertex of the mesh one of the result was made from. Where all
# of the result is a canvas's, only Blender's own modifiers tell them.
WITHOUT_INDICES = {"OBJECT", "POSE"}


class Times(NamedTuple):
    """Milliseconds of a frame."""

    pose: float
    skin: float  # with shape keys
    stages: tuple[float, ...]  # of each modifier of the run after the armature

    @property
    def total(self) -> float:
        return self.pose + self.skin + sum(self.stages)


class Timings:
    """Milliseconds of the last frames since an edit, without those on which something was built."""

    def __init__(self) -> None:
        self._frames: deque[np.ndarray] = deque(maxlen=RECENT_FRAMES)  # (S + 2,) each

    def add(self, numbers: np.ndarray) -> None:
        """Copies the times of a frame, (S + 2,): of the pose, of keys and skinning, and of each of S stages."""
        if self._frames and len(self._frames[-1]) != len(numbers):
            self.forget()
        self._frames.append(numbers.copy())

    def forget(self) -> None:
        self._frames.clear()

    @property
    def last(self) -> Times:
        """The times of the last frame; zeros if there was none."""
        return self._times(self._frames[-1]) if self._frames else Times(0.0, 0.0, ())

    def recent(self) -> Times | None:
        """Returns the medians of the last frames, or None."""
        frames = list(self._frames)
        return self._times(np.median(frames, axis=0)) if frames and len({len(f) for f in frames}) == 1 else None

    @staticmethod
    def _times(numbers: np.ndarray) -> Times:
        pose, skin, *stages = numbers.tolist()
        return Times(pose, skin, tuple(stages))


@dataclass
class Status:
    """Of one bound mesh."""

    error: str = ""  # a sentence; "" after a frame without an error
    failures: int = 0  # evaluations in a row that have failed
    to_skip: int = 0  # evaluations that leave the mesh to Blender before the next try
    timings: Timings = field(default_factory=Timings)
    is_copy_known: bool = False  # the deformed copy has been compared with the mesh
    copy_stays: bool = False  # the last evaluation had no shape for the deformed copy

    def note_failure(self) -> None:
        """Notes that an evaluation has failed. The more have failed in a row, the more are skipped."""
        self.failures += 1
        self.to_skip = min(2**self.failures, MOST_SKIPPED)

    def note_success(self) -> None:
        """Notes that an evaluation has not failed, or that something was edited."""
        self.error, self.failures, self.to_skip = "", 0, 0

    def skips(self) -> bool:
        """Whether to skip this evaluation. Counts."""
        self.to_skip = max(self.to_skip - 1, 0)
        return self.to_skip > 0


class Character:
    """One bound mesh."""

    def __init__(self, key: int, name: tuple[str, str | None]) -> None:
        """key: of its object; name: of its object, and the path of its library."""
        self.key, self.name = key, name
        self.planning = Planning(key)
        self.status = Status()
        self.edition = 0  # of the mesh that was last read, see reading.Reading
        self.shared = Shared()
        self.kept = methods.Kept()  # what the method has precomputed
        self.edited_to: int | None = None  # tells the vertices that its own mesh had after the last edit, see bind.py
        self.lock = threading.RLock()

    # --- its plan ---------------------------------------------------------------------------------

    @property
    def plan(self) -> plans.Plan:
        return self.planning.plan

    @property
    def way(self) -> ways.Way:
        return self.plan.way

    @property
    def is_wired(self) -> bool:
        return self.plan.is_wired

    @property
    def taken(self) -> tuple[str, ...]:
        return self.plan.taken

    @property
    def run(self) -> runs.Run:
        return self.plan.run

    def stage_names(self, ob: bpy.types.Object) -> tuple[str, ...]:
        """Returns the names of the stages after skinning that the last evaluation had."""
        last = self.last
        return last.chain.stage_names(ob) if last is not None and last.is_deforming else stages.names(ob, self.run)

    def look(self, ob: bpy.types.Object) -> plans.Plan:
        """Makes a plan for the object, original or evaluated, and returns it."""
        with self.lock:
            return self.planning.look(ob)

    def look_again(self) -> None:
        """Has the next evaluation make a new plan. The caller has Blender evaluate."""
        self.planning.look_again()
        self.status.note_success()

    def may_work(self, plan: plans.Plan, ob: bpy.types.Object) -> bool:
        """Whether Sinew deforms an evaluated object that has such a plan, if any modifier that it replaces is on."""
        if plan.way.takes_all and ob.mode not in WITHOUT_INDICES:
            return False
        return plan.is_wired and not switching.stands_aside() and modifier_memory.can_put_aside()

    # --- its evaluated copies ---------------------------------------------------------------------

    def copy_of(self, ob: bpy.types.Object) -> GraphCopy:
        """Returns what is known of that evaluated object; new if there is nothing. From any thread."""
        return graph_copies.of(self, ob)

    @property
    def last(self) -> GraphCopy | None:
        """What is known of the evaluated copy that was evaluated last, or None."""
        return next(reversed(graph_copies.of_mesh(self)), None)

    @property
    def layers(self) -> list:
        return self.last.chain.first.layers if self.last else []

    @property
    def deformer(self) -> Any:
        return self.last and self.last.chain.deformer

    @property
    def keys(self) -> Any:
        return self.last and self.last.reading.keys

    @property
    def method(self) -> methods.Method:
        return self.last.reading.method if self.last else methods.Method()

    @property
    def is_deforming(self) -> bool:
        """Whether Sinew deformed the mesh in its last evaluation."""
        return self.last is not None and self.last.is_deforming
