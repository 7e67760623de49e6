"""Bends, Layer, ShapeKeys, Deformer."""

import contextlib
import gc
import threading

import numpy as np
import pytest
import sinew_native as sinew

import reference
import rigs
from test_skeleton import said

METHODS = ["linear", "dual_quaternion"]
V, J = 5000, 8


@pytest.fixture
def random():
    return np.random.default_rng(21)


def turned(random, count):
    """Motions that keep near each other, so that dual quaternions do not nearly cancel."""
    q = np.array([1.0, 0, 0, 0]) + random.uniform(-0.4, 0.4, (count, 4))
    q /= np.linalg.norm(q, axis=1)[:, None]
    matrices = np.tile(np.eye(4), (count, 1, 1))
    matrices[:, :3, :3] = [reference.rotation(one) for one in q]
    matrices[:, :3, 3] = random.uniform(-0.5, 0.5, (count, 3))
    return matrices.astype(np.float32)


def spaces(random):
    rigid = rigs.random_matrices(random, 1)[0]
    similar, sheared = rigid.copy(), rigid.copy()
    similar[:3, :3] *= 0.8
    sheared[:3, :3] *= [0.8, 1.1, 0.9]
    return [None, rigid, similar, sheared]


def moved(matrix, points):
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def skinned(method, skin, weights, matrices, space, rest):
    """Slow and obvious: to the armature's space, skinned there, and back."""
    space = np.eye(4) if space is None else space
    there = moved(np.linalg.inv(space), rest.astype(np.float64))
    if method == "linear":
        own = reference.skin_linear(there, weights, matrices)
    else:
        own = reference.skin_dual_quaternion(there, skin.offsets, skin.joints, skin.weights, matrices)
    return moved(space, own)


@pytest.mark.parametrize("method", METHODS)
def test_a_layer_in_every_space(random, method):
    skin, positions, weights = rigs.dense_skin(random, 300, J)
    mask = random.random(300).astype(np.float32)
    pose = turned(random, J)
    out, rest = np.empty((300, 3), np.float32), random.uniform(-1, 1, (300, 3)).astype(np.float32)
    for space in spaces(random):
        for matrices in rigs.layouts(pose):
            sinew.Deformer([sinew.Layer(skin, method)]).deform([(matrices, space)], out)
            expected = skinned(method, skin, weights, pose, space, positions)
            assert np.abs(out - expected).max() < 4e-6
        masked = sinew.Deformer([sinew.Layer(skin, method, mask=mask)])
        masked.deform([(pose, space)], out)
        expected = positions + mask[:, None] * (expected - positions)
        assert np.abs(out - expected).max() < 4e-6
        masked.deform([(pose, space)], out, rest_positions=rest)
        expected = rest + mask[:, None] * (skinned(method, skin, weights, pose, space, rest) - rest)
        assert np.abs(out - expected).max() < 4e-6


def test_half_turns_are_refused_if_that_is_wanted():
    """Between joints that move the same vertices, or some beside them; others may lie as they like."""
    weights = np.zeros((32, 3))
    weights[:16], weights[16:] = (0.3, 0.7, 0), (0, 0, 1)
    skin = sinew.Skin.from_dense(np.random.default_rng(1).normal(size=(32, 3)), weights)
    deformers = [
        sinew.Deformer([sinew.Layer(skin, "dual_quaternion", refuse_half_turns=refuse)]) for refuse in (True, False)
    ]
    matrices = np.tile(np.eye(4, dtype=np.float32), (3, 1, 1))
    out, other = np.empty((2, 32, 3), np.float32)
    for turned, is_refused in ((2, False), (1, True)):
        matrices[:] = np.eye(4)
        matrices[turned, :3, :3] = np.diag([-1, 1, -1])
        deformers[1].deform([(matrices, None)], other)
        if is_refused:
            with pytest.raises(sinew.HalfTurn, match="joints 1 and 0 are half a turn apart|joints 0 and 1"):
                deformers[0].deform([(matrices, None)], out)
        else:
            deformers[0].deform([(matrices, None)], out)
            assert np.array_equal(out, other)


