"""What the panel and the command line show of a bound mesh: its last error and what its frames cost."""

from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

RECENT_FRAMES = 10  # whose times are shown


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


MOST_SKIPPED = 32  # evaluations, after many failures in a row


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
