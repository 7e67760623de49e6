"""Blender's own exporters, which not every build has."""

import addon_utils
import bpy
import pytest


def operator(name):
    """Or None, if this Blender does not have it."""
    kind, _, name = name.partition(".")
    return getattr(getattr(bpy.ops, kind), name) if name in dir(getattr(bpy.ops, kind)) else None


def enable_exporters():
    """Enables those that Blender brings as add-ons."""
    for name in ("io_scene_gltf2", "io_scene_fbx", "io_anim_bvh"):
        if any(module.__name__ == name for module in addon_utils.modules()):
            bpy.ops.preferences.addon_enable(module=name)


def skip_without(*names, options=()):
    """Skips the test if this Blender lacks an operator, or if the first one lacks one of its options."""
    if any(operator(name) is None for name in names):
        pytest.skip("this Blender does not have that exporter")
    if not set(options).issubset(operator(names[0]).get_rna_type().properties.keys()):
        pytest.skip("this Blender's exporter does not have these options")
    if names[0] == "export_scene.gltf" and bpy.app.version < (4, 0):
        pytest.skip("this Blender's glTF add-on is older than the system's numpy, and cannot read a mesh")
