"""Skin, skin_linear, skin_dual_quaternion."""

import gc
import pickle
import re
import tracemalloc

import numpy as np
import pytest
import sinew_native as sinew

import reference
import rigs
from test_skeleton import said

METHODS = [sinew.skin_linear, sinew.skin_dual_quaternion]
IDENTITY = np.eye(4, dtype=np.float32)


@pytest.fixture
def random():
    return np.random.default_rng(11)


def expected(method, skin, weights, matrices):
    if method is sinew.skin_linear:
        return reference.skin_linear(skin.rest_positions, weights, matrices)
    return reference.skin_dual_quaternion(skin.rest_positions, skin.offsets, skin.joints, skin.weights, matrices)


def test_skin_keeps_influences_in_order():
    skin = sinew.Skin(
        np.arange(6.0).reshape(2, 3), np.array([0, 3, 4]), np.array([2, 0, 2, 1]), np.array([0.5, 0.25, 0.25, 0.75]), 3
    )
    assert (skin.vertex_count, skin.joint_count, skin.influence_count) == (2, 3, 4)
    assert (skin.most_influences, skin.unweighted_count, skin.largest_sum_error) == (3, 0, 0.25)
    assert skin.rest_positions.dtype == np.float32
    assert skin.rest_positions.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert skin.offsets.dtype == np.int64 and skin.offsets.tolist() == [0, 3, 4]
    assert skin.joints.dtype == np.int32 and skin.joints.tolist() == [2, 0, 2, 1]
    assert skin.weights.dtype == np.float32 and skin.weights.tolist() == [0.5, 0.25, 0.25, 0.75]
    assert repr(skin) == "<Skin of 2 vertices, 3 joints, 4 influences>"


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_skin_from_dense(order, dtype):
    weights = np.asarray([[0.25, 0, 0.75], [0, 0, 0], [0, -1e-9, 1]], dtype, order=order)
    skin = sinew.Skin.from_dense(np.zeros((3, 3)), weights)
    assert skin.joint_count == 3 and skin.unweighted_count == 1
    assert skin.offsets.tolist() == [0, 2, 2, 4]
    assert skin.joints.tolist() == [0, 2, 1, 2]
    assert np.array_equal(skin.weights, np.float32([0.25, 0.75, -1e-9, 1]))


def test_skin_refuses_what_is_wrong():
    points, offsets, joints, weights = np.zeros((2, 3)), np.array([0, 1, 2]), np.array([0, 1]), np.ones(2)
    assert sinew.Skin(points, offsets, joints, weights, 2).vertex_count == 2
    assert (
        said(sinew.Skin, points[:, :2], offsets, joints, weights, 2)
        == "rest_positions has shape (2, 2); expected (V, 3)"
    )
    assert (
        said(sinew.Skin, points.ravel(), offsets, joints, weights, 2)
        == "rest_positions has shape (6,); expected (V, 3)"
    )
    assert (
        said(sinew.Skin, points + np.inf, offsets, joints, weights, 2) == "the rest position of vertex 0 is not finite"
    )
    assert (
        said(sinew.Skin, points, offsets[:2], joints, weights, 2)
        == "offsets has 2 entries; expected 3, one more than there are vertices"
    )
    assert said(sinew.Skin, points, offsets * 1.0, joints, weights, 2) == "offsets is float64; expected integers"
    assert said(sinew.Skin, points, offsets, joints[:, None], weights, 2) == "joints has shape (2, 1); expected (N,)"
    assert said(sinew.Skin, points, offsets, joints, weights, 1) == "influence 1 names joint 1; there are 1 joint"
    assert (
        said(sinew.Skin, points, offsets, joints + 2**40, weights, 2) == f"joints holds {2**40}, which is out of range"
    )
    assert said(sinew.Skin, points, offsets, joints, weights * np.nan, 2) == "the weight of influence 0 is not finite"
    assert (
        said(sinew.Skin, points, offsets, joints, weights * 1e39, 2) == "the weight of influence 0 is not finite"
    )  # as float32
    assert said(sinew.Skin, points, offsets, joints, weights, -1) == "joint_count is -1; expected 0 or more"
    for count in (2**24 + 1, 2**32, 2**63 - 1):
        assert (
            said(sinew.Skin, points, offsets, joints, weights, count)
            == f"joint_count is {count:,}; expected at most 16,777,216"
        )
    # Said before memory is asked for, which such arrays do not have.
    many = np.broadcast_to(np.float32(0), (2**33, 3))
    assert (
        said(sinew.Skin, many, offsets, joints, weights, 2)
        == f"there are {2**33:,} vertices; expected at most 2,147,483,647"
    )
    assert (
        said(sinew.Skin, points, offsets, np.broadcast_to(np.int32(0), 2**33), weights, 2)
        == f"there are {2**33:,} influences; expected at most 2,147,483,647"
    )
    assert said(sinew.Skin.from_dense, many, many) == f"there are {2**33:,} vertices; expected at most 2,147,483,647"
    assert said(sinew.Skin.from_dense, points, many.T) == f"joint_count is {2**33:,}; expected at most 16,777,216"
    assert said(sinew.Skin.from_dense, points, weights) == "weights has shape (2,); expected (V, J)"
    assert said(sinew.Skin.from_dense, points, np.ones((3, 2))) == "weights has 3 rows; there are 2 vertices"
    assert said(sinew.Skin.from_dense, points, np.full((2, 2), "a")) == "weights is <U1; expected real numbers"


