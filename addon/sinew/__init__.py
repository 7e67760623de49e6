"""Sinew: skeletal deformation with a native core. This file is the list of its modules."""

import sys

bl_info = {  # for Blender 3.4; later versions read blender_manifest.toml
    "name": "Sinew",
    "author": "The Sinew authors",
    "version": (0, 0, 0),  # set from the manifest when the zip is made
    "blender": (3, 4, 1),
    "location": "View3D > Sidebar > Sinew; File > Import > Sinew Rig",
    "description": "Fast skeletal deformation with a native core",
    "category": "Animation",
}


def _forget_older_version():
    """Unloads the modules of an older version that this one was installed over. The compiled module stays, since it
    cannot be loaded twice."""
    for name in [name for name in sys.modules if name.startswith(f"{__name__}.")]:
        if not name.endswith(".sinew_native"):
            del sys.modules[name]
            globals().pop(name.rpartition(".")[2], None)


def _modules():
    """Returns the modules in the order in which they are registered."""
    from . import native

    if native.sinew_native is None:
        from . import without_native

        return (without_native,)
    from .cli import command_line
    from .main import handlers, properties, write_lock
    from .onion import ghost_handlers
    from .played import frame_handlers
    from .ui import (
        bake,
        bone_lines,
        crowd,
        cures,
        display,
        menus,
        method_settings,
        onion_skins,
        operators,
        panels,
        played_rigs,
        preferences,
        profile,
        recorded_frames,
        rig_files,
        rig_line,
        to_bones,
        weight_reduction,
        weight_tools,
        weights,
    )

    return (
        properties,
        preferences,
        rig_files,
        rig_line,
        operators,
        bake,
        to_bones,
        crowd,
        cures,
        method_settings,
        weights,
        weight_tools,
        weight_reduction,
        bone_lines,
        display,
        menus,
        panels,
        played_rigs,
        onion_skins,
        recorded_frames,
        profile,
        write_lock,
        handlers,
        frame_handlers,
        ghost_handlers,
        command_line,
    )


_forget_older_version()
MODULES = _modules()


def register():
    for module in MODULES:
        module.register()


def unregister():
    for module in reversed(MODULES):
        module.unregister()
