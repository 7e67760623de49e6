"""Exports a mesh, its skeleton, weights and poses as a rig folder; or its skin, for a rig that is computed without
Blender."""

import contextlib
import os
import secrets
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from ..blender import armatures, meshes, values
from ..clips import clip_store
from ..deform.clips import transformed
from ..deform.influences import Bones, Rules, columns_of_groups, influences
from ..feedback import progress
from ..native import sinew_native
from ..plan import bindable
from . import rig_import
from .file_options import ExportOptions


def mesh_to_export(context: Any, armature: Any, name: str | None) -> Any:
    """Returns the mesh object of that name, or without a name the only one that the armature deforms. Raises
    ValueError."""
    deformed = bindable.meshes_of(context, armature)
    names = ", ".join(ob.name for ob in deformed) or "none"
    found = [ob for ob in deformed if name in (None, ob.name)]
    if not found:
        raise ValueError(f"there is no mesh {name} that {armature.name} deforms; those that it deforms: {names}")
    if len(found) > 1:
        raise ValueError(f"choose a mesh with --mesh NAME; those that {armature.name} deforms: {names}")
    return found[0]


def skin_of(context: Any, ob: Any, armature: Any) -> dict[str, Any]:
    """Returns the arguments of sinew_native.Skin for a mesh at rest, without shape keys, in armature space. Its joints
    are those of RigProgram.joint_begin. Masks and other modifiers are left out."""
    modifier = bindable.armature_modifier(ob, armature)
    rules = Rules(modifier.use_vertex_groups, modifier.use_bone_envelopes) if modifier else Rules()
    evaluated = armature.evaluated_get(context.evaluated_depsgraph_get())
    bones = Bones(**armatures.read_bones(evaluated))
    rest = transformed(values.relative_matrix(armature, ob), meshes.read_positions(ob.data).astype(np.float64))
    index = {name: number for number, name in enumerate(bones.names)}
    own = influences(
        *meshes.read_object_weights(ob),
        np.array([index.get(group.name, -1) for group in ob.vertex_groups], np.int32),
        bones,
        rules,
        lambda: rest,
        lambda bone, point: armatures.segment_at(evaluated, bone, point),
    )
    # A deformer has no joints for bones that do not deform; a program has.
    counts = np.where(bones.segments > 1, bones.segments + 1, 1)
    joints = np.flatnonzero(np.repeat(bones.deform, counts))
    return {
        "rest_positions": rest.astype(np.float32),
        "offsets": own.offsets,
        "joints": joints[own.joints].astype(np.int32),
        "weights": own.weights,
        "joint_count": int(counts.sum()),
    }


def export_rig(context: Any, ob: Any, skeleton_path: str, options: ExportOptions, shown: Any = progress.SILENT) -> None:
    """Writes mesh.obj, the skeleton, weights.dmat and, if there are poses, pose.dmat or anim.dmat. Raises ValueError
    with the reason."""
    armature = bindable.find_armature(ob)
    if armature is None:
        raise ValueError(f"{ob.name} has no armature: give it one, or choose another mesh")
    folder, skeleton_name = os.path.split(os.path.abspath(skeleton_path))
    if not os.path.isdir(folder):
        raise ValueError(f"There is no folder {folder}: make it first")

    from_file = clip_store.has_skeleton(armature.data)
    files_from_mesh = np.eye(4) if from_file else np.linalg.inv(rig_import.orientation(options.up_axis))
    if from_file:
        skeleton = clip_store.load_skeleton(armature.data)
        joints = clip_store.own_joints(armature)
        names = skeleton.names
    else:
        skeleton, names = skeleton_from_bones(armature, files_from_mesh @ values.relative_matrix(ob, armature))
        joints = np.arange(len(names))

    poses = matrices = None
    plays_clip = clip_store.has_poses(armature.data) and ob.sinew.source == "CLIP"
    drive = armature.animation_data
    is_animated = bool(drive and (drive.action or drive.nla_tracks or drive.drivers)) and not plays_clip
    if options.animation == "AUTO" and from_file and not is_animated:
        poses, matrices = clip_store.load_poses(armature.data)
    if options.animation == "FRAMES" or options.animation == "AUTO" and is_animated:
        matrices = sample_frames(context, ob, armature, joints, len(names), shown)
        matrices = files_from_mesh @ matrices @ np.linalg.inv(files_from_mesh)

    left = [
        name
        for name, written in (("pose.dmat", poses), ("anim.dmat", matrices))
        if written is None and os.path.exists(os.path.join(folder, name))
    ]
    if left:
        raise ValueError(
            f"{folder} has {left[0]} from another rig, which the next import would read with this one; remove it, "
            "or choose another folder"
        )
    mesh = ob.data
    face_offsets, face_vertices, face_materials = meshes.read_faces(mesh)
    material_names = [material.name if material else "none" for material in mesh.materials]
    library = "mesh.mtl" if material_names else ""
    rig = sinew_native.Rig(
        transformed(files_from_mesh, meshes.read_positions(mesh)),
        face_offsets,
        face_vertices,
        skeleton,
        dense_weights(ob, names, skeleton.weight_columns),
        poses,
        matrices,
        np.minimum(face_materials, len(material_names) - 1) if material_names else None,
        material_names,
        library,
    )
    with contextlib.ExitStack() as written:
        if library:
            written.enter_context(replaced(os.path.join(folder, library), colors(mesh.materials)))
        sinew_native.write_rig(folder, rig, skeleton=skeleton_name)


