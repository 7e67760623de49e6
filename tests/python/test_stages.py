"""Topology, CorrectiveSmooth, Smooth, Hook, Stage, and a Deformer that runs them."""

import gc
import threading

import numpy as np
import pytest
import sinew_native as sinew

import rigs
from test_skeleton import said

ROWS, COLUMNS = 40, 50
V = ROWS * COLUMNS


def grid():
    """(edges, face offsets, corners) of a sheet of quads."""
    at = np.arange(V, dtype=np.int32).reshape(ROWS, COLUMNS)
    along = np.stack([at[:, :-1], at[:, 1:]], -1).reshape(-1, 2)
    across = np.stack([at[:-1], at[1:]], -1).reshape(-1, 2)
    faces = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], -1).reshape(-1)
    return np.concatenate([along, across]), np.arange(0, len(faces) + 1, 4), faces


@pytest.fixture(scope="module")
def topology():
    edges, offsets, corners = grid()
    return sinew.Topology(V, edges, offsets, corners)


@pytest.fixture
def random():
    return np.random.default_rng(22)


@pytest.fixture
def shape(random):
    return random.uniform(-1, 1, (V, 3)).astype(np.float32)


def smoothed(shape, weights, factor, iterations):
    """Blender's simple smoothing, edge by edge."""
    edges = grid()[0]
    counts = np.bincount(edges.ravel(), minlength=V)[:, None]
    x = shape.astype(np.float64)
    for _ in range(iterations):
        sums, sides = np.zeros_like(x), x[edges[:, 1]] - x[edges[:, 0]]
        np.add.at(sums, edges[:, 0], sides)
        np.add.at(sums, edges[:, 1], -sides)
        x += sums * factor * weights[:, None] / counts
    return x


def applied(stage, shape):
    out = shape.copy()
    assert stage.apply(out) is None
    return out


def test_topology(topology):
    edges = (ROWS - 1) * COLUMNS + ROWS * (COLUMNS - 1)
    assert (topology.vertex_count, topology.edge_count) == (V, edges)
    assert topology.corner_count == 4 * (ROWS - 1) * (COLUMNS - 1)
    assert sinew.Topology(3, np.array([[0, 1]])).corner_count == 0


def test_corrective_smooth(random, topology, shape):
    weights = random.random(V).astype(np.float32)
    for group, effective in (
        ({}, np.ones(V)),
        ({"weights": weights}, weights),
        ({"weights": weights.astype(float), "invert": True}, 1 - weights),
    ):
        smooth = sinew.CorrectiveSmooth(topology, **group)
        assert smooth.vertex_count == V
        only = applied(smooth.stage(0.3, 4, only_smooth=True), shape)
        assert np.abs(only - smoothed(shape, effective, 0.3, 4)).max() < 2e-6
    keeps = sinew.CorrectiveSmooth(topology, shape)
    for smooth_type in ("simple", "length_weighted"):
        stage = keeps.stage(factor=0.5, iterations=5, scale=1, smooth_type=smooth_type)
        assert np.abs(applied(stage, shape) - shape).max() < 2e-5
        turned = shape[:, [1, 2, 0]].copy()
        assert np.abs(applied(stage, turned) - turned).max() < 2e-5
    none = keeps.stage(scale=0)
    assert (applied(none, shape) == applied(keeps.stage(only_smooth=True), shape)).all()
    keeps.set_rest_positions(shape[::-1])
    assert np.abs(applied(keeps.stage(), shape) - shape).max() > 0.1


def test_corrective_smooth_pins_the_boundary(topology, shape):
    pinned = applied(sinew.CorrectiveSmooth(topology, pin_boundary=True).stage(only_smooth=True), shape)
    stays = (pinned == shape).all(axis=1).reshape(ROWS, COLUMNS)
    inside = np.zeros((ROWS, COLUMNS), bool)
    inside[1:-1, 1:-1] = True
    assert (stays == ~inside).all()


def test_smooth(topology, shape):
    edges = grid()[0]
    sums, counts = np.zeros((V, 3)), np.bincount(edges.ravel(), minlength=V)[:, None]
    for end in (0, 1):
        np.add.at(sums, edges[:, end], (shape[edges[:, 0]] + shape[edges[:, 1]]) / 2)
    expected = 0.7 * shape + 0.3 * sums / counts
    smooth = sinew.Smooth(topology)
    assert smooth.vertex_count == V
    assert np.abs(applied(smooth.stage(0.3), shape) - expected).max() < 1e-6
    along = applied(smooth.stage(0.3, use_x=False, use_z=False), shape)
    assert np.abs(along[:, 1] - expected[:, 1]).max() < 1e-6
    assert (along[:, [0, 2]] == shape[:, [0, 2]]).all()
    half = np.arange(V) % 2
    own = applied(sinew.Smooth(topology, half, invert=True).stage(0.3), shape)
    assert np.abs(own - np.where(half[:, None], shape, expected)).max() < 1e-6