def test_views_are_read_only_and_outlive_their_owner(random):
    skin, positions, _ = rigs.dense_skin(random, 400, 9)
    views = [skin.rest_positions, skin.offsets, skin.joints, skin.weights]
    kept = [view.copy() for view in views]
    for view in views:
        with pytest.raises(ValueError, match="read-only"):
            view[0] = 0
    del skin
    gc.collect()
    others = [rigs.dense_skin(random, 400, 9) for _ in range(3)]
    assert others and all(np.array_equal(view, copy) for view, copy in zip(views, kept))
    assert np.array_equal(views[0], positions)


def test_the_skin_has_memory_of_its_own(random):
    positions = np.ones((2, 3), np.float32)
    skin = sinew.Skin.from_dense(positions, np.ones((2, 1)))
    positions[:] = 7
    assert np.array_equal(skin.rest_positions, np.ones((2, 3)))


@pytest.mark.parametrize("method", METHODS)
def test_against_the_formula(random, method):
    skin, _, weights = rigs.dense_skin(random, 300, 8)
    matrices = rigs.random_matrices(random, 8, dtype=np.float32)
    positions = method(skin, matrices)
    assert positions.dtype == np.float32 and positions.shape == (300, 3) and positions.flags.c_contiguous
    # Random rotations may nearly cancel, which takes digits from the dual quaternions.
    tolerance = 2e-6 if method is sinew.skin_linear else 2e-5
    assert np.abs(positions - expected(method, skin, weights, matrices)).max() < tolerance


@pytest.mark.parametrize("method", METHODS)
def test_rest_pose_and_rigid_motion(random, method):
    skin, positions, weights = rigs.dense_skin(random, 200, 8)
    assert np.allclose(method(skin, np.tile(IDENTITY, (8, 1, 1))), positions, rtol=0, atol=1e-6)
    motion = rigs.random_matrices(random, 1, dtype=np.float32)
    moved = positions @ motion[0, :3, :3].T + motion[0, :3, 3]
    moved[0] = positions[0]  # nothing moves it
    assert np.allclose(method(skin, np.tile(motion, (8, 1, 1))), moved, rtol=0, atol=2e-6)


@pytest.mark.parametrize("method", METHODS)
def test_batches_are_frame_by_frame(random, method):
    skin, _, _ = rigs.dense_skin(random, 200, 8)
    matrices = rigs.random_matrices(random, 6, 8, dtype=np.float32)
    at_once = method(skin, matrices)
    assert at_once.shape == (6, 200, 3)
    assert all(np.array_equal(at_once[f], method(skin, matrices[f])) for f in range(6))
    assert method(skin, matrices[:0]).shape == (0, 200, 3)
    assert method(skin, matrices[:1]).shape == (1, 200, 3)


