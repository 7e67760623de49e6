"""Automatic weights: laws that hold for any mesh, and for any damage to it."""

import threading

import numpy as np
import pytest
import sinew_native as sinew

NO_FACES = np.zeros(0, int)


def arm(around=24, along=60, radius=0.3, length=4.0):
    """A closed tube along x, with triangles at its ends: positions, face offsets, face vertices."""
    x = np.linspace(0, length, along)
    angle = np.arange(around) * 2 * np.pi / around
    rings = np.stack(np.broadcast_arrays(x[:, None], radius * np.cos(angle), radius * np.sin(angle)), -1).reshape(-1, 3)
    positions = np.concatenate((rings, [[-0.1, 0, 0], [length + 0.1, 0, 0]]))
    i, j = (axis.reshape(-1) for axis in np.mgrid[: along - 1, :around])
    k = (j + 1) % around
    quads = np.stack((i * around + j, i * around + k, (i + 1) * around + k, (i + 1) * around + j), 1)
    j = np.arange(around)
    k, last = (j + 1) % around, (along - 1) * around
    first_cap = np.stack((k, j, np.full(around, len(rings))), 1)
    last_cap = np.stack((last + j, last + k, np.full(around, len(rings) + 1)), 1)
    faces = [*quads.tolist(), *first_cap.tolist(), *last_cap.tolist()]
    return positions, *as_arrays(faces)


def as_arrays(faces):
    return np.cumsum([0, *map(len, faces)]), np.array([v for face in faces for v in face], int)


def as_faces(offsets, vertices):
    return [vertices[a:b].tolist() for a, b in zip(offsets, offsets[1:])]


HEADS = np.array([[0.0, 0, 0], [2, 0, 0]])
TAILS = np.array([[2.0, 0, 0], [4, 0, 0]])


def table(result, joints):
    """(V, J)."""
    weights = np.zeros((len(result.offsets) - 1, joints))
    weights[np.repeat(np.arange(len(weights)), np.diff(result.offsets)), result.joints] = result.weights
    return weights


def check(result, vertices, joints):
    """The laws of every result; returns the weights (V, J)."""
    assert len(result.offsets) == vertices + 1 and result.offsets[0] == 0
    assert (np.diff(result.offsets) >= 1).all(), "a vertex without weights"
    assert np.isfinite(result.weights).all() and (result.weights > 0).all()
    assert (result.joints >= 0).all() and (result.joints < joints).all()
    weights = table(result, joints)
    np.testing.assert_allclose(weights.sum(1), 1, atol=1e-6)
    report = result.report
    ways = np.bincount(result.ways, minlength=5)
    assert [
        report.surface_count,
        report.volume_count,
        report.nearest_count,
        report.fixed_count,
        report.rigid_count,
    ] == ways.tolist()
    assert report.vertex_count == vertices
    return weights


def weigh(mesh, heads=HEADS, tails=TAILS, **settings):
    result = sinew.automatic_weights(*mesh, heads, tails, **settings)
    return check(result, len(mesh[0]), settings.get("joints", np.arange(len(heads))).max() + 1)


def test_weights_follow_the_bones():
    mesh = arm()
    weights, x = weigh(mesh), mesh[0][:, 0]
    assert (weights[x < 1.5, 0] > 0.99).all() and (weights[x > 2.5, 1] > 0.99).all()
    near = np.abs(x - 2) < 0.05
    assert near.any() and (np.abs(weights[near, 0] - 0.5) < 0.2).all()
    along = weights[:-2, 0].reshape(60, 24).mean(1)
    assert (np.diff(along) < 1e-6).all()


def test_result_is_what_a_skin_takes():
    mesh = arm()
    result = sinew.automatic_weights(*mesh, HEADS, TAILS)
    skin = sinew.Skin(mesh[0], result.offsets, result.joints, result.weights, 2)
    assert skin.unweighted_count == 0 and skin.largest_sum_error < 1e-6
    with pytest.raises(ValueError, match="read-only"):
        result.weights[0] = 1


