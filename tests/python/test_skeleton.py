"""Skeleton, forward_kinematics, skinning_matrices, PoseClip, rotation_transforms."""

import gc
import pickle
import re

import numpy as np
import pytest
import sinew_native as sinew

import reference
import rigs

FUNCTIONS = [sinew.forward_kinematics, sinew.skinning_matrices]


def said(call, *args, **kwargs):
    with pytest.raises(ValueError) as error:
        call(*args, **kwargs)
    return str(error.value)


@pytest.fixture
def random():
    return np.random.default_rng(7)


def test_skeleton_keeps_the_callers_numbers(random):
    skeleton, parents, rest = rigs.skeleton(random, 12)
    assert skeleton.joint_count == 12
    assert skeleton.parents.dtype == np.int32 and np.array_equal(skeleton.parents, parents)
    assert skeleton.rest.dtype == np.float64 and np.array_equal(skeleton.rest, rest)
    world = reference.forward_kinematics(parents, rest, np.tile(np.eye(4), (12, 1, 1)))
    assert np.allclose(skeleton.rest_world, world, atol=1e-12)
    assert np.allclose(skeleton.inverse_rest @ world, np.eye(4), atol=1e-12)
    assert repr(skeleton) == "<Skeleton of 12 joints>"


@pytest.mark.parametrize("dtype", [np.int8, np.int16, np.int32, np.int64, ">i4"])
def test_skeleton_takes_any_integers_and_reals(dtype):
    rest = np.tile(np.eye(4, dtype=np.int16), (3, 1, 1))
    skeleton = sinew.Skeleton(np.array([1, -1, 0], dtype), rest)
    assert skeleton.parents.tolist() == [1, -1, 0]
    assert np.array_equal(skeleton.rest, rest)


def test_skeleton_may_be_empty():
    skeleton = sinew.Skeleton(np.zeros(0, int), np.zeros((0, 4, 4)))
    assert skeleton.joint_count == 0
    assert skeleton.parents.shape == (0,) and skeleton.rest_world.shape == (0, 4, 4)
    assert sinew.forward_kinematics(skeleton, np.zeros((0, 4, 4))).shape == (0, 4, 4)
    assert sinew.skinning_matrices(skeleton, np.zeros((5, 0, 4, 4))).shape == (5, 0, 4, 4)


def test_skeleton_refuses_what_is_wrong():
    two = np.tile(np.eye(4), (2, 1, 1))
    nan = two.copy()
    nan[1, 2, 3] = np.nan
    assert said(sinew.Skeleton, np.array([-1, 2]), two) == "joint 1 has parent 2; expected -1 (a root) to 1"
    assert said(sinew.Skeleton, np.array([1, 0]), two) == "joint 0 is its own ancestor: its chain of parents is a cycle"
    assert (
        said(sinew.Skeleton, np.array([-1, 0]), nan)
        == "the rest transform of joint 1 holds a number that is not finite"
    )
    assert (
        said(sinew.Skeleton, np.array([-1]), two)
        == "there are 1 parent and 2 rest transforms; expected one of each per joint"
    )
    assert said(sinew.Skeleton, np.array([[-1, 0]]), two) == "parents has shape (1, 2); expected (N,)"
    assert said(sinew.Skeleton, np.array([-1, 0]), two[:, :3]) == "rest has shape (2, 3, 4); expected (J, 4, 4)"
    assert said(sinew.Skeleton, np.array([-1.0, 0.0]), two) == "parents is float64; expected integers"
    assert said(sinew.Skeleton, np.array([-1, 0]), two.astype(complex)) == "rest is complex128; expected real numbers"
    assert said(sinew.Skeleton, np.array([-1, 2**31]), two) == "parents holds 2147483648, which is out of range"
    assert (
        said(sinew.Skeleton, np.array([2**64 - 1, 0], np.uint64), two)
        == "parents holds 18446744073709551615, which is out of range"
    )
    with pytest.raises(TypeError):
        sinew.Skeleton(None, two)


