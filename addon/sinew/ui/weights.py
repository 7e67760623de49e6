"""Operators that make weights from bones, check weights, and select what the report names."""

import math
from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ..blender import meshes
from ..feedback import notice
from ..plan import bindable
from ..weights import assigning, bone_segments, checking, checks, parenting, pose_checks, reports, rigid
from . import available
from .in_background import InBackground

ENDS = (
    (
        bone_segments.AUTOMATIC,
        "Automatic",
        "To the tail, unless most tails are far from the next bone, as in rigs from files without tails",
    ),
    (bone_segments.TAIL, "Head to Tail", "The bones as they are drawn"),
    (bone_segments.CHILD, "Head to Child", "To the next bone. For imported rigs, whose tails are guesses"),
)


SELECT = "RESTRICT_SELECT_OFF"  # an icon


class WeightSettings:
    """The properties of the operators that make weights."""

    ends: EnumProperty(name="Bones", description="The line that each bone stands for", items=ENDS)
    stiffness: FloatProperty(
        name="Stiffness",
        description="How closely weights follow the nearest bone: small values are soft, large ones stiff",
        default=8.0,
        min=0.1,
        soft_max=50.0,
        max=1e4,
    )
    resolution: IntProperty(
        name="Resolution",
        description="Voxels along the longest side, which measure distances inside the mesh",
        default=128,
        min=16,
        max=256,
    )
    max_influences: IntProperty(
        name="Most Bones",
        description="The largest number of bones per vertex, for game engines often 4; 0: no limit",
        default=0,
        min=0,
        soft_max=8,
    )
    rigid_size: FloatProperty(
        name="Rigid Parts",
        description="Loose parts that are smaller than this share of the mesh's size do not bend: buttons, buckles, "
        "teeth, eyes. 0: all parts bend",
        default=rigid.SIZE,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        precision=3,
    )
    rigid_follow: EnumProperty(
        name="They Follow",
        description="What rigid parts follow",
        items=(
            ("attachment", "Surface", "The closest point of the rest of the mesh"),
            ("bone", "One Bone", "The bone that moves them most"),
        ),
    )

    rigid_group: StringProperty(
        name="Rigid Group",
        description="Vertices in the vertex group of this name do not bend: each connected piece of them is rigid",
        default=rigid.GROUP,
    )
    is_selected_rigid: BoolProperty(
        name="Selected Are Rigid",
        description="The vertices that are selected in Edit Mode do not bend: each connected piece of them is rigid",
        default=False,
    )

    def weight_settings(self: Any) -> assigning.Settings:
        return assigning.Settings(
            self.ends,
            self.resolution,
            self.stiffness,
            self.max_influences,
            self.rigid_size,
            self.rigid_follow,
            self.rigid_group,
        )

    def chosen_rigid(self: Any, objects: Any) -> dict[str, np.ndarray]:
        """Returns the vertices of each object that are to be rigid because they are selected."""
        return {ob.name: meshes.selected_vertices(ob.data) for ob in objects} if self.is_selected_rigid else {}


class MakesWeights(available.Explains, WeightSettings, InBackground):
    """What the operators that make weights have in common."""

    def tell(self: Any, report: reports.Report, warnings: Sequence[str] = ()) -> set[str]:
        self.report({"WARNING"} if report.unweighted else {"INFO"}, report.sentence())
        for warning in warnings:
            self.report({"WARNING"}, warning)
        notice.redraw()
        return {"FINISHED"}


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
            why = parenting.why_not(ob, armature)
            if why:
                raise ValueError(f"{ob.name} {why}")
        context.view_layer.update()
        return assigning.Assignment(objects, armature, self.weight_settings(), chosen_rigid=self.chosen_rigid(objects))

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

    @classmethod
    def why_not(cls, context):
        return available.other_mode(context, "PAINT_WEIGHT")

    def assignment(self, context):
        ob = context.active_object
        armature = bindable.find_armature(ob)
        if armature is None:
            raise ValueError(f"{ob.name} has no armature: give it an Armature modifier, or parent it to an armature")
        names = selected_bones(armature)
        if not names:
            raise ValueError(
                f"no bone of {armature.name} is selected: select the bones whose weights to make (Ctrl or Shift+Ctrl "
                "and click in Weight Paint, if the armature is in Pose Mode)"
            )
        free = masked(ob.data)
        return assigning.Assignment(
            [ob],
            armature,
            self.weight_settings(),
            names,
            None if free is None else {ob.name: free},
            self.chosen_rigid([ob]),
        )

    def finish(self, _context, made):
        return self.tell(made.write())


def selected_bones(armature: bpy.types.Object) -> list[str]:
    """Returns the names of the selected bones."""
    return [bone.name for bone in armature.pose.bones if (bone.select if hasattr(bone, "select") else bone.bone.select)]


def enter_pose_mode(context: bpy.types.Context, armature: bpy.types.Object) -> None:
    """Selects only an armature object that is visible, and goes to Pose Mode with it."""
    for other in context.selected_objects:
        other.select_set(False)
    armature.select_set(True)
    context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="POSE")


