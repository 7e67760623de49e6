"""What the panels say about the rig of a mesh: whether it is computed natively, or why it is not."""

from typing import Any

import bpy

from ..feedback import notice
from ..frozen import rigs
from ..rig_programs import reading


def draw(layout: bpy.types.UILayout, context: bpy.types.Context, armature: Any) -> None:
    """Draws the switch, and how it is with one armature."""
    if not reading.CAN_READ:
        return
    column = layout.column(align=True)
    column.prop(context.scene, "sinew_accelerates_rigs")
    text, reason = text_of(armature) if context.scene.sinew_accelerates_rigs else ("", "")
    if text:
        column.label(text=text, icon="ARMATURE_DATA")
    if reason:
        notice.draw_sentence(column, context, reason, False)


def text_of(armature: Any) -> tuple[str, str]:
    """Returns how it is with an armature, and why Blender evaluates it, a sentence; "" for nothing to say."""
    rig = rigs.get(armature)
    if rig is None:
        return "", ""
    if rig.is_frozen and rig.source.is_proven:
        return f"Rig: native, {rig.milliseconds:.2f} ms", ""
    if rig.is_idle:
        return "Rig: native" if rig.is_posable else "Rig: frozen", ""
    if rig.stays_live:
        return "Rig: Blender's, because it was thawed", ""
    return ("Rig: Blender's", rig.reason) if rig.needs_program and rig.reason else ("", "")
