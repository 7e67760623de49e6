"""Checks the weights of mesh objects: reads them, and collects what `checks` finds."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from mathutils.kdtree import KDTree

from ..blender import meshes
from ..plan import bindable
from . import assigning, bone_segments, checks, pose_checks, reports, solid

PROBLEMS = (
    (checks.UNWEIGHTED, "Unweighted", "Vertices that no deforming bone moves"),
    (checks.SUMS, "Sums", "Vertices whose weights in deforming bones do not sum to 1"),
    (checks.MANY, "Many Bones", "Vertices that more bones move than the limit"),
    (checks.FAR_BONES, "Far Bones", "Vertices with weight in a bone that is far away although another is near"),
    (checks.ISLANDS, "Parts Apart", "Loose parts that move apart from the surface they lie on"),
    (checks.STRETCHED, "Stretched", "Vertices of edges that become much longer when a bone is bent"),
)


@dataclass(frozen=True)
class Checkup:
    """What was found in some meshes."""

    armature: str  # its name; of the first mesh, if there are several
    of: dict[str, checks.Check]  # by the name of the object
    bones_without_vertices: tuple[str, ...]
    most_influences: int  # the limit
    poses: dict[str, list[pose_checks.TestPose]]  # by the name of the object
    bones: dict[str, tuple[str, ...]]  # by the name of the object: the names of all bones of its armature
    degrees: float  # by which bones are bent in the poses

    @property
    def objects(self) -> tuple[str, ...]:
        return tuple(self.of)

    @property
    def unweighted(self) -> int:
        return self.count(checks.UNWEIGHTED)

    def count(self, problem: str) -> int:
        """Returns how many vertices have a problem."""
        return sum(each.count(problem) for each in self.of.values())

    def problems(self) -> list[tuple[str, str, int]]:
        """Returns (problem, what the vertices are, how many) for each problem that was found."""
        names = {
            checks.UNWEIGHTED: "Vertices without weights",
            checks.SUMS: "Weights not summing to 1",
            checks.MANY: f"More than {self.most_influences} bones",
            checks.FAR_BONES: "Weights in far bones",
            checks.ISLANDS: "Parts that move apart",
            checks.STRETCHED: f"Stretched more than {pose_checks.STRETCHED} times in test poses",
        }
        return [(problem, text, self.count(problem)) for problem, text in names.items() if self.count(problem)]

    def worst_poses(self, count: int = 5) -> list[str]:
        """Returns what the bones that stretch the mesh most do, for people, the worst first."""
        all_poses = [(pose, self.bones[name][pose.bone]) for name, own in self.poses.items() for pose in own]
        all_poses.sort(key=lambda each: -each[0].stretch)
        return [
            f"{bone}: edges {pose.squash:.2f} to {pose.stretch:.2f} times as long"
            + ("" if np.isnan(pose.volume) else f", volume {100 * (pose.volume - 1):+.0f} %")
            for pose, bone in all_poses[:count]
        ]

    def sentence(self) -> str:
        """Returns the result for people."""
        vertices = reports.counted(sum(each.vertex_count for each in self.of.values()), "vertex", "vertices")
        unused = len(self.bones_without_vertices)
        found = [f"{text.lower()}: {count:,}" for _problem, text, count in self.problems()]
        found += [f"bones without vertices: {unused:,}"] if unused else []
        return f"{vertices}, {'; '.join(found) or 'nothing wrong with the weights'}"

    def document(self) -> dict[str, Any]:
        """Returns the result for JSON."""
        return {
            "armature": self.armature,
            "objects": [
                {
                    "name": name,
                    **each.document(),
                    "stretched": each.count(checks.STRETCHED),
                    "poses": [pose.document(self.bones[name]) for pose in self.poses[name]],
                }
                for name, each in self.of.items()
            ],
            "unweighted": self.unweighted,
            "bones_without_vertices": list(self.bones_without_vertices),
            "degrees": self.degrees,
        }


def check(
    objects: Sequence[bpy.types.Object],
    most_influences: int = checks.MOST_INFLUENCES,
    degrees: float = pose_checks.ANGLE,
) -> Checkup:
    """Checks mesh objects, which have armatures. degrees: by which each bone is bent in the test poses. Raises
    ValueError if an object has no armature, or is in Edit Mode."""
    poses: dict[str, list[pose_checks.TestPose]] = {}
    names_of: dict[str, tuple[str, ...]] = {}
    found: dict[str, checks.Check] = {}
    used: dict[Any, set[str]] = {}
    for ob in objects:
        armature = bindable.find_armature(ob)
        if armature is None:
            raise ValueError(f"{ob.name} has no armature: give it an Armature modifier, or parent it to an armature")
        if ob.data.is_editmode:
            raise ValueError(f"{ob.name} is in Edit Mode; leave it first")
        names, found[ob.name] = _check_object(ob, armature, most_influences)
        used.setdefault(armature, set()).update(names)
        mesh, bones = posable(ob, armature)
        poses[ob.name] = pose_checks.check(mesh, bones, degrees)
        names_of[ob.name] = tuple(bone.name for bone in armature.data.bones)
        stretched = [pose.stretched for pose in poses[ob.name]]
        found[ob.name].vertices[checks.STRETCHED] = np.unique(np.concatenate([np.empty(0, int), *stretched]))
    if not found:
        raise ValueError("no mesh with an armature is selected: select one")
    unused = [
        bone.name
        for armature, names in used.items()
        for bone in armature.data.bones
        if bone.use_deform and bone.name not in names
    ]
    return Checkup(next(iter(used)).name, found, tuple(unused), most_influences, poses, names_of, degrees)


def _check_object(ob, armature, most_influences):
    """Returns the names of the deforming bones that move any vertex of the object, and its Check."""
    bones = assigning.read_bones(armature)
    deforming = np.flatnonzero(bones.deform)
    number = {bones.names[bone]: i for i, bone in enumerate(deforming.tolist())}
    offsets, groups, weights = meshes.read_object_weights(ob)
    bone_of_group = np.array([number.get(group.name, -1) for group in ob.vertex_groups] + [-1], int)
    segments = bone_segments.choose(dataclasses.replace(bones, curves={}), deforming)
    edges, _offsets, _corners = meshes.read_topology(ob.data)
    own = checks.Weights(offsets, bone_of_group[groups], weights)
    found = checks.check(
        own, solid.world_positions(ob), edges, segments.heads, segments.tails, _nearest, most_influences
    )
    return {bones.names[deforming[bone]] for bone in found.bones_used}, found


def posable(ob: bpy.types.Object, armature: bpy.types.Object) -> tuple[pose_checks.Mesh, pose_checks.Bones]:
    """Returns a mesh object and the bones of its armature, all of them, for test poses, in world space."""
    bones = assigning.read_bones(armature)
    number = {name: i for i, name in enumerate(bones.names) if bones.deform[i]}
    offsets, groups, weights = meshes.read_object_weights(ob)
    bone_of_group = np.array([number.get(group.name, -1) for group in ob.vertex_groups] + [-1], int)
    vertices, owners, values = checks.Weights(offsets, bone_of_group[groups], weights).used()
    sums = np.bincount(vertices, values, minlength=len(offsets) - 1)
    edges, _offsets, _corners = meshes.read_topology(ob.data)
    own = solid.collect([ob])
    mesh = pose_checks.Mesh(own.positions, edges, own.triangles(), vertices, owners, values / sums[vertices])
    turned = np.array([armature.matrix_world.to_3x3() @ bone.matrix_local.to_3x3() for bone in armature.data.bones])
    axes = turned.transpose(0, 2, 1)
    axes = axes / np.maximum(np.linalg.norm(axes, axis=2, keepdims=True), 1e-30)
    return mesh, pose_checks.Bones(bones.parents, bones.heads, axes)


def _nearest(points, others, reach):
    """Returns for each of the points (P, 3) (P,) the index of the nearest of the others (Q, 3), -1 beyond reach."""
    tree = KDTree(len(others))
    for i, place in enumerate(others):
        tree.insert(place, i)
    tree.balance()
    result = np.full(len(points), -1)
    for i, place in enumerate(points):
        _place, index, distance = tree.find(place)
        if index is not None and distance <= reach:
            result[i] = index
    return result
