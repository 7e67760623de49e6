"""The sidebar panel. It draws and nothing else."""

import bpy

from . import binding, clip_store, session
from .operators import Bind, ClipToKeyframes, Unbind, meshes_of


class SinewPanel(bpy.types.Panel):
    bl_idname = "VIEW3D_PT_sinew"
    bl_label = "Sinew"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Sinew"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        ob = context.active_object
        if ob is not None and ob.type == "ARMATURE":
            draw_armature(layout, context, ob)
        elif ob is None or ob.type != "MESH":
            layout.label(text="Select a mesh or its armature", icon="INFO")
        elif ob.sinew.is_bound:
            draw_bound(layout, ob)
        else:
            draw_free(layout, ob)


def draw_free(layout, ob):
    modifier = binding.armature_modifier(ob)
    if modifier is None:
        layout.label(text="Not bound", icon="UNLINKED")
        layout.operator(Bind.bl_idname, icon="LINKED")
    else:
        layout.label(text=f"{modifier.name} deforms it", icon="MOD_ARMATURE")
        layout.operator(Bind.bl_idname, text="Accelerate", icon="LINKED")


def draw_armature(layout, context, armature):
    meshes = meshes_of(context, armature)
    bound = sum(ob.sinew.is_bound for ob in meshes)
    if any(ob.sinew.source == "CLIP" for ob in meshes):
        draw_clip(layout, armature)
    if meshes:
        layout.label(text=f"Sinew deforms {bound} of its {len(meshes)} meshes", icon="MESH_DATA")
    if bound < len(meshes):
        layout.operator(Bind.bl_idname, text="Accelerate", icon="LINKED")
    if bound:
        layout.operator(Unbind.bl_idname, icon="UNLINKED")


def draw_bound(layout, ob):
    settings = ob.sinew
    entry = session.character(ob)
    if entry is not None and entry.error:
        box = layout.box()
        box.alert = True
        box.label(text=entry.error, icon="ERROR")
    layout.prop(settings, "armature")
    column = layout.column()
    column.prop(settings, "method")
    column.prop(settings, "source")
    column.prop(settings, "output")
    if ob.vertex_groups:
        row = column.row(align=True)
        row.prop_search(settings, "mask_group", ob, "vertex_groups")
        row.prop(settings, "mask_invert", text="", icon="ARROW_LEFTRIGHT")
    column.prop(settings, "use_envelopes")
    for layer in settings.mixed:
        box = layout.box().column()
        box.label(text="Mixed with", icon="MOD_ARMATURE")
        box.prop(layer, "armature")
        box.prop(layer, "method")
        row = box.row(align=True)
        row.prop_search(layer, "mask_group", ob, "vertex_groups")
        row.prop(layer, "mask_invert", text="", icon="ARROW_LEFTRIGHT")
    armature = settings.armature
    if armature is not None and settings.source == "CLIP":
        draw_clip(layout, armature)
    if entry is not None and entry.deformer is not None:
        draw_statistics(layout, entry)
    layout.operator(Unbind.bl_idname, icon="UNLINKED")


def draw_clip(layout, armature):
    count = clip_store.pose_count(armature.data)
    if count == 0:
        layout.label(text=f"{armature.name} has no imported poses", icon="INFO")
        return
    settings = armature.sinew_clip
    box = layout.box()
    box.label(text=f"Poses of {armature.name} ({count})", icon="ARMATURE_DATA")
    box.prop(settings, "mode")
    if settings.mode == "FACTOR":
        box.prop(settings, "factor")
    if settings.mode in {"PLAYBACK", "SWING"}:
        box.prop(settings, "frame_start")
    if settings.mode == "PLAYBACK":
        box.prop(settings, "speed")
        box.prop(settings, "loop")
    box.operator(ClipToKeyframes.bl_idname, icon="KEYFRAME")


def draw_statistics(layout, entry):
    skin = entry.deformer.skin
    timings = entry.timings
    mean = skin.influence_count / max(skin.vertex_count, 1)
    column = layout.box().column(align=True)
    draw_value(column, "Vertices", f"{skin.vertex_count:,}")
    draw_value(column, "Bones", str(len(entry.layers[0].bones.names)))
    draw_value(column, "Influences", f"{mean:.2f} (max {skin.most_influences})")
    if skin.unweighted_count:
        draw_value(column, "Unweighted", f"{skin.unweighted_count:,}")
    column.separator()
    draw_value(column, "Last Frame", f"{timings.total:.2f} ms")
    for name, value in (("Pose", timings.pose), ("Skin", timings.skin), ("Write", timings.write)):
        draw_value(column, name, f"{value:.2f} ms")


def draw_value(column, name, value):
    row = column.split(factor=0.4)
    row.alignment = "RIGHT"
    row.label(text=name)
    row.label(text=value)


CLASSES = (SinewPanel,)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister():
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
