"""smooth_weights, reduce_weights, mirror_weights, transfer_weights."""

from itertools import combinations

import numpy as np
import pytest
import sinew_native as sinew

from test_decompose import grid, posed, rigid, soft

NONE = np.zeros(0, int)


@pytest.fixture
def random():
    return np.random.default_rng(29)


def edges(offsets, faces):
    pairs = set()
    for first, last in zip(offsets[:-1], offsets[1:]):
        own = faces[first:last].tolist()
        pairs |= {tuple(sorted(pair)) for pair in zip(own, own[1:] + own[:1])}
    return np.array(sorted(pairs))


def mean_of_neighbours(offsets, faces, vertices):
    """The matrix whose rows average over neighbours, dense."""
    matrix = np.zeros((vertices, vertices))
    for a, b in edges(offsets, faces):
        matrix[a, b] = matrix[b, a] = 1
    return matrix / matrix.sum(1, keepdims=True)


def painted(random, columns=12):
    positions, offsets, faces = grid(columns)
    weights = random.dirichlet(np.full(5, 0.3), len(positions))
    return positions, offsets, faces, weights


# Smooth


@pytest.mark.parametrize("factor, steps", ((0.5, 1), (0.5, 5), (1, 3), (0.3, 40)))
def test_steps_go_to_the_mean_of_neighbours(random, factor, steps):
    _, offsets, faces, weights = painted(random)
    expected = weights
    mean = mean_of_neighbours(offsets, faces, len(weights))
    for _ in range(steps):
        expected = (1 - factor) * expected + factor * mean @ expected
    made = sinew.smooth_weights(weights, offsets, faces, steps=steps, factor=factor)
    assert made.dtype == np.float32
    assert made == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("strength", (0.1, 1.0, 100.0))
def test_a_strength_is_solved_for(random, strength):
    _, offsets, faces, weights = painted(random)
    mean = mean_of_neighbours(offsets, faces, len(weights))
    expected = np.linalg.solve(np.eye(len(weights)) * (1 + strength) - strength * mean, weights)
    made = sinew.smooth_weights(weights, offsets, faces, strength=strength)
    assert made == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("how", ({"steps": 7}, {"strength": 10.0}))
def test_smoothing_keeps_sums_and_what_is_fixed(random, how):
    _, offsets, faces, weights = painted(random)
    fixed = random.random(len(weights)) < 0.4
    made = sinew.smooth_weights(weights, offsets, faces, mask=~fixed, **how)
    assert made.sum(1) == pytest.approx(np.ones(len(weights)), abs=1e-5)
    assert made.min() >= 0
    assert (made[fixed] == weights[fixed].astype(np.float32)).all()
    assert np.abs(made[~fixed] - weights[~fixed]).max() > 0.1
    locked = sinew.smooth_weights(weights, offsets, faces, locked=np.array([1, 3]), **how)
    assert (locked[:, [1, 3]] == weights[:, [1, 3]].astype(np.float32)).all()
    assert locked.sum(1) == pytest.approx(np.ones(len(weights)), abs=1e-5)
    assert np.abs(locked[:, 0] - weights[:, 0]).max() > 0.1


def test_seams_become_equal(random):
    positions, offsets, faces, weights = painted(random)
    split = np.arange(len(faces))
    apart = sinew.smooth_weights(
        weights[faces], np.arange(0, len(faces) + 1, 4), split, positions=positions[faces], steps=3
    )
    whole = sinew.smooth_weights(weights, offsets, faces, steps=3)
    assert apart == pytest.approx(whole[faces], abs=1e-5)


def test_vertices_without_faces_stay(random):
    weights = random.dirichlet(np.ones(3), 5)
    for how in ({"steps": 3}, {"strength": 3.0}):
        assert (sinew.smooth_weights(weights, NONE, NONE, **how) == weights.astype(np.float32)).all()


# Reduce


def moves(positions, weights, reduced, matrices):
    return np.linalg.norm(posed(positions, reduced, matrices) - posed(positions, weights, matrices), axis=2)


def test_what_goes_is_what_moves_least(random):
    """A large weight of a bone that moves as another one goes, a small one of a bone that goes far stays."""
    weights = np.array([[0.45, 0.45, 0.1]])
    matrices = np.tile(np.eye(4), (2, 3, 1, 1))
    matrices[1, 2, 0, 3] = 5
    made, largest, mean = sinew.reduce_weights(weights, np.zeros((1, 3)), matrices, max_influences=2)
    assert (made[0, 2], (made[0] > 0).sum()) == (pytest.approx(0.1, abs=1e-6), 2)
    assert largest[0] < 1e-6 and mean[0] < 1e-6


