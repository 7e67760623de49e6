"""addon/sinew/deform/influences.py, which needs no Blender: the rules by hand. The judge of the whole is
Blender's modifier, in tests/blender/test_any_character.py."""

import importlib
import sys
import types
from pathlib import Path

import numpy as np
import pytest
import sinew_native as sinew

import rigs

ADDON = Path(__file__).resolve().parents[2] / "addon" / "sinew"
# The add-on's package, with the compiled module and without what needs Blender.
package, native = types.ModuleType("addon"), types.ModuleType("addon.native")
package.__path__, native.sinew_native = [str(ADDON)], sinew
sys.modules |= {"addon": package, "addon.native": native}
rules = importlib.import_module("addon.deform.influences")


def bones(count=2, segments=None, deform=None, multiply=None, curved=False):
    """Bones of length 1 along Y, one above the other, with envelopes of radius 0.25 and reach 0.5."""
    rest = np.tile(np.eye(4), (count, 1, 1))
    rest[:, 1, 3] = np.arange(count)
    ones = np.ones(count)
    return rules.Bones(
        names=tuple(f"b{i}" for i in range(count)),
        rest=rest,
        length=ones,
        deform=np.ones(count, bool) if deform is None else np.array(deform),
        head_radius=0.25 * ones,
        tail_radius=0.25 * ones,
        envelope_distance=0.5 * ones,
        envelope_weight=np.arange(1.0, count + 1),
        multiply=np.zeros(count, bool) if multiply is None else np.array(multiply),
        segments=np.ones(count, int) if segments is None else np.array(segments),
        curved=np.full(count, curved),
    )


def dense(result):
    table = np.zeros((len(result.offsets) - 1, result.joint_count + 1))
    vertex = np.repeat(np.arange(len(table)), np.diff(result.offsets))
    np.add.at(table, (vertex, result.joints), result.weights)
    return table


def of(entries, own_bones, points=None, segment_at=None, **settings):
    """entries: for each vertex [(bone, weight)]."""
    offsets = np.cumsum([0] + [len(e) for e in entries])
    flat = [pair for e in entries for pair in e]
    groups = np.array([b for b, _ in flat], np.int32)  # the group of bone b has its number
    weight = np.array([w for _, w in flat], np.float32)
    points = np.zeros((len(entries), 3)) if points is None else np.array(points, float)
    own_rules, numbers = rules.Rules(**settings), np.arange(len(own_bones.names))
    return rules.influences(offsets, groups, weight, numbers, own_bones, own_rules, lambda: points, segment_at)


def test_weights_are_normalised_over_bones_that_deform():
    result = of([[(0, 0.3), (1, 0.3)], [(0, 0.2), (-1, 0.7)], [(1, 1.0)], [(0, 5e-5)], []], bones(deform=[True, False]))
    assert dense(result).tolist() == [[1, 0], [1, 0], [0, 0], [0, 0], [0, 0]]  # one joint, and the one that stays
    assert not result.depend_on_shape


def test_a_weight_that_is_nothing_and_a_group_that_is_gone_move_nothing():
    result = of([[(0, 0.0), (1, 0.5)], [(7, 1.0), (1, 0.25), (0, 0.75)], [(0, 0.0)]], bones())
    assert result.offsets.tolist() == [0, 1, 3, 3] and result.joints.tolist() == [1, 1, 0]
    assert result.weights.tolist() == [1, 0.25, 0.75]
    assert (result.unweighted_count, result.unnormalized_count) == (1, 1)


def test_an_armature_without_bones_moves_nothing():
    result = rules.influences(
        np.array([0, 1]), np.zeros(1, np.int32), np.ones(1, np.float32), np.array([-1]), bones(0), rules.Rules(), None
    )
    assert result.offsets.tolist() == [0, 0] and result.unweighted_count == 1


