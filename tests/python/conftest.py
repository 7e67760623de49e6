"""The compiled module without Blender: from SINEW_BUILD, or <repository>/build."""

import os
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(Path(os.environ.get("SINEW_BUILD", ROOT / "build")).resolve() / "python"))

import sinew_native  # noqa: E402


@pytest.fixture(autouse=True)
def keep_thread_count():
    yield
    sinew_native.set_thread_count(0)