@pytest.mark.parametrize("most", (1, 2, 4))
def test_reduced_weights_are_near_the_best(random, most):
    positions = random.normal(size=(40, 3))
    weights = random.dirichlet(np.full(6, 0.7), 40)
    matrices = rigid(random, 5, 6, far=0.2)
    made, largest, mean = sinew.reduce_weights(weights, positions, matrices, max_influences=most)
    assert (np.count_nonzero(made, axis=1) <= most).all() and made.min() >= 0
    assert made.sum(1) == pytest.approx(np.ones(40), abs=1e-6)
    off = moves(positions, weights, made, matrices)
    assert largest == pytest.approx(off.max(0), rel=1e-3, abs=1e-6)
    assert mean == pytest.approx(off.mean(0), rel=1e-3, abs=1e-6)
    # No worse than the best set without a new fit.
    best = np.full(40, np.inf)
    for kept in combinations(range(6), most):
        some = np.zeros_like(weights)
        some[:, kept] = weights[:, kept] + 1e-12
        some /= some.sum(1, keepdims=True)
        best = np.minimum(best, moves(positions, weights, some, matrices).max(0))
    assert (largest <= best + 1e-6).all()
    assert most == 1 or largest.sum() < 0.95 * best.sum()
    smallest_gone = np.where(weights >= np.sort(weights, axis=1)[:, [-most]], weights, 0)
    smallest_gone /= smallest_gone.sum(1, keepdims=True)
    assert off.max(0).sum() <= moves(positions, weights, smallest_gone, matrices).max(0).sum()


def test_many_influences_leave_one_by_one(random):
    positions = random.normal(size=(5, 3))
    weights = random.dirichlet(np.ones(40), 5)
    matrices = rigid(random, 30, 40, far=0.2)
    made, largest, _ = sinew.reduce_weights(weights, positions, matrices, max_influences=4)
    assert (np.count_nonzero(made, axis=1) <= 4).all()
    smallest_gone = np.where(weights >= np.sort(weights, axis=1)[:, [-4]], weights, 0)
    smallest_gone /= smallest_gone.sum(1, keepdims=True)
    assert largest.sum() < moves(positions, weights, smallest_gone, matrices).max(0).sum()


def test_few_weights_stay_to_the_bit(random):
    weights = np.array([[0.3, 0.2, 0, 0], [0, 0, 0, 0], [0.1, 0, 0, 0.7]], np.float32)
    made, largest, mean = sinew.reduce_weights(
        weights, random.normal(size=(3, 3)), rigid(random, 4, 4), max_influences=2
    )
    assert (made == weights).all() and (largest == 0).all() and (mean == 0).all()


def test_other_sums_stay(random):
    weights = 0.5 * random.dirichlet(np.ones(5), 9)
    made, _, _ = sinew.reduce_weights(weights, random.normal(size=(9, 3)), rigid(random, 4, 5), max_influences=2)
    assert made.sum(1) == pytest.approx(np.full(9, 0.5), abs=1e-6)


def test_rings_leave_no_seams(random):
    """Without them, a weight ends between two vertices; with them it fades, and what moves by it is told."""
    positions, offsets, faces = grid(40)
    weights = np.zeros((len(positions), 5))
    weights[:, :4] = 0.2 * soft(positions, 4) + 0.1 * random.random((len(positions), 1))
    weights[:, 4] = np.clip((30 - positions[:, 0]) / 60, 0.1, 1)
    weights /= weights.sum(1, keepdims=True)
    matrices = rigid(random, 5, 5, size=0.1, far=0.5)
    plain, _, _ = sinew.reduce_weights(weights, positions, matrices, max_influences=2)
    faded, largest, mean = sinew.reduce_weights(
        weights, positions, matrices, max_influences=2, rings=5, face_offsets=offsets, face_vertices=faces
    )
    a, b = edges(offsets, faces).T
    ends = (
        ((plain[a] > 0) != (plain[b] > 0)) & ((weights[a] > 0) & (weights[b] > 0)) & ((faded > 0).sum(1) > 1)[a, None]
    )
    assert ends.any()
    assert np.abs(faded[a] - faded[b])[ends].mean() < 0.7 * np.abs(plain[a] - plain[b])[ends].mean()
    assert ((faded > 0) <= (plain > 0)).all()
    assert faded.sum(1) == pytest.approx(np.ones(len(positions)), abs=1e-5)
    off = moves(positions, weights, faded, matrices)
    assert largest == pytest.approx(off.max(0), rel=1e-3, abs=1e-5)
    assert mean == pytest.approx(off.mean(0), rel=1e-3, abs=1e-5)


# Mirror


def halves(random, rows=(9, 9)):
    """Two sheets, left and right of x = 0, which touch there: (positions, offsets, faces, weights, pairs)."""
    left, offsets, faces = grid(10, rows[0])
    right, right_offsets, right_faces = grid(10, rows[1])
    left[:, 1] /= rows[0] - 1
    right[:, 1] /= rows[1] - 1
    left[:, 2] = right[:, 2] = 0
    positions = np.concatenate((left, right * (-1, 1, 1)))
    faces = np.concatenate((faces, right_faces + len(left)))
    positive = np.stack((np.clip(1 - left[:, 0] / 5, 0, 1), np.clip(left[:, 0] / 5, 0, 1), 0 * left[:, 0]), 1)
    positive /= positive.sum(1, keepdims=True)
    weights = np.concatenate((positive, random.dirichlet(np.ones(3), len(right))))
    return positions, np.arange(0, len(faces) + 1, 4), faces, weights, np.array([0, 2, 1]), len(left)


