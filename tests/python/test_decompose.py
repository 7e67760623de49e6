"""decompose: joints, weights and motions from a clip."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import sinew_native as sinew

NO_FACES = np.zeros(0, int)
ARRAYS = ("offsets", "joints", "weights", "rest", "poses", "vertex_rms", "vertex_largest")


@pytest.fixture
def random():
    return np.random.default_rng(28)


def grid(columns, rows=9):
    """A sheet of quads, one unit each, with a wave in it: (positions, face_offsets, face_vertices)."""
    x, y = (axis.reshape(-1).astype(float) for axis in np.mgrid[:columns, :rows])
    corner = (np.arange(columns - 1)[:, None] * rows + np.arange(rows - 1)).reshape(-1)
    faces = (corner[:, None] + (0, rows, rows + 1, 1)).reshape(-1)
    return np.stack((x, y, 0.5 * np.sin(x + y)), 1), np.arange(0, len(faces) + 1, 4), faces


def rotation(axis, angle):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.cross(np.eye(3), axis)
    return np.eye(3) - np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def rigid(random, frames, joints, size=0.5, far=3.0):
    matrices = np.tile(np.eye(4), (frames, joints, 1, 1))
    for f, j in np.ndindex(frames, joints):
        matrices[f, j, :3, :3] = rotation(random.normal(size=3), size * random.normal())
        matrices[f, j, :3, 3] = far * random.normal(size=3)
    return matrices


def posed(rest, weights, matrices):
    """Linear skinning in double precision, (F, V, 3)."""
    homogeneous = np.column_stack((rest, np.ones(len(rest))))
    return np.einsum("vj,fjrc,vc->fvr", weights, matrices[:, :, :3], homogeneous)


def dense(made, vertices):
    table = np.zeros((vertices, made.joint_count))
    row = np.repeat(np.arange(vertices), np.diff(made.offsets))
    table[row, made.joints] = made.weights
    return table


def distances(made, rest, frames):
    return np.linalg.norm(posed(rest, dense(made, len(rest)), made.poses) - frames, axis=2)


def soft(positions, joints, width=4.0):
    """Weights along x, smooth, with at most three influences."""
    places = np.linspace(0, np.ptp(positions[:, 0]), joints)
    weights = np.maximum(0, 1 - np.abs(positions[:, :1] - places) / (1.2 * (places[1] - places[0]))) ** 2
    return weights / weights.sum(1, keepdims=True)


def clip(random, joints=4, frames=12, columns=40):
    """(positions, face_offsets, face_vertices, weights, matrices, frames): a sheet that linear skinning moves."""
    positions, offsets, faces = grid(columns)
    weights = soft(positions, joints)
    matrices = rigid(random, frames, joints)
    return positions, offsets, faces, weights, matrices, posed(positions, weights, matrices)


def check_laws(made, vertices, most):
    counts = np.diff(made.offsets)
    assert counts.min() >= 1 and counts.max() <= most
    assert made.weights.min() > 0
    sums = np.add.reduceat(made.weights.astype(float), made.offsets[:-1])
    assert np.abs(sums - 1).max() < 1e-6
    assert made.joints.min() >= 0 and made.joints.max() < made.joint_count
    inside = np.diff(made.joints) <= 0
    assert set(np.flatnonzero(inside) + 1) <= set(made.offsets[1:-1].tolist()), "joints ascend at each vertex"
    turn = made.poses[..., :3, :3]
    assert np.abs(turn @ np.swapaxes(turn, -1, -2) - np.eye(3)).max() < 1e-9
    assert np.linalg.det(turn).min() > 0
    assert (made.poses[..., 3, :] == (0, 0, 0, 1)).all()


def test_errors_are_those_of_linear_skinning(random):
    positions, offsets, faces, weights, matrices, frames = clip(random)
    frames = frames + 0.1 * random.normal(size=frames.shape)
    made = sinew.decompose(positions, frames, offsets, faces, bones=3, max_influences=3, iterations=5)
    check_laws(made, len(positions), 3)
    off = distances(made, positions, frames)
    assert made.rms == pytest.approx(np.sqrt((off**2).mean()), rel=1e-4)
    assert made.mean == pytest.approx(off.mean(), rel=1e-4)
    assert made.largest == pytest.approx(off.max(), rel=1e-4)
    assert made.vertex_rms == pytest.approx(np.sqrt((off**2).mean(0)), rel=1e-4)
    assert made.vertex_largest == pytest.approx(off.max(0), rel=1e-4)


def test_a_rigid_clip_needs_one_joint_and_leaves_no_error(random):
    positions, offsets, faces = grid(20)
    frames = posed(positions, np.ones((len(positions), 1)), rigid(random, 7, 1, size=2))
    made = sinew.decompose(positions, frames, offsets, faces, bones=6)
    assert made.joint_count == 1
    assert made.largest < 1e-5
    assert (np.diff(made.offsets) == 1).all()


def test_rigid_parts_are_found(random):
    """Three sheets, each with a motion of its own, need three joints."""
    sheet, sheet_offsets, sheet_faces = grid(8)
    positions = np.concatenate([sheet + (0, 0, 6 * part) for part in range(3)])
    faces = np.concatenate([sheet_faces + part * len(sheet) for part in range(3)])
    weights = np.repeat(np.eye(3), len(sheet), axis=0)
    frames = posed(positions, weights, rigid(random, 9, 3))
    made = sinew.decompose(positions, frames, np.arange(0, len(faces) + 1, 4), faces, bones=3)
    assert made.joint_count == 3 and made.largest < 1e-4
    assert made.rms < 1e-5


def test_a_synthetic_rig_is_recovered(random):
    positions, offsets, faces, weights, matrices, frames = clip(random)
    alone = sinew.decompose(positions, frames, offsets, faces, bones=4, iterations=1, tolerance=0)
    made = sinew.decompose(positions, frames, offsets, faces, bones=4, iterations=200, tolerance=0, smoothing=1e-6)
    check_laws(made, len(positions), 8)
    assert made.rms < 0.1 * alone.rms
    assert made.rms < 2e-2 * np.sqrt(((frames - positions) ** 2).sum(2).mean())


@pytest.mark.parametrize("kind", ("rigid", "affine"))
def test_weights_for_known_motions(random, kind):
    positions, offsets, faces, weights, matrices, _ = clip(random)
    if kind == "affine":
        matrices[..., :3, :3] += 0.2 * random.normal(size=matrices[..., :3, :3].shape)
    frames = posed(positions, weights, matrices)
    made = sinew.decompose(positions, frames, offsets, faces, matrices=matrices, smoothing=0)
    assert dense(made, len(positions)) == pytest.approx(weights, abs=1e-4)
    assert made.largest < 1e-3
    assert (made.poses == matrices).all()


def least_squares(rest, matrices, target, most):
    """Weights of one vertex, at most so many: the best of all supports. Twice as many digits, and no cleverness."""
    from itertools import combinations

    columns = (matrices[:, :, :3] @ np.append(rest, 1)).transpose(0, 2, 1).reshape(-1, matrices.shape[1])
    best = np.inf
    for count in range(1, most + 1):
        for support in combinations(range(matrices.shape[1]), count):
            own = columns[:, support]
            system = np.block([[own.T @ own, np.ones((count, 1))], [np.ones((1, count)), np.zeros((1, 1))]])
            solution = np.linalg.lstsq(system, np.append(own.T @ target.reshape(-1), 1), rcond=None)[0][:count]
            if solution.min() > -1e-12:
                best = min(best, ((own @ solution - target.reshape(-1)) ** 2).sum())
    return best


@pytest.mark.parametrize("most", (5, 2))
def test_weights_are_the_best_of_all_supports(random, most):
    """With every influence allowed exactly; with fewer, where they are left out one by one, nearly."""
    positions = random.normal(size=(30, 3))
    matrices = rigid(random, 6, 5, far=0.5)
    frames = random.normal(size=(6, 30, 3))
    frames = 0.7 * posed(positions, random.dirichlet(np.ones(5), 30), matrices) + 0.3 * frames
    made = sinew.decompose(
        positions, frames, NO_FACES, NO_FACES, matrices=matrices, smoothing=0, max_influences=most, iterations=1
    )
    squares = (distances(made, positions, frames) ** 2).sum(0)
    best = np.array([least_squares(positions[v], matrices, frames[:, v], most) for v in range(30)])
    assert (squares > best * (1 - 1e-5)).all()
    if most == 5:
        assert squares == pytest.approx(best, rel=1e-4)
    else:
        assert np.mean(squares < best * (1 + 1e-4)) > 0.7
        assert squares.sum() < 1.1 * best.sum()


@pytest.mark.parametrize("kind", ("table", "skin"))
def test_motions_for_known_weights(random, kind):
    positions, offsets, faces, weights, matrices, frames = clip(random)
    given = weights if kind == "table" else sinew.Skin.from_dense(positions, weights)
    made = sinew.decompose(positions, frames, offsets, faces, weights=given, iterations=400, tolerance=0)
    assert made.rms < 2e-3
    assert dense(made, len(positions)) == pytest.approx(weights, abs=1e-7)
    assert made.poses[..., :3, :3] == pytest.approx(matrices[..., :3, :3], abs=0.02)


@pytest.mark.parametrize("place", (0, 20))
def test_other_sums_of_given_weights_count_as_skinning_counts_them(random, place):
    """Where the weights do not sum to 1, the error is that of what skinning gives, wherever the mesh is."""
    positions, offsets, faces, weights, _, frames = clip(random)
    positions, frames = positions + place, frames + place
    weights = weights * random.uniform(0.9, 1.1, (len(weights), 1))
    made = sinew.decompose(positions, frames, offsets, faces, weights=weights)
    skin = sinew.Skin.from_dense(positions, weights)
    off = np.linalg.norm(sinew.skin_linear(skin, made.poses.astype(np.float32)) - frames, axis=2)
    assert made.rms == pytest.approx(np.sqrt((off**2).mean()), rel=1e-3)
    assert made.mean == pytest.approx(off.mean(), rel=1e-3)
    assert made.largest == pytest.approx(off.max(), rel=1e-3)


def test_many_joints_are_tried_at_every_vertex(random):
    """Of more joints than frames could tell apart, few remain, and they fit."""
    positions, frames = random.normal(size=(40, 3)), random.normal(size=(4, 40, 3))
    matrices = rigid(random, 4, 120, far=1.0)
    made = sinew.decompose(
        positions, frames, np.zeros(0, int), np.zeros(0, int), matrices=matrices, max_influences=4, iterations=2
    )
    assert np.diff(made.offsets).max() <= 4
    alone = np.einsum("fjab,vb->fjva", matrices, np.concatenate((positions, np.ones((40, 1))), 1))[..., :3]
    best = np.linalg.norm(alone - frames[:, None], axis=3) ** 2
    assert (made.vertex_rms <= np.sqrt(best.mean(axis=0).min(axis=0)) + 1e-4).all()


def test_joints_that_lose_their_points_begin_anew():
    """On the way one loses all of them, and would be missing at the end."""
    random = np.random.default_rng(6)
    clip(random, joints=6), random.normal(size=(12, 360, 3))  # as it was found
    positions, offsets, faces, _, _, frames = clip(random, joints=12)
    made = sinew.decompose(positions, frames, offsets, faces, bones=30, max_influences=1, iterations=12, tolerance=0)
    assert made.joint_count == 30 and made.rms < 0.9


def test_heads_begin_where_they_are(random):
    positions, offsets, faces, weights, matrices, frames = clip(random)
    heads = np.stack((np.linspace(0, 39, 4), np.full(4, 4.0), np.zeros(4)), 1)
    made = sinew.decompose(positions, frames, offsets, faces, heads=heads)
    assert made.joint_count == 4
    assert (made.rest[:, :3, 3] == heads).all()
    heaviest = dense(made, len(positions)).argmax(1)
    for joint in range(4):
        assert np.abs(positions[heaviest == joint, 0].mean() - heads[joint, 0]) < 8


def test_smoothing_makes_weights_smooth(random):
    positions, offsets, faces, weights, _, _ = clip(random)
    matrices = rigid(random, 12, 4, size=0.05, far=0.3)
    frames = posed(positions, weights, matrices) + 0.3 * random.normal(size=(12, len(positions), 3))

    def roughness(smoothing):
        made = sinew.decompose(positions, frames, offsets, faces, matrices=matrices, smoothing=smoothing)
        table = dense(made, len(positions)).reshape(40, 9, 4)
        return np.square(np.diff(table, axis=0)).sum() + np.square(np.diff(table, axis=1)).sum()

    assert roughness(1e-1) < 0.5 * roughness(0)


def test_seams_stay_closed(random):
    """Vertices that coincide and move alike have equal weights, in whatever order they are."""
    positions, offsets, faces, weights, matrices, frames = clip(random)
    frames = frames + 0.1 * random.normal(size=frames.shape)
    apart = sinew.decompose(
        positions[faces], frames[:, faces], np.arange(0, len(faces) + 1, 4), np.arange(len(faces)), bones=4
    )
    table = dense(apart, len(faces))
    for vertex in range(0, len(positions), 7):
        own = table[faces == vertex]
        assert (own == own[0]).all()
    whole = sinew.decompose(positions, frames, offsets, faces, bones=4)
    assert apart.rms == pytest.approx(whole.rms, rel=0.2)


@pytest.mark.parametrize("known", ("bones", "heads", "matrices", "weights"))
def test_threads_give_the_same_bits(random, known):
    positions, offsets, faces, weights, matrices, frames = clip(random, columns=90)
    frames = frames + 0.05 * random.normal(size=frames.shape)
    start = {"bones": 6, "heads": positions[::100], "matrices": matrices, "weights": weights}[known]
    results = []
    for threads in (1, 2, 3, 0):
        sinew.set_thread_count(threads)
        results.append(sinew.decompose(positions, frames, offsets, faces, iterations=6, **{known: start}))
    for other in results[1:]:
        for name in ARRAYS:
            assert getattr(other, name).tobytes() == getattr(results[0], name).tobytes(), name


@pytest.mark.parametrize("scale, place", ((1e-3, 0), (1e3, 0), (1, 1e4)))
def test_units_and_places_do_not_matter(random, scale, place):
    positions, offsets, faces, weights, matrices, frames = clip(random)
    frames = frames + 0.1 * random.normal(size=frames.shape)
    first = sinew.decompose(positions, frames, offsets, faces, bones=4, iterations=4)
    other = sinew.decompose(scale * positions + place, scale * frames + place, offsets, faces, bones=4, iterations=4)
    assert other.rms / scale == pytest.approx(first.rms, rel=0.05)


def test_more_influences_never_fit_worse(random):
    positions, offsets, faces, weights, matrices, frames = clip(random, joints=6)
    errors = [
        sinew.decompose(positions, frames, offsets, faces, matrices=matrices, smoothing=0, max_influences=most).rms
        for most in (1, 2, 3, 6)
    ]
    assert all(later <= earlier + 1e-5 for earlier, later in zip(errors, errors[1:]))
    assert errors[0] > 10 * errors[-1]


def test_without_local_the_error_is_smaller(random):
    positions, offsets, faces = grid(60)
    x = positions[:, 0]
    phase = np.linspace(0, 6, 16)[:, None]
    wave = np.stack((0 * (x + phase), 0 * (x + phase), 4 * np.sin(x / 9 + phase)), 2)
    frames = positions + wave
    near = sinew.decompose(positions, frames, offsets, faces, bones=8)
    anywhere = sinew.decompose(positions, frames, offsets, faces, bones=8, local=False)
    assert anywhere.rms < near.rms


@pytest.mark.parametrize(
    "vertices, frame_count, bones", ((1, 1, 1), (1, 5, 3), (2, 1, 4), (3, 1, 2), (4, 6, 10), (30, 1, 3))
)
def test_little_meshes(random, vertices, frame_count, bones):
    """Fewer vertices than bones, one frame, no faces: what is found is sane."""
    positions = random.normal(size=(vertices, 3))
    frames = random.normal(size=(frame_count, vertices, 3))
    made = sinew.decompose(positions, frames, NO_FACES, NO_FACES, bones=bones)
    check_laws(made, vertices, 8)
    assert 1 <= made.joint_count <= min(bones, vertices)
    assert np.isfinite(made.largest)
    if vertices <= bones:
        assert made.largest < 1e-5


@pytest.mark.parametrize("faces", ([0, 0, 0], [0, 1, 1]), ids=("one vertex", "two vertices"))
def test_faces_without_area(random, faces):
    positions = random.normal(size=(3, 3))
    made = sinew.decompose(positions, positions[None] + 1, np.array([0, 3]), np.array(faces), bones=2)
    assert made.largest < 1e-5 and made.joint_count == 1


def test_all_vertices_in_one_place(random):
    positions = np.full((6, 3), 4.0)
    still = sinew.decompose(positions, np.full((3, 6, 3), 5.0), NO_FACES, NO_FACES, bones=3)
    assert still.joint_count == 1 and still.largest < 1e-5
    burst = sinew.decompose(positions, random.normal(size=(3, 6, 3)), NO_FACES, NO_FACES, bones=6)
    assert np.isfinite(burst.largest)
    check_laws(burst, 6, 8)


def test_joints_that_do_the_same_share(random):
    """Equal matrices leave the weights undetermined: any that fit will do."""
    positions, offsets, faces = grid(10)
    matrices = np.repeat(rigid(random, 5, 1), 3, axis=1)
    frames = posed(positions, np.full((len(positions), 3), 1 / 3), matrices)
    made = sinew.decompose(positions, frames, offsets, faces, matrices=matrices)
    assert made.largest < 1e-4
    assert made.joint_count == 3


def calls():
    positions, offsets, faces = grid(4, 3)
    frames = np.repeat(positions[None], 3, axis=0)
    many = {"rest": positions, "frames": frames, "face_offsets": offsets, "face_vertices": faces, "bones": 2}
    broken, flat = frames.copy(), positions.copy()
    broken[1, 5, 2] = np.nan
    flat[7, 0] = np.inf
    eyes = np.tile(np.eye(4), (3, 2, 1, 1))
    spoilt = eyes.copy()
    spoilt[2, 1, 0, 3] = np.nan
    table = np.ones((12, 2))
    negative = table.copy()
    negative[4, 1] = -0.5
    empty = table.copy()
    empty[3] = 0

    def case(message, **changes):
        return pytest.param({**many, **changes}, message, id=message[:40])

    yield case("frames is not finite in frame 1 at vertex 5", frames=broken)
    yield case("rest is not finite at vertex 7", rest=flat)
    yield case("frames has 11 vertices in each frame, rest has 12", frames=frames[:, :11])
    yield case(r"frames has shape \(12, 3\); expected \(F, V, 3\)", frames=positions)
    yield case("frames has no frames", frames=frames[:0])
    yield case("rest has no vertices", rest=positions[:0], frames=frames[:, :0])
    yield case("face_vertices names vertex 99; the mesh has 12 vertices", face_vertices=np.full(len(faces), 99))
    yield case("face_offsets goes from 0 to 4", face_offsets=offsets[:2])
    yield case("nothing is known; expected bones, heads, matrices or weights", bones=0)
    yield case("bones is -1; expected one at least", bones=-1)
    yield case("bones is 5000; expected 1 to 2,048", bones=5000)
    yield case("bones and heads exclude each other", heads=np.zeros((2, 3)))
    yield case("bones, matrices and weights exclude each other", matrices=eyes)
    yield case("bones, matrices and weights exclude each other", weights=table)
    yield case("matrices is not finite in frame 2 at joint 1", bones=0, matrices=spoilt)
    yield case("matrices has 2 frames, frames has 3", bones=0, matrices=eyes[:2])
    yield case("matrices has no joints", bones=0, matrices=eyes[:, :0])
    yield case("heads has 1 joint, matrices 2 joints", bones=0, matrices=eyes, heads=np.zeros((1, 3)))
    yield case("heads has 3 joints, weights 2 joints", bones=0, weights=table, heads=np.zeros((3, 3)))
    yield case("heads is not finite at joint 0", bones=0, heads=np.full((1, 3), np.nan))
    yield case("weights is -0.5 at vertex 4, bone 1; expected 0 or more", bones=0, weights=negative)
    yield case("weights has none above 0 at vertex 3", bones=0, weights=empty)
    yield case("weights has 11 rows; rest has 12 vertices", bones=0, weights=table[:11])
    yield case("max_influences is 0; expected 1 to 64", max_influences=0)
    yield case("iterations is 0; expected 1 to 10,000", iterations=0)
    yield case("smoothing is nan; expected 0 to 1", smoothing=float("nan"))
    yield case("tolerance is 2; expected 0 to 1", tolerance=2.0)


@pytest.mark.parametrize("arguments, message", calls())
def test_mistakes_are_explained(arguments, message):
    with pytest.raises(ValueError, match=message):
        sinew.decompose(**arguments)


def test_float32_and_float64_frames_give_the_same(random):
    positions, offsets, faces, weights, matrices, frames = clip(random)
    single = frames.astype(np.float32)
    a = sinew.decompose(positions, single, offsets, faces, bones=3, iterations=3)
    b = sinew.decompose(positions, single.astype(float), offsets, faces, bones=3, iterations=3)
    assert a.poses.tobytes() == b.poses.tobytes()


def test_progress_and_cancelling(random):
    positions, offsets, faces, weights, matrices, frames = clip(random)
    progress = sinew.Progress()
    assert sinew.decompose(positions, frames, offsets, faces, bones=3, tolerance=0, progress=progress).iterations == 30
    assert progress.fraction == 1
    progress = sinew.Progress()
    progress.cancel()
    for start in ({"bones": 3}, {"matrices": matrices}, {"weights": weights}):
        assert sinew.decompose(positions, frames, offsets, faces, progress=progress, **start) is None


INTERRUPTED = """
import os, signal, sys, threading, time
sys.path[:0] = sys.argv[1:3]
import numpy as np, sinew_native as sinew
from test_decompose import clip

