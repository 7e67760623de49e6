import bpy
import pytest


@pytest.fixture(autouse=True)
def fresh_scene():
    """Every test starts in an empty file, with the add-on enabled."""
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    scene.frame_set(1)
    return scene
