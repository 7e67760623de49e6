"""Runs the Python module `bpy` as if it were the program: `-b ... --python FILE -- arguments`, `--version`.

The module does not read the profile's preferences by itself, so they are read here, which starts the add-ons
that are enabled there.
"""

import os
import runpy
import sys

import bpy

arguments = sys.argv[1 : sys.argv.index("--")] if "--" in sys.argv else sys.argv[1:]
if "--version" in arguments:
    print(f"Blender {bpy.app.version_string} (Python module)")
    sys.exit()
if os.path.exists(os.path.join(bpy.utils.user_resource("CONFIG"), "userpref.blend")):
    bpy.ops.wm.read_userpref()
script = arguments[arguments.index("--python") + 1]
runpy.run_path(script, run_name="__main__")