def test_views_are_read_only_and_outlive_their_owner(random):
    skeleton, parents, rest = rigs.skeleton(random, 50)
    views = [skeleton.parents, skeleton.rest, skeleton.rest_world, skeleton.inverse_rest]
    kept = [view.copy() for view in views]
    for view in views:
        with pytest.raises(ValueError, match="read-only"):
            view[0] = 0
    del skeleton
    gc.collect()
    others = [rigs.skeleton(random, 50) for _ in range(5)]  # would take the memory
    assert others and all(np.array_equal(view, copy) for view, copy in zip(views, kept))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("frames", [None, 1, 5])
def test_forward_kinematics(random, dtype, frames):
    skeleton, parents, rest = rigs.skeleton(random, 20)
    shape = (20,) if frames is None else (frames, 20)
    local = rigs.random_matrices(random, *shape, dtype=dtype)
    world = sinew.forward_kinematics(skeleton, local)
    assert world.dtype == dtype and world.shape == local.shape
    expected = [reference.forward_kinematics(parents, rest, one) for one in local.reshape(-1, 20, 4, 4)]
    assert np.allclose(world, np.reshape(expected, local.shape), rtol=0, atol=100 * np.finfo(dtype).eps)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("frames", [None, 3])
def test_skinning_matrices(random, dtype, frames):
    skeleton, _, _ = rigs.skeleton(random, 20)
    shape = (20,) if frames is None else (frames, 20)
    world = rigs.random_matrices(random, *shape, dtype=dtype)
    matrices = sinew.skinning_matrices(skeleton, world)
    assert matrices.dtype == np.float32 and matrices.shape == world.shape
    assert np.allclose(matrices, world @ skeleton.inverse_rest, rtol=0, atol=2e-6)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_local_transforms_are_what_forward_kinematics_is_given(random, dtype):
    skeleton, _, _ = rigs.skeleton(random, 20)
    local = rigs.random_matrices(random, 6, 20)
    local[..., :3, :3] *= random.uniform(0.8, 1.25, (6, 20, 1, 3))
    world = sinew.forward_kinematics(skeleton, local).astype(dtype)
    tolerance = 1e-3 if dtype == np.float32 else 1e-10
    for stack in rigs.layouts(world):
        locations, rotations, scales, played = sinew.local_transforms(skeleton, stack)
        assert (locations.shape, rotations.shape, scales.shape) == ((6, 20, 3), (6, 20, 4), (6, 20, 3))
        turns = np.array([reference.rotation(q) for q in rotations.reshape(-1, 4)]).reshape(6, 20, 3, 3)
        assert np.abs(turns * scales[..., None, :] - local[..., :3, :3]).max() < tolerance
        assert np.abs(locations - local[..., :3, 3]).max() < tolerance
        assert played.dtype == np.float64 and np.abs(played - world).max() < tolerance
        assert (np.einsum("fji,fji->fj", rotations[1:], rotations[:-1]) >= 0).all()


def test_joints_that_may_not_move_have_no_location(random):
    skeleton, _, _ = rigs.skeleton(random, 5)
    world = sinew.forward_kinematics(skeleton, rigs.random_matrices(random, 3, 5))
    locations, *_ = sinew.local_transforms(skeleton, world, [True, False, True, False, True])
    assert not locations[:, [1, 3]].any() and locations[:, [0, 2, 4]].all()


@pytest.mark.parametrize("size", (1.0, 1e-3, 1e3))
def test_local_transforms_have_the_nearest_rotation(random, size):
    """Of matrices that shear, that stretch a thousand times more along one axis than along another, and that mirror."""
    stretch = np.array([1, 1e-3, 1e3])[random.permuted(np.tile(np.arange(3), (200, 1)), axis=1)]
    linear = size * random.normal(size=(200, 3, 3)) * stretch[:, None]
    world = np.tile(np.eye(4), (200, 1, 1, 1))
    world[:, 0, :3, :3] = linear
    _locations, rotations, scales, _played = sinew.local_transforms(
        sinew.Skeleton(np.array([-1]), np.eye(4)[None]), world
    )
    sign = np.sign(np.linalg.det(linear))
    left, _sizes, right = np.linalg.svd(sign[:, None, None] * linear)
    turns = left @ right
    assert np.allclose(scales[:, 0], (turns * linear).sum(axis=1), rtol=1e-9, atol=1e-9 * size)
    w, x, y, z = rotations[:, 0].T
    assert np.allclose(
        np.stack((w * w + x * x - y * y - z * z, 2 * (x * y + w * z), 2 * (x * z - w * y)), 1), turns[:, :, 0]
    )


