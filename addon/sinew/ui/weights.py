"""Operators that make weights from bones, check weights, and select what the report names."""

import math
from collections.abc import Sequence
from dataclasses import astuple
from typing import Any

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, StringProperty

from ..blender import meshes, selection
from ..feedback import notice
from ..plan import bindable
from ..weights import assigning, checking, checks, parenting, reports
from ..weights.weight_settings import AutomaticSettings, CheckSettings
from . import available, option_properties
from .in_steps import InBackground

SELECT = "RESTRICT_SELECT_OFF"  # an icon


@option_properties.added(AutomaticSettings)
class WeightSettings:
    """The properties of the operators that make weights."""

    is_selected_rigid: BoolProperty(
        name="Selected Are Rigid",
        description="The vertices that are selected in Edit Mode do not bend: each connected piece of them is rigid",
        default=False,
    )

    def chosen_rigid(self: Any, objects: Any) -> dict[str, np.ndarray]:
        """Returns the vertices of each object that are to be rigid because they are selected."""
        return {ob.name: meshes.selected_vertices(ob.data) for ob in objects} if self.is_selected_rigid else {}


class MakesWeights(available.Explains, WeightSettings, InBackground):
    """What the operators that make weights have in common."""

    def tell(self: Any, report: reports.Report, warnings: Sequence[str] = ()) -> None:
        self.report({"WARNING"} if report.unweighted else {"INFO"}, report.sentence())
        for warning in warnings:
            self.report({"WARNING"}, warning)
        notice.redraw()


class ParentWithWeights(MakesWeights, bpy.types.Operator):
    """Parent the selected meshes to the active armature, with an Armature modifier, and make their weights from its
    deforming bones. All selected meshes are treated as one body, so clothes follow what they lie on. Locked vertex
    groups and groups of other bones stay"""

    bl_idname = "object.sinew_parent_with_weights"
    bl_label = "With Sinew Weights"

    @classmethod
    def why_not(cls, context):
        ob = context.active_object
        is_armature = ob is not None and ob.type == "ARMATURE"
        return available.other_mode(context, "OBJECT") or ("" if is_armature else "Select meshes, and an armature last")

    def assignment(self, context):
        armature = context.active_object
        objects = [ob for ob in context.selected_objects if ob.type == "MESH"]
        assigning.refuse(objects, armature)
        for ob in objects:
            parenting.refuse(ob, armature)
        context.view_layer.update()
        return assigning.Assignment(
            objects, armature, option_properties.read(self, AutomaticSettings), chosen_rigid=self.chosen_rigid(objects)
        )

    def finish(self, _context, made):
        report = made.write()
        for ob in made.objects:
            parenting.parent(ob, made.armature)
        warnings = [parenting.deformed_twice(ob, made.armature) for ob in made.objects]
        return self.tell(report, list(filter(None, warnings)))


class AssignFromBones(MakesWeights, bpy.types.Operator):
    """Make the weights of the selected bones from where the bones are. With a vertex or face mask, only the selected
    vertices change, and the weights of the others are fixed values that the new ones blend into. Locked vertex groups
    stay"""

    bl_idname = "object.sinew_assign_from_bones"
    bl_label = "Assign from Bones (Sinew)"
    modes = ("PAINT_WEIGHT",)

    def assignment(self, context):
        ob = context.active_object
        armature = bindable.find_armature(ob)
        if armature is None:
            raise ValueError(f"{ob.name} has no armature: give it an Armature modifier, or parent it to an armature")
        names = selection.selected_bones(armature)
        if not names:
            raise ValueError(
                f"no bone of {armature.name} is selected: select the bones whose weights to make (Ctrl or Shift+Ctrl "
                "and click in Weight Paint, if the armature is in Pose Mode)"
            )
        free = selection.masked(ob.data)
        return assigning.Assignment(
            [ob],
            armature,
            option_properties.read(self, AutomaticSettings),
            names,
            None if free is None else {ob.name: free},
            self.chosen_rigid([ob]),
        )

    def finish(self, _context, made):
        return self.tell(made.write())


class ChecksWeights(available.Explains, InBackground):
    """What the operators that check weights have in common."""

    computing = "checking weights"
    stopped = "Stopped: the weights were not checked"

    @classmethod
    def why_not(cls, context):
        why = available.other_mode(context, *available.MODES)
        return why or ("" if meshes_to_check(context) else "Select meshes, or an armature that moves some")

    def assignment(self: Any, context):
        return checking.Checking(self.objects(context), *astuple(option_properties.read(self, CheckSettings)))

    def objects(self, context: bpy.types.Context) -> list[bpy.types.Object]:
        return meshes_to_check(context)


@option_properties.added(CheckSettings)
class CheckWeights(ChecksWeights, bpy.types.Operator):
    """Look for vertices without weights, weights that do not sum to 1, too many bones per vertex, weights in bones that
    are far away, parts that move apart from the surface they lie on, bones that move nothing, and edges that a bent
    bone makes much longer"""

    bl_idname = "object.sinew_check_weights"
    bl_label = "Check Weights"
    bl_options = {"REGISTER"}

    def finish(self, _context, made):
        reports.remember(made.checkup)
        self.report({"INFO"}, made.checkup.sentence())
        notice.redraw()


