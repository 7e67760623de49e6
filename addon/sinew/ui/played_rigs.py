"""Rigs that are native or recorded: operators, the panel that lists them, and marks in the timeline which frames are
recorded."""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import bpy
import gpu
from bpy.props import BoolProperty
from gpu_extras.batch import batch_for_shader

from ..blender.drawn import Drawn
from ..description import reading
from ..feedback import notice
from ..played import followers, recording, rigs, states
from . import available
from .in_steps import InSteps
from .panels import InSidebar

MOST_RUNS = 3  # of recorded frames that are listed
MOST_STRIPS = 8
RULER, HEIGHT, GAP = 23, 3, 1  # of the frame numbers, of a strip, between two: pixels at 100 % interface scale
PLAYED, LIVE = (0.35, 0.75, 1.0, 0.9), (0.55, 0.6, 0.65, 0.7)


def chosen(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Returns the armature objects of the selected objects, or else of the active one."""
    objects = context.selected_objects or ([context.active_object] if context.active_object else [])
    return recording.armatures_of(objects)


def not_now(context: bpy.types.Context) -> str:
    """Returns what to do before rigs can change their state; "" if they can."""
    return available.other_mode(context, "OBJECT", "POSE") or available.playing(context)


def nothing_chosen(context: bpy.types.Context) -> str:
    return "" if chosen(context) else "Select an armature, or an object that one moves"


class _Records(available.Explains, InSteps):
    """What Record and RecordOthers share."""

    stopped = "Stopped: the frames that were recorded are kept, and the rigs stay Blender's"
    seconds_in_a_row = 0.1

    def invoke(self: Any, context, _event):
        return self.begin(context, self._steps_of(context))

    def run(self: Any, context):
        for _step in self._steps_of(context):
            pass
        return self.finish(context, None)

    def _steps_of(self: Any, context):
        return recording.steps(context.scene, context.view_layer, self.armatures(context))

    def finish(self: Any, context, _value):
        own = [rigs.learn(each) for each in self.armatures(context)]
        if not own:
            raise ValueError("No other character of this view layer has keyframes")
        for rig in own:
            if rig.stays_live:
                rig.ob.sinew_accelerates_rig = True
            states.want(rig)
        states.take_over(own, context.scene, context.view_layer)
        is_any = any(rig.is_played for rig in own)
        native = followers.listed([rig.name for rig in own if rig.source.is_proven])
        if native:
            self.report({"INFO"}, f"{native}: native, so nothing has to be recorded")
        for rig in own:
            if rig.reason:
                self.report({"WARNING" if is_any else "ERROR"}, notice.as_sentence(rig.reason))
            elif recording.missing(rig, context.scene):
                self.report(
                    {"WARNING"}, f"{rig.name} is not recorded on all frames: raise the limit in the preferences"
                )
        notice.redraw()
        return {"FINISHED"} if is_any else {"CANCELLED"}


class Record(_Records, bpy.types.Operator):
    """Play selected characters whose rigs Sinew cannot compute from memory, so that Blender does not evaluate them,
    until they are selected or edited. Frames of the preview range or the scene's range that are not recorded are played
    once first. Press Esc to stop; the recorded frames are kept"""

    bl_idname = "object.sinew_record"
    bl_label = "Record"

    @classmethod
    def why_not(cls, context):
        return not_now(context) or nothing_chosen(context)

    def armatures(self, context):
        return chosen(context)


class RecordOthers(_Records, bpy.types.Operator):
    """Record all characters except for the selected ones, and play them from memory"""

    bl_idname = "object.sinew_record_others"
    bl_label = "Record All But This"

    @classmethod
    def why_not(cls, context):
        return not_now(context)

    def armatures(self, context):
        selected = chosen(context)
        return [each for each in recording.animated_armatures(context.view_layer) if each not in selected]


class LeaveToBlender(available.Explains, bpy.types.Operator):
    """Switch Accelerate Rig off for the selected characters, or for all if none is selected: Blender evaluates them"""

    bl_idname = "object.sinew_leave_to_blender"
    bl_label = "Leave to Blender"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def why_not(cls, context):
        has_any = any(rig.is_wanted for rig in rigs.known())
        return not_now(context) or ("" if has_any else "All rigs are Blender's")

    def run(self, context):
        selected = chosen(context)
        for rig in rigs.known():
            if rig.ob in selected or not selected:
                rig.ob.sinew_accelerates_rig = False
        notice.redraw()


def draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    if reading.CAN_READ:
        layout.prop(context.scene, "sinew_accelerates_rigs")
    row = layout.row(align=True)
    row.operator(Record.bl_idname, icon="REC")
    row.operator(RecordOthers.bl_idname, text="All But This")
    layout.operator(LeaveToBlender.bl_idname, icon="LIGHT_SUN")
    for rig in rigs.known():
        draw_rig(layout, context, rig)
    if rigs.known():
        layout.label(text=f"{rigs.used_memory() / 2**20:,.0f} MB in memory", icon="INFO")


def draw_rig(layout: bpy.types.UILayout, context: bpy.types.Context, rig: Any) -> None:
    row = layout.split(factor=0.5, align=True)
    row.prop(rig.ob, "sinew_accelerates_rig", text=rig.name)
    row.label(text=frames_text(rig))
    if rig.is_wanted and not rig.is_idle and not rig.trial.needs_program and rig.reason:
        notice.draw_sentence(layout, context, rig.reason, False)
    if rig.source.refusal and not rig.trial.needs_program:
        notice.draw_sentence(layout, context, f"It is recorded, not computed: {rig.source.refusal}", False)


def frames_text(rig: Any) -> str:
    """Returns which frames of a character are recorded, as text."""
    if rig.source.is_proven:
        return "native" if rig.is_idle else "Blender's"
    runs = [f"{first}" if first == last else f"{first} to {last}" for first, last in rig.motion.record.runs()]
    more = f" and {len(runs) - MOST_RUNS} more" if len(runs) > MOST_RUNS else ""
    return ", ".join(runs[:MOST_RUNS]) + more or "not recorded"


class SidebarRigs(InSidebar, bpy.types.Panel):
    bl_idname, bl_parent_id = "VIEW3D_PT_sinew_rigs", "VIEW3D_PT_sinew"
    bl_label = "Rigs"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return bool(rigs.known()) or context.object is not None and bool(recording.armatures_of([context.object]))

    def draw(self, context):
        draw(self.layout, context)


def _switch_rigs(scene: Any, context: Any) -> None:
    """Lets Blender evaluate the rigs of a scene that are only accelerated, and keeps nothing of them, or tries all
    again."""
    here = [rig for rig in rigs.known() if rig.home.scene in (scene, None)]
    if not scene.sinew_accelerates_rigs:
        own = [rig for rig in here if rig.trial.needs_program]
        states.hand_back(own, scene, context.view_layer)
        for rig in own:
            rig.clear()
    for rig in here:
        rig.try_at_once()


def _switch_rig(ob: Any, context: Any) -> None:
    """Lets Blender evaluate the rig of an armature object, or tries it again."""
    rig = rigs.get(ob)
    if rig is None:
        return
    rig.try_at_once()
    if rig.stays_live and rig.is_wanted:
        graph = rig.graph()
        scene, layer = (context.scene, context.view_layer) if graph is None else (graph.scene, graph.view_layer)
        states.hand_back([rig], scene, layer)


class Bar(NamedTuple):
    """A run of recorded frames, in pixels of the region."""

    left: float
    bottom: float
    right: float
    top: float
    color: tuple[float, float, float, float]


def marked(context: bpy.types.Context) -> list[rigs.Rig]:
    """Returns the characters with a strip: those that are played or were, and the selected ones."""
    selected = chosen(context)
    found = [rig for rig in rigs.known() if len(rig.motion.record) and (rig.is_wanted or rig.ob in selected)]
    return sorted(found, key=lambda rig: rig.name)[:MOST_STRIPS]


def bars(shown: Iterable[rigs.Rig], place: Callable[[float], float], height: float, scale: float) -> list[Bar]:
    """Returns what is drawn. place: the pixel of a frame; height: of the region; scale: of the interface."""
    shown = list(shown)
    # Under the frame numbers, or over the lower border of a timeline that shows nothing else.
    found, top = [], max(height - RULER * scale, len(shown) * (HEIGHT + GAP) * scale)
    for rig in shown:
        color = PLAYED if rig.is_idle else LIVE
        bottom = top - HEIGHT * scale
        found += [
            Bar(place(first - 0.5), bottom, place(last + 0.5), top, color) for first, last in rig.motion.record.runs()
        ]
        top = bottom - GAP * scale
    return found


def _draw_strips() -> None:
    context = bpy.context
    shown = marked(context)
    if not shown:
        return
    region = context.region
    drawn = bars(
        shown,
        lambda frame: region.view2d.view_to_region(frame, 0, clip=False)[0],
        region.height,
        context.preferences.system.ui_scale,
    )
    shader = gpu.shader.from_builtin("2D_UNIFORM_COLOR" if bpy.app.version < (4, 0, 0) else "UNIFORM_COLOR")
    gpu.state.blend_set("ALPHA")
    for color in {bar.color for bar in drawn}:
        corners = [corner for bar in drawn if bar.color == color for corner in _triangles(bar)]
        shader.bind()
        shader.uniform_float("color", color)
        batch_for_shader(shader, "TRIS", {"pos": corners}).draw(shader)
    gpu.state.blend_set("NONE")


def _triangles(bar: Bar) -> list[tuple[float, float]]:
    left, bottom, right, top, _color = bar
    return [(left, bottom), (right, bottom), (right, top), (left, bottom), (right, top), (left, top)]


_strips = Drawn(bpy.types.SpaceDopeSheetEditor, _draw_strips, "POST_PIXEL")


CLASSES = (Record, RecordOthers, LeaveToBlender, SidebarRigs)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.sinew_accelerates_rigs = BoolProperty(
        name="Accelerate Rigs",
        description="Compute the bones of the accelerated characters of this scene natively, with the same result, if "
        "possible",
        default=True,
        update=_switch_rigs,
    )
    bpy.types.Object.sinew_accelerates_rig = BoolProperty(
        name="Accelerate Rig",
        description="Of an armature: compute its bones natively, with the same result, if possible. Otherwise Blender "
        "evaluates it",
        default=True,
        options=set(),
        override={"LIBRARY_OVERRIDABLE"},
        update=_switch_rig,
    )
    if not bpy.app.background:
        _strips.show()


def unregister() -> None:
    _strips.hide()
    del bpy.types.Object.sinew_accelerates_rig
    del bpy.types.Scene.sinew_accelerates_rigs
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
