"""The profile of the open scene in the sidebar: which objects take the time of a frame."""

import bpy
from bpy.props import IntProperty, StringProperty

from ..feedback import notice
from ..install import bind
from ..main import callbacks
from ..plan import bindable
from ..profiling import costs, measure
from . import available
from .in_steps import InSteps
from .panels import InSidebar

MOST_OBJECTS = 12  # the largest number that is listed
ICONS = {"MESH": "MESH_DATA", "ARMATURE": "ARMATURE_DATA"}


class MeasureProfile(available.Explains, InSteps, bpy.types.Operator):
    """Play the scene and measure what evaluating each object costs, and what Accelerate would save. The .blend does not
    change, except that unkeyed changes return to their keyframes, as they do whenever the scene plays. Press Esc to
    stop"""

    bl_idname = "scene.sinew_profile"
    bl_label = "Measure"
    bl_options = {"REGISTER"}
    stopped = "Stopped: nothing was measured, and nothing has changed"

    frame_start: IntProperty(name="First Frame", description="The first frame to play; by default the scene's")
    frame_end: IntProperty(name="Last Frame", description="The last frame to play; by default the scene's")

    @classmethod
    def why_not(cls, context):
        return available.other_mode(context, *available.MODES) or available.playing(context)

    def run(self, context):
        return self.finish(context, measure.run(context, *self._frames(context)))

    def invoke(self, context, _event):
        if context.window is None:
            return self.execute(context)
        return self.begin(context, measure.steps(context, *self._frames(context)))

    def _frames(self, context):
        first, last = costs.frames_of(context.scene)
        return (
            self.frame_start if self.properties.is_property_set("frame_start") else first,
            self.frame_end if self.properties.is_property_set("frame_end") else last,
        )

    def finish(self, _context: bpy.types.Context, profile: costs.Profile) -> None:
        costs.last[:] = [profile]
        notice.redraw()


class AccelerateOne(available.Explains, bpy.types.Operator):
    """Let Sinew deform this mesh, with its armature if it has one"""

    bl_idname = "object.sinew_accelerate_one"
    bl_label = "Accelerate"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}
    modes = tuple(available.MODES)

    name: StringProperty(options={"SKIP_SAVE"})

    def run(self, _context):
        ob = bpy.data.objects.get((self.name, None))
        if ob is None:
            raise ValueError(f"{self.name} no longer exists: measure again")
        bind.bind(ob, bindable.armature_to_bind(ob))


class SidebarProfile(InSidebar, bpy.types.Panel):
    bl_idname = "VIEW3D_PT_sinew_profile"
    bl_label = "Where the Time Goes"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        self.layout.operator(MeasureProfile.bl_idname, icon="TIME")
        for profile in costs.last:
            draw_profile(self.layout, context, profile)


def draw_profile(layout: bpy.types.UILayout, context: bpy.types.Context, profile: costs.Profile) -> None:
    notice.draw_sentence(layout, context, costs.heading(profile), False)
    for cost in profile.objects[:MOST_OBJECTS]:
        ob = bpy.data.objects.get(cost.name)
        if ob is not None:  # None: it was deleted or renamed
            draw_object(layout.box().column(align=True), context, ob, cost)
    column = layout.box().column(align=True)
    others = profile.objects[MOST_OBJECTS:]
    if others:
        draw_row(
            column,
            "1 more object" if len(others) == 1 else f"{len(others)} more objects",
            f"{sum(cost.ms for cost in others):.2f} ms",
            "BLANK1",
        )
    for name, text in costs.last_rows(profile):
        draw_row(column, name, text, "BLANK1")
    if costs.about_rest(profile):
        notice.draw_sentence(column, context, costs.about_rest(profile), False)


def draw_object(
    column: bpy.types.UILayout, context: bpy.types.Context, ob: bpy.types.Object, cost: costs.ObjectCost
) -> None:
    draw_row(column, cost.name[0], f"{cost.ms:.2f} ms", ICONS.get(cost.type, "OBJECT_DATA"))
    for part in cost.parts:
        draw_row(column, part.name, costs.part_text(part), "BLANK1")
    if ob.type == "MESH" and ob.sinew.is_bound and not cost.is_bound:
        column.label(text="Accelerated since: measure again", icon="CHECKMARK")
    elif cost.saves is not None:
        draw_row(column, "Accelerate", costs.verdict(cost), "BLANK1")
        column.operator(AccelerateOne.bl_idname, icon="LINKED").name = ob.name
    elif costs.verdict(cost):
        notice.draw_sentence(column, context, costs.verdict(cost), False)
    for remark in cost.remarks:
        notice.draw_sentence(column, context, remark, False)


def draw_row(column: bpy.types.UILayout, name: str, value: str, icon: str) -> None:
    row = column.split(factor=0.6)
    row.label(text=name, icon=icon)
    right = row.row()
    right.alignment = "RIGHT"
    right.label(text=value)


CLASSES = (MeasureProfile, AccelerateOne, SidebarProfile)
register_classes, unregister_classes = bpy.utils.register_classes_factory(CLASSES)


def register() -> None:
    register_classes()
    callbacks.start_with_file(costs.last.clear)


def unregister() -> None:
    callbacks.stop_with_file(costs.last.clear)
    unregister_classes()