def meshes_to_check(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Returns the selected meshes and the active one, and those of a selected armature, that an armature deforms."""
    chosen = {ob: None for ob in [*context.selected_objects, context.active_object] if ob is not None}
    found = {ob: None for ob in chosen if ob.type == "MESH" and ob.sinew.copy_of is None}
    if not found:
        found = {mesh: None for ob in chosen if ob.type == "ARMATURE" for mesh in bindable.meshes_of(context, ob)}
    return [ob for ob in found if bindable.find_armature(ob) is not None]


@option_properties.added(CheckSettings)
class SelectWeightProblem(ChecksWeights, bpy.types.Operator):
    """Select the vertices with this problem. In Weight Paint they are the mask; otherwise the mesh goes to Edit Mode"""

    bl_idname = "object.sinew_select_weight_problem"
    bl_label = "Select Vertices by Weight Problem"

    problem: EnumProperty(name="Problem", items=checking.PROBLEMS, description="Which vertices to select")
    object_name: StringProperty(name="Mesh", description="Only this mesh; empty: the active one", options={"HIDDEN"})

    def objects(self, context):
        chosen = context.view_layer.objects.get(self.object_name) if self.object_name else None
        return [chosen] if chosen is not None else meshes_to_check(context)

    def finish(self, context, made):
        candidates, found = made.objects, made.checkup
        counts = {ob.name: found.of[ob.name].count(self.problem) for ob in candidates}
        ob = max(candidates, key=lambda each: counts[each.name])
        selected = np.zeros(len(ob.data.vertices), bool)
        selected[found.of[ob.name].vertices[self.problem]] = True
        meshes.select_vertices(ob.data, selected)
        self.report({"INFO"}, f"{reports.counted(counts[ob.name], 'vertex', 'vertices')} of {ob.name} selected")
        if context.mode == "PAINT_WEIGHT" and ob == context.active_object:
            ob.data.use_paint_mask_vertex = True
        elif counts[ob.name]:
            self.show(context, ob)

    def show(self, context: bpy.types.Context, ob: bpy.types.Object) -> None:
        """Shows the selection in Edit Mode."""
        if ob.visible_get() and ob.data.library is None:
            if context.mode != "OBJECT":
                bpy.ops.object.mode_set(mode="OBJECT")
            selection.show_vertices(context, [ob])


class SelectReportedBones(available.Explains, bpy.types.Operator):
    """Select the bones that the last report names"""

    bl_idname = "object.sinew_select_reported_bones"
    bl_label = "Select Reported Bones"
    bl_options = {"REGISTER", "UNDO"}

    which: EnumProperty(
        name="Bones",
        description="Which bones to select",
        items=(
            ("OUTSIDE", "Outside the Mesh", "Bones of which no part is inside the meshes"),
            ("UNUSED", "Without Vertices", "Deforming bones that move no vertex"),
        ),
    )

    @classmethod
    def why_not(cls, context):
        why = available.other_mode(context, *available.MODES)
        return why or ("" if shown_report(context) is not None else "Check the weights first")

    def run(self, context):
        report = shown_report(context)
        names = getattr(report, "bones_outside", ()) if self.which == "OUTSIDE" else report.bones_without_vertices
        armature = context.view_layer.objects.get(report.armature)
        if armature is None or armature.type != "ARMATURE":
            raise ValueError(f"There is no armature {report.armature} in this view layer: check the weights again")
        if context.mode == "OBJECT" and armature.visible_get():
            selection.pose(context, armature)
        selection.select_bones(armature, set(names))
        self.report({"INFO"}, f"{reports.counted(len(names), 'bone')} of {armature.name} selected")


def shown_report(context: bpy.types.Context) -> Any:
    """Returns the last report if it is about the active object, otherwise None."""
    ob = context.active_object
    return None if ob is None else reports.last([ob.name])


# --- panel and menus ------------------------------------------------------------------------------


def draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draws the section Weights."""
    column = layout.column()
    if context.mode == "PAINT_WEIGHT":
        column.operator(AssignFromBones.bl_idname, icon="BONE_DATA")
    else:
        column.operator(ParentWithWeights.bl_idname, text="Parent with Sinew Weights", icon="BONE_DATA")
    column.operator(CheckWeights.bl_idname, icon="CHECKMARK")
    report = shown_report(context)
    if report is None:
        return
    box = layout.box().column(align=True)
    notice.draw_sentence(box, context, report.sentence(), bool(report.unweighted))
    for problem, text, count in report.problems():
        row = box.row()
        row.label(text=f"{count:,} {text}")
        button = row.operator(SelectWeightProblem.bl_idname, text="", icon=SELECT)
        button.problem, button.most_influences = problem, report.most_influences
        if problem == checks.STRETCHED:
            button.angle = math.radians(report.degrees)
            for text in report.worst_poses(3):
                box.label(text=text, icon="BONE_DATA")
    for which, text, names in (
        ("OUTSIDE", "outside the mesh", getattr(report, "bones_outside", ())),
        ("UNUSED", "without vertices", report.bones_without_vertices),
    ):
        if names:
            row = box.row()
            row.label(text=f"{reports.counted(len(names), 'bone')} {text}")
            row.operator(SelectReportedBones.bl_idname, text="", icon=SELECT).which = which


def draw_parent(menu: Any, _context: bpy.types.Context) -> None:
    menu.layout.separator()
    menu.layout.operator_context = "INVOKE_DEFAULT"
    menu.layout.operator(ParentWithWeights.bl_idname, text="Armature Deform With Sinew Weights")


def draw_assign(menu: Any, _context: bpy.types.Context) -> None:
    menu.layout.separator()
    menu.layout.operator(AssignFromBones.bl_idname)
    menu.layout.operator(CheckWeights.bl_idname)


CLASSES = (ParentWithWeights, AssignFromBones, CheckWeights, SelectWeightProblem, SelectReportedBones)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
