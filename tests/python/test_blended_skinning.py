"""BlendShares and skin_blended."""

import gc

import numpy as np
import pytest
import sinew_native as sinew

import rigs
from test_skeleton import said


@pytest.fixture
def random():
    return np.random.default_rng(15)


@pytest.fixture
def subject(random):
    """(skin, matrices, shares): a share of 0, 1 and between in turn."""
    skin, _, _ = rigs.dense_skin(random, 300, 8)
    shares = random.random(300)
    shares[::3], shares[1::3] = 0, 1
    return skin, rigs.random_matrices(random, 8, dtype=np.float32), shares


def test_shares_of_0_and_1_are_the_methods_to_the_bit(subject):
    skin, matrices, shares = subject
    blended = sinew.skin_blended(skin, sinew.BlendShares(shares), matrices)
    linear, dual = sinew.skin_linear(skin, matrices), sinew.skin_dual_quaternion(skin, matrices)
    assert blended[::3].tobytes() == linear[::3].tobytes()
    assert blended[1::3].tobytes() == dual[1::3].tobytes()
    assert np.allclose(blended, linear + shares[:, None] * (dual - linear), rtol=0, atol=1e-6)


def test_every_way_in_gives_the_same(subject):
    skin, matrices, shares = subject
    matrices[2, :3, :3] *= 1.5
    frames = np.tile(np.eye(4), (8, 1, 1))
    data = sinew.BlendShares(shares)
    expected = sinew.skin_blended(skin, data, matrices, stretch="frame_each", rest_frames=frames)
    out = np.empty_like(expected)
    assert sinew.skin_blended(skin, data, matrices, out, "frame_each", frames) is out
    assert np.array_equal(out, expected)
    sinew.skin_all([(skin, matrices, out, "blended", "frame_each", frames, data)])
    assert np.array_equal(out, expected)
    layer = sinew.Layer(skin, "blended", stretch="frame_each", rest_frames=frames, data=data)
    sinew.Deformer([layer]).deform([(matrices, None)], out)
    assert np.array_equal(out, expected)
    assert not np.array_equal(expected, sinew.skin_blended(skin, data, matrices))


def test_rest_frames_may_be_none_in_a_job(subject):
    skin, matrices, shares = subject
    data = sinew.BlendShares(shares)
    out = np.empty((300, 3), np.float32)
    sinew.skin_all([(skin, matrices, out, "blended", "polar", None, data)])
    assert np.array_equal(out, sinew.skin_blended(skin, data, matrices))


def test_a_layer_keeps_its_data(subject):
    skin, matrices, shares = subject
    expected = sinew.skin_blended(skin, sinew.BlendShares(shares), matrices)
    deformer = sinew.Deformer([sinew.Layer(skin, "blended", data=sinew.BlendShares(shares))])
    gc.collect()
    others = [sinew.BlendShares(1 - shares) for _ in range(3)]
    out = np.empty_like(expected)
    deformer.deform([(matrices, None)], out)
    assert others and np.array_equal(out, expected)


def test_shares_are_copied_and_can_be_read():
    numbers = np.array([0, 0.5, 1])
    data = sinew.BlendShares(numbers)
    numbers[:] = 0
    assert data.shares.tolist() == [0, 0.5, 1] and data.shares.dtype == np.float32
    assert (data.method, data.vertex_count) == ("blended", 3)
    with pytest.raises(ValueError, match="read-only"):
        data.shares[0] = 1


def test_refuses_what_is_wrong(subject):
    skin, matrices, shares = subject
    assert said(sinew.BlendShares, shares * 2) == "the share of vertex 1 is 2; expected 0 to 1"
    assert said(sinew.BlendShares, np.array([np.nan])) == "the share of vertex 0 is nan; expected 0 to 1"
    assert said(sinew.BlendShares, np.zeros((3, 1))) == "shares has shape (3, 1); expected (N,)"
    short = sinew.BlendShares(shares[1:])
    assert said(sinew.skin_blended, skin, short, matrices) == "the data has 299 vertices; the skin has 300"
    assert said(sinew.Layer, skin, "blended", data=short) == "the data has 299 vertices; the skin has 300"
    assert said(sinew.Layer, skin, "blended") == "the method blended needs data of its own; pass it as data"
    whole = sinew.BlendShares(shares)
    assert said(sinew.Layer, skin, "linear", data=whole) == "the data is of the method blended; the method is linear"
    out = np.empty((300, 3), np.float32)
    job = (skin, matrices, out, "blended", "polar", None, None)
    assert said(sinew.skin_all, [job]) == "the method blended needs data of its own; pass it as data"
