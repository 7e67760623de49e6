"""What the panels say about the rig of a mesh: whether it is computed natively, or why it is not."""

from typing import Any

import bpy

from ..description import reading
from ..feedback import notice
from ..host import contract, features
from ..played import rigs
from . import rig_cures


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
        notice.draw_sentence(column, context, reason, False)
    rig_cures.draw(column, armature, reason)


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
    return "Rig: Blender's", "" if rig.stays_live or not rig.needs_program else rig.reason


def compared(armature: Any) -> int:
    """Returns on how many frames the rig of an armature was compared with Blender, if it is native."""
    rig = rigs.get(armature) if armature is not None else None
    return len(rig.source.compared) if rig is not None and rig.source.is_proven else 0
