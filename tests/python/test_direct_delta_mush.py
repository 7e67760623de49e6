"""DirectDeltaMush, skin_direct_delta_mush."""

import threading
import tracemalloc

import numpy as np
import pytest
import sinew_native as sinew

import mush_reference as oracle
import reference
import rigs
from test_skeleton import said

JOINTS = 4


def tube(random, rings=24, around=12):
    """A bent, uneven tube of quads and triangles and its weights along it, (positions, offsets, vertices, weights)."""
    ring, k = np.divmod(np.arange(rings * around), around)
    angle = 2 * np.pi * (k + 0.3 * np.sin(ring)) / around
    radius = 0.25 + 0.05 * np.sin(3 * angle) + 0.01 * random.random(len(ring))
    x = ring / rings * 3
    positions = np.column_stack([x, radius * np.cos(angle) + 0.1 * x**2, radius * np.sin(angle)]).astype(np.float32)
    faces = []
    for r in range(rings - 1):
        for i in range(around):
            a, b = r * around + i, r * around + (i + 1) % around
            quad = [a, b, b + around, a + around]
            faces += [quad] if (r + i) % 3 else [quad[:3], [quad[0], *quad[2:]]]
    offsets = np.cumsum([0] + [len(face) for face in faces])
    distance = np.abs(x[:, None] - np.linspace(0.4, 2.6, JOINTS))
    weights = np.maximum(0, 1 - distance / 0.9)
    return positions, offsets, np.concatenate(faces), weights / weights.sum(axis=1)[:, None]


@pytest.fixture
def random():
    return np.random.default_rng(17)


@pytest.fixture
def character(random):
    return tube(random)


@pytest.fixture
def pose(random):
    return rigs.random_matrices(random, JOINTS, size=0.3, dtype=np.float32)


def diagonal(positions):
    return np.linalg.norm(np.ptp(positions, axis=0))


def error(ddm, rest, omega, matrices):
    expected = oracle.deform(rest, omega, matrices)
    return np.abs(sinew.skin_direct_delta_mush(ddm, matrices) - expected).max() / diagonal(rest)


SETTINGS = [
    {},
    {"blend": 0.0},
    {"blend": 0.5, "smoothing": 10.0, "weight_smoothing": 20.0, "iterations": 3},
    {"smoothing": 0.5, "weight_smoothing": 0.0, "iterations": 50},
]


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
def test_agrees_with_the_formulas(character, pose, settings):
    ddm = sinew.DirectDeltaMush(*character, prune=0, **settings)
    omega, _ = oracle.small_omega(character, **settings)
    assert error(ddm, character[0], omega, pose) < 2e-6


def test_uniform_laplacian(character, pose):
    ddm = sinew.DirectDeltaMush(*character, laplacian="uniform")
    omega, _ = oracle.small_omega(character, laplacian="uniform")
    assert error(ddm, character[0], omega, pose) < 1e-5


def test_blend_1_is_the_limit(character, pose):
    # The formula itself has nothing to take a rotation of.
    ddm = sinew.DirectDeltaMush(*character, blend=1)
    near, _ = oracle.small_omega(character, blend=1 - 1e-6)
    assert error(ddm, character[0], near, pose) < 1e-5


def test_pruning_is_reported_and_no_more_than_that(character, pose):
    whole = sinew.DirectDeltaMush(*character, iterations=1, prune=0)
    for prune in (1e-4, 1e-3, 1e-2):
        ddm = sinew.DirectDeltaMush(*character, iterations=1, prune=prune)
        assert 0 < ddm.pruned <= prune
        assert ddm.entry_count < whole.entry_count
        off = np.abs(sinew.skin_direct_delta_mush(ddm, pose) - sinew.skin_direct_delta_mush(whole, pose)).max()
        assert off < 4 * ddm.pruned * diagonal(character[0])
    assert whole.pruned == 0


def moments(rest, omega, p):
    """Omega about p, as arrays() has it but for its scale."""
    back = np.tile(np.eye(4), (len(rest), 1, 1))
    back[:, :3, 3] = -p
    return np.einsum("vab,vjbc,vdc->vjad", back, omega, back)


