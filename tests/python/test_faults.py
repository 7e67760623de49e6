"""What the machine does to a rig folder's files and to memory: an error in one sentence, nothing lost."""

import functools
import os
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import sinew_native

resource = pytest.importorskip("resource")
SANITIZED = "libasan" in os.environ.get("LD_PRELOAD", "")


def rig(vertices, height):
    """A rod of two bones; its files are as long as it has vertices, and tell which one it is by its height."""
    joints = np.array([(0, 0, 0), (0, height / 2, 0), (0, height, 0)])
    skeleton = sinew_native.RigSkeleton(np.array([-1, 0]), joints[:2], joints[1:], np.array([0, 1]))
    positions = np.column_stack((np.zeros(vertices), np.linspace(0, height, vertices), np.zeros(vertices)))
    weights = np.column_stack((np.linspace(1, 0, vertices), np.linspace(0, 1, vertices)))
    poses = sinew_native.PoseClip(np.tile((1.0, 0, 0, 0), (height, 2, 1)))
    return sinew_native.Rig(positions, np.array([0, 3]), np.arange(3), skeleton, weights, poses)


def contents(folder):
    return {path.name: path.read_bytes() for path in Path(folder).iterdir()}


def python(code, *arguments):
    """What another Python prints that has the module as `sinew_native`."""
    start = f"import sys; sys.path[:0] = {[str(Path(sinew_native.__file__).parent), str(Path(__file__).parent)]!r}\n"
    done = subprocess.run([sys.executable, "-c", start + code, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("most_bytes", (0, 60, 2000, 20_000))
def test_a_full_disk_leaves_the_rig_that_was_there(tmp_path, most_bytes):
    sinew_native.write_rig(tmp_path, rig(5, 2))
    before = contents(tmp_path)
    code = """
import resource, signal, sinew_native, test_faults
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), -1))
try:
    sinew_native.write_rig(sys.argv[1], test_faults.rig(5000, 3))
except ValueError as error:
    print(error)
"""
    assert python(code, tmp_path, most_bytes).strip().endswith("cannot be written: File too large")
    assert contents(tmp_path) == before


def test_two_programs_write_one_rig_folder_and_a_third_reads_it(tmp_path):
    """Each file is one that somebody has written, whole; in the end nothing is left but the rig."""
    written = []
    for height in (2, 3):
        folder = tmp_path / str(height)
        folder.mkdir()
        sinew_native.write_rig(folder, rig(3000, height))
        written.append(contents(folder))
    shared = tmp_path / "shared"
    shared.mkdir()
    sinew_native.write_rig(shared, rig(3000, 2))
    code = """
import sinew_native, test_faults
for _ in range(30):
    sinew_native.write_rig(sys.argv[1], test_faults.rig(3000, int(sys.argv[2])))
"""
    with ThreadPoolExecutor() as pool:
        programs = [pool.submit(python, code, shared, height) for height in (2, 3)]
        while not all(program.done() for program in programs):
            for name in written[0]:
                assert (shared / name).read_bytes() in [one[name] for one in written]
    for program in programs:
        program.result()
    assert contents(shared).keys() == written[0].keys()


def test_a_file_that_shrinks_and_grows_while_it_is_read(tmp_path):
    path = tmp_path / "table.dmat"
    sinew_native.write_dmat(path, np.ones((1000, 20)), binary=True)
    whole = path.stat().st_size
    stop = threading.Event()

    def shrink():
        while not stop.is_set():
            os.truncate(path, whole // 3)
            os.truncate(path, whole)  # with zeros

    thread = threading.Thread(target=shrink)
    thread.start()
    try:
        for _ in range(500):
            try:
                table = sinew_native.read_dmat(path)
                assert table.shape == (1000, 20) and set(np.unique(table)) <= {0.0, 1.0}
            except ValueError as error:
                assert "cannot be read to its end" in str(error) or "ends after" in str(error)
    finally:
        stop.set()
        thread.join()
    assert sinew_native.read_dmat(path).shape == (1000, 20)  # while it changes, every attempt may be refused


MEMORY = """
import resource
import numpy as np, sinew_native
sinew_native.write_dmat(sys.argv[1], np.ones((20000, 4)), binary=True)
positions = np.random.default_rng(1).random((20000, 3), np.float32)
weights = np.full((20000, 4), 0.25)
matrices = np.tile(np.eye(4, dtype=np.float32), (60, 4, 1, 1))
parents = np.arange(-1, 3999)
shape = np.empty((60, 20000, 3), np.float32)

def skin(method=sinew_native.skin_linear):
    method(sinew_native.Skin.from_dense(positions, weights), matrices, out=shape)

edges = np.stack((np.arange(19999), np.arange(1, 20000)), 1)

def smooth():
    topology = sinew_native.Topology(20000, edges)
    stage = sinew_native.CorrectiveSmooth(topology, positions).stage()
    stage.apply(shape[0])
    sinew_native.Smooth(topology).stage().apply(shape[0])

few, faces = 400, np.array([(i, i + 1, i + 20) for i in range(380)])
def mush():
    sinew_native.DirectDeltaMush(positions[:few], np.arange(0, 1141, 3), faces.reshape(-1), weights[:few])

calls = {
    "smooth": smooth,
    "mush": mush,
    "read": lambda: sinew_native.read_dmat(sys.argv[1]),
    "write": lambda: sinew_native.write_dmat(sys.argv[1], np.ones((20000, 4)), binary=True),
    "skeleton": lambda: sinew_native.Skeleton(parents, np.tile(np.eye(4), (4000, 1, 1))),
    "skin_linear": skin,
    "skin_dual_quaternion": lambda: skin(sinew_native.skin_dual_quaternion),
}
call = calls[sys.argv[2]]
refused = 0
for step in range(24):  # from 16 kB more than there is, by halves more each time
    pages = int(open("/proc/self/statm").read().split()[0])
    most = pages * resource.getpagesize() + int(2**14 * 1.5**step)
    resource.setrlimit(resource.RLIMIT_AS, (most, -1))
    try:
        call()
        break
    except MemoryError as error:
        refused += 1
        said = str(error)
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (-1, -1))
call()
print("refused" if refused else "never refused", said if refused else "")
"""


@functools.cache
def is_memory_limited():
    """Whether this system heeds the limit of a process's memory."""
    code = "import resource; resource.setrlimit(resource.RLIMIT_AS, (2**30, -1)); bytearray(2**31)"
    return subprocess.run([sys.executable, "-c", code], capture_output=True).returncode != 0


@pytest.mark.skipif(
    SANITIZED or not os.path.exists("/proc/self/statm"), reason="the address sanitizer wants all memory"
)
@pytest.mark.parametrize("call", ("read", "write", "skeleton", "skin_linear", "skin_dual_quaternion", "smooth", "mush"))
def test_memory_that_cannot_be_had(tmp_path, call):
    """Whichever request is the first that fails: an error, and the next call with memory succeeds."""
    if not is_memory_limited():
        pytest.skip("QEMU lets every process have all memory")
    said = python(MEMORY, tmp_path / "table.dmat", call)
    assert said.startswith("refused")
    assert "not enough memory" in said or "Unable to allocate" in said  # the latter is numpy's
