"""The compiled module without Blender: from SINEW_BUILD, or <repository>/build; the installed one where SINEW_BUILD
is empty."""

import os
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
if build := os.environ.get("SINEW_BUILD", ROOT / "build"):
    sys.path.insert(0, str(Path(build).resolve() / "python"))
sys.path.append(str(ROOT / "tests/blender"))  # what of it needs no Blender


@pytest.fixture(autouse=True)
def keep_thread_count():
    import sinew_native

    yield
    sinew_native.set_thread_count(0)
