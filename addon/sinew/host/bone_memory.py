"""Reads all bones of an armature by address, of its pose and of its data: what must be equal for two of them to be the
same, their numbers, the settings of the pose, and what animation sets of constraints."""

import ctypes
from typing import Any, NamedTuple

import bpy
import numpy as np

from ..native import sinew_native
from . import contract, features, poses, proof
from .members import BEND, CHANNELS, CONSTRAINTS, LIMITS, REST

_HANDLES = "*bbone_prev", "*bbone_next"
_FLOAT, _ADDRESS = 4, 8  # bytes
# By the member: what Blender's API calls it, or its parts.
_POSED = {member: (name,) for member, (name, _skipped) in poses.NAMES.items()} | LIMITS
_REST = {member: (name,) for member, name in REST.items()} | {member: _POSED[member] for member in BEND}
_ADDRESSES = {
    "bPoseChannel": ("*next", "*parent", "constraints", "*prop"),
    "Bone": ("*prop",),
}  # of the first of a list
# What evaluations write into bones, what is selected, and what is only drawn.
_NOT_SET = (
    *("flag", "selectflag", "chan_mat", "pose_mat", "disp_mat", "disp_tail_mat", "constinv", "pose_head", "pose_tail"),
    "runtime",
)
_WRITTEN = "enforce", "flag"
_ARMATURE = "bArmatureConstraint"
_MUTED = 512  # a bit of a constraint's flags


@contract.kept
def _bytes_layout(has_handles: bool) -> tuple[int, Any]:
    """Returns the byte offset of the first bone in an armature's data, and what is read of bones: the addresses of
    their handles, or all that is no address."""
    children = contract.offset("Bone", "childbase") + contract.offset("ListBase", "*first")
    handles = [(contract.offset("Bone", name), contract.size("Bone", name)) for name in _HANDLES if has_handles]
    bones = sinew_native.host.Described(handles or contract.plain_regions("Bone"), [], [], [(children, None)])
    return contract.offset("bArmature", "bonebase") + contract.offset("ListBase", "*first"), bones


def can_read() -> bool:
    """Whether read_bytes works in this Blender."""
    return contract.has(features.EDITIONS)


def read_bytes(data: Any) -> bytes:
    """Returns bytes that are equal for two copies of an armature's data if their bones are: names, rest positions, all
    settings but other bones, and which bone is whose child. They may differ for equal bones, by bytes that do not
    matter."""
    return _read_data(data, False)


def read_handles(data: Any) -> bytes:
    """Returns bytes that are equal at two times if the B-bones of an original armature's data have the same bones as
    their custom handles. Blender's API lets nobody set other bones of a bone."""
    return _read_data(data, True)


def _read_data(data: Any, has_handles: bool) -> bytes:
    first, bones = _bytes_layout(has_handles)
    return bones.bytes_of_list(contract.address_at(data.as_pointer() + first))


class Numbers(NamedTuple):
    """What N bones have: numbers, (N, F) float32; which columns are those of a property; addresses, (N, A) uint64."""

    floats: np.ndarray
    columns: dict[str, slice]
    addresses: np.ndarray

    def of(self, name: str) -> np.ndarray:
        """Returns a property of all bones: N, or N x the numbers that it has."""
        own = self.columns[name]
        return self.floats[:, own if own.stop - own.start > 1 else own.start]

    def have_properties(self) -> np.ndarray:
        """Returns which bones may have custom properties."""
        return self.addresses[:, -1] != 0


@contract.kept
def _numbers_layout(kind: str) -> tuple[Any, dict[str, slice], int]:
    """Returns what is read of a struct of bones, the columns, and how many there are."""
    regions = [(contract.offset(kind, name), _ADDRESS) for name in _ADDRESSES[kind]]
    columns, count = dict[str, slice](), 0
    for member, names in (_POSED if kind == "bPoseChannel" else _REST).items():
        regions.append((contract.offset(kind, member), contract.size(kind, member)))
        width = regions[-1][1] // _FLOAT // len(names)
        for name in names:
            columns[name] = slice(columns[name].start if name in columns else count, count + width)
            count += width
    children = contract.offset("Bone", "childbase") + contract.offset("ListBase", "*first")
    lists = [(children, None)] if kind == "Bone" else []
    return sinew_native.host.Described(regions, [], [], lists), columns, count


