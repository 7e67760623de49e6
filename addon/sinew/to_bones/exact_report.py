"""What an exact bake to bones has made, for people and for other programs."""

from dataclasses import asdict, dataclass
from typing import Any

from ..weights.reports import counted
from .report import length

SHOWN = 3  # bones


@dataclass(frozen=True)
class Baked:
    """One action of the rig, and that of the skeleton."""

    name: str  # of the rig's, and of the NLA track
    action: str  # name of the skeleton's
    first: int
    last: int
    frame_count: int


@dataclass(frozen=True)
class ExactReport:
    """The result. Distances are those between where a bone is and where the rig's is, of its head and of points one
    bone's length away, the largest over all frames, in the rig's space and Blender's unit."""

    armature: str
    rig: str
    objects: tuple[str, ...]  # names of the copied meshes
    bones: int
    actions: tuple[Baked, ...]
    sheared: dict[str, float]  # how far the bones are off that are, the worst first
    largest: float  # of all bones, with the keyframes that are kept
    kept: float  # the share of the keyframes that is; 1: one on each frame
    evaluated: str  # why Blender evaluated the rig, which is slower; "": it was computed
    seconds: float

    def sentence(self) -> str:
        """Returns the report for people, with distances in the scene's unit."""
        frames = sum(each.frame_count for each in self.actions)
        counts = (counted(self.bones, "bone"), counted(len(self.actions), "action"), counted(frames, "frame"))
        names = list(self.sheared)
        more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
        off = f"{', '.join(names[:SHOWN])}{more} cannot be keyed exactly, off by {length(self.largest)} at most"
        reduced = f"{self.kept:.0%} of the keyframes, off by {length(self.largest)} at most"
        parts = [f"{self.rig}: {', '.join(counts)}"]
        parts += [off] * bool(names) + [reduced] * (self.kept < 1) or ["exact"]
        if self.evaluated:
            parts.append(f"Blender evaluated the rig, which is slower: {self.evaluated}")
        return "; ".join([*parts, f"{self.seconds:.1f} s"])

    def document(self) -> dict[str, Any]:
        """Returns the report for JSON."""
        return asdict(self)