def test_local_transforms_refuse_what_is_wrong(random):
    skeleton, _, _ = rigs.skeleton(random, 3)
    world = rigs.random_matrices(random, 2, 3)
    assert "world has shape (3, 4, 4); expected (F, J, 4, 4)" in said(sinew.local_transforms, skeleton, world[0])
    assert "world is int64; expected float32 or float64" in said(sinew.local_transforms, skeleton, world.astype(int))
    assert "there are 2 matrices per frame; the skeleton has 3 joints" in said(
        sinew.local_transforms, skeleton, world[:, :2]
    )
    assert "may_move has 1 values; the skeleton has 3 joints" in said(sinew.local_transforms, skeleton, world, [True])
    world[1, 2, 0, 3] = np.nan
    assert "joint 2 is not at a finite place in frame 1" in said(sinew.local_transforms, skeleton, world)


def test_rest_pose_gives_the_identity(random):
    skeleton, _, _ = rigs.skeleton(random, 20)
    world = sinew.forward_kinematics(skeleton, np.tile(np.eye(4), (20, 1, 1)))
    assert np.allclose(world, skeleton.rest_world, atol=1e-12)
    assert np.allclose(sinew.skinning_matrices(skeleton, world), np.eye(4), atol=1e-6)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("function", FUNCTIONS)
def test_any_strides_in_and_out(random, function, dtype):
    skeleton, _, _ = rigs.skeleton(random, 6)
    given = rigs.random_matrices(random, 3, 6, dtype=dtype)
    expected = function(skeleton, given)
    for source in rigs.layouts(given):
        for out in rigs.layouts(np.zeros_like(expected)):
            assert function(skeleton, source, out) is out
            assert np.array_equal(out, expected)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_forward_kinematics_in_place(random, dtype):
    skeleton, _, _ = rigs.skeleton(random, 6)
    local = rigs.random_matrices(random, 3, 6, dtype=dtype)
    expected = sinew.forward_kinematics(skeleton, local)
    for memory in rigs.layouts(local):
        assert sinew.forward_kinematics(skeleton, memory, memory) is memory
        assert np.array_equal(memory, expected)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_a_dtype_that_is_equal_is_enough(random, function):
    """Unpickled arrays carry a dtype object of their own."""
    skeleton, _, _ = rigs.skeleton(random, 4)
    for dtype in (np.float32, np.float64):
        given = rigs.random_matrices(random, 4, dtype=dtype)
        back = pickle.loads(pickle.dumps(given))
        assert np.array_equal(function(skeleton, back), function(skeleton, given))


@pytest.mark.parametrize("function", FUNCTIONS)
def test_read_only_input_is_fine(random, function):
    skeleton, _, _ = rigs.skeleton(random, 4)
    broadcast = np.broadcast_to(np.eye(4), (3, 4, 4, 4))
    assert np.array_equal(function(skeleton, broadcast), function(skeleton, broadcast.copy()))


@pytest.mark.parametrize("function, name", list(zip(FUNCTIONS, ["local", "world"])))
def test_refuses_arrays_that_do_not_fit(random, function, name):
    skeleton, _, _ = rigs.skeleton(random, 4)
    good = rigs.random_matrices(random, 2, 4, dtype=np.float32)
    out = np.zeros_like(good)
    for bad in (good.astype(np.float16), good.astype(int), good.astype(">f4"), good.astype(bool)):
        assert re.fullmatch(f"{name} is .*; expected float32 or float64", said(function, skeleton, bad))
    for shape in [(4, 4, 3), (4, 3, 4), (4, 4), (1, 2, 4, 4, 4), (), (64,)]:
        assert (
            said(function, skeleton, np.zeros(shape)) == f"{name} has shape {shape}; expected (J, 4, 4) or (F, J, 4, 4)"
        )
    assert said(function, skeleton, good[:, :3]) == "there are 3 matrices per frame; the skeleton has 4 joints"
    assert said(function, skeleton, good, out[0]) == "the result holds 1 x 4 matrices; expected 2 x 4"
    assert said(function, skeleton, good, out[:, :3]) == "the result holds 2 x 3 matrices; expected 2 x 4"
    assert said(function, skeleton, good, out.astype(np.float64)) == "out is float64; expected float32"
    assert (
        said(function, skeleton, good, out[..., :3]) == "out has shape (2, 4, 4, 3); expected (J, 4, 4) or (F, J, 4, 4)"
    )
    assert said(function, skeleton, good, out.tolist()) == "out is a list; expected a numpy array"
    odd = np.zeros(good.nbytes + 1, np.uint8)[1:].view(np.float32).reshape(good.shape)
    assert said(function, skeleton, odd) == f"{name} is not aligned in memory; pass {name}.copy()"
    assert said(function, skeleton, good, odd) == "out is not aligned in memory; pass out.copy()"
    out.flags.writeable = False
    assert said(function, skeleton, good, out) == "out is read-only; pass a writable array"
    with pytest.raises(TypeError):
        function(None, good)
    with pytest.raises(TypeError):
        function(skeleton, good.tolist())


