"""Operators that show weights as colours, the skeleton in front, and the lines that bones stand for when weights are
made."""

import colorsys
from collections.abc import Sequence
from typing import Any

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..blender import meshes
from ..blender.drawn import Drawn
from ..feedback import notice
from ..plan import bindable
from ..weights import assigning, bone_segments
from ..weights.weight_settings import AutomaticSettings
from . import available, option_properties

COLORS = "Sinew Weights"  # the colour attribute that exists while weights are shown
BEFORE = "sinew_shown_before"  # custom property of the mesh: what the 3D views showed before
UNWEIGHTED = (0.02, 0.02, 0.02)
GOLDEN = 0.618034  # step of the hue: neighbours in the list of groups get very different colours
LINE_COLOR = (1.0, 0.55, 0.1, 1.0)
_ends = bone_segments.AUTOMATIC


def weight_colors(offsets: np.ndarray, groups: np.ndarray, weights: np.ndarray, group_count: int) -> np.ndarray:
    """Returns (V, 4) float32: the groups' colours mixed by the weights, which need not sum to 1. offsets, groups and
    weights are as `meshes.read_weights` returns them."""
    palette = np.array(
        [
            colorsys.hsv_to_rgb(i * GOLDEN % 1, 0.75 if i % 2 else 0.9, 0.85 if i % 3 else 0.6)
            for i in range(group_count)
        ]
    ).reshape(-1, 3)
    vertex = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    used = groups >= 0
    colors = np.zeros((len(offsets) - 1, 3))
    sums = np.bincount(vertex[used], weights[used], minlength=len(colors))
    for channel in range(3):
        colors[:, channel] = np.bincount(
            vertex[used], weights[used] * palette[groups[used], channel], minlength=len(colors)
        )
    weighted = sums > 0
    colors[weighted] /= sums[weighted, None]
    colors[~weighted] = UNWEIGHTED
    return np.column_stack((colors, np.ones(len(colors)))).astype(np.float32)


def are_weights_shown(ob: bpy.types.Object) -> bool:
    return COLORS in ob.data.attributes


def show_weights(ob: bpy.types.Object, views: Sequence[Any]) -> None:
    """Writes the weights into a colour attribute of the mesh, and makes the views (View3D spaces) show it."""
    mesh = ob.data
    colors = mesh.color_attributes
    before = {"color": colors.active_color.name if colors.active_color else ""}
    if views:
        before["color_type"], before["type"] = views[0].shading.color_type, views[0].shading.type
    mesh[BEFORE] = before
    attribute = colors.new(COLORS, "FLOAT_COLOR", "POINT")
    attribute.data.foreach_set("color", weight_colors(*_entries_of_bones(ob), len(ob.vertex_groups)).reshape(-1))
    colors.active_color = colors[COLORS]
    for view in views:
        view.shading.type, view.shading.color_type = "SOLID", "VERTEX"
    mesh.update()


def hide_weights(ob: bpy.types.Object, views: Sequence[Any]) -> None:
    """Restores the views and the mesh."""
    mesh = ob.data
    mesh.color_attributes.remove(mesh.color_attributes[COLORS])
    before = mesh.get(BEFORE, {})
    if before.get("color") in mesh.color_attributes:
        mesh.color_attributes.active_color = mesh.color_attributes[before["color"]]
    for view in views:
        view.shading.color_type = before.get("color_type", "MATERIAL")
        view.shading.type = before.get("type", view.shading.type)
    if BEFORE in mesh:
        del mesh[BEFORE]
    mesh.update()


