"""RotationCenters, Progress and skin_rotation_centers."""

import gc
import threading
import time

import numpy as np
import pytest
import sinew_native as sinew

import reference
import rigs
from test_skeleton import said
from test_threads import assert_runs_beside


@pytest.fixture
def random():
    return np.random.default_rng(16)


def sheet(side, joints):
    """(skin, face_offsets, face_vertices): a square of quads; the joints' weights fall along it."""
    x, y = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), 0.1 * np.sin(3 * x.ravel())])
    weights = np.exp(-2 * (x.reshape(-1, 1) - np.linspace(-1, 1, joints)) ** 2)
    weights /= weights.sum(axis=1)[:, None]
    corner = np.arange(side * side).reshape(side, side)
    quads = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]], axis=-1).reshape(-1, 4)
    return sinew.Skin.from_dense(points, weights), 4 * np.arange(len(quads) + 1), quads.ravel()


def all_pairs(skin, triangles, sigma):
    """The formula in double, over all triangles, for a skin whose vertices have all joints."""
    weights = skin.weights.reshape(skin.vertex_count, -1).astype(np.float64)
    points = skin.rest_positions.astype(np.float64)[triangles]
    area = np.linalg.norm(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]), axis=1) / 2
    own = weights[triangles].mean(axis=1)
    similarity = np.zeros((len(weights), len(triangles)))
    for j in range(weights.shape[1]):
        for k in range(weights.shape[1]):
            if j != k:
                apart = np.outer(weights[:, j], own[:, k]) - np.outer(weights[:, k], own[:, j])
                product = np.outer(weights[:, j] * weights[:, k], own[:, j] * own[:, k])
                similarity += product * np.exp(-((apart / sigma) ** 2))
    similarity *= area
    return similarity @ points.mean(axis=1) / similarity.sum(axis=1)[:, None]


def test_centers_are_those_of_the_formula():
    skin, offsets, vertices = sheet(15, 3)
    quads = vertices.reshape(-1, 4)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    for sigma in (0.1, 0.3):
        centers = sinew.RotationCenters.compute(skin, offsets, vertices, sigma)
        assert centers.has_center.all() and centers.count == skin.vertex_count
        assert np.allclose(centers.centers, all_pairs(skin, triangles, sigma), rtol=0, atol=1e-3)
    assert np.array_equal(
        sinew.RotationCenters.compute(skin, offsets, vertices).centers,
        sinew.RotationCenters.compute(skin, offsets, vertices, sigma=0.1).centers,
    )


def test_skinning_is_the_formula(random):
    """Joints that stay and joints that turn about one axis: the blended quaternion turns by 2 atan(z / w)."""
    skin, positions, weights = rigs.dense_skin(random, 300, 6)
    matrices = np.tile(np.eye(4, dtype=np.float32), (6, 1, 1))
    matrices[1::2, :2, :2] = [[0.6, -0.8], [0.8, 0.6]]  # cos of the half angle: sqrt 0.8
    matrices[1::2, :3, 3] = 1, 2, 3
    points, has_center = random.uniform(-1, 1, (300, 3)).astype(np.float32), random.random(300) < 0.8
    has_center[0] = False  # nothing moves it
    turning = weights[:, 1::2].sum(axis=1)
    angle = 2 * np.arctan2(turning * np.sqrt(0.2), 1 - turning + turning * np.sqrt(0.8))
    x, y, z = (positions - points).astype(np.float64).T
    turned = np.column_stack([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle), z])
    expected = turned + reference.skin_linear(points, weights, matrices)
    expected = np.where(has_center[:, None], expected, reference.skin_linear(positions, weights, matrices))
    centers = sinew.RotationCenters(points, has_center)
    assert np.allclose(sinew.skin_rotation_centers(skin, centers, matrices), expected, rtol=0, atol=2e-6)


@pytest.fixture
def subject(random):
    """(skin, matrices, centers)"""
    skin, _, _ = rigs.dense_skin(random, 300, 8)
    centers = sinew.RotationCenters(random.uniform(-1, 1, (300, 3)), np.arange(300) % 3 > 0)
    return skin, rigs.random_matrices(random, 8, dtype=np.float32), centers


