"""Checks the weights of mesh objects: reads them, and collects what `checks` finds."""

import dataclasses
import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from mathutils.kdtree import KDTree

from ..blender import meshes
from . import assigning, bone_segments, carriers, checks, pose_checks, reports, solid, table
from .entries import Entries

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
        """Returns (problem, what its vertices are, how many) for each problem that was found. The words follow the
        number, and both fit into a sidebar."""
        names = {
            checks.UNWEIGHTED: "without weights",
            checks.SUMS: "not summing to 1",
            checks.MANY: f"with over {self.most_influences} bones",
            checks.FAR_BONES: "in far bones",
            checks.ISLANDS: "moving apart",
            checks.STRETCHED: f"stretched over {pose_checks.STRETCHED}x",
        }
        return [(problem, text, self.count(problem)) for problem, text in names.items() if self.count(problem)]

    def worst_poses(self, count: int = 5) -> list[str]:
        """Returns what the bones that stretch the mesh most do, for people, the worst first."""
        all_poses = [(pose, self.bones[name][pose.bone]) for name, own in self.poses.items() for pose in own]
        all_poses.sort(key=lambda each: -each[0].stretch)
        return [
            f"{pose.stretch:.1f}x {bone}"
            + ("" if np.isnan(pose.volume) else f", volume {100 * (pose.volume - 1):+.0f} %")
            for pose, bone in all_poses[:count]
        ]

    def sentence(self) -> str:
        """Returns the result for people."""
        vertices = reports.counted(sum(each.vertex_count for each in self.of.values()), "vertex", "vertices")
        unused = len(self.bones_without_vertices)
        found = [f"{count:,} {text}" for _problem, text, count in self.problems()]
        found += [f"{reports.counted(unused, 'bone')} without vertices"] if unused else []
        return f"{vertices}: {', '.join(found) or 'nothing wrong with the weights'}"

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


@dataclass(frozen=True)
class Subject:
    """What is read of one mesh object, in world space."""

    armature: str  # its name
    rest: assigning.RestBones
    deforming: np.ndarray  # (D,) int: the numbers of the bones that deform
    weights: Entries  # in these bones
    mesh: pose_checks.Mesh  # for test poses; with the numbers of all bones
    bones: pose_checks.Bones


def read(ob: bpy.types.Object) -> Subject:
    """Reads a mesh object and its armature. Raises ValueError if it has none, or is in Edit Mode."""
    armature = table.armature_of(ob)
    if ob.data.is_editmode:
        raise ValueError(f"{ob.name} is in Edit Mode; leave it first")
    rest, own = assigning.read_bones(armature), solid.collect([ob])
    deforming = np.flatnonzero(rest.deform)
    weights = Entries.of(table.read(ob, [rest.names[bone] for bone in deforming]).weights)
    shares = weights.summing_to(np.ones(len(own.positions)))
    mesh = pose_checks.Mesh(
        own.positions, meshes.read_topology(ob.data)[0], own.triangles(), shares.renumbered(deforming)
    )
    turned = np.array([armature.matrix_world.to_3x3() @ bone.matrix_local.to_3x3() for bone in armature.data.bones])
    axes = turned.transpose(0, 2, 1)
    axes = axes / np.maximum(np.linalg.norm(axes, axis=2, keepdims=True), 1e-30)
    number, carrier = {name: bone for bone, name in enumerate(rest.names)}, carriers.of(armature)
    parents = np.array([number[carrier[name]] if name in carrier else -1 for name in rest.names], int)
    bones = pose_checks.Bones(parents, rest.heads, axes)
    return Subject(armature.name, rest, deforming, weights, mesh, bones)


class Checking:
    """Checks mesh objects, which have armatures. It is made in the main thread; `compute` may run in any thread,
    because it does not touch Blender's data."""

    def __init__(
        self,
        objects: Sequence[bpy.types.Object],
        most_influences: int = checks.MOST_INFLUENCES,
        degrees: float = pose_checks.ANGLE,
    ) -> None:
        """Reads everything. degrees: by which each bone is bent in the test poses. Raises ValueError if an object has
        no armature, or is in Edit Mode."""
        if not objects:
            raise ValueError("no mesh with an armature is selected: select one")
        self.objects, self._subjects = list(objects), {ob.name: read(ob) for ob in objects}
        self._most_influences, self._degrees = most_influences, degrees
        self.share = 0.0  # of the computation that is done
        self.checkup: Any = None  # a Checkup, once it is computed

    def compute(self, progress: Any = None) -> bool:
        """Checks. progress: a sinew_native.Progress. Returns False if it was cancelled: there is no checkup."""
        found: dict[str, checks.Check] = {}
        poses: dict[str, list[pose_checks.TestPose]] = {}
        used: dict[str, set[str]] = {}

        def goes_on(share: float) -> bool:
            self.share = (len(poses) + share) / len(self._subjects)
            return progress is None or not progress.is_cancelled

        for name, own in self._subjects.items():
            segments = bone_segments.choose(dataclasses.replace(own.rest, curves={}), own.deforming)
            found[name] = checks.check(
                own.weights,
                own.mesh.positions,
                own.mesh.edges,
                segments.heads,
                segments.tails,
                functools.partial(_nearest, goes_on),
                self._most_influences,
            )
            used.setdefault(own.armature, set()).update(
                own.rest.names[bone] for bone in own.deforming[found[name].bones_used]
            )
            poses[name] = pose_checks.check(own.mesh, own.bones, self._degrees, goes_on)
            if not goes_on(0):
                return False
            stretched = [np.empty(0, int), *(pose.stretched for pose in poses[name])]
            found[name].vertices[checks.STRETCHED] = np.unique(np.concatenate(stretched))
        rests = {own.armature: own.rest for own in self._subjects.values()}
        unused = [
            name
            for armature, rest in rests.items()
            for name, deforms in zip(rest.names, rest.deform)
            if deforms and name not in used[armature]
        ]
        bones = {name: own.rest.names for name, own in self._subjects.items()}
        self.checkup = Checkup(
            next(iter(rests)), found, tuple(unused), self._most_influences, poses, bones, self._degrees
        )
        return True


def check(objects: Sequence[bpy.types.Object], *settings: Any, **named: Any) -> Checkup:
    """Returns the Checkup of mesh objects. Settings and errors are those of Checking."""
    made = Checking(objects, *settings, **named)
    made.compute()
    return made.checkup


def _nearest(goes_on, points, others, reach):
    """Returns for each of the points (P, 3) (P,) the index of the nearest of the others (Q, 3), -1 beyond reach."""
    tree = KDTree(len(others))
    for i, place in enumerate(others.tolist()):
        tree.insert(place, i)
    tree.balance()
    result = np.full(len(points), -1)
    for i, place in enumerate(points.tolist()):
        if i % 1024 == 0 and not goes_on(0):
            break
        _place, index, distance = tree.find(place)
        if index is not None and distance <= reach:
            result[i] = index
    return result
