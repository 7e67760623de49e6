"""addon/sinew/to_bones/joints.py, which needs no Blender: motions of joints as keyframes of bones that inherit."""

import importlib
import sys
import types
from pathlib import Path

import numpy as np
import pytest
import sinew_native as sinew

ADDON = Path(__file__).resolve().parents[2] / "addon" / "sinew"
# The add-on's package, with the compiled module and without what needs Blender.
package, native = types.ModuleType("addon"), types.ModuleType("addon.native")
package.__path__, native.sinew_native = [str(ADDON)], sinew
sys.modules |= {"addon": package, "addon.native": native}
joints = importlib.import_module("addon.to_bones.joints")

FRAMES = range(3, 8)


@pytest.fixture
def random():
    return np.random.default_rng(8)


def turns(random, *shape):
    """Random rotations (..., 3, 3)."""
    found = np.linalg.qr(random.normal(size=(*shape, 3, 3)))[0]
    return found * np.linalg.det(found)[..., None, None]


def placed(linear, places):
    found = np.tile(np.eye(4), (*linear.shape[:-2], 1, 1))
    found[..., :3, :3], found[..., :3, 3] = linear, places
    return found


def chain(random):
    """A root, its child, the child's child and another root."""
    rest = placed(turns(random, 4), random.normal(size=(4, 3)))
    return joints.Joints(("root", "arm", "hand", "prop"), np.array([-1, 0, 1, -1]), rest, np.ones(4))


def test_rigid_motions_are_played_exactly(random):
    bones = chain(random)
    motions = placed(turns(random, len(FRAMES), 4), random.normal(size=(len(FRAMES), 4, 3)))
    keys, played = joints.keys_of(bones, motions, FRAMES)
    assert np.allclose(played, motions, atol=1e-12) and not keys.has_scales
    assert (np.sum(keys.rotations[1:] * keys.rotations[:-1], axis=-1) >= 0).all(), "on the shorter way"
    assert np.allclose(np.linalg.norm(keys.rotations, axis=-1), 1)


def test_bones_that_scale_alike_along_all_axes_are_played_exactly(random):
    bones = chain(random)
    sizes = random.uniform(0.5, 2, (len(FRAMES), 4, 1, 1))
    motions = placed(sizes * turns(random, len(FRAMES), 4), random.normal(size=(len(FRAMES), 4, 3)))
    keys, played = joints.keys_of(bones, motions, FRAMES)
    assert np.allclose(played, motions, atol=1e-12) and keys.has_scales


def test_what_shears_is_as_near_as_a_rotation_and_a_scale(random):
    """The child of a bone that is stretched; its own motion is rigid, so it has to shear against its parent."""
    bones = chain(random)
    motions = np.tile(np.eye(4), (len(FRAMES), 4, 1, 1))
    motions[:, 0, :3, :3] = np.diag((1, 2, 0.5))
    _, played = joints.keys_of(bones, motions, FRAMES)
    assert not np.allclose(played[:, 1], motions[:, 1], atol=1e-3)
    assert np.allclose(played[:, 3], motions[:, 3], atol=1e-12), "others do not notice"
    origin = bones.rest[1, :, 3]
    assert np.allclose(played[:, 1] @ origin, motions[:, 1] @ origin), "its head is where it should be"


def test_bones_that_may_not_move_only_turn(random):
    bones = chain(random)
    motions = placed(turns(random, len(FRAMES), 4), random.normal(size=(len(FRAMES), 4, 3)))
    keys, played = joints.keys_of(bones, motions, FRAMES, [True, False, False, True])
    assert not keys.locations[:, 1:3].any() and keys.locations[:, [0, 3]].any()
    assert np.allclose(played[:, [0, 3]], motions[:, [0, 3]], atol=1e-12)
    assert np.allclose(played[:, 1, :3, :3], motions[:, 1, :3, :3], atol=1e-12), "they turn as they should"


def test_a_bone_without_a_size_that_others_follow_is_named(random):
    bones = chain(random)
    motions = np.tile(np.eye(4), (len(FRAMES), 4, 1, 1))
    motions[2, 3, :3, :3] = 0
    joints.keys_of(bones, motions, FRAMES)  # nothing follows it
    motions[2, 1, :3, :3] = 0
    with pytest.raises(ValueError, match="arm has a scale of 0 along an axis on frame 5, and other bones follow it"):
        joints.keys_of(bones, motions, FRAMES)
