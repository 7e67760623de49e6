"""What the panels say about the rig of a mesh: whether it is computed natively, or why it is not. Buttons beside the
sentence that says why a rig, or a mesh, is left to Blender."""

import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper

from ..blender import animation, armatures, dependencies, selection
from ..blender.spoken_paths import spoken
from ..description import reading
from ..feedback import notice
from ..host import contract, features
from ..played import changes, differences, rigs
from ..run import characters
from . import available

_NAMES_DRIVER = re.compile(r"\bdriver of\b|\bhas a driver\b|\bis driven\b", re.IGNORECASE)


def draw_buttons(layout: bpy.types.UILayout, armature: Any, reason: str) -> None:
    """Draws the buttons for what keeps an armature from being native. reason: the sentence, or ""."""
    rig, row = rigs.get(armature), layout.row(align=True)
    if rig is None:
        return
    for name, text in offered(reason, rig):
        operator = row.operator(name, text=text) if text else row.operator(name)
        if name != "object.sinew_record":
            operator.armature = armature.name_full


def offered(reason: str, rig: rigs.Rig) -> Iterator[tuple[str, str]]:
    """Yields (operator, text of its button, "" for its own name) for a sentence about a rig."""
    if bone_of(rig.ob, reason):
        yield SelectBone.bl_idname, ""
    if names_driver(reason):
        yield ShowDriver.bl_idname, ""
    if reason and rig.trust.is_distrusted:
        yield AccelerateAgain.bl_idname, ""
    if reason and (rig.source.refusal or rig.source.is_proven) and rigs.can_be_recorded(rig.ob):
        yield "object.sinew_record", "Record Instead"
    if rig.trust.difference is not None:
        yield ReportRig.bl_idname, ""


def bone_of(armature: Any, reason: str) -> str:
    """Returns the name of the bone that a sentence about an armature names, or ""."""
    named = re.findall(r'bone "([^"]+)"', reason)
    return next((name for name in named if name in armature.pose.bones), "")


def names_driver(reason: str) -> bool:
    """Whether a sentence is about a driver."""
    return _NAMES_DRIVER.search(reason) is not None


def sentences_about(ob: Any) -> str:
    """Returns all that the panel says of why an armature object, or an accelerated mesh, is left to Blender."""
    if ob.type == "ARMATURE":
        rig = rigs.get(ob)
        return "" if rig is None else rig.reason
    entry = characters.looked_at(ob) if ob.type == "MESH" else None
    return "" if entry is None else f"{entry.way.reason} {entry.run.reason}"


def driver_of(ob: Any, reason: str) -> Any:
    """Returns the driver that a sentence about an object names, or None."""
    found = [curve for block in _blocks_around(ob) for curve in animation.drivers_of(block) if _names(reason, curve)]
    return max(found, key=lambda curve: (len(spoken(curve.data_path)), curve.id_data.name in reason), default=None)


def _blocks_around(ob: Any) -> list[Any]:
    """Returns the data-blocks whose drivers sentences about an object may name: its own, those of its armatures, and of
    what uses it or is used by it."""
    users = dependencies.Users.now()
    found = _with_data([ob, *armatures.of_modifiers(ob)])
    near = [each for block in found for each in (*users.get(block, ()), *users.uses.get(block, ()))]
    every = dict.fromkeys([*found, *_with_data(near)])
    return [each for each in every if hasattr(each, "animation_data")]  # collections have none


def _with_data(blocks: Iterable[Any]) -> list[Any]:
    """Returns data-blocks with their data and shape keys."""
    found = []
    for block in blocks:
        data = getattr(block, "data", None) if isinstance(block, bpy.types.Object) else None
        found += [block, data, getattr(data or block, "shape_keys", None)]
    return [each for each in found if each is not None]


def _names(reason: str, curve: Any) -> bool:
    """Whether a sentence names what a driver sets, as followers, descriptions and plans do."""
    what = spoken(curve.data_path)
    if re.search(rf"(driver of {re.escape(what)}|{re.escape(what)} of .* (has a driver|is driven))", reason):
        return True
    modifier = re.match(r'modifiers\["(.*)"\]\.(\w+)$', curve.data_path)
    if modifier is None:
        return False
    setting = modifier[2].replace("_", " ")
    return f"{setting} of {modifier[1]} is driven" in reason or f"its {setting} is driven" in reason


def _named(context: bpy.types.Context, name: str) -> Any:
    """Returns the object of the view layer with a full name, or None."""
    return next((each for each in context.view_layer.objects if each.name_full == name), None)


class _OfRig(available.Reports):
    """What the operators of one armature's buttons have in common. Each defines `cure(context, rig)`."""

    armature: StringProperty(options={"HIDDEN", "SKIP_SAVE"})

    def run(self: Any, context):
        ob = _named(context, self.armature)
        rig = rigs.get(ob) if ob is not None else None
        if rig is None:
            raise ValueError(f"No rig {self.armature or 'without a name'} of this view layer was accelerated")
        self.cure(context, rig)