@pytest.mark.parametrize("method", ["heat", "volume", "nearest"])
def test_any_number_of_threads_gives_the_same_bits(method):
    mesh, results = arm(), []
    for threads in (1, 2, 0):
        sinew.set_thread_count(threads)
        results.append(sinew.automatic_weights(*mesh, HEADS, TAILS, method=method))
    for result in results[1:]:
        for name in ("offsets", "joints", "weights", "ways", "parts"):
            np.testing.assert_array_equal(getattr(result, name), getattr(results[0], name))


@pytest.mark.parametrize("scale", [1e-300, 1e-3, 0.01, 1000, 1e300])
def test_scale_does_not_matter(scale):
    positions, *faces = arm()
    expected = weigh((positions, *faces))
    scaled = weigh((positions * scale, *faces), HEADS * scale, TAILS * scale)
    np.testing.assert_allclose(scaled, expected, atol=1e-4)


def test_place_does_not_matter():
    positions, *faces = arm()
    move = np.array([1e5, -500, 3e4])
    moved = weigh((positions + move, *faces), HEADS + move, TAILS + move)
    np.testing.assert_allclose(moved, weigh((positions, *faces)), atol=1e-4)


@pytest.mark.parametrize("axis", range(3))
def test_mirrored_mesh_has_mirrored_weights(axis):
    positions, offsets, vertices = arm()
    sign = np.ones(3)
    sign[axis] = -1
    mirrored = weigh((positions * sign, offsets, vertices), HEADS * sign, TAILS * sign)
    np.testing.assert_allclose(mirrored, weigh((positions, offsets, vertices)), atol=1e-4)


def soup(mesh):
    """Every face with vertices of its own."""
    positions, offsets, vertices = mesh
    return positions[vertices], offsets, np.arange(len(vertices))


def test_coincident_vertices_have_equal_weights():
    mesh = arm()
    split = weigh(soup(mesh))
    np.testing.assert_array_equal(split, split[first_of_each(soup(mesh)[0])])
    np.testing.assert_allclose(split, weigh(mesh)[mesh[2]], atol=1e-6)


def first_of_each(positions):
    """(V,): the first vertex at each vertex's place."""
    _, first, inverse = np.unique(positions, axis=0, return_index=True, return_inverse=True)
    return first[inverse.reshape(-1)]


def test_cancelled():
    progress = sinew.Progress()
    progress.cancel()
    assert sinew.automatic_weights(*arm(), HEADS, TAILS, progress=progress) is None


def test_progress_reaches_one():
    progress, results = sinew.Progress(), []
    thread = threading.Thread(
        target=lambda: results.append(sinew.automatic_weights(*arm(), HEADS, TAILS, progress=progress))
    )
    thread.start()
    thread.join()
    assert results[0] is not None and progress.fraction == 1


def test_least_weight_and_most_influences():
    heads = np.array([[x, 0.0, 0] for x in np.linspace(0, 3.5, 8)])
    tails = heads + (0.5, 0, 0)
    every = weigh(arm(radius=1.0), heads, tails, least_weight=0.0)
    assert ((every > 0).sum(1) > 4).any()
    cut = weigh(arm(radius=1.0), heads, tails, least_weight=0.05)
    assert cut[cut > 0].min() >= 0.05
    few = weigh(arm(radius=1.0), heads, tails, max_influences=2)
    assert (few > 0).sum(1).max() == 2


def test_segments_of_a_joint_add_up():
    mesh = arm()
    whole = weigh(mesh, least_weight=0.0)
    middle = (HEADS + TAILS) / 2
    heads, tails = np.concatenate((HEADS, middle)), np.concatenate((middle, TAILS))
    parts = weigh(mesh, heads, tails, joints=np.array([0, 1, 0, 1]), least_weight=0.0)
    np.testing.assert_allclose(parts, whole, atol=0.02)