signal.signal(signal.SIGINT, signal.default_int_handler)
positions, offsets, faces, _, _, frames = clip(np.random.default_rng(1), columns=300)
progress = sinew.Progress()

def interrupt():
    while progress.fraction == 0:
        time.sleep(0.001)
    os.kill(os.getpid(), signal.SIGINT)

threading.Thread(target=interrupt, daemon=True).start()
try:
    sinew.decompose(positions, frames, offsets, faces, bones=12, iterations=10000, tolerance=0, progress=progress)
except KeyboardInterrupt:
    print(progress.fraction, progress.is_cancelled)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there Python's os.kill ends the process")
def test_ctrl_c_cancels():
    folders = [str(Path(sinew.__file__).parent), str(Path(__file__).parent)]
    done = subprocess.run([sys.executable, "-c", INTERRUPTED, *folders], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    fraction, is_cancelled = done.stdout.split()
    assert is_cancelled == "True" and float(fraction) < 0.9


def test_what_is_found_plays_in_skin_linear(random):
    positions, offsets, faces, weights, matrices, frames = clip(random)
    made = sinew.decompose(positions, frames, offsets, faces, bones=4)
    skin = sinew.Skin(positions, made.offsets, made.joints, made.weights, made.joint_count)
    played = sinew.skin_linear(skin, made.poses.astype(np.float32))
    off = np.linalg.norm(played - frames, axis=2)
    assert np.sqrt((off**2).mean()) == pytest.approx(made.rms, rel=1e-3, abs=1e-4)
