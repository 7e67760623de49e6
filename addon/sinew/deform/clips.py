"""Converts the poses of a rig folder to motions of joints. Pure: numpy and the native library, nothing of Blender.

Letters: V vertices, J joints, P poses, F frames.
Matrices are indexed [bone, row, column] and act on column vectors.
"""

from dataclasses import dataclass

import numpy as np

from ..native import sinew_native


def transformed(matrix, points):
    """Returns points (V, 3) transformed by a 4x4 matrix; None is the identity."""
    return points if matrix is None else points @ matrix[:3, :3].T + matrix[:3, 3]


@dataclass
class ClipPose:
    """One moment of a clip, per joint. `rotation` and `location` are the values for a pose bone."""

    skinning: np.ndarray  # (J, 4, 4) float32, F(j) A(j)^-1 in the space of the rig
    location: np.ndarray  # (J, 3)
    rotation: np.ndarray  # (J, 4) w x y z


class RotationClip:
    """Poses of a rig folder: rotations that are converted by forward kinematics."""

    def __init__(self, skeleton, poses, bone_axes):
        """bone_axes (J, 3, 3): the columns are the rest axes of the joint's bone, in the space of the rig."""
        self.length = poses.pose_count
        self._skeleton = skeleton
        self._poses = poses
        self._bone_axes = bone_axes
        joints = skeleton.joint_count
        self._location = np.zeros((joints, 3))
        self._local = np.empty((joints, 4, 4))
        self._world = np.empty((joints, 4, 4))
        self._skinning = np.empty((joints, 4, 4), np.float32)

    def at(self, time, loop):
        """Returns the ClipPose at a time, in poses from 0. Its arrays are reused by the next call."""
        rotations = self._poses.sample(time, loop)
        sinew_native.rotation_transforms(rotations, self._local)
        sinew_native.forward_kinematics(self._skeleton, self._local, self._world)
        sinew_native.skinning_matrices(self._skeleton, self._world, self._skinning)
        # The joint uses the rig's axes and the bone its own: express the same rotation in the bone's axes.
        seen = rotations.copy()
        seen[:, 1:] = np.einsum("jab,ja->jb", self._bone_axes, rotations[:, 1:])
        return ClipPose(self._skinning, self._location, seen)


class MatrixClip:
    """Frames of anim.dmat, which contains the skinning matrices themselves. Between frames they are interpolated
    entry by entry, which is exact on frames and close to the true motion between neighbours."""

    def __init__(self, parents, matrices, bone_matrices):
        """parents (J,); matrices (F, J, 4, 4); bone_matrices (J, 4, 4): rest pose, in the space of the rig."""
        self.length = len(matrices)
        self._matrices = matrices
        relative = matrices.copy()
        has_parent = parents >= 0
        parent_matrices = matrices[:, parents[has_parent]]
        relative[:, has_parent] = np.linalg.solve(parent_matrices, matrices[:, has_parent])
        basis = np.linalg.inv(bone_matrices) @ relative @ bone_matrices
        self._locations = basis[..., :3, 3]
        self._rotations = continuous(quaternions(basis[..., :3, :3]))

    def at(self, time, loop):
        """Returns the ClipPose at a time, in frames from 0."""
        time = time % self.length if loop else min(max(time, 0), self.length - 1)
        before = min(int(time), self.length - 1)
        after = (before + 1) % self.length if loop else min(before + 1, self.length - 1)
        blend = time - before

        def mixed(frames):
            return frames[before] if blend == 0 else ((1 - blend) * frames[before] + blend * frames[after])

        rotation = mixed(self._rotations)
        rotation = rotation / np.linalg.norm(rotation, axis=-1, keepdims=True)
        return ClipPose(mixed(self._matrices).astype(np.float32), mixed(self._locations), rotation)


def quaternions(matrices):
    """Converts rotations (..., 3, 3) to unit quaternions (..., 4), w x y z.

    Bar-Itzhack, "New method for extracting the quaternion from a rotation matrix", 2000: the
    eigenvector of the largest eigenvalue; it also finds the nearest rotation of a noisy matrix.
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


def continuous(rotations):
    """Flips the sign of quaternions (F, J, 4) whose frame is in the hemisphere opposite to the frame before."""
    flips = np.where(np.sum(rotations[1:] * rotations[:-1], axis=-1) < 0, -1.0, 1.0)
    rotations = rotations.copy()
    rotations[1:] *= np.cumprod(flips, axis=0)[..., None]
    return rotations
