"""Ctrl C ends a long computation before it is done."""

import subprocess
import sys
from pathlib import Path

import pytest
import sinew_native

CODE = """
import os, signal, sys, threading, time
sys.path.insert(0, sys.argv[1])
import numpy as np, sinew_native as sinew

signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in a shell's background ignores it
sinew.set_thread_count(1)
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

def interrupt():
    while progress.fraction == 0:
        time.sleep(0.001)
    os.kill(os.getpid(), signal.SIGINT)

threading.Thread(target=interrupt, daemon=True).start()
try:
    getattr(sinew, sys.argv[2]).compute(skin, face_offsets, faces, progress=progress)
except KeyboardInterrupt:
    print(progress.fraction, progress.is_cancelled)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there Python's os.kill ends the process")
@pytest.mark.parametrize("kind", ("DirectDeltaMush", "RotationCenters"))
def test_ctrl_c_ends_a_computation(kind):
    """How far it has come is counted, not the time: without ears for signals it would be at the end."""
    folder = str(Path(sinew_native.__file__).parent)
    done = subprocess.run([sys.executable, "-c", CODE, folder, kind], capture_output=True, text=True, check=True)
    fraction, is_cancelled = done.stdout.split()
    assert is_cancelled == "True" and float(fraction) < 0.9
