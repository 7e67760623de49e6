"""The only import of the compiled module: `sinew_native`, or None and a sentence that says why."""

import platform
import sys

try:
    from . import sinew_native
    problem = ""
except ImportError as error:
    sinew_native = None
    problem = (
        f"Sinew has no native library for Python {sys.version_info.major}.{sys.version_info.minor} "
        f"on {platform.system()} {platform.machine()} ({error})"
    )
