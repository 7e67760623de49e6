"""Reads the bytes of all settings of an armature's pose: of its bones, but not how they are posed, and of their
constraints, but neither influence nor flags, which are written on each frame if they are animated."""

import ctypes
import functools
from typing import Any

import bpy

from ..native import sinew_native
from . import contract, features, proof
from .members import CHANNELS, CONSTRAINTS

# What evaluations write into bones, what is selected, and what is only drawn.
_NOT_SET = (
    *("flag", "selectflag", "chan_mat", "pose_mat", "disp_mat", "disp_tail_mat", "constinv", "pose_head", "pose_tail"),
    "runtime",
)
_WRITTEN = "enforce", "flag"
_ARMATURE = "bArmatureConstraint"


def _whole(kind: str, *lists: tuple[int, Any]) -> Any:
    return sinew_native.host.Described([(0, contract.struct_size(kind))], [], [], list(lists))


def _numbers() -> dict[str, int]:
    """Returns the numbers of the types of constraints."""
    kinds: Any = bpy.types.Constraint.bl_rna.properties["type"]
    return {item.identifier: item.value for item in kinds.enum_items}


@functools.cache
def _layout() -> Any:
    """Returns what is read of the bones."""
    first = contract.offset("ListBase", "*first")
    numbers = _numbers()
    kinds = {numbers[name]: _whole(kind) for name, kind in CONSTRAINTS.items() if name in numbers}
    targets = contract.offset(_ARMATURE, "targets") + first
    kinds[numbers["ARMATURE"]] = _whole(_ARMATURE, (targets, _whole("bConstraintTarget")))
    choice = contract.offset("bConstraint", "type"), contract.offset("bConstraint", "*data"), kinds
    written = sorted((contract.offset("bConstraint", name), contract.size("bConstraint", name)) for name in _WRITTEN)
    starts = [0, *(sum(each) for each in written)]
    ends = [*(start for start, _size in written), contract.struct_size("bConstraint")]
    regions = [(start, end - start) for start, end in zip(starts, ends)]
    constraint = sinew_native.host.Described(regions, [], [], [], [choice])
    own = contract.plain_regions("bPoseChannel", *CHANNELS, *_NOT_SET)
    lists = [(contract.offset("bPoseChannel", "constraints") + first, constraint)]
    return sinew_native.host.Described(own, [], [], lists)


@functools.cache
def _kinds() -> Any:
    """Returns what is read of the bones for `kinds_of_constraints`."""
    kind = contract.offset("bConstraint", "type"), contract.size("bConstraint", "type")
    first = contract.offset("bPoseChannel", "constraints") + contract.offset("ListBase", "*first")
    return sinew_native.host.Described([], [], [], [(first, sinew_native.host.Described([kind], [], [], []))])


def kinds_of_constraints(ob: bpy.types.Object) -> Any:
    """Returns a value that is equal at two times if the bones of an original armature object have constraints of the
    same types."""
    if not _can_read(ob):
        return [[getattr(each, "type", "") for each in bone.constraints] for bone in ob.pose.bones]
    return _kinds().bytes_of_list(ob.pose.bones[0].as_pointer())


def read(ob: bpy.types.Object) -> bytes | None:
    """Returns bytes that are equal at two times if all settings of the pose of an original armature object are, and the
    addresses of what its constraints follow. None if they cannot be read, as with a constraint of another type."""
    return _layout().bytes_of_list(ob.pose.bones[0].as_pointer()) if _can_read(ob) else None


def _can_read(ob: bpy.types.Object) -> bool:
    if not contract.has(features.POSED) or not len(ob.pose.bones):
        return False
    if proof.is_due("constraints of poses"):
        bones = (each for each in ob.pose.bones if len(each.constraints))
        bone = next((each for each in bones if isinstance(each.constraints[0], bpy.types.Constraint)), None)
        if bone is not None:
            first: Any = bone.constraints[0]
            at = contract.offset("bPoseChannel", "constraints") + contract.offset("ListBase", "*first")
            is_there = contract.address_at(bone.as_pointer() + at) == first.as_pointer()
            place = first.as_pointer() + contract.offset("bConstraint", "type")
            if not is_there or ctypes.c_int16.from_address(place).value != _numbers()[first.type]:
                contract.distrust(features.POSED, "the constraints of a bone are not where they were")
                return False
            proof.give("constraints of poses")
    return True
