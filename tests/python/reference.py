"""The oracle, in numpy and double: slow, obvious formulas."""

import numpy as np


def forward_kinematics(parents, rest, local):
    """F(j) = F(p(j)) R(j) T(j) for one frame, by recursion."""

    def world(j):
        own = rest[j] @ local[j].astype(np.float64)
        return own if parents[j] < 0 else world(parents[j]) @ own

    return np.array([world(j) for j in range(len(parents))]).reshape(-1, 4, 4)


def skin_linear(rest, weights, matrices):
    """rest (V, 3), dense weights (V, J), matrices (J, 4, 4)."""
    points = np.column_stack([rest, np.ones(len(rest))])
    moved = np.einsum("vj,jrc,vc->vr", weights, matrices.astype(np.float64), points)[:, :3]
    return np.where(weights.any(axis=1)[:, None], moved, rest)


def quaternion(matrix):
    """w x y z of a rotation matrix: the eigenvector for the largest eigenvalue (Bar-Itzhack)."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = matrix[:3, :3]
    k = np.array(
        [
            [xx - yy - zz, 0, 0, 0],
            [yx + xy, yy - xx - zz, 0, 0],
            [zx + xz, zy + yz, zz - xx - yy, 0],
            [zy - yz, xz - zx, yx - xy, xx + yy + zz],
        ]
    )
    x, y, z, w = np.linalg.eigh(k)[1][:, -1]
    return np.array([w, x, y, z])


def rotation(q):
    """The rotation matrix of a unit quaternion w x y z."""
    w, x, y, z = q
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def multiply(p, q):
    return np.concatenate([[p[0] * q[0] - p[1:] @ q[1:]], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])])


def skin_dual_quaternion(rest, offsets, joints, weights, matrices):
    """Kavan 2008 for rigid matrices (J, 4, 4), signs against the running sum in stored order."""
    real = np.array([quaternion(m) for m in matrices.astype(np.float64)])
    dual = np.array([multiply(np.array([0, *m[:3, 3]]), q) / 2 for m, q in zip(matrices, real)])
    moved = rest.astype(np.float64)
    for v in range(len(rest)):
        r, d = np.zeros(4), np.zeros(4)
        for joint, weight in zip(joints[offsets[v] : offsets[v + 1]], weights[offsets[v] : offsets[v + 1]]):
            signed = -float(weight) if r @ real[joint] < 0 else float(weight)
            r, d = r + signed * real[joint], d + signed * dual[joint]
        if r.any():
            length = np.linalg.norm(r)
            r, d = r / length, d / length
            moved[v] = rotation(r) @ rest[v] + 2 * multiply(d, r * [1, -1, -1, -1])[1:]
    return moved