@pytest.mark.parametrize("rows", ((9, 9), (9, 14)), ids=("same vertices", "other vertices"))
@pytest.mark.parametrize("from_positive", (True, False))
def test_mirrored_weights_are_those_of_the_other_side(random, rows, from_positive):
    positions, offsets, faces, weights, pairs, half = halves(random, rows)
    if not from_positive:
        positions = positions * (-1, 1, 1)
    made = sinew.mirror_weights(weights, positions, offsets, faces, pairs, from_positive=from_positive)
    assert (made[:half][positions[:half, 0] != 0] == weights[:half][positions[:half, 0] != 0].astype(np.float32)).all()
    x = np.abs(positions[half:, 0])
    away = x > 0
    expected = np.stack((np.clip(1 - x / 5, 0, 1), 0 * x, np.clip(x / 5, 0, 1)), 1)
    expected /= expected.sum(1, keepdims=True)
    assert made[half:][away] == pytest.approx(expected[away], abs=1e-5)
    middle = made[half:][~away]
    assert middle[:, 1] == pytest.approx(middle[:, 2])


def test_mirror_elsewhere_and_masked(random):
    positions, offsets, faces, weights, pairs, half = halves(random)
    here = sinew.mirror_weights(weights, positions, offsets, faces, pairs)
    moved = np.roll(positions, 2, axis=1) + (0, 0, 7)
    assert np.ptp(moved[:, 1]) < 2
    there = sinew.mirror_weights(weights, moved, offsets, faces, pairs, axis=2, origin=7.0)
    assert there == pytest.approx(here, abs=1e-5)
    mask = np.arange(len(weights)) % 2 == 0
    some = sinew.mirror_weights(weights, positions, offsets, faces, pairs, mask=mask)
    assert (some[~mask] == weights[~mask].astype(np.float32)).all()
    assert (some[mask] == here[mask]).all()


def test_a_mesh_on_one_side_stays(random):
    positions, offsets, faces, weights = painted(random)
    made = sinew.mirror_weights(weights, positions + (1, 0, 0), offsets, faces, np.arange(5))
    assert (made == weights.astype(np.float32)).all()
    with pytest.raises(ValueError, match="no faces on the positive side of the mirror"):
        sinew.mirror_weights(weights, positions - (100, 0, 0), offsets, faces, np.arange(5))


# Transfer


def ball(rings=24, around=32, radius=1.0):
    """A tall ball of quads, open at the poles, whose faces look outward: (positions, offsets, faces)."""
    ring, k = np.divmod(np.arange(rings * around), around)
    height = np.pi * (ring + 1) / (rings + 1)
    angle = 2 * np.pi * k / around
    positions = np.stack((np.sin(height) * np.cos(angle), np.sin(height) * np.sin(angle), 2 * np.cos(height)), 1)
    faces = []
    for r in range(rings - 1):
        for i in range(around):
            a, b = r * around + i, r * around + (i + 1) % around
            faces.append((a, a + around, b + around, b))
    return radius * positions, np.arange(0, 4 * len(faces) + 1, 4), np.concatenate(faces)


def along(positions, bones=4):
    places = np.linspace(-2, 2, bones)
    weights = np.maximum(0, 1 - np.abs(positions[:, 2:] - places) / (1.5 * (places[1] - places[0]))) ** 2
    return weights / weights.sum(1, keepdims=True)


def check_transferred(weights, matched, vertices):
    assert weights.shape[0] == vertices and matched.shape == (vertices,)
    assert (weights.dtype, matched.dtype) == (np.float32, bool)
    assert weights.min() >= 0
    assert weights.sum(1) == pytest.approx(np.ones(vertices), abs=1e-5)


def test_the_same_mesh_gets_the_same_weights():
    source = ball()
    weights = along(source[0])
    made, matched = sinew.transfer_weights(*source, weights, *source)
    check_transferred(made, matched, len(weights))
    assert matched.all()
    assert made == pytest.approx(weights, abs=1e-5)


def test_a_denser_coat_gets_what_is_below():
    source, coat = ball(), ball(37, 50, 1.03)
    made, matched = sinew.transfer_weights(*source, along(source[0]), *coat)
    check_transferred(made, matched, len(coat[0]))
    assert matched.mean() > 0.95
    assert np.abs(made - along(coat[0])).max() < 0.08