# What each variant keeps, from the formulas' Omega.
def deform_variant(variant, rest, omega, p, matrices):
    matrices = matrices.astype(float)
    about = moments(rest, omega, p)
    share = about[..., 3, 3]
    linear = np.einsum("vj,jab->vab", share, matrices[:, :3, :3])
    place = np.einsum("vj,jab,vb->va", share, matrices[:, :3], np.column_stack([p, np.ones(len(p))]))
    if variant < 4:
        place += np.einsum("jab,vjb->va", matrices[:, :3, :3], about[..., :3, 3])
    if variant in (2, 4):
        quaternions = np.array([reference.quaternion(m) for m in matrices])
        rotation = np.array([blended_rotation(quaternions, own) for own in share])
    elif variant == 1:
        whole = np.einsum("jac,vjcb->vab", matrices, omega)
        of_rest = omega.sum(axis=1)
        deformed = whole[:, :3, :3] - whole[:, :3, 3:] * whole[:, 3:, :3]
        rest_moment = of_rest[:, :3, :3] - of_rest[:, :3, 3:] * of_rest[:, 3:, :3]
        rotation = np.linalg.inv(deformed @ np.linalg.inv(rest_moment)).transpose(0, 2, 1)
        rotation /= np.cbrt(np.linalg.det(rotation))[:, None, None]
    else:
        rotation = linear
    return place + np.einsum("vab,vb->va", rotation, rest - p)


def blended_rotation(quaternions, weights):
    total = np.zeros(4)
    for q, w in sorted(zip(quaternions, weights), key=lambda one: -one[1]):
        total += w * q * (-1 if q @ total < 0 else 1)
    return reference.rotation(total / np.linalg.norm(total))


def turn(angle, axis):
    axis = np.asarray(axis) / np.linalg.norm(axis)
    matrix = np.eye(4, dtype=np.float32)
    matrix[:3, :3] = reference.rotation(np.array([np.cos(angle / 2), *np.sin(angle / 2) * axis]))
    return matrix


@pytest.mark.parametrize("variant, width", [(1, 10), (2, 4), (3, 4), (4, 1), (5, 1)])
def test_variants_keep_less(random, character, variant, width):
    positions = character[0]
    # Turns that agree about the sign of a quaternion whatever the order.
    matrices = np.tile(np.eye(4, dtype=np.float32), (JOINTS, 1, 1))
    for j in range(JOINTS):
        matrices[j] = turn(0.25 * j, [1, 0.5 * j, 0.2])
        matrices[j, :3, 3] = 0.1 * random.random(3)
    ddm = sinew.DirectDeltaMush(*character, variant=variant, prune=0)
    assert ddm.arrays()["omega"].shape[1] == width
    omega, p = oracle.small_omega(character)
    expected = deform_variant(variant, positions, omega, p, matrices)
    off = np.abs(sinew.skin_direct_delta_mush(ddm, matrices) - expected).max() / diagonal(positions)
    assert off < (2e-2 if variant == 1 else 5e-6)  # 1 adds a ball to what is flat


every_variant = pytest.mark.parametrize("variant", range(6))


@every_variant
def test_the_rest_pose_is_the_rest_mesh(character, variant):
    ddm = sinew.DirectDeltaMush(*character, variant=variant)
    rest = sinew.skin_direct_delta_mush(ddm, np.tile(np.eye(4, dtype=np.float32), (JOINTS, 1, 1)))
    assert np.abs(rest - character[0]).max() < 2e-6 * diagonal(character[0])


@every_variant
def test_one_rigid_motion_moves_everything_rigidly(random, character, variant):
    ddm = sinew.DirectDeltaMush(*character, variant=variant)
    motion = rigs.random_matrices(random, 1, dtype=np.float32)
    moved = sinew.skin_direct_delta_mush(ddm, np.repeat(motion, JOINTS, axis=0))
    expected = character[0] @ motion[0, :3, :3].T + motion[0, :3, 3]
    assert np.abs(moved - expected).max() < 2e-6 * diagonal(character[0])


