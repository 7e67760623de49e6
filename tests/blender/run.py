"""Runs the tests of this folder inside Blender, on the installed add-on.

blender -b --python-exit-code 1 --python tests/blender/run.py -- [pytest arguments]
"""

import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
if not any(Path(argument.partition("::")[0]).exists() for argument in arguments):
    arguments.append(str(HERE))
code = pytest.main(["-q", "--durations=8", "-p", "no:cacheprovider", f"--rootdir={HERE}", *arguments])
sys.stdout.flush()
sys.exit(int(code))
