"""What a bake to bones has made, for people and for other programs."""

from dataclasses import asdict, dataclass
from typing import Any

import bpy

from ..weights.reports import counted


@dataclass(frozen=True)
class Report:
    """The result of a bake. Distances are between what the new mesh plays and the original, over all vertices and
    frames, in Blender's unit."""

    armature: str  # name of the new one
    objects: tuple[str, ...]  # names of the new meshes
    sources: tuple[str, ...]  # names of the originals
    vertices: int
    bones: int
    frames: str  # as in FrameRange
    frame_count: int
    mean: float
    rms: float  # the root of the mean square
    largest: float
    iterations: int
    seconds: float

    def sentence(self) -> str:
        """Returns the report for people, with distances in the scene's unit."""
        counts = (
            counted(self.vertices, "vertex", "vertices"),
            counted(self.bones, "bone"),
            counted(self.frame_count, "frame"),
        )
        off = f"off by {length(self.mean)} on average, {length(self.largest)} at most"
        return f"{', '.join(self.sources)}: {', '.join(counts)}; {off}; {self.seconds:.1f} s"

    def document(self) -> dict[str, Any]:
        """Returns the report for JSON."""
        return {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(self).items()} | {
            "unit_scale": bpy.context.scene.unit_settings.scale_length
        }


def length(distance: float) -> str:
    """Returns a distance of the scene as Blender shows lengths, with three digits."""
    unit = bpy.context.scene.unit_settings
    if unit.system == "NONE":
        return f"{distance:.3g}"
    value = distance * unit.scale_length
    units = METRIC if unit.system == "METRIC" else IMPERIAL
    name, size = next((each for each in units if value >= each[1]), units[-1])
    return f"{value / size:.3g} {name}"


METRIC = (("km", 1e3), ("m", 1.0), ("cm", 1e-2), ("mm", 1e-3), ("µm", 1e-6))
IMPERIAL = (("mi", 1609.344), ("ft", 0.3048), ("in", 0.0254), ("thou", 2.54e-5))
