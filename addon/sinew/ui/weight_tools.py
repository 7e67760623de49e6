"""Operators that transfer, smooth and mirror weights."""

from typing import Any

import bpy
import numpy as np
from bpy.props import BoolProperty

from ..blender import meshes, selection
from ..feedback import notice
from ..weights import editing, transferring
from ..weights.weight_settings import MirrorSettings, SmoothSettings, TransferSettings
from . import available, option_properties
from .in_background import InBackground


@option_properties.added(TransferSettings)
class TransferWeights(available.Explains, InBackground, bpy.types.Operator):
    """Copy the weights of the active mesh to the other selected meshes, as from a body to clothes: from the closest
    points of its surface where these are near and face the same way, elsewhere the smoothest weights that fit. Locked
    vertex groups and groups of other bones stay"""

    bl_idname = "object.sinew_transfer_weights"
    bl_label = "Transfer Weights (Sinew)"
    computing = "copying weights"

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
        settings = option_properties.read(self, TransferSettings)
        both = (others, [active]) if self.selected_to_active else ([active], others)
        return transferring.Transfer(*both, settings, self.add_modifier and not self.preview)

    def finish(self, context, made):
        report = made.report() if self.preview else made.write()
        if self.preview:
            for ob, matched in zip(made.targets, made.matched):
                meshes.select_vertices(ob.data, matched)
            selection.show_vertices(context, made.targets)
        self.report({"WARNING"} if report.unweighted else {"INFO"}, report.sentence())
        notice.redraw()


class EditsWeights(available.Explains, InBackground):
    """What the operators for the active mesh have in common. Each defines `edit(ob, free)`, which returns an
    editing.Edit."""

    @classmethod
    def why_not(cls, context):
        return available.other_mode(context, "OBJECT", "PAINT_WEIGHT") or available.no_mesh(context.active_object)

    def assignment(self: Any, context):
        ob = context.active_object
        return self.edit(ob, selection.masked(ob.data) if context.mode == "PAINT_WEIGHT" else None)

    def edit(self, ob: bpy.types.Object, free: np.ndarray | None) -> editing.Edit:
        raise NotImplementedError

    def finish(self: Any, _context, made):
        self.report({"INFO"}, made.write().sentence())
        notice.redraw()


@option_properties.added(SmoothSettings)
class SmoothWeights(EditsWeights, bpy.types.Operator):
    """Smooth the weights of all bones at once, along the edges of faces. With a vertex or face mask, only the selected
    vertices change. Locked vertex groups and groups of other bones stay"""

    bl_idname = "object.sinew_smooth_weights"
    bl_label = "Smooth (Sinew)"
    computing = "smoothing weights"

    def edit(self, ob, free):
        return editing.Smoothing(ob, option_properties.read(self, SmoothSettings), free)


@option_properties.added(MirrorSettings)
class MirrorWeights(EditsWeights, bpy.types.Operator):
    """Copy the weights of one side to the other, by the closest points of the mirrored surface, so that both sides may
    have different vertices. Bones change places with those of the other side, which are found by their names, or by
    their rest positions. With a vertex or face mask, only the selected vertices change. Locked vertex groups and groups
    of other bones stay"""

    bl_idname = "object.sinew_mirror_weights"
    bl_label = "Mirror (Sinew)"
    computing = "mirroring weights"

    def edit(self, ob, free):
        return editing.Mirroring(ob, option_properties.read(self, MirrorSettings), free)


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