@pytest.mark.parametrize("method", METHODS)
def test_any_strides(random, method):
    skin, _, _ = rigs.dense_skin(random, 200, 8)
    for shape in ((8,), (3, 8)):
        matrices = rigs.random_matrices(random, *shape, dtype=np.float32)
        positions = method(skin, matrices)
        for same in rigs.layouts(matrices):
            assert np.array_equal(method(skin, same), positions)


@pytest.mark.parametrize("method", METHODS)
def test_a_transposed_view_is_not_copied(random, method):
    skin, _, _ = rigs.dense_skin(random, 10, 4)
    matrices = rigs.random_matrices(random, 500, 4, dtype=np.float32).swapaxes(-1, -2)
    out = np.empty((500, 10, 3), np.float32)
    method(skin, matrices, out)
    tracemalloc.start()
    try:
        method(skin, matrices, out)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < matrices.nbytes / 10


@pytest.mark.parametrize("method", METHODS)
def test_out_is_written_and_returned(random, method):
    skin, _, _ = rigs.dense_skin(random, 50, 4)
    for shape in ((4,), (3, 4)):
        matrices = rigs.random_matrices(random, *shape, dtype=np.float32)
        positions = method(skin, matrices)
        out = np.full(positions.shape, np.nan, np.float32)
        assert method(skin, matrices, out) is out
        assert np.array_equal(out, positions)
        assert method(skin=skin, matrices=matrices, out=out) is out
        assert method(skin, matrices, None) is not out
        part = np.zeros((2, *positions.shape), np.float32)
        method(skin, matrices, part[1])
        assert np.array_equal(part[1], positions) and not part[0].any()


@pytest.mark.parametrize("method", METHODS)
def test_refuses_arrays_that_do_not_fit(random, method):
    skin, _, _ = rigs.dense_skin(random, 50, 4)
    matrices = rigs.random_matrices(random, 2, 4, dtype=np.float32)
    out = np.zeros((2, 50, 3), np.float32)
    for bad in (matrices.astype(np.float64), matrices.astype(">f4"), matrices.astype(int)):
        assert re.fullmatch("matrices is .*; expected float32", said(method, skin, bad))
    for shape in [(4, 4, 3), (4, 4), (64,), (1, 1, 4, 4, 4)]:
        assert (
            said(method, skin, np.zeros(shape, np.float32))
            == f"matrices has shape {shape}; expected (J, 4, 4) or (F, J, 4, 4)"
        )
    assert said(method, skin, matrices[:, :3]) == "there are 3 matrices per frame; the skin has 4 joints"
    for shape in [(50, 3), (3, 50, 3), (2, 49, 3), (2, 50, 4), (300,)]:
        assert (
            said(method, skin, matrices, np.zeros(shape, np.float32)) == f"out has shape {shape}; expected (2, 50, 3)"
        )
    assert said(method, skin, matrices[0], out) == "out has shape (2, 50, 3); expected (50, 3)"
    assert said(method, skin, matrices, out.astype(np.float64)) == "out is float64; expected float32"
    assert said(method, skin, matrices, np.asfortranarray(out)) == "out is not C-contiguous; pass a C-contiguous array"
    assert (
        said(method, skin, matrices, np.zeros((2, 50, 6), np.float32)[:, :, ::2])
        == "out is not C-contiguous; pass a C-contiguous array"
    )
    assert said(method, skin, matrices, out.tolist()) == "out is a list; expected a numpy array"
    odd = np.zeros(out.nbytes + 1, np.uint8)[1:].view(np.float32).reshape(out.shape)
    assert said(method, skin, matrices, odd) == "out is not aligned in memory; pass out.copy()"
    out.flags.writeable = False
    assert said(method, skin, matrices, out) == "out is read-only; pass a writable array"
    with pytest.raises(TypeError):
        method(skin, matrices.tolist())


@pytest.mark.parametrize("method", METHODS)
def test_unpickled_arrays_are_taken(random, method):
    skin, _, _ = rigs.dense_skin(random, 50, 4)
    matrices = rigs.random_matrices(random, 4, dtype=np.float32)
    out = pickle.loads(pickle.dumps(np.zeros((50, 3), np.float32)))
    assert method(skin, pickle.loads(pickle.dumps(matrices)), out) is out
    assert np.array_equal(out, method(skin, matrices))


