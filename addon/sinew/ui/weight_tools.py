"""Operators that transfer, smooth and mirror weights."""

import math
from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from ..blender import meshes
from ..feedback import notice
from ..weights import editing, transferring
from . import available
from .in_background import InBackground
from .weights import masked

AXES = ("X", "Y", "Z")


class TransferWeights(available.Explains, InBackground, bpy.types.Operator):
    """Copy the weights of the active mesh to the other selected meshes, as from a body to clothes: from the closest
    points of its surface where these are near and face the same way, elsewhere the smoothest weights that fit. Locked
    vertex groups and groups of other bones stay"""

    bl_idname = "object.sinew_transfer_weights"
    bl_label = "Transfer Weights (Sinew)"
    computing = "copying weights"

    distance: FloatProperty(
        name="Distance",
        description="How far the closest point may be for a vertex to be matched, as a share of the size of the target",
        default=0.05,
        min=0.0001,
        soft_max=0.5,
        max=10.0,
        precision=3,
    )
    angle: FloatProperty(
        name="Angle",
        description="The largest angle between the surfaces there",
        default=math.radians(30),
        min=0.0,
        max=math.pi,
        subtype="ANGLE",
    )
    flipped: BoolProperty(
        name="Flipped Normals",
        description="Also match surfaces that face the opposite way, such as linings",
        default=False,
    )
    selected_to_active: BoolProperty(
        name="Selected to Active",
        description="Copy the other way: from all other selected meshes to the active one",
        default=False,
    )
    add_modifier: BoolProperty(
        name="Add Armature Modifier",
        description="Parent targets that belong to no armature to that of the source, with an Armature modifier",
        default=True,
    )
    preview: BoolProperty(
        name="Preview",
        description="Change no weights, but show in Edit Mode the vertices that are matched: they are selected",
        default=False,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def why_not(cls, context):
        return available.other_mode(context, "OBJECT") or available.no_mesh(context.active_object)

    def assignment(self, context):
        active = context.active_object
        others = [ob for ob in context.selected_objects if ob.type == "MESH" and ob != active]
        context.view_layer.update()
        settings = transferring.Settings(self.distance, min(math.degrees(self.angle), 180.0), self.flipped)
        both = (others, [active]) if self.selected_to_active else ([active], others)
        return transferring.Transfer(*both, settings, self.add_modifier and not self.preview)

    def finish(self, context, made):
        report = made.report() if self.preview else made.write()
        if self.preview:
            for ob, matched in zip(made.targets, made.matched):
                meshes.select_vertices(ob.data, matched)
            show_in_edit_mode(context, made.targets)
        self.report({"WARNING"} if report.unweighted else {"INFO"}, report.sentence())
        notice.redraw()
        return {"FINISHED"}


def show_in_edit_mode(context: bpy.types.Context, objects: Sequence[bpy.types.Object]) -> None:
    """Shows the selected vertices of those of the mesh objects that are visible."""
    shown = [ob for ob in objects if ob.visible_get()]
    if not shown:
        return
    for ob in context.selected_objects:
        ob.select_set(ob in shown)
    context.view_layer.objects.active = shown[0]
    context.tool_settings.mesh_select_mode = (True, False, False)
    bpy.ops.object.mode_set(mode="EDIT")


class EditsWeights(available.Explains, InBackground):
    """What the operators for the active mesh have in common. Each defines `edit(ob, free)`, which returns an
    editing.Edit."""

    @classmethod
    def why_not(cls, context):
        return available.other_mode(context, "OBJECT", "PAINT_WEIGHT") or available.no_mesh(context.active_object)

    def assignment(self: Any, context):
        ob = context.active_object
        return self.edit(ob, masked(ob.data) if context.mode == "PAINT_WEIGHT" else None)

    def edit(self, ob: bpy.types.Object, free: np.ndarray | None) -> editing.Edit:
        raise NotImplementedError

    def finish(self: Any, _context, made):
        self.report({"INFO"}, made.write().sentence())
        notice.redraw()
        return {"FINISHED"}


class SmoothWeights(EditsWeights, bpy.types.Operator):
    """Smooth the weights of all bones at once, along the edges of faces. With a vertex or face mask, only the selected
    vertices change. Locked vertex groups and groups of other bones stay"""

    bl_idname = "object.sinew_smooth_weights"
    bl_label = "Smooth (Sinew)"
    computing = "smoothing weights"

    steps: IntProperty(
        name="Steps",
        description="How many times each vertex goes towards the mean of its neighbors",
        default=5,
        min=1,
        soft_max=50,
        max=10000,
    )
    factor: FloatProperty(
        name="Factor", description="How far each step goes", default=0.5, min=0.0, max=1.0, subtype="FACTOR"
    )
    strength: FloatProperty(
        name="Strength",
        description="Above 0: smooth in one solve instead of steps. It reaches about so many edges as the square root "
        "of this number",
        default=0.0,
        min=0.0,
        soft_max=1000.0,
        max=1e6,
    )

    def edit(self, ob, free):
        return editing.Smoothing(ob, editing.SmoothSettings(self.steps, self.factor, self.strength), free)


class MirrorWeights(EditsWeights, bpy.types.Operator):
    """Copy the weights of one side to the other, by the closest points of the mirrored surface, so that both sides may
    have different vertices. Bones change places with those of the other side, which are found by their names, or by
    their rest positions. With a vertex or face mask, only the selected vertices change. Locked vertex groups and groups
    of other bones stay"""

    bl_idname = "object.sinew_mirror_weights"
    bl_label = "Mirror (Sinew)"
    computing = "mirroring weights"

    axis: EnumProperty(
        name="Axis",
        description="The axis of the object that the sides are on. The mirror is at its origin",
        items=tuple((axis, axis, f"Left and right along {axis}") for axis in AXES),
    )
    direction: EnumProperty(
        name="Direction",
        description="Which side is copied",
        items=(
            ("POSITIVE", "Positive to Negative", "From the positive side of the axis, which is a character's left"),
            ("NEGATIVE", "Negative to Positive", "From the negative side of the axis"),
        ),
    )

    def edit(self, ob, free):
        settings = editing.MirrorSettings(AXES.index(self.axis), self.direction == "POSITIVE")
        return editing.Mirroring(ob, settings, free)


# --- menus ----------------------------------------------------------------------------------------


def draw_object(menu: Any, _context: bpy.types.Context) -> None:
    menu.layout.separator()
    menu.layout.operator_context = "INVOKE_DEFAULT"
    menu.layout.operator(TransferWeights.bl_idname)


def draw_paint(menu: Any, _context: bpy.types.Context) -> None:
    menu.layout.separator()
    menu.layout.operator_context = "INVOKE_DEFAULT"
    for operator in (SmoothWeights, MirrorWeights):
        menu.layout.operator(operator.bl_idname)


CLASSES = (TransferWeights, SmoothWeights, MirrorWeights)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
