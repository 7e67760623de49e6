"""Makes weights for mesh objects from the bones of an armature: reads the scene, computes, writes vertex groups."""

from collections.abc import Iterable, Mapping, Sequence
from time import perf_counter
from typing import Any

import bpy
import numpy as np

from ..blender import armatures
from ..deform import influences
from ..native import sinew_native
from . import bone_segments, reports, solid, table
from .bone_segments import RestBones
from .entries import Entries, stacked
from .weight_settings import AutomaticSettings

FAR_AWAY = 100.0  # sizes of the mesh: how far the bone is that stands for all bones that were not chosen


def refuse(objects: Sequence[bpy.types.Object], armature: bpy.types.Object) -> None:
    """Raises ValueError with the reason if the weights of one of the objects cannot be made or written."""
    if armature is None or armature.type != "ARMATURE":
        raise ValueError("there is no armature: select the meshes, then the armature last, so that it is active")
    if not objects:
        raise ValueError("no mesh is selected: select the meshes, then the armature last, so that it is active")
    if not any(bone.use_deform for bone in armature.data.bones):
        raise ValueError(f"{armature.name} has no deforming bone: tick Deform in the properties of at least one bone")
    if armature.data.is_editmode:
        raise ValueError(f"{armature.name} is in Edit Mode; leave it first")
    for ob in objects:
        why = table.why_not_writable(ob)
        if why:
            raise ValueError(f"{ob.name} {why}")
    if not any(len(ob.data.vertices) for ob in objects):
        raise ValueError(f"{', '.join(ob.name for ob in objects)}: there are no vertices to give weights to")


def read_bones(armature: bpy.types.Object) -> RestBones:
    """Returns all bones of an armature at rest in world space."""
    bones = list(armature.data.bones)
    number = {bone.name: i for i, bone in enumerate(bones)}
    matrix = np.array(armature.matrix_world, np.float64)

    def in_world(points: Any) -> np.ndarray:
        return np.array(points, np.float64).reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]

    curves = {}
    for i, bone in enumerate(bones):
        if bone.use_deform and bone.bbone_segments > 1:
            ends = armatures.read_segments(armature, bone.name, rest=True)[:, :3, 3]
            rest = np.array(bone.matrix_local, np.float64)
            curves[i] = in_world(ends @ rest[:3, :3].T + rest[:3, 3])
    return RestBones(
        tuple(bone.name for bone in bones),
        np.array([number[bone.parent.name] if bone.parent else -1 for bone in bones], int),
        np.array([bone.use_deform for bone in bones], bool),
        in_world([bone.head_local for bone in bones]),
        in_world([bone.tail_local for bone in bones]),
        curves,
    )


