"""What the panels say about the rig of a mesh: whether it is computed natively, or why it is not."""

import json
from pathlib import Path
from typing import Any

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper

from ..description import reading
from ..feedback import notice
from ..host import contract, features
from ..played import differences, rigs


def draw(layout: bpy.types.UILayout, context: bpy.types.Context, armature: Any) -> None:
    """Draws the switch, and how it is with one armature."""
    if not reading.CAN_READ:
        return
    column = layout.column(align=True)
    column.prop(context.scene, "sinew_accelerates_rigs")
    text, reason = text_of(armature) if context.scene.sinew_accelerates_rigs else ("", "")
    if rigs.get(armature) is not None:  # always two lines, so that nothing moves below while somebody poses
        first, second = (text.splitlines() + ["", ""])[:2]
        column.label(text=first, icon="ARMATURE_DATA" if first else "BLANK1")
        column.label(text=second, icon="BLANK1")
    if reason:
        notice.draw_sentence(column, context, reason, False)
    if getattr(rigs.get(armature), "difference", None) is not None:
        column.operator(ReportRig.bl_idname).armature = armature.name_full


def text_of(armature: Any) -> tuple[str, str]:
    """Returns how it is with an armature, one or two lines, and why Blender evaluates it, a sentence; "" for nothing to
    say."""
    if not contract.has(features.FREEZING):
        return "", contract.why_not(features.FREEZING)
    rig = rigs.get(armature)
    if rig is None:
        return "", ""
    if rig.is_frozen and rig.source.is_proven:
        own, blender, frames = rig.source.milliseconds, rig.source.blender_milliseconds, len(rig.source.compared)
        compared = f", {own:.2f} ms (Blender {blender:.2f})\nCompared on {frames} frame{'s' * (frames != 1)}"
        return f"Rig: native{compared if blender else ''}", ""
    if rig.is_idle:
        return "Rig: native" if rig.is_posable else "Rig: recorded", ""
    if rig.stays_live:
        return "Rig: Blender's, because it was thawed", ""
    return ("Rig: Blender's", rig.reason) if rig.needs_program and rig.reason else ("", "")


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


CLASSES = (ReportRig,)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
