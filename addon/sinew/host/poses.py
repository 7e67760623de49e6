"""Reads the pose of an evaluated armature in one call, records what Blender has written into its bones, and writes it
there again."""

import ctypes
from collections.abc import Iterable
from typing import Any

import numpy as np

from ..native import sinew_native
from . import contract, features, proof
from .members import CHANNELS, SIZES

NO_LAYOUT = (0,) * 6  # in place of pose_layout, without any armature
_BONE = "bPoseChannel"
_FLOAT = 4  # bytes
# In each bone: its channels, where it is, and what it does to vertices. Blender writes these into originals too.
_MEMBERS = ("chan_mat", "pose_mat", "pose_head", "pose_tail", *CHANNELS)
_COMPUTED = {"chan_mat": "channel_matrix", "pose_mat": "pose_matrix", "pose_head": "head", "pose_tail": "tail"}
# What Blender's API calls those that keyframes and drivers can set, and how many numbers come before them.
NAMES = {
    "loc": ("location", 0),
    "eul": ("rotation_euler", 0),
    "quat": ("rotation_quaternion", 0),
    "rotAngle": ("rotation_axis_angle", 0),
    "rotAxis": ("rotation_axis_angle", 1),
    "size": ("scale", 0),
    "roll1": ("bbone_rollin", 0),
    "roll2": ("bbone_rollout", 0),
    "curveInX": ("bbone_curveinx", 0),
    "curveInY": ("bbone_curveinz", 0),
    "curveOutX": ("bbone_curveoutx", 0),
    "curveOutY": ("bbone_curveoutz", 0),
    "ease1": ("bbone_easein", 0),
    "ease2": ("bbone_easeout", 0),
    "scale_in": ("bbone_scalein", 0),
    "scale_out": ("bbone_scaleout", 0),
}
RECORDED = tuple(dict.fromkeys(name for name, _skipped in NAMES.values()))
# For each segment of a B-bone, how many more there are, and whether equal poses have equal ones. Blender leaves a part
# of a dual quaternion undefined if there is no scale.
_SEGMENTS = (
    ("*bbone_pose_mats", "Mat4", 1, True),
    ("*bbone_deform_mats", "Mat4", 2, True),
    ("*bbone_dual_quats", "DualQuat", 1, False),
)


@contract.kept
def _bone_layout(has_segments: bool) -> tuple[int, int, int, int]:
    """Returns byte offsets in a pose bone, the `layout` of `sinew_native.host.read_pose`. has_segments: segments of
    B-bones are read too."""
    motion = contract.offset("bPoseChannel", "*next"), contract.offset("bPoseChannel", "chan_mat")
    if not has_segments:
        return *motion, 0, 0
    start = contract.offset("bPoseChannel", "runtime")
    return (
        *motion,
        start + contract.offset("bPoseChannel_Runtime", "bbone_segments"),
        start + contract.offset("bPoseChannel_Runtime", "*bbone_deform_mats"),
    )


def pose_layout(has_segments: bool) -> tuple[int, ...]:
    """Returns byte offsets in a pose, then in its bones, the `layout` of `sinew_native.host.Shortcut`. has_segments:
    the pose has B-bones that are read. Raises contract.Broken."""
    for feature in (features.FAST_ARMATURES, *([features.SEGMENTS] if has_segments else [])):
        if not contract.has(feature):
            raise contract.Broken(contract.why_not(feature))
    array = contract.offset("bPose", "**chan_array") if contract.holds("bPose", "**chan_array") else -1
    return contract.offset("bPose", "chanbase"), array, *_bone_layout(has_segments)


def pose_address_at(armature: Any) -> int:
    """Returns the address at which the address of an object's pose is stored. Raises contract.Broken."""
    return contract.region(armature, "Object", "*pose")[0]


def read_motions(armature: Any, first_joints: np.ndarray, joint_counts: np.ndarray, out: np.ndarray) -> None:
    """Reads the motions of an evaluated armature's bones, from rest to pose, in armature space; for a B-bone, those of
    each end of a segment. The arguments are those of `sinew_native.host.read_pose`."""
    if contract.has(features.BONES):
        has_segments = contract.has(features.SEGMENTS)
        own = first_joints if has_segments else np.where(joint_counts > 1, np.int32(-1), first_joints)
        first = armature.pose.bones[0].as_pointer()
        sinew_native.host.read_pose(first, own, joint_counts, _bone_layout(has_segments), out)
        _prove_motions(armature, own, joint_counts, out)
    if not contract.has(features.SEGMENTS):
        _ask(armature, first_joints, joint_counts, out)


