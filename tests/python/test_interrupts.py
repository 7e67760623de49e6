"""A long computation ends before it is done: by Ctrl C, or because the process ends."""

import subprocess
import sys
import time
from pathlib import Path

import pytest
import sinew_native

LONG = """
import os, signal, sys, threading, time
sys.path.insert(0, sys.argv[1])
import numpy as np, sinew_native as sinew

sinew.set_thread_count(int(sys.argv[3]))
SIDE, JOINTS = 500, 40
x, y = (axis.reshape(-1) for axis in np.mgrid[:SIDE, :SIDE])
corner = (np.arange(SIDE - 1)[:, None] * SIDE + np.arange(SIDE - 1)).reshape(-1)
faces = (corner[:, None] + (0, 1, SIDE + 1, SIDE)).reshape(-1)
face_offsets = np.arange(0, len(faces) + 1, 4)
place = x / SIDE * (JOINTS - 1.001)
joints = np.stack((place.astype(int), place.astype(int) + 1), 1)
weights = np.stack((1 - place % 1, place % 1), 1)
skin = sinew.Skin(np.stack((x, y, 0 * x), 1), np.arange(0, 2 * SIDE**2 + 1, 2), joints.reshape(-1),
                  weights.reshape(-1), JOINTS)
progress = sinew.Progress()
if sys.argv[2] == "automatic_weights":
    heads = np.array([(SIDE * j / JOINTS, SIDE / 2, 0) for j in range(JOINTS)])

    def compute(skin, face_offsets, faces, progress):
        positions = skin.rest_positions
        sinew.automatic_weights(positions, face_offsets, faces, heads, heads + (10, 0, 0), progress=progress)
else:
    compute = getattr(sinew, sys.argv[2]).compute
"""

INTERRUPTED = """
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in a shell's background ignores it

def interrupt():
    while progress.fraction == 0:
        time.sleep(0.001)
    os.kill(os.getpid(), signal.SIGINT)

threading.Thread(target=interrupt, daemon=True).start()
try:
    compute(skin, face_offsets, faces, progress=progress)
except KeyboardInterrupt:
    print(progress.fraction, progress.is_cancelled)
"""

ENDED = """
threading.Thread(target=compute, args=(skin, face_offsets, faces), kwargs={"progress": progress}, daemon=True).start()
while progress.fraction == 0:
    time.sleep(0.001)
print("at work", progress.fraction < 1, flush=True)
"""


# At the end, when Python is gone, the process waits until its standard input is closed.
ENDED_SLOWLY = f"""
import ctypes
libc = ctypes.CDLL(None)
libc.__cxa_atexit(libc.getchar, None, None)
{ENDED}
sys.exit(3)
"""


def command(code, kind, threads):
    return [sys.executable, "-c", LONG + code, str(Path(sinew_native.__file__).parent), kind, str(threads)]


def run(code, kind, threads):
    return subprocess.run(command(code, kind, threads), capture_output=True, text=True, timeout=300)


@pytest.mark.skipif(sys.platform == "win32", reason="there Python's os.kill ends the process")
@pytest.mark.parametrize("kind", ("DirectDeltaMush", "RotationCenters", "automatic_weights"))
def test_ctrl_c_ends_a_computation(kind):
    """How far it has come is counted, not the time: without ears for signals it would be at the end."""
    done = run(INTERRUPTED, kind, 1)
    assert done.returncode == 0, done.stderr
    fraction, is_cancelled = done.stdout.split()
    assert is_cancelled == "True" and float(fraction) < 0.9


@pytest.mark.parametrize("threads", (1, 4))
@pytest.mark.parametrize("ending", ("sys.exit(3)", "os._exit(3)"))
def test_a_process_ends_in_the_middle_of_a_computation(ending, threads):
    """On Windows the module's own ending runs while nobody may load a library, and its threads are gone by then."""
    done = run(ENDED + ending, "DirectDeltaMush", threads)
    assert (done.stdout.split(), done.returncode) == (["at", "work", "True"], 3), done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="what runs at the end of a process is given to glibc")
@pytest.mark.parametrize("seconds", (0.5, 4), ids=("before the computation", "after the computation"))
def test_python_ends_before_the_process_does(seconds):
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    with subprocess.Popen(command(ENDED_SLOWLY, "DirectDeltaMush", 2), text=True, **pipes) as process:
        assert process.stdout.readline().split() == ["at", "work", "True"]
        time.sleep(seconds)
        assert process.poll() is None, process.stderr.read()
        errors = process.communicate(timeout=300)[1]
    assert process.returncode == 3, errors