def _entries_of_bones(ob: bpy.types.Object) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns the weights in groups of deforming bones, or all weights if no armature is known."""
    offsets, groups, weights = meshes.read_object_weights(ob)
    armature = bindable.find_armature(ob)
    if armature is not None:
        bones = armature.data.bones
        deforming = np.array(
            [group.name in bones and bones[group.name].use_deform for group in ob.vertex_groups] + [False]
        )
        groups = np.where(deforming[groups], groups, -1)
    return offsets, groups, weights


def is_skeleton_shown(armature: bpy.types.Object) -> bool:
    return armature.visible_get() and armature.show_in_front


def show_skeleton(context: bpy.types.Context, armature: bpy.types.Object) -> None:
    """Makes the armature visible, whatever hides it, and draws it in front of its meshes."""
    armature.hide_viewport = False
    armature.show_in_front = True
    if armature.name not in context.view_layer.objects:
        _include(context.view_layer.layer_collection, armature)
    if armature.name not in context.view_layer.objects:
        context.scene.collection.objects.link(armature)
    armature.hide_set(False)
    if not armature.visible_get():
        _include(context.view_layer.layer_collection, armature)


def _include(layer_collection, armature):
    """Shows the collections that contain the armature. Returns whether this one does, directly or not."""
    found = armature.name in layer_collection.collection.objects
    for child in layer_collection.children:
        found |= _include(child, armature)
    if found:
        layer_collection.exclude = layer_collection.hide_viewport = False
        layer_collection.collection.hide_viewport = False
    return found


class ToggleWeights(available.Explains, bpy.types.Operator):
    """Show the weights of all bones at once, one color per bone, in the solid shading of the 3D views; press again to
    restore the views"""

    bl_idname = "object.sinew_show_weights"
    bl_label = "Weight Colors"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def why_not(cls, context):
        ob = context.active_object
        why = available.no_mesh(ob) or ("Leave Edit Mode" if ob.mode == "EDIT" else "")
        return why or ("" if len(ob.vertex_groups) else f"{ob.name} has no vertex groups")

    def run(self, context):
        ob = context.active_object
        areas = context.screen.areas if context.screen else ()
        views = [area.spaces.active for area in areas if area.type == "VIEW_3D"]
        if are_weights_shown(ob):
            hide_weights(ob, views)
        else:
            show_weights(ob, views)


class ToggleSkeleton(available.Explains, bpy.types.Operator):
    """Show the armature in front of its meshes, wherever it was hidden; press again to hide it. It deforms them the
    same way, hidden or not"""

    bl_idname = "object.sinew_show_skeleton"
    bl_label = "Skeleton"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def why_not(cls, context):
        ob = context.active_object
        return no_armature(ob) or ("" if ob.mode == "OBJECT" else "Switch to Object Mode")

    def run(self, context):
        armature = armature_of(context.active_object)
        if is_skeleton_shown(armature):
            armature.hide_set(True)
        else:
            show_skeleton(context, armature)


def armature_of(ob: bpy.types.Object) -> bpy.types.Object | None:
    return ob if ob.type == "ARMATURE" else bindable.find_armature(ob)


def no_armature(ob: bpy.types.Object | None) -> str:
    """Returns what to do unless an active object is an armature or a mesh that has one."""
    if ob is None or ob.type not in {"MESH", "ARMATURE"}:
        return "Select an armature, or a mesh that one moves"
    return "" if armature_of(ob) is not None else f"{ob.name} has no armature"


def lines(armature: bpy.types.Object, ends: str) -> np.ndarray:
    """Returns (2 S, 3) float32: both ends of the line of each deforming bone at rest, one after the other, world
    space."""
    bones = assigning.read_bones(armature)
    segments = bone_segments.choose(bones, np.flatnonzero(bones.deform), ends)
    return np.stack((segments.heads, segments.tails), 1).reshape(-1, 3).astype(np.float32)


def _draw_lines():
    ob = bpy.context.active_object
    armature = armature_of(ob) if ob is not None and ob.type in {"MESH", "ARMATURE"} else None
    if armature is None or armature.data.is_editmode:
        return
    shader = gpu.shader.from_builtin("3D_UNIFORM_COLOR" if bpy.app.version < (4, 0, 0) else "UNIFORM_COLOR")
    batch = batch_for_shader(shader, "LINES", {"pos": lines(armature, _ends)})
    gpu.state.line_width_set(3.0)
    shader.uniform_float("color", LINE_COLOR)
    batch.draw(shader)
    gpu.state.line_width_set(1.0)


_lines = Drawn(bpy.types.SpaceView3D, _draw_lines)


def are_lines_shown() -> bool:
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
        is_same = are_lines_shown() and _ends == self.ends
        _lines.hide()
        if not is_same:
            _ends = self.ends
            _lines.show()
        notice.redraw()


def draw_bone_lines(layout: bpy.types.UILayout) -> None:
    """Draws the button."""
    layout.operator(ToggleBoneLines.bl_idname, icon="CONSTRAINT_BONE", depress=are_lines_shown())


CLASSES = (ToggleWeights, ToggleSkeleton, ToggleBoneLines)
register, _unregister = bpy.utils.register_classes_factory(CLASSES)


def unregister() -> None:
    _lines.hide()
    _unregister()
