"""Operators that bake the selected meshes, or a rig, to bones."""

from dataclasses import replace
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty

from ..to_bones import conversion, exact, gltf
from ..to_bones.bake_options import ExactOptions, FoundOptions
from ..to_bones.bone_names import read_names
from ..to_bones.exact_report import ExactReport
from ..to_bones.report import Report
from . import available, option_properties
from .in_steps import InSteps, OverFrames
from .operators import selected_meshes

SOURCES = (
    ("NEW", "New Bones", "Find bones that play the deformation best"),
    ("RIG", "The Rig's Bones", "Copy the deforming bones of the meshes' armature with their motion, and find weights"),
    (
        "EXACT",
        "The Rig's Bones, Exact",
        "Make a skeleton for games: the rig's deforming bones with exactly their motion, in each of its actions; the "
        "meshes keep their weights",
    ),
)
EXACT_OPTIONS = ("root", "root_motion", "is_flat", "has_segments", "roots_alone_move", "copies_meshes")


@option_properties.added(ExactOptions)
@option_properties.added(FoundOptions)
class ToBonesSettings(available.Explains, OverFrames):
    """The properties that BakeToBones and BakeToBonesSteps, which does the work, share."""

    source: EnumProperty(name="Bones", description="Which bones the new armature has", items=SOURCES)
    all_actions: BoolProperty(
        name="All Actions",
        description="Bake each action that moves the rig's bones, on its own frames; otherwise the scene as it plays",
        default=True,
    )

    @classmethod
    def why_not(cls, context):
        active = context.view_layer.objects.active
        is_armature = active is not None and active.type == "ARMATURE" and active.select_get()
        has_any = is_armature or selected_meshes(context)
        why = available.other_mode(context, "OBJECT") or available.playing(context)
        return why or ("" if has_any else "Select meshes, or an armature")

    def exact_job(self: Any, context: bpy.types.Context) -> exact.ExactSettings:
        return exact.ExactSettings(
            frames=self.frames(context.scene),
            actions=self.actions if self.all_actions else "",
            target=self.skeleton,
            key_error=self.key_error,
            names=read_names(bpy.path.abspath(self.names)) if self.names else {},
            **{name: getattr(self, name) for name in EXACT_OPTIONS},
        )

    def work(self: Any, context: bpy.types.Context, is_in_steps: bool) -> Any:
        """Returns the steps of the bake, or, at once, its report."""
        if self.source == "EXACT":
            rig, meshes = exact.chosen(context)
            return (exact.steps if is_in_steps else exact.run)(context, rig, meshes, self.exact_job(context))
        bake = conversion.steps if is_in_steps else conversion.run
        return bake(context, selected_meshes(context), self.job(context))

    def job(self: Any, context: bpy.types.Context) -> conversion.Settings:
        found = replace(option_properties.read(self, FoundOptions), **{} if self.source == "NEW" else {"bones": 0})
        return conversion.Settings(**vars(found), frames=self.frames(context.scene))


class BakeToBones(ToBonesSettings, bpy.types.Operator):
    """Make an armature with keyframes, and copies of the selected meshes with weights, which play what the meshes do on
    each frame, whatever deforms them, or what a rig does in all its actions: for game engines and other programs. All
    selected meshes get one armature. Esc stops it, and nothing has changed"""

    bl_idname = "object.sinew_bake_to_bones"
    bl_label = "Bake to Bones"
    bl_options = {"PRESET"}

    def invoke(self, context, _event):
        self.set_frames(context.scene)
        return context.window_manager.invoke_props_dialog(self)

    def draw(self, _context):
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        self.layout.prop(self, "source")
        if self.source == "EXACT":
            self.draw_exact()
            return
        column = self.layout.column(align=True)
        for name in ("frame_start", "frame_end", "frame_step"):
            column.prop(self, name)
        column = self.layout.column()
        column.active = self.source == "NEW"
        column.prop(self, "bones")
        for name in ("max_influences", "iterations", "tolerance"):
            self.layout.prop(self, name)

    def draw_exact(self: Any) -> None:
        column = self.layout.column(align=True)
        column.prop(self, "all_actions")
        for name in ("actions",) if self.all_actions else ("frame_start", "frame_end"):
            column.prop(self, name)
        column.prop(self, "frame_step")
        column = self.layout.column(align=True)
        column.prop_search(self, "skeleton", bpy.context.scene, "objects")
        column = self.layout.column(align=True)
        column.active = not self.skeleton
        rig = bpy.context.active_object
        if rig is not None and rig.type == "ARMATURE":
            column.prop_search(self, "root", rig.data, "bones")
        for name in EXACT_OPTIONS[rig is not None and rig.type == "ARMATURE" :]:
            column.prop(self, name)
        for name in ("key_error", "names", "gltf"):
            self.layout.prop(self, name)

    def run(self, _context):
        return self.start(bpy.ops.object.sinew_bake_to_bones_steps)


class BakeToBonesSteps(ToBonesSettings, InSteps, bpy.types.Operator):
    """Bake the selected meshes to bones, without a dialog"""

    bl_idname = "object.sinew_bake_to_bones_steps"
    bl_label = "Bake to Bones"
    bl_options = {"UNDO", "INTERNAL"}
    stopped = "Stopped: nothing was made"
    seconds_in_a_row = 0.1

    def run(self, context):
        return self.finish(context, self.work(context, is_in_steps=False))

    def invoke(self, context, _event):
        return self.at_once(lambda: self.begin(context, self.work(context, is_in_steps=True)))

    def finish(self, context: bpy.types.Context, report: Report | ExactReport) -> None:
        if isinstance(report, ExactReport) and self.gltf:
            made = [bpy.data.objects[name] for name in (report.armature, *report.objects)]
            gltf.export(context, made, bpy.path.abspath(self.gltf))
        self.report({"INFO"}, report.sentence())


def draw_operator(layout: bpy.types.UILayout) -> None:
    """Draws the operator, which opens its dialog."""
    layout.operator(BakeToBones.bl_idname, icon="BONE_DATA")


def draw_object(menu: Any, _context: bpy.types.Context) -> None:
    menu.layout.operator_context = "INVOKE_DEFAULT"  # the menu's own would skip the dialog
    draw_operator(menu.layout)


CLASSES = (BakeToBones, BakeToBonesSteps)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
