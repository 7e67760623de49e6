"""What constraints and drivers look at: targets, and actions."""

from functools import cached_property
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from ..blender import animation
from . import curves, rna_paths

Target = dict[str, Any] | None
# How the matrix of another object, or of a bone of another armature, is read if not in world space: from which space it
# is converted into which one, as Object.convert_space names them.
ReadAs = tuple[str, str]
HEAD: ReadAs = ("WORLD", "HEAD")  # of a bone, only the head counts, which is moved to the world as a point
BASIS: ReadAs = ("BASIS", "BASIS")  # what its own channels say
Channel = tuple[str, int, bpy.types.FCurve, dict[str, Any]]  # a bone's property, its index, the curve and its row


class Targets:
    """Finds targets by object and bone. Those outside the rig become matrices that are given for each frame."""

    def __init__(self, ob: bpy.types.Object, moves: bool = False) -> None:
        self.ob = ob
        self.moves = moves  # the program computes where the object itself is
        self.bones = set(ob.pose.bones.keys())
        self.outside: dict[str, tuple[bpy.types.Object, str]] = {}  # object and bone by name
        self.read_as: dict[str, ReadAs] = {}  # those of them that are not read as world matrices
        self.along: dict[str, float] = {}  # bones of which another place than the head is read: 1 is the tail
        self.moving: dict[str, bpy.types.Object] = {}  # those whose matrices the program computes, and their parents
        self.splines: dict[str, bpy.types.Object] = {}  # curves that Spline IK and Follow Path follow
        self.along_splines: dict[str, set[str]] = {}  # the types of the constraints that do
        self.without_row: set[str] = set()  # paths of constraints that do nothing, whatever is animated of them
        self.refused: list[str] = []
        self._actions: dict[tuple[str, int], dict[str, list[Channel]]] = {}

    @cached_property
    def animated(self) -> set[str]:
        """The paths of all that drivers and keyframes of the rig's object set."""
        return set(map(rna_paths.normalised, animation.animated_paths(self.ob)))

    @cached_property
    def switches(self) -> set[str]:
        """Those of them that are switches of constraints."""
        return {path for path in self.animated if rna_paths.SWITCH.search(path)}

    def of(self, target: bpy.types.Object | None, bone: str, read_as: ReadAs | None = None, along: float = 0) -> Target:
        """Returns what a description says of a target. along: see Targets.along, of those outside the rig. Raises
        Refused for what has no matrix."""
        if target is None:
            return None
        if target == self.ob:
            return {"bone": bone} if bone in self.bones else {"armature": True}  # as Blender does
        if bone and target.type != "ARMATURE":
            raise curves.Refused(f"it looks at the vertices {bone} of {target.name}, which is not covered")
        if bone and bone not in target.pose.bones:  # so that Blender does not know what to evaluate first
            raise curves.Refused(f"{target.name} has no bone {bone}: choose another one")
        parts = (target.name_full, *filter(None, (bone, along)), *(read_as or ()))
        name = "/".join(map(str, parts))
        if along:
            self.along[name] = along
        if read_as is not None:
            self.read_as[name] = read_as
        self.outside.setdefault(name, (target, bone))
        return {"outside": name}

    def spline(self, curve: bpy.types.Object, kind: str) -> str:
        """Returns the name of a curve object that a constraint of that type follows."""
        self.splines.setdefault(curve.name_full, curve)
        self.along_splines.setdefault(curve.name_full, set()).add(kind)
        return str(curve.name_full)

    def channels_of(self, action: bpy.types.Action, slot: int) -> dict[str, list[Channel]]:
        """Returns the curves of an action's slot by bone. Raises Refused."""
        key = (action.name_full, slot)
        if key not in self._actions:
            found: dict[str, list[Channel]] = {}
            own = curves.that_set_anything(self.ob, curves.of_slot(action, slot))
            for curve, row in zip(own, curves.rows_of(own)):
                path, index = row.pop("path"), row.pop("index")
                bone = rna_paths.BONE.match(path)
                if bone:
                    name = bpy.utils.unescape_identifier(bone[1])
                    found.setdefault(name, []).append((path[bone.end() + 1 :], index, curve, row))
            # A group of the bone's name hides curves that are not in it.
            for name, channels in found.items():
                groups = [curve.group for _name, _index, curve, _row in channels]
                grouped = [each for each, group in zip(channels, groups) if group is not None and group.name == name]
                found[name] = grouped or channels
            self._actions[key] = found
        return self._actions[key]

    def has_actions(self) -> bool:
        """Whether constraints use actions."""
        return bool(self._actions)

    def matrices(self, depsgraph: bpy.types.Depsgraph | None = None) -> dict[str, np.ndarray]:
        """Returns the present matrices from outside that are not computed, each 4 x 4."""
        given = {name: each for name, each in self.outside.items() if each[1] or each[0].name_full not in self.moving}
        return {
            name: matrix_of(target, bone, depsgraph, self.read_as.get(name), self.along.get(name, 0))
            for name, (target, bone) in given.items()
        }


def matrix_of(
    target: bpy.types.Object,
    bone: str,
    depsgraph: bpy.types.Depsgraph | None,
    read_as: ReadAs | None = None,
    along: float = 0,
) -> np.ndarray:
    evaluated = target if depsgraph is None else target.evaluated_get(depsgraph)
    posed: Any = evaluated.pose.bones[bone] if bone else None
    if read_as == BASIS:
        return np.array((posed or evaluated).matrix_basis, np.float32)
    in_world = np.array(evaluated.matrix_world, np.float32)
    if posed is not None:
        pose = moved_along(np.array(posed.matrix, np.float32), posed.bone.length, along)
        in_world = multiplied(in_world, pose, read_as == HEAD)
    if read_as is None or read_as == HEAD:
        return in_world
    start, to = read_as
    matrix = posed.matrix if start == "POSE" else Matrix(in_world.tolist())
    return np.array(evaluated.convert_space(pose_bone=posed, matrix=matrix, from_space=start, to_space=to), np.float32)


def multiplied(a: np.ndarray, b: np.ndarray, is_head: bool = False) -> np.ndarray:
    """Returns the product of a matrix and others, (..., 4, 4), with the sums in Blender's order: that of products, or
    that in which it moves a point."""
    terms = [a[:, k, None] * b[..., k, None, :] for k in range(4)]
    return ((terms[0] + terms[1]) + terms[2]) + terms[3] if is_head else (terms[0] + terms[1]) + (terms[2] + terms[3])


def moved_along(poses: np.ndarray, lengths: Any, along: float) -> np.ndarray:
    """Returns the poses of bones, (..., 4, 4) float32, moved from their heads towards their tails, in Blender's steps.
    lengths: of the bones, (...); along: see Targets.along."""
    if not along:
        return poses
    moved, heads = poses.copy(), poses[..., :3, 3]
    tails = heads + poses[..., :3, 1] * np.asarray(lengths, np.float32)[..., None]
    moved[..., :3, 3] = (np.float32(1) - np.float32(along)) * heads + np.float32(along) * tails
    return moved
