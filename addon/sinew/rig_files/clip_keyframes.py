"""Writes the clip of an imported rig as ordinary keyframes, which an animator can edit."""

from typing import Any

import bpy
import numpy as np

from ..clips import clip_store, posing
from ..feedback import progress
from ..run import characters


def clip_armature(ob: bpy.types.Object | None) -> bpy.types.Object | None:
    """Returns an object, if it is an armature, or else its armature; None if that has no imported poses."""
    if ob is None:
        return None
    armature = ob if ob.type == "ARMATURE" else ob.sinew.armature
    has_poses = armature is not None and clip_store.has_poses(armature.data)
    return armature if has_poses else None


def insert(
    scene: bpy.types.Scene, armature: bpy.types.Object, first: int, last: int, shown: Any = progress.SILENT
) -> int:
    """Keys the location and rotation of every bone on the frames first to last, in one action, and makes the bound
    meshes follow the armature from now on. Returns the number of frames."""
    frames = np.arange(first, last + 1)
    player = clip_store.ClipPlayer(armature)
    settings = armature.sinew_clip
    poses: Any = []
    for frame in frames:
        time, loop = posing.clip_time(settings, player.clip.length, float(frame), scene.render)
        _, location, rotation = player.at(time, loop, rest=settings.mode == "REST")
        poses.append(np.concatenate((location, rotation), axis=1))
    poses = np.array(poses)  # (frames, bones, 7)

    action = bpy.data.actions.new(f"{armature.name}_clip")
    armature.animation_data_create().action = action
    for i, bone in enumerate(armature.pose.bones):
        shown.step(i / len(armature.pose.bones), f"keyframes of {bone.name}")
        bone.rotation_mode = "QUATERNION"
        for path, start, count in (("location", 0, 3), ("rotation_quaternion", 3, 4)):
            data_path = bone.path_from_id(path)
            for component in range(count):
                curve = new_curve(armature, action, data_path, component, bone.name)
                fill(curve, np.stack((frames, poses[:, i, start + component]), axis=1).astype(np.float32))
    for ob in characters.bound_objects():
        if ob.sinew.armature == armature:
            ob.sinew.source = "ARMATURE"
    return len(frames)


def new_curve(armature: bpy.types.Object, action: Any, data_path: str, component: int, group: str) -> Any:
    """Returns a new F-curve, which has one keyframe."""
    if not hasattr(action, "fcurves"):  # 5.0 and later
        curve = action.fcurve_ensure_for_datablock(armature, data_path, index=component, group_name=group)
    elif not hasattr(action, "fcurve_ensure_for_datablock"):  # before 4.4: actions have no slots
        curve = action.fcurves.new(data_path, index=component, action_group=group)
    else:
        curve = action.fcurve_ensure_for_datablock(armature, data_path, index=component)
        curve.group = action.groups.get(group) or action.groups.new(group)
    curve.auto_smoothing = "NONE"  # of handles, which straight lines do not have: it takes a third of the time
    curve.keyframe_points.add(1)
    return curve


def fill(curve: Any, points: np.ndarray) -> None:
    """Replaces the keyframes of an F-curve, which has some, by others (K, 2) float32, frames and values, with straight
    lines between them. Samples are written several times faster than keyframes, and become such in one call."""
    count, first = len(points), int(points[0, 0])
    curve.convert_to_samples(0, count)
    curve.sampled_points.foreach_set("co", points.reshape(-1))
    curve.convert_to_keyframes(first, first + count)
