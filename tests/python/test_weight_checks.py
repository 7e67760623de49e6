"""What Check Weights finds, which needs no Blender, against slow searches through all vertices and all bones."""

import importlib
import sys
import types
from pathlib import Path

import numpy as np
import pytest
import sinew_native as sinew

ADDON = Path(__file__).resolve().parents[2] / "addon" / "sinew"
package, native = types.ModuleType("addon"), types.ModuleType("addon.native")
package.__path__, native.sinew_native = [str(ADDON)], sinew
sys.modules |= {"addon": package, "addon.native": native}
bone_segments, checks, entries, pose_checks = (
    importlib.import_module(f"addon.weights.{name}") for name in ("bone_segments", "checks", "entries", "pose_checks")
)
SEEDS = range(6)


def some_weights(random, vertex_count, bone_count, most=4):
    """Entries of 0 to `most` bones at each vertex, near each other in the list of bones for most vertices."""
    rows = []
    for vertex in range(vertex_count):
        near = random.integers(bone_count) + np.arange(random.integers(most + 1)) * (1 + 5 * (random.random() < 0.2))
        rows += [(vertex, bone, random.random()) for bone in sorted(set((near % bone_count).tolist()))]
    return entries.Entries(*(np.array(column) for column in zip(*rows)))


def dense(own, vertex_count, bone_count):
    table = np.zeros((vertex_count, bone_count))
    np.add.at(table, (own.vertices, own.bones), own.weights)
    return table


def shuffled_tree(random, bone_count):
    """Parents in any order, with more than one root."""
    names, parents = random.permutation(bone_count), np.full(bone_count, -1)
    for place in range(2, bone_count):
        parents[names[place]] = names[random.integers(max(0, place - 4), place)]
    return parents


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("size", (1.0, 1e-6, 0.0))
def test_the_nearest_segment_is_that_of_all(seed, size):
    random = np.random.default_rng(seed)
    points, heads = size * random.normal(size=(300, 3)), random.normal(size=(40, 3))
    tails = heads + 0.4 * random.normal(size=(40, 3))
    distances, found = bone_segments.nearest(points, heads, tails)
    every = np.array([bone_segments.distances(points, np.tile(a, (300, 1)), b) for a, b in zip(heads, tails)])
    assert np.array_equal(distances, every.min(axis=0)) and np.array_equal(found, every.argmin(axis=0))


def test_nothing_is_near_where_there_is_nothing():
    distances, found = bone_segments.nearest(np.zeros((2, 3)), np.empty((0, 3)), np.empty((0, 3)))
    assert np.isinf(distances).all() and (found == -1).all()
    assert len(bone_segments.nearest(np.empty((0, 3)), np.zeros((1, 3)), np.ones((1, 3)))[0]) == 0


@pytest.mark.parametrize("seed", SEEDS)
def test_weights_in_far_bones_are_those_of_a_search_through_all(seed):
    random = np.random.default_rng(seed)
    points, heads = random.random((400, 3)), random.random((12, 3))
    tails, own = heads + 0.1, some_weights(random, 400, 12)
    found = checks.check(own, points, np.empty((0, 2), int), heads, tails, lambda a, b, c: np.full(len(a), -1))
    every = np.array([bone_segments.distances(points, np.tile(a, (400, 1)), b) for a, b in zip(heads, tails)])
    share = dense(own, 400, 12)
    share /= np.maximum(share.sum(axis=1, keepdims=True), 1e-30)
    size = np.linalg.norm(np.ptp(points, axis=0))
    is_far = (every.T > checks.FAR * every.min(axis=0)[:, None] + checks.FAR_AT_LEAST * size) & (share >= 0.05)
    assert found.vertices["FAR"].tolist() == np.flatnonzero(is_far.any(axis=1)).tolist() and is_far.any()