def read_numbers(ob: Any) -> tuple[Numbers, Numbers] | None:
    """Returns what the bones of an original armature object's pose have, and those of its data, in the order of the
    collections in the API. None if it cannot be read."""
    if not contract.has(features.NUMBERS) or not len(ob.pose.bones):
        return None
    posed, rest = (
        _read_numbers(kind, bones) for kind, bones in (("bPoseChannel", ob.pose.bones), ("Bone", ob.data.bones))
    )
    if proof.is_due("numbers of bones"):
        if not (
            _is_shown(posed, ob.pose.bones) and _is_shown(rest, ob.data.bones) and _are_related(posed, ob.pose.bones)
        ):
            contract.distrust(features.NUMBERS, "the numbers of bones are not where they were")
            return None
        proof.give("numbers of bones")
    return posed, rest


def _read_numbers(kind: str, bones: Any) -> Numbers:
    described, columns, count = _numbers_layout(kind)
    before = _ADDRESS * len(_ADDRESSES[kind])
    stream = described.bytes_of_list(bones[0].as_pointer(), marks=False)
    found = np.frombuffer(stream, np.uint8).reshape(-1, before + _FLOAT * count)
    return Numbers(found[:, before:].view(np.float32), columns, found[:, :before].view(np.uint64))


def parents(posed: Numbers) -> list[int]:
    """Returns the number of the parent of each bone of a pose, -1 for none."""
    following, of_parents = posed.addresses[:, :2].T.tolist()
    places = {0: -1, **dict(zip(following[:-1], range(1, len(following))))}  # of all but the first bone
    return [places.get(address, 0) for address in of_parents]


def have_constraints(posed: Numbers) -> list[bool]:
    """Returns which bones of a pose have constraints."""
    return (posed.addresses[:, 2] != 0).tolist()


def _are_related(posed: Numbers, bones: Any) -> bool:
    """Whether the API shows the same parents of all bones, and constraints of the same bones."""
    names = [*bones.keys(), None]
    return all(
        (names[parent] == (bone.parent and bone.parent.name)) and has == (len(bone.constraints) > 0)
        for parent, has, bone in zip(parents(posed), have_constraints(posed), bones)
    )


def _is_shown(found: Numbers, bones: Any) -> bool:
    """Whether the API shows the numbers of the last bone, and custom properties only where they may be."""
    if len(found.floats) != len(bones):
        return False
    wanted = [(own, np.array(getattr(bones[-1], name), np.float32).T.ravel()) for name, own in found.columns.items()]
    return all(np.array_equal(found.floats[-1, own], one, equal_nan=True) for own, one in wanted) and all(
        may_have or not bone.keys() for may_have, bone in zip(found.have_properties().tolist(), bones)
    )


def _whole(kind: str, *lists: tuple[int, Any]) -> Any:
    return sinew_native.host.Described([(0, contract.struct_size(kind))], [], [], list(lists))


def _numbers() -> dict[str, int]:
    """Returns the numbers of the types of constraints."""
    kinds: Any = bpy.types.Constraint.bl_rna.properties["type"]
    return {item.identifier: item.value for item in kinds.enum_items}


@contract.kept
def _settings_layout() -> Any:
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


@contract.kept
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


def read_settings(ob: bpy.types.Object) -> bytes | None:
    """Returns bytes that are equal at two times if all settings of the pose of an original armature object are, and the
    addresses of what its constraints follow. None if they cannot be read, as with a constraint of another type."""
    return _settings_layout().bytes_of_list(ob.pose.bones[0].as_pointer()) if _can_read(ob) else None


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


def can_set_constraints() -> bool:
    """Whether this Blender's constraints can be set."""
    return contract.has(features.CONSTRAINTS)


def set_influence(constraint: Any, value: float) -> None:
    """Sets the influence of a constraint. Raises contract.Broken."""
    place = ctypes.c_float.from_address(_address(constraint, "enforce"))
    place.value = value


def set_mute(constraint: Any, value: float) -> None:
    """Mutes a constraint, or lets Blender evaluate it. Raises contract.Broken."""
    flags = ctypes.c_int16.from_address(_address(constraint, "flag"))
    flags.value = flags.value & ~_MUTED | _MUTED * bool(value)


def set_enabled(constraint: Any, value: float) -> None:
    """Lets Blender evaluate a constraint, or mutes it. Raises contract.Broken."""
    set_mute(constraint, not value)


SETTERS = {"influence": set_influence, "mute": set_mute, "enabled": set_enabled}


def _address(constraint: Any, name: str) -> int:
    address = constraint.as_pointer()
    if proof.is_due("constraints"):
        influence = ctypes.c_float.from_address(address + contract.offset("bConstraint", "enforce")).value
        flags = ctypes.c_int16.from_address(address + contract.offset("bConstraint", "flag")).value
        is_same = influence == constraint.influence and bool(flags & _MUTED) == constraint.mute
        proof.give("constraints", is_same, "the influence of a constraint is not where it was", features.CONSTRAINTS)
    return address + contract.offset("bConstraint", name)