def test_hook(random, shape):
    matrix = rigs.random_matrices(random, 1)[0]
    there = shape @ matrix[:3, :3].T + matrix[:3, 3]
    weights = random.random(V)
    hook = sinew.Hook(V, weights=weights)
    assert hook.vertex_count == V
    expected = shape + 0.5 * weights[:, None] * (there - shape)
    assert np.abs(applied(hook.stage(matrix, 0.5), shape) - expected).max() < 2e-6
    named = np.array([3, 5])
    center, scale = np.array([0.1, 0.2, 0.3]), np.diag([1, 2, 3])
    stage = sinew.Hook(V, named).stage(matrix, 0.5, "linear", 2.5, center, scale)
    own = applied(stage, shape)
    distance = np.linalg.norm((shape - center) @ scale.T, axis=1)
    part = 0.5 * np.clip(1 - distance / 2.5, 0, 1)[:, None]
    expected = shape.copy()
    expected[named] += (part * (there - shape))[named]
    assert np.abs(own - expected).max() < 2e-6
    assert (applied(sinew.Hook(V).stage(matrix), shape) == shape).all()


def test_a_whole_chain(random, topology):
    skin, positions, _ = rigs.dense_skin(random, V, 4)
    keys = sinew.ShapeKeys([positions, positions[::-1]], [0, 0])
    matrices = rigs.random_matrices(random, 4).astype(np.float32)
    stages = [sinew.CorrectiveSmooth(topology, positions).stage(), sinew.Smooth(topology).stage(iterations=2)]
    out, times = np.empty((V, 3), np.float32), np.full(3, -1.0)
    chain = sinew.Deformer([sinew.Layer(skin, "linear")], keys)
    values = np.array([0, 0.3], np.float32)
    chain.deform([(matrices, None)], out, values, stages=stages, milliseconds=times)
    expected = np.empty_like(out)
    chain.deform([(matrices, None)], expected, values)
    before = expected.copy()
    for stage in stages:
        stage.apply(expected)
    assert (out == expected).all() and (out != before).any()
    assert (times >= 0).all()
    alone = sinew.Deformer(vertex_count=V)
    alone.deform([], out, rest_positions=before, stages=stages)
    assert (out == expected).all()


def test_a_stage_keeps_what_it_needs(shape):
    edges, offsets, corners = grid()
    stage = sinew.CorrectiveSmooth(sinew.Topology(V, edges, offsets, corners), shape).stage()
    expected = applied(stage, shape)
    gc.collect()
    assert (applied(stage, shape) == expected).all()


