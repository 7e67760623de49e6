"""Operators that bake the selected meshes to bones."""

from typing import Any

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty

from ..to_bones import conversion
from ..to_bones.report import Report
from .in_steps import InSteps
from .operators import selected_meshes
from .over_frames import OverFrames

SOURCES = (
    ("NEW", "New Bones", "Find bones that play the deformation best"),
    ("RIG", "The Rig's Bones", "Copy the deforming bones of the meshes' armature with their motion, and find weights"),
)


class ToBonesSettings(OverFrames):
    """The properties that BakeToBones and BakeToBonesSteps, which does the work, share."""

    source: EnumProperty(name="Bones", description="Which bones the new armature has", items=SOURCES)
    bones: IntProperty(
        name="Number of Bones",
        description="The largest number of bones to find; fewer, if fewer play the deformation exactly",
        default=20,
        min=1,
        soft_max=200,
        max=2048,
    )
    max_influences: IntProperty(
        name="Most Bones per Vertex",
        description="Game engines often allow 4 or 8",
        default=4,
        min=1,
        soft_max=8,
        max=64,
    )
    iterations: IntProperty(
        name="Iterations",
        description="At most so often weights and motions are found in turns",
        default=30,
        min=1,
        soft_max=200,
        max=10000,
    )
    tolerance: FloatProperty(
        name="Tolerance",
        description="Stop when three iterations lower the error by less than this share of it; 0: do all iterations",
        default=1e-3,
        min=0.0,
        max=1.0,
        precision=4,
    )

    def job(self: Any, context: bpy.types.Context) -> conversion.Settings:
        bones = self.bones if self.source == "NEW" else 0
        return conversion.Settings(
            self.frames(context.scene), bones, self.max_influences, self.iterations, self.tolerance
        )


def can_bake(context: bpy.types.Context) -> bool:
    is_playing = context.screen and context.screen.is_animation_playing
    return context.mode == "OBJECT" and bool(selected_meshes(context)) and not is_playing


class BakeToBones(ToBonesSettings, bpy.types.Operator):
    """Make an armature with keyframes, and copies of the selected meshes with weights, which play what the meshes do on
    each frame, whatever deforms them: for game engines and other programs. All selected meshes get one armature. Esc
    stops it, and nothing has changed"""

    bl_idname = "object.sinew_bake_to_bones"
    bl_label = "Bake to Bones"
    bl_options = {"PRESET"}

    @classmethod
    def poll(cls, context):
        return can_bake(context)

    def invoke(self, context, _event):
        self.set_frames(context.scene)
        return context.window_manager.invoke_props_dialog(self)

    def draw(self, _context):
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        column = self.layout.column(align=True)
        for name in ("frame_start", "frame_end", "frame_step"):
            column.prop(self, name)
        self.layout.prop(self, "source")
        column = self.layout.column()
        column.active = self.source == "NEW"
        column.prop(self, "bones")
        for name in ("max_influences", "iterations", "tolerance"):
            self.layout.prop(self, name)

    def execute(self, _context):
        return self.start(bpy.ops.object.sinew_bake_to_bones_steps)


class BakeToBonesSteps(ToBonesSettings, InSteps, bpy.types.Operator):
    """Bake the selected meshes to bones, without a dialog"""

    bl_idname = "object.sinew_bake_to_bones_steps"
    bl_label = "Bake to Bones"
    bl_options = {"UNDO", "INTERNAL"}
    stopped = "Stopped: nothing was made"
    seconds_in_a_row = 0.1

    @classmethod
    def poll(cls, context):
        return can_bake(context)

    def execute(self, context):
        return self.at_once(
            lambda: self.finish(context, conversion.run(context, selected_meshes(context), self.job(context)))
        )

    def invoke(self, context, _event):
        return self.at_once(
            lambda: self.begin(context, conversion.steps(context, selected_meshes(context), self.job(context)))
        )

    def finish(self, _context: bpy.types.Context, report: Report) -> set[str]:
        self.report({"INFO"}, report.sentence())
        return {"FINISHED"}


def draw_operator(layout: bpy.types.UILayout) -> None:
    """Draws the operator, which opens its dialog."""
    layout.operator(BakeToBones.bl_idname, icon="BONE_DATA")


def draw_object(menu: Any, _context: bpy.types.Context) -> None:
    menu.layout.operator_context = "INVOKE_DEFAULT"  # the menu's own would skip the dialog
    draw_operator(menu.layout)


CLASSES = (BakeToBones, BakeToBonesSteps)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
