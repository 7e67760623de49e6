"""Draws the lines that the bones stand for when weights are made."""

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..blender.drawn import Drawn
from ..feedback import notice
from ..weights import assigning, bone_segments
from ..weights.weight_settings import AutomaticSettings
from . import available, option_properties
from .display import armature_of, no_armature

COLOR = (1.0, 0.55, 0.1, 1.0)
_ends = bone_segments.AUTOMATIC


def lines(armature: bpy.types.Object, ends: str) -> np.ndarray:
    """Returns (2 S, 3) float32: both ends of the line of each deforming bone at rest, one after the other, world
    space."""
    bones = assigning.read_bones(armature)
    segments = bone_segments.choose(bones, np.flatnonzero(bones.deform), ends)
    return np.stack((segments.heads, segments.tails), 1).reshape(-1, 3).astype(np.float32)


def _draw():
    ob = bpy.context.active_object
    armature = armature_of(ob) if ob is not None and ob.type in {"MESH", "ARMATURE"} else None
    if armature is None or armature.data.is_editmode:
        return
    shader = gpu.shader.from_builtin("3D_UNIFORM_COLOR" if bpy.app.version < (4, 0, 0) else "UNIFORM_COLOR")
    batch = batch_for_shader(shader, "LINES", {"pos": lines(armature, _ends)})
    gpu.state.line_width_set(3.0)
    shader.uniform_float("color", COLOR)
    batch.draw(shader)
    gpu.state.line_width_set(1.0)


_lines = Drawn(bpy.types.SpaceView3D, _draw)


def are_shown() -> bool:
    return _lines.is_shown()


class ToggleBoneLines(available.Explains, bpy.types.Operator):
    """Show the lines that the bones stand for when Sinew makes weights, at rest; press again to hide them"""

    bl_idname = "object.sinew_show_bone_lines"
    bl_label = "Bone Lines"
    bl_options = {"REGISTER"}

    ends: option_properties.one(AutomaticSettings, "ends")

    @classmethod
    def why_not(cls, context):
        return no_armature(context.active_object)

    def run(self, _context):
        global _ends
        is_same = are_shown() and _ends == self.ends
        _lines.hide()
        if not is_same:
            _ends = self.ends
            _lines.show()
        notice.redraw()


def draw(layout: bpy.types.UILayout) -> None:
    """Draws the button."""
    layout.operator(ToggleBoneLines.bl_idname, icon="CONSTRAINT_BONE", depress=are_shown())


CLASSES = (ToggleBoneLines,)
register, _unregister = bpy.utils.register_classes_factory(CLASSES)


def unregister() -> None:
    _lines.hide()
    _unregister()
