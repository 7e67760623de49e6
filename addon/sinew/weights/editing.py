"""Smooths and mirrors the weights of a mesh object in the bones of its armature."""

import dataclasses
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ..blender import meshes
from ..native import sinew_native
from . import mirrored_bones, reports, table
from .weight_settings import MirrorSettings, SmoothSettings


@dataclass(frozen=True)
class Report:
    """What an edit has changed."""

    objects: tuple[str, ...]  # name of the mesh
    verb: str  # "smoothed"
    vertices: int  # that were free to change
    changed: int
    kept: tuple[str, ...]  # names of the locked groups
    unpaired: tuple[str, ...] = ()  # bones of one side that lack the other

    def sentence(self) -> str:
        """Returns the report for people."""
        parts = [f"{self.changed:,} of {reports.counted(self.vertices, 'vertex', 'vertices')} {self.verb}"]
        if self.unpaired:
            named = ", ".join(self.unpaired[:3]) + (", ..." if len(self.unpaired) > 3 else "")
            parts.append(f"{reports.counted(len(self.unpaired), 'bone')} without a bone on the other side ({named})")
        if self.kept:
            parts.append(f"{reports.counted(len(self.kept), 'locked group')} kept")
        return ", ".join(parts)

    def document(self) -> dict[str, Any]:
        """Returns the report for JSON."""
        return reports.document(self, verb="", kept="locked_groups_kept", unpaired="bones_without_pair")


class Edit:
    """New weights of a mesh object. It is made and written in the main thread; in between, `compute` may run in any
    thread, because it does not touch Blender's data."""

    verb = ""
    defaults: Any = None  # settings
    needs_faces = ""  # why; "": it does not

    def __init__(self, ob: bpy.types.Object, settings: Any = None, free: np.ndarray | None = None) -> None:
        """Reads the object. settings: of the tool; None: its defaults. free: (V,) bool, the vertices that may change;
        None: all. Raises ValueError."""
        table.refuse(ob)
        self.ob, self.armature, self.settings = ob, table.armature_of(ob), settings or self.defaults
        if free is not None and not free.any():
            raise ValueError("no vertex is selected: select those whose weights to change, or turn the mask off")
        self.free = free
        bones = table.deforming(self.armature)
        names = table.used_names(ob, bones)
        if not names:
            raise ValueError(
                f"no vertex of {ob.name} has weight in a deforming bone of {self.armature.name}: make weights first"
            )
        self.positions = table.own_positions(ob)
        self._edges, self.face_offsets, self.face_vertices = meshes.read_topology(ob.data)
        self.table = table.read(ob, self.columns(names, bones))
        if self.table.locked.all():
            raise ValueError(f"all vertex groups of {ob.name} that move it are locked: unlock some")
        if self.needs_faces and not len(self.face_vertices):
            raise ValueError(f"{ob.name} has no faces, {self.needs_faces}")
        self.locked = np.flatnonzero(self.table.locked).astype(np.int32)
        self.made: Any = None  # a sinew_native.WeightTable, once it is computed
        self.changed: Any = None  # (V,) bool

    def columns(self, names: tuple[str, ...], _bones: tuple[str, ...]) -> tuple[str, ...]:
        """Returns the bones that get columns. names: those with weight; bones: all that deform."""
        return names

    def compute(self, progress: Any = None) -> bool:
        """Computes the weights. progress: a sinew_native.Progress. Returns False if it was cancelled: there is nothing
        to write."""
        made = self.new_weights(progress)
        if made is not None:
            made, self.changed = table.held(self.table, made, self.free)
            self.made = made  # the last, because it tells other threads that all is there
        return made is not None

    def new_weights(self, progress: Any) -> Any:
        """Returns a sinew_native.WeightTable, or None if it was cancelled."""
        raise NotImplementedError

    def write(self) -> Any:
        """Writes what was computed. Returns the report."""
        table.write(self.ob, self.table, self.made, self.changed)
        reports.forget()  # it is about the weights of before
        return self.report(is_written=True)

    def report(self, is_written: bool = False) -> Any:
        """Returns what was computed, for people."""
        changed = int(np.count_nonzero(self.changed))
        return Report((self.ob.name,), self.verb, self.free_count, changed, self.table.locked_names, self.unpaired())

    def unpaired(self) -> tuple[str, ...]:
        """Returns the names of bones that are of one side, and lack the other."""
        return ()

    @property
    def free_count(self) -> int:
        """How many vertices may change."""
        return len(self.positions) if self.free is None else int(np.count_nonzero(self.free))


class Smoothing(Edit):
    """Smooths the weights of all bones along the edges of faces."""

    verb, defaults = "smoothed", SmoothSettings()
    needs_faces = "along whose edges weights are smoothed"

    def new_weights(self, progress: Any) -> Any:
        return sinew_native.smooth_weights(
            self.table.weights,
            self.face_offsets,
            self.face_vertices,
            mask=self.free,
            locked=self.locked,
            positions=self.positions,
            progress=progress,
            **dataclasses.asdict(self.settings),
        )


class Mirroring(Edit):
    """Copies weights from one side to the other, by the closest points of the mirrored surface. Bones change places
    with those of the other side."""

    verb, defaults = "mirrored", MirrorSettings()
    needs_faces = "and weights are mirrored by the closest points of faces"

    @property
    def axis(self) -> int:
        return "XYZ".index(self.settings.axis)

    def columns(self, names: tuple[str, ...], bones: tuple[str, ...]) -> tuple[str, ...]:
        in_object = np.array(self.ob.matrix_world.inverted_safe() @ self.armature.matrix_world)
        rest = self.armature.data.bones
        ends = np.array([[rest[name].head_local, rest[name].tail_local] for name in bones])
        ends = ends @ in_object[:3, :3].T + in_object[:3, 3]
        other = mirrored_bones.pairs(bones, [bpy.utils.flip_name(name) for name in bones], ends, self.axis)
        self._other = {name: None if number < 0 else bones[number] for name, number in zip(bones, other.tolist())}
        wanted = {*names, *(self._other[name] for name in names)}
        return tuple(name for name in bones if name in wanted)

    def pairs(self) -> np.ndarray:
        """Returns (B,) int32: the column of the bone on the other side, or a bone's own."""
        number = {name: column for column, name in enumerate(self.table.names)}
        return np.array([number[self._other[name] or name] for name in self.table.names], np.int32)

    def unpaired(self) -> tuple[str, ...]:
        return tuple(name for name in self.table.names if self._other[name] is None)

    def new_weights(self, progress: Any) -> Any:
        side = self.settings.direction.lower()
        toward = 1 if side == "positive" else -1
        if not (toward * self.positions[:, self.axis] > 0).any():
            raise ValueError(
                f"{self.ob.name} has no vertices on the {side} side of its {self.settings.axis} axis to copy weights "
                "from: choose the other direction, or move its origin to the middle"
            )
        return sinew_native.mirror_weights(
            self.table.weights,
            self.positions,
            self.face_offsets,
            self.face_vertices,
            self.pairs(),
            axis=self.axis,
            from_positive=side == "positive",
            mask=self.free,
            progress=progress,
        )
