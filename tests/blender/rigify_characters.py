"""Characters that Rigify generates."""

import ctypes

import addon_utils
import bpy
import pytest

HUMAN = "armature_human_metarig_add"


def enable_rigify():
    if addon_utils.enable("rigify", default_set=True) is None:
        pytest.skip("this Blender has no Rigify")


def generate():
    """Generates the rig of the active metarig. Returns it."""
    bpy.ops.pose.rigify_generate()
    # In Blender 4.3 the scene owns bpy.context from then on. The scene is freed with its file, and the next script that
    # sets bpy.context.window.scene, as Blender's glTF exporter does, reads what was freed, and may crash.
    if bpy.context.id_data is not None:
        ctypes.c_void_p.from_address(id(bpy.context) + object.__basicsize__).value = None
    assert bpy.context.id_data is None
    return bpy.context.object


def character(metarig):
    """Returns a new character: metarig is an operator that adds bones to generate one from."""
    enable_rigify()
    getattr(bpy.ops.object, metarig)()
    return generate()