class SelectBone(_OfRig, bpy.types.Operator):
    """Select the bone that keeps the rig from being computed, in Pose Mode"""

    bl_idname = "object.sinew_select_bone"
    bl_label = "Select Bone"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    def cure(self, context, rig):
        name = bone_of(rig.ob, sentences_about(rig.ob))
        if not name:
            raise ValueError(f"No bone keeps {rig.name} from being native")
        if not rig.ob.visible_get():
            raise ValueError(f"{rig.name} is hidden: show it first")
        if context.mode not in {"OBJECT", "POSE"} or context.active_object not in (None, rig.ob):
            bpy.ops.object.mode_set(mode="OBJECT")
        selection.pose(context, rig.ob)
        selection.select_bones(rig.ob, {name})
        rig.ob.data.bones.active = rig.ob.data.bones[name]


class ShowDriver(available.Reports, bpy.types.Operator):
    """Select the driver that the sentence is about, with its object, and show it in an editor for curves if one is
    open"""

    bl_idname = "object.sinew_show_driver"
    bl_label = "Show Driver"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    armature: StringProperty(options={"HIDDEN", "SKIP_SAVE"})

    def run(self, context):
        ob = _named(context, self.armature) if self.armature else context.active_object
        curve = driver_of(ob, sentences_about(ob)) if ob is not None else None
        if curve is None:
            raise ValueError(f"No driver keeps {self.armature or 'the active object'} from Sinew")
        block = curve.id_data
        owner = _object_with(block, context.view_layer)
        if owner is None or not owner.visible_get():
            raise ValueError(f"{block.name} is hidden, or in no object of this view layer: show it first")
        if context.mode != "OBJECT" and context.active_object != owner:
            bpy.ops.object.mode_set(mode="OBJECT")
        selection.select(context, owner, (owner,))
        for each in block.animation_data.drivers:
            each.select = each == curve
        areas = [each for each in context.screen.areas if each.type == "GRAPH_EDITOR"] if context.screen else []
        for area in areas[:1]:
            area.ui_type = "DRIVERS"
        where = "" if areas else ": open an editor of the type Drivers to see it"
        self.report({"INFO"}, f"Selected the driver of {spoken(curve.data_path)} of {block.name}{where}")


def _object_with(block: Any, layer: Any) -> Any:
    """Returns the object of a view layer that a data-block is, or that has it as its data or shape keys, or None."""
    return next(
        (each for each in layer.objects if block in (each, each.data, getattr(each.data, "shape_keys", None))), None
    )


class AccelerateAgain(_OfRig, bpy.types.Operator):
    """Compare the rig with Blender again: it has differed twice, so it is not computed until its settings change"""

    bl_idname = "object.sinew_accelerate_again"
    bl_label = "Accelerate Again"
    bl_options = {"REGISTER", "INTERNAL"}

    def cure(self, _context, rig):
        changes.trust(rig)
        notice.redraw()


class ReportRig(available.Reports, bpy.types.Operator, ExportHelper):
    """Write the rig and both poses of the frame on which they differ to a file, for Sinew's developers"""

    bl_idname = "object.sinew_report_rig"
    bl_label = "Report"

    filename_ext = ".json"
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})
    armature: StringProperty(options={"HIDDEN", "SKIP_SAVE"})

    def run(self, context):
        rig = next((each for each in rigs.known() if each.ob.name_full == self.armature), None)
        if rig is None or rig.trust.difference is None:
            raise ValueError(f"No difference from Blender was found in {self.armature or 'any armature'}")
        found = differences.report(rig, context.evaluated_depsgraph_get())
        Path(self.filepath).write_text(json.dumps(found, default=reading.as_list) + "\n", encoding="utf-8")
        self.report({"INFO"}, f"Wrote {self.filepath}")


CLASSES = (SelectBone, ShowDriver, AccelerateAgain, ReportRig)
register, unregister = bpy.utils.register_classes_factory(CLASSES)


def draw_rig(layout: bpy.types.UILayout, context: bpy.types.Context, armature: Any) -> None:
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
    draw_buttons(column, armature, reason)


def text_of(armature: Any) -> tuple[str, str]:
    """Returns how it is with an armature, one or two lines, and why Blender evaluates it, a sentence; "" for nothing to
    say."""
    if not contract.has(features.PLAYING):
        return "", contract.why_not(features.PLAYING)
    rig = rigs.get(armature)
    if rig is None:
        return "", ""
    if rig.is_played and rig.source.is_proven:
        own, blender = rig.source.milliseconds, rig.source.blender_milliseconds
        if not own or not blender:
            return "Rig: native", ""
        gain = f", {blender / own:.1f} times faster" if blender > own else ""
        return f"Rig: native{gain}\n{own:.2f} ms (Blender {blender:.2f})", ""
    if rig.is_idle:
        return "Rig: native" if rig.trust.is_posable else "Rig: recorded", ""
    return "Rig: Blender's", "" if rig.stays_live or not rig.trial.needs_program else rig.reason


def compared(armature: Any) -> int:
    """Returns on how many frames the rig of an armature was compared with Blender, if it is native."""
    rig = rigs.get(armature) if armature is not None else None
    return len(rig.source.compared) if rig is not None and rig.source.is_proven else 0
