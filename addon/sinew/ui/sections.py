"""Draws what the panels show about an object, section by section: texts, values and buttons in a layout."""

from typing import Any

import bpy

from ..bake import mesh_cache
from ..blender import graph, modifier_types
from ..clips import clip_store, posing
from ..crowd import making
from ..feedback import notice
from ..main import memory_use, whole_frames
from ..native import sinew_native
from ..plan import bindable, survey, ways
from ..stencils import searching
from . import advice, cures, display, method_settings, rig_cures
from .bake import Bake, PlayCache, TakeOffCache
from .crowd import AddCrowd, RenewCrowd
from .operators import Bind, ClipToKeyframes, MeasureFrames, Unbind
from .rig_files import ImportRig
from .to_bones import draw_operator as draw_bake_to_bones

WAYS = {"ATTRIBUTE": "Attribute", "CANVAS": "Canvas", "KEYS": "Shape Keys", "BLENDER": "Blender's Modifier"}
CROWD_SETTINGS = ("Agents", "Lanes", "Lane Distance", "Jitter", "Seed", "Speed", "Speed Variation", "Size Variation")
NOT_PLAYED = "not played yet"  # shown instead of a time
MOST_MESHES = 10  # the largest number of an armature's meshes that is listed


def draw_main(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    ob = context.object
    if ob is not None and ob.type == "MESH" and mesh_cache.is_on(ob):
        draw_cache(layout, context, ob)
    if ob is not None and ob.type == "ARMATURE":
        draw_armature(layout, context, ob)
    elif ob is None or ob.type != "MESH":
        layout.label(text="Select a mesh or its armature", icon="INFO")
        layout.operator(ImportRig.bl_idname, icon="IMPORT")
    elif making.modifier_of(ob) is not None:
        draw_crowd(layout, ob)
    elif ob.sinew.copy_of is not None:
        layout.label(text=f"Deformed copy of {ob.sinew.copy_of.name}", icon="MESH_DATA")
        draw_hiding(layout, ob)
    elif ob.sinew.is_bound:
        draw_bound(layout, context, ob)
    else:
        draw_free(layout, context, ob)


def draw_cache(layout: bpy.types.UILayout, context: bpy.types.Context, ob: bpy.types.Object) -> None:
    """Draws the section of a mesh that plays a cache."""
    box = layout.box().column(align=True)
    cache = next((each for each in ob.modifiers if each.type in modifier_types.CACHES), None)
    sentence = "The cache is gone, and what it replaced is switched off"
    if cache is not None:
        sentence = f"{cache.name} plays a cache in place of the modifiers that were baked, which are switched off"
    notice.draw_sentence(box, context, sentence, cache is None)
    box.operator(TakeOffCache.bl_idname, icon="X")


def draw_bake_and_crowd(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    layout.operator(Bake.bl_idname, icon="FILE_CACHE")
    ob = context.object
    if ob is not None and ob.type == "MESH" and mesh_cache.is_on(ob):
        layout.operator(TakeOffCache.bl_idname, icon="X")
    else:
        layout.operator(PlayCache.bl_idname, icon="PLAY")
    draw_bake_to_bones(layout)
    layout.operator(AddCrowd.bl_idname, text="Add Crowd", icon="COMMUNITY")


def draw_crowd(layout: bpy.types.UILayout, ob: bpy.types.Object) -> None:
    modifier = making.modifier_of(ob)
    layout.label(text="A crowd", icon="COMMUNITY")
    column = layout.column()
    for name in CROWD_SETTINGS:
        column.prop(*graph.as_property(modifier, name), text=name)
    layout.operator(RenewCrowd.bl_idname, icon="FILE_REFRESH")


def draw_free(layout: bpy.types.UILayout, context: bpy.types.Context, ob: bpy.types.Object) -> None:
    modifier = bindable.armature_modifier(ob)
    if modifier is None and ways.why_idle(survey.if_bound(ob)):
        layout.label(text="Not bound", icon="UNLINKED")
        layout.operator(Bind.bl_idname, icon="LINKED")
    else:
        if modifier is not None:
            layout.label(text=f"{modifier.name} deforms it", icon="MOD_ARMATURE")
        else:
            layout.label(text="Deformed without an armature", icon="MOD_SMOOTH")
        layout.operator(Bind.bl_idname, icon="LINKED")
        for warning in advice.about_generated(ob):
            draw_warning(layout, context, warning)
    draw_display(layout, ob)


def draw_armature(layout: bpy.types.UILayout, context: bpy.types.Context, armature: bpy.types.Object) -> None:
    meshes = bindable.meshes_of(context, armature)
    bound = sum(ob.sinew.is_bound for ob in meshes)
    if any(ob.sinew.source == "CLIP" for ob in meshes):
        draw_clip(layout.box(), armature)
    if meshes:
        layout.label(text=f"{bound} of {len(meshes)} meshes bound", icon="MESH_DATA")
    else:
        layout.label(text="No mesh uses this armature", icon="INFO")
    if bound < len(meshes):
        layout.operator(Bind.bl_idname, icon="LINKED")
    if bound:
        column = layout.column()
        for ob in [ob for ob in meshes if ob.sinew.is_bound][:MOST_MESHES]:
            column.prop(ob.sinew, "method", text=ob.name)
        rig_cures.draw_rig(layout, context, armature)
        draw_unbind(layout, context)
    draw_display(layout, armature)


def draw_bound(layout: bpy.types.UILayout, context: bpy.types.Context, ob: bpy.types.Object) -> None:
    settings, warnings = ob.sinew, advice.warnings(ob)
    for warning in warnings:
        if warning.is_error:
            draw_warning(layout, context, warning)
    column = layout.column()
    for modifier in settings.modifiers[:1]:
        column.prop(modifier, "object", text="Armature")
        column.prop(settings, "source")
        column.prop(settings, "method")
        method_settings.draw(column, context, ob)
    column.prop(settings, "output")
    draw_switches(column, ob)
    armature = display.armature_of(ob)
    if armature is not None and settings.source != "CLIP":
        rig_cures.draw_rig(layout, context, armature)
    draw_display(layout, ob)
    draw_unbind(layout, context)
    for warning in warnings:
        if not warning.is_error:
            draw_warning(layout, context, warning)


def draw_unbind(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draws the Unbind button and, once it was measured, the speed of a whole frame with Sinew."""
    row = layout.split(factor=0.62, align=True)
    row.operator(Unbind.bl_idname, icon="UNLINKED")
    measured = whole_frames.last(context.scene)
    row.operator(MeasureFrames.bl_idname, text=measured.glance if measured else "Measure")


def draw_warning(layout: bpy.types.UILayout, context: bpy.types.Context, warning: advice.Advice) -> None:
    box = layout.box().column(align=True)
    notice.draw_sentence(box, context, warning.text, warning.is_error)
    row = box.row(align=True)
    for operator, text in warning.cures:
        row.operator(operator, text=text)


def draw_switches(column: bpy.types.UILayout, ob: bpy.types.Object) -> None:
    """Draws the switches that show the shape in the viewport and in renders."""
    for modifier in ob.sinew.modifiers[:1]:
        row = named_row(column, "Show").row(align=True)
        row.use_property_split = False
        row.prop(modifier, "show_viewport", text="")
        row.prop(modifier, "show_render", text="")
    copy = ob.sinew.deformed
    if copy is not None:
        draw_value(column, "Copy", copy.name)
        row = draw_hiding(column, copy)
        row.prop(ob.sinew, "show_shape", toggle=True)


def draw_hiding(layout: bpy.types.UILayout, copy: bpy.types.Object) -> bpy.types.UILayout:
    row = named_row(layout, "Show Copy").row(align=True)
    row.use_property_split = False
    row.prop(copy, "hide_viewport", text="")
    row.prop(copy, "hide_render", text="")
    return row


def draw_display(layout: bpy.types.UILayout, ob: bpy.types.Object) -> None:
    row = layout.row(align=True)
    if ob.type == "MESH":
        row.operator(display.ToggleWeights.bl_idname, icon="GROUP_VCOL", depress=display.are_weights_shown(ob))
    armature = display.armature_of(ob)
    if armature is not None:
        row.operator(
            display.ToggleSkeleton.bl_idname, icon="ARMATURE_DATA", depress=display.is_skeleton_shown(armature)
        )


# --- sections of a bound mesh ----------------------------------------------------------


def draw_clip(layout: bpy.types.UILayout, armature: bpy.types.Object) -> None:
    count = clip_store.pose_count(armature.data)
    if posing.is_damaged(armature):
        layout.label(text=f"The imported poses of {armature.name} are damaged", icon="ERROR")
    if count == 0:
        layout.label(text=f"{armature.name} has no imported poses", icon="INFO")
        return
    settings = armature.sinew_clip
    layout.label(text="1 pose" if count == 1 else f"{count} poses", icon="ARMATURE_DATA")
    layout.prop(settings, "mode")
    if settings.mode == "FACTOR":
        layout.prop(settings, "factor")
    if settings.mode in {"PLAYBACK", "SWING"}:
        layout.prop(settings, "frame_start")
    if settings.mode == "PLAYBACK":
        layout.prop(settings, "speed")
        layout.prop(settings, "loop")
    layout.operator(ClipToKeyframes.bl_idname, icon="KEYFRAME")


def draw_influence(layout: bpy.types.UILayout, ob: bpy.types.Object) -> None:
    """Draws the Armature modifiers' own settings."""
    for number, modifier in enumerate(ob.sinew.modifiers):
        if number > 0:
            layout = layout.box().column()
            layout.label(text="Mixed with", icon="MOD_ARMATURE")
            layout.prop(modifier, "object", text="Armature")
            layout.prop(modifier, "use_deform_preserve_volume")
        row = layout.row(align=True)
        row.prop_search(modifier, "vertex_group", ob, "vertex_groups", text="Mask")
        row.prop(modifier, "invert_vertex_group", text="", icon="ARROW_LEFTRIGHT")
        layout.prop(modifier, "use_vertex_groups", text="Vertex Groups")
        layout.prop(modifier, "use_bone_envelopes", text="Bone Envelopes")


def draw_chain(layout: bpy.types.UILayout, ob: bpy.types.Object, entry: Any) -> None:
    """Draws what Sinew replaces, stage by stage, and the modifier at which Blender takes over."""
    timings, column = entry.status.timings.recent(), layout.column(align=True)
    before, behind = ("Shape Keys", *entry.taken) if entry.keys is not None else entry.taken, entry.stage_names(ob)
    draw_value(column, "Pose" if entry.taken else "Settings", time_text(timings and timings.pose))
    if before:
        draw_value(column, " + ".join(before), time_text(timings and timings.skin))
    mixes = {mix[0]: " + ".join(mix) for mix in entry.run.mixes}
    tail = entry.way.tail.names if entry.way.tail is not None else ()
    behind = *behind, *filter(None, [" + ".join(tail)])
    for name, milliseconds in zip(behind, timings.stages if timings else (None for _ in behind)):
        draw_value(column, mixes.get(name, name or "Smooth"), time_text(milliseconds))
    if tail:
        return
    if entry.run.end:
        draw_value(column, entry.run.end, "in Blender")
        searched = searching.says(ob)
        notice.draw_sentence(
            column, bpy.context, f"Blender takes over at {entry.run.end}: {searched or entry.run.reason}", False
        )
        if searching.takes_long(ob):
            layout.operator(cures.FindWeights.bl_idname)
        end = ob.modifiers.get(entry.run.end)
        if end is not None and survey.why_not_bound(ob, end):
            layout.operator(cures.BindSmoothing.bl_idname)
        if rig_cures.names_driver(entry.run.reason):
            layout.operator(rig_cures.ShowDriver.bl_idname)


def time_text(milliseconds: float | None) -> str:
    """Returns a time as text. milliseconds: None until a frame was played after an edit."""
    return NOT_PLAYED if milliseconds is None else f"{milliseconds:.2f} ms"


def draw_details(layout: bpy.types.UILayout, context: bpy.types.Context, entry: Any) -> None:
    ob = context.object
    if entry.way.in_pass and entry.is_deforming:
        draw_chain(layout, ob, entry)
        layout.separator()
    timings, column = entry.status.timings.recent(), layout.column(align=True)
    own, made = entry.deformer.vertex_count, entry.deformer.result_count
    draw_value(column, "Vertices", f"{own:,}" if own == made else f"{own:,}, made into {made:,}")
    for layer in entry.layers[:1]:
        draw_value(column, "Bones", str(len(layer.bones.names)))
        mean = layer.skin.influence_count / max(layer.skin.vertex_count, 1)
        draw_value(column, "Influences", f"{mean:.2f}, at most {layer.skin.most_influences}")
        draw_value(column, "Unweighted", f"{layer.influences.unweighted_count:,}")
    draw_value(column, "Path", WAYS[entry.way.kind if entry.is_deforming else "BLENDER"])
    if entry.is_deforming:
        draw_value(column, "Sinew's Part", time_text(timings and timings.total))
    measured = whole_frames.last(context.scene)
    if measured is not None:
        draw_value(column, "Whole Frame", f"{measured.sinew:.2f} ms")
        draw_value(column, "Without Sinew", f"{measured.blender:.2f} ms")
    compared = rig_cures.compared(display.armature_of(ob))
    if compared:
        draw_value(column, "Rig Compared", f"{compared} frame{'s' * (compared != 1)}")
    draw_value(column, "Instructions", sinew_native.instruction_set())
    draw_value(column, "Threads", str(sinew_native.thread_count()))


def draw_program(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draws the versions, and what of Blender's memory Sinew uses."""
    column = layout.column(align=True)
    for line in memory_use.states():
        notice.draw_sentence(column, context, line, False)


def draw_value(column: bpy.types.UILayout, name: str, value: str) -> None:
    named_row(column, name).label(text=value)


def named_row(column: bpy.types.UILayout, name: str) -> bpy.types.UILayout:
    row = column.split(factor=0.4)
    left = row.row()
    left.alignment = "RIGHT"
    left.label(text=name)
    return row
