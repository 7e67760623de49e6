"""Sinew: skeletal deformation with a native core. This file is the list of its modules."""

bl_info = {  # for Blender 3.4; later versions read blender_manifest.toml
    "name": "Sinew",
    "author": "The Sinew authors",
    "version": (0, 0, 0),  # set from the manifest when the zip is made
    "blender": (3, 4, 0),
    "location": "View3D > Sidebar > Sinew; File > Import > Sinew rig",
    "description": "Fast skeletal deformation with a native core",
    "category": "Animation",
}

from . import native  # noqa: E402

if native.sinew_native is None:
    # Nothing can work without it: say so in one sentence instead of failing feature by feature.
    def register():
        raise RuntimeError(native.problem)

    def unregister():
        pass
else:
    from . import handlers, operators, panels, properties

    MODULES = (properties, operators, panels, handlers)

    def register():
        for module in MODULES:
            module.register()

    def unregister():
        for module in reversed(MODULES):
            module.unregister()
