"""The poses of an imported rig, kept with its armature: written on import, read by the session and
by the export. They are custom properties of the armature data, so the .blend holds everything.
"""

import numpy as np

from ..blender import values
from ..deform.clips import MatrixClip, RotationClip
from ..native import sinew_native

CLIP_PROPERTY = "sinew_clip"
JOINT_PROPERTY = "sinew_joint"  # on each bone: the joint that it stands for; survives renaming


def store(armature_data, rig, skeleton_suffix):
    """Keep the skeleton as its file described it, and the poses or the animation, if any."""
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


def has_skeleton(armature_data):
    return CLIP_PROPERTY in armature_data


def has_poses(armature_data):
    clip = armature_data.get(CLIP_PROPERTY)
    return clip is not None and (len(clip["rotations"]) > 0 or len(clip["matrices"]) > 0)


def pose_count(armature_data):
    """How many poses the clip has, without reading them."""
    clip = armature_data.get(CLIP_PROPERTY)
    if clip is None:
        return 0
    joints = len(clip["parents"])
    return len(clip["rotations"]) // (4 * joints) or len(clip["matrices"]) // (12 * joints)


def load_skeleton(armature_data):
    """The RigSkeleton, with the names that its bones have now."""
    clip = armature_data[CLIP_PROPERTY]
    parents = values.from_property(clip["parents"], np.int32, -1)
    names = [""] * len(parents)
    for bone in armature_data.bones:
        joint = bone.get(JOINT_PROPERTY, -1)
        if 0 <= joint < len(names):
            names[joint] = bone.name
    return sinew_native.RigSkeleton(
        parents,
        values.from_property(clip["heads"], float, (-1, 3)),
        values.from_property(clip["tails"], float, (-1, 3)),
        values.from_property(clip["weight_columns"], np.int32, -1),
        names,
        clip["convention"],
    )


def load_poses(armature_data):
    """PoseClip or None, and skinning matrices (F, J, 4, 4) or None."""
    clip = armature_data[CLIP_PROPERTY]
    joints = len(clip["parents"])
    if len(clip["rotations"]):
        rotations = values.from_property(clip["rotations"], float, (-1, joints, 4))
        return sinew_native.PoseClip(rotations), None
    if len(clip["matrices"]):
        rows = values.from_property(clip["matrices"], float, (-1, joints, 3, 4))
        matrices = np.tile(np.eye(4), rows.shape[:2] + (1, 1))
        matrices[..., :3, :] = rows
        return None, matrices
    return None, None


def own_joints(armature):
    """(B,) the joint that each pose bone stands for, -1 for bones that somebody added."""
    return np.array([bone.bone.get(JOINT_PROPERTY, -1) for bone in armature.pose.bones], np.int32)


def bones_are_where_they_were(armature):
    """Whether each joint's bone still begins where the imported skeleton has the joint."""
    clip = armature.data.get(CLIP_PROPERTY)
    if clip is None:
        return True
    own = own_joints(armature)
    heads = values.from_property(clip["heads"], float, (-1, 3))
    now = np.array([bone.bone.head_local for bone in armature.pose.bones], float).reshape(-1, 3)
    size = np.ptp(heads, axis=0).max(initial=0) if len(heads) else 0
    moved = np.abs(now[own >= 0] - heads[own[own >= 0]]).max(initial=0)
    return bool(moved <= 1e-4 * max(size, 1e-30))


def carrying_joints(armature):
    """(B,) the joint that moves each pose bone: its own, or for a bone that somebody added that of
    its nearest ancestor that has one, else -1."""
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
    return [bone.get(JOINT_PROPERTY, -1) for bone in bones], matrices.tobytes()


class ClipPlayer:
    """What a frame needs of an armature's clip: bone poses and bone matrices at a time."""

    def __init__(self, armature):
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
            self.clip = RotationClip(skeleton, poses, bone_matrices[:, :3, :3])
        else:
            self.clip = MatrixClip(np.array(skeleton.parents), matrices, bone_matrices)
        bones = len(self._own)
        self._channels = np.tile(np.eye(4, dtype=np.float32), (bones, 1, 1))
        self._location = np.zeros((bones, 3))
        self._rotation = np.tile([1.0, 0, 0, 0], (bones, 1))

    def is_of(self, armature_data):
        return self._data_key == values.key_of(armature_data)

    def is_edited(self, armature_data):
        """Whether the bones are no longer those that this player was made for."""
        return self._signature != _signature(armature_data)

    def at(self, time, loop, rest=False):
        """Of each bone: channels (B, 4, 4) float32, location (B, 3), rotation (B, 4) w x y z.
        rest: the rest pose, whatever the time. The arrays are reused by the next call."""
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
