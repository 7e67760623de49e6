"""The skeleton that a game gets of a rig: the bones that deform, each below the nearest of its ancestors that does.

Letters: F frames, B bones of the rig, S ends of its B-bones' segments, J joints of the skeleton.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import bpy
import numpy as np

from ..blender import values
from . import sampling
from .joints import Joints

ROOT = "root"  # name of a root that no bone of the rig is
UP = 2  # the axis of the rig


@dataclass(frozen=True)
class GameSkeleton:
    """Which joints there are, and what of the rig moves each."""

    joints: Joints  # in the rig's space
    bones: np.ndarray  # (J,): the number of the rig's bone that moves it; -1: none
    ends: np.ndarray  # (J,): the number of the end of a segment; -1: the bone itself

    def motions(self, poses: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """Returns what moves each joint from rest, (F, J, 4, 4) float64. poses: (F, B, 4, 4); ends: (F, S, 4, 4)."""
        wanted = poses[:, self.bones].astype(np.float64)
        is_end = self.ends >= 0
        wanted[:, is_end] = wanted[:, is_end] @ ends[:, self.ends[is_end]]
        wanted[:, self.bones < 0] = self.joints.rest[self.bones < 0]
        return wanted @ np.linalg.inv(self.joints.rest)

    def program_joints(self, rig: bpy.types.Object) -> list[int]:
        """Returns J numbers of joints as RigProgram.joint_begin counts them; -1: none."""
        segments = np.array([bone.bone.bbone_segments for bone in rig.pose.bones])
        begins = np.concatenate(([0], np.cumsum(np.where(segments > 1, segments + 1, 1))))
        first_end = np.concatenate(([0], np.cumsum(np.where(segments > 1, segments + 1, 0))))
        found = begins[self.bones] + np.where(self.ends < 0, 0, self.ends - first_end[self.bones])
        return np.where(self.bones < 0, -1, found).tolist()


def of_rig(
    rig: bpy.types.Object,
    names: Mapping[str, str],
    root: str = "",
    has_segments: bool = False,
    has_root: bool = False,
    is_flat: bool = False,
) -> GameSkeleton:
    """Returns the skeleton of a rig. names: other names for bones. root: a bone of the rig that all others are below,
    whether it deforms or not. has_segments: whether there is a joint for each end of a B-bone's segments. has_root:
    whether there is a root, if no bone is chosen. is_flat: whether no bone but the root has children. Raises ValueError
    if a bone is missing, or none deforms."""
    pose = rig.pose.bones
    if root and root not in pose:
        raise ValueError(f"{rig.name} has no bone {root}, which was chosen as the root: choose another one")
    chosen = [int(number) for number in sampling.deforming(rig) if pose[int(number)].name != root]
    if not chosen:
        raise ValueError(f"{rig.name} has no deforming bone: tick Deform in the properties of at least one")
    rows: list[tuple[str, int, int, int, np.ndarray, float]] = []  # name, parent, bone, end, rest, length
    last_of: dict[str, int] = {}  # the joint below which the children of a bone are
    begins = np.cumsum([0, *(bone.bone.bbone_segments + 1 if bone.bone.bbone_segments > 1 else 0 for bone in pose)])
    if root:
        bone = pose[root].bone
        last_of[root] = 0
        rows.append((names.get(root, root), -1, pose.find(root), -1, _rest(bone), bone.length))
    elif has_root:
        rows.append((ROOT, -1, -1, -1, np.eye(4), 0.1 * max(bone.bone.length for bone in pose)))
    for number in chosen:
        posed = pose[number]
        bone, name = posed.bone, names.get(posed.name, posed.name)
        above = next((each.name for each in posed.parent_recursive if each.name in last_of and not is_flat), None)
        top = 0 if root or has_root else -1
        parent = top if above is None else last_of[above]
        count = bone.bbone_segments if has_segments and bone.bbone_segments > 1 else 0
        for end in range(count + 1):
            at_rest = _rest(bone)
            if count:
                at_rest = at_rest @ values.matrix_to_numpy(posed.bbone_segment_matrix(end, rest=True))
            last_of[posed.name] = len(rows)
            own = name if not end else f"{name}_{end}"
            place = begins[number] + end if count else -1
            rows.append((own, parent, number, place, at_rest, bone.length / max(count, 1)))
            parent = top if is_flat else last_of[posed.name]
    own_names, parents, bones, ends, rest, lengths = zip(*rows)
    twice = next((name for name in own_names if own_names.count(name) > 1), None)
    if twice is not None:
        raise ValueError(f"two bones would have the name {twice}: give one of them another one")
    joints = Joints(own_names, np.array(parents), np.array(rest), np.maximum(sampling.SHORTEST_BONE, lengths))
    return GameSkeleton(joints, np.array(bones), np.array(ends))


def joints_of(armature: bpy.types.Object) -> Joints:
    """Returns the bones of an armature as they are."""
    own = armature.data.bones
    place = {bone.name: j for j, bone in enumerate(own)}
    return Joints(
        tuple(bone.name for bone in own),
        np.array([-1 if bone.parent is None else place[bone.parent.name] for bone in own]),
        np.array([_rest(bone) for bone in own]),
        np.array([bone.length for bone in own]),
    )


def places_in(joints: Joints, names: tuple[str, ...], owner: str) -> np.ndarray:
    """Returns (J,): the place of each joint among the names, -1 if it is not there. owner: whose joints they are, for
    the message. Raises ValueError if none is."""
    number = {name: place for place, name in enumerate(names)}
    found = np.array([number.get(name, -1) for name in joints.names])
    if not (found >= 0).any():
        raise ValueError(f"{owner} has no bone with the name of one that deforms: choose another armature")
    return found


def moved_along(motions: np.ndarray, places: np.ndarray, parents: np.ndarray) -> np.ndarray:
    """Returns the motions of joints (F, J, 4, 4) from those of others (F, N, 4, 4), of which each has one or, at place
    -1, follows its parent."""
    found = motions[:, places]
    for j in np.flatnonzero(places < 0):
        found[:, j] = found[:, parents[j]] if parents[j] >= 0 else np.eye(4)
    return found


def with_root_motion(motions: np.ndarray, joints: Joints, is_in_place: bool) -> np.ndarray:
    """Returns motions (F, J, 4, 4) in which what moves the first joint below the root along the ground is the root's,
    or, in place, no joint's. The first joint is the root."""
    hips = int(np.flatnonzero(joints.parents == 0)[0])
    at = joints.rest[hips, :, 3]
    moved = (motions[:, hips] @ at - at)[:, :3]
    moved[:, UP] = 0
    found = motions.copy()
    found[:, 0] = np.eye(4)
    if is_in_place:
        found[:, 1:, :3, 3] -= moved[:, None]
    else:
        found[:, 0, :3, 3] = moved
    return found


def _rest(bone):
    return values.matrix_to_numpy(bone.matrix_local)
