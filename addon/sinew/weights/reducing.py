"""Leaves each vertex of a mesh object only so many bones, chosen by how far the vertex moves without the others."""

import copy
import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ..native import sinew_native
from . import editing, reports, solid
from .weight_settings import ReduceSettings

# Returns skinning matrices in world space (F, B, 4, 4) of an armature's bones of these names.
Pose = Callable[[bpy.types.Object, tuple[str, ...]], np.ndarray]


@dataclass(frozen=True)
class Report:
    """How far vertices move with fewer bones, over all poses."""

    objects: tuple[str, ...]  # name of the mesh
    vertices: int  # that were free to change
    changed: int
    most: int  # bones per vertex
    poses: int
    largest: float  # move of a vertex, in world space
    mean: float  # of the vertices that have changed
    tolerance: float
    over: int  # vertices that move farther
    kept: tuple[str, ...]  # names of the locked groups
    is_written: bool

    def sentence(self, length: Callable[[float], str]) -> str:
        """Returns the report for people. length(distance): writes a distance in the scene's unit."""
        vertices, bones = reports.counted(self.vertices, "vertex", "vertices"), reports.counted(self.most, "bone")
        if not self.changed:
            return f"none of {vertices} has more than {bones}"
        did = "reduced to" if self.is_written else "would be reduced to"
        text = f"{self.changed:,} of {vertices} {did} {bones}: "
        text += "they move" if self.is_written else "they would move"
        text += f" by at most {length(self.largest)}, on average {length(self.mean)}, in {self.poses:,} poses"
        if self.tolerance > 0:
            text += f", {self.over:,} by more than {length(self.tolerance)}"
        return text + (f", {reports.counted(len(self.kept), 'locked group')} kept" if self.kept else "")

    def document(self) -> dict[str, Any]:
        """Returns the report for JSON. Lengths are in world space."""
        others = {"over": "over_tolerance", "kept": "locked_groups_kept", "tolerance": "", "is_written": ""}
        return reports.document(self, most="max_influences", largest="largest_move", mean="mean_move", **others)


class Reduction(editing.Edit):
    """Fewer bones per vertex. Locked groups stay, and count."""

    verb, defaults = "reduced", ReduceSettings()

    def __init__(
        self, ob: bpy.types.Object, pose: Pose, settings: ReduceSettings | None = None, free: np.ndarray | None = None
    ) -> None:
        """Reads the object and, by `pose`, the poses in which moves are measured. Raises ValueError."""
        super().__init__(ob, settings, free)
        self._places = solid.world_positions(ob)
        solid.refuse_infinite(ob, self._places)
        self._matrices = np.asarray(pose(self.armature, self.table.names), np.float64)
        self.largest = np.zeros(len(self._places))  # (V,): move of each vertex over the poses, in world space
        self.mean = np.zeros(len(self._places))

    def with_settings(self, settings: ReduceSettings) -> "Reduction":
        """Returns this with other settings, without reading anything again; computed, if only the tolerance is
        different. May be called while it is computed."""
        made = copy.copy(self)
        made.settings = settings
        if dataclasses.replace(settings, tolerance=self.settings.tolerance) != self.settings:
            made.made = None
        return made

    def new_weights(self, progress: Any) -> Any:
        has_faces = bool(len(self.face_vertices))
        made = sinew_native.reduce_weights(
            self.table.weights,
            self._places,
            self._matrices,
            max_influences=self.settings.max_influences,
            rings=self.settings.rings if has_faces else 0,
            face_offsets=self.face_offsets,
            face_vertices=self.face_vertices,
            locked=self.locked,
            progress=progress,
        )
        if made is None:
            return None
        weights, self.largest, self.mean = made
        if self.free is not None:
            for each in (self.largest, self.mean):
                each[~self.free] = 0
        return weights

    def over(self) -> np.ndarray:
        """Returns (V,) bool: the vertices that move farther than the tolerance, if there is one."""
        return (self.largest > self.settings.tolerance) & (self.settings.tolerance > 0)

    def report(self, is_written: bool = False) -> Report:
        return Report(
            (self.ob.name,),
            self.free_count,
            int(np.count_nonzero(self.changed)),
            self.settings.max_influences,
            len(self._matrices),
            float(self.largest.max(initial=0)),
            float(self.mean[self.changed].mean()) if self.changed.any() else 0.0,
            self.settings.tolerance,
            int(self.over().sum()),
            self.table.locked_names,
            is_written,
        )
