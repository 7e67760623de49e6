"""Selects objects, bones and vertices, and shows them in the mode in which they can be seen."""

from collections.abc import Collection, Sequence

import bpy
import numpy as np

from . import meshes


def select(context: bpy.types.Context, active: bpy.types.Object, objects: Sequence[bpy.types.Object]) -> None:
    """Makes an object the active one, and selects these alone."""
    for ob in context.selected_objects:
        ob.select_set(False)
    for ob in objects:
        ob.select_set(True)
    context.view_layer.objects.active = active


def pose(context: bpy.types.Context, armature: bpy.types.Object) -> None:
    """Selects only an armature object that is visible, and goes to Pose Mode with it."""
    select(context, armature, (armature,))
    bpy.ops.object.mode_set(mode="POSE")


def select_bones(armature: bpy.types.Object, names: Collection[str]) -> None:
    """Selects only the bones of these names."""
    for bone in armature.pose.bones:
        owner = bone if hasattr(bone, "select") else bone.bone  # 5.0, before
        owner.select = bone.name in names


def selected_bones(armature: bpy.types.Object) -> list[str]:
    """Returns the names of the selected bones."""
    return [bone.name for bone in armature.pose.bones if (bone.select if hasattr(bone, "select") else bone.bone.select)]


def show_vertices(context: bpy.types.Context, objects: Sequence[bpy.types.Object]) -> None:
    """Shows the selected vertices of those of the mesh objects that are visible, in Edit Mode."""
    shown = [ob for ob in objects if ob.visible_get()]
    if shown:
        select(context, shown[0], shown)
        context.tool_settings.mesh_select_mode = (True, False, False)
        bpy.ops.object.mode_set(mode="EDIT")


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
