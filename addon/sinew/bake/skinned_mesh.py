"""A mesh that is moved only by linear skinning with one armature: its influences, and its joints frame by frame.
Uses no types of Blender except those of its arguments.

Letters: V vertices, J joints, K influences of a vertex.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..blender import armatures, meshes, nodes, values
from ..deform.influences import Bones, Rules, columns_of_groups, influences
from ..native import sinew_native


class NotLinear(ValueError):
    """Why a skeleton alone cannot reproduce the mesh."""


@dataclass
class Skeleton:
    """The bones that move the mesh, parents first; at the end one that never moves, if some vertex needs it."""

    names: list
    parents: np.ndarray  # (J,), -1: a root
    bind: np.ndarray  # (J, 4, 4), rigid, in the space of the mesh


class LinearCharacter:
    """A mesh object that one Armature modifier deforms linearly, and nothing else. Raises NotLinear."""

    def __init__(self, ob: Any, depsgraph: Any) -> None:
        """ob: the mesh object."""
        self._ob, self._armature = ob, _modifier_of(ob).object
        self.rest = meshes.read_positions(ob.data)
        bones = Bones(**armatures.read_bones(self._armature))
        offsets, groups, weights = meshes.read_object_weights(ob)
        bone_of_group = columns_of_groups(ob.vertex_groups.keys(), bones.names)
        own = influences(offsets, groups, weights, bone_of_group, bones, Rules(), lambda: self.rest)
        bone_of_joint = np.repeat(np.arange(len(bones.names)), bones.joint_counts)
        self._used = np.unique(bone_of_joint[own.joints])
        if (bones.segments[self._used] > 1).any() or bones.multiply[self._used].any():
            raise NotLinear(f"{self._armature.name} has bones with segments or envelopes that move it")
        joint_of_bone = np.full(len(bones.names), -1)
        joint_of_bone[self._used] = np.arange(len(self._used))
        joints = joint_of_bone[bone_of_joint[own.joints]] if len(own.joints) else own.joints
        to_mesh = self._mesh_from_armature(depsgraph)
        self._bind = np.array([rigid(to_mesh @ bones.rest[bone]) for bone in self._used]).reshape(-1, 4, 4)
        order = self._order(bones.names)
        self.influences, has_still = _padded(own.offsets, joints, own.weights, len(self._used))
        self.skeleton = Skeleton(
            [bones.names[bone] for bone in self._used] + ["still"] * has_still,
            np.append(order, [-1] * has_still).astype(int),
            np.concatenate([self._bind, np.tile(np.eye(4), (int(has_still), 1, 1))]),
        )
        self._native = sinew_native.Skin(
            self.rest,
            np.arange(len(self.rest) + 1) * self.influences[0].shape[1],
            self.influences[0].reshape(-1),
            self.influences[1].reshape(-1),
            len(self.skeleton.names),
        )

    def _order(self, names):
        """Returns (J,): each joint's nearest ancestor that is a joint. Blender keeps parents before children."""
        place = {names[bone]: joint for joint, bone in enumerate(self._used)}
        found = []
        for bone in self._used:
            parent = self._armature.pose.bones[int(bone)].parent
            while parent is not None and parent.name not in place:
                parent = parent.parent
            joint = place[parent.name] if parent is not None else -1
            found.append(joint if joint < len(found) else -1)
        return found

    def _mesh_from_armature(self, depsgraph):
        try:
            return values.relative_matrix(self._ob.evaluated_get(depsgraph), self._armature.evaluated_get(depsgraph))
        except values.Flat as error:
            raise NotLinear(str(error)) from error

    def posed(self, depsgraph: Any) -> np.ndarray:
        """Returns (J, 4, 4): the joints of the evaluated pose, in the space of the mesh."""
        evaluated = self._armature.evaluated_get(depsgraph)
        to_mesh = self._mesh_from_armature(depsgraph)
        channels = armatures.read_channels(evaluated).astype(np.float64)[self._used]
        moved = to_mesh @ channels @ np.linalg.inv(to_mesh) @ self._bind
        return np.concatenate([moved, self.skeleton.bind[len(moved) :]])

    def skinned(self, posed: np.ndarray) -> np.ndarray:
        """Returns (V, 3) float32: the positions by linear skinning."""
        motions = posed @ np.linalg.inv(self.skeleton.bind)
        return sinew_native.skin_linear(self._native, np.ascontiguousarray(motions, np.float32))


def _modifier_of(ob):
    shown = [modifier for modifier in ob.modifiers if modifier.show_viewport and not nodes.is_sinew(modifier)]
    armature = [modifier for modifier in shown if modifier.type == "ARMATURE" and modifier.object is not None]
    others = [modifier.name for modifier in shown if modifier not in armature]
    if others or len(armature) != 1:
        raise NotLinear(f"{others[0]} deforms it" if others else "its only deformer is not a single Armature modifier")
    modifier = armature[0]
    if ob.data.shape_keys is not None:
        raise NotLinear("shape keys deform it")
    if modifier.use_deform_preserve_volume:
        raise NotLinear(f"{modifier.name} preserves volume")
    if modifier.vertex_group or modifier.use_bone_envelopes or not modifier.use_vertex_groups:
        raise NotLinear(f"{modifier.name} uses more than vertex groups")
    return modifier


def rigid(matrix: np.ndarray) -> np.ndarray:
    """Returns a matrix with the nearest rotation and the same translation."""
    left, _, right = np.linalg.svd(matrix[:3, :3])
    found = np.eye(4)
    found[:3, :3] = left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right
    found[:3, 3] = matrix[:3, 3]
    return found


def _padded(offsets, joints, weights, joint_count):
    """Returns joints (V, K) int32 and weights (V, K) float32, padded with zeros; and whether some vertex needs the
    joint that never moves, whose number is joint_count."""
    counts = np.diff(offsets)
    width = max(1, int(counts.max(initial=1)))
    used = np.arange(width) < counts[:, None]
    all_joints, all_weights = np.zeros(used.shape, np.int32), np.zeros(used.shape, np.float32)
    all_joints[used], all_weights[used] = joints, weights
    still = counts == 0
    all_joints[still, 0], all_weights[still, 0] = joint_count, 1.0
    return (all_joints, all_weights), bool(still.any())
