"""Leaves out keyframes that lines between the others replace. Pure.

Letters: F frames, J joints.
"""

from dataclasses import dataclass

import numpy as np

from ..native import sinew_native
from .joints import Joints, Keys, distances, points_of, skeleton_of

ROUNDS = 16  # after so many, all keyframes stay where a bone is too far off
SMALLEST_ANGLE = 1e-4  # between two keyframes, in radians, below which a line and the sphere are one


@dataclass(frozen=True)
class Kept:
    """Which keyframes stay, of each channel of each bone: (F, J) bools. The first and the last always do."""

    channels: tuple[np.ndarray, ...]  # of location, rotation and scale


def reduce(joints: Joints, keys: Keys, times: np.ndarray, error: float) -> tuple[Kept, np.ndarray]:
    """Returns which keyframes stay, and the skinning matrices (F, J, 4, 4) that they play. times: (F,), the frames.

    On each of the frames, each bone's head, and points one bone's length along its axes, are at most `error` from where
    all the keyframes have them, in the space of the armature: whether rotations are interpolated along a line, as
    Blender does, or on the sphere, as glTF does. Each channel of a bone keeps or loses the keyframe of a frame as a
    whole. The poses are measured; where a bone is too far off, it and the bones above it may be half as far off as they
    might before, on that frame.
    """
    values = [np.asarray(each, np.float64) for each in (keys.locations, keys.rotations, keys.scales)]
    times = np.asarray(times, np.float64)
    wanted = _world(joints, *values)
    points = points_of(joints)
    levers = _levers(joints, wanted)
    kept = [np.zeros(each.shape[:2], bool) for each in values]
    for each in kept:
        each[[0, -1]] = True
    allowed = np.full(kept[0].shape, 0.5 * error)
    above = _above(joints.parents)
    for number in range(ROUNDS):
        for each, own, lever, measure in zip(values, kept, levers, (_far, _turned, _far)):
            _keep_more(each, own, times, allowed / lever, measure)
        ends = [_ends(each, own, times) for each, own in zip(values, kept)]
        locations, scales = _between(*ends[0]), _between(*ends[2])
        worlds = [_world(joints, locations, drawn(*ends[1]), scales) for drawn in (_between, _between_on_sphere)]
        off = np.maximum(*(distances(world, wanted, points) for world in worlds))
        is_far = np.greater(off, error).astype(np.float32) @ above > 0
        if not is_far.any():
            break
        allowed[is_far] *= 0.5 if number < ROUNDS - 2 else 0.0
    return Kept(tuple(kept)), worlds[0] @ np.linalg.inv(joints.rest)


def _world(joints, locations, rotations, scales):
    """Returns the poses (F, J, 4, 4) in the space of the armature."""
    local = np.zeros((*locations.shape[:2], 4, 4))
    w, x, y, z = np.moveaxis(_unit(rotations), 2, 0)
    local[..., 0, :3] = np.stack((1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)), axis=-1)
    local[..., 1, :3] = np.stack((2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)), axis=-1)
    local[..., 2, :3] = np.stack((2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)), axis=-1)
    local[..., :3, :3] *= scales[:, :, None]
    local[..., :3, 3] = locations
    local[..., 3, 3] = 1
    return sinew_native.forward_kinematics(skeleton_of(joints), local)


def _levers(joints, world):
    """Returns how far a bone's own points and those below it move at most, about, by one unit of its location, by one
    radian, and by a scale of 1: (J,) each."""
    stretched = np.linalg.norm(world[:, :, :3, :3], axis=2).max(axis=(0, 2))
    reach = joints.lengths * stretched
    of_parent = np.ones(len(reach))
    for j in range(len(reach) - 1, -1, -1):
        parent = joints.parents[j]
        if parent >= 0:
            apart = np.linalg.norm(world[:, j, :3, 3] - world[:, parent, :3, 3], axis=1).max()
            reach[parent] = max(reach[parent], apart + reach[j])
            of_parent[j] = stretched[parent]
    tiny = np.finfo(np.float64).tiny
    return np.maximum(of_parent, tiny), np.maximum(reach, tiny), np.maximum(reach, tiny)


def _above(parents):
    """Returns (J, J) float32: 1 where the column's joint is the row's or one above it."""
    found = np.eye(len(parents), dtype=np.float32)
    for j, parent in enumerate(parents):
        if parent >= 0:
            found[j] += found[parent]
    return found


def _keep_more(values, kept, times, limits, measure):
    """Keeps more keyframes, in place, until lines between them are nowhere further off than the limits (F, J)."""
    joints = np.arange(values.shape[1])
    while len(joints):
        own, wanted = kept[:, joints], values[:, joints]
        ends = _ends(wanted, own, times)
        errors = measure(_between(*ends), wanted)
        if measure is _turned:
            errors = np.maximum(errors, measure(_between_on_sphere(*ends), wanted))
        over = (errors > limits[:, joints]) & ~own
        starts = np.flatnonzero(own.T)  # of the stretches between keyframes, one joint after the other
        worst = np.maximum.reduceat(np.where(over, errors, 0).T.reshape(-1), starts)
        worst = np.repeat(worst, np.diff(starts, append=errors.size)).reshape(errors.T.shape).T
        kept[:, joints] |= over & (errors == worst)
        joints = joints[over.any(axis=0)]


def _ends(values, kept, times):
    """Returns the values (F, J, K) of the keyframes before and after each frame, and the share (F, J, 1) of the way."""
    numbers = np.arange(len(kept))[:, None]
    before = np.maximum.accumulate(np.where(kept, numbers, 0), axis=0)
    after = np.minimum.accumulate(np.where(kept, numbers, len(kept) - 1)[::-1], axis=0)[::-1]
    length = times[after] - times[before]
    share = np.where(length > 0, (times[:, None] - times[before]) / np.where(length > 0, length, 1), 0)
    begin, end = (np.take_along_axis(values, each[:, :, None], axis=0) for each in (before, after))
    return begin, end, share[:, :, None]


def _between(begin, end, share):
    return begin + (end - begin) * share


def _between_on_sphere(begin, end, share):
    cosine = np.sum(begin * end, axis=2, keepdims=True)
    end = np.where(cosine < 0, -end, end)
    angle = np.arccos(np.minimum(np.abs(cosine), 1))
    sine = np.sin(angle)
    is_line = angle < SMALLEST_ANGLE
    sine = np.where(is_line, 1, sine)
    first = np.where(is_line, 1 - share, np.sin((1 - share) * angle) / sine)
    second = np.where(is_line, share, np.sin(share * angle) / sine)
    return first * begin + second * end


def _far(drawn, values):
    return np.linalg.norm(drawn - values, axis=2)


def _turned(drawn, values):
    """Returns about the angle between rotations, (F, J), in radians."""
    drawn, values = _unit(drawn), _unit(values)
    return 2 * np.minimum(np.linalg.norm(drawn - values, axis=2), np.linalg.norm(drawn + values, axis=2))


def _unit(rotations):
    return rotations / np.maximum(np.linalg.norm(rotations, axis=2, keepdims=True), 1e-12)