def test_fixed_weights_are_kept_and_others_follow():
    mesh = arm()
    near = np.flatnonzero(np.abs(mesh[0][:, 0] - 1) < 0.04)
    given = np.tile([0.0, 3.0], (len(near), 1))
    free = weigh(mesh)
    weights = weigh(mesh, fixed_vertices=near, fixed_weights=given)
    np.testing.assert_array_equal(weights[near], np.tile([0.0, 1.0], (len(near), 1)))
    beside = np.flatnonzero(np.abs(mesh[0][:, 0] - 1.08) < 0.04)
    assert (weights[beside, 1] > free[beside, 1] + 0.3).all()


def test_rigid_parts():
    mesh = arm()
    part = np.where(np.abs(mesh[0][:, 0] - 2) < 0.3, 7, -1)
    weights = weigh(mesh, rigid_parts=part)
    np.testing.assert_array_equal(weights[part == 7], np.broadcast_to(weights[part == 7][0], ((part == 7).sum(), 2)))
    one = weigh(mesh, rigid_parts=part, rigid_follow="bone")
    assert set(one[part == 7].reshape(-1)) == {0.0, 1.0}


def small_cube(center, size):
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) - 0.5
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return corners * size + center, faces


def with_more(mesh, positions, faces):
    count = len(mesh[0])
    both = as_faces(*mesh[1:]) + [[v + count for v in face] for face in faces]
    return np.concatenate((mesh[0], positions)), *as_arrays(both)


def test_small_parts_are_attached_to_what_is_below():
    mesh = with_more(arm(), *small_cube((2.0, 0, 0.35), 0.1))
    weights = weigh(mesh, rigid_size=0.1)
    np.testing.assert_array_equal(weights[-8:], np.broadcast_to(weights[-1], (8, 2)))
    below = np.argmin(np.linalg.norm(mesh[0][:-8] - (2, 0, 0.3), axis=1))
    np.testing.assert_allclose(weights[-1], weights[below], atol=0.1)


def box(low, high):
    corners, faces = small_cube(np.zeros(3), 1.0)
    low, high = np.array(low), np.array(high)
    return (low + high) / 2 + corners * (high - low), faces


VOXEL = 28.2 / 31.6  # of hand() at the resolution of these tests
GAP = 0.6 * VOXEL  # between its fingers


def hand(gap=GAP):
    """A long arm, a palm and two fingers, closer than a voxel: the mesh, heads and tails of the bones. The first finger
    has three short bones along all of it, the second one has one bone in its lower quarter."""
    mesh = arm(around=12, along=20, radius=0.35)
    away = np.array([0, 0.7 + gap, 0])
    mesh = with_more(mesh, mesh[0] + away, as_faces(*mesh[1:]))
    mesh = with_more(mesh, *box((-4.1, -1, -0.5), (0.2, 2.2, 0.5)))
    positions, *faces = arm(around=20, along=60, radius=1.0, length=20.0)
    mesh = with_more(mesh, positions - (24, 0, 0), as_faces(*faces))
    heads = np.array([[0.0, 0, 0], [1.3, 0, 0], [2.6, 0, 0], away, [-24, 0, 0]])
    tails = np.array([[1.3, 0, 0], [2.6, 0, 0], [3.9, 0, 0], away + (1, 0, 0), [-4, 0, 0]])
    return mesh, heads, tails


def finger_weights(scale=1.0, mirror=1.0):
    (positions, *faces), heads, tails = hand()
    change = scale * np.array([1, mirror, 1])
    result = sinew.automatic_weights(positions * change, *faces, heads * change, tails * change, resolution=32)
    weights = check(result, len(positions), len(heads))
    assert result.report.voxel_size > GAP * scale
    count = 12 * 20 + 2
    return weights[:count], weights[count : 2 * count]


def test_fingers_closer_than_a_voxel_do_not_follow_each_other():
    first, second = finger_weights()
    assert first[:, 3].max() < 0.2 and second[:, :3].max() < 0.2
    assert second[:, 3].min() > 0.7 and first[:, 2].max() > 0.9


