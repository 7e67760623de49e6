"""Imports a rig folder into the scene: mesh, vertex groups, armature, clip."""

import math
import os
from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np

from ..blender import bounds, meshes, selection, weight_writing
from ..clips import clip_store
from ..feedback import progress
from ..install import bind, deformed_copy, shared_group
from ..native import sinew_native
from .file_options import AUTO, FileOptions, ImportOptions

# Blender removes bones of zero length; this fraction of the rig's size is short but visible.
SHORTEST_BONE = 0.02
Y_UP_TO_Z_UP = ((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1))


def import_rig(
    context: bpy.types.Context, skeleton_path: str, options: ImportOptions, shown: Any = progress.SILENT
) -> tuple[bpy.types.Object, bpy.types.Object, str]:
    """Imports a rig folder. All files are read first: their errors raise ValueError before the scene is changed. After
    a later error, everything that was built is removed. Returns the mesh object and the armature object, bound and
    selected, and a remark on the files for the user: a sentence, or ""."""
    shown.step(0.0, f"reading {skeleton_path}")
    folder, skeleton_name = os.path.split(os.path.abspath(skeleton_path))
    rig = read_rig(folder, skeleton_name, options)
    colors = read_colors(os.path.join(folder, rig.material_library))

    name = os.path.basename(folder) or "rig"
    created: list[Any]
    scene, active, created = context.scene, context.view_layer.objects.active, []
    frame_end = scene.frame_end
    try:
        shown.step(0.3, f"building the armature of {name}")
        armature = build_armature(context, name, rig, created)
        clip_store.store(armature.data, rig, os.path.splitext(skeleton_name)[1].lower())
        shown.step(0.4, f"building the mesh of {name}")
        mesh_object = build_mesh(context, name, rig, armature, colors, created)
        to_world = orientation(options.up_axis)
        to_world[:3] *= options.scale
        armature.matrix_world = to_world.T  # Blender fills it column by column
        set_playback(scene, armature, options)
        context.view_layer.update()
        shown.step(0.8, f"binding {name}")
        bind.bind(
            mesh_object,
            armature,
            options.output,
            options.method,
            options.source if clip_store.has_poses(armature.data) else "ARMATURE",
        )
    except BaseException:  # also an interrupt
        remove(created)
        scene.frame_end = frame_end
        context.view_layer.objects.active = active
        raise
    selection.select(context, mesh_object, (armature, mesh_object))
    return mesh_object, armature, remark_on(rig, folder, options)


def remove(created: Sequence[Any]) -> None:
    """Removes data-blocks. created: in the order in which they were made."""
    if bpy.context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    for data in reversed(created):
        if isinstance(data, bpy.types.Object):
            deformed_copy.remove(data)
        bpy.data.batch_remove([data])
    shared_group.see_to()


def remark_on(rig: Any, folder: str, options: FileOptions) -> str:
    """Returns a sentence about what reading has changed or made, or "" if nothing."""
    if not options.weights and weights_to_read(folder, options) == AUTO:
        return f"there is no weights.dmat in {folder}, so the weights were made from the bones"
    name, count = options.weights or "weights.dmat", rig.clamped_weights
    if not count:
        return ""
    return (
        f"{name} has {count:,} {'weight' if count == 1 else 'weights'} below 0 or above 1, which vertex groups cannot "
        "hold: each was set to 0 or 1, and the weights of its vertex were normalized"
    )


def weights_to_read(folder: str, options: FileOptions) -> str | None:
    """Returns what to pass to read_rig: the name of a file, None for the usual one, or AUTO."""
    if options.weights or os.path.exists(os.path.join(folder, "weights.dmat")):
        return options.weights or None
    return AUTO


def orientation(up_axis: str) -> np.ndarray:
    """Returns (4, 4): the transform to Blender's axes from files in which up_axis, "Y" or "Z", points up."""
    return np.array(Y_UP_TO_Z_UP if up_axis == "Y" else np.eye(4), float)


def read_rig(folder: str, skeleton_name: str, options: FileOptions) -> Any:
    """Reads the files that the options name, with the options' conventions. Raises ValueError or OSError."""
    return sinew_native.read_rig(
        folder,
        skeleton=skeleton_name,
        mesh=options.mesh or None,
        weights=weights_to_read(folder, options),
        pose=options.pose or None,
        convention=None if options.convention == "AUTO" else options.convention.lower(),
        quaternion_order=options.quaternion_order.lower(),
    )


def set_playback(scene: bpy.types.Scene, armature: bpy.types.Object, options: ImportOptions) -> None:
    """Sets the clip's mode: up to two poses swing, more play from the scene's first frame."""
    count = clip_store.pose_count(armature.data)
    settings = armature.sinew_clip
    settings.mode = "PLAYBACK" if count > 2 else "SWING"
    settings.frame_start = scene.frame_start
    if options.frame_rate > 0:
        settings.speed = options.frame_rate * scene.render.fps_base / scene.render.fps
    if count > 2 and options.source == "CLIP" and options.set_frame_range:
        scene.frame_end = scene.frame_start + max(math.ceil((count - 1) / settings.speed), 1)