@pytest.mark.parametrize("seed", SEEDS)
def test_parts_apart_are_judged_by_the_sum_of_all_differences(seed):
    random = np.random.default_rng(seed)
    own, one, other = some_weights(random, 200, 9), *random.integers(200, size=(2, 60))
    table = dense(own, 200, 9)
    expected = 0.5 * np.abs(table[one] - table[other]).sum(axis=1)
    assert np.allclose(checks._differences(own, 200, one, other), expected, atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_edges_that_a_bone_bends_are_those_of_a_search_through_all(seed):
    random = np.random.default_rng(seed)
    count, bone_count = 150, 30
    own = some_weights(random, count, bone_count).summing_to(np.ones(count))
    edges, triangles = random.integers(count, size=(300, 2)), random.integers(count, size=(200, 3))
    edges = edges[edges[:, 0] != edges[:, 1]]
    mesh = pose_checks.Mesh(random.normal(size=(count, 3)), edges, triangles, own)
    parents = shuffled_tree(random, bone_count)
    axes = np.tile(np.eye(3), (bone_count, 1, 1))
    bones = pose_checks.Bones(parents, random.normal(size=(bone_count, 3)), axes)
    found = {pose.bone: pose for pose in pose_checks.check(mesh, bones, 50)}
    table = dense(own, count, bone_count)
    for bone in range(bone_count):
        is_below = np.array([bone in chain(parents, each) for each in range(bone_count)])
        share = table[:, is_below].sum(axis=1)
        assert np.allclose(pose_checks.shares(mesh, bones, bone), share)
        bends = [~((share[c] < 0.01).all(axis=1) | (share[c] > 0.99).all(axis=1)) for c in (edges, triangles)]
        if not bends[0].any():
            assert bone not in found
            continue
        before, posed = mesh.positions, {}
        for axis in "XZ":
            posed[axis] = pose_checks.bent(before, share, bones.heads[bone], axes[bone]["XYZ".index(axis)], 50)
        ratios = {axis: lengths(points, edges) / lengths(before, edges) for axis, points in posed.items()}
        own_pose = found[bone]
        worse = max(ratios, key=lambda axis: ratios[axis][bends[0]].max())
        assert own_pose.axis == worse and np.isclose(own_pose.stretch, ratios[worse][bends[0]].max())
        assert np.isclose(own_pose.squash, ratios[worse][bends[0]].min())
        stretched = np.unique(edges[bends[0] & (ratios[worse] > pose_checks.STRETCHED)])
        assert own_pose.stretched.tolist() == stretched.tolist()
        corners = [(points[triangles[bends[1]]] - bones.heads[bone]) for points in (posed[worse], before)]
        assert np.isclose(own_pose.volume, np.linalg.det(corners[0]).sum() / np.linalg.det(corners[1]).sum(), rtol=1e-6)
    assert len(found) > 20


def chain(parents, bone):
    """A bone and those above it."""
    while bone >= 0:
        yield bone
        bone = parents[bone]


def lengths(points, edges):
    return np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)


def test_test_poses_end_when_told():
    random = np.random.default_rng(1)
    own = some_weights(random, 50, 10).summing_to(np.ones(50))
    edges = np.stack((np.arange(49), np.arange(1, 50)), axis=1)
    mesh = pose_checks.Mesh(random.normal(size=(50, 3)), edges, np.empty((0, 3), int), own)
    bones = pose_checks.Bones(np.full(10, -1), np.zeros((10, 3)), np.tile(np.eye(3), (10, 1, 1)))
    shares = []

    def goes_on(share):
        shares.append(share)
        return len(shares) < 4

    assert len(pose_checks.check(mesh, bones, 30, goes_on)) == 3 and shares == [0, 0.1, 0.2, 0.3]
    assert pose_checks.check(mesh, bones, 30)[0].volume != pose_checks.check(mesh, bones, 30)[0].volume, "none: NaN"


def test_the_largest_weights_of_a_vertex_keep_its_sum():
    random = np.random.default_rng(2)
    own = some_weights(random, 80, 12, 6)
    limits = random.integers(1, 5, size=80)
    before, after = dense(own, 80, 12), dense(own.largest(limits), 80, 12)
    assert ((after > 0).sum(axis=1) == np.minimum((before > 0).sum(axis=1), limits)).all()
    assert np.allclose(after.sum(axis=1), before.sum(axis=1))
    for old, new in zip(before, after):
        assert set(np.flatnonzero(new)) == set(np.argsort(-old, kind="stable")[: np.count_nonzero(new)])