def select_bones(armature: bpy.types.Object, names: Any) -> None:
    """Selects only the bones of these names."""
    for bone in armature.pose.bones:
        owner = bone if hasattr(bone, "select") else bone.bone  # 5.0, before
        owner.select = bone.name in names


def masked(mesh: bpy.types.Mesh) -> np.ndarray | None:
    """Returns the vertices that the mask of Weight Paint lets tools change, (V,) bool; None without a mask."""
    if not mesh.use_paint_mask_vertex and not mesh.use_paint_mask:
        return None
    if mesh.use_paint_mask_vertex:
        return meshes.selected_vertices(mesh)
    faces = np.empty(len(mesh.polygons), bool)
    mesh.polygons.foreach_get("select", faces)
    _edges, offsets, corners = meshes.read_topology(mesh)
    selected = np.zeros(len(mesh.vertices), bool)
    selected[corners[np.repeat(faces, np.diff(offsets))]] = True
    return selected


class ChecksWeights(available.Explains, InBackground):
    """What the operators that check weights have in common."""

    computing = "checking weights"
    stopped = "Stopped: the weights were not checked"

    @classmethod
    def why_not(cls, context):
        why = available.other_mode(context, *available.MODES)
        return why or ("" if meshes_to_check(context) else "Select meshes, or an armature that moves some")

    def assignment(self: Any, context):
        return checking.Checking(self.objects(context), self.most_influences, math.degrees(self.angle))

    def objects(self, context: bpy.types.Context) -> list[bpy.types.Object]:
        return meshes_to_check(context)


class CheckWeights(ChecksWeights, bpy.types.Operator):
    """Look for vertices without weights, weights that do not sum to 1, too many bones per vertex, weights in bones that
    are far away, parts that move apart from the surface they lie on, bones that move nothing, and edges that a bent
    bone makes much longer"""

    bl_idname = "object.sinew_check_weights"
    bl_label = "Check Weights"
    bl_options = {"REGISTER"}

    most_influences: IntProperty(
        name="Most Bones",
        description="Find vertices with more bones than this",
        default=checks.MOST_INFLUENCES,
        min=1,
        soft_max=16,
    )
    angle: FloatProperty(
        name="Test Poses",
        description="The angle by which each bone is bent to see how far it stretches the mesh",
        default=math.radians(pose_checks.ANGLE),
        min=0.0,
        max=math.pi,
        subtype="ANGLE",
    )

    def finish(self, _context, made):
        reports.remember(made.checkup)
        self.report({"INFO"}, made.checkup.sentence())
        notice.redraw()
        return {"FINISHED"}


def meshes_to_check(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Returns the selected meshes and the active one, and those of a selected armature, that an armature deforms."""
    chosen = {ob: None for ob in [*context.selected_objects, context.active_object] if ob is not None}
    found = {ob: None for ob in chosen if ob.type == "MESH" and ob.sinew.copy_of is None}
    if not found:
        found = {mesh: None for ob in chosen if ob.type == "ARMATURE" for mesh in bindable.meshes_of(context, ob)}
    return [ob for ob in found if bindable.find_armature(ob) is not None]


class SelectWeightProblem(ChecksWeights, bpy.types.Operator):
    """Select the vertices with this problem. In Weight Paint they are the mask; otherwise the mesh goes to Edit Mode"""

    bl_idname = "object.sinew_select_weight_problem"
    bl_label = "Select Vertices by Weight Problem"

    problem: EnumProperty(name="Problem", items=checking.PROBLEMS, description="Which vertices to select")
    most_influences: IntProperty(
        name="Most Bones", description="For the vertices with more bones than this", default=4, min=1
    )
    angle: FloatProperty(
        name="Test Poses",
        description="The angle by which each bone is bent, for stretched vertices",
        default=math.radians(pose_checks.ANGLE),
        subtype="ANGLE",
    )
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
        return {"FINISHED"}

    def show(self, context: bpy.types.Context, ob: bpy.types.Object) -> None:
        """Shows the selection in Edit Mode."""
        if not ob.visible_get() or ob.data.library is not None:
            return
        if context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        for other in context.selected_objects:
            other.select_set(other == ob)
        ob.select_set(True)
        context.view_layer.objects.active = ob
        context.tool_settings.mesh_select_mode = (True, False, False)
        bpy.ops.object.mode_set(mode="EDIT")


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

    def execute(self, context):
        report = shown_report(context)
        names = getattr(report, "bones_outside", ()) if self.which == "OUTSIDE" else report.bones_without_vertices
        armature = context.view_layer.objects.get(report.armature)
        if armature is None or armature.type != "ARMATURE":
            self.report(
                {"ERROR"}, f"There is no armature {report.armature} in this view layer: check the weights again"
            )
            return {"CANCELLED"}
        if context.mode == "OBJECT" and armature.visible_get():
            enter_pose_mode(context, armature)
        select_bones(armature, set(names))
        self.report({"INFO"}, f"{reports.counted(len(names), 'bone')} of {armature.name} selected")
        return {"FINISHED"}


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
