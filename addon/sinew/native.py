"""The only place that imports the compiled module: `sinew_native`, or None and a sentence that says why."""

import platform
import re
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

from . import bl_info

PYTHON = f"{sys.version_info.major}.{sys.version_info.minor}"
HERE = f"Python {PYTHON} on {platform.system()} {platform.machine()}"
VERSION = ".".join(map(str, bl_info["version"]))


def problem_of_import(error, files):
    """Returns why the module could not be loaded, for users. files: names of the compiled files in this package."""
    if any(f"sinew_native{suffix}" in files for suffix in EXTENSION_SUFFIXES):
        return f"Sinew's native library for {HERE} does not load: {error}"
    # cpython-311-x86_64-linux-gnu, cpython-311-darwin, cp311-win_amd64; in a wheel's name cp311-cp311-win_amd64
    made_for = [re.search(r"[.-]c(?:python-|p)3(\d+)-(?:cp\d+-)?([\w-]+)\.", name) for name in sorted(files)]
    there = ", ".join(f"Python 3.{found[1]} ({found[2]})" for found in made_for if found)
    return f"Sinew has no native library for {HERE}; this package has {f'those for {there}' if there else 'none'}"


def _load():
    """Returns (module or None, problem). The module is in this folder, or in one of the wheels in it, of which Blender
    has installed the one for its Python."""
    folder = Path(__file__).parent
    files = [path.name for path in folder.glob("sinew_native.*")]
    wheels = [path.name for path in folder.glob("wheels/sinew_native-*.whl")]
    try:
        if wheels and not files:
            import sinew_native as module
        else:
            from . import sinew_native as module
    except ImportError as error:
        return None, problem_of_import(error, files or wheels)
    if module.__version__ != VERSION:
        return None, (
            f"Sinew {VERSION} was installed over {module.__version__}, whose native library is "
            "still loaded: restart Blender"
        )
    return module, ""


sinew_native, problem = _load()
