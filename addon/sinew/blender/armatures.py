"""Reads and writes armatures as numpy arrays."""

from typing import Any

import numpy as np
from mathutils import Vector

_BONE_NUMBERS = (
    ("use_deform", 1, bool),
    ("use_envelope_multiply", 1, bool),
    ("bbone_segments", 1, np.int32),
    ("matrix_local", 16, np.float32),
    ("length", 1, np.float32),
    ("head_radius", 1, np.float32),
    ("tail_radius", 1, np.float32),
    ("envelope_distance", 1, np.float32),
    ("envelope_weight", 1, np.float32),
    ("bbone_curveinx", 1, np.float32),
    ("bbone_curveinz", 1, np.float32),
    ("bbone_curveoutx", 1, np.float32),
    ("bbone_curveoutz", 1, np.float32),
    ("bbone_rollin", 1, np.float32),
    ("bbone_rollout", 1, np.float32),
    ("bbone_easein", 1, np.float32),
    ("bbone_easeout", 1, np.float32),
)


def of_modifiers(ob: Any) -> list[Any]:
    """Returns the armature objects of a mesh object's Armature modifiers, in stack order."""
    return [modifier.object for modifier in ob.modifiers if modifier.type == "ARMATURE" and modifier.object is not None]


def bone_signature(armature: Any) -> list[Any]:
    """Returns a value that differs if the bones have changed in any way that affects influences, or which of them
    Blender evaluates first."""
    bones = armature.data.bones
    parts = [bones.keys()]
    for name, size, dtype in _BONE_NUMBERS:
        numbers = np.empty(size * len(bones), dtype)
        bones.foreach_get(name, numbers)
        parts.append(numbers.tobytes())
    parts.append([(is_curved(bone), getattr(bone.parent, "name", None)) for bone in bones])
    return parts


def is_curved(bone: Any) -> bool:
    """Whether vertices are assigned to a B-bone's segments along its curve (4.x)."""
    return getattr(bone, "bbone_mapping_mode", "STRAIGHT") == "CURVED"


def following_shape(data: Any) -> set[str]:
    """Returns the names of the deforming bones of an armature's data whose weights depend on where the shape is: those
    with envelopes that multiply, and B-bones along whose curve vertices are assigned."""
    count = len(data.bones)
    deforms, multiplies, segments = np.empty(count, bool), np.empty(count, bool), np.empty(count, np.int32)
    for name, numbers in (("use_deform", deforms), ("use_envelope_multiply", multiplies), ("bbone_segments", segments)):
        data.bones.foreach_get(name, numbers)
    may_follow = deforms & (multiplies | (segments > 1))
    if not may_follow.any():
        return set()
    found = [bone for bone, may in zip(data.bones, may_follow.tolist()) if may]
    return {bone.name for bone in found if bone.use_envelope_multiply or is_curved(bone)}


def read_bones(armature: Any) -> dict[str, Any]:
    """Returns the fields of influences.Bones, with one entry per pose bone, in the order of the pose bones."""
    bones = [bone.bone for bone in armature.pose.bones]

    def numbers(name, dtype=np.float64):
        return np.array([getattr(bone, name) for bone in bones], dtype)

    rest = np.array([bone.matrix_local for bone in bones], np.float64).reshape(-1, 4, 4)
    return dict(
        names=tuple(bone.name for bone in bones),
        deform=numbers("use_deform", bool),
        rest=rest,
        length=numbers("length"),
        head_radius=numbers("head_radius"),
        tail_radius=numbers("tail_radius"),
        envelope_distance=numbers("envelope_distance"),
        envelope_weight=numbers("envelope_weight"),
        multiply=numbers("use_envelope_multiply", bool),
        segments=numbers("bbone_segments", int),
        curved=np.array([is_curved(bone) for bone in bones], bool),
    )


def read_channels(armature: Any) -> np.ndarray:
    """Returns (B, 4, 4) float32: each pose bone's motion from rest to pose, in armature space."""
    bones = armature.pose.bones
    numbers = np.empty(16 * len(bones), np.float32)
    bones.foreach_get("matrix_channel", numbers)
    return numbers.reshape(-1, 4, 4).transpose(0, 2, 1)


def read_segments(armature: Any, bone: int | str, rest: bool = False) -> np.ndarray:
    """Returns (n + 1, 4, 4) float64: the ends of a B-bone's n segments, in the bone's space, at rest or posed."""
    pose_bone = armature.pose.bones[bone]
    return np.array(
        [pose_bone.bbone_segment_matrix(k, rest=rest) for k in range(pose_bone.bone.bbone_segments + 1)], np.float64
    )


def segment_at(armature: Any, bone: int | str, point: np.ndarray) -> tuple[int, float]:
    """Returns the segment of a curved B-bone at a point (3,) in armature space, and the point's position within the
    segment, 0 to 1."""
    return armature.pose.bones[bone].bbone_segment_index(Vector(point))


def read_pose(armature: Any) -> tuple[np.ndarray, np.ndarray]:
    """Returns the location (B, 3) and rotation (B, 4) w x y z of all pose bones, float32."""
    bones = armature.pose.bones
    location, rotation = np.empty(3 * len(bones), np.float32), np.empty(4 * len(bones), np.float32)
    bones.foreach_get("location", location)
    bones.foreach_get("rotation_quaternion", rotation)
    return location.reshape(-1, 3), rotation.reshape(-1, 4)


def write_pose(armature: Any, location: np.ndarray, rotation: np.ndarray) -> None:
    """Sets the location (B, 3) and rotation (B, 4) w x y z, float32, of all pose bones of an original armature, and
    their scale to 1."""
    bones = armature.pose.bones
    bones.foreach_set("location", location.reshape(-1))
    bones.foreach_set("rotation_quaternion", rotation.reshape(-1))
    bones.foreach_set("scale", np.ones(3 * len(bones), np.float32))
    armature.update_tag(refresh={"DATA"})
