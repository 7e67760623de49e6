"""Joints in motion as the bones of an armature: what has to be keyed, and what the armature then plays. Pure.

Letters: F frames, J joints.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..deform import clips

SMALLEST_SCALE = 1e-6  # of a bone that another one follows


@dataclass(frozen=True)
class Joints:
    """The bones of an armature at rest, parents first."""

    names: tuple[str, ...]
    parents: np.ndarray  # (J,), -1: none
    rest: np.ndarray  # (J, 4, 4), rigid, in the space of the armature
    lengths: np.ndarray  # (J,)


@dataclass(frozen=True)
class Keys:
    """The values of the keyframes: location, rotation (w x y z) and scale of each bone relative to its parent."""

    locations: np.ndarray  # (F, J, 3)
    rotations: np.ndarray  # (F, J, 4)
    scales: np.ndarray  # (F, J, 3)

    @property
    def has_scales(self) -> bool:
        return bool(np.abs(self.scales - 1).max(initial=0) > 1e-6)


def keys_of(joints: Joints, motions: np.ndarray, frames: Sequence[int]) -> tuple[Keys, np.ndarray]:
    """Returns the Keys that play skinning matrices (F, J, 4, 4), and the skinning matrices that they play.

    The two differ only where a bone shears, which no bone of an armature can: it gets the rotation and the scale along
    its own axes that are closest. Poses are composed as by bones that inherit rotation and full scale:
    pose = pose(parent) rest(parent)^-1 rest basis. frames: their numbers, for the message.
    Raises ValueError if a bone has children and a scale of 0 along an axis.
    """
    count, basis = len(motions), np.empty_like(motions)
    poses = np.empty_like(motions)
    locations, scales = np.empty((count, len(joints.names), 3)), np.empty((count, len(joints.names), 3))
    turns = np.empty((count, len(joints.names), 3, 3))
    for j, parent in enumerate(joints.parents.tolist()):
        before = np.broadcast_to(joints.rest[j], (count, 4, 4))
        if parent >= 0:
            _refuse_flat(joints.names[parent], poses[:, parent], frames)
            before = poses[:, parent] @ np.linalg.inv(joints.rest[parent]) @ joints.rest[j]
        wanted = np.linalg.solve(before, motions[:, j] @ joints.rest[j])
        locations[:, j] = wanted[:, :3, 3]
        turns[:, j], scales[:, j] = turn_and_scale(wanted[:, :3, :3])
        basis[:, j] = np.eye(4)
        basis[:, j, :3, :3] = turns[:, j] * scales[:, j, None]
        basis[:, j, :3, 3] = locations[:, j]
        poses[:, j] = before @ basis[:, j]
    rotations = clips.continuous(clips.quaternions(turns))
    return Keys(locations, rotations, scales), poses @ np.linalg.inv(joints.rest)


def turn_and_scale(linear: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Splits matrices (..., 3, 3) into the nearest rotation (..., 3, 3) and a scale (..., 3) along its columns, all
    below 0 if the matrix mirrors."""
    sign = np.where(np.linalg.det(linear) < 0, -1.0, 1.0)[..., None, None]
    left, _, right = np.linalg.svd(sign * linear)
    left[..., -1] *= np.linalg.det(left @ right)[..., None]
    turn = left @ right
    return turn, np.einsum("...ij,...ij->...j", turn, linear)


def _refuse_flat(name, poses, frames):
    sizes = np.linalg.svd(poses[:, :3, :3], compute_uv=False)[:, -1]
    flat = np.flatnonzero(sizes < SMALLEST_SCALE)
    if len(flat):
        raise ValueError(
            f"{name} has a scale of 0 along an axis on frame {frames[flat[0]]}, and other bones follow it: choose "
            "other frames, or new bones"
        )
