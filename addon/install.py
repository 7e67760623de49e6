"""Permanently installs and enables the add-on's zip in the Blender that runs this script.

blender -b --python-exit-code 1 --python addon/install.py -- ZIP
"""

import sys

import bpy

zip_path = sys.argv[sys.argv.index("--") + 1]
if bpy.app.version >= (4, 2, 0):
    bpy.ops.extensions.package_install_files(filepath=zip_path, repo="user_default", enable_on_install=True)
    module = "bl_ext.user_default.sinew"
else:
    bpy.ops.preferences.addon_install(filepath=zip_path, overwrite=True)
    module = "sinew"
    bpy.ops.preferences.addon_enable(module=module)
bpy.ops.wm.save_userpref()
if module not in bpy.context.preferences.addons or not hasattr(bpy.types.Object, "sinew"):
    sys.exit(f"the add-on {module} did not start")
print(f"installed {module}")
