"""Sinew's own skinning methods in the panel: their settings, the state of their precomputed data, and their painted
maps."""

import bpy
from bpy.props import EnumProperty

from ..chain import methods
from ..feedback import notice
from ..install import precomputing
from . import available

SETTINGS = {
    methods.BLENDED: (),
    methods.CENTERS: ("sigma",),
    methods.MUSH: ("smoothing", "weight_smoothing", "blend", "iterations", "laplacian", "variant"),
}
MAPS = (
    ("share_group", "Share", "The share of dual quaternion skinning in the method Blended"),
    ("smooth_group", "Smooth", "Where and how much the shape is smoothed"),
)
NAMES = {"share_group": "Dual Quaternion", "smooth_group": "Smooth"}  # names of new vertex groups
LACKS = {
    methods.ABSENT: "It has not been computed yet: until then, {fallback} deforms the mesh",
    methods.STALE: "Weights, rest shape or settings have changed since it was computed: compute it again",
    methods.UNFIT: "It was computed for other bones or vertices: until you compute it again, {fallback} deforms it",
}


def draw(layout: bpy.types.UILayout, context: bpy.types.Context, ob: bpy.types.Object) -> None:
    """Draws the settings of the method of a bound mesh with an armature."""
    skinning, kind = ob.sinew.skinning, ob.sinew.own_method
    if kind == methods.BLENDED:
        _draw_map(layout, ob, "share_group", "share_invert")
        if not skinning.share_group:
            layout.prop(skinning, "share", text="Share")
    for name in SETTINGS.get(kind, ()):
        layout.prop(skinning, name)
    if kind in methods.PRECOMPUTED:
        _draw_state(layout, context, ob)
    if kind in methods.OWN:
        layout.label(text=f"Without Sinew: {fallback(ob)}", icon="INFO")


def fallback(ob: bpy.types.Object) -> str:
    return "Preserve Volume" if ob.sinew.modifier.use_deform_preserve_volume else "linear skinning"


def _draw_state(layout, context, ob):
    job, lacks = precomputing.job_of(ob), precomputing.lacks(ob)
    if job is not None:
        text = f"Computing, {100 * job.progress.fraction:.0f} %"
        if hasattr(layout, "progress"):
            layout.progress(text=text, factor=job.progress.fraction)
        else:  # before 4.0
            layout.label(text=text, icon="SORTTIME")
        layout.operator(CancelMethod.bl_idname, icon="X")
    elif lacks:
        box = layout.box().column(align=True)
        notice.draw_sentence(box, context, LACKS[lacks].format(fallback=fallback(ob)), lacks != methods.STALE)
        box.operator(PrepareMethod.bl_idname, icon="FILE_REFRESH")


def draw_smoothing(layout: bpy.types.UILayout, ob: bpy.types.Object) -> None:
    skinning = ob.sinew.skinning
    layout.prop(skinning, "smooth_iterations")
    if skinning.smooth_iterations:
        layout.prop(skinning, "smooth_factor")
        _draw_map(layout, ob, "smooth_group", "smooth_invert")


def _draw_map(layout, ob, group, invert):
    row = layout.row(align=True)
    row.prop_search(ob.sinew.skinning, group, ob, "vertex_groups")
    row.prop(ob.sinew.skinning, invert, text="", icon="ARROW_LEFTRIGHT")
    row.operator(PaintMap.bl_idname, text="", icon="BRUSH_DATA").map = group


class _OfBoundMesh(available.Explains):
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def why_not(cls, context):
        ob = context.active_object
        return available.unbound(ob) or (available.linked(ob) if ob.library is not None else "")


class PrepareMethod(_OfBoundMesh, bpy.types.Operator):
    """Compute the data that the skinning method of this mesh needs, from its current weights and rest shape. You can
    go on using Blender in the meantime"""

    bl_idname = "object.sinew_prepare_method"
    bl_label = "Compute Skinning Data"

    def run(self, context):
        precomputing.start(context.active_object)


class CancelMethod(_OfBoundMesh, bpy.types.Operator):
    """Stop the computation; the mesh keeps the data that it has"""

    bl_idname = "object.sinew_cancel_method"
    bl_label = "Cancel Computation"
    bl_options = {"REGISTER"}

    @classmethod
    def why_not(cls, context):
        ob = context.active_object
        return super().why_not(context) or ("" if precomputing.job_of(ob) else f"Nothing is computed for {ob.name}")

    def run(self, context):
        precomputing.cancel(context.active_object)


class PaintMap(_OfBoundMesh, bpy.types.Operator):
    """Paint this map in Weight Paint mode. If it has no vertex group, one is added"""

    bl_idname = "object.sinew_paint_map"
    bl_label = "Paint Skinning Map"

    map: EnumProperty(name="Map", items=MAPS)

    def run(self, context):
        ob = context.active_object
        skinning = ob.sinew.skinning
        group = ob.vertex_groups.get(getattr(skinning, self.map))
        if group is None:
            if ob.mode != "OBJECT":
                bpy.ops.object.mode_set(mode="OBJECT")
            group = ob.vertex_groups.new(name=NAMES[self.map])
            group.add(range(len(ob.data.vertices)), skinning.share if self.map == "share_group" else 1.0, "REPLACE")
            setattr(skinning, self.map, group.name)
        ob.vertex_groups.active_index = group.index
        bpy.ops.object.mode_set(mode="WEIGHT_PAINT")


CLASSES = (PrepareMethod, CancelMethod, PaintMap)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