class Assignment:
    """Weights of some mesh objects by an armature. It is made and written in the main thread; in between, `compute`
    may run in any thread, because it does not touch Blender's data."""

    def __init__(
        self,
        objects: Sequence[bpy.types.Object],
        armature: bpy.types.Object,
        settings: AutomaticSettings | None = None,
        names: Iterable[str] | None = None,
        free: Mapping[str, np.ndarray] | None = None,
        chosen_rigid: Mapping[str, np.ndarray] | None = None,
    ) -> None:
        """Reads everything. names: of the bones that get weights; None: all that deform. free: {name of an object:
        (V,) bool}, the vertices that get weights, if not all; the weights of the others are fixed values of the
        solution. chosen_rigid: {name of an object: (V,) bool}, vertices that are rigid besides those of rigid_group.
        Raises ValueError."""
        refuse(objects, armature)
        self._start = perf_counter()
        self.objects, self.armature, self._settings = list(objects), armature, settings or AutomaticSettings()
        bones = read_bones(armature)
        wanted = set(bones.names) if names is None else set(names)
        chosen = [i for i, name in enumerate(bones.names) if bones.deform[i] and name in wanted]
        if not chosen:
            raise ValueError(f"none of the chosen bones of {armature.name} deforms: select bones that do")
        locked = [{group.name for group in ob.vertex_groups if group.lock_weight} for ob in self.objects]
        in_all = set.intersection(*locked)
        self._kept = tuple(bones.names[i] for i in chosen if any(bones.names[i] in names for names in locked))
        chosen = [i for i in chosen if bones.names[i] not in in_all]
        if not chosen:
            raise ValueError("the vertex groups of all chosen bones are locked: unlock those that should get weights")
        self._deforming = {name for name, deforms in zip(bones.names, bones.deform) if deforms}
        self.names = [bones.names[i] for i in chosen]
        # The others that deform have a part in the solution, but keep the weights that they have.
        rivals = [i for i, deforms in enumerate(bones.deform) if deforms and bones.names[i] not in wanted]
        self._solved = [*self.names, *(bones.names[i] for i in rivals)]
        self._locked = np.array([[name in own for name in self.names] for own in locked], bool).reshape(
            len(objects), len(chosen)
        )
        self.segments = bone_segments.choose(bones, np.array([*chosen, *rivals]), self._settings.ends)
        self._refuse_infinite()
        self._solid = solid.collect(self.objects)
        self._before = [table.in_groups(ob) for ob in self.objects]
        self._free = np.ones(len(self._solid.positions), bool)
        for number, ob in enumerate(self.objects):
            if free is not None and ob.name in free:
                self._free[self._range(number)] = free[ob.name]
        if not self._free.any():
            raise ValueError("no vertex is selected: select those that should get weights, or turn the mask off")
        self._fixed = None if self._free.all() else self._fixed_weights()
        self._rigid_parts = self._find_rigid(chosen_rigid or {})
        self._found: Any = None

    def _refuse_infinite(self) -> None:
        is_finite = np.isfinite(self.segments.heads).all(axis=1) & np.isfinite(self.segments.tails).all(axis=1)
        if not is_finite.all():
            name = self._solved[self.segments.bones[np.flatnonzero(~is_finite)[0]]]
            raise ValueError(
                f"Bone {name} of {self.armature.name} is not at a finite position (NaN or infinite): move it"
            )

    @property
    def _has_rivals(self) -> bool:
        return len(self._solved) > len(self.names)

    def _range(self, number: int) -> slice:
        return slice(self._solid.starts[number], self._solid.starts[number + 1])

    def _find_rigid(self, chosen: Mapping[str, np.ndarray]) -> np.ndarray | None:
        """Returns the number of the rigid piece of each vertex, (V,) int32, -1 for none; None if there are none."""
        marked = np.zeros(len(self._solid.positions), bool)
        for number, (ob, before) in enumerate(zip(self.objects, self._before)):
            if self._settings.rigid_group not in self._deforming:
                marked[self._range(number)] |= solid.rigid_members(ob, before, self._settings.rigid_group)
            if ob.name in chosen:
                marked[self._range(number)] |= chosen[ob.name]
        if not marked.any():
            return None
        return solid.rigid_pieces(marked, self._solid.positions, self._solid.edges())

    def _fixed_weights(self) -> Any:
        """Returns a sinew_native.WeightTable, fixed vertices x (solved bones + 1): the weights that the fixed vertices
        have, and in the last column what is missing to 1, which other bones hold."""
        columns = [influences.columns_of_groups(ob.vertex_groups.keys(), self._solved) for ob in self.objects]
        own = stacked(list(map(Entries.renumbered, self._before, columns)), self._solid.starts)
        own, count = own.where(~self._free[own.vertices]), int(np.count_nonzero(~self._free))
        own = Entries((np.cumsum(~self._free) - 1)[own.vertices], own.bones, own.weights)
        missing = np.clip(1 - own.sums(count), 0, 1)
        rest = Entries(np.arange(count), np.full(count, len(self._solved)), missing)
        return own.joined(rest).table(count, len(self._solved) + 1)

    def compute(self, progress: Any = None) -> bool:
        """Computes the weights. progress: a sinew_native.Progress. Returns False if it was cancelled: there is nothing
        to write."""
        heads, tails, bones = self.segments
        fixed = {}
        if self._fixed is not None:
            # Too far away to be the nearest bone of any vertex: it has the fixed values only.
            size = np.ptp(self._solid.positions, axis=0).max() or 1.0
            far = self._solid.positions[:1] + FAR_AWAY * size
            heads, tails = np.concatenate((heads, far)), np.concatenate((tails, far + size))
            bones = np.append(bones, len(self._solved))
            fixed = {"fixed_vertices": np.flatnonzero(~self._free).astype(np.int32), "fixed_weights": self._fixed}
        self._found = sinew_native.automatic_weights(
            self._solid.positions,
            self._solid.face_offsets,
            self._solid.face_vertices,
            heads,
            tails,
            joints=bones.astype(np.int32),
            resolution=self._settings.resolution,
            stiffness=self._settings.stiffness,
            rigid_size=self._settings.rigid_size,
            rigid_follow=self._settings.rigid_follow,
            rigid_parts=self._rigid_parts,
            progress=progress,
            **fixed,
        )
        return self._found is not None

    def write(self) -> reports.Report:
        """Writes what was computed: once into each mesh. Returns the report."""
        found = Entries.from_offsets(self._found.offsets, self._found.joints, np.array(self._found.weights, float))
        unweighted, used = 0, np.zeros(len(self.names), bool)
        for number, ob in enumerate(self.objects):
            left, is_used = self._write_object(number, ob, found)
            unweighted += left
            used |= is_used
        report = self._report(unweighted, [name for name, is_used in zip(self.names, used) if not is_used])
        reports.remember(report)
        return report

    def _write_object(self, number: int, ob: bpy.types.Object, found: Entries) -> tuple[int, np.ndarray]:
        """Writes the weights of one object, of those of all. Returns how many of its free vertices no deforming bone
        moves, and which of the bones it uses, (bones,) bool."""
        here, is_locked, before = self._range(number), self._locked[number], self._before[number]
        free, count = self._free[here], here.stop - here.start
        group_of_bone = table.add_groups(ob, self.names)
        written = group_of_bone[~is_locked]
        deforms = np.array([group.name in self._deforming for group in ob.vertex_groups] + [False])
        is_kept_group = np.array([group.lock_weight for group in ob.vertex_groups] + [False]) & deforms
        stays = (before.bones >= 0) & ~(np.isin(before.bones, written) & free[before.vertices])

        # Of the rivals, and of the column of fixed weights, nothing is written.
        own = found.where(
            (found.vertices >= here.start) & (found.vertices < here.stop) & (found.bones < len(is_locked))
        )
        own = Entries(own.vertices - here.start, own.bones, own.weights)
        own = own.where(free[own.vertices] & ~is_locked[own.bones] & (own.weights > 0))
        if is_locked.any() and not self._has_rivals:
            own = self._with_nearest(number, free, own)
        if self._settings.max_influences:
            moving = before.where(stays & deforms[before.bones] & (before.weights > 0))
            limits = self._settings.max_influences - np.bincount(moving.vertices, minlength=count)
            own = own.largest(np.maximum(limits, 1))
        if is_kept_group.any():
            if self._fixed is None and not self._has_rivals:  # otherwise these hold less than 1
                own = own.summing_to(np.ones(count))
            own = own.times(np.clip(1 - before.where(stays & is_kept_group[before.bones]).sums(count), 0, 1))
            own = own.where(own.weights > 0)

        everything = table.replace(ob, before, own.renumbered(group_of_bone), written, free)
        moving = everything.where(deforms[everything.bones])
        is_used = np.isin(group_of_bone, everything.bones[everything.weights > 0])
        return int(np.count_nonzero(free & (moving.sums(count) <= influences.SMALLEST_WEIGHT_SUM))), is_used

    def _with_nearest(self, number: int, free: np.ndarray, own: Entries) -> Entries:
        """Adds the nearest bone that is not locked, for the vertices that have got none because their groups are."""
        missed = np.flatnonzero(free & (np.bincount(own.vertices, minlength=len(free)) == 0))
        heads, tails, bones = (part[~self._locked[number][self.segments.bones]] for part in self.segments)
        if not len(missed) or not len(heads):
            return own
        points = self._solid.positions[self._range(number)][missed]
        _distances, nearest = bone_segments.nearest(points, heads, tails)
        return own.joined(Entries(missed, bones[nearest], np.ones(len(missed))))

    def _report(self, unweighted: int, without_vertices: Sequence[str]) -> reports.Report:
        found = self._found.report
        outside_segments = np.zeros(len(self.segments.bones) + 1, bool)
        outside_segments[np.asarray(found.bones_outside, int)] = True
        inside = self.segments.bones[~outside_segments[:-1]]
        outside = np.setdiff1d(np.arange(len(self.names)), inside)
        return reports.Report(
            self.armature.name,
            tuple(ob.name for ob in self.objects),
            int(np.count_nonzero(self._free)),
            found.part_count,
            unweighted,
            {way: getattr(found, f"{way}_count") for way in ("surface", "volume", "nearest", "fixed", "rigid")},
            len(self.names),
            tuple(self.names[bone] for bone in outside),
            tuple(without_vertices),
            perf_counter() - self._start,
            self._kept,
        )