def test_the_library_and_numpy_agree():
    random = np.random.default_rng(6)
    count = random.integers(0, 6, 3000)
    offsets, total = np.concatenate(([0], np.cumsum(count))), count.sum()
    groups = random.integers(-1, 5, total).astype(np.int32)
    weights = random.choice([0, 1e-5, 0.3, 1], total).astype(np.float32) * random.random(total, np.float32)
    joint_of_group = np.array([3, -1, 0, 2], np.int32)  # group 4 is gone
    found = sinew.group_influences(offsets, groups, weights, joint_of_group)
    joint = np.append(joint_of_group, [-1, -1])[groups]
    vertex = np.repeat(np.arange(3000), count)[(joint >= 0) & (weights != 0)]
    kept = np.float64(weights[(joint >= 0) & (weights != 0)])
    sums = np.bincount(vertex, kept, 3000)
    moved = sums[vertex] > rules.SMALLEST_WEIGHT_SUM
    assert found[0].tolist() == [0, *np.cumsum(np.bincount(vertex[moved], minlength=3000))]
    assert found[1].tolist() == joint[(joint >= 0) & (weights != 0)][moved].tolist()
    assert found[2].tolist() == np.float32((kept / sums[vertex])[moved]).tolist()
    has_sum = sums > rules.SMALLEST_WEIGHT_SUM
    assert found[3] == np.count_nonzero(~has_sum)
    assert found[4] == np.count_nonzero(has_sum & (np.abs(sums - 1) > rules.NORMALIZED_WITHIN))


def test_sizes_of_groups_that_do_not_fit():
    def said(offsets, groups, weights):
        with pytest.raises(ValueError) as error:
            sinew.group_influences(
                np.array(offsets, int), np.array(groups, int), np.array(weights, float), np.array([0])
            )
        return str(error.value)

    assert said([0, 1], [0], [1, 1]) == "groups has 1 entries and weights has 2; expected as many of each"
    assert said([], [0], [1]) == "offsets is empty; expected one number more than there are rows"
    for offsets in ([0], [1, 1], [0, 2]):
        ends = f"from {offsets[0]} to {offsets[-1]}"
        assert said(offsets, [0], [1]) == f"offsets goes {ends}; expected 0 to 1, the number of entries"
    assert said([0, 2, 1, 2], [0, 0], [1, 1]) == "offsets[2] is 1, below the one before"


def test_entries_keep_their_order():
    result = of([[(1, 0.25), (0, 0.75)]], bones())
    assert result.joints.tolist() == [1, 0] and result.weights.tolist() == [0.25, 0.75]


def test_envelope_by_distance():
    points = np.array([[0, 0.5, 0], [0.25, 0.5, 0], [0.5, 0.5, 0], [0.75, 0.5, 0], [0, -0.5, 0]])
    taken = rules.envelope(points, bones(1), np.zeros(5, int))
    assert np.allclose(taken, [1, 1, 0.75, 0, 0.75])


def test_envelopes_for_vertices_without_weights_alone():
    result = of([[(0, 1.0)], [], []], bones(), points=[[0, 1.5, 0], [0, 1, 0], [9, 9, 9]], use_envelopes=True)
    table = dense(result)
    assert np.allclose(table, [[1, 0, 0], [1 / 3, 2 / 3, 0], [0, 0, 0]])  # envelope weights 1 and 2
    assert result.depend_on_shape


def test_envelope_multiplies():
    result = of([[(0, 0.5), (1, 0.5)]], bones(multiply=[True, False]), points=[[0.5, 0.5, 0]])
    assert np.allclose(dense(result), [[0.375 / 0.875, 0.5 / 0.875, 0]])


def test_segments_share_a_bone():
    result = of([[(0, 1.0)]] * 4, bones(1, segments=[4]), points=[[0, -1, 0], [0, 0.375, 0], [0, 0.5, 0], [0, 3, 0]])
    assert result.joint_count == 5 and not result.depend_on_shape
    assert np.allclose(
        dense(result), [[1, 0, 0, 0, 0, 0], [0, 0.5, 0.5, 0, 0, 0], [0, 0, 1, 0, 0, 0], [0, 0, 0, 0, 1, 0]]
    )


