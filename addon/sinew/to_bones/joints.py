"""Joints in motion as the bones of an armature: what has to be keyed, and what the armature then plays. Pure.

Letters: F frames, J joints.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..native import sinew_native

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


def keys_of(
    joints: Joints, motions: np.ndarray, frames: Sequence[int], may_move: Sequence[bool] | None = None
) -> tuple[Keys, np.ndarray]:
    """Returns the Keys that play skinning matrices (F, J, 4, 4), and the skinning matrices that they play.

    The two differ only where a bone shears, which no bone of an armature can: it gets the rotation and the scale along
    its own axes that are closest. Poses are composed as by bones that inherit rotation and full scale:
    pose = pose(parent) rest(parent)^-1 rest basis. frames: their numbers, for the message. may_move: (J,), whether a
    bone may have a location; None: all may. Raises ValueError if a bone has children and a scale of 0 along an axis.
    """
    poses = motions @ joints.rest
    _refuse_flat(joints, poses, frames)
    locations, rotations, scales, played = sinew_native.local_transforms(skeleton_of(joints), poses, may_move)
    return Keys(locations, rotations, scales), played @ np.linalg.inv(joints.rest)


def points_of(joints: Joints) -> np.ndarray:
    """Returns (J, 4, 4): points one length along a bone's axes, and its head, as columns, in its own space."""
    points = np.eye(4)
    points[3] = 1
    return points * np.stack((*3 * [joints.lengths], np.ones(len(joints.lengths))), axis=1)[:, :, None]


def distances(motions: np.ndarray, others: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Returns (F, J): how far apart two motions (F, J, 4, 4) move the points (J, 4, 4) of a joint at most."""
    apart = ((motions - others) @ points)[:, :, :3]
    return np.sqrt(np.einsum("fjap,fjap->fjp", apart, apart).max(axis=2, initial=0))


def skeleton_of(joints: Joints) -> Any:
    """Returns a sinew_native.Skeleton."""
    rest, is_child = joints.rest.copy(), joints.parents >= 0
    rest[is_child] = np.linalg.solve(joints.rest[joints.parents[is_child]], rest[is_child])
    return sinew_native.Skeleton(joints.parents, rest)


def _refuse_flat(joints, poses, frames):
    parents = np.unique(joints.parents[joints.parents >= 0])
    sizes = np.linalg.norm(poses[:, parents, :3, :3], axis=2).min(axis=2, initial=np.inf)
    for frame, parent in np.argwhere(sizes < SMALLEST_SCALE)[:1]:
        raise ValueError(
            f"{joints.names[parents[parent]]} has a scale of 0 along an axis on frame {frames[frame]}, and other bones "
            "follow it: choose other frames, or new bones"
        )