def _ask(armature: Any, first_joints: np.ndarray, joint_counts: np.ndarray, out: np.ndarray) -> None:
    """Reads through the API what read cannot read by address."""
    bones, used = armature.pose.bones, first_joints >= 0
    if not contract.has(features.BONES):
        numbers = np.empty(16 * len(bones), np.float32)
        bones.foreach_get("matrix_channel", numbers)
        single = used & (joint_counts == 1)
        out[first_joints[single]] = numbers.reshape(-1, 4, 4)[single]
    for bone in np.flatnonzero(used & (joint_counts > 1)):
        first = first_joints[bone]
        out[first : first + joint_counts[bone]] = _motions_of_segments(bones[int(bone)]).transpose(0, 2, 1)


def _prove_motions(armature: Any, first_joints: np.ndarray, joint_counts: np.ndarray, found: np.ndarray) -> None:
    """Compares with the API the motions of a bone and those of a B-bone's segments."""
    for what, feature, has_such, motions_of in (
        ("bones", features.BONES, np.equal, _motion_of),
        ("segments", features.SEGMENTS, np.greater, _motions_of_segments),
    ):
        chosen: Any = np.flatnonzero((first_joints >= 0) & has_such(joint_counts, 1)) if proof.is_due(what) else ()
        if not len(chosen):
            continue
        bone = int(chosen[-1])
        first = first_joints[bone]
        expected = motions_of(armature.pose.bones[bone])
        own = found[first : first + joint_counts[bone]].transpose(0, 2, 1)
        largest = np.abs(expected).max()
        if not np.isfinite(largest):
            continue
        if np.allclose(own, expected, rtol=0, atol=1e-3 * max(1.0, largest)):
            proof.give(what)
        else:
            contract.distrust(feature, f"the motions of {what} are not where they were")


def _motion_of(pose_bone: Any) -> np.ndarray:
    return np.array(pose_bone.matrix_channel, np.float64)[None]


def _motions_of_segments(pose_bone: Any) -> np.ndarray:
    """Computes the motions of the ends of n segments, (n + 1, 4, 4), as Blender's Armature modifier does."""
    rest = np.array(pose_bone.bone.matrix_local, np.float64)
    ends = range(pose_bone.bone.bbone_segments + 1)
    posed, at_rest = (
        np.array([pose_bone.bbone_segment_matrix(k, rest=is_rest) for k in ends], np.float64)
        for is_rest in (False, True)
    )
    turned = rest @ posed @ np.linalg.pinv(at_rest) @ np.linalg.pinv(rest)
    return _motion_of(pose_bone) @ turned


@contract.kept
def _layout() -> Any:
    """Returns the layout of all that is recorded, a sinew_native.host.PoseRecordLayout."""
    start = contract.offset(_BONE, "runtime")

    def within(member: str) -> int:
        return start + contract.offset("bPoseChannel_Runtime", member)

    members: list[tuple[int, int]] = []
    for start_of, size in sorted((contract.offset(_BONE, name), contract.size(_BONE, name)) for name in _MEMBERS):
        if members and sum(members[-1]) == start_of:  # neighbors are copied in one go
            members[-1] = members[-1][0], members[-1][1] + size
        else:
            members.append((start_of, size))
    computed = [(within("deform_dual_quat"), contract.size("bPoseChannel_Runtime", "deform_dual_quat"))]
    segments = [(within(member), SIZES[kind], more, int(is_compared)) for member, kind, more, is_compared in _SEGMENTS]
    return sinew_native.host.PoseRecordLayout(
        contract.offset(_BONE, "*next"), within("bbone_segments"), members, computed, segments
    )


@contract.kept
def fields() -> list[tuple[str, int, int]]:
    """Returns what a record holds of each bone, in order, as sinew_native.RigPlayer takes it."""
    places: dict[str, int] = {}
    first = 0
    for name, count in sinew_native.rig_bone_settings():
        places.setdefault(name, first)  # those of the pose come first
        first += count

    def field(member: str) -> tuple[str, int, int]:
        if member in _COMPUTED:
            return _COMPUTED[member], 0, 0
        name, skipped = NAMES[member]
        return "values", places[name] + skipped, CHANNELS[member] // _FLOAT

    return [field(member) for member in sorted(_MEMBERS, key=lambda member: contract.offset(_BONE, member))]


def _first(armature: Any) -> int:
    bones: Any = armature.pose.bones if armature.pose is not None else ()
    # Blender counts the bones by going through all of them, which takes long if they are not in the caches.
    return next((bone.as_pointer() for bone in bones), 0)


def record(armature: Any) -> np.ndarray:
    """Returns a copy of the pose of an evaluated armature object, (N,) uint8. Raises contract.Broken."""
    _prove(armature)
    return sinew_native.host.record_pose(_first(armature), _layout())