def skeleton_from_bones(armature: Any, files_from_armature: np.ndarray) -> tuple[Any, list[str]]:
    """Returns a skeleton in the joint convention, in the space of the files, and the bones' names. Every joint has a
    column of weights, even if it is all zeros: a root without one would be read as the bone convention."""
    bones = [pose_bone.bone for pose_bone in armature.pose.bones]
    index = {bone.name: i for i, bone in enumerate(bones)}
    parents = np.array([index[bone.parent.name] if bone.parent else -1 for bone in bones], np.int32)
    heads = transformed(files_from_armature, np.array([bone.head_local for bone in bones], float))
    tails = transformed(files_from_armature, np.array([bone.tail_local for bone in bones], float))
    names = [bone.name for bone in bones]
    skeleton = sinew_native.RigSkeleton(parents, heads, tails, np.arange(len(bones)), names, "joint")
    return skeleton, names


def dense_weights(ob: Any, names: Sequence[str], columns: np.ndarray) -> np.ndarray:
    """Returns (V, columns): the weights of each joint's vertex group, unchanged from the mesh."""
    offsets, groups, weights = meshes.read_object_weights(ob)
    column = np.append(columns, -1)[columns_of_groups(ob.vertex_groups.keys(), names)][groups]
    rows = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    dense = np.zeros((len(offsets) - 1, int(np.max(columns, initial=-1)) + 1))
    used = column >= 0
    dense[rows[used], column[used]] = weights[used]
    return dense


def sample_frames(context: Any, ob: Any, armature: Any, joints: np.ndarray, joint_count: int, shown: Any) -> np.ndarray:
    """Returns (F, J, 4, 4): skinning matrices for the scene's frames, in the space of the mesh."""
    scene = context.scene
    current = scene.frame_current
    frames = []
    try:
        for frame in range(scene.frame_start, scene.frame_end + 1):
            shown.step((frame - scene.frame_start) / (scene.frame_end + 1 - scene.frame_start), f"frame {frame}")
            scene.frame_set(frame)
            depsgraph = context.evaluated_depsgraph_get()
            evaluated = armature.evaluated_get(depsgraph)
            to_mesh = values.relative_matrix(ob.evaluated_get(depsgraph), evaluated)
            channels = armatures.read_channels(evaluated).astype(float)
            matrices = np.tile(np.eye(4), (joint_count, 1, 1))
            has_joint = joints >= 0
            matrices[joints[has_joint]] = (to_mesh @ channels @ np.linalg.inv(to_mesh))[has_joint]
            frames.append(matrices)
    finally:
        scene.frame_set(current)
    return np.array(frames)


def colors(materials: Iterable[Any]) -> str:
    """Returns the text of an .mtl file."""
    text = ""
    for material in materials:
        color = material.diffuse_color[:3] if material else (0.8, 0.8, 0.8)
        text += f"newmtl {material.name if material else 'none'}\n"
        text += "Kd {:.6g} {:.6g} {:.6g}\n".format(*color)
    return text


@contextlib.contextmanager
def replaced(path: str, text: str) -> Iterator[None]:
    """Writes a file that replaces the one at path when the `with` block succeeds; if it fails, the old file stays."""
    neighbour = f"{path}.partial-{secrets.token_hex(4)}"
    try:
        with open(neighbour, "x", encoding="utf-8") as file:
            file.write(text)
        yield
        os.replace(neighbour, path)
    finally:
        if os.path.exists(neighbour):
            os.remove(neighbour)
