"""Makes weights for mesh objects from the bones of an armature: reads the scene, computes, writes vertex groups."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import bpy
import numpy as np

from ..blender import armatures, meshes, weight_writing
from ..deform import influences
from ..native import sinew_native
from . import bone_segments, reports, rigid, solid
from .bone_segments import RestBones

FAR_AWAY = 100.0  # sizes of the mesh: how far the bone is that stands for all bones that were not chosen


@dataclass(frozen=True)
class Settings:
    """How weights are made. The defaults suit a character."""

    ends: str = bone_segments.AUTOMATIC  # of the bones' segments, as in bone_segments.choose
    resolution: int = 128  # voxels along the longest side
    stiffness: float = 8.0  # how close the weights stay to the nearest bone
    max_influences: int = 0  # of a vertex; 0: no limit
    rigid_size: float = rigid.SIZE  # loose parts that are smaller than this share of the mesh's size are rigid
    rigid_follow: str = "attachment"  # what they follow: "attachment" or "bone"
    rigid_group: str = rigid.GROUP  # vertices of the vertex group of this name are rigid, each connected piece of them


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
        why = why_not_writable(ob)
        if why:
            raise ValueError(f"{ob.name} {why}")
    if not any(len(ob.data.vertices) for ob in objects):
        raise ValueError(f"{', '.join(ob.name for ob in objects)}: there are no vertices to give weights to")


def why_not_writable(ob: bpy.types.Object) -> str:
    """Returns why the weights of a mesh object cannot be written, as a clause without its subject, or ""."""
    if ob.type != "MESH":
        return "is not a mesh; select one"
    if ob.sinew.copy_of is not None:
        return f"is the deformed copy of {ob.sinew.copy_of.name}; select that mesh instead"
    if ob.library is not None or ob.data.library is not None:
        return "is linked from another file; make its weights in that file"
    if ob.data.override_library is not None:
        return "has a mesh from another file (a library override); make its weights in that file"
    if ob.data.is_editmode:
        return "is in Edit Mode; leave it first"
    sharers = meshes.count_sharers(ob)
    if sharers > 1:
        return (
            f"shares its mesh with {reports.counted(sharers - 1, 'other object')}, whose weights would change too; "
            "make it single-user first (Object > Relations > Make Single User > Object & Data)"
        )
    return ""


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
        settings: Settings = Settings(),
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
        self.objects, self.armature, self._settings = list(objects), armature, settings
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
        self.segments = bone_segments.choose(bones, np.array([*chosen, *rivals]), settings.ends)
        self._refuse_infinite()
        self._solid = solid.collect(self.objects)
        self._before = [meshes.read_object_weights(ob) for ob in self.objects]
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
                marked[self._range(number)] |= rigid.members(ob, before, self._settings.rigid_group)
            if ob.name in chosen:
                marked[self._range(number)] |= chosen[ob.name]
        if not marked.any():
            return None
        return rigid.pieces(marked, self._solid.positions, self._solid.edges())

    def _fixed_weights(self) -> Any:
        """Returns a sinew_native.WeightTable, fixed vertices x (solved bones + 1): the weights that the fixed vertices
        have, and in the last column what is missing to 1, which other bones hold."""
        columns = {name: i for i, name in enumerate(self._solved)}
        row_of = np.cumsum(~self._free) - 1
        rows, bones, values = [], [], []
        for number, ob in enumerate(self.objects):
            of_group = np.array([columns.get(group.name, -1) for group in ob.vertex_groups] + [-1], int)
            offsets, groups, weights = self._before[number]
            vertices = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets)) + self._solid.starts[number]
            used = (of_group[groups] >= 0) & ~self._free[vertices]
            rows.append(row_of[vertices[used]])
            bones.append(of_group[groups[used]])
            values.append(weights[used])
        count = int(np.count_nonzero(~self._free))
        missing = np.clip(1 - np.bincount(np.concatenate(rows), np.concatenate(values), minlength=count), 0, 1)
        rows.append(np.arange(count))
        bones.append(np.full(count, len(columns)))
        order = np.argsort(np.concatenate(rows), kind="stable")
        offsets = np.concatenate(([0], np.cumsum(np.bincount(np.concatenate(rows), minlength=count))))
        return sinew_native.WeightTable(
            offsets, np.concatenate(bones)[order], np.concatenate([*values, missing])[order], len(columns) + 1
        )

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
        offsets = np.asarray(self._found.offsets)
        vertices = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
        bones, weights = np.asarray(self._found.joints), np.asarray(self._found.weights, np.float64)
        unweighted, used = 0, np.zeros(len(self.names), bool)
        for number, ob in enumerate(self.objects):
            here = self._range(number)
            first, last = np.searchsorted(vertices, (here.start, here.stop))
            own = vertices[first:last] - here.start, bones[first:last], weights[first:last]
            left, is_used = self._write_object(number, ob, *own)
            unweighted += left
            used |= is_used
        report = self._report(unweighted, [name for name, is_used in zip(self.names, used) if not is_used])
        reports.remember(report)
        return report

    def _write_object(
        self, number: int, ob: bpy.types.Object, vertices: np.ndarray, bones: np.ndarray, weights: np.ndarray
    ) -> tuple[int, np.ndarray]:
        """Writes the weights of one object. Returns how many of its free vertices no deforming bone moves, and which of
        the bones it uses, (bones,) bool."""
        free, is_locked = self._free[self._range(number)], self._locked[number]
        count = len(free)
        offsets, groups, values = self._before[number]
        group_of_bone = add_groups(ob, self.names)
        is_target = np.zeros(len(ob.vertex_groups) + 1, bool)
        is_target[group_of_bone[~is_locked]] = True
        deforms = np.array([group.name in self._deforming for group in ob.vertex_groups] + [False])
        is_kept_group = np.array([group.lock_weight for group in ob.vertex_groups] + [False]) & deforms

        owner = np.repeat(np.arange(count), np.diff(offsets))
        kept = (groups >= 0) & (~is_target[groups] | ~free[owner])
        held = kept & is_kept_group[groups]
        room = 1 - np.bincount(owner[held], values[held], minlength=count)
        places = self._settings.max_influences
        limits = places - np.bincount(owner[kept & deforms[groups] & (values > 0)], minlength=count)

        usable = free[vertices] & (bones < len(is_locked)) & (weights > 0)
        usable[usable] = ~is_locked[bones[usable]]
        vertices, bones, weights = vertices[usable], bones[usable], weights[usable]
        if self._locked[number].any() and not self._has_rivals:
            vertices, bones, weights = self._with_nearest(number, free, vertices, bones, weights)
        if places:
            vertices, bones, weights = largest(vertices, bones, weights, np.maximum(limits, 1))
        if is_kept_group.any():
            if self._fixed is None and not self._has_rivals:  # otherwise these hold less than 1
                weights = weights / np.bincount(vertices, weights, minlength=count)[vertices]
            weights = weights * np.clip(room, 0, 1)[vertices]
            usable = weights > 0
            vertices, bones, weights = vertices[usable], bones[usable], weights[usable]

        all_vertices = np.concatenate((owner[kept], vertices))
        all_groups = np.concatenate((groups[kept], group_of_bone[bones]))
        all_weights = np.concatenate((values[kept], weights)).astype(np.float32)
        order = np.lexsort((all_groups, -all_weights, all_vertices))
        new_offsets = np.concatenate(([0], np.cumsum(np.bincount(all_vertices, minlength=count))))
        weight_writing.replace(ob, new_offsets, all_groups[order], all_weights[order])

        moves = deforms[all_groups]
        sums = np.bincount(all_vertices[moves], all_weights[moves], minlength=count)
        is_used = np.isin(group_of_bone, np.unique(all_groups[all_weights > 0]))
        return int(np.count_nonzero(free & (sums <= influences.SMALLEST_WEIGHT_SUM))), is_used

    def _with_nearest(
        self, number: int, free: np.ndarray, vertices: np.ndarray, bones: np.ndarray, weights: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Adds the nearest bone that is not locked, for the vertices that have got none because their groups are."""
        if self._locked[number].all():
            return vertices, bones, weights
        missed = np.flatnonzero(free & (np.bincount(vertices, minlength=len(free)) == 0))
        if not len(missed):
            return vertices, bones, weights
        points = self._solid.positions[self._range(number)][missed]
        best, nearest = np.full(len(missed), np.inf), np.zeros(len(missed), int)
        for head, tail, bone in zip(*self.segments):
            if not self._locked[number][bone]:
                own = bone_segments.distances(points, np.broadcast_to(head, points.shape), tail)
                nearest[own < best] = bone
                best = np.minimum(best, own)
        vertices, bones = np.concatenate((vertices, missed)), np.concatenate((bones, nearest))
        weights = np.concatenate((weights, np.ones(len(missed))))
        order = np.argsort(vertices, kind="stable")
        return vertices[order], bones[order], weights[order]

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


