"""Threads of the library and threads of Python."""

import sys
import threading

import numpy as np
import pytest
import sinew_native as sinew

import rigs
from test_skeleton import said

SKELETON, _, _ = rigs.skeleton(np.random.default_rng(1), 60)
SKIN, _, _ = rigs.dense_skin(np.random.default_rng(2), 20000, 60)
MUSH = sinew.DirectDeltaMush.compute(SKIN, np.array([0]), np.array([], int))
POSE = rigs.random_matrices(np.random.default_rng(3), 4, 60, dtype=np.float32)
CLIP = np.repeat(POSE, 200, axis=0)

CALLS = {
    "forward_kinematics": lambda: sinew.forward_kinematics(SKELETON, CLIP),
    "skinning_matrices": lambda: sinew.skinning_matrices(SKELETON, CLIP),
    "skin_linear": lambda: sinew.skin_linear(SKIN, POSE),
    "skin_dual_quaternion": lambda: sinew.skin_dual_quaternion(SKIN, POSE),
    "skin_direct_delta_mush": lambda: sinew.skin_direct_delta_mush(MUSH, POSE),
}
V = 20000
OFFSETS, JOINTS, WEIGHTS = SKIN.offsets, SKIN.joints, SKIN.weights
SHAPE, GROUP = np.ones((V, 3), np.float32), np.ones(V, np.float32)
EDGES = np.stack((np.arange(V - 1), np.arange(1, V)), 1).astype(np.int32)
TOPOLOGY = sinew.Topology(V, EDGES)
# What reads arrays of the mesh's size: within an evaluation other threads have to go on.
MAKERS = {
    "Skin": lambda: sinew.Skin(SHAPE, OFFSETS, JOINTS, WEIGHTS, 60),
    "Skin.from_dense": lambda: sinew.Skin.from_dense(SHAPE, DENSE),
    "Skin.set_rest_positions": lambda: OTHER_SKIN.set_rest_positions(SHAPE),
    "group_influences": lambda: sinew.group_influences(OFFSETS, JOINTS, WEIGHTS, ONES),
    "Layer": lambda: sinew.Layer(SKIN, "linear", mask=GROUP),
    "ShapeKeys": lambda: sinew.ShapeKeys([SHAPE, SHAPE], [0, 0]),
    "Topology": lambda: sinew.Topology(V, EDGES),
    "Smooth": lambda: sinew.Smooth(TOPOLOGY, GROUP),
    "CorrectiveSmooth": lambda: sinew.CorrectiveSmooth(TOPOLOGY, SHAPE),
    "Hook": lambda: sinew.Hook(V, weights=GROUP),
    "Lattice": lambda: sinew.Lattice(V, GROUP),
    "MeshDeform": lambda: sinew.MeshDeform(3 * np.arange(V + 1), TRIPLES, THIRDS, SHAPE, GROUP),
    "SurfaceDeform": lambda: sinew.SurfaceDeform(V, **BINDING, weights=GROUP),
    "Bends": lambda: sinew.Bends(NUMBERS, OFFSETS, JOINTS, WEIGHTS, ONES, ONES, AXES),
    "BlendShares": lambda: sinew.BlendShares(GROUP),
    "RotationCenters": lambda: sinew.RotationCenters(SHAPE, HAS_CENTER),
    "DirectDeltaMush": lambda: sinew.DirectDeltaMush.from_arrays(SKIN, **MUSH_ARRAYS),
}
DENSE, ONES = np.full((V, 4), 0.25), np.ones(60, np.int32)
NUMBERS, HAS_CENTER, AXES = np.arange(V), np.ones(V, bool), np.zeros((60, 4))
TRIPLES, THIRDS = np.repeat(NUMBERS % 100, 3), np.full(3 * V, 1 / 3)
BINDING = {
    "vertices": NUMBERS,
    "offsets": np.arange(V + 1),
    "attachments": np.zeros(V, int),
    "corner_offsets": 3 * np.arange(V + 1),
    "corners": TRIPLES,
    "corner_weights": THIRDS,
    "distances": GROUP,
    "influences": GROUP,
}
OTHER_SKIN = sinew.Skin(SHAPE, OFFSETS, JOINTS, WEIGHTS, 60)
MUSH_ARRAYS = MUSH.arrays()
every_call = pytest.mark.parametrize("call", CALLS.values(), ids=CALLS.keys())