def unit(q):
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def test_pose_clip(random):
    rotations = random.normal(size=(5, 3, 4))
    clip = sinew.PoseClip(rotations)
    assert (clip.pose_count, clip.joint_count) == (5, 3)
    assert clip.rotations.dtype == np.float64 and np.allclose(clip.rotations, unit(rotations))
    assert clip.sample(2).shape == (3, 4) and np.array_equal(clip.sample(2), clip.rotations[2])
    assert np.array_equal(clip.sample(-3), clip.rotations[0])
    assert np.array_equal(clip.sample(99), clip.rotations[4])
    assert np.array_equal(clip.sample(time=7, loop=True), clip.rotations[2])


def test_pose_clip_interpolates_on_the_sphere():
    def about_x(degrees):
        half = np.radians(degrees) / 2
        return [np.cos(half), np.sin(half), 0, 0]

    clip = sinew.PoseClip(np.array([[about_x(0)], [about_x(80)]]))
    assert np.allclose(clip.sample(0.25), about_x(20))
    assert np.allclose(clip.sample(1.25, loop=True), about_x(60))
    assert np.allclose(clip.sample(1.25), about_x(80))


def test_pose_clip_refuses_what_is_wrong():
    one = np.tile([1.0, 0, 0, 0], (2, 3, 1))
    assert said(sinew.PoseClip, one[0]) == "rotations has shape (3, 4); expected (P, J, 4)"
    assert said(sinew.PoseClip, one[:, :, :3]) == "rotations has shape (2, 3, 3); expected (P, J, 4)"
    assert (
        said(sinew.PoseClip, one[:0])
        == "there are 0 rotations for 3 joints; expected one per joint for each of at least one pose"
    )
    assert (
        said(sinew.PoseClip, one[:, :0])
        == "there are 0 rotations for 0 joints; expected one per joint for each of at least one pose"
    )
    assert said(sinew.PoseClip, one * 0) == "the quaternion of joint 0 in pose 0 has length 0; expected 1"
    assert said(sinew.PoseClip, one * np.nan) == "the quaternion of joint 0 in pose 0 has length nan; expected 1"
    assert said(sinew.PoseClip(one).sample, np.nan) == "the time of a pose is nan; expected a finite number"


def test_rotation_transforms(random):
    q = unit(random.normal(size=(4, 4)))
    transforms = sinew.rotation_transforms(q)
    expected = np.tile(np.eye(4), (4, 1, 1))
    expected[:, :3, :3] = [reference.rotation(one) for one in q]
    assert transforms.dtype == np.float64 and np.allclose(transforms, expected, atol=1e-14)
    for (out,) in rigs.layouts(np.zeros((1, 4, 4, 4))):
        assert sinew.rotation_transforms(q, out) is out
        assert np.array_equal(out, transforms)


def test_rotation_transforms_refuse_what_is_wrong(random):
    q = np.tile([1.0, 0, 0, 0], (4, 1))
    assert said(sinew.rotation_transforms, q[0]) == "rotations has shape (4,); expected (J, 4)"
    assert said(sinew.rotation_transforms, q, np.zeros((3, 4, 4))) == "the result holds 1 x 3 matrices; expected 1 x 4"
    assert said(sinew.rotation_transforms, q, np.zeros((4, 4, 4), np.float32)) == "out is float32; expected float64"
    assert said(sinew.rotation_transforms, q, [1]) == "out is a list; expected a numpy array"
