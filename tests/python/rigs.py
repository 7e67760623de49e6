"""Skeletons, poses and skins to try things on."""

from pathlib import Path

import numpy as np
import pytest
import sinew_native as sinew

import reference

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared" / "rigs"  # other people's rigs, not part of the project

needs_shared_rigs = pytest.mark.skipif(not SHARED.is_dir(), reason=f"no {SHARED}")


def random_matrices(random, *shape, size=1.0, dtype=np.float64):
    """Rigid transforms, (*shape, 4, 4)."""
    count = int(np.prod(shape))
    q = random.normal(size=(count, 4))
    q /= np.linalg.norm(q, axis=1)[:, None]
    matrices = np.tile(np.eye(4), (count, 1, 1))
    matrices[:, :3, :3] = [reference.rotation(one) for one in q]
    matrices[:, :3, 3] = random.uniform(-size, size, (count, 3))
    return matrices.reshape(*shape, 4, 4).astype(dtype)


def forest(random, count):
    """Several roots, parents that come after their children."""
    names = random.permutation(count)
    parents = np.full(count, -1)
    for i in range(1, count):
        if random.random() < 0.9:
            parents[names[i]] = names[random.integers(i)]
    return parents


def skeleton(random, count):
    parents = forest(random, count)
    rest = random_matrices(random, count)
    return sinew.Skeleton(parents, rest), parents, rest


def dense_skin(random, vertices, joints):
    """A Skin and its dense weights as float32 sees them; vertex 0 has no influence."""
    weights = random.random((vertices, joints)) * (random.random((vertices, joints)) < 0.3)
    weights[:, 0] += 0.01
    weights /= weights.sum(axis=1)[:, None]
    weights[0] = 0
    positions = random.uniform(-1, 1, (vertices, 3)).astype(np.float32)
    skin = sinew.Skin.from_dense(positions, weights)
    return skin, positions, weights.astype(np.float32).astype(np.float64)


def layouts(matrices):
    """The same matrices in memory of their own: row-major, column-major (as Blender's foreach_get delivers
    them), inside a wider array, backwards."""
    yield matrices.copy()
    yield np.ascontiguousarray(matrices.swapaxes(-1, -2)).swapaxes(-1, -2)
    wide = np.zeros((*matrices.shape[:-2], 5, 9), matrices.dtype)
    wide[..., :4, 1::2] = matrices
    yield wide[..., :4, 1::2]
    yield np.ascontiguousarray(matrices[..., ::-1, ::-1, ::-1])[..., ::-1, ::-1, ::-1]