def test_every_way_in_gives_the_same(subject):
    skin, matrices, centers = subject
    expected = sinew.skin_rotation_centers(skin, centers, matrices)
    linear = sinew.skin_linear(skin, matrices)
    assert np.array_equal(expected[::3], linear[::3]) and not np.array_equal(expected, linear)
    out = np.zeros_like(expected)
    assert sinew.skin_rotation_centers(skin, centers, matrices, out) is out
    assert np.array_equal(out, expected)
    out[:] = 0
    sinew.skin_all([(skin, matrices, out, "rotation_centers", "polar", None, centers)])
    assert np.array_equal(out, expected)
    deformer = sinew.Deformer([sinew.Layer(skin, "rotation_centers", data=centers)])
    del centers
    gc.collect()
    out[:] = 0
    deformer.deform([(matrices, None)], out)
    assert np.array_equal(out, expected)


def test_centers_are_read_out_and_given_back():
    skin, offsets, vertices = sheet(12, 2)
    centers = sinew.RotationCenters.compute(skin, offsets, vertices)
    again = sinew.RotationCenters(centers.centers, centers.has_center)
    assert np.array_equal(again.centers, centers.centers) and np.array_equal(again.has_center, centers.has_center)
    assert (again.method, again.vertex_count) == ("rotation_centers", 144)
    some = sinew.RotationCenters(np.full((2, 3), [[1], [np.nan]]), np.array([True, False]))
    assert some.centers.tolist() == [[1, 1, 1], [0, 0, 0]] and some.has_center.tolist() == [True, False]
    assert some.centers.dtype == np.float32 and some.has_center.dtype == bool and some.count == 1


def test_the_gil_is_released():
    skin, offsets, vertices = sheet(60, 4)
    assert_runs_beside(lambda: sinew.RotationCenters.compute(skin, offsets, vertices))
    centers = sinew.RotationCenters.compute(skin, offsets, vertices)
    matrices = np.tile(np.eye(4, dtype=np.float32), (200, 4, 1, 1))
    assert_runs_beside(lambda: sinew.skin_rotation_centers(skin, centers, matrices))


def test_another_thread_watches_and_cancels():
    skin, offsets, vertices = sheet(300, 12)  # takes a second
    progress, ended = sinew.Progress(), []

    def compute():
        ended.append(sinew.RotationCenters.compute(skin, offsets, vertices, progress=progress))

    worker = threading.Thread(target=compute)
    worker.start()
    while progress.fraction < 0.3:
        time.sleep(0.001)
    progress.cancel()
    worker.join()
    assert ended == [None] and progress.is_cancelled and progress.fraction < 1


def test_progress_goes_from_0_to_1():
    progress = sinew.Progress()
    assert progress.fraction == 0
    sinew.RotationCenters.compute(*sheet(10, 2), progress=progress)
    assert progress.fraction == 1


def test_refuses_what_is_wrong(subject):
    skin, matrices, centers = subject
    faces = (np.array([0, 3]), np.array([0, 1, 2]))
    compute = sinew.RotationCenters.compute
    assert said(compute, skin, *faces, 0) == "sigma is 0; expected a number above 0"
    assert said(compute, skin, faces[0], faces[1] + 300) == "face_vertices names vertex 300; the mesh has 300 vertices"
    assert said(compute, skin, faces[0] * 1.0, faces[1]) == "face_offsets is float64; expected integers"
    made = sinew.RotationCenters
    assert said(made, np.zeros((2, 2)), np.ones(2, bool)) == "centers has shape (2, 2); expected (V, 3)"
    assert said(made, np.zeros((2, 3)), np.ones(2)) == "has_center is float64; expected bool"
    assert said(made, np.zeros((2, 3)), np.ones((2, 1), bool)) == "has_center has shape (2, 1); expected (V,)"
    assert said(made, np.zeros((3, 3)), np.ones(2, bool)) == (
        "centers has 9 numbers; expected 6, three a vertex of has_center"
    )
    assert said(made, np.full((2, 3), np.inf), np.ones(2, bool)) == "the center of vertex 0 is not finite"
    other = made(np.zeros((299, 3)), np.ones(299, bool))
    assert said(sinew.skin_rotation_centers, skin, other, matrices) == "the data has 299 vertices; the skin has 300"
    assert (
        said(sinew.Layer, skin, "rotation_centers")
        == "the method rotation_centers needs data of its own; pass it as data"
    )
    assert said(sinew.Layer, skin, "blended", data=centers) == (
        "the data is of the method rotation_centers; the method is blended"
    )