def test_what_is_not_matched_is_smooth():
    """Part of the coat stands off and aside: its weights go on from the rest, better than those of closest points."""
    positions, offsets, faces = grid(60, 21)
    positions[:, 2] = 0
    weights = soft(positions, 4)
    bump = np.exp(-(((positions[:, :2] - (32, 10)) / 5) ** 2).sum(1))
    coat = positions + bump[:, None] * (7, 0, 9)
    made, matched = sinew.transfer_weights(positions, offsets, faces, weights, coat, offsets, faces, distance=0.02)
    check_transferred(made, matched, len(coat))
    assert 0.05 < 1 - matched.mean() < 0.6
    near, everywhere = sinew.transfer_weights(
        positions, offsets, faces, weights, coat, offsets, faces, distance=1.0, angle=180.0
    )
    assert everywhere.all()
    off = (bump > 0.1) & ~matched
    assert np.abs(made - weights)[off].mean() < 0.7 * np.abs(near - weights)[off].mean()


def filled_in(positions, faces, known, weights):
    """L M^-1 L w = 0 where weights are not known, with dense matrices."""
    count = len(positions)
    laplacian, areas = np.zeros((count, count)), np.zeros(count)
    for a, b, c, d in faces.reshape(-1, 4):
        for corners in ((a, b, c), (a, c, d)):
            for i in range(3):
                at, *ends = np.roll(corners, -i)
                sides = positions[ends] - positions[at]
                across = np.linalg.norm(np.cross(*sides))
                half = np.clip(np.dot(*sides) / across, 0.01, 20) / 2
                laplacian[ends, ends] += half
                laplacian[ends, ends[::-1]] -= half
                areas[at] += across / 6
    square = laplacian @ np.diag(1 / areas) @ laplacian
    numbers = weights.copy()
    numbers[~known] = np.linalg.solve(square[~known][:, ~known], -square[~known][:, known] @ weights[known])
    return numbers


def nearest_weights(numbers):
    """Those that are not negative and sum to 1: what is above a level that is the same for all."""
    low, high = numbers.min() - 1, numbers.max()
    for _ in range(100):
        level = (low + high) / 2
        low, high = (level, high) if np.maximum(numbers - level, 0).sum() > 1 else (low, level)
    return np.maximum(numbers - level, 0)


def test_what_is_filled_in_is_what_the_formula_says(random):
    """Of a sheet with obtuse, narrow and tiny triangles, over a body that ends below a part of it."""
    positions, offsets, faces = grid(14, 7)
    positions = positions * (1, 1, 0) + random.uniform(-0.45, 0.45, positions.shape) * (1, 1, 0)
    narrow = np.abs(positions[:, 0] - 9) < 1
    positions[narrow, 0] = 9 + 0.01 * (positions[narrow, 0] - 9)
    body, *body_faces = grid(5, 30)
    body = body * (1, 0.5, 0) - (0.5, 3, 0)
    turn, side = np.clip((body[:, 0] - 2) / 2, 0, 1), np.clip(body[:, 1] / 6, 0, 1)
    weights = np.stack((1 - turn, turn * (1 - side), turn * side), 1)
    made, matched = sinew.transfer_weights(
        body, *body_faces, weights, positions, offsets, faces, distance=1e-4, angle=180.0
    )
    assert 0.15 < matched.mean() < 0.5
    numbers = filled_in(positions, faces, matched, made.astype(float))
    assert numbers.min() < -0.05
    expected = np.array([nearest_weights(row) for row in numbers])
    assert made == pytest.approx(expected, abs=2e-4)


@pytest.mark.parametrize("scale, place", ((1e-3, 0), (1e4, 0), (1, 500)))
def test_units_and_places_do_not_matter(scale, place):
    source, coat = ball(), ball(30, 30, 1.12)
    weights = along(source[0])
    first, matched = sinew.transfer_weights(*source, weights, *coat, distance=0.03)
    assert 0 < matched.mean() < 1
    other, other_matched = sinew.transfer_weights(
        scale * source[0] + place, *source[1:], weights, scale * coat[0] + place, *coat[1:], distance=0.03
    )
    assert (matched != other_matched).mean() < 0.02
    assert np.abs(first - other).mean() < 2e-3


def test_normals_decide():
    source = ball()
    inside_out = (source[0], source[1], source[2].reshape(-1, 4)[:, ::-1].reshape(-1))
    weights = along(source[0])
    _, matched = sinew.transfer_weights(*source, weights, *inside_out)
    assert not matched.any()
    made, matched = sinew.transfer_weights(*source, weights, *inside_out, flipped=True)
    assert matched.all() and made == pytest.approx(weights, abs=1e-5)
    _, matched = sinew.transfer_weights(*source, weights, *inside_out, angle=180.0)
    assert matched.all()