def crowd(random):
    """Jobs of several sizes and both methods, and what each gives alone."""
    jobs, alone = [], []
    for vertices, frames, method in [
        (100, None, "linear"),
        (3000, 4, "dual_quaternion"),
        (0, 2, "linear"),
        (700, 3, "linear"),
    ]:
        weights = random.random((vertices, 5))
        skin = sinew.Skin.from_dense(random.random((vertices, 3)), weights)
        shape = (5,) if frames is None else (frames, 5)
        matrices = np.ascontiguousarray(np.broadcast_to(IDENTITY, shape + (4, 4)))
        matrices[..., :3, 3] += random.random(shape + (3,), np.float32)
        alone.append(getattr(sinew, f"skin_{method}")(skin, matrices))
        jobs.append((skin, matrices, np.empty_like(alone[-1]), method))
    return jobs, alone


def test_skin_all_is_one_call_a_job(random):
    jobs, alone = crowd(random)
    assert sinew.skin_all(jobs) is None
    for (_, _, out, _), expected in zip(jobs, alone):
        assert np.array_equal(out, expected)
    sinew.skin_all([])


@pytest.mark.parametrize("stretch", ("frame", "frame_each"))
def test_skin_all_takes_what_becomes_of_scale(random, stretch):
    skin, positions, _ = rigs.dense_skin(random, 500, 4)
    matrices = rigs.random_matrices(random, 4, dtype=np.float32)
    matrices[:, :3, 0] *= 1.5
    frames = np.tile(np.eye(4), (4, 1, 1))
    out = np.empty_like(positions, np.float32)
    sinew.skin_all([(skin, matrices, out, "dual_quaternion", stretch, frames)])
    assert np.array_equal(out, sinew.skin_dual_quaternion(skin, matrices, stretch=stretch, rest_frames=frames))
    assert not np.array_equal(out, sinew.skin_dual_quaternion(skin, matrices))


def test_skin_all_refuses_what_is_wrong(random):
    jobs, _ = crowd(random)
    skin, matrices, out, method = jobs[0]

    def said_of(*job):
        return said(sinew.skin_all, [jobs[1], job])

    assert (
        said_of(skin, matrices, out, "cubic")
        == 'job 1: there is no method "cubic"; expected one of linear, dual_quaternion, blended, rotation_centers, '
        "direct_delta_mush"
    )
    assert (
        said_of(skin, matrices, out) == "job 1: expected (skin, matrices, out, method[, stretch, rest_frames[, data]])"
    )
    frames = np.tile(np.eye(4), (5, 1, 1))
    assert (
        said_of(skin, matrices, out, method, "odd", frames)
        == 'job 1: there is no stretch "odd"; expected polar, frame or frame_each'
    )
    assert said_of(skin, matrices, None, method) == "job 1: out is None; expected a numpy array"
    assert said_of(skin, matrices.tolist(), out, method) == "job 1: matrices is a list; expected a numpy array"
    assert said_of(skin, matrices, out[1:], method) == "job 1: out has shape (99, 3); expected (100, 3)"
    assert said_of(skin, matrices[:4], out, method) == "job 1: there are 4 matrices per frame; the skin has 5 joints"
    assert said(sinew.skin_all, [jobs[0], jobs[0]]) == "the results of job 0 and job 1 overlap"
    with pytest.raises(TypeError, match=r"job 1: expected \(Skin, array, array, str\["):
        sinew.skin_all([jobs[1], ("skin", matrices, out, method)])


@pytest.mark.parametrize("method", METHODS)
def test_another_rest_shape(random, method):
    skin, positions, weights = rigs.dense_skin(random, 5000, 8)
    matrices = rigs.random_matrices(random, 8, dtype=np.float32)
    before = method(skin, matrices)
    other = random.random((5000, 3)).astype(np.float32)
    skin.set_rest_positions(other)
    assert np.array_equal(skin.rest_positions, other)
    fresh = sinew.Skin(other, skin.offsets, skin.joints, skin.weights, 8)
    assert np.array_equal(method(skin, matrices), method(fresh, matrices))
    skin.set_rest_positions(positions)
    assert np.array_equal(method(skin, matrices), before)