def test_bends_hold_influences_that_are_not_split():
    own_bones = bones(4, segments=[1, 4, 1, 2], deform=[True, True, False, True])
    result = of([[(0, 1.0)], [(3, 0.5), (0, 1.5)], [(2, 0.5), (1, 0.5)], [(0, 0.5)], [(1, 5e-5)]], own_bones)
    bends = result.bends
    assert bends.vertices.tolist() == [1, 2] and bends.offsets.tolist() == [0, 2, 3]
    assert bends.bones.tolist() == [2, 0, 1] and bends.weights.tolist() == [0.25, 0.75, 1]
    assert bends.first_joints.tolist() == [0, 1, 6] and bends.segments.tolist() == [1, 4, 2]
    assert bends.axes.tolist() == [[0, 1, 0, 0], [0, 1, 0, -1], [0, 1, 0, -3]]
    assert not result.depend_on_shape


def test_there_are_bends_for_bones_with_segments_alone():
    assert of([[(0, 1.0)]], bones()).bends is None
    assert of([[(0, 1.0)]], bones(2, segments=[1, 4], curved=True)).bends is None  # moves no vertex
    assert not of([[(0, 1.0)]], bones(2, segments=[1, 4], curved=True)).depend_on_shape
    enveloped = of([[(0, 1.0)]], bones(2, segments=[4, 1]), use_envelopes=True)
    assert enveloped.depend_on_shape and enveloped.bends is not None


def test_bends_split_as_influences_do():
    random = np.random.default_rng(5)
    own_bones = bones(3, segments=[4, 1, 3])
    own_bones.rest = rigs.random_matrices(random, 3, size=0.3)
    own_bones.length = np.array([0.7, 1, 0.5])
    entries = [[(b, w) for b, w in zip(random.permutation(3)[: 1 + v % 3], random.random(3))] for v in range(400)]
    rest, points = random.uniform(-1, 1, (2, 400, 3)).astype(np.float32)
    pose = np.tile(np.eye(4, dtype=np.float32), (own_bones.joint_count + 1, 1, 1))
    pose[:-1, :3, 3] = random.uniform(-1, 1, (own_bones.joint_count, 3))

    def deformed(result, **more):
        skin = sinew.Skin(rest, result.offsets, result.joints, result.weights, result.joint_count + 1)
        out = np.empty_like(rest)
        sinew.Deformer([sinew.Layer(skin, "linear", **more)]).deform([(pose, None)], out, None, points)
        return out

    at_rest, there = of(entries, own_bones, rest), of(entries, own_bones, points)
    bends = sinew.Bends(**vars(at_rest.bends))
    assert np.abs(deformed(at_rest, bends=bends) - deformed(there)).max() < 2e-6
    assert np.abs(deformed(at_rest) - deformed(there)).max() > 0.1


def test_segments_along_a_curve_are_asked_for():
    asked = []

    def segment_at(bone, point):
        asked.append((bone, point.tolist()))
        return 2, 0.25

    result = of(
        [[(1, 1.0)], [(0, 1.0)]],
        bones(2, segments=[1, 4], curved=True),
        points=[[0, 1.5, 0], [0, 0, 0]],
        segment_at=segment_at,
    )
    assert asked == [(1, [0, 1.5, 0])]
    assert result.depend_on_shape and result.bends is None
    assert np.allclose(dense(result), [[0, 0, 0, 0.75, 0.25, 0, 0], [1, 0, 0, 0, 0, 0, 0]])


def test_weights_of_one_group():
    assert rules.group_weights(np.array([0, 2, 2, 3]), np.array([1, 0, 1]), np.array([0.5, 0.25, 1.0]), 1).tolist() == [
        0.5,
        0,
        1,
    ]