def test_the_lining_of_a_tight_coat_is_matched():
    """Its faces look the other way than the body's."""
    source, outer, inner = ball(), ball(24, 32, 1.01), ball(24, 32, 1.004)
    count = len(outer[0])
    lining = inner[2].reshape(-1, 4)[:, ::-1] + count
    rim = [(i, i + count, (i + 1) % 32 + count, (i + 1) % 32) for i in range(32)]
    faces = np.concatenate((outer[2].reshape(-1, 4), lining, rim))
    coat = np.concatenate((outer[0], inner[0])), np.arange(0, 4 * len(faces) + 1, 4), faces.reshape(-1)
    made, matched = sinew.transfer_weights(*source, along(source[0]), *coat)
    assert matched.all()
    assert np.abs(made - along(coat[0])).max() < 0.02
    loose = np.concatenate((1.1 * outer[0], inner[0])), *coat[1:]
    assert sinew.transfer_weights(*source, along(source[0]), *loose, distance=0.03)[1][count:].mean() < 0.1


def test_a_tight_coat_that_is_blunter_than_the_body_is_matched():
    """Over the edges of a ridge it is flat, as the ridge's top is near by; the closest points are on the slopes."""

    def roof(places, half):
        down = 0.84 * np.maximum(np.abs(places[:, 0] - 15) - half, 0)
        return places * (1, 1, 0) - down[:, None] * (0, 0, 1)

    positions, offsets, faces = grid(31, 31)
    fine, fine_offsets, fine_faces = grid(121, 121)
    source, coat = roof(positions, 1), roof(fine / 4, 1.5) + (0, 0, 0.15)
    weights = np.stack((positions[:, 0], 30 - positions[:, 0]), 1) / 30
    made, matched = sinew.transfer_weights(source, offsets, faces, weights, coat, fine_offsets, fine_faces)
    assert matched.all()
    assert np.abs(made[:, 0] - coat[:, 0] / 30).max() < 0.02