@pytest.mark.parametrize(("scale", "mirror"), [(1e-3, 1.0), (1e4, 1.0), (1.0, -1.0)])
def test_divided_cells_keep_the_laws(scale, mirror):
    for own, expected in zip(finger_weights(scale, mirror), finger_weights()):
        np.testing.assert_allclose(own, expected, atol=1e-4)


def test_divided_cells_give_the_same_bits_with_any_number_of_threads():
    results = []
    for threads in (1, 2, 0):
        sinew.set_thread_count(threads)
        results.append(finger_weights())
    for first, second in results[1:]:
        np.testing.assert_array_equal(first, results[0][0])
        np.testing.assert_array_equal(second, results[0][1])


@pytest.mark.parametrize("damage", ["islands", "soup", "holes", "flipped"])
def test_divided_cells_of_damaged_hands(damage):
    mesh, heads, tails = hand()
    random = np.random.default_rng(2)
    if damage == "islands":  # a pea that touches nothing, closer than a voxel
        mesh = with_more(mesh, *small_cube((2.0, -0.55, 0), 0.15))
    elif damage == "soup":
        mesh = soup(mesh)
        mesh = mesh[0] + random.normal(0, 0.02, mesh[0].shape), *mesh[1:]
    elif damage == "holes":
        mesh = mesh[0], *as_arrays([face for face in as_faces(*mesh[1:]) if random.random() > 0.3])
    else:
        mesh = mesh[0], *as_arrays([face[:: random.choice((1, -1))] for face in as_faces(*mesh[1:])])
    for method in ("heat", "volume"):
        weigh(mesh, heads, tails, method=method, resolution=32)


def test_many_short_bones_are_too_many_to_divide_for():
    x, y = (axis.reshape(-1) for axis in np.mgrid[:31, :31])
    i, j = (axis.reshape(-1) for axis in np.mgrid[:30, :30])
    faces = np.stack((i * 31 + j, i * 31 + j + 1, (i + 1) * 31 + j + 1, (i + 1) * 31 + j), 1)
    sheet = np.stack((x, y, 0.0 * x), 1), *as_arrays(faces.tolist())
    x, y = (axis.reshape(-1) * 30 / 19 for axis in np.mgrid[:20, :20])
    heads = np.stack((x, y, 0.0 * x), 1)
    weights = weigh(sheet, heads, heads)
    nearest = np.linalg.norm(sheet[0][:, None] - heads, axis=2).argmin(1)
    assert (weights.argmax(1) == nearest).mean() > 0.8


def jittered(mesh, amount):
    return mesh[0] + np.random.default_rng(3).normal(0, amount, mesh[0].shape), *mesh[1:]


def holes(mesh):
    faces = as_faces(*mesh[1:])
    keep = np.random.default_rng(1).random(len(faces)) > 0.3
    return mesh[0], *as_arrays([face for face, kept in zip(faces, keep) if kept])


def flipped(mesh):
    return mesh[0], *as_arrays([face[::-1] for face in as_faces(*mesh[1:])])


def half_flipped(mesh):
    return mesh[0], *as_arrays([face[:: (-1) ** i] for i, face in enumerate(as_faces(*mesh[1:]))])


def double_faces(mesh):
    faces = as_faces(*mesh[1:])
    return mesh[0], *as_arrays(faces + [face[::-1] for face in faces])


def faces_without_area(mesh):
    faces = as_faces(*mesh[1:])
    return mesh[0], *as_arrays([*faces, [0, 0, 0], [1, 1, 2], [0, 24, 48]])


def inner_shell(mesh):
    center = mesh[0].mean(0)
    inner = center + (mesh[0] - center) * (0.98, 0.7, 0.7)
    return with_more(mesh, inner, [face[::-1] for face in as_faces(*mesh[1:])])


def stray_island(mesh):
    return with_more(mesh, *small_cube((2.0, 5, 9), 0.2))


def fins(mesh):
    return with_more(mesh, np.array([[2.0, 0.3, 0], [2.0, 0.8, 0], [2.1, 0.8, 0]]), [[0, 1, 2]])


