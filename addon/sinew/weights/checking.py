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
from . import assigning, bone_segments, checks, reports, solid

PROBLEMS = (
    (checks.UNWEIGHTED, "Unweighted", "Vertices that no deforming bone moves"),
    (checks.SUMS, "Sums", "Vertices whose weights in deforming bones do not sum to 1"),
    (checks.MANY, "Many Bones", "Vertices that more bones move than the limit"),
    (checks.FAR_BONES, "Far Bones", "Vertices with weight in a bone that is far away although another is near"),
    (checks.ISLANDS, "Parts Apart", "Loose parts that move apart from the surface they lie on"),
)


@dataclass(frozen=True)
class Checkup:
    """What was found in some meshes."""

    armature: str  # its name; of the first mesh, if there are several
    of: dict[str, checks.Check]  # by the name of the object
    bones_without_vertices: tuple[str, ...]
    most_influences: int  # the limit

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
        }
        return [(problem, text, self.count(problem)) for problem, text in names.items() if self.count(problem)]

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
            "objects": [{"name": name, **each.document()} for name, each in self.of.items()],
            "unweighted": self.unweighted,
            "bones_without_vertices": list(self.bones_without_vertices),
        }


def check(objects: Sequence[bpy.types.Object], most_influences: int = checks.MOST_INFLUENCES) -> Checkup:
    """Checks mesh objects, which have armatures. Raises ValueError if one has none, or is in Edit Mode."""
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
    if not found:
        raise ValueError("no mesh with an armature is selected: select one")
    unused = [
        bone.name
        for armature, names in used.items()
        for bone in armature.data.bones
        if bone.use_deform and bone.name not in names
    ]
    return Checkup(next(iter(used)).name, found, tuple(unused), most_influences)


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