def test_thread_count():
    sinew.set_thread_count(0)
    machine = sinew.thread_count()
    assert machine >= 1
    for count in (1, 2, 1024):
        sinew.set_thread_count(count)
        assert sinew.thread_count() == min(count, machine)
    assert said(sinew.set_thread_count, -1) == "the thread count is -1; expected 0 (all) or a positive number"
    assert sinew.thread_count() == machine


@every_call
def test_any_number_of_threads_gives_the_same_bits(call):
    sinew.set_thread_count(1)
    one = call().tobytes()
    for count in (2, 3, 8):
        sinew.set_thread_count(count)
        assert call().tobytes() == one


@every_call
def test_python_threads_may_call_at_once(call):
    expected = call().tobytes()
    results = []
    threads = [threading.Thread(target=lambda: results.append(call().tobytes())) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == [expected] * 6


@pytest.fixture(scope="module")
def file_calls(tmp_path_factory):
    """Readers and writers of files that take a while."""
    folder = tmp_path_factory.mktemp("files")
    heads = np.random.default_rng(4).normal(size=(3000, 3))
    skeleton = sinew.RigSkeleton(np.arange(-1, 2999), heads, heads, np.maximum(-np.arange(3000), -1))
    rig = sinew.Rig(np.zeros((30000, 3)), np.array([0]), np.array([], int), skeleton, np.ones((30000, 1)))
    dmat, bf, bvh, table = folder / "a.dmat", folder / "a.bf", folder / "a.bvh", np.zeros((1000, 100))
    names = [f"joint{j}" for j in range(3000)]
    turns = np.tile([1.0, 0, 0, 0], (9, 3000, 1))
    clip = sinew.BvhClip(names, np.arange(-1, 2999), heads, 0.04, np.tile(heads, (9, 1, 1)), turns)
    calls = {
        "write_dmat": lambda: sinew.write_dmat(dmat, table),
        "read_dmat": lambda: sinew.read_dmat(dmat),
        "write_skeleton": lambda: sinew.write_skeleton(bf, skeleton),
        "read_skeleton": lambda: sinew.read_skeleton(bf),
        "write_bvh": lambda: sinew.write_bvh(bvh, clip),
        "read_bvh": lambda: sinew.read_bvh(bvh),
        "write_rig": lambda: sinew.write_rig(folder, rig),
        "read_rig": lambda: sinew.read_rig(folder),
    }
    for write in "write_dmat", "write_skeleton", "write_bvh", "write_rig":
        calls[write]()
    return calls


@pytest.mark.parametrize(
    "name", [f"{act}_{kind}" for act in ("write", "read") for kind in ("dmat", "skeleton", "bvh", "rig")]
)
def test_files_are_read_and_written_without_the_gil(file_calls, name):
    assert_runs_beside(file_calls[name])


@every_call
def test_the_gil_is_released(call):
    assert_runs_beside(call)


@pytest.mark.parametrize("name", MAKERS)
def test_objects_are_made_without_the_gil(name):
    assert_runs_beside(MAKERS[name])


def assert_runs_beside(call):
    """Another Python thread runs while the library computes. With a switch interval this long it gets
    its turn only when somebody lets go of the GIL, which nothing but the call does here."""
    gate, ran = threading.Lock(), []
    gate.acquire()

    def wait_and_run():
        with gate:
            ran.append(True)

    other = threading.Thread(target=wait_and_run)
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1000)
    try:
        other.start()
        gate.release()
        assert not ran
        for _ in range(5000):  # the system may be slow to wake the other thread
            call()
            if ran:
                break
        assert ran
    finally:
        sys.setswitchinterval(interval)
        other.join()
