"""Runs the Python module `bpy` as if it were the program: `-b ... --python FILE -- arguments`, `--python-expr TEXT`,
`--version`.

The module does not read the profile's preferences, and reading them crashes 4.2, which then renews the icons of a
window. The extensions that are installed in the profile are enabled here instead.

The process ends at once when the script is done: 4.2 crashes now and then as Python takes the module apart.
"""

import os
import runpy
import sys
import traceback

import bpy


def enable_extensions():
    import addon_utils  # which bpy brings

    for addon in addon_utils.modules():
        if addon.__name__.startswith("bl_ext."):
            bpy.ops.preferences.addon_enable(module=addon.__name__)


def run(arguments):
    enable_extensions()
    if "--python-expr" in arguments:
        exec(arguments[arguments.index("--python-expr") + 1], {"__name__": "__main__"})
    else:
        runpy.run_path(arguments[arguments.index("--python") + 1], run_name="__main__")


os.environ["AS_BLENDER"] = os.path.abspath(__file__)  # for scripts that start another
arguments = sys.argv[1 : sys.argv.index("--")] if "--" in sys.argv else sys.argv[1:]
if "--version" in arguments:
    print(f"Blender {bpy.app.version_string} (Python module)")
else:
    code = 0
    try:
        run(arguments)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
        if code and not isinstance(end.code, int):
            print(end.code, file=sys.stderr)
    except BaseException:
        traceback.print_exc()
        code = 1
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