def build_armature(context: bpy.types.Context, name: str, rig: Any, created: list[Any]) -> bpy.types.Object:
    """Builds an armature with one bone per joint, in the space of the rig. Each bone stores the number of its joint."""
    skeleton = rig.skeleton
    data = bpy.data.armatures.new(f"{name}_armature")
    created.append(data)
    armature = bpy.data.objects.new(data.name, data)
    created.append(armature)
    context.collection.objects.link(armature)
    context.view_layer.objects.active = armature
    heads, tails = np.array(skeleton.heads), visible_tails(rig)
    # A connected bone cannot be moved, but the frames of an animation may require that.
    may_connect = rig.animation is None or rig.poses is not None

    bpy.ops.object.mode_set(mode="EDIT")
    bones = []
    for joint, joint_name in enumerate(skeleton.names):
        bone = armature.data.edit_bones.new(joint_name)
        bone.head, bone.tail = heads[joint], tails[joint]
        bone.use_deform = bool(skeleton.weight_columns[joint] >= 0)
        bones.append(bone)
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            bones[joint].parent = bones[parent]
            bones[joint].use_connect = bool(may_connect and np.array_equal(heads[joint], tails[parent]))
    names = [bone.name for bone in bones]
    bpy.ops.object.mode_set(mode="OBJECT")

    for joint, bone_name in enumerate(names):
        armature.data.bones[bone_name][clip_store.JOINT_PROPERTY] = joint
    armature.show_in_front = True
    return armature


def visible_tails(rig: Any) -> np.ndarray:
    """Returns (J, 3): the bones' tails, adjusted so that no bone has zero length."""
    heads, tails = np.array(rig.skeleton.heads), np.array(rig.skeleton.tails)
    shortest = SHORTEST_BONE * (bounds.diagonal(rig.positions) or 1)
    degenerate = np.linalg.norm(tails - heads, axis=1) < 1e-3 * shortest
    tails[degenerate] = heads[degenerate] + (0, shortest, 0)
    return tails


def build_mesh(
    context: bpy.types.Context,
    name: str,
    rig: Any,
    armature: bpy.types.Object,
    colors: dict[str, tuple[float, ...]],
    created: list[Any],
) -> bpy.types.Object:
    """Builds the mesh with one vertex group per deforming bone, attached to the armature as Blender users expect:
    parented, and with an Armature modifier (which binding then takes over)."""
    mesh = meshes.new_mesh(name, rig.positions, rig.face_offsets, rig.face_vertices)
    created.append(mesh)
    ob = bpy.data.objects.new(name, mesh)
    created.append(ob)
    context.collection.objects.link(ob)
    assign_materials(mesh, rig, colors, created)

    names = {bone[clip_store.JOINT_PROPERTY]: bone.name for bone in armature.data.bones}
    columns = []
    for joint, column in enumerate(rig.skeleton.weight_columns):
        if column >= 0:
            ob.vertex_groups.new(name=names[joint])
            columns.append(column)
    own = sinew_native.WeightTable.from_dense(np.asarray(rig.weights)[:, columns])
    vertices = np.repeat(np.arange(len(own.offsets) - 1), np.diff(own.offsets))
    order = np.lexsort((-own.weights, vertices))  # the largest of a vertex first
    weight_writing.replace(ob, own.offsets, own.bones[order], own.weights[order])

    ob.parent = armature
    modifier = ob.modifiers.new("Armature", "ARMATURE")
    modifier.object = armature
    return ob


def assign_materials(mesh: bpy.types.Mesh, rig: Any, colors: dict[str, tuple[float, ...]], created: list[Any]) -> None:
    if not rig.material_names or len(mesh.polygons) != len(rig.face_materials):
        return
    for material_name in rig.material_names:
        material = bpy.data.materials.new(material_name)
        created.append(material)
        color = (*colors.get(material_name, (0.8, 0.8, 0.8)), 1.0)
        material.diffuse_color = color
        if material.node_tree is None:  # before 5.0
            material.use_nodes = True
        shader = next((n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED"), None)
        if shader:
            shader.inputs["Base Color"].default_value = color
        mesh.materials.append(material)
    mesh.polygons.foreach_set("material_index", np.maximum(rig.face_materials, 0).astype(np.int32))


def read_colors(path: str) -> dict[str, tuple[float, ...]]:
    """Returns {material: (r, g, b)} from the `Kd` lines of an .mtl file; empty if there is no such file."""
    colors: dict[Any, tuple[float, ...]]
    material: str | None
    colors, material = {}, None
    if not os.path.isfile(path):
        return colors
    for line in read_text(path).splitlines():
        words = line.split()
        if words[:1] == ["newmtl"]:
            material = line.split(None, 1)[1].strip() if len(words) > 1 else None
        elif words[:1] == ["Kd"] and len(words) >= 4:
            try:
                colors[material] = tuple(float(word) for word in words[1:4])
            except ValueError:
                pass  # colours are not essential: an unreadable one stays grey
    return colors


def read_text(path: str) -> str:
    """Reads text as the native readers do: as UTF-8, or, if it is not valid UTF-8, as Latin-1."""
    with open(path, "rb") as file:
        data = file.read()
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")