def fin_on_edge(mesh):
    faces = as_faces(*mesh[1:])
    return np.concatenate((mesh[0], [[2.0, 2, 0]])), *as_arrays([*faces, [0, 1, len(mesh[0])]])


def loose_vertices(mesh):
    return with_more(mesh, np.array([[1.0, 0.299, 0], [3, 1, 1], [2, 0, 0]]), [])


def no_faces(mesh):
    return mesh[0], NO_FACES, NO_FACES


def open_ends(mesh):
    return mesh[0], *as_arrays([face for face in as_faces(*mesh[1:]) if len(face) == 4])


DAMAGE = {
    "whole": lambda mesh: mesh,
    "holes": holes,
    "flipped": flipped,
    "half flipped": half_flipped,
    "soup": soup,
    "jittered soup": lambda mesh: jittered(soup(mesh), 0.002),
    "jitter": lambda mesh: jittered(mesh, 0.01),
    "double faces": double_faces,
    "faces without area": faces_without_area,
    "inner shell": inner_shell,
    "stray island": stray_island,
    "fins": fins,
    "fin on an edge": fin_on_edge,
    "loose vertices": loose_vertices,
    "no faces": no_faces,
    "open ends": open_ends,
    "flat": lambda mesh: (mesh[0] * (1, 1, 0), *mesh[1:]),
    "flat and open": lambda mesh: open_ends((mesh[0] * (1, 0, 1), *mesh[1:])),
    "small": lambda mesh: (mesh[0] * 1e-3, *mesh[1:]),
    "large": lambda mesh: (mesh[0] * 1e3, *mesh[1:]),
    "far": lambda mesh: (mesh[0] + 1e5, *mesh[1:]),
}


@pytest.mark.parametrize("method", ["heat", "volume"])
@pytest.mark.parametrize("kind", DAMAGE)
def test_damage(kind, method):
    positions, *faces = arm()
    mesh = DAMAGE[kind]((positions, *faces))
    scale, move = {"small": (1e-3, 0), "large": (1e3, 0), "far": (1, 1e5)}.get(kind, (1, 0))
    weights = weigh(mesh, HEADS * scale + move, TAILS * scale + move, method=method)
    own = weights[: len(positions)] if "soup" not in kind else weights
    x = (mesh[0][: len(own), 0] - move) / scale
    # Far from the elbow there is no doubt.
    assert (own[x < 1.4, 0] > 0.9).all() and (own[x > 2.6, 1] > 0.9).all()


@pytest.mark.parametrize(
    "heads, tails",
    [
        (HEADS, HEADS),
        (HEADS[:1], HEADS[:1]),
        (HEADS + 50, TAILS + 50),
        (HEADS * 1e12, TAILS * 1e12),
        (np.zeros((5, 3)), np.ones((5, 3))),
        (np.array([[-1e300, 0, 0], [0, 0, 1e-300]]), np.array([[1e300, 0, 0], [0, 1e300, 0]])),
    ],
    ids=["points", "one", "outside", "far outside", "on top of each other", "huge"],
)
@pytest.mark.parametrize("method", ["heat", "volume", "nearest"])
def test_any_bones(heads, tails, method):
    weights = weigh(arm(), heads, tails, method=method)
    if len(heads) == 5:
        np.testing.assert_allclose(weights, 0.2, atol=1e-6)


def test_bones_outside_are_reported():
    heads, tails = np.concatenate((HEADS, HEADS + (0, 9, 0))), np.concatenate((TAILS, TAILS + (0, 9, 0)))
    result = sinew.automatic_weights(*arm(), heads, tails)
    assert result.report.bones_outside.tolist() == [2, 3]


def test_loose_vertices():
    mesh = loose_vertices(arm())
    assert sinew.automatic_weights(*mesh, HEADS, TAILS).ways[-3:].tolist() == [1, 2, 1]


@pytest.mark.parametrize("far", [1e2, 1e6, 1e9])
def test_a_vertex_astray_does_not_matter(far):
    mesh = arm()
    weights = weigh((np.concatenate((mesh[0], [[0, 0, far]])), *mesh[1:]))
    np.testing.assert_allclose(weights[:-1], weigh(mesh), atol=0.05)