def test_several_threads_may_use_one(topology, shape):
    smooth = sinew.CorrectiveSmooth(topology, shape[::-1])
    expected = [applied(smooth.stage(factor), shape) for factor in (0.2, 0.5, 0.8)]
    wrong = []

    def work(i):
        for frame in range(20):
            k = (i + frame) % 3
            if not (applied(smooth.stage((0.2, 0.5, 0.8)[k]), shape) == expected[k]).all():
                wrong.append((i, frame))

    threads = [threading.Thread(target=work, args=(i,)) for i in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


def test_what_has_nothing():
    nothing = np.zeros((0, 3), np.float32)
    empty = sinew.Topology(0, np.zeros((0, 2), int))
    for stage in (
        sinew.Smooth(empty).stage(),
        sinew.CorrectiveSmooth(empty, nothing).stage(),
        sinew.Hook(0).stage(np.eye(4)),
    ):
        stage.apply(nothing)
    loose = sinew.Topology(2, np.zeros((0, 2), int))
    shape = np.ones((2, 3), np.float32)
    assert (applied(sinew.CorrectiveSmooth(loose, shape).stage(), shape) == shape).all()


@pytest.mark.parametrize("iterations", (0, -3))
def test_no_iterations(topology, shape, iterations):
    for smooth in (sinew.Smooth(topology), sinew.CorrectiveSmooth(topology, shape[::-1])):
        assert (applied(smooth.stage(iterations=iterations), shape) == shape).all()


def test_refuses_what_it_is_made_of(topology):
    edges, face, corners = np.array([[0, 1], [1, 2], [2, 0]]), np.array([0, 3]), np.array([0, 1, 2])
    assert said(sinew.Topology, 3, edges.ravel()) == "edges has shape (6,); expected (E, 2)"
    assert said(sinew.Topology, 3, edges + 0.5) == "edges is float64; expected integers"
    assert said(sinew.Topology, 2, edges) == "edges names vertex 2; the mesh has 2 vertices"
    assert (
        said(sinew.Topology, 3, edges, face, corners + 3) == "corner_vertices names vertex 3; the mesh has 3 vertices"
    )
    assert (
        said(sinew.Topology, 3, edges, corner_vertices=corners)
        == "face_offsets is empty; expected one number more than there are rows"
    )
    assert (
        said(sinew.Topology, 3, edges[:2], face, corners)
        == "face 0 has a side from vertex 2 to vertex 0, which is not one of the edges"
    )
    for kind in (sinew.Smooth, sinew.CorrectiveSmooth):
        assert said(kind, topology, weights=np.ones(3)) == "weights has 3 numbers; the mesh has 2,000 vertices"
        assert said(kind, topology, weights=np.full(V, np.nan)) == "weights is not finite at vertex 0"
    assert (
        said(sinew.CorrectiveSmooth, topology, np.zeros((3, 3)))
        == "rest_positions has shape (3, 3); expected (2000, 3)"
    )
    assert (
        said(sinew.CorrectiveSmooth, topology, np.zeros((0, 3)))
        == "rest_positions has shape (0, 3); expected (2000, 3)"
    )
    assert said(sinew.CorrectiveSmooth, topology, np.full((V, 3), np.inf)) == "rest_positions is not finite at vertex 0"
    assert (
        said(sinew.CorrectiveSmooth, topology, corner_angle="exact")
        == 'there is no corner_angle "exact"; expected polynomial or arc_cosine'
    )
    assert said(sinew.Hook, 3, face) == "vertices names vertex 3; the mesh has 3 vertices"
    assert said(sinew.Hook, 3, weights=np.ones(1)) == "weights has 1 number; the mesh has 3 vertices"


def test_refuses_settings(topology, shape):
    smooth = sinew.CorrectiveSmooth(topology, shape)
    assert said(smooth.stage, float("nan")) == "factor is nan; expected a finite number"
    assert said(smooth.stage, scale=float("inf")) == "scale is inf; expected a finite number"
    assert (
        said(smooth.stage, smooth_type="SIMPLE")
        == 'there is no smooth_type "SIMPLE"; expected simple or length_weighted'
    )
    assert said(sinew.CorrectiveSmooth(topology).stage) == "there are no rest positions; pass some, or only_smooth"
    assert said(smooth.set_rest_positions, shape[:3]) == "rest_positions has 9 numbers; expected 6,000 (2000 x 3)"
    assert said(sinew.Smooth(topology).stage, float("nan")) == "factor is nan; expected a finite number"
    hook = sinew.Hook(V)
    assert said(hook.stage, np.eye(3)) == "matrix has shape (3, 3); expected (4, 4)"
    assert said(hook.stage, np.full((4, 4), np.nan)) == "matrix is not finite"
    assert (
        said(hook.stage, np.eye(4), falloff="curve")
        == 'there is no falloff "curve"; expected one of none, constant, linear, smooth, sharp, root, sphere, '
        "inverse_square"
    )
    assert said(hook.stage, np.eye(4), uniform=np.eye(4)) == "uniform has shape (4, 4); expected (3, 3)"


# --- what follows another object's shape ------------------------------------------------------------

GRID = {"counts": (2, 1, 3), "first": (0, 0, 0), "step": (1, 0, 2), "interpolation": ("linear",) * 3}


def test_a_lattice_moves_what_is_between_its_points(shape, random):
    rest = np.array([(u, 0, 2 * w) for w in range(3) for u in range(2)], float)
    points = rest + random.uniform(-1, 1, (6, 3))
    stage = sinew.Lattice(V).stage(points, **GRID, matrix=np.eye(4), strength=0.5)
    u, w = np.clip(shape[:, :1], 0, 1), np.clip(shape[:, 2:] / 2, 0, 2)
    moved = (points - rest).reshape(3, 2, 3)[:2]  # all of the shape is below the second row
    rows = moved[:, 0] + u[:, None] * (moved[:, 1] - moved[:, 0])
    expected = shape + 0.5 * (rows[:, 0] + w * (rows[:, 1] - rows[:, 0]))
    np.testing.assert_allclose(applied(stage, shape), expected, atol=1e-6)


def test_a_lattice_with_groups(shape, random):
    """Its own weighs the effect once more."""
    points, half = random.uniform(-1, 1, (6, 3)), np.full(6, 0.5)
    weights = random.uniform(0, 1, V)
    lattice = sinew.Lattice(V, weights, True)
    whole = applied(sinew.Lattice(V).stage(points, **GRID, matrix=np.eye(4)), shape) - shape
    own = applied(lattice.stage(points, **GRID, matrix=np.eye(4), point_weights=half), shape)
    assert lattice.vertex_count == V
    np.testing.assert_allclose(own, shape + 0.5 * (1 - weights[:, None]) ** 2 * whole, atol=1e-6)


def test_refuses_lattices():
    points, matrix = np.zeros((6, 3)), np.eye(4)
    lattice = sinew.Lattice(3)
    assert said(sinew.Lattice, 3, np.ones(2)) == "weights has 2 numbers; the mesh has 3 vertices"
    assert said(lattice.stage, points[:5], **GRID, matrix=matrix) == "points has 15 numbers; expected 18 (6 x 3)"
    assert said(lattice.stage, points, **GRID, matrix=np.eye(3)) == "matrix has shape (3, 3); expected (4, 4)"
    assert said(lattice.stage, points, **GRID, matrix=0 * matrix) == "the matrix has no inverse"
    assert said(lattice.stage, points, **GRID, matrix=matrix, strength=np.nan) == (
        "strength is nan; expected a finite number"
    )
    assert said(lattice.stage, points, **GRID, matrix=matrix, point_weights=np.ones(2)) == (
        "weights has 2 numbers; the lattice has 6 vertices"
    )
    assert said(lattice.stage, points, **GRID | {"interpolation": ("cubic",) * 3}, matrix=matrix) == (
        'there is no interpolation "cubic"; expected linear, cardinal, catmull_rom or bspline'
    )


def attached(vertices, attachments, **more):
    """What SurfaceDeform takes: attachments of each vertex, [(kind, corners, weights, distance, influence)]."""
    flat = [each for own in attachments for each in own]
    kinds, corners, weights, distances, influences = zip(*flat)
    counts, sizes = [len(own) for own in attachments], [len(each) for each in corners]
    return sinew.SurfaceDeform(
        V,
        np.array(vertices),
        np.cumsum([0, *counts]),
        np.array(kinds),
        np.cumsum([0, *sizes]),
        np.concatenate(corners),
        np.concatenate(weights),
        np.array(distances),
        np.array(influences),
        **more,
    )


SQUARE = np.array([(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)], float)
MATRIX = np.array([(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 5), (0, 0, 0, 1)], float)


@pytest.mark.parametrize(
    "attachment, place",
    [
        ((0, [0, 1, 2, 3], [0.5, 0.25, 0.25], 1, 1), (1, 0.5, 6)),
        ((1, [0, 1, 2, 3], [0.1, 0.2, 0.3, 0.4], -1, 1), (1, 1.4, 4)),
        ((2, [1, 2, 3, 0], [0.5, 0.25, 0.25], 0.5, 1), (1.75, 0.75, 5.5)),
        ((1, [3, 2, 1, 0], [1, 0, 0, 0], 1, 0.5), (0, 1, 2)),
    ],
    ids=("corner triangle", "polygon", "centroid", "half, from below"),
)
def test_a_surface_takes_what_is_attached_to_it_along(shape, attachment, place):
    own = attached([3], [[attachment]])
    out = applied(own.stage(SQUARE, MATRIX), shape)
    np.testing.assert_allclose(out[3], place, atol=1e-6)
    np.testing.assert_array_equal(np.delete(out, 3, 0), np.delete(shape, 3, 0))
    half = applied(own.stage(SQUARE, MATRIX, 0.5), shape)
    np.testing.assert_allclose(half[3], (shape[3] + place) / 2, atol=1e-6)
    assert (own.vertex_count, own.least_target_count) == (V, 4)


def test_a_surface_with_a_group(shape):
    weights = np.zeros(V)
    weights[3] = 0.25
    attachment = [(1, [0, 1, 2], [0, 1, 0], 0, 1)]
    for own, share in ((attached([3], [attachment], weights=weights), 0.25),
                       (attached([3], [attachment], weights=weights, invert=True), 0.75)):  # fmt: skip
        out = applied(own.stage(SQUARE, np.eye(4)), shape)
        np.testing.assert_allclose(out[3], (1 - share) * shape[3] + share * SQUARE[1], atol=1e-6)


def test_refuses_surfaces():
    whole = (1, [0, 1, 2], [0, 1, 0], 0, 1)
    own = attached([3], [[whole]])
    assert said(attached, [V], [[whole]]) == "vertices names vertex 2000; the mesh has 2,000 vertices"
    assert said(attached, [3], [[(3, *whole[1:])]]) == "attachments holds 3; expected 0, 1 or 2"
    assert said(attached, [3], [[whole]], weights=np.ones(2)) == "weights has 2 numbers; the mesh has 2,000 vertices"
    assert said(own.stage, SQUARE[:2], MATRIX) == "the target has 2 vertices; the mesh was bound to 3"
    assert said(own.stage, SQUARE, np.eye(3)) == "matrix has shape (3, 3); expected (4, 4)"
    assert said(own.stage, SQUARE, MATRIX, np.inf) == "strength is inf; expected a finite number"


def caged(**more):
    """The first three vertices follow a cage of two."""
    offsets = np.minimum([0, 1, 3, 4] + (V - 3) * [4], 4)
    return sinew.MeshDeform(offsets, np.array([0, 0, 1, 1]), np.array([0.5, 1, 3, 2]), np.zeros((2, 3)), **more)


CAGE = np.array([(1, 0, 0), (0, 0, 4)], float)


def test_a_cage_takes_vertices_along(shape):
    own = caged()
    out = applied(own.stage(CAGE, np.eye(4), np.eye(3)), shape)
    np.testing.assert_allclose(out[:3], shape[:3] + [(1, 0, 0), (0.25, 0, 3), (0, 0, 4)], atol=1e-6)
    np.testing.assert_array_equal(out[3:], shape[3:])
    out = applied(own.stage(CAGE, MATRIX, np.diag([2, 1, 1])), shape)
    np.testing.assert_allclose(out[:3], shape[:3] + [(2, 0, 5), (0.5, 0, 8), (0, 0, 9)], atol=1e-6)
    assert (own.vertex_count, own.cage_vertex_count) == (V, 2)


def test_a_cage_with_a_group(shape):
    weights = np.linspace(0, 0.5, V)
    for own, share in ((caged(weights=weights), weights), (caged(weights=weights, invert=True), 1 - weights)):
        out = applied(own.stage(CAGE, np.eye(4), np.eye(3)), shape)
        moved = share[:3, None] * [(1, 0, 0), (0.25, 0, 3), (0, 0, 4)]
        np.testing.assert_allclose(out[:3], shape[:3] + moved, atol=1e-6)


def test_refuses_cages():
    own = caged()
    assert said(sinew.MeshDeform, np.array([0, 1]), np.array([2]), np.ones(1), np.zeros((2, 3))) == (
        "vertex 0 follows vertex 2 of a cage that has 2 vertices"
    )
    assert said(caged, weights=np.ones(2)) == "weights has 2 numbers; the mesh has 2,000 vertices"
    assert said(own.stage, CAGE[:1], np.eye(4), np.eye(3)) == "cage has 3 numbers; expected 6 (2 x 3)"
    assert said(own.stage, CAGE, np.eye(3), np.eye(3)) == "matrix has shape (3, 3); expected (4, 4)"
    assert said(own.stage, CAGE, np.eye(4), np.full((3, 3), np.nan)) == "the matrix is not finite"


def test_refuses_what_it_works_on(topology, shape):
    stage = sinew.Smooth(topology).stage()
    assert said(stage.apply, shape[:5].copy()) == "positions has shape (5, 3); expected (2000, 3)"
    assert said(stage.apply, shape.astype(float)) == "positions is float64; expected float32"
    assert said(stage.apply, np.repeat(shape, 2, 0)[::2]) == "positions is not C-contiguous; pass a C-contiguous array"
    assert said(stage.apply, shape.tolist()) == "positions is a list; expected a numpy array"
    shape.setflags(write=False)
    assert said(stage.apply, shape) == "positions is read-only; pass a writable array"
    deformer, out = sinew.Deformer(vertex_count=V), np.zeros((V, 3), np.float32)
    assert (
        said(deformer.deform, [], out, rest_positions=shape, stages=[stage, 7])
        == "stage 1 is not a Stage; expected what stage(...) of a Smooth or another stage returns"
    )
    assert (
        said(deformer.deform, [], out, rest_positions=shape, stages=[sinew.Hook(3).stage(np.eye(4))])
        == "stage 0 has 3 vertices; the deformer has 2,000"
    )
    assert (
        said(deformer.deform, [], out, rest_positions=shape, stages=[stage], milliseconds=np.zeros(3))
        == "milliseconds has shape (3,); expected (2,)"
    )
    assert said(deformer.deform, [], out) == "there are no layers and no shape keys; expected rest_positions"
    keys = sinew.ShapeKeys([shape], [0])
    assert said(sinew.Deformer, [], keys, V) == "there is a vertex_count beside layers or keys; expected one"
    assert said(sinew.Deformer, vertex_count=-1) == "vertex_count is -1; expected 0 to 536,870,912"
