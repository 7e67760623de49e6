"""What nobody should pass to a binding is refused in a short sentence, and never ends Python. SINEW_SPOILT_CALLS says
how many calls are tried."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("resource")

import spoilt_calls

COUNT = int(os.environ.get("SINEW_SPOILT_CALLS", 2000))
PROGRAM = Path(__file__).with_name("spoilt_calls.py")
# Calls without arguments, which nothing can be spoilt of.
WITHOUT_ARGUMENTS = {
    "instruction_set",
    "instruction_sets",
    "thread_count",
    "rig_bone_settings",
    "rig_constraint_settings",
}
WITHOUT_ARGUMENTS |= {"Progress.__init__", "Progress.cancel", "DirectDeltaMush.arrays", "WeightTable.dense"}


def test_every_binding_is_called(tmp_path):
    of_host, _kept = spoilt_calls.host_calls()
    calls = spoilt_calls.valid() | spoilt_calls.more_calls(tmp_path) | of_host
    assert set(spoilt_calls.members()) - calls.keys() == WITHOUT_ARGUMENTS


def test_spoilt_calls(tmp_path):
    wrong, first, file = [], 0, tmp_path / "number"
    while first < COUNT and len(wrong) < 20:
        command = [sys.executable, PROGRAM, file, str(first), str(COUNT - first)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        wrong += done.stdout.splitlines()
        first = int(file.read_bytes()) + 1
        if done.returncode:
            wrong.append(f"{first - 1} ended Python: {done.returncode} {done.stderr[-2000:]}")
    assert not wrong, "\n".join(wrong)