@pytest.mark.parametrize(("turns", "is_refused"), [((0, 0, np.pi), True), ((0, np.pi / 2, np.pi), False)])
def test_half_turns_of_segments_that_a_vertex_may_reach(turns, is_refused):
    """At rest it is at the first of two segments; behind another layer it may be at the second. No vertex is moved by
    the ends of both."""
    one, axes = np.array([1.0]), np.array([[0.0, 1, 0, 0]])
    bends = sinew.Bends(np.array([0]), np.array([0, 1]), np.array([0]), one, np.array([0]), np.array([2]), axes)
    skin = sinew.Skin.from_dense(np.array([[0.1, 0.25, 0]]), np.array([[0.5, 0.5, 0]]))
    deformer = sinew.Deformer([sinew.Layer(skin, "dual_quaternion", bends=bends, refuse_half_turns=True)])
    matrices = np.tile(np.eye(4, dtype=np.float32), (3, 1, 1))
    for matrix, angle in zip(matrices, turns):
        matrix[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    with pytest.raises(sinew.HalfTurn, match="half a turn apart") if is_refused else contextlib.nullcontext():
        deformer.deform([(matrices, None)], np.empty((1, 3), np.float32))
    linear = sinew.Deformer([sinew.Layer(skin, "linear", bends=bends, refuse_half_turns=True)])
    linear.deform([(matrices, None)], np.empty((1, 3), np.float32))


def test_layers_are_mixed_by_their_shares(random):
    skin, positions, weights = rigs.dense_skin(random, 300, J)
    other, _, other_weights = rigs.dense_skin(random, 300, 5)
    shares = random.random((2, 300))
    deformer = sinew.Deformer(
        [
            sinew.Layer(skin, "linear"),
            sinew.Layer(other, "dual_quaternion", share=shares[0]),
            sinew.Layer(skin, "dual_quaternion", share=shares[1]),
        ]
    )
    assert deformer.vertex_count == 300
    poses = [(turned(random, J), None), (turned(random, 5), spaces(random)[3]), (turned(random, J), None)]
    out = np.empty((300, 3), np.float32)
    deformer.deform(poses, out)
    shape = skinned("linear", skin, weights, *poses[0], positions)
    for share, layer, (pose, space), dense in (
        (shares[0], other, poses[1], other_weights),
        (shares[1], skin, poses[2], weights),
    ):
        own = skinned("dual_quaternion", layer, dense, pose, space, positions)
        shape += share[:, None] * (own - shape)
    assert np.abs(out - shape).max() < 4e-6


def test_layers_as_a_stage_start_from_the_shape_before_them(random):
    (skin, _, _), (other, _, _) = rigs.dense_skin(random, 300, J), rigs.dense_skin(random, 300, 5)
    layers = [sinew.Layer(skin, "linear"), sinew.Layer(other, "dual_quaternion", share=random.random(300))]
    first, poses = [(turned(random, J), None)], [(turned(random, J), spaces(random)[2]), (turned(random, 5), None)]
    deformer, mixed = sinew.Deformer([sinew.Layer(skin, "dual_quaternion")]), sinew.MixedLayers(layers)
    before, out, expected = np.empty((3, 300, 3), np.float32)
    deformer.deform(first, before)
    sinew.Deformer(layers).deform(poses, expected, rest_positions=before)
    stage = mixed.stage(poses)
    assert mixed.vertex_count == 300
    del layers, poses
    gc.collect()  # the stage keeps what it is made of
    deformer.deform(first, out, stages=[stage])
    assert np.array_equal(out, expected)
    stage.apply(before)
    assert np.array_equal(before, expected)


def test_refuses_layers_and_poses_that_do_not_fit_a_stage(random):
    skin, _, _ = rigs.dense_skin(random, 300, J)
    layer, pose = sinew.Layer(skin, "linear"), turned(random, J)
    assert said(sinew.MixedLayers, []) == "there are no layers; expected at least one"
    assert said(sinew.MixedLayers, [layer, layer]) == "layer 1 has no share; only the first has none"
    stage = sinew.MixedLayers([layer]).stage
    assert said(stage, []) == "there are 0 poses; the stage has 1 layer"
    assert said(stage, [pose]) == "pose 0 is not a tuple (matrices, space)"
    assert said(stage, [(pose[1:], None)]) == "layer 0: there are 7 matrices per frame; the skin has 8 joints"


def some_keys(random, vertices=V):
    """Positions, what they are relative to, groups: a key of a part, a key of all, one relative to another,
    one with a group, one that is relative to none there is."""
    base = random.uniform(-1, 1, (vertices, 3)).astype(np.float32)
    part, whole, group = base.copy(), base.copy(), random.random(vertices).astype(np.float32)
    part[vertices // 3 : vertices // 2] += 0.1
    whole += random.uniform(-0.1, 0.1, base.shape).astype(np.float32)
    further = whole.copy()
    further[::7] += 0.3
    group[::3] = 0
    return (
        [base, part, whole, further, whole, whole],
        np.array([0, 0, 0, 2, 0, 17]),
        [None, None, None, None, group, None],
    )


def summed(positions, relative_to, weights, values):
    """Blender's loop in float32."""
    shape = positions[0].copy()
    for k in range(1, len(positions)):
        value, reference_key = np.float32(values[k]), relative_to[k]
        if value == 0 or not 0 <= reference_key < len(positions):
            continue
        factor = value if weights[k] is None else (weights[k] * value)[:, None]
        shape -= factor * (positions[reference_key] - positions[k])
    return shape


def test_shape_keys_are_the_numpy_loop_to_the_bit(random):
    keys = some_keys(random)
    made = sinew.ShapeKeys(*keys)
    assert (made.count, made.vertex_count) == (6, V)
    group = keys[2][4]
    assert made.delta_count == V // 2 - V // 3 + V + len(range(0, V, 7)) + np.count_nonzero(group)
    assert np.array_equal(made.base, keys[0][0])
    deformer = sinew.Deformer([], made)
    out = np.empty((V, 3), np.float32)
    for values in ([0] * 6, [1] * 6, [0.3, -0.7, 0, 0.1, 0, 0], [0, 0.1, 0.2, 0.3, 0.4, 0.5]):
        deformer.deform([], out, key_values=np.float32(values))
        assert out.tobytes() == summed(*keys, values).tobytes()
    deformer.deform([], out)
    assert out.tobytes() == keys[0][0].tobytes()


def test_nothing_is_kept_of_the_positions(random):
    positions, relative_to, weights = some_keys(random)
    values = np.float32([0, 1, 1, 1, 1, 1])
    expected = summed(positions, relative_to, weights, values)
    strided = [np.zeros((V, 6), np.float64)[:, ::2] for _ in positions]  # read through a copy
    for own, given in zip(strided, positions):
        own[:] = given
    for given in (positions, strided):
        made = sinew.Deformer([], sinew.ShapeKeys(given, relative_to.tolist(), weights))
        for own in given:
            own[:] = 7
        out = np.empty((V, 3), np.float32)
        made.deform([], out, values)
        assert np.array_equal(out, expected)


@pytest.mark.parametrize("method", METHODS)
def test_keys_come_before_skinning(random, method):
    skin, _, _ = rigs.dense_skin(random, V, J)
    keys = some_keys(random)
    layer = sinew.Layer(skin, method, mask=random.random(V))
    with_keys, without = sinew.Deformer([layer], sinew.ShapeKeys(*keys)), sinew.Deformer([layer])
    poses = [(turned(random, J), spaces(random)[2])]
    out, expected = np.empty((2, V, 3), np.float32)
    for values in ([0, 0.5, 0, 0, 0, 0], [0, 0.1, 0.2, 0.3, 0.4, 0.5], None):
        with_keys.deform(poses, out, None if values is None else np.float32(values))
        shape = keys[0][0] if values is None else summed(*keys, values)
        without.deform(poses, expected, rest_positions=shape)
        assert np.array_equal(out, expected)


@pytest.mark.parametrize("method", METHODS)
def test_alone_it_is_the_skinning_function(random, method):
    skin, _, _ = rigs.dense_skin(random, V, J)
    pose, frames = turned(random, J), rigs.random_matrices(random, J)
    pose[:, :3, :3] *= [1, 1.2, 0.9]
    out = np.empty((V, 3), np.float32)
    how = {} if method == "linear" else {"stretch": "frame_each", "rest_frames": frames}
    sinew.Deformer([sinew.Layer(skin, method, **how)]).deform([(pose, None)], out)
    function = sinew.skin_linear if method == "linear" else sinew.skin_dual_quaternion
    assert np.array_equal(out, function(skin, pose, **how))
    skin.set_rest_positions(random.random((V, 3)))  # a layer sees what is done to its skin
    sinew.Deformer([sinew.Layer(skin, method, **how)]).deform([(pose, None)], out)
    assert np.array_equal(out, function(skin, pose, **how))


def test_a_scale_of_the_space_is_taken_off_the_rest_frames(random):
    skin, positions, _ = rigs.dense_skin(random, V, J)
    frames, pose, space = rigs.random_matrices(random, J), turned(random, J), spaces(random)[2]
    pose[:, :3, :3] *= [1, 1.2, 0.9]
    layer = sinew.Layer(skin, "dual_quaternion", "frame_each", frames)
    out = np.empty((V, 3), np.float32)
    sinew.Deformer([layer]).deform([(pose, space)], out)
    there = space @ frames
    there[:, :3, :3] /= np.cbrt(np.linalg.det(space[:3, :3]))
    carried = (space @ pose @ np.linalg.inv(space)).astype(np.float32)
    expected = sinew.skin_dual_quaternion(skin, carried, stretch="frame_each", rest_frames=there)
    assert np.abs(out - expected).max() < 2e-6


def test_a_space_without_an_inverse(random):
    skin, _, _ = rigs.dense_skin(random, V, J)
    flat = np.diag([1.0, 1, 0, 1])
    out = np.empty((V, 3), np.float32)
    for method in METHODS:
        sinew.Deformer([sinew.Layer(skin, method)]).deform([(turned(random, J), flat)], out)
        assert np.isfinite(out).all()


def bendy(random, vertices=V):
    """What Bends takes of a rig with a bone of four segments, one of two and an ordinary one, joints 0 to 8; the
    first third of the vertices hangs on the ordinary one alone, the others on all three."""
    listed = np.arange(vertices // 3, vertices)
    weights = random.dirichlet(np.ones(3), len(listed)).astype(np.float32)
    axes = np.linalg.inv(rigs.random_matrices(random, 3, size=0.5))[:, 1] / 0.7  # many points beyond an end
    return {
        "vertices": listed,
        "offsets": 3 * np.arange(len(listed) + 1),
        "bones": np.tile([2, 0, 1], len(listed)),
        "weights": weights.ravel(),
        "first_joints": np.array([0, 5, 8]),
        "segments": np.array([4, 2, 1]),
        "axes": axes,
    }


def split_skin(given, positions, points, space=None):
    """A Skin on positions, split at points, both in the space of the mesh."""
    if space is not None:
        points = moved(np.linalg.inv(space), points.astype(np.float64))
    first, n, axes = given["first_joints"], given["segments"], given["axes"]
    listed = given["vertices"]
    influences = [[(8, 1.0)] for _ in range(len(positions))]
    for i, v in enumerate(listed):
        influences[v] = []
        for k in range(*given["offsets"][i : i + 2]):
            bone, weight = given["bones"][k], float(given["weights"][k])
            place = min(max(axes[bone, :3] @ points[v] + axes[bone, 3], 0), 1) * n[bone]
            index = min(int(place), n[bone] - 1) if n[bone] > 1 else 0
            blend = place - index if n[bone] > 1 else 0
            parts = [(first[bone] + index, weight * (1 - blend)), (first[bone] + index + 1, weight * blend)]
            influences[v] += [part for part in parts if part[1] != 0]
    flat = [part for own in influences for part in own]
    return sinew.Skin(
        positions,
        np.cumsum([0] + [len(own) for own in influences]),
        np.array([joint for joint, _ in flat]),
        np.array([weight for _, weight in flat]),
        9,
    )


def ways_to_skin(random):
    """Arguments of Layer and whether joints are scaled."""
    frames = rigs.random_matrices(random, 9)
    yield {"method": "linear"}, True
    yield {"method": "dual_quaternion"}, False
    for stretch in ("frame", "frame_each"):
        yield {"method": "dual_quaternion", "stretch": stretch, "rest_frames": frames}, True


def test_bends_follow_the_points(random):
    given = bendy(random)
    bends = sinew.Bends(**given)
    assert (bends.vertex_count, bends.influence_count) == (len(given["vertices"]), len(given["bones"]))
    keys = some_keys(random)
    rest, values = keys[0][0], np.float32([0, 0.8, 0, 0, 0, 0])
    other = random.uniform(-1, 1, rest.shape).astype(np.float32)
    shape = summed(*keys, values)
    own, expected = np.empty((2, V, 3), np.float32)
    for space in spaces(random):
        skin = split_skin(given, rest, rest, space)
        on_shape, on_other = (split_skin(given, rest, points, space) for points in (shape, other))
        elsewhere = split_skin(given, rest, rest, np.diag([1.3, 1.3, 1.3, 1]))
        for how, scaled in ways_to_skin(random):
            pose = turned(random, 9)
            if scaled:
                pose[:, :3, :3] *= [1, 1.2, 0.9]
            poses = [(pose, space)]

            def plain(own_skin, *arguments, how=how, poses=poses):
                sinew.Deformer([sinew.Layer(own_skin, **how)], sinew.ShapeKeys(*keys)).deform(
                    poses, expected, *arguments
                )
                return expected

            layer = sinew.Layer(skin, **how, bends=bends, split_space=space)
            deformer = sinew.Deformer([layer], sinew.ShapeKeys(*keys))
            deformer.deform(poses, own, values)
            assert np.abs(own - plain(on_shape, values)).max() < 4e-6
            unmoved = (shape == rest).all(axis=1)
            assert np.array_equal(own[unmoved], plain(skin, values)[unmoved])
            assert not np.allclose(own[~unmoved], expected[~unmoved], atol=1e-3)
            deformer.deform(poses, own, None, other)
            assert np.abs(own - plain(on_other, None, other)).max() < 4e-6
            deformer.deform(poses, own)
            assert np.array_equal(own, plain(skin))
            layer = sinew.Layer(elsewhere, **how, bends=bends, split_space=np.diag([1.3, 1.3, 1.3, 1]))
            sinew.Deformer([layer], sinew.ShapeKeys(*keys)).deform(poses, own)
            assert np.abs(own - plain(skin)).max() < 4e-6


def test_bends_with_any_number_of_threads_give_the_same_bits(random):
    given = bendy(random, 30000)
    keys = some_keys(random, 30000)
    layer = sinew.Layer(split_skin(given, keys[0][0], keys[0][0]), "linear", bends=sinew.Bends(**given))
    deformer, results = sinew.Deformer([layer], sinew.ShapeKeys(*keys)), []
    poses = [(turned(random, 9), None)]
    for count in (1, 2, 3, 8):
        sinew.set_thread_count(count)
        results.append(deformed(deformer, poses, np.float32([0, 1, 0, 0.5, 0, 0])))
    assert len(set(results)) == 1


def test_refuses_bends_that_do_not_fit(random):
    given = bendy(random, 6)
    skin = split_skin(given, np.zeros((6, 3)), np.zeros((6, 3)))

    def complains(**changes):
        return said(sinew.Bends, **{**given, **changes})

    assert complains(vertices=np.array([2, 3, 3, 5])) == "vertices does not increase at entry 2"
    assert complains(vertices=np.arange(4.0)) == "vertices is float64; expected integers"
    assert complains(offsets=np.array([0, 12])) == "offsets has 2 entries; expected 5, one more than there are vertices"
    assert complains(bones=np.full(12, 3)) == "influence 0 names bone 3; there are 3 bones"
    assert complains(weights=np.full(12, np.nan)) == "the weight of influence 0 is not finite"
    assert complains(weights=np.ones((12, 1))) == "weights has shape (12, 1); expected (N,)"
    assert (
        complains(first_joints=np.array([0, 5]))
        == "first_joints has 2 entries and segments has 3; expected as many of each"
    )
    assert complains(segments=np.array([4, 2, 0])) == "bone 2 has 0 segments; expected 1 to 16,777,215"
    assert complains(axes=np.zeros((3, 3))) == "axes has shape (3, 3); expected (B, 4)"
    assert complains(axes=np.zeros((2, 4))) == "axes has 8 numbers; expected four for each of 3 bones"
    bends = sinew.Bends(**{**given, "vertices": given["vertices"] + 1})
    assert said(sinew.Layer, skin, "linear", bends=bends) == "bends names vertex 6; the skin has 6 vertices"
    bends = sinew.Bends(**{**given, "first_joints": np.array([0, 5, 9])})
    assert said(sinew.Layer, skin, "linear", bends=bends) == "bends names joint 9; the skin has 9 joints"
    assert said(sinew.Layer, skin, "linear", split_space=np.eye(3)) == "split_space has shape (3, 3); expected (4, 4)"


def everything(random, vertices=30000):
    """(deformer, arguments of deform without out) with layers of all kinds on keys."""
    skin, _, _ = rigs.dense_skin(random, vertices, J)
    layers = [
        sinew.Layer(
            skin,
            METHODS[i % 2],
            mask=random.random(vertices) if i else None,
            share=random.random(vertices) if i else None,
        )
        for i in range(4)
    ]
    poses = [(turned(random, J), space) for space in spaces(random)]
    deformer = sinew.Deformer(layers, sinew.ShapeKeys(*some_keys(random, vertices)))
    return deformer, poses, np.float32([0, 0.1, 0.2, 0.3, 0.4, 0.5])


def deformed(deformer, poses, values):
    out = np.full((deformer.vertex_count, 3), np.nan, np.float32)
    deformer.deform(poses, out, values)
    return out.tobytes()


def test_any_number_of_threads_gives_the_same_bits(random):
    all_of_it = everything(random)
    sinew.set_thread_count(1)
    one = deformed(*all_of_it)
    for count in (2, 3, 8):
        sinew.set_thread_count(count)
        assert deformed(*all_of_it) == one


def test_python_threads_may_use_one_at_once(random):
    deformer, poses, values = everything(random)
    cases = [values, None]
    expected = [deformed(deformer, poses, case) for case in cases]
    wrong = []

    def work(first):
        for i in range(first, first + 6):
            if deformed(deformer, poses, cases[i % 2]) != expected[i % 2]:
                wrong.append(i)

    threads = [threading.Thread(target=work, args=(i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_a_deformer_keeps_what_it_is_made_of(random):
    all_of_it = everything(random, 400)
    before = deformed(*all_of_it)
    gc.collect()
    others = [everything(random, 400) for _ in range(3)]
    assert others and deformed(*all_of_it) == before


def test_of_no_vertices():
    skin = sinew.Skin(np.zeros((0, 3)), np.array([0]), np.array([], int), np.array([]), 2)
    nothing = np.zeros((0, 3), np.float32)
    keys = sinew.ShapeKeys([nothing], [0])
    deformer = sinew.Deformer([sinew.Layer(skin, "linear", mask=np.zeros(0))], keys)
    deformer.deform([(np.tile(np.eye(4, dtype=np.float32), (2, 1, 1)), None)], nothing)


def test_refuses_what_it_is_made_of():
    skin = sinew.Skin.from_dense(np.zeros((5, 3)), np.ones((5, 2)))
    small = sinew.Skin.from_dense(np.zeros((4, 3)), np.ones((4, 2)))
    layer = sinew.Layer(skin, "linear")
    assert (layer.vertex_count, layer.joint_count) == (5, 2)
    assert (
        said(sinew.Layer, skin, "cubic")
        == 'there is no method "cubic"; expected one of linear, dual_quaternion, blended, rotation_centers, '
        "direct_delta_mush"
    )
    assert said(sinew.Layer, skin, "dual_quaternion", "frame") == "there are 0 rest frames; expected 2"
    assert said(sinew.Layer, skin, "linear", mask=np.ones(4)) == "mask has 4 numbers; the skin has 5 vertices"
    assert said(sinew.Layer, skin, "linear", share=np.ones((5, 1))) == "share has shape (5, 1); expected (N,)"
    assert said(sinew.Layer, skin, "linear", mask=np.full(5, np.nan)) == "mask is not finite at vertex 0"
    assert said(sinew.Deformer, []) == "there are no layers and no shape keys; expected at least one of them"
    assert (
        said(sinew.Deformer, [layer, sinew.Layer(small, "linear", share=np.ones(4))])
        == "layer 1 has 4 vertices; layer 0 has 5"
    )
    assert said(sinew.Deformer, [layer, layer]) == "layer 1 has no share; only the first has none"
    assert (
        said(sinew.Deformer, [sinew.Layer(skin, "linear", share=np.ones(5))])
        == "layer 0 has a share; there is nothing that it could be mixed with"
    )
    points = np.zeros((5, 3))
    assert (
        said(sinew.Deformer, [layer], sinew.ShapeKeys([points[:4]], [0]))
        == "the keys have 4 vertices; the layers have 5"
    )
    assert said(sinew.ShapeKeys, [], np.array([], int)) == "there are no shape keys; expected the base at least"
    assert said(sinew.ShapeKeys, [points, points[:4]], [0, 0]) == "key 1 has 4 vertices; key 0 has 5"
    assert said(sinew.ShapeKeys, [points, points.ravel()], [0, 0]) == "positions[1] has shape (15,); expected (V, 3)"
    assert said(sinew.ShapeKeys, [points], [0, 0]) == "relative_to has 2 entries; there are 1 key"
    assert said(sinew.ShapeKeys, [points], [0.5]) == "relative_to is float64; expected integers"
    assert said(sinew.ShapeKeys, [points, points], [0, 0], [None]) == "weights has 1 entry; there are 2 keys"
    assert said(sinew.ShapeKeys, [points], [0], []) == "weights has 0 entries; expected one per key, or None"
    assert (
        said(sinew.ShapeKeys, [points, points], [0, 0], [None, np.ones(4)])
        == "key 1 has 4 weights; there are 5 vertices"
    )
    assert said(sinew.ShapeKeys, [points, points + np.inf], [0, 0]) == "vertex 0 of key 1 is not finite"


def test_refuses_arguments_that_do_not_fit():
    skin = sinew.Skin.from_dense(np.zeros((5, 3)), np.ones((5, 2)))
    layer, points = sinew.Layer(skin, "linear"), np.zeros((5, 3), np.float32)
    deformer = sinew.Deformer([layer])
    with_keys = sinew.Deformer([layer], sinew.ShapeKeys([points, points], [0, 0]))
    pose = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    out = np.full((5, 3), 7, np.float32)
    good = [(pose, None)]

    def complains(poses, *arguments, by=deformer, **named):
        sentence = said(by.deform, poses, *arguments, **named)
        assert (out == 7).all()
        return sentence

    assert complains([], out) == "there are 0 poses; the deformer has 1 layer"
    assert complains([pose], out) == "pose 0 is not a tuple (matrices, space)"
    assert complains([(pose, None, 1)], out) == "pose 0 is not a tuple (matrices, space)"
    assert complains([(pose[:1], None)], out) == "layer 0: there are 1 matrix per frame; the skin has 2 joints"
    assert complains([(pose[None], None)], out) == "pose 0: matrices has shape (1, 2, 4, 4); expected (J, 4, 4)"
    assert complains([(pose.astype(float), None)], out) == "pose 0: matrices is float64; expected float32"
    assert complains([([1], None)], out) == "pose 0: matrices is a list; expected a numpy array"
    assert complains([(pose, np.eye(3))], out) == "pose 0: space has shape (3, 3); expected (4, 4)"
    assert complains([(pose, np.eye(4, dtype=np.float32))], out) == "pose 0: space is float32; expected float64"
    assert complains(good, out[:4]) == "out has shape (4, 3); expected (5, 3)"
    assert complains(good, out.astype(float)) == "out is float64; expected float32"
    assert complains(good, out, np.zeros(2, np.float32)) == "there are key values, but no shape keys"
    assert (
        complains(good, out, np.zeros(3, np.float32), by=with_keys) == "there are 3 key values; expected 2, one per key"
    )
    assert complains(good, out, np.zeros(2), by=with_keys) == "key_values is float64; expected float32"
    assert (
        complains(good, out, np.zeros((2, 1), np.float32), by=with_keys) == "key_values has shape (2, 1); expected (K,)"
    )
    assert (
        complains(good, out, np.zeros(2, np.float32), points, by=with_keys)
        == "there are key_values and rest_positions; expected one"
    )
    assert complains(good, out, None, points[:4]) == "rest_positions has 12 numbers; expected 15 (5 x 3)"
    assert complains(good, out, None, points.ravel()) == "rest_positions has shape (15,); expected (V, 3)"
    assert (
        complains(good, out, None, np.zeros((5, 6), np.float32)[:, ::2])
        == "rest_positions is not C-contiguous; pass a C-contiguous array"
    )
    assert complains(good, out, None, out) == "the result and rest_positions overlap"
    deformer.deform(good, out)
    assert not out.any()
