"""What the panels say about the rig of a mesh: whether it is computed natively, or why it is not."""

import json
import re
from pathlib import Path
from typing import Any

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper

from ..description import reading
from ..feedback import notice
from ..host import contract, features
from ..played import changes, differences, rigs
from .weights import enter_pose_mode, select_bones


def draw(layout: bpy.types.UILayout, context: bpy.types.Context, armature: Any) -> None:
    """Draws the switch, and how it is with one armature."""
    if not reading.CAN_READ:
        return
    column = layout.column(align=True)
    column.prop(armature, "sinew_accelerates_rig")
    text, reason = "Rig: Blender's, since the scene's Accelerate Rigs is off", ""
    if context.scene.sinew_accelerates_rigs:
        text, reason = text_of(armature)
    if rigs.get(armature) is not None:  # always two lines, so that nothing moves below while somebody poses
        first, second = (text.splitlines() + ["", ""])[:2]
        column.label(text=first, icon="ARMATURE_DATA" if first else "BLANK1")
        column.label(text=second, icon="BLANK1")
    if reason:
        notice.draw_sentence(column, context, reason[0].upper() + reason[1:], False)
    _draw_cures(column, armature, reason)


def _draw_cures(layout: bpy.types.UILayout, armature: Any, reason: str) -> None:
    """Draws the buttons for what keeps an armature from being native."""
    rig, row = rigs.get(armature), layout.row(align=True)
    if rig is None:
        return
    if bone_of(armature, reason):
        row.operator(SelectBone.bl_idname).armature = armature.name_full
    if reason and rig.is_distrusted:
        row.operator(AccelerateAgain.bl_idname).armature = armature.name_full
    if reason and rig.source.refusal and rigs.has_animation(armature):
        row.operator("object.sinew_freeze", text="Record Instead")
    if rig.difference is not None:
        row.operator(ReportRig.bl_idname).armature = armature.name_full


def bone_of(armature: Any, reason: str) -> str:
    """Returns the name of the bone that a sentence about an armature names, or ""."""
    named = re.findall(r'bone "([^"]+)"', reason)
    return next((name for name in named if name in armature.pose.bones), "")


class _OfRig:
    """What the operators of one armature's buttons have in common. Each defines `cure(context, rig)`."""

    armature: StringProperty(options={"HIDDEN", "SKIP_SAVE"})

    def execute(self: Any, context):
        ob = next((each for each in context.view_layer.objects if each.name_full == self.armature), None)
        rig = rigs.get(ob) if ob is not None else None
        if rig is None:
            self.report({"ERROR"}, f"No rig {self.armature or 'without a name'} of this view layer was accelerated")
            return {"CANCELLED"}
        return self.cure(context, rig)


class SelectBone(_OfRig, bpy.types.Operator):
    """Select the bone that keeps the rig from being computed, in Pose Mode"""

    bl_idname = "object.sinew_select_bone"
    bl_label = "Select Bone"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    def cure(self, context, rig):
        name = bone_of(rig.ob, text_of(rig.ob)[1])
        if not name:
            self.report({"ERROR"}, f"No bone keeps {rig.name} from being native")
            return {"CANCELLED"}
        if not rig.ob.visible_get():
            self.report({"ERROR"}, f"{rig.name} is hidden: show it first")
            return {"CANCELLED"}
        if context.mode not in {"OBJECT", "POSE"} or context.active_object not in (None, rig.ob):
            bpy.ops.object.mode_set(mode="OBJECT")
        enter_pose_mode(context, rig.ob)
        select_bones(rig.ob, {name})
        rig.ob.data.bones.active = rig.ob.data.bones[name]
        return {"FINISHED"}


class AccelerateAgain(_OfRig, bpy.types.Operator):
    """Compare the rig with Blender again: it has differed twice, so it is not computed until its settings change"""

    bl_idname = "object.sinew_accelerate_again"
    bl_label = "Accelerate Again"
    bl_options = {"REGISTER", "INTERNAL"}

    def cure(self, _context, rig):
        changes.trust(rig)
        notice.redraw()
        return {"FINISHED"}


def text_of(armature: Any) -> tuple[str, str]:
    """Returns how it is with an armature, one or two lines, and why Blender evaluates it, a sentence; "" for nothing to
    say."""
    if not contract.has(features.FREEZING):
        return "", contract.why_not(features.FREEZING)
    rig = rigs.get(armature)
    if rig is None:
        return "", ""
    if rig.is_frozen and rig.source.is_proven:
        own, blender = rig.source.milliseconds, rig.source.blender_milliseconds
        if not own or not blender:
            return "Rig: native", ""
        gain = f", {blender / own:.1f} times faster" if blender > own else ""
        return f"Rig: native{gain}\n{own:.2f} ms (Blender {blender:.2f})", ""
    if rig.is_idle:
        return "Rig: native" if rig.is_posable else "Rig: recorded", ""
    if rig.stays_live:
        return "Rig: Blender's", ""
    return ("Rig: Blender's", rig.reason) if rig.needs_program and rig.reason else ("", "")


def compared(armature: Any) -> int:
    """Returns on how many frames the rig of an armature was compared with Blender, if it is native."""
    rig = rigs.get(armature) if armature is not None else None
    return len(rig.source.compared) if rig is not None and rig.source.is_proven else 0


class ReportRig(bpy.types.Operator, ExportHelper):
    """Write the rig and both poses of the frame on which they differ to a file, for Sinew's developers"""

    bl_idname = "object.sinew_report_rig"
    bl_label = "Report"

    filename_ext = ".json"
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})
    armature: StringProperty(options={"HIDDEN", "SKIP_SAVE"})

    def execute(self, context):
        rig = next((each for each in rigs.known() if each.ob.name_full == self.armature), None)
        if rig is None or rig.difference is None:
            self.report({"ERROR"}, f"No difference from Blender was found in {self.armature or 'any armature'}")
            return {"CANCELLED"}
        try:
            found = differences.report(rig, context.evaluated_depsgraph_get())
            Path(self.filepath).write_text(json.dumps(found, default=reading.as_list) + "\n", encoding="utf-8")
        except (ValueError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Wrote {self.filepath}")
        return {"FINISHED"}


CLASSES = (SelectBone, AccelerateAgain, ReportRig)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