@every_variant
def test_a_piece_that_one_joint_moves_is_linear(random, character, pose, variant):
    positions, offsets, vertices, weights = character
    two = np.concatenate([positions, positions + 3])
    faces = np.concatenate([offsets, offsets[1:] + offsets[-1]]), np.concatenate([vertices, vertices + len(positions)])
    rigid = np.zeros((len(two), JOINTS))
    rigid[: len(positions), 0] = rigid[len(positions) :, 2] = 1
    ddm = sinew.DirectDeltaMush(two, *faces, rigid, variant=variant)
    linear = sinew.skin_linear(sinew.Skin.from_dense(two, rigid), pose)
    assert np.abs(sinew.skin_direct_delta_mush(ddm, pose) - linear).max() < 3e-6 * diagonal(two)


@pytest.mark.parametrize("settings", [{"iterations": 0}, {"smoothing": 0, "weight_smoothing": 0}], ids=str)
def test_without_smoothing_it_is_linear(character, pose, settings):
    positions, _, _, weights = character
    ddm = sinew.DirectDeltaMush(*character, **settings)
    linear = sinew.skin_linear(sinew.Skin.from_dense(positions, weights), pose)
    assert np.abs(sinew.skin_direct_delta_mush(ddm, pose) - linear).max() < 2e-6 * diagonal(positions)


def test_without_faces_it_is_linear(character, pose):
    positions, _, _, weights = character
    linear = sinew.skin_linear(sinew.Skin.from_dense(positions, weights), pose)
    for offsets in (np.array([], int), np.array([0])):
        ddm = sinew.DirectDeltaMush(positions, offsets, np.array([], int), weights)
        assert np.abs(sinew.skin_direct_delta_mush(ddm, pose) - linear).max() < 2e-6 * diagonal(positions)


def odd_meshes(random):
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    quad = np.array([0, 4]), np.arange(4)
    line = np.column_stack([np.arange(4), np.zeros((4, 2))])
    yield "flat", square, *quad
    yield "a line", line, *quad
    yield "a point", np.zeros((4, 3)), *quad
    yield "an isolated vertex", np.vstack([square[:3], [[9, 9, 9]]]), np.array([0, 3]), np.arange(3)
    yield "a thin triangle", square * [1, 1e-30, 1] + [[0, 0, 0], [0, 0, 1e-7], [0, 0, 0], [0, 0, 0]], *quad
    yield "a corner twice", square, np.array([0, 4, 7]), np.array([0, 1, 2, 3, 1, 1, 2])
    yield "far away and tiny", square * 1e-12 + 1e-3, *quad
    yield "huge", square * 1e15, *quad


ODD = list(odd_meshes(None))


@every_variant
@pytest.mark.parametrize("kind", ["cotangent", "uniform"])
@pytest.mark.parametrize("mesh", [mesh[1:] for mesh in ODD], ids=[mesh[0] for mesh in ODD])
def test_odd_meshes_stay_finite_and_move_rigidly(random, mesh, kind, variant):
    weights = np.array([[1, 0], [0, 1], [0.5, 0.5], [1, 0]])
    ddm = sinew.DirectDeltaMush(*mesh, weights, laplacian=kind, variant=variant)
    assert np.isfinite(sinew.skin_direct_delta_mush(ddm, rigs.random_matrices(random, 2, dtype=np.float32))).all()
    motion = rigs.random_matrices(random, 1, dtype=np.float32)
    moved = sinew.skin_direct_delta_mush(ddm, np.repeat(motion, 2, axis=0))
    size = np.abs(mesh[0]).max() + 1
    assert np.abs(moved - (mesh[0] @ motion[0, :3, :3].T + motion[0, :3, 3])).max() < 2e-6 * size


@every_variant
def test_singular_matrices_stay_finite(character, pose, variant):
    ddm = sinew.DirectDeltaMush(*character, variant=variant)
    for scale in (np.zeros(3), [1, 0, 0], [1, 1, 0], [-1, 1, 1], [1e-20, 1e-20, 1e-20], [1e15, 1, 1]):
        matrices = pose.copy()
        matrices[:, :3, :3] *= np.float32(scale)
        assert np.isfinite(sinew.skin_direct_delta_mush(ddm, matrices)).all(), scale
        matrices[1:] = pose[1:]
        assert np.isfinite(sinew.skin_direct_delta_mush(ddm, matrices)).all(), scale