def matrices_in(recorded: np.ndarray) -> np.ndarray:
    """Returns the matrices of the B bones of a recorded pose in the armature's space, (B, 4, 4) float32."""
    sizes = {"channel_matrix": 16, "pose_matrix": 16, "head": 3, "tail": 3}
    counts = [count or sizes[name] for name, _first, count in fields()]
    begin = sum(counts[: [name for name, *_ in fields()].index("pose_matrix")])
    header = 1 + int(recorded[:4].view(np.int32)[0])
    segments = recorded[4 : 4 * header].view(np.int32)
    bent = sum((segments + more) * (SIZES[kind] // _FLOAT) for _member, kind, more, _is_compared in _SEGMENTS)
    widths = sum(counts) + SIZES["DualQuat"] // _FLOAT + np.where(segments > 0, bent, 0)
    places = header + np.cumsum(widths) - widths + begin
    return recorded.view(np.float32)[places[:, None] + np.arange(16)].reshape(-1, 4, 4).swapaxes(1, 2)


def play(armature: Any, recorded: np.ndarray) -> bool:
    """Writes a recorded pose into an evaluated armature object. Returns False, and writes nothing, if it was recorded
    with other bones or segments. Raises contract.Broken."""
    return sinew_native.host.play_pose(_first(armature), _layout(), recorded)


def play_original(armature: Any, recorded: np.ndarray) -> bool:
    """Writes a recorded pose into an original armature object, as Blender does after it has evaluated the bones: their
    channels and matrices. Returns False, and writes nothing, if it was recorded with other bones."""
    return sinew_native.host.play_original_pose(_first(armature), _layout(), recorded)


def step(steps: Iterable[tuple[Any, Any, np.ndarray, np.ndarray]]) -> list[bool]:
    """Writes recorded poses into evaluated armature objects and into their originals, where the evaluated one has
    exactly the pose `before`. steps: of each armature (evaluated, original, before, recorded). Returns False for those
    that have another pose: some of their bones may have been written."""
    return sinew_native.host.step_poses(
        _layout(),
        [(_first(armature), _first(original), before, recorded) for armature, original, before, recorded in steps],
    )


def are_posed(asked: Iterable[tuple[Any, np.ndarray]]) -> list[bool]:
    """Whether evaluated armature objects have exactly the recorded poses. asked: of each (armature, recorded). Raises
    contract.Broken."""
    return sinew_native.host.are_poses(_layout(), [(_first(armature), recorded) for armature, recorded in asked])


def _prove(armature: Any) -> None:
    """Compares with the API where a bone is and, if there is a B-bone, its segments."""
    if proof.is_due("poses") and _first(armature):
        bone: Any = armature.pose.bones[-1]
        wanted = [*_columns(bone.matrix_channel), *_columns(bone.matrix), *bone.head, *bone.tail]
        wanted += [*bone.location, *bone.rotation_euler, *bone.scale, bone.bbone_curveinx, bone.bbone_easein]
        found = _floats(bone.as_pointer() + contract.offset(_BONE, "chan_mat"), 16)
        parts = (("pose_mat", 16), ("pose_head", 3), ("pose_tail", 3), ("loc", 3), ("eul", 3), ("size", 3))
        for name, count in (*parts, ("curveInX", 1), ("ease1", 1)):
            found += _floats(bone.as_pointer() + contract.offset(_BONE, name), count)
        _give("poses", np.array_equal(found, wanted, equal_nan=True), "poses are not where they were")
    if proof.is_due("segments of poses"):
        bent: Any = next((each for each in armature.pose.bones if each.bone.bbone_segments > 1), None)
        start = contract.offset(_BONE, "runtime") + contract.offset("bPoseChannel_Runtime", "*bbone_pose_mats")
        address = contract.address_at(bent.as_pointer() + start) if bent is not None else 0
        if address:
            last = bent.bone.bbone_segments
            found = _floats(address + last * SIZES["Mat4"], 16)
            wanted = _columns(bent.bbone_segment_matrix(last))
            near = np.allclose(found, wanted, rtol=0, atol=1e-6, equal_nan=True)
            _give("segments of poses", near, "the segments of poses are not where they were")


def _give(what: str, is_equal: bool, difference: str) -> None:
    if not is_equal:
        raise contract.distrust(features.PLAYING, difference)
    proof.give(what)


def _floats(address: int, count: int) -> list[float]:
    return list((ctypes.c_float * count).from_address(address))


def _columns(matrix: Any) -> list[float]:
    return [number for column in matrix.transposed() for number in column]