def test_lips_that_touch_are_told_apart():
    """In the middle, the lower lip of the target is closer to the upper lip of the source."""
    positions, offsets, faces = grid(30, 30)
    lower, upper = positions * (1, 1, 0), positions * (1, 1, 0) + (0, 0, 0.3)
    turned = faces.reshape(-1, 4)[:, ::-1].reshape(-1)
    lips = np.concatenate((lower, upper)), np.arange(0, 8 * len(turned) // 4 + 1, 4)
    count = len(positions)
    sides = np.repeat(np.eye(2), count, axis=0)
    up = np.cross(lower[faces[1]] - lower[faces[0]], lower[faces[2]] - lower[faces[0]])[2] > 0
    own, other = (faces, turned) if up else (turned, faces)
    bulge = np.exp(-(((positions[:, :2] - 15) / 5) ** 2).sum(1))
    target = lower + bulge[:, None] * (0, 0, 0.18)
    assert (target[:, 2] > 0.15).sum() > 5
    made, matched = sinew.transfer_weights(*lips, np.concatenate((own, other + count)), sides, target, offsets, own)
    assert not matched[target[:, 2] > 0.15].any()
    assert made[:, 0].min() > 0.999


def test_islands_without_a_match_are_rigid():
    """A button on the coat follows the coat, a ball far from it the source; each is rigid. The coat stays as it is."""
    source, coat = ball(), ball(30, 30, 1.02)
    weights = along(source[0])
    button = ball(6, 8, 0.05)
    positions = np.concatenate((coat[0], button[0] + (1.5, 0, 0.4)))
    faces = np.concatenate((coat[2], button[2] + len(coat[0])))
    offsets = np.arange(0, len(faces) + 1, 4)
    alone, _ = sinew.transfer_weights(*source, weights, *coat)
    made, matched = sinew.transfer_weights(*source, weights, positions, offsets, faces)
    check_transferred(made, matched, len(positions))
    own = made[len(coat[0]) :]
    assert (own == own[0]).all() and not matched[len(coat[0]) :].any()
    assert own[0] == pytest.approx(along(np.array([[1, 0, 0.4]]))[0], abs=0.1)
    assert made[: len(coat[0])] == pytest.approx(alone, abs=1e-4)
    far, matched = sinew.transfer_weights(*source, weights, button[0] + (50, 0, 0.4), *button[1:])
    check_transferred(far, matched, len(button[0]))
    assert not matched.any() and (far == far[0]).all()


def test_without_faces_every_vertex_is_matched_by_distance():
    source = ball()
    weights = along(source[0])
    made, matched = sinew.transfer_weights(*source, weights, 1.001 * source[0], NONE, NONE)
    check_transferred(made, matched, len(weights))
    assert matched.all() and np.abs(made - weights).max() < 0.05
    one, matched = sinew.transfer_weights(*source, weights, np.array([[3.0, 0, 0]]), NONE, NONE)
    check_transferred(one, matched, 1)
    assert sinew.transfer_weights(*source, weights, np.zeros((0, 3)), NONE, NONE)[0].shape == (0, 4)


def test_unpainted_parts_of_the_source_match_nothing():
    source, coat = ball(), ball(30, 30, 1.01)
    weights = along(source[0])
    weights[source[0][:, 2] > 1] = 0
    made, matched = sinew.transfer_weights(*source, weights, *coat)
    check_transferred(made, matched, len(coat[0]))
    assert not matched[coat[0][:, 2] > 1.3].any() and matched[coat[0][:, 2] < 0.8].all()


def test_a_target_full_of_flaws(random):
    source = ball()
    positions, offsets, faces = ball(30, 30, 1.2)
    faces = faces.copy()
    faces[4:8] = faces[4]  # one vertex
    faces[8:12] = [faces[8], faces[9], faces[8], faces[9]]  # no area
    positions[faces[20]] = positions[faces[21]]  # an edge of no length
    made, matched = sinew.transfer_weights(*source, along(source[0]), positions, offsets, faces, distance=0.045)
    check_transferred(made, matched, len(positions))
    made, matched = sinew.transfer_weights(
        *source, along(source[0]), random.normal(size=positions.shape), offsets, faces, distance=0.02
    )
    check_transferred(made, matched, len(positions))


# All


def test_threads_give_the_same_bits(random):
    source, coat = ball(50, 60), ball(50, 70, 1.15)
    weights = along(source[0])
    positions, offsets, faces, painted_weights = painted(random, 200)
    matrices = rigid(random, 6, 5)

    def everything():
        return (
            *sinew.transfer_weights(*source, weights, *coat, distance=0.045),
            sinew.smooth_weights(painted_weights, offsets, faces, steps=4),
            sinew.smooth_weights(painted_weights, offsets, faces, strength=9.0),
            *sinew.reduce_weights(painted_weights, positions, matrices, max_influences=2),
            sinew.mirror_weights(painted_weights, positions - (90, 0, 0), offsets, faces, np.array([1, 0, 2, 4, 3])),
        )

    results = []
    for threads in (1, 2, 0):
        sinew.set_thread_count(threads)
        results.append([array.tobytes() for array in everything()])
    assert results[0] == results[1] == results[2]


def mistakes():
    positions, offsets, faces = grid(4, 3)
    weights = soft(positions, 2)
    spoilt, negative, bad = weights.copy(), weights.copy(), positions.copy()
    spoilt[3, 1] = np.nan
    negative[5, 0] = -1
    bad[7, 1] = np.inf
    eyes = np.tile(np.eye(4), (3, 2, 1, 1))
    broken = eyes.copy()
    broken[1, 0, 0, 0] = np.nan
    pairs = np.array([1, 0])
    surface = (positions, offsets, faces)

    def case(message, function, *arguments, **options):
        return pytest.param(function, arguments, options, message, id=f"{function.__name__}: {message[:40]}")

    smooth, reduce = sinew.smooth_weights, sinew.reduce_weights
    mirror, transfer = sinew.mirror_weights, sinew.transfer_weights
    yield case("weights is nan at vertex 3, bone 1", smooth, spoilt, offsets, faces)
    yield case("weights is -1 at vertex 5, bone 0", smooth, negative, offsets, faces)
    yield case(r"weights has shape \(24,\); expected \(V, B\)", smooth, weights.reshape(-1), offsets, faces)
    yield case("weights has no columns", smooth, weights[:, :0], offsets, faces)
    yield case("face_vertices names vertex 9; the mesh has 9 vertices", smooth, weights[:9], offsets, faces)
    yield case("mask has 3 numbers", smooth, weights, offsets, faces, mask=np.ones(3))
    yield case("mask is 2 at vertex 0", smooth, weights, offsets, faces, mask=np.full(12, 2.0))
    yield case("locked names bone 2; there are 2 bones", smooth, weights, offsets, faces, locked=np.array([2]))
    yield case("steps is -1; expected 0 to 10,000", smooth, weights, offsets, faces, steps=-1)
    yield case("factor is 1.5; expected 0 to 1", smooth, weights, offsets, faces, factor=1.5)
    yield case("strength is nan", smooth, weights, offsets, faces, strength=float("nan"))
    yield case("positions is not finite at vertex 7", smooth, weights, offsets, faces, positions=bad)
    yield case("positions has 11 vertices; the weights are those of 12", reduce, weights, positions[:11], eyes)
    yield case("matrices has 1 joint, weights 2 columns", reduce, weights, positions, eyes[:, :1])
    yield case("matrices has no poses", reduce, weights, positions, eyes[:0])
    yield case("matrices is not finite in pose 1 at joint 0", reduce, weights, positions, broken)
    yield case("max_influences is 0; expected 1 to 64", reduce, weights, positions, eyes, max_influences=0)
    yield case("rings is 3, and there are no faces", reduce, weights, positions, eyes, rings=3)
    yield case("rings is -1; expected 0 to 64", reduce, weights, positions, eyes, rings=-1)
    yield case("pairs has 1 number, weights 2 columns", mirror, weights, *surface, pairs[:1])
    yield case("bone 0 has the pair 5; expected 0 to 1", mirror, weights, *surface, np.array([5, 0]))
    yield case("bone 1 has the pair 0, which has the pair 0", mirror, weights, *surface, np.array([0, 0]))
    yield case("axis is 3; expected 0 to 2", mirror, weights, *surface, pairs, axis=3)
    yield case("origin is nan", mirror, weights, *surface, pairs, origin=float("nan"))
    yield case("the source has no faces", transfer, positions, NONE, NONE, weights, *surface)
    yield case("the source has no weight above 0", transfer, *surface, 0 * weights, *surface)
    yield case("source_positions has 12 vertices; the weights", transfer, *surface, weights[:5], *surface)
    yield case("source_positions is not finite at vertex 7", transfer, bad, offsets, faces, weights, *surface)
    yield case("positions is not finite at vertex 7", transfer, *surface, weights, bad, offsets, faces)
    yield case(
        "face_vertices names vertex 8; the mesh has 8", transfer, *surface, weights, positions[:8], offsets, faces
    )
    yield case("distance is 0; expected a number above 0", transfer, *surface, weights, *surface, distance=0.0)
    yield case("angle is 200; expected 0 to 180", transfer, *surface, weights, *surface, angle=200.0)


@pytest.mark.parametrize("function, arguments, options, message", mistakes())
def test_mistakes_are_explained(function, arguments, options, message):
    with pytest.raises(ValueError, match=message):
        function(*arguments, **options)


# Tables without what is 0


def tools(positions, offsets, faces):
    """What each tool does with weights of 5 bones: functions of weights and options."""
    matrices = rigid(np.random.default_rng(3), 4, 5)
    pairs = np.array([1, 0, 2, 4, 3])
    surface = (positions - (5, 0, 0), offsets, faces)
    return {
        "smooth": lambda weights, **own: (sinew.smooth_weights(weights, offsets, faces, **own),),
        "solve": lambda weights, **own: (sinew.smooth_weights(weights, offsets, faces, strength=2.0, **own),),
        "reduce": lambda weights, **own: sinew.reduce_weights(weights, positions, matrices, max_influences=2, **own),
        "fade": lambda weights, **own: sinew.reduce_weights(
            weights, positions, matrices, max_influences=2, rings=2, face_offsets=offsets, face_vertices=faces, **own
        ),
        "mirror": lambda weights, **own: (sinew.mirror_weights(weights, *surface, pairs, **own),),
        "transfer": lambda weights, **own: sinew.transfer_weights(*surface, weights, *surface, distance=0.01, **own),
    }


TOOLS = ("smooth", "solve", "reduce", "fade", "mirror", "transfer")


@pytest.mark.parametrize("name", TOOLS)
def test_tables_and_arrays_give_the_same(random, name):
    positions, offsets, faces, weights = painted(random)
    weights[weights < 0.1] = 0
    weights[:, 2] += 0.01
    run = tools(positions, offsets, faces)[name]
    dense, *others = run(weights)
    table, *other_others = run(sinew.WeightTable.from_dense(weights))
    assert isinstance(table, sinew.WeightTable) and np.array_equal(table.dense(), dense)
    assert all(np.array_equal(a, b) for a, b in zip(others, other_others))
    assert (table.vertex_count, table.bone_count) == weights.shape
    rows = np.split(np.asarray(table.bones), table.offsets[1:-1])
    assert all((np.diff(row) > 0).all() for row in rows) and (np.asarray(table.weights) > 0).all()


def test_a_table_from_lists_adds_what_is_named_twice():
    table = sinew.WeightTable(np.array([0, 3, 3]), np.array([2, 0, 2]), np.array([0.25, 0, 0.5]), 3)
    assert table.dense().tolist() == [[0, 0, 0.75], [0, 0, 0]]
    for change, message in (
        ({"offsets": np.array([0, 4, 3])}, r"offsets\[2\] is 3, below the one before"),
        ({"offsets": np.array([0, 3, 4])}, "offsets goes from 0 to 4; expected 0 to 3"),
        ({"bones": np.array([0, 1, 3])}, "bones names bone 3 at vertex 0; there are 3 bones"),
        ({"bones": np.array([0, 1])}, "bones has 2 numbers, weights 3"),
        ({"weights": np.array([0, -1, 0])}, "weights is -1 at vertex 0, bone 1; expected 0 or more"),
        ({"bone_count": 0}, "bone_count is 0; expected 1 to 16,777,216"),
    ):
        own = {"offsets": np.array([0, 3, 3]), "bones": np.arange(3), "weights": np.ones(3), "bone_count": 3}
        with pytest.raises(ValueError, match=message):
            sinew.WeightTable(**(own | change))


@pytest.mark.parametrize("name", TOOLS)
def test_tools_count_their_progress_and_are_cancelled(random, name):
    positions, offsets, faces, weights = painted(random, 60)
    run = tools(positions, offsets, faces)[name]
    progress = sinew.Progress()
    assert run(weights, progress=progress)[0] is not None and progress.fraction == 1
    progress.cancel()
    assert run(weights, progress=progress) in (None, (None,))


@pytest.mark.parametrize("name", ("smooth", "solve", "reduce", "fade", "mirror"))
def test_extreme_weights_stay_finite(random, name):
    positions, offsets, faces, weights = painted(random)
    weights[:40] *= 3e38
    weights[40:60] *= 1e-40
    made = tools(positions, offsets, faces)[name](weights)[0]
    assert np.isfinite(made).all() and made.min() >= 0


def test_very_many_influences_leave_about_as_well_as_one_by_one(random):
    """All but 24 leave at once, by how far they can move the vertex."""
    positions, weights = random.normal(size=(6, 3)), random.dirichlet(np.full(60, 0.3), 6)
    matrices = rigid(random, 5, 60)
    made, largest, _ = sinew.reduce_weights(weights, positions, matrices, max_influences=4)
    assert (np.count_nonzero(made, axis=1) <= 4).all()
    smallest_dropped = np.where(weights >= np.sort(weights)[:, -4:-3], weights, 0)
    smallest_dropped /= smallest_dropped.sum(1, keepdims=True)
    points = np.concatenate((positions, np.ones((6, 1))), 1)
    off = np.einsum("vj,fjab,vb->fva", smallest_dropped - weights, matrices, points)[..., :3]
    assert (largest < np.linalg.norm(off, axis=2).max(axis=0)).mean() > 0.6


def test_locked_weights_stay_and_count(random):
    positions, _, _, weights = painted(random)
    made, _, _ = sinew.reduce_weights(
        weights, positions, rigid(random, 4, 5), max_influences=3, locked=np.array([1, 4])
    )
    assert np.array_equal(made[:, [1, 4]], weights[:, [1, 4]].astype(np.float32))
    assert (np.count_nonzero(made, axis=1) == 3).all()
    assert made.sum(1) == pytest.approx(weights.sum(1), abs=1e-6)


def test_faces_across_the_mirror_take_nothing_from_the_other_side(random):
    """A strip without vertices in the middle: what is on the side that is overwritten must not matter."""
    positions, offsets, faces = grid(7, 3)
    positions = positions - (3.5, 0, 0) + (0, 0.1, 0) * np.sin(7 * positions)
    weights = random.dirichlet(np.ones(4), len(positions))
    other = weights.copy()
    other[positions[:, 0] < 0] = random.dirichlet(np.ones(4), (positions[:, 0] < 0).sum())
    made = [sinew.mirror_weights(own, positions, offsets, faces, np.array([1, 0, 2, 3])) for own in (weights, other)]
    assert np.array_equal(*made)
    assert made[0].sum(1) == pytest.approx(np.ones(len(positions)), abs=1e-6)


FOLDED = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 0, 0], [0, 1, 0], [3, 0, 0], [4, 0, 0], [3, 0, 0]], float)