def test_another_rest_shape_reaches_every_instruction_set(random):
    skin, _, _ = rigs.dense_skin(random, 100, 4)
    matrices = rigs.random_matrices(random, 4, dtype=np.float32)
    other = random.random((100, 3)).astype(np.float32)
    try:
        for name in sinew.instruction_sets():
            sinew.set_instruction_set(name)
            sinew.skin_linear(skin, matrices)  # packs for this set
        skin.set_rest_positions(other)
        for name in sinew.instruction_sets():
            sinew.set_instruction_set(name)
            fresh = sinew.Skin(other, skin.offsets, skin.joints, skin.weights, 4)
            assert np.array_equal(sinew.skin_linear(skin, matrices), sinew.skin_linear(fresh, matrices))
    finally:
        sinew.set_instruction_set("auto")


def test_another_rest_shape_is_checked_first(random):
    skin, positions, _ = rigs.dense_skin(random, 20, 3)
    wrong = positions.copy()
    wrong[7, 1] = np.nan
    assert said(skin.set_rest_positions, wrong) == "the rest position of vertex 7 is not finite"
    assert said(skin.set_rest_positions, positions[:19]) == "positions has 57 numbers; the skin has 60 (20 x 3)"
    assert said(skin.set_rest_positions, positions.ravel()) == "positions has shape (60,); expected (V, 3)"
    assert np.array_equal(skin.rest_positions, positions)


def scaled_joints(random, count):
    """Matrices that turn, move and scale each joint along the axes of its own rest frame, and those
    frames: R = motion, S = scale in the frame."""
    frames = rigs.random_matrices(random, count)
    motions = rigs.random_matrices(random, count)
    scales = np.tile(np.eye(4), (count, 1, 1))
    scales[:, [0, 1, 2], [0, 1, 2]] = random.uniform(0.5, 2, (count, 3))
    stretches = frames @ scales @ np.linalg.inv(frames)
    return (motions @ stretches).astype(np.float32), frames, motions, stretches


def test_one_scaled_joint_is_its_matrix(random):
    """However it is split, one joint alone must move a vertex by its own matrix."""
    matrices, frames, _, _ = scaled_joints(random, 6)
    points = random.random((600, 3))
    skin = sinew.Skin.from_dense(points, np.repeat(np.eye(6), 100, axis=0))
    expected = np.einsum(
        "vrc,vc->vr", np.repeat(matrices, 100, axis=0).astype(float), np.column_stack([points, np.ones(600)])
    )[:, :3]
    for stretch in ("polar", "frame", "frame_each"):
        moved = sinew.skin_dual_quaternion(skin, matrices, None, stretch, None if stretch == "polar" else frames)
        assert np.abs(moved - expected).max() < 5e-6


def test_stretch_in_the_frames_of_the_joints(random):
    """Against the formulas: stretches blended and applied first, or each to its own dual quaternion."""
    matrices, frames, motions, stretches = scaled_joints(random, 4)
    weights = random.random((200, 4))
    weights /= weights.sum(1, keepdims=True)
    skin = sinew.Skin.from_dense(random.random((200, 3)), weights)
    rest = skin.rest_positions.astype(float)
    points = np.column_stack([rest, np.ones(200)])
    real = np.array([reference.quaternion(m) for m in motions])
    dual = np.array([reference.multiply(np.array([0, *m[:3, 3]]), q) / 2 for m, q in zip(motions, real)])
    for stretch in ("frame", "frame_each"):
        expected = np.empty((200, 3))
        for v, point in enumerate(points):
            r, d, place = np.zeros(4), np.zeros(4), np.zeros(4)
            for j in range(4):
                own = stretches[j] @ point
                sign = -1 if r @ real[j] < 0 else 1
                r, d = r + sign * weights[v, j] * real[j], d + sign * weights[v, j] * dual[j]
                place += weights[v, j] * own
                if stretch == "frame_each":
                    by = np.array([0, *(own - point)[:3]])
                    d = d + sign * weights[v, j] * reference.multiply(real[j], by) / 2
            start = place[:3] if stretch == "frame" else point[:3]
            length = np.linalg.norm(r)
            r, d = r / length, d / length
            expected[v] = reference.rotation(r) @ start + 2 * reference.multiply(d, r * [1, -1, -1, -1])[1:]
        moved = sinew.skin_dual_quaternion(skin, matrices, None, stretch, frames)
        assert np.abs(moved - expected).max() < 2e-5, stretch