def test_never_a_reflection(character):
    # Each joint mirrors: detail is turned, not turned inside out.
    mirror = np.tile(np.diag(np.float32([-1, 1, 1, 1])), (JOINTS, 1, 1))
    positions = character[0]
    omega, p = oracle.small_omega(character)
    ddm = sinew.DirectDeltaMush(*character)
    detail = sinew.skin_direct_delta_mush(ddm, mirror) - p * [-1, 1, 1]
    lengths = np.linalg.norm(detail, axis=1), np.linalg.norm(positions - p, axis=1)
    assert np.allclose(*lengths, rtol=0, atol=1e-5)
    assert error(ddm, positions, omega, mirror) < 1e-5


def test_what_no_weight_reaches_stays(character, pose):
    positions, offsets, vertices, weights = character
    two = np.concatenate([positions, positions + 3])
    faces = np.concatenate([offsets, offsets[1:] + offsets[-1]]), np.concatenate([vertices, vertices + len(positions)])
    weights = np.concatenate([weights, 0 * weights])
    moved = sinew.skin_direct_delta_mush(sinew.DirectDeltaMush(two, *faces, weights), pose)
    assert np.allclose(moved[len(positions) :], two[len(positions) :], rtol=0, atol=2e-6)
    assert np.abs(moved[: len(positions)] - positions).max() > 0.1


def test_a_vertex_without_weight_follows_its_neighbours(character, pose):
    positions, offsets, vertices, weights = character
    weights = weights.copy()
    weights[100] = 0
    omega, _ = oracle.small_omega((positions, offsets, vertices, weights))
    ddm = sinew.DirectDeltaMush(positions, offsets, vertices, weights)
    assert error(ddm, positions, omega, pose) < 5e-6


@every_variant
def test_arrays_give_the_same_bits(character, pose, variant):
    skin = sinew.Skin.from_dense(character[0], character[3])
    ddm = sinew.DirectDeltaMush.compute(skin, *character[1:3], variant=variant)
    kept = {name: np.copy(value) if isinstance(value, np.ndarray) else value for name, value in ddm.arrays().items()}
    again = sinew.DirectDeltaMush.from_arrays(skin, **kept)
    assert np.array_equal(sinew.skin_direct_delta_mush(again, pose), sinew.skin_direct_delta_mush(ddm, pose))
    assert (again.variant, again.pruned, again.entry_count) == (variant, ddm.pruned, ddm.entry_count)
    for name, value in again.arrays().items():
        assert np.array_equal(value, kept[name]), name


def test_arrays_that_do_not_fit(character):
    skin = sinew.Skin.from_dense(character[0], character[3])
    kept = sinew.DirectDeltaMush.compute(skin, *character[1:3]).arrays()

    def refused(**changed):
        return said(sinew.DirectDeltaMush.from_arrays, skin, **{**kept, **changed})

    joints, omega = kept["joints"].copy(), kept["omega"].copy()
    joints[3], omega[2, 1] = 4, np.inf
    assert refused(variant=7) == "variant is 7; expected 0 to 5"
    assert refused(variant=4).startswith("omega has ")
    assert (
        refused(offsets=kept["offsets"][:-1])
        == "offsets has 288 entries; expected 289, one more than there are vertices"
    )
    assert refused(offsets=kept["offsets"][::-1]).startswith("offsets goes from ")
    assert refused(joints=joints) == "joints names joint 4; the skin has 4 joints"
    assert refused(omega=omega) == "omega is not finite at number 21"
    assert refused(centers=kept["centers"][1:]) == "centers has 861 numbers; expected 864"


def test_what_is_wrong_is_said(character):
    positions, offsets, vertices, weights = character

    def refused(**changed):
        given = {"rest_positions": positions, "face_offsets": offsets, "face_vertices": vertices, "weights": weights}
        return said(sinew.DirectDeltaMush, **{**given, **changed})

    assert refused(smoothing=-1) == "smoothing is -1; expected 0 to 1,000"
    assert refused(weight_smoothing=np.nan) == "weight_smoothing is nan; expected 0 to 1,000"
    assert refused(blend=1.5) == "blend is 1.5; expected 0 to 1"
    assert refused(iterations=1001) == "iterations is 1001; expected 0 to 1,000"
    assert refused(variant=6) == "variant is 6; expected 0 to 5"
    assert refused(prune=-0.1) == "prune is -0.1; expected 0 to 1"
    assert refused(laplacian="mean") == 'there is no laplacian "mean"; expected cotangent or uniform'
    assert refused(face_offsets=offsets[:-1]).startswith("face_offsets goes from 0 to ")
    assert refused(face_offsets=np.array([0, 2, len(vertices)])) == "face 0 has 2 corners; expected three at least"
    assert refused(face_vertices=vertices + 1) == "face_vertices names vertex 288; the mesh has 288 vertices"
    assert refused(weights=weights[:-1]) == "weights has 287 rows; there are 288 vertices"
    assert refused(smoothing=1e3, iterations=1000).startswith("smoothing by 1000, 1000 times, is too strong")


