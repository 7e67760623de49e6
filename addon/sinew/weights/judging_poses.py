"""Poses of an armature in which weights are judged: frames of the scene, or each bone turned by itself.

Letters: F poses, B bones. All matrices are in world space, and take a point of the rest shape to where a bone takes it.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from ..blender import armatures, temporary, values
from ..feedback import progress as feedback
from . import carriers

MOST_FRAMES = 50  # that a range is played on
TEST_ANGLE = 90.0  # degrees
_STILL = 1e-4  # of a turn, and of the armature's size: bones that differ less from rest do not move; float32 rounds


class AtRest(ValueError):
    """No bone moves on the frames."""


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
    their segments. The scene returns to its frame. Raises AtRest if the bones do not move, and ValueError if one moves
    to no finite place."""
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
    with temporary.frame_kept(scene):
        for number, frame in enumerate(frames):
            progress.step(number / len(frames), f"playing frame {frame}")
            scene.frame_set(frame)
            posed = armature.evaluated_get(context.evaluated_depsgraph_get())
            found[number] = place @ armatures.read_channels(posed)[columns].astype(np.float64) @ back
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
    heads = np.array([armature.data.bones[name].head_local for name in names], np.float64)
    heads = heads @ (place := values.matrix_to_numpy(armature.matrix_world))[:3, :3].T + place[:3, 3]
    away = np.einsum("fbij,bj->fbi", found[..., :3, :3], heads) + found[..., :3, 3] - heads
    size = max(np.ptp(heads, axis=0).max(), np.abs(heads).max() * np.finfo(np.float32).eps / _STILL)
    if np.abs(found[..., :3, :3] - np.eye(3)).max() < _STILL and np.abs(away).max() < _STILL * size:
        raise AtRest(
            f"{armature.name} is at rest on the frames {frames[0]} to {frames[-1]}: choose frames on which it moves, "
            "or use test poses"
        )


def in_test_poses(armature: bpy.types.Object, names: Sequence[str]) -> np.ndarray:
    """Returns (4 B, B, 4, 4): each of the bones of these names turned to and fro by TEST_ANGLE about its X and
    Z axes, at rest otherwise. The bones that it carries go with it (`carriers`)."""
    place = _solid(armature, values.matrix_to_numpy(armature.matrix_world))
    bones, carried = armature.data.bones, carriers.carried(armature)
    number = {name: column for column, name in enumerate(names)}
    found = np.tile(np.eye(4), (4 * len(names), len(names), 1, 1))
    for column, name in enumerate(names):
        rest = place @ np.array(bones[name].matrix_local, np.float64)
        back = np.linalg.inv(rest)
        moved = [number[each] for each in carried[name] if each in number]
        for pose, (axis, sign) in enumerate((axis, sign) for axis in "XZ" for sign in (1, -1)):
            turn = np.array(Matrix.Rotation(math.radians(sign * TEST_ANGLE), 4, axis), np.float64)
            found[4 * column + pose, moved] = rest @ turn @ back
    return found
