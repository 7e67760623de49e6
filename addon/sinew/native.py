"""The only import of the compiled module: `sinew_native`, or None and a sentence that says why."""

import platform
import sys
from pathlib import Path

from . import bl_info

PYTHON = f"{sys.version_info.major}.{sys.version_info.minor}"
HERE = f"Python {PYTHON} on {platform.system()} {platform.machine()}"
VERSION = ".".join(map(str, bl_info["version"]))


def problem_of_import(error, files):
    """Why the module could not be had, for people. files: names of those in this package."""
    versions = [
        f"{name.split('cpython-')[1][0]}.{name.split('cpython-')[1][1:].split('-')[0]}"
        for name in sorted(files)
        if "cpython-" in name
    ]
    if PYTHON in versions and platform.system() == "Linux":
        return f"Sinew's native library for {HERE} does not load: {error}"
    return (
        f"Sinew has no native library for {HERE}; this package has those for "
        f"Python {', '.join(versions) or '(none)'} on Linux x86_64"
    )


def _load():
    """(module or None, problem)"""
    try:
        from . import sinew_native as module
    except ImportError as error:
        files = [path.name for path in Path(__file__).parent.glob("sinew_native.*")]
        return None, problem_of_import(error, files)
    if module.__version__ != VERSION:
        return None, (
            f"Sinew {VERSION} was installed over {module.__version__}, whose native library is "
            "still at work: restart Blender"
        )
    return module, ""


sinew_native, problem = _load()