@pytest.mark.parametrize("positions", [np.zeros((0, 3)), np.ones((1, 3)), np.full((9, 3), -7e5)])
def test_meshes_without_extent(positions):
    weigh((positions, NO_FACES, NO_FACES))


def test_more_bones_than_can_be_kept():
    """200 bones on one line share all vertices: each has less than what is left out."""
    heads, tails = np.zeros((200, 3)), np.tile([4.0, 0, 0], (200, 1))
    weights = weigh(arm(), heads, tails)
    assert (weights > 0).all()


BROKEN = [
    ({"positions": np.full((2, 3), np.nan)}, "positions is not finite at vertex 0"),
    ({"heads": np.array([[0, 0, 0], [0, np.inf, 0]])}, "heads is not finite at bone 1"),
    ({"heads": np.zeros((0, 3)), "tails": np.zeros((0, 3))}, "there are no bones; expected at least one"),
    ({"tails": np.zeros((3, 3))}, "there are 2 heads and 3 tails; expected as many of each"),
    (
        {"face_vertices": np.array([0, 1, 9]), "face_offsets": np.array([0, 3])},
        "names vertex 9; the mesh has 4 vertices",
    ),
    ({"face_offsets": np.array([0, 2])}, "face_offsets goes from 0 to 2; expected 0 to 3"),
    ({"positions": np.zeros((4, 2))}, r"positions has shape \(4, 2\); expected \(V, 3\)"),
    ({"method": "magic"}, 'there is no method "magic"; expected heat, volume or nearest'),
    ({"resolution": 7}, "resolution is 7; expected 8 to 256"),
    ({"stiffness": np.nan}, "stiffness is nan; expected 0.001 to 1,000,000"),
    ({"max_influences": -1}, "max_influences is -1; expected 0"),
    ({"least_weight": 0.6}, "least_weight is 0.6; expected 0 to 0.5"),
    ({"joints": np.array([0])}, "joints has 1 number; there are 2 bones"),
    ({"joints": np.array([0, -2])}, "bone 1 has joint -2; expected 0 to 16,777,215"),
    ({"joints": np.zeros(0, int)}, "joints is empty; expected one for each bone"),
    ({"fixed_vertices": np.array([0])}, "fixed_vertices and fixed_weights belong together"),
    ({"fixed_vertices": np.array([4]), "fixed_weights": np.ones((1, 2))}, "fixed_vertices names vertex 4"),
    (
        {"fixed_vertices": np.array([0]), "fixed_weights": np.ones((1, 3))},
        "fixed_weights has 1 row of 3 joints; expected 1 of 2",
    ),
    (
        {"fixed_vertices": np.array([0]), "fixed_weights": np.ones((2, 2))},
        "fixed_weights has 2 rows of 2 joints; expected 1 of 2",
    ),
    ({"fixed_vertices": np.array([3]), "fixed_weights": np.zeros((1, 2))}, "the sum 0 in row 0, of vertex 3"),
    (
        {"fixed_vertices": np.array([3]), "fixed_weights": np.array([[1, -1]])},
        "fixed_weights is -1 at vertex 0, bone 1; expected 0 or more",
    ),
    ({"rigid_parts": np.array([0])}, "rigid_parts has 1 number; the mesh has 4 vertices"),
    ({"rigid_size": 2.0}, "rigid_size is 2; expected 0 to 1"),
    ({"rigid_follow": "me"}, 'there is no rigid_follow "me"; expected attachment or bone'),
]


@pytest.mark.parametrize("change, message", BROKEN, ids=[message for _, message in BROKEN])
def test_refused(change, message):
    arguments = {
        "positions": np.eye(4)[:, :3],
        "face_offsets": np.array([0, 3]),
        "face_vertices": np.array([0, 1, 2]),
        "heads": HEADS,
        "tails": TAILS,
    }
    with pytest.raises(ValueError, match=message):
        sinew.automatic_weights(**(arguments | change))
