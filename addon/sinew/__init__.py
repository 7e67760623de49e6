"""Sinew: skeletal deformation with a native core. This file is the list of its modules."""

import importlib

bl_info = {  # for Blender 3.4; later versions read blender_manifest.toml
    "name": "Sinew",
    "author": "The Sinew authors",
    "version": (0, 0, 0),  # set from the manifest when the zip is made
    "blender": (3, 4, 1),
    "location": "View3D > Sidebar > Sinew; File > Import > Sinew Rig",
    "description": "Fast skeletal deformation with a native core",
    "category": "Animation",
}


def _modules():
    """Returns the modules in the order in which they are registered."""
    from . import native

    if native.VERSION != ".".join(map(str, bl_info["version"])):  # that of an older one, which is still loaded
        native = importlib.reload(native)  # it says that Blender has to be restarted
    if native.sinew_native is None:
        from . import without_native

        return (without_native,)
    from .cli import command_line
    from .main import handlers, memory_use, properties, write_lock
    from .onion import ghost_handlers
    from .played import frame_handlers
    from .ui import (
        bake,
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
        rig_cures,
        rig_files,
        to_bones,
        weight_tools,
        weights,
    )

    return (
        properties,
        preferences,
        memory_use,
        rig_files,
        rig_cures,
        operators,
        bake,
        to_bones,
        crowd,
        cures,
        method_settings,
        weights,
        weight_tools,
        display,
        menus,
        panels,
        played_rigs,
        onion_skins,
        profile,
        write_lock,
        handlers,
        frame_handlers,
        ghost_handlers,
        command_line,
    )


MODULES = _modules()


def register():
    for module in MODULES:
        module.register()


def unregister():
    for module in reversed(MODULES):
        module.unregister()