def add_groups(ob: bpy.types.Object, names: Sequence[str]) -> np.ndarray:
    """Adds the vertex groups of these names that the object lacks; with a Mirror modifier those of the other side, too,
    since it gives weights of a group to the other half only if there is one. Returns the index of each, (names,)
    int."""
    active = ob.vertex_groups.active_index if len(ob.vertex_groups) else 0
    there = {group.name: group.index for group in ob.vertex_groups}
    is_mirrored = any(each.type == "MIRROR" and each.use_mirror_vertex_groups for each in ob.modifiers)
    for name in [*names, *(map(bpy.utils.flip_name, names) if is_mirrored else ())]:
        if name not in there:
            there[name] = ob.vertex_groups.new(name=name).index
    ob.vertex_groups.active_index = active
    return np.array([there[name] for name in names], int)


def largest(
    vertices: np.ndarray, bones: np.ndarray, weights: np.ndarray, limits: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Keeps the largest weights of each vertex, and scales them to the same sum. vertices, bones, weights (N,);
    limits (V,): how many a vertex keeps."""
    order = np.lexsort((bones, -weights, vertices))
    vertices, bones, weights = vertices[order], bones[order], weights[order]
    rank = np.arange(len(vertices)) - np.searchsorted(vertices, vertices)
    kept = rank < limits[vertices]
    count = len(limits)
    before, after = (np.bincount(vertices[own], weights[own], minlength=count) for own in (slice(None), kept))
    scale = before / np.where(after > 0, after, 1)
    return vertices[kept], bones[kept], weights[kept] * scale[vertices[kept]]
