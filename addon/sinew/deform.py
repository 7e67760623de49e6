"""From poses to vertex positions. Pure: numpy and the native library, nothing of Blender.

Letters: V vertices, J joints (of a rig's clip), B bones (of an armature), P poses, F frames.
Matrices are indexed [bone, row, column] and act on column vectors.
"""

from dataclasses import dataclass

import numpy as np

from .native import sinew_native

def is_similarity(matrix):
    """Whether a 4x4 matrix only turns, moves and scales uniformly."""
    linear = matrix[:3, :3]
    gram = linear.T @ linear
    scale = np.trace(gram) / 3
    return np.linalg.det(linear) > 0 and np.allclose(gram, scale * np.eye(3), atol=1e-6 * scale)


class Deformer:
    """One mesh and its influences: joint matrices in, vertex positions out."""

    def __init__(self, rest_positions, influences, rest_frames, stretch, mask=None):
        """rest_positions (V, 3), mesh space; influences as `influences.influences` gives them;
        rest_frames (J + 1, 4, 4): of the joints, relative to the armature; stretch: how dual
        quaternions treat scale, as sinew_native names it; mask (V,): of dual quaternions, how much
        of the motion each vertex takes part in (with linear skinning it is in the influences)."""
        self.influences = influences
        self.skin = self._make_skin(rest_positions)
        self._rest_positions = rest_positions
        self.rest_frames, self._stretch = rest_frames, stretch
        self._mask = None if mask is None else mask[:, None].astype(np.float32)
        self._armature_skin = None
        self._armature_skin_key = None
        self._in_armature_space = False  # the last job was

    def has_rest(self, rest_positions):
        return np.array_equal(rest_positions, self._rest_positions)

    def set_rest(self, rest_positions):
        """Another shape under the same influences, (V, 3), mesh space."""
        self.skin.set_rest_positions(rest_positions)
        self._rest_positions = rest_positions
        self._armature_skin_key = None

    def job(self, method, matrices, mesh_from_armature, out):
        """What `sinew_native.skin_all` is to do; `finish` comes after it.

        matrices (J + 1, 4, 4) float32: each joint's motion from rest to pose, armature space, the
        last the identity.
        mesh_from_armature (4, 4) float64, or None where the two spaces are the same.
        out (V, 3) float32: where the shape goes, mesh space.
        """
        skin, frames, change = self.skin, self.rest_frames, mesh_from_armature
        linear = method == "LINEAR"
        self._in_armature_space = change is not None and not (linear or is_similarity(change))
        if self._in_armature_space:
            # A dual quaternion cannot carry the change of space: blend in the armature's space.
            skin = self._skin_in_armature_space(change)
        elif change is not None:
            matrices = (change @ matrices @ np.linalg.inv(change)).astype(np.float32)
        if linear:
            return skin, matrices, out, "linear"
        if change is not None and not self._in_armature_space:
            frames = change @ frames
            frames[:, :3, :3] /= np.cbrt(np.linalg.det(change[:3, :3]))
        return skin, matrices, out, "dual_quaternion", self._stretch, frames

    def finish(self, positions, mesh_from_armature):
        """What is left to do to the last job's positions, (V, 3), in place."""
        if self._in_armature_space:
            positions[:] = transformed(mesh_from_armature, positions)
        if self._mask is not None:
            positions += (1 - self._mask) * (self._rest_positions - positions)

    def _make_skin(self, rest_positions):
        own = self.influences
        return sinew_native.Skin(
            rest_positions, own.offsets, own.joints, own.weights, own.joint_count + 1)

    def _skin_in_armature_space(self, mesh_from_armature):
        key = mesh_from_armature.tobytes()
        if key != self._armature_skin_key:
            rest = transformed(np.linalg.inv(mesh_from_armature), self._rest_positions)
            self._armature_skin = self._make_skin(rest)
            self._armature_skin_key = key
        return self._armature_skin


def transformed(matrix, points):
    """points (V, 3) moved by a 4x4 matrix; None is the identity."""
    return points if matrix is None else points @ matrix[:3, :3].T + matrix[:3, 3]


@dataclass
class ClipPose:
    """One moment of a clip, by joint. `rotation` and `location` are what a pose bone is set to."""

    skinning: np.ndarray  # (J, 4, 4) float32, F(j) A(j)^-1 in the space of the rig
    location: np.ndarray  # (J, 3)
    rotation: np.ndarray  # (J, 4) w x y z


class RotationClip:
    """Poses of a rig folder: rotations that go through forward kinematics."""

    def __init__(self, skeleton, poses, bone_axes):
        """bone_axes (J, 3, 3): columns are the rest axes of the joint's bone, space of the rig."""
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
        """time counts poses from 0. The arrays of the result are reused by the next call."""
        rotations = self._poses.sample(time, loop)
        sinew_native.rotation_transforms(rotations, self._local)
        sinew_native.forward_kinematics(self._skeleton, self._local, self._world)
        sinew_native.skinning_matrices(self._skeleton, self._world, self._skinning)
        # The joint's axes are the rig's, the bone's are its own: the same turn, seen from there.
        seen = rotations.copy()
        seen[:, 1:] = np.einsum("jab,ja->jb", self._bone_axes, rotations[:, 1:])
        return ClipPose(self._skinning, self._location, seen)


class MatrixClip:
    """Frames of anim.dmat: skinning matrices given outright. Between frames they are mixed
    entry by entry, which is exact on frames and close between neighbours."""

    def __init__(self, parents, matrices, bone_matrices):
        """parents (J,); matrices (F, J, 4, 4); bone_matrices (J, 4, 4): rest, space of the rig."""
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
        """time counts frames from 0."""
        time = time % self.length if loop else min(max(time, 0), self.length - 1)
        before = min(int(time), self.length - 1)
        after = (before + 1) % self.length if loop else min(before + 1, self.length - 1)
        blend = time - before

        def mixed(frames):
            return frames[before] if blend == 0 else (
                (1 - blend) * frames[before] + blend * frames[after])

        rotation = mixed(self._rotations)
        rotation = rotation / np.linalg.norm(rotation, axis=-1, keepdims=True)
        return ClipPose(mixed(self._matrices).astype(np.float32), mixed(self._locations), rotation)


def quaternions(matrices):
    """(..., 3, 3) rotations -> (..., 4) unit quaternions w x y z.

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
    """Flip the sign of (F, J, 4) quaternions where a frame lies opposite to the one before."""
    flips = np.where(np.sum(rotations[1:] * rotations[:-1], axis=-1) < 0, -1.0, 1.0)
    rotations = rotations.copy()
    rotations[1:] *= np.cumprod(flips, axis=0)[..., None]
    return rotations
