"""read_bvh, write_bvh and BvhClip. Which messages bad files get is proved in tests/native."""

import numpy as np
import pytest
import sinew_native as sinew

from test_skeleton import said

PARENTS = np.array([-1, 0, 1, 0])


@pytest.fixture
def clip():
    random = np.random.default_rng(6)
    rotations = random.normal(size=(5, 4, 4))
    locations = random.normal(size=(5, 4, 3))
    locations[:, 2] = 0
    offsets, ends = random.normal(size=(2, 4, 3))
    return sinew.BvhClip(["hips", "chest of it", "head", "leg"], PARENTS, offsets, 1 / 24, locations, rotations, ends)


def test_round_trip(clip, tmp_path):
    sinew.write_bvh(tmp_path / "a.bvh", clip)
    back = sinew.read_bvh(tmp_path / "a.bvh")
    assert back.names == clip.names and back.frame_time == clip.frame_time and back.frame_count == 5
    assert back.skeleton.parents.tolist() == PARENTS.tolist()
    assert np.array_equal(back.offsets, clip.offsets) and np.array_equal(back.ends[2:], clip.ends[2:])
    assert np.abs(back.locations - clip.locations).max() < 1e-14
    assert np.abs(back.local - clip.local).max() < 1e-13
    assert "JOINT head\n{\nOFFSET" in (tmp_path / "a.bvh").read_text()
    assert (tmp_path / "a.bvh").read_text().count("Xposition") == 3, "the head does not move"


def test_local_is_location_and_rotation(clip):
    assert np.array_equal(clip.local[..., :3, 3], clip.locations)
    for matrix, (w, *axis) in zip(clip.local.reshape(-1, 4, 4), clip.rotations.reshape(-1, 4)):
        x, y, z = axis
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        assert np.allclose(matrix[:3, :3], np.eye(3) + 2 * w * cross + 2 * cross @ cross, atol=1e-14)
    assert np.array_equal(clip.skeleton.rest[:, :3, 3], clip.offsets)


def test_poses_of_any_skeleton_as_bvh(tmp_path):
    """As the page shows it: bones at rest have no rotation there, so what turns them from rest is written."""
    random = np.random.default_rng(7)
    rest = np.tile(np.eye(4), (4, 1, 1))
    rest[:, :3, :3] = np.linalg.qr(random.normal(size=(4, 3, 3)))[0]
    rest[:, :3, :3] *= np.linalg.det(rest[:, :3, :3])[:, None, None]
    rest[:, :3, 3] = random.normal(size=(4, 3))
    skeleton = sinew.Skeleton(PARENTS, rest)
    turns = sinew.rotation_transforms(np.array([[0.9, 0.1, 0.2, 0.3]] * 4) / np.sqrt(0.95))
    world = sinew.forward_kinematics(skeleton, np.tile(turns, (3, 1, 1, 1)))

    heads = skeleton.rest_world[:, :3, 3]
    offsets = np.where(PARENTS[:, None] < 0, heads, heads - heads[PARENTS])
    plain = np.tile(np.eye(4), (4, 1, 1))
    plain[:, :3, 3] = offsets
    placed = np.tile(np.eye(4), (4, 1, 1))
    placed[:, :3, 3] = heads
    unrotated = world @ skeleton.inverse_rest @ placed
    locations, rotations, scales, _ = sinew.local_transforms(sinew.Skeleton(PARENTS, plain), unrotated)
    assert np.abs(scales - 1).max() < 1e-12
    clip = sinew.BvhClip(list("abcd"), PARENTS, offsets, 0.04, locations, rotations)
    sinew.write_bvh(tmp_path / "a.bvh", clip)
    back = sinew.read_bvh(tmp_path / "a.bvh")
    found = sinew.forward_kinematics(back.skeleton, back.local)
    assert np.abs(found - unrotated).max() < 1e-12
    assert np.abs(found[..., :3, 3] - world[..., :3, 3]).max() < 1e-12


def test_what_is_refused(clip, tmp_path):
    (tmp_path / "a.bvh").write_text("HIERARCHY\nROOT a\n{\nOFFSET 0 0\n}\n")
    assert said(sinew.read_bvh, tmp_path / "a.bvh") == 'a.bvh, line 5: expected a coordinate, found "}"'
    assert said(sinew.read_bvh, tmp_path / "b.bvh") == f"there is no file {tmp_path / 'b.bvh'}"
    values = ["a"], np.array([-1]), np.zeros((1, 3)), 0.04, np.zeros((2, 1, 3)), np.ones((2, 1, 4))
    assert said(sinew.BvhClip, *values[:4], np.zeros((2, 2, 3)), values[5]) == (
        "locations has shape (2, 2, 3); expected (F, 1, 3)"
    )
    assert said(sinew.BvhClip, [], *values[1:]) == "there are 1 end and 0 names; the skeleton has 1 joint"
    nameless = sinew.BvhClip([""], *values[1:])
    assert "it is empty" in said(sinew.write_bvh, tmp_path / "a.bvh", nameless)
