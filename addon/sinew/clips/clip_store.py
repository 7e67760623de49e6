"""Saves and reads the poses of an imported rig. They are written on import, and read for playback and for the export.
They are custom properties of the armature data, so the .blend contains everything.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..blender import values
from ..deform.clips import MatrixClip, RotationClip
from ..native import sinew_native

CLIP_PROPERTY = "sinew_clip"
JOINT_PROPERTY = "sinew_joint"  # on each bone: the joint that it represents; survives renaming


def store(armature_data: Any, rig: Any, skeleton_suffix: str) -> None:
    """Saves the skeleton of a sinew_native.Rig as its file describes it, and the poses or the animation, if any."""
    skeleton = rig.skeleton
    clip = {
        "convention": skeleton.convention,
        "suffix": skeleton_suffix,
        "parents": values.to_property(skeleton.parents),
        "heads": values.to_property(skeleton.heads),
        "tails": values.to_property(skeleton.tails),
        "weight_columns": values.to_property(skeleton.weight_columns),
        "rotations": [],
        "matrices": [],
    }
    if rig.poses is not None:
        clip["rotations"] = values.to_property(rig.poses.rotations)
    elif rig.animation is not None:
        clip["matrices"] = values.to_property(rig.animation[..., :3, :])
    armature_data[CLIP_PROPERTY] = clip


class DamagedClip(ValueError):
    """The imported skeleton or poses of an armature cannot be read; the message tells why."""


@dataclass
class _Clip:
    """The data that `store` saved, after validation."""

    parents: np.ndarray  # (J,)
    heads: np.ndarray  # (J, 3)
    tails: np.ndarray  # (J, 3)
    weight_columns: np.ndarray  # (J,)
    rotations: np.ndarray  # (P, J, 4)
    matrices: np.ndarray  # (F, J, 3, 4)
    convention: str

    @classmethod
    def of(cls, armature_data: Any) -> "_Clip":
        """Reads and checks the clip of an armature. Raises DamagedClip."""
        try:
            return cls._read(armature_data[CLIP_PROPERTY])
        except Exception as error:  # custom properties may contain anything
            raise _damaged(armature_data, error) from error

    @classmethod
    def _read(cls, clip):
        joints = len(clip["parents"])
        if not joints:
            raise ValueError("it has no joints")
        found = cls(
            parents=_numbers(clip, "parents", np.int32, (joints,)),
            heads=_numbers(clip, "heads", float, (joints, 3)),
            tails=_numbers(clip, "tails", float, (joints, 3)),
            weight_columns=_numbers(clip, "weight_columns", np.int32, (joints,)),
            rotations=_numbers(clip, "rotations", float, (-1, joints, 4)),
            matrices=_numbers(clip, "matrices", float, (-1, joints, 3, 4)),
            convention=clip["convention"],
        )
        if (found.parents < -1).any() or (found.parents >= np.arange(joints)).any():
            raise ValueError("a joint's parent does not come before it")
        if not np.linalg.norm(found.rotations, axis=-1).all():
            raise ValueError("a rotation is 0")
        return found


def _numbers(clip, name, dtype, shape):
    numbers = clip[name]
    if not hasattr(numbers, "__len__"):
        raise ValueError(f"{name} is not a list")
    try:
        found = values.from_property(numbers, dtype, shape)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} has {len(numbers)} entries that do not fit") from error
    if not np.isfinite(found).all():
        raise ValueError(f"{name} has numbers that are not finite")
    return found


def _damaged(armature_data, error):
    return DamagedClip(
        f"The imported poses of {armature_data.name} are damaged ({error}): import the rig again, or set Pose to "
        "Armature"
    )


def has_skeleton(armature_data: Any) -> bool:
    return CLIP_PROPERTY in armature_data


def has_poses(armature_data: Any) -> bool:
    """Whether the armature has poses. Damaged poses count, so that reading them reports the damage."""
    clip = armature_data.get(CLIP_PROPERTY)
    return clip is not None and any(_length(clip, name) != 0 for name in ("rotations", "matrices"))


def _length(clip, name):
    """Returns the length of an entry of the clip, or -1 if there is none."""
    numbers = clip.get(name) if hasattr(clip, "get") else None
    return len(numbers) if hasattr(numbers, "__len__") else -1


def pose_count(armature_data: Any) -> int:
    """Returns the number of poses in the clip, without reading them."""
    clip = armature_data.get(CLIP_PROPERTY)
    joints = _length(clip, "parents")
    if joints < 1:
        return 0
    return max(_length(clip, "rotations") // (4 * joints) or _length(clip, "matrices") // (12 * joints), 0)


def load_skeleton(armature_data: Any) -> Any:
    """Returns the sinew_native.RigSkeleton, with the current names of its bones. Raises DamagedClip."""
    clip = _Clip.of(armature_data)
    names = [""] * len(clip.parents)
    for bone, joint in zip(armature_data.bones, _joints(armature_data.bones, len(names))):
        if joint >= 0:
            names[joint] = bone.name
    try:
        return sinew_native.RigSkeleton(
            clip.parents, clip.heads, clip.tails, clip.weight_columns, names, clip.convention
        )
    except Exception as error:
        raise _damaged(armature_data, error) from error


def load_poses(armature_data: Any) -> tuple[Any, np.ndarray | None]:
    """Returns a sinew_native.PoseClip or None, and skinning matrices (F, J, 4, 4) or None. Raises DamagedClip."""
    clip = _Clip.of(armature_data)
    if len(clip.rotations):
        return sinew_native.PoseClip(clip.rotations), None
    if len(clip.matrices):
        matrices = np.tile(np.eye(4), clip.matrices.shape[:2] + (1, 1))
        matrices[..., :3, :] = clip.matrices
        return None, matrices
    return None, None


def own_joints(armature: Any) -> np.ndarray:
    """Returns (B,): the joint that each pose bone represents, -1 for bones that a user added."""
    count = _length(armature.data.get(CLIP_PROPERTY), "parents")
    return _joints([bone.bone for bone in armature.pose.bones], count)


def _joints(bones, count):
    """Returns (B,): the joint of each bone, or -1. Bones of a rig that was joined to this one may name joints that
    other bones represent."""
    taken, found = set(), []
    for bone in bones:
        joint = bone.get(JOINT_PROPERTY, -1)
        is_own = isinstance(joint, int) and 0 <= joint < count and joint not in taken
        found.append(joint if is_own else -1)
        taken.add(found[-1])
    return np.array(found, np.int32)


def bones_are_where_they_were(armature: Any) -> bool:
    """Whether the head of each joint's bone is still at the joint's position in the imported skeleton."""
    if not has_skeleton(armature.data):
        return True
    try:
        heads = _Clip.of(armature.data).heads
    except DamagedClip:
        return True  # the damage is reported elsewhere
    own = own_joints(armature)
    now = np.array([bone.bone.head_local for bone in armature.pose.bones], float).reshape(-1, 3)
    size = np.ptp(heads, axis=0).max(initial=0)
    moved = np.abs(now[own >= 0] - heads[own[own >= 0]]).max(initial=0)
    return bool(moved <= 1e-4 * max(size, 1e-30))


def carrying_joints(armature: Any) -> np.ndarray:
    """Returns (B,): the joint that moves each pose bone. For a bone that a user added, this is the joint of its nearest
    ancestor that has one, or -1."""
    own = own_joints(armature)
    index = {bone.name: i for i, bone in enumerate(armature.pose.bones)}

    def find(i):
        parent = armature.pose.bones[i].parent
        return own[i] if own[i] >= 0 or parent is None else find(index[parent.name])

    return np.array([find(i) for i in range(len(own))], np.int32)


def _signature(armature_data):
    bones = armature_data.bones
    matrices = np.empty(16 * len(bones), np.float32)
    bones.foreach_get("matrix_local", matrices)
    return [str(bone.get(JOINT_PROPERTY)) for bone in bones], matrices.tobytes()


class ClipPlayer:
    """Computes the bone poses and bone matrices of an armature's clip at a given time. Raises DamagedClip."""

    def __init__(self, armature: Any) -> None:
        data = armature.data
        self._data_key, self._signature = values.key_of(data), _signature(data)
        poses, matrices = load_poses(data)
        skeleton = load_skeleton(data)
        self._own = own_joints(armature)
        self._carrying = carrying_joints(armature)
        self._driven = self._own >= 0
        self._carried = self._carrying >= 0
        bone_matrices = np.tile(np.eye(4), (skeleton.joint_count, 1, 1))
        for joint, pose_bone in zip(self._own, armature.pose.bones):
            if joint >= 0:
                bone_matrices[joint] = values.matrix_to_numpy(pose_bone.bone.matrix_local)
        self.is_by_matrices = poses is None
        if poses is not None:
            self.clip: RotationClip | MatrixClip = RotationClip(skeleton, poses, bone_matrices[:, :3, :3])
        elif matrices is not None:
            try:
                self.clip = MatrixClip(np.array(skeleton.parents), matrices, bone_matrices)
            except np.linalg.LinAlgError as error:
                raise _damaged(data, "a matrix is flat") from error
        else:
            raise _damaged(data, "there are none")
        bones = len(self._own)
        self._channels = np.tile(np.eye(4, dtype=np.float32), (bones, 1, 1))
        self._location = np.zeros((bones, 3))
        self._rotation = np.tile([1.0, 0, 0, 0], (bones, 1))

    def is_of(self, armature_data: Any) -> bool:
        """Whether this player was made for that armature data."""
        return self._data_key == values.key_of(armature_data)

    def is_edited(self, armature_data: Any) -> bool:
        """Whether the bones have been edited since this player was made."""
        return self._signature != _signature(armature_data)

    def at(self, time: float, loop: bool, rest: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Returns for each bone: channels (B, 4, 4) float32, location (B, 3), rotation (B, 4) w x y z.
        rest: return the rest pose and ignore the time. The arrays are reused by the next call."""
        if rest:
            self._channels[:] = np.eye(4)
            self._location[:] = 0
            self._rotation[:] = (1, 0, 0, 0)
        else:
            pose = self.clip.at(time, loop)
            self._channels[self._carried] = pose.skinning[self._carrying[self._carried]]
            self._location[self._driven] = pose.location[self._own[self._driven]]
            self._rotation[self._driven] = pose.rotation[self._own[self._driven]]
        return self._channels, self._location, self._rotation
