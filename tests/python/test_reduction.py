"""addon/sinew/to_bones/reduction.py, which needs no Blender: keyframes that lines between the others replace."""

import importlib

import numpy as np
import pytest

from test_joints import joints, turns

reduction = importlib.import_module("addon.to_bones.reduction")
COUNT, FRAMES = 9, np.arange(3, 64)


@pytest.fixture
def random():
    return np.random.default_rng(5)


def skeleton(random):
    """A chain of six and two other children, at rest in any direction."""
    rest = np.tile(np.eye(4), (COUNT, 1, 1))
    rest[:, :3, :3] = turns(random, COUNT)
    rest[:, :3, 3] = random.uniform(-1, 1, (COUNT, 3))
    names = tuple(f"bone{j}" for j in range(COUNT))
    return joints.Joints(names, np.array([-1, 0, 1, 2, 3, 4, 1, 1, -1]), rest, random.uniform(0.2, 1, COUNT))


def smooth(random, size, scale):
    """(F, COUNT, size): waves."""
    waves = random.uniform(0.02, 0.2, (3, 1, COUNT, size)) * FRAMES[:, None, None] + random.uniform(
        0, 6, (3, 1, COUNT, size)
    )
    return scale * np.sin(waves).sum(axis=0)


def moving(random):
    rotations = smooth(random, 4, 0.3) + [1, 0, 0, 0]
    rotations /= np.linalg.norm(rotations, axis=2, keepdims=True)
    return joints.Keys(smooth(random, 3, 0.1), rotations, 1 + smooth(random, 3, 0.05))


def played(bones, keys, kept, is_on_sphere):
    """(F, J, 4, 4): the poses that the keyframes make, one number and one bone at a time."""
    drawn = []
    for values, own in zip((keys.locations, keys.rotations, keys.scales), kept.channels):
        lines = np.empty(values.shape)
        for j, component in np.ndindex(values.shape[1:]):
            at = own[:, j]
            lines[:, j, component] = np.interp(FRAMES, FRAMES[at], values[at, j, component])
        drawn.append(lines)
    if is_on_sphere:
        drawn[1] = spherical(keys.rotations, kept.channels[1])
    found = np.empty((len(FRAMES), COUNT, 4, 4))
    for frame, j in np.ndindex(len(FRAMES), COUNT):
        location, rotation, scale = (each[frame, j] for each in drawn)
        basis = np.eye(4)
        basis[:3, :3], basis[:3, 3] = matrix(rotation) * scale, location
        parent = bones.parents[j]
        above = np.eye(4) if parent < 0 else found[frame, parent] @ np.linalg.inv(bones.rest[parent])
        found[frame, j] = above @ bones.rest[j] @ basis
    return found


def matrix(rotation):
    w, x, y, z = rotation / np.linalg.norm(rotation)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def spherical(rotations, kept):
    found = rotations.copy()
    for j in range(COUNT):
        at = np.flatnonzero(kept[:, j])
        for first, last in zip(at, at[1:]):
            a, b = rotations[first, j], rotations[last, j]
            b = b if a @ b > 0 else -b
            angle = np.arccos(min(a @ b, 1))
            for i in range(first, last):
                share = (i - first) / (last - first)
                found[i, j] = (
                    (np.sin((1 - share) * angle) * a + np.sin(share * angle) * b) / np.sin(angle) if angle > 1e-9 else a
                )
    return found


def far(bones, poses, others):
    """How far apart heads, and points one length along the axes, are at most."""
    points = np.array([[0, 0, 0, 1], [1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1]], float)
    worst = 0.0
    for j in range(COUNT):
        own = points * [*3 * [bones.lengths[j]], 1]
        worst = max(worst, np.linalg.norm(((poses - others)[:, j] @ own.T)[:, :3], axis=1).max())
    return worst


@pytest.mark.parametrize("error", (0.3, 0.03, 3e-3))
def test_no_bone_is_further_off_than_the_error(random, error):
    bones, keys = skeleton(random), moving(random)
    everything = reduction.Kept(tuple(np.ones((len(FRAMES), COUNT), bool) for _ in range(3)))
    wanted = played(bones, keys, everything, False)
    kept, poses = reduction.reduce(bones, keys, FRAMES, error)
    ours = [far(bones, played(bones, keys, kept, is_on_sphere), wanted) for is_on_sphere in (False, True)]
    assert 0.1 * error < max(ours) <= error * (1 + 1e-9)
    assert np.abs(poses @ bones.rest - played(bones, keys, kept, False)).max() < 1e-12
    assert all(own[0].all() and own[-1].all() for own in kept.channels)


def test_fewer_keyframes_for_a_larger_error(random):
    bones, keys = skeleton(random), moving(random)
    shares = [np.mean(reduction.reduce(bones, keys, FRAMES, error)[0].channels) for error in (1e-7, 1e-3, 1e-2, 1e-1)]
    assert shares == sorted(shares, reverse=True) and shares[0] > 0.99 and shares[-1] < 0.35


def test_what_moves_along_lines_keeps_the_corners(random):
    bones = skeleton(random)
    still = np.tile([1.0, 0, 0, 0], (len(FRAMES), COUNT, 1))
    locations = np.zeros((len(FRAMES), COUNT, 3))
    locations[:, 2, 1] = np.abs(FRAMES - 20.0)
    keys = joints.Keys(locations, still, np.ones((len(FRAMES), COUNT, 3)))
    kept, _ = reduction.reduce(bones, keys, FRAMES, 1e-6)
    assert FRAMES[kept.channels[0][:, 2]].tolist() == [3, 20, 63]
    others = [own[:, np.arange(COUNT) != 2] for own in kept.channels]
    assert all(own.sum(axis=0).tolist() == 8 * [2] for own in others)


def test_a_turn_of_more_than_half_keeps_its_way(random):
    """The straight way from the first to the last of these would be none."""
    bones = skeleton(random)
    angles = np.pi * (FRAMES - 3.0) / 60  # of half the rotation
    rotations = np.zeros((len(FRAMES), COUNT, 4))
    rotations[..., 0], rotations[..., 3] = np.cos(angles)[:, None], np.sin(angles)[:, None]
    keys = joints.Keys(np.zeros((len(FRAMES), COUNT, 3)), rotations, np.ones((len(FRAMES), COUNT, 3)))
    kept, poses = reduction.reduce(bones, keys, FRAMES, 0.01)
    assert 3 < kept.channels[1][:, 5].sum() < 61
    everything = reduction.Kept(tuple(np.ones((len(FRAMES), COUNT), bool) for _ in range(3)))
    assert far(bones, poses @ bones.rest, played(bones, keys, everything, False)) <= 0.01


def test_one_frame(random):
    bones, keys = skeleton(random), moving(random)
    one = joints.Keys(*(each[:1] for each in (keys.locations, keys.rotations, keys.scales)))
    kept, _ = reduction.reduce(bones, one, FRAMES[:1], 0.1)
    assert all(own.shape == (1, COUNT) and own.all() for own in kept.channels)


def test_where_numbers_round_all_keyframes_stay(random):
    """An error that is smaller than rounding cannot be kept to."""
    bones, keys = skeleton(random), moving(random)
    kept, _ = reduction.reduce(bones, keys, FRAMES, 1e-300)
    assert np.mean(kept.channels) == 1