def test_layer_and_jobs(character, pose):
    skin = sinew.Skin.from_dense(character[0], character[3])
    ddm = sinew.DirectDeltaMush.compute(skin, *character[1:3])
    assert ddm.method == "direct_delta_mush" and ddm.vertex_count == 288
    expected = sinew.skin_direct_delta_mush(ddm, pose)
    layer = sinew.Layer(skin, "direct_delta_mush", data=ddm)
    out = np.empty_like(expected)
    sinew.Deformer([layer]).deform([(pose, None)], out)
    assert np.array_equal(out, expected)
    sinew.skin_all([(skin, pose, out, "direct_delta_mush", "polar", None, ddm)])
    assert np.array_equal(out, expected)
    other = sinew.Skin.from_dense(character[0], character[3][:, :2])
    assert said(sinew.Layer, other, "direct_delta_mush", data=ddm) == "the data has 4 joints; the skin has 2"


def test_layer_in_a_space_of_its_own(random, character, pose):
    """In the space of the mesh, whatever the armature's: C M C^-1."""
    skin = sinew.Skin.from_dense(character[0], character[3])
    ddm = sinew.DirectDeltaMush.compute(skin, *character[1:3])
    space = rigs.random_matrices(random, 1)[0] @ np.diag([1, 2, 3, 1])
    out = np.empty_like(character[0])
    sinew.Deformer([sinew.Layer(skin, "direct_delta_mush", data=ddm)]).deform([(pose, space)], out)
    carried = (space @ pose @ np.linalg.inv(space)).astype(np.float32)
    assert np.allclose(out, sinew.skin_direct_delta_mush(ddm, carried), rtol=0, atol=1e-5)


def test_detail_of_shape_keys_turns_with_the_surface(random, character, pose):
    """p' + R (v - p) of whatever v the keys give."""
    positions, offsets, vertices, weights = character
    skin = sinew.Skin.from_dense(positions, weights)
    ddm = sinew.DirectDeltaMush.compute(skin, offsets, vertices)
    omega, _ = oracle.small_omega((positions, offsets, vertices, weights))
    keyed = positions + np.float32(0.02 * random.random(positions.shape))
    out = np.empty_like(positions)
    layer = sinew.Layer(skin, "direct_delta_mush", data=ddm)
    sinew.Deformer([layer]).deform([(pose, None)], out, rest_positions=keyed)
    assert np.abs(out - oracle.deform(keyed, omega, pose)).max() < 5e-6 * diagonal(positions)


def test_frames_at_once_and_any_number_of_threads(random, character):
    positions, offsets, vertices, weights = character
    many = np.concatenate([positions + 2 * i for i in range(40)])  # some tiles
    faces = np.concatenate([[0], *(offsets[1:] + i * offsets[-1] for i in range(40))])
    corners = np.concatenate([vertices + i * len(positions) for i in range(40)])
    matrices = rigs.random_matrices(random, 6, JOINTS, dtype=np.float32)
    results = []
    for threads in (1, 2, 8):
        sinew.set_thread_count(threads)
        ddm = sinew.DirectDeltaMush(many, faces, corners, np.tile(weights, (40, 1)))
        results.append(sinew.skin_direct_delta_mush(ddm, matrices).tobytes())
    single = np.array([sinew.skin_direct_delta_mush(ddm, frame) for frame in matrices])
    assert results == [single.tobytes()] * 3


