"""Rotations, forward kinematics and linear blend skinning in plain numpy.

J skeleton rows, P poses, V vertices, B weight columns. Quaternions are w x y z.
"""

import numpy as np


def axis_quaternion(axis, degrees):
    """Rotation about axis (3,) by degrees (any shape S): quaternions S + (4,)."""
    half = np.radians(np.asarray(degrees, float)) / 2
    unit = np.asarray(axis, float) / np.linalg.norm(axis)
    return np.concatenate([np.cos(half)[..., None], np.sin(half)[..., None] * unit], axis=-1)


def multiply(a, b):
    """Hamilton product of (..., 4) quaternions: b turns first, then a."""
    aw, ax, ay, az = np.moveaxis(np.asarray(a, float), -1, 0)
    bw, bx, by, bz = np.moveaxis(np.asarray(b, float), -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def conjugate(q):
    """Inverse of unit quaternions (..., 4)."""
    return np.asarray(q) * [1, -1, -1, -1]


def from_eulers(degrees):
    """(..., 3) degrees about X, then Y, then Z -> (..., 4)."""
    degrees = np.asarray(degrees, float)
    x, y, z = (axis_quaternion(axis, degrees[..., i]) for i, axis in enumerate(np.eye(3)))
    return multiply(z, multiply(y, x))


def to_eulers(q):
    """Unit quaternions (J, 4) -> degrees (J, 3) about X, then Y, then Z."""
    m = to_matrices(q)
    return np.degrees(
        np.stack(
            [
                np.arctan2(m[:, 2, 1], m[:, 2, 2]),
                np.arcsin(np.clip(-m[:, 2, 0], -1, 1)),
                np.arctan2(m[:, 1, 0], m[:, 0, 0]),
            ],
            axis=-1,
        )
    )


def to_matrices(q):
    """Unit quaternions (..., 4) -> rotation matrices (..., 3, 3)."""
    w, x, y, z = np.moveaxis(np.asarray(q, float), -1, 0)
    rows = [
        1 - 2 * (y * y + z * z),
        2 * (x * y - w * z),
        2 * (x * z + w * y),
        2 * (x * y + w * z),
        1 - 2 * (x * x + z * z),
        2 * (y * z - w * x),
        2 * (x * z - w * y),
        2 * (y * z + w * x),
        1 - 2 * (x * x + y * y),
    ]
    return np.stack(rows, axis=-1).reshape(np.shape(q)[:-1] + (3, 3))


def from_matrix(m):
    """Rotation matrix (3, 3) -> quaternion (4,) with w >= 0; half turns are not needed here."""
    w = np.sqrt(max(1 + np.trace(m), 1e-12)) / 2
    return np.array([w, (m[2, 1] - m[1, 2]) / (4 * w), (m[0, 2] - m[2, 0]) / (4 * w), (m[1, 0] - m[0, 1]) / (4 * w)])


def same_hemisphere(poses):
    """Chooses the sign of each quaternion of (P, J, 4) that lies next to the pose before."""
    poses = poses.copy()
    poses[0][poses[0, :, 0] < 0] *= -1
    for before, pose in zip(poses[:-1], poses[1:]):
        pose[(before * pose).sum(axis=-1) < 0] *= -1
    return poses


def rest_positions(parents, offsets):
    """Joint positions (J, 3) of parents (J,) and offsets (J, 3); parents come first."""
    positions = np.array(offsets, float)
    for joint, parent in enumerate(parents):
        if parent >= 0:
            positions[joint] += positions[parent]
    return positions


def skinning_matrices(parents, origins, quaternions):
    """F(j) A(j)^-1 as (J, 3, 4) for one pose (J, 4).

    origins (J, 3): the point that row j turns about, in the rest pose. In the bone convention
    that is the parent joint's position, in the joint convention the joint's own.
    """
    rotations = to_matrices(quaternions)
    result = np.empty((len(parents), 3, 4))
    for joint, parent in enumerate(parents):
        local = np.column_stack([rotations[joint], origins[joint] - rotations[joint] @ origins[joint]])
        if parent >= 0:
            local[:, 3] = result[parent, :, :3] @ local[:, 3] + result[parent, :, 3]
            local[:, :3] = result[parent, :, :3] @ local[:, :3]
        result[joint] = local
    return result


def turning_points(parents, positions, bone_convention):
    """Rest point (J, 3) about which each row's rotation turns."""
    if not bone_convention:
        return positions
    return np.where(np.asarray(parents)[:, None] >= 0, positions[np.maximum(parents, 0)], positions)


def skin_linear(vertices, weights, matrices):
    """vertices (V, 3), weights (V, B), matrices (B, 3, 4) of the weight columns -> (V, 3)."""
    blended = np.tensordot(weights, matrices, axes=1)
    return np.einsum("vij,vj->vi", blended[:, :, :3], vertices) + blended[:, :, 3]
