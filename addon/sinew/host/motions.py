"""Reads the pose of an evaluated armature in one call."""

import functools
from typing import Any

import numpy as np

from ..native import sinew_native
from . import contract, proof


@functools.cache
def _bone_layout() -> tuple[int, int, int, int]:
    """Returns byte offsets in a pose bone, the `layout` of `sinew_native.host.read_pose`."""
    start = contract.offset("bPoseChannel", "runtime")
    return (
        contract.offset("bPoseChannel", "*next"),
        contract.offset("bPoseChannel", "chan_mat"),
        start + contract.offset("bPoseChannel_Runtime", "bbone_segments"),
        start + contract.offset("bPoseChannel_Runtime", "*bbone_deform_mats"),
    )


@functools.cache
def pose_layout() -> tuple[int, ...]:
    """Returns byte offsets in a pose, then in its bones, the `layout` of `sinew_native.host.Shortcut`."""
    return contract.offset("bPose", "chanbase"), contract.offset("bPose", "**chan_array"), *_bone_layout()


def pose_address_at(armature: Any) -> int:
    """Returns the address at which the address of an object's pose is stored."""
    return contract.region(armature, "Object", "*pose")[0]


def read(armature: Any, first_joints: np.ndarray, joint_counts: np.ndarray, out: np.ndarray) -> None:
    """Reads the motions of an evaluated armature's bones, from rest to pose, in armature space; for a B-bone, those of
    each end of a segment. The arguments are those of `sinew_native.host.read_pose`."""
    first = armature.pose.bones[0].as_pointer()
    sinew_native.host.read_pose(first, first_joints, joint_counts, _bone_layout(), out)
    _prove(armature, first_joints, joint_counts, out)


def _prove(armature: Any, first_joints: np.ndarray, joint_counts: np.ndarray, found: np.ndarray) -> None:
    for what, has_such, motions_of in (("bones", np.equal, _motion_of), ("segments", np.greater, _motions_of_segments)):
        chosen: Any = np.flatnonzero((first_joints >= 0) & has_such(joint_counts, 1)) if proof.is_due(what) else ()
        if not len(chosen):
            continue
        bone = int(chosen[-1])
        first = first_joints[bone]
        expected = motions_of(armature.pose.bones[bone])
        own = found[first : first + joint_counts[bone]].transpose(0, 2, 1)
        largest = np.abs(expected).max()
        if np.isfinite(largest):
            near = np.allclose(own, expected, rtol=0, atol=1e-3 * max(1.0, largest))
            proof.give(what, near, f"the motions of {what} are not where they were")


def _motion_of(pose_bone: Any) -> np.ndarray:
    return np.array(pose_bone.matrix_channel, np.float64)[None]


def _motions_of_segments(pose_bone: Any) -> np.ndarray:
    """Computes the motions of the ends of n segments, (n + 1, 4, 4), as Blender's Armature modifier does."""
    rest = np.array(pose_bone.bone.matrix_local, np.float64)
    ends = range(pose_bone.bone.bbone_segments + 1)
    posed, at_rest = (
        np.array([pose_bone.bbone_segment_matrix(k, rest=is_rest) for k in ends], np.float64)
        for is_rest in (False, True)
    )
    turned = rest @ posed @ np.linalg.pinv(at_rest) @ np.linalg.pinv(rest)
    return _motion_of(pose_bone) @ turned
