"""The oracle of direct delta mush: the formulas of its header in double, dense, with a solver for any matrix."""

import numpy as np


def triangles(face_offsets, face_vertices):
    """The fan around the first corner of each face, (T, 3)."""
    faces = [face_vertices[a:b] for a, b in zip(face_offsets, face_offsets[1:])]
    return np.array([(f[0], f[i - 1], f[i]) for f in faces for i in range(2, len(f))], int).reshape(-1, 3)


def cotangent_laplacian(positions, corners):
    """Minus half the sum of the cotangents of the angles across each edge; (rows, columns, values)."""
    rows, columns, values = [], [], []
    for i in range(3):
        a, b, c = (corners[:, (i + k) % 3] for k in range(3))  # the angle at a lies across b c
        u, w = positions[b] - positions[a], positions[c] - positions[a]
        angle = np.arctan2(np.linalg.norm(np.cross(u, w), axis=1), (u * w).sum(axis=1))
        half = 0.5 / np.tan(angle)
        rows += [b, c, b, c]
        columns += [c, b, b, c]
        values += [-half, -half, half, half]
    return np.concatenate(rows), np.concatenate(columns), np.concatenate(values)


def uniform_laplacian(face_offsets, face_vertices):
    edges = set()
    for a, b in zip(face_offsets, face_offsets[1:]):
        face = face_vertices[a:b]
        edges |= {tuple(sorted(edge)) for edge in zip(face, np.roll(face, -1)) if edge[0] != edge[1]}
    a, b = np.array(sorted(edges), int).reshape(-1, 2).T
    one = np.ones(len(a))
    return np.concatenate([a, b, a, b]), np.concatenate([b, a, a, b]), np.concatenate([-one, -one, one, one])


def smoother(laplacian, vertices, strength, iterations):
    """((I + strength L D^-1)^T)^-iterations, (V, V), of an L given by triplets; where D is 0 nothing is smoothed."""
    dense = np.zeros((vertices, vertices))
    np.add.at(dense, laplacian[:2], laplacian[2])
    diagonal = dense.diagonal()
    system = np.eye(vertices) + strength * (dense / np.where(diagonal > 0, diagonal, 1)).T
    return np.linalg.matrix_power(np.linalg.inv(system), iterations)


def smoother_rows(laplacian, vertices, strength, iterations, which):
    """Those rows of it, of a large mesh, by a sparse LU decomposition."""
    from scipy import sparse
    from scipy.sparse.linalg import splu

    matrix = sparse.coo_matrix((laplacian[2], laplacian[:2]), (vertices, vertices)).tocsc()
    solver = splu((sparse.eye(vertices) + strength * (matrix @ sparse.diags(1 / matrix.diagonal())).T).tocsc())
    columns = np.zeros((vertices, len(which)))
    columns[which, np.arange(len(which))] = 1
    for _ in range(iterations):
        columns = solver.solve(columns, trans="T")
    return columns.T


def omega(rest, weights, by_shape, by_weight, blend):
    """Omega (N, J, 4, 4) and p (N, 3) of the vertices whose N rows of both smoothings are given."""
    u = np.column_stack([rest, np.ones(len(rest))])
    field = np.einsum("vj,va,vb->vjab", weights, u, u)
    psi = (by_shape @ field.reshape(len(rest), -1)).reshape(-1, *field.shape[1:])
    column = psi.sum(axis=1)[:, :, 3]
    p = column / column[:, 3:]
    flat = np.einsum("vj,va,vb->vjab", by_weight @ weights, p, p)
    return (1 - blend) * psi + blend * flat, p[:, :3]


def small_omega(
    character, weights=None, laplacian="cotangent", smoothing=3.0, weight_smoothing=1.0, blend=0.8, iterations=20
):
    """Of all vertices of a small character (positions, face_offsets, face_vertices, weights)."""
    positions, offsets, vertices, own = character
    rest = positions.astype(float)
    entries = (
        uniform_laplacian(offsets, vertices)
        if laplacian == "uniform"
        else cotangent_laplacian(rest, triangles(offsets, vertices))
    )
    by_shape = smoother(entries, len(rest), smoothing, iterations)
    by_weight = smoother(entries, len(rest), weight_smoothing, iterations)
    return omega(rest, own if weights is None else weights, by_shape, by_weight, blend)


def nearest_rotations(matrices):
    u, _, vt = np.linalg.svd(matrices)
    sign = np.ones(matrices.shape[:-1])
    sign[..., 2] = np.linalg.det(u @ vt)
    return (u * sign[..., None, :]) @ vt


def deform(rest, omega, matrices):
    """v' = R v + q - R p."""
    q = np.einsum("jac,vjcb->vab", matrices.astype(np.float64), omega)
    q /= q[:, 3:, 3:]
    p, top = q[:, 3, :3], q[:, :3, 3]
    rotation = nearest_rotations(q[:, :3, :3] - top[:, :, None] * p[:, None, :])
    return top + np.einsum("vab,vb->va", rotation, rest - p)
