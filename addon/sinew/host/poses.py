"""Records what Blender's evaluation has written into the bones of an armature, and writes it there again."""

import ctypes
import functools
from collections.abc import Iterable
from typing import Any

import numpy as np

from ..native import sinew_native
from . import contract, features, proof
from .members import CHANNELS, SIZES

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


@functools.cache
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


@functools.cache
def fields() -> list[tuple[str, int, int]]:
    """Returns what a record holds of each bone, in order, as sinew_native.rig_records takes it."""
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


def forget() -> None:
    """Discards the layout. For tests."""
    fields.cache_clear()
    _layout.cache_clear()


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
        raise contract.distrust(features.FREEZING, difference)
    proof.give(what)


def _floats(address: int, count: int) -> list[float]:
    return list((ctypes.c_float * count).from_address(address))


def _columns(matrix: Any) -> list[float]:
    return [number for column in matrix.transposed() for number in column]
