"""Writes what was found to the scene: an armature with an action, and meshes with weights beside the originals."""

from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from ..bake.frame_range import FrameRange
from ..blender import animation, meshes, nodes, weight_writing
from ..blender.selection import select
from ..rig_files import clip_keyframes, rig_import
from . import joints as joint_motions
from .joints import Joints, Keys
from .sampling import Clip

CHANNELS = ("location", "rotation_quaternion", "scale")
ERROR = "bone_error"  # name of the attribute: the largest distance of each vertex over the frames


def write(
    context: bpy.types.Context,
    objects: Sequence[bpy.types.Object],
    clip: Clip,
    joints: Joints,
    found: Any,
    frames: FrameRange,
) -> tuple[bpy.types.Object, list[bpy.types.Object]]:
    """Makes the armature and a mesh for each object, and selects them. found: a sinew_native.Decomposition. Returns the
    armature and the meshes. If an error occurs, nothing is left behind."""
    created: list[Any] = []
    active, selected = context.view_layer.objects.active, list(context.selected_objects)
    try:
        context.scene.frame_set(frames.first)
        copies = [_copied_mesh(context, ob, created) for ob in objects]
        armature = build_armature(context, objects[0], f"{objects[0].name}_bones", joints, created)
        armature.location = clip.origin
        rest = np.array([bone.matrix_local for bone in armature.data.bones], np.float64)
        exact = Joints(joints.names, joints.parents, rest, joints.lengths)
        keys, _played = joint_motions.keys_of(exact, found.poses, list(frames))
        used = [np.full(len(joints.names), is_used) for is_used in (True, True, keys.has_scales)]
        insert_keys(new_action(armature, f"{armature.name}_clip", used, created), keys, list(frames), used)
        made = [
            _build_mesh(ob, mesh, armature, clip, number, joints.names, found, created)
            for number, (ob, mesh) in enumerate(zip(objects, copies))
        ]
    except BaseException:  # also an interrupt
        rig_import.remove(created)
        select(context, active, selected)
        raise
    select(context, armature, (armature, *made))
    return armature, made


def _copied_mesh(context, ob, created):
    """Returns a new mesh as modifiers have made it, with its materials and UV maps."""
    graph = context.evaluated_depsgraph_get()
    mesh = bpy.data.meshes.new_from_object(ob.evaluated_get(graph), preserve_all_data_layers=True, depsgraph=graph)
    created.append(mesh)
    mesh.name = f"{ob.name}_baked"
    meshes.remove_attribute(mesh, nodes.POSITION_ATTRIBUTE)  # of a bound mesh that Blender has deformed
    if ob.evaluated_get(graph).matrix_world.determinant() < 0:  # positions will be those of world space
        mesh.flip_normals()
    return mesh


def link(context: bpy.types.Context, ob: bpy.types.Object, beside: bpy.types.Object) -> None:
    """Links a new object where another one is, or else to the scene's own collection, which is always shown."""
    homes = [each for each in beside.users_collection if each.library is None and each.override_library is None]
    (homes or [context.scene.collection])[0].objects.link(ob)
    if context.view_layer.objects.get(ob.name) != ob or not ob.visible_get():
        for home in ob.users_collection:
            home.objects.unlink(ob)
        context.scene.collection.objects.link(ob)


def build_armature(
    context: bpy.types.Context, beside: bpy.types.Object, name: str, joints: Joints, created: list[Any]
) -> bpy.types.Object:
    """Makes an armature of joints, beside an object, and selects it alone. created: gets what was made."""
    data = bpy.data.armatures.new(name)
    created.append(data)
    armature = bpy.data.objects.new(data.name, data)
    created.append(armature)
    link(context, armature, beside)
    select(context, armature, (armature,))  # other armatures would go into Edit Mode, too
    bpy.ops.object.mode_set(mode="EDIT")
    bones: list[bpy.types.EditBone] = []
    for bone_name, parent, rest, length in zip(joints.names, joints.parents.tolist(), joints.rest, joints.lengths):
        bone = data.edit_bones.new(bone_name)
        bone.head = rest[:3, 3]
        bone.tail = rest[:3, 3] + length * rest[:3, 1]
        if not np.array_equal(rest[:3, :3], np.eye(3)):  # it would be rounded
            bone.matrix = Matrix(rest.tolist())
        if parent >= 0:
            bone.parent = bones[parent]
        bones.append(bone)
    bpy.ops.object.mode_set(mode="OBJECT")
    armature.show_in_front = True
    return armature


def new_action(
    armature: bpy.types.Object, name: str, used: Sequence[np.ndarray], created: list[Any]
) -> bpy.types.Action:
    """Makes an action with the F-curves of bones that insert_keys fills, has the armature play it, and returns it.
    used: which bones get keys of their location, rotation and scale, (J,) bools each. created: gets what was made."""
    action = bpy.data.actions.new(name)
    created.append(action)
    (armature.animation_data or armature.animation_data_create()).action = action
    for number, j, component in _curves_of(used):
        bone = armature.pose.bones[j]
        bone.rotation_mode = "QUATERNION"
        clip_keyframes.new_curve(armature, action, bone.path_from_id(CHANNELS[number]), component, bone.name)
    return action


def insert_keys(
    action: bpy.types.Action,
    keys: Keys,
    frames: Sequence[int],
    used: Sequence[np.ndarray],
    kept: Sequence[np.ndarray] | None = None,
) -> None:
    """Fills an action of new_action, or a copy of it, with keys. kept: on which frames, (F, J) bools each; None: on
    all."""
    values = np.concatenate((keys.locations, keys.rotations, keys.scales), axis=2)  # (F, J, 10)
    points = np.empty((*values.shape[1:], len(frames), 2), np.float32)
    points[..., 0], points[..., 1] = frames, np.moveaxis(values, 0, 2)
    for (number, j, component), curve in zip(_curves_of(used), animation.action_curves(action), strict=True):
        own = points[j, (0, 3, 7)[number] + component]
        clip_keyframes.fill(curve, own if kept is None else own[kept[number][:, j]])


def _curves_of(used):
    """Yields (number of the channel, bone, component) of each curve, in the order in which an action has them."""
    for j in np.flatnonzero(np.any(used, axis=0)).tolist():
        for number, size in enumerate((3, 4, 3)):
            if used[number][j]:
                for component in range(size):
                    yield number, j, component


def _build_mesh(beside, mesh, armature, clip, number, names, found, created):
    """Returns the object of the mesh, in the space of the armature, with groups of the joints that move it."""
    first, last = clip.starts[number], clip.starts[number + 1]
    meshes.write_positions(mesh, clip.rest[first:last])
    ob = bpy.data.objects.new(mesh.name, mesh)
    created.append(ob)
    link(bpy.context, ob, beside)
    ob.vertex_groups.clear()
    begin, end = found.offsets[first], found.offsets[last]
    used, groups = np.unique(found.joints[begin:end], return_inverse=True)
    for joint in used:
        ob.vertex_groups.new(name=names[joint])
    weight_writing.replace(ob, found.offsets[first : last + 1] - begin, groups, found.weights[begin:end])
    meshes.remove_attribute(mesh, ERROR)
    mesh.attributes.new(ERROR, "FLOAT", "POINT").data.foreach_set("value", found.vertex_largest[first:last])
    ob.parent = armature
    ob.modifiers.new("Armature", "ARMATURE").object = armature
    return ob