@pytest.mark.parametrize("width", (0, 1e-30, 1e-12))
def test_folded_faces_get_the_same_weights_each_time(width):
    positions, offsets, faces = grid(3, 3)
    target = FOLDED + width * np.arange(8)[:, None] * (0, 1, 0)
    corners = np.array([0, 1, 2, 3, 2, 5, 6, 7])
    results = set()
    for _ in range(50):
        made, matched = sinew.transfer_weights(
            positions * (0.4, 0.4, 0),
            offsets,
            faces,
            soft(positions, 3),
            target,
            np.array([0, 4, 8]),
            corners,
            distance=0.05,
        )
        check_transferred(made, matched, 8)
        results.add(made.tobytes())
    assert len(results) == 1


def test_points_without_weights_are_not_followed():
    """The island's nearest points have no weights: it follows the nearest that have."""
    source = ball()
    weights = along(source[0])
    weights[source[0][:, 2] > -1] = 0
    button = ball(6, 8, 0.05)
    made, matched = sinew.transfer_weights(*source, weights, button[0] + (0, 0, 3), *button[1:])
    check_transferred(made, matched, len(button[0]))
    assert not matched.any() and made[0, 0] > 0 and not made[0, 3]


def test_a_polygon_of_thousands_of_corners_is_filled_in():
    positions, offsets, faces = grid(11, 11)
    positions = (positions - 5) * (0.3, 0.3, 0)
    angle = np.linspace(0, 2 * np.pi, 4000, endpoint=False)
    disc = np.stack((np.cos(angle), np.sin(angle), np.where(np.sin(angle) > 0.5, 0.5, 0)), 1)
    weights = soft(positions, 3)
    made, matched = sinew.transfer_weights(
        positions, offsets, faces, weights, disc, np.array([0, 4000]), np.arange(4000), distance=0.05, angle=180.0
    )
    check_transferred(made, matched, 4000)
    assert 0.2 < matched.mean() < 0.9
