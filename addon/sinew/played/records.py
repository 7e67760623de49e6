"""The recorded poses of all armatures, within a limit of memory. Does not use Blender."""

from collections import OrderedDict
from typing import Any

MEGABYTE = 2**20


class Record:
    """The poses of one armature, by frame."""

    def __init__(self, store: "Store") -> None:
        self._store = store
        self._poses: dict[int, Any] = {}

    def __len__(self) -> int:
        return len(self._poses)

    def __contains__(self, frame: object) -> bool:
        return frame in self._poses

    def at(self, frame: float) -> Any:
        """Returns what was put at a frame, or None. Between two whole frames there is none."""
        return self._poses.get(int(frame)) if frame == int(frame) else None

    def put(self, frame: int, pose: Any) -> None:
        """Keeps a pose, which has `nbytes`. If there is no room, the oldest poses of all armatures are dropped."""
        self.drop_frame(frame)
        self._poses[frame] = pose
        self._store.note(self, frame, pose.nbytes)

    def drop_frame(self, frame: int) -> None:
        if self._poses.pop(frame, None) is not None:
            self._store.forget(self, frame)

    def clear(self) -> None:
        for frame in list(self._poses):
            self.drop_frame(frame)

    def runs(self) -> list[tuple[int, int]]:
        """Returns (first, last) of each run of recorded frames, in order."""
        found: list[list[int]] = []
        for frame in sorted(self._poses):
            if found and found[-1][1] == frame - 1:
                found[-1][1] = frame
            else:
                found.append([frame, frame])
        return [(first, last) for first, last in found]

    @property
    def nbytes(self) -> int:
        return sum(pose.nbytes for pose in self._poses.values())


class Store:
    """How much memory all records need together."""

    def __init__(self, limit: int) -> None:
        """limit: in bytes."""
        self._sizes: OrderedDict[tuple[int, int], tuple[Record, int]] = (
            OrderedDict()
        )  # by record and frame, oldest first
        self.used, self.limit = 0, limit

    def note(self, record: Record, frame: int, size: int) -> None:
        """Counts a new pose, and drops the oldest ones if there are too many."""
        self._sizes[id(record), frame] = record, size
        self.used += size
        while self.used > self.limit and self._sizes:
            (_, oldest), (owner, _) = next(iter(self._sizes.items()))
            owner.drop_frame(oldest)

    def forget(self, record: Record, frame: int) -> None:
        self.used -= self._sizes.pop((id(record), frame))[1]

    def set_limit(self, limit: int) -> None:
        """Changes the limit, in bytes, at once."""
        self.limit = limit
        while self.used > self.limit and self._sizes:
            (_, oldest), (owner, _) = next(iter(self._sizes.items()))
            owner.drop_frame(oldest)