def test_out_is_written_and_nothing_is_copied(character, random):
    ddm = sinew.DirectDeltaMush(*character)
    matrices = rigs.random_matrices(random, 500, JOINTS, dtype=np.float32).swapaxes(-1, -2)
    out = np.full((500, 288, 3), np.nan, np.float32)
    sinew.skin_direct_delta_mush(ddm, matrices, out)  # some memory is kept from the first call on
    tracemalloc.start()
    try:
        assert sinew.skin_direct_delta_mush(ddm, matrices, out) is out
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < matrices.nbytes / 10
    assert np.array_equal(out, sinew.skin_direct_delta_mush(ddm, matrices.copy()))
    assert said(sinew.skin_direct_delta_mush, ddm, matrices[:, :3]) == (
        "there are 3 matrices per frame; the skin has 4 joints"
    )


@pytest.mark.parametrize("name", sinew.instruction_sets())
def test_every_instruction_set(character, pose, name):
    positions, offsets, vertices, weights = character
    omega, _ = oracle.small_omega((positions, offsets, vertices, weights))
    try:
        sinew.set_instruction_set(name)
        assert error(sinew.DirectDeltaMush(*character), positions, omega, pose) < 5e-6
    finally:
        sinew.set_instruction_set("auto")


def test_progress_and_cancelling(random):
    positions, offsets, vertices, weights = tube(random, 400, 60)
    skin = sinew.Skin.from_dense(positions, weights)
    progress = sinew.Progress()
    assert sinew.DirectDeltaMush.compute(skin, offsets, vertices, progress=progress) is not None
    assert progress.fraction == 1
    progress = sinew.Progress()
    progress.cancel()
    assert sinew.DirectDeltaMush.compute(skin, offsets, vertices, progress=progress) is None


def test_progress_of_the_first_smoothing(random):
    """It is half of the work where one joint moves all."""
    positions, offsets, vertices, weights = tube(random, 400, 60)
    skin = sinew.Skin.from_dense(positions, np.ones((len(positions), 1)))
    progress = sinew.Progress()
    worker = threading.Thread(
        target=sinew.DirectDeltaMush.compute,
        args=(skin, offsets, vertices),
        kwargs={"iterations": 1000, "progress": progress},
    )
    worker.start()
    while worker.is_alive() and progress.fraction == 0:
        pass
    seen = progress.fraction
    progress.cancel()
    worker.join()
    assert 0 < seen < 0.5


def test_other_python_threads_run_meanwhile(random):
    positions, offsets, vertices, weights = tube(random, 400, 60)
    skin = sinew.Skin.from_dense(positions, weights)
    progress, results = sinew.Progress(), []

    def work():
        results.append(sinew.DirectDeltaMush.compute(skin, offsets, vertices, iterations=1000, progress=progress))

    worker = threading.Thread(target=work)
    worker.start()
    progress.cancel()  # not before the end if the worker keeps the interpreter
    worker.join()
    assert results == [None]


@pytest.fixture(scope="module")
def elephant():
    """The rig, some of its vertices and what smooths there."""
    pytest.importorskip("scipy.sparse.linalg")
    rig = sinew.read_rig(rigs.SHARED / "elephant")
    rest = rig.positions.astype(float)
    laplacian = oracle.cotangent_laplacian(rest, oracle.triangles(rig.face_offsets, rig.face_vertices))
    some = np.arange(7, len(rest), 101)
    return rig, some, [oracle.smoother_rows(laplacian, len(rest), strength, 20, some) for strength in (3, 1)]


@rigs.needs_shared_rigs
@pytest.mark.parametrize("rigid", [False, True], ids=["own weights", "largest weight 1"])
def test_shared_elephant(elephant, rigid):
    rig, some, rows = elephant
    weights = rig.weights
    if rigid:
        weights = (np.arange(weights.shape[1]) == weights.argmax(axis=1)[:, None]).astype(float)
    omega, _ = oracle.omega(rig.positions.astype(float), weights, *rows, blend=0.8)
    ddm = sinew.DirectDeltaMush(rig.positions, rig.face_offsets, rig.face_vertices, weights)
    for frame in (0, 100, 228, 456):
        matrices = rig.animation[frame].astype(np.float32)
        expected = oracle.deform(rig.positions[some].astype(float), omega, matrices)
        off = np.abs(sinew.skin_direct_delta_mush(ddm, matrices)[some] - expected).max()
        assert off < 1e-5 * diagonal(rig.positions), frame
