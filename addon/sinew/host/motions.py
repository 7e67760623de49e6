"""Reads the pose of an evaluated armature in one call."""

import functools
from typing import Any

import numpy as np

from ..native import sinew_native
from . import contract, features, proof

NO_LAYOUT = (0,) * 6  # in place of pose_layout, without any armature


@functools.cache
def _bone_layout(has_segments: bool) -> tuple[int, int, int, int]:
    """Returns byte offsets in a pose bone, the `layout` of `sinew_native.host.read_pose`. has_segments: segments of
    B-bones are read too."""
    motion = contract.offset("bPoseChannel", "*next"), contract.offset("bPoseChannel", "chan_mat")
    if not has_segments:
        return *motion, 0, 0
    start = contract.offset("bPoseChannel", "runtime")
    return (
        *motion,
        start + contract.offset("bPoseChannel_Runtime", "bbone_segments"),
        start + contract.offset("bPoseChannel_Runtime", "*bbone_deform_mats"),
    )


def pose_layout(has_segments: bool) -> tuple[int, ...]:
    """Returns byte offsets in a pose, then in its bones, the `layout` of `sinew_native.host.Shortcut`. has_segments:
    the pose has B-bones that are read. Raises contract.Broken."""
    for feature in (features.FAST_ARMATURES, *([features.SEGMENTS] if has_segments else [])):
        if not contract.has(feature):
            raise contract.Broken(contract.why_not(feature))
    array = contract.offset("bPose", "**chan_array") if contract.holds("bPose", "**chan_array") else -1
    return contract.offset("bPose", "chanbase"), array, *_bone_layout(has_segments)


def forget() -> None:
    """Discards the layout. For tests."""
    _bone_layout.cache_clear()


def pose_address_at(armature: Any) -> int:
    """Returns the address at which the address of an object's pose is stored. Raises contract.Broken."""
    return contract.region(armature, "Object", "*pose")[0]


def read(armature: Any, first_joints: np.ndarray, joint_counts: np.ndarray, out: np.ndarray) -> None:
    """Reads the motions of an evaluated armature's bones, from rest to pose, in armature space; for a B-bone, those of
    each end of a segment. The arguments are those of `sinew_native.host.read_pose`."""
    if contract.has(features.BONES):
        has_segments = contract.has(features.SEGMENTS)
        own = first_joints if has_segments else np.where(joint_counts > 1, np.int32(-1), first_joints)
        first = armature.pose.bones[0].as_pointer()
        sinew_native.host.read_pose(first, own, joint_counts, _bone_layout(has_segments), out)
        _prove(armature, own, joint_counts, out)
    if not contract.has(features.SEGMENTS):
        _ask(armature, first_joints, joint_counts, out)


def _ask(armature: Any, first_joints: np.ndarray, joint_counts: np.ndarray, out: np.ndarray) -> None:
    """Reads through the API what read cannot read by address."""
    bones, used = armature.pose.bones, first_joints >= 0
    if not contract.has(features.BONES):
        numbers = np.empty(16 * len(bones), np.float32)
        bones.foreach_get("matrix_channel", numbers)
        single = used & (joint_counts == 1)
        out[first_joints[single]] = numbers.reshape(-1, 4, 4)[single]
    for bone in np.flatnonzero(used & (joint_counts > 1)):
        first = first_joints[bone]
        out[first : first + joint_counts[bone]] = _motions_of_segments(bones[int(bone)]).transpose(0, 2, 1)


def _prove(armature: Any, first_joints: np.ndarray, joint_counts: np.ndarray, found: np.ndarray) -> None:
    """Compares with the API the motions of a bone and those of a B-bone's segments."""
    for what, feature, has_such, motions_of in (
        ("bones", features.BONES, np.equal, _motion_of),
        ("segments", features.SEGMENTS, np.greater, _motions_of_segments),
    ):
        chosen: Any = np.flatnonzero((first_joints >= 0) & has_such(joint_counts, 1)) if proof.is_due(what) else ()
        if not len(chosen):
            continue
        bone = int(chosen[-1])
        first = first_joints[bone]
        expected = motions_of(armature.pose.bones[bone])
        own = found[first : first + joint_counts[bone]].transpose(0, 2, 1)
        largest = np.abs(expected).max()
        if not np.isfinite(largest):
            continue
        if np.allclose(own, expected, rtol=0, atol=1e-3 * max(1.0, largest)):
            proof.give(what)
        else:
            contract.distrust(feature, f"the motions of {what} are not where they were")


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
