"""Poses of an armature in which weights are judged: frames of the scene, or each bone turned by itself.

Letters: F poses, B bones. All matrices are in world space, and take a point of the rest shape to where a bone takes it.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from ..blender import armatures, values
from ..feedback import progress as feedback

MOST_FRAMES = 50  # that a range is played on
TEST_ANGLE = 90.0  # degrees
_STILL = 1e-6  # the largest difference from the identity of a bone that does not move


def spread(first: int, last: int, most: int = MOST_FRAMES) -> list[int]:
    """Returns at most so many frames from first to last, evenly spread. Raises ValueError."""
    if last < first:
        raise ValueError(f"the last frame ({last}) comes before the first ({first}): swap them")
    count = min(last - first + 1, most)
    return sorted({first + round((last - first) * number / max(count - 1, 1)) for number in range(count)})


def on_frames(
    context: bpy.types.Context,
    armature: bpy.types.Object,
    names: Sequence[str],
    frames: Iterable[int],
    progress: Any = feedback.SILENT,
) -> np.ndarray:
    """Plays frames. Returns (F, B, 4, 4) of the bones of these names. B-bones count with their own matrix, without
    their segments. The scene returns to its frame. Raises ValueError if the bones do not move, or not to finite
    places."""
    if context.view_layer.objects.get(armature.name) != armature:
        raise ValueError(
            f"{armature.name} is not in the view layer {context.view_layer.name}, so Blender does not pose it: show "
            "its collection, or use test poses"
        )
    scene, frames = context.scene, list(frames)
    place = values.matrix_to_numpy(armature.matrix_world)
    back = np.linalg.inv(_solid(armature, place))
    columns = [armature.pose.bones.find(name) for name in names]
    found = np.empty((len(frames), len(names), 4, 4))
    before = scene.frame_current, scene.frame_subframe
    try:
        for number, frame in enumerate(frames):
            progress.step(number / len(frames), f"playing frame {frame}")
            scene.frame_set(frame)
            posed = armature.evaluated_get(context.evaluated_depsgraph_get())
            found[number] = place @ armatures.read_channels(posed)[columns].astype(np.float64) @ back
    finally:
        scene.frame_set(before[0], subframe=before[1])
    _check(found, armature, names, frames)
    return found


def _solid(armature: bpy.types.Object, place: np.ndarray) -> np.ndarray:
    """Returns the armature's matrix if it can be inverted. Raises ValueError."""
    values.refuse_flat(armature)
    if not np.isfinite(place).all():
        raise ValueError(f"{armature.name} is not at a finite place (NaN or infinite): move it")
    return place


def _check(found, armature, names, frames):
    is_finite = np.isfinite(found).all(axis=(2, 3))
    if not is_finite.all():
        frame, bone = np.argwhere(~is_finite)[0]
        raise ValueError(
            f"Bone {names[bone]} of {armature.name} is not at a finite place (NaN or infinite) on frame {frames[frame]}"
        )
    if np.abs(found - np.eye(4)).max() < _STILL:
        raise ValueError(
            f"{armature.name} is at rest on the frames {frames[0]} to {frames[-1]}: choose frames on which it moves, "
            "or use test poses"
        )


def in_test_poses(armature: bpy.types.Object, names: Sequence[str], angle: float = TEST_ANGLE) -> np.ndarray:
    """Returns (4 B, B, 4, 4): each of the bones of these names turned to and fro by an angle in degrees about its X and
    Z axes, at rest otherwise. Its children go with it."""
    place = _solid(armature, values.matrix_to_numpy(armature.matrix_world))
    bones = armature.data.bones
    number = {name: column for column, name in enumerate(names)}
    found = np.tile(np.eye(4), (4 * len(names), len(names), 1, 1))
    for column, name in enumerate(names):
        rest = place @ np.array(bones[name].matrix_local, np.float64)
        back = np.linalg.inv(rest)
        moved = [number[each.name] for each in (bones[name], *bones[name].children_recursive) if each.name in number]
        for pose, (axis, sign) in enumerate((axis, sign) for axis in "XZ" for sign in (1, -1)):
            turn = np.array(Matrix.Rotation(math.radians(sign * angle), 4, axis), np.float64)
            found[4 * column + pose, moved] = rest @ turn @ back
    return found
