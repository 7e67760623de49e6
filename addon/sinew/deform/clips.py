"""Converts the poses of a rig folder to motions of joints. Uses only numpy and the native library, nothing of Blender.

Letters: V vertices, J joints, P poses, F frames.
Matrices are indexed [bone, row, column] and act on column vectors.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..native import sinew_native


def transformed(matrix: np.ndarray | None, points: np.ndarray) -> np.ndarray:
    """Returns points (V, 3) transformed by a 4x4 matrix; None is the identity."""
    return points if matrix is None else points @ matrix[:3, :3].T + matrix[:3, 3]


@dataclass
class ClipPose:
    """The pose of all joints at one time of a clip. `rotation` and `location` are the values for a pose bone."""

    skinning: np.ndarray  # (J, 4, 4) float32, F(j) A(j)^-1 in rig space
    location: np.ndarray  # (J, 3)
    rotation: np.ndarray  # (J, 4) w x y z


class RotationClip:
    """A clip of joint rotations, which forward kinematics converts to transforms."""

    def __init__(self, skeleton: Any, poses: Any, bone_axes: np.ndarray) -> None:
        """Takes a sinew_native.Skeleton and a sinew_native.PoseClip. bone_axes (J, 3, 3): the columns are the rest axes
        of the joint's bone, in rig space."""
        self.length = poses.pose_count
        self._skeleton = skeleton
        self._poses = poses
        self._bone_axes = bone_axes
        joints = skeleton.joint_count
        self._location = np.zeros((joints, 3))
        self._local = np.empty((joints, 4, 4))
        self._world = np.empty((joints, 4, 4))
        self._skinning = np.empty((joints, 4, 4), np.float32)

    def at(self, time: float, loop: bool) -> ClipPose:
        """Returns the ClipPose at a time, in poses from 0. Its arrays are reused by the next call."""
        rotations = self._poses.sample(time, loop)
        sinew_native.rotation_transforms(rotations, self._local)
        sinew_native.forward_kinematics(self._skeleton, self._local, self._world)
        sinew_native.skinning_matrices(self._skeleton, self._world, self._skinning)
        # The rotations are in the axes of the rig; a pose bone needs them in its own rest axes.
        seen = rotations.copy()
        seen[:, 1:] = np.einsum("jab,ja->jb", self._bone_axes, rotations[:, 1:])
        return ClipPose(self._skinning, self._location, seen)


class MatrixClip:
    """A clip of skinning matrices, as stored in anim.dmat. Between frames they are interpolated entry by entry, which
    is close to the true motion; on frames it is exact."""

    def __init__(self, parents: np.ndarray, matrices: np.ndarray, bone_matrices: np.ndarray) -> None:
        """Takes parents (J,), skinning matrices (F, J, 4, 4) and the bones' rest matrices (J, 4, 4), in rig space."""
        self.length = len(matrices)
        self._matrices = matrices
        relative = matrices.copy()
        has_parent = parents >= 0
        parent_matrices = matrices[:, parents[has_parent]]
        relative[:, has_parent] = np.linalg.solve(parent_matrices, matrices[:, has_parent])
        basis = np.linalg.inv(bone_matrices) @ relative @ bone_matrices
        self._locations = basis[..., :3, 3]
        self._rotations = continuous(quaternions(basis[..., :3, :3]))

    def at(self, time: float, loop: bool) -> ClipPose:
        """Returns the ClipPose at a time, in frames from 0."""
        time = time % self.length if loop else min(max(time, 0), self.length - 1)
        before = min(int(time), self.length - 1)
        after = (before + 1) % self.length if loop else min(before + 1, self.length - 1)
        blend = time - before

        def mixed(frames: np.ndarray) -> np.ndarray:
            return frames[before] if blend == 0 else ((1 - blend) * frames[before] + blend * frames[after])

        rotation = mixed(self._rotations)
        rotation = rotation / np.linalg.norm(rotation, axis=-1, keepdims=True)
        return ClipPose(mixed(self._matrices).astype(np.float32), mixed(self._locations), rotation)


def quaternions(matrices: np.ndarray) -> np.ndarray:
    """Converts rotations (..., 3, 3) to unit quaternions (..., 4), w x y z.

    Bar-Itzhack, "New method for extracting the quaternion from a rotation matrix", 2000: the eigenvector of the
    largest eigenvalue. For a noisy matrix this is the nearest rotation.
    """
    m = matrices
    k = np.empty(m.shape[:-2] + (4, 4))
    k[..., 0, 0] = m[..., 0, 0] + m[..., 1, 1] + m[..., 2, 2]
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        k[..., 0, a + 1] = k[..., a + 1, 0] = m[..., c, b] - m[..., b, c]
        k[..., a + 1, a + 1] = m[..., a, a] - m[..., b, b] - m[..., c, c]
        k[..., a + 1, b + 1] = k[..., b + 1, a + 1] = m[..., a, b] + m[..., b, a]
    return np.linalg.eigh(k)[1][..., -1]


def continuous(rotations: np.ndarray) -> np.ndarray:
    """Returns quaternions (F, J, 4) with signs such that each is in the same hemisphere as on the frame before."""
    flips = np.where(np.sum(rotations[1:] * rotations[:-1], axis=-1) < 0, -1.0, 1.0)
    rotations = rotations.copy()
    rotations[1:] *= np.cumprod(flips, axis=0)[..., None]
    return rotations
