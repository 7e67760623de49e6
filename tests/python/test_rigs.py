"""Whole rigs: other people's, with published results, and our own."""

import numpy as np
import pytest
import sinew_native as sinew

import rigs

METHODS = {"lbs": sinew.skin_linear, "dqs": sinew.skin_dual_quaternion}


def by_column(skeleton, matrices, columns):
    """Matrices a joint -> matrices a column of weights."""
    palette = np.tile(np.eye(4, dtype=np.float32), (columns, 1, 1))
    weighted = skeleton.weight_columns >= 0
    palette[skeleton.weight_columns[weighted]] = matrices[weighted]
    return palette


def posed(rig, time, method=sinew.skin_linear):
    local = sinew.rotation_transforms(rig.poses.sample(time))
    world = sinew.forward_kinematics(rig.skeleton, local)
    matrices = sinew.skinning_matrices(rig.skeleton, world)
    skin = sinew.Skin.from_dense(rig.positions, rig.weights)
    return method(skin, by_column(rig.skeleton, matrices, rig.weights.shape[1]))


def diagonal(positions):
    return np.linalg.norm(np.ptp(positions, axis=0))


def expected_positions(path):
    return np.fromfile(path, "<f4").reshape(-1, 3)


@rigs.needs_shared_rigs
def test_shared_ogre():
    rig = sinew.read_rig(rigs.SHARED / "ogre")
    assert rig.positions.shape == (29960, 3) and rig.weights.shape == (29960, 22)
    assert rig.skeleton.joint_count == 23 and rig.skeleton.convention == "bone"
    assert np.allclose(posed(rig, 0), rig.positions, rtol=0, atol=1e-5 * diagonal(rig.positions))
    expected = expected_positions(rigs.SHARED / "ogre" / "expected-pose1.f32")
    distances = np.linalg.norm(posed(rig, 1) - expected, axis=1)
    assert np.median(distances) < 0.0005
    assert distances.mean() < 0.004


@rigs.needs_shared_rigs
def test_shared_ogre_in_the_wrong_convention_is_far_off():
    rig = sinew.read_rig(rigs.SHARED / "ogre", convention="joint")
    expected = expected_positions(rigs.SHARED / "ogre" / "expected-pose1.f32")
    assert np.linalg.norm(posed(rig, 1) - expected, axis=1).mean() > 0.19


@pytest.fixture(scope="module")
def elephant():
    return sinew.read_rig(rigs.SHARED / "elephant")


@rigs.needs_shared_rigs
@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("frame", [0, 100, 228, 456])
def test_shared_elephant(elephant, name, frame):
    assert elephant.animation.shape == (457, 24, 4, 4)
    skin = sinew.Skin.from_dense(elephant.positions, elephant.weights)
    matrices = elephant.animation[frame].astype(np.float32)
    positions = METHODS[name](skin, by_column(elephant.skeleton, matrices, 24))
    expected = expected_positions(rigs.SHARED / "elephant" / f"expected-{name}-{frame:03}.f32")
    assert np.abs(positions - expected).max() < 1e-6 * diagonal(elephant.positions)


@rigs.needs_shared_rigs
def test_shared_elephant_survives_a_round_trip(elephant, tmp_path):
    sinew.write_rig(tmp_path, elephant, skeleton="skeleton.tgf")
    back = sinew.read_rig(tmp_path)
    for key in ("positions", "face_vertices", "weights", "animation"):
        assert np.array_equal(getattr(back, key), getattr(elephant, key)), key
    assert np.array_equal(back.skeleton.tails, elephant.skeleton.tails)


@pytest.mark.parametrize("name", ["capsule", "ogre"])
@pytest.mark.parametrize("poses", ["pose.dmat", "walk.dmat"])
def test_our_own_rigs(name, poses):
    rig = sinew.read_rig(rigs.ROOT / "data" / name, pose=poses)
    assert rig.weights.min() > -1e-6
    assert np.allclose(rig.weights.sum(axis=1), 1, rtol=0, atol=1e-4)
    assert np.allclose(np.linalg.norm(rig.poses.rotations, axis=-1), 1, rtol=0, atol=1e-12)
    assert sinew.Skin.from_dense(rig.positions, rig.weights).unweighted_count == 0
    if name == "ogre":
        assert 25_000 <= len(rig.positions) <= 35_000
        assert np.count_nonzero(rig.skeleton.weight_columns >= 0) >= 22
    if poses == "pose.dmat":
        assert np.allclose(posed(rig, 0), rig.positions, rtol=0, atol=1e-5 * diagonal(rig.positions))
    else:
        assert rig.poses.pose_count >= 24
    # The poses move it, and it stays in one piece.
    for method in METHODS.values():
        positions = posed(rig, 1, method)
        assert np.isfinite(positions).all()
        moved = np.linalg.norm(positions - rig.positions, axis=1)
        assert 0.001 < moved.max() / diagonal(rig.positions) < 1
    table = sinew.read_dmat(rigs.ROOT / "data" / name / poses)
    if len(table) == 4 * rig.skeleton.joint_count:  # quaternions: unit in the file already
        lengths = np.linalg.norm(table.T.reshape(-1, 4), axis=1)
        assert np.allclose(lengths, 1, rtol=0, atol=1e-6)