def test_rigid_joints_are_the_same_under_every_rule(random):
    skin, _, _ = rigs.dense_skin(random, 300, 5)
    matrices = rigs.random_matrices(random, 5, dtype=np.float32)
    frames = rigs.random_matrices(random, 5)
    polar = sinew.skin_dual_quaternion(skin, matrices)
    as_blender = [sinew.skin_dual_quaternion(skin, matrices, None, rule, frames) for rule in ("frame", "frame_each")]
    assert np.array_equal(*as_blender)
    # Blender has steps of its own from a matrix to a quaternion.
    assert np.abs(as_blender[0] - polar).max() < 2e-6


def test_stretch_is_checked(random):
    skin, _, _ = rigs.dense_skin(random, 10, 3)
    matrices = np.tile(IDENTITY, (3, 1, 1))
    frames = np.tile(np.eye(4), (3, 1, 1))

    def said_of(*more):
        return said(sinew.skin_dual_quaternion, skin, matrices, None, *more)

    assert said_of("rubber") == 'there is no stretch "rubber"; expected polar, frame or frame_each'
    assert said_of("frame") == "there are 0 rest frames; expected 3"
    assert said_of("frame_each", frames[:2]) == "there are 2 rest frames; expected 3"
    assert said_of("polar", frames) == "there are 3 rest frames; expected 0"


def spoilt_character():
    """A skin of 56 vertices that three joints move in turns of two, matrices, and which vertices the second moves."""
    vertex = np.arange(56)
    joints = np.stack([vertex % 3, (vertex + 1) % 3], 1)
    weights = np.tile(np.float32([0.75, 0.25]), (56, 1))
    points = np.random.default_rng(8).normal(size=(56, 3))
    skin = sinew.Skin(points, np.arange(57) * 2, joints.reshape(-1), weights.reshape(-1), 3)
    matrices = np.tile(IDENTITY, (3, 1, 1))
    for matrix, turn in zip(matrices, (0.2, 0.5, -0.4)):
        matrix[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
        matrix[:3, 3] = turn
    return skin, matrices, (joints == 1).any(axis=1)


@pytest.mark.parametrize("entries", [(slice(0, 3), slice(0, 4)), (1, 3), (0, 0)], ids=["whole", "translation", "one"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("name", ["linear", "dual_quaternion", "blended", "rotation_centers"])
def test_a_joint_that_is_not_finite_spoils_the_vertices_that_it_moves(name, value, entries):
    skin, matrices, moved = spoilt_character()
    data = {
        "blended": sinew.BlendShares(np.linspace(0, 1, 56)),
        "rotation_centers": sinew.RotationCenters(skin.rest_positions * 0.5, np.arange(56) % 5 > 0),
    }.get(name)
    layer = sinew.Layer(skin, name, data=data)
    whole, out = np.empty((2, 56, 3), np.float32)
    sinew.Deformer([layer]).deform([(matrices, None)], whole)
    matrices[(1, *entries)] = value
    sinew.Deformer([layer]).deform([(matrices, None)], out)
    assert np.allclose(out[~moved], whole[~moved], rtol=0, atol=1e-5)
    assert not np.isfinite(out[moved]).all(axis=1).any()


def test_what_is_not_finite_does_not_get_through_a_mask():
    skin, matrices, moved = spoilt_character()
    matrices[1] = np.nan
    mask = np.where(moved, 0, 0.5).astype(np.float32)
    out = np.empty((56, 3), np.float32)
    sinew.Deformer([sinew.Layer(skin, "linear", mask=mask)]).deform([(matrices, None)], out)
    assert np.isfinite(out).all() and np.array_equal(out[moved], skin.rest_positions[moved])
