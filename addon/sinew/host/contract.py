"""The parts of Blender's memory that Sinew relies on: each struct and member that it reads or writes, with type and
size.

Offsets are those of the running Blender. A member that is not in the table cannot be requested.
"""

import ctypes
import functools
from collections.abc import Iterator
from typing import Any, NamedTuple

import bpy

from . import layout


class Member(NamedTuple):
    """Describes a member of a struct. type, size: as in Blender's description, size in bytes, None for any. offset: the
    required offset in bytes, None for any."""

    type: str | None
    size: int | None
    offset: int | None = None


def _pointer(kind: str | None = None, offset: int | None = None) -> Member:
    return Member(kind, layout.POINTER, offset)


_NAME = Member("char", 64)

# A pointer's name begins with "*". The type of a pointer is omitted if it differs between Blender versions.
CONTRACT: dict[str, dict[str, Member]] = {
    "ID": {"*orig_id": _pointer("ID"), "recalc": Member("int", 4)},
    "Object": {"mode": Member("int", 4), "*data": _pointer(), "*pose": _pointer("bPose")},
    "Mesh": {"*key": _pointer("Key"), "vdata": Member("CustomData", 248), "vertex_group_names": Member("ListBase", 16)},
    "Lattice": {
        **{name: Member("float", 4) for name in ("fu", "fv", "fw", "du", "dv", "dw")},
        "*dvert": _pointer("MDeformVert"),
        "vertex_group_names": Member("ListBase", 16),
    },
    "Key": {},
    "bArmature": {"flag": Member("int", 4), "bonebase": Member("ListBase", 16), "*adt": _pointer("AnimData")},
    "bAction": {},
    "AnimData": {"*action": _pointer("bAction"), "*tmpact": _pointer("bAction")},
    "NlaStrip": {"*act": _pointer("bAction")},
    "Bone": {"*next": _pointer("Bone", 0), "childbase": Member("ListBase", 16)},
    # A struct in a list begins with the address of the next one.
    "ListBase": {"*first": _pointer("void", 0), "*last": _pointer("void", 8)},
    "bDeformGroup": {"*next": _pointer("bDeformGroup", 0), "name": _NAME},
    "KeyBlock": {
        "*next": _pointer("KeyBlock", 0),
        "flag": Member("short", 2),
        "curval": Member("float", 4),
        "relative": Member("short", 2),
        "*data": _pointer("void"),
        "totelem": Member("int", 4),
    },
    "CustomData": {"*layers": _pointer("CustomDataLayer"), "totlayer": Member("int", 4)},
    "CustomDataLayer": {"type": Member("int", 4), "*data": _pointer("void")},
    # Read by native code, in which these offsets and sizes are hard-coded.
    "MDeformVert": {"*dw": _pointer("MDeformWeight", 0), "totweight": Member("int", 4, 8)},
    "MDeformWeight": {"def_nr": Member("int", 4, 0), "weight": Member("float", 4, 4)},
    "bPose": {"chanbase": Member("ListBase", 16), "**chan_array": _pointer("bPoseChannel")},
    "bPoseChannel": {
        "*next": _pointer("bPoseChannel", 0),
        "chan_mat": Member("float", 64),
        "runtime": Member("bPoseChannel_Runtime", None),
    },
    "bPoseChannel_Runtime": {"bbone_segments": Member("int", 4), "*bbone_deform_mats": _pointer("Mat4")},
    "DriverTarget": {"*id": _pointer("ID"), "*rna_path": _pointer("char")},
    "DriverVar": {
        "*next": _pointer("DriverVar", 0),
        "name": _NAME,
        "type": Member("char", 1),
        "targets": Member("DriverTarget", None),
        "curval": Member("float", 4),
    },
    "ChannelDriver": {
        "variables": Member("ListBase", 16),
        "expression": Member("char", 256),
        "type": Member("int", 4),
        "flag": Member("int", 4),
    },
    "FCurve": {
        "*next": _pointer("FCurve", 0),
        "*rna_path": _pointer("char"),
        "*driver": _pointer("ChannelDriver"),
        "flag": Member("short", 2),
    },
    "ModifierData": {"mode": Member("int", 4)},
    "ArmatureModifierData": {
        "deformflag": Member("short", 2),
        "multi": Member("short", 2),
        "defgrp_name": _NAME,
        "*object": _pointer("Object"),
    },
    "CorrectiveSmoothModifierData": {
        "(*bind_coords)()": _pointer("float"),
        "bind_coords_num": Member("int", 4),
        "lambda": Member("float", 4),
        "scale": Member("float", 4),
        "repeat": Member("short", 2),
        "flag": Member("short", 2),
        "smooth_type": Member("char", 1),
        "rest_source": Member("char", 1),
        "defgrp_name": _NAME,
    },
    "SurfaceDeformModifierData": {
        "*verts": _pointer("SDefVert"),
        "num_mesh_verts": Member("int", 4),
        "numverts": Member("int", 4),
        "target_verts_num": Member("int", 4),
        "flags": Member("int", 4),
        "mat": Member("float", 64),
    },
    "MeshDeformModifierData": {
        "*bindinfluences": _pointer("MDefInfluence"),
        "*bindoffsets": _pointer("int"),
        "*bindcagecos": _pointer("float"),
        "totvert": Member("int", 4),
        "totcagevert": Member("int", 4),
        "bindmat": Member("float", 64),
    },
    "MDefInfluence": {"vertex": Member("int", 4, 0), "weight": Member("float", 4, 4)},
    # Read by native code, in which these offsets and sizes are hard-coded.
    "SDefVert": {
        "*binds": _pointer("SDefBind", 0),
        "numbinds": Member("int", 4, 8),
        "vertex_idx": Member("int", 4, 12),
    },
    "SDefBind": {
        "*vert_inds": _pointer("int", 0),
        "numverts": Member("int", 4, 8),
        "mode": Member("int", 4, 12),
        "*vert_weights": _pointer("float", 16),
        "normal_dist": Member("float", 4, 24),
        "influence": Member("float", 4, 28),
    },
    "SmoothModifierData": {
        "fac": Member("float", 4),
        "repeat": Member("short", 2),
        "flag": Member("short", 2),
        "defgrp_name": _NAME,
    },
}
# What keyframes, drivers and people set in a pose bone.
CHANNELS = {
    "loc": 12,
    "size": 12,
    "eul": 12,
    "quat": 16,
    "rotAxis": 12,
    "rotAngle": 4,
    "scale_in": 12,
    "scale_out": 12,
    **dict.fromkeys(("roll1", "roll2", "curveInX", "curveInY", "curveOutX", "curveOutY", "ease1", "ease2"), 4),
}
# What only freezing needs (frozen/). If it does not hold, characters cannot be frozen, and all else works.
FREEZING: dict[str, dict[str, Member]] = {
    "ID": {"us": Member("int", 4)},
    "AnimData": {"nla_tracks": Member("ListBase", 16)},
    "ChannelDriver": {
        "expression": Member("char", 256),
        "*expr_simple": _pointer("ExprPyLike_Parsed"),
        "type": Member("int", 4),
    },
    "bPoseChannel": {
        "pose_mat": Member("float", 64),
        "pose_head": Member("float", 12),
        "pose_tail": Member("float", 12),
        **{name: Member("float", size) for name, size in CHANNELS.items()},
    },
    "bPoseChannel_Runtime": {
        "deform_dual_quat": Member("DualQuat", 100),
        "*bbone_pose_mats": _pointer("Mat4"),
        "*bbone_dual_quats": _pointer("DualQuat"),
    },
    "FCurve": {
        "*bezt": _pointer("BezTriple"),
        "*fpt": _pointer("FPoint"),
        "totvert": Member("int", 4),
        "extend": Member("short", 2),
        "array_index": Member("int", 4),
        "*rna_path": _pointer("char"),
        "modifiers": Member("ListBase", 16),
    },
    "BezTriple": {
        "vec": Member("float", 36),
        "ipo": Member("char", 1),
        "easing": Member("char", 1),
        "back": Member("float", 4),
        "amplitude": Member("float", 4),
        "period": Member("float", 4),
    },
}
FREEZING_SIZES = {"Mat4": 64, "DualQuat": 100}
# The sizes in bytes of structs that are read from arrays.
SIZES = {"MDeformVert": 16, "MDeformWeight": 8, "SDefVert": 16, "SDefBind": 32, "MDefInfluence": 8}
# Structs with a byte that Blender does not use, for a mark.
MARKED = ("Object", "Mesh", "Key", "bArmature", "bAction")
# The members that may lead to an object's matrix to world space; the first that exists is used. Before 4.1 it is the
# matrix itself, since then the address of a struct that Blender does not describe.
PLACES = {"obmat": Member("float", 64), "object_to_world": Member("float", 64), "*runtime": _pointer()}


class Broken(RuntimeError):
    """Raised if Blender's data layout is not the one that Sinew expects."""


def differences(structs: dict[str, layout.Struct]) -> list[str]:
    """Returns the parts of the contract that do not hold, as clauses. structs: as returned by layout.structs."""
    found = _differences(structs, CONTRACT, SIZES)
    found += [f"{kind} has no unused byte" for kind in MARKED if kind in structs and structs[kind].padding() is None]
    if "Object" in structs:
        place = _place_in(structs["Object"])
        found += (
            ["Object has no matrix to the world"]
            if place is None
            else _differences_of(structs["Object"], "Object", place, PLACES[place])
        )
    return found


def freezing_differences(structs: dict[str, layout.Struct]) -> list[str]:
    """Returns the parts of FREEZING that do not hold, as clauses. structs: as returned by layout.structs."""
    return _differences(structs, FREEZING, FREEZING_SIZES)


def _differences(
    structs: dict[str, layout.Struct], wanted: dict[str, dict[str, Member]], sizes: dict[str, int]
) -> list[str]:
    found = []
    for kind, members in wanted.items():
        if kind not in structs:
            found.append(f"there is no struct {kind}")
            continue
        for name, member in members.items():
            found += _differences_of(structs[kind], kind, name, member)
    return found + [
        f"{kind} has {structs[kind].size} bytes instead of {size}"
        for kind, size in sizes.items()
        if kind in structs and structs[kind].size != size
    ]


def _differences_of(struct: layout.Struct, kind: str, name: str, wanted: Member) -> list[str]:
    if name not in struct.members:
        return [f"{kind} has no {name}"]
    offset, of_type, size = struct.members[name]
    if wanted.type not in (None, of_type) or wanted.size not in (None, size):
        expected = " ".join(str(each) for each in (wanted.type, wanted.size and f"of {wanted.size} bytes") if each)
        return [f"{kind}.{name} is {of_type} of {size} bytes instead of {expected}"]
    if wanted.offset not in (None, offset):
        return [f"{kind}.{name} is at byte {offset} instead of {wanted.offset}"]
    return []


def _place_in(struct: layout.Struct) -> str | None:
    return next((name for name in PLACES if name in struct.members), None)


# --- of the running Blender -----------------------------------------------------------------------

_trouble: str | None = None  # a sentence, "" for none; None: not checked yet
_freezing_trouble: str | None = None  # the same


def trouble() -> str:
    """Returns why Blender's own modifiers must deform, as a sentence for users; "" if nothing is wrong. The first call
    must come from the main thread, because it makes Blender write a file."""
    if _trouble is None:
        _look()
    return _trouble  # type: ignore[return-value]  # _look has set it


def is_broken() -> bool:
    """Whether there is trouble. False if nothing has been checked yet. Can be called from any thread."""
    return bool(_trouble)


def distrust(difference: str) -> Broken:
    """Stops all access to Blender's memory from now on. difference: a clause. Returns the error to raise."""
    global _trouble
    _trouble = _trouble or _sentence([difference])
    return Broken(_trouble)


def freezing_trouble() -> str:
    """Returns why characters cannot be frozen, as a sentence for users; "" if nothing is wrong. The first call must
    come from the main thread."""
    global _freezing_trouble
    if trouble():
        return trouble()
    if _freezing_trouble is None:
        found = freezing_differences(layout.structs())
        _freezing_trouble = _freezing_sentence(found) if found else ""
    return _freezing_trouble


def distrust_freezing(difference: str) -> Broken:
    """Stops all freezing from now on. difference: a clause. Returns the error to raise."""
    global _freezing_trouble
    _freezing_trouble = _freezing_trouble or _freezing_sentence([difference])
    return Broken(_freezing_trouble)


def forget() -> None:
    """Discards the result of the check, so that the next use checks again. For tests."""
    global _trouble, _freezing_trouble
    _trouble = _freezing_trouble = None
    for function in (offset, size, struct_size, plain_regions, unused_byte, place):
        function.cache_clear()


def _look() -> None:
    global _trouble
    try:
        found = differences(layout.structs())
    except Exception as error:  # kept, because it would fail again for each mesh and frame
        found = [f"its description of its data cannot be read: {error}"]
    _trouble = _sentence(found) if found else ""


def _sentence(found: list[str]) -> str:
    return f"{_difference_of_versions(found)}, so Blender's own modifiers deform: look for a newer Sinew"


def _freezing_sentence(found: list[str]) -> str:
    return f"{_difference_of_versions(found)}, so characters cannot be frozen: look for a newer Sinew"


def _difference_of_versions(found: list[str]) -> str:
    more = f", and {len(found) - 1} more" if len(found) > 1 else ""
    version = bpy.app.version_string
    return f"Blender {version} keeps its data in another way than this version of Sinew knows ({found[0]}{more})"


def _of(kind: str) -> layout.Struct:
    if trouble():
        raise Broken(_trouble)
    return layout.structs()[kind]


def _check_listed(kind: str, member: str) -> None:
    """Raises KeyError if the member is in no list, and Broken if it is only in FREEZING, which does not hold."""
    if member in CONTRACT.get(kind, {}):
        return
    FREEZING[kind][member]
    if freezing_trouble():
        raise Broken(_freezing_trouble)


@functools.cache
def offset(kind: str, member: str) -> int:
    """Returns the offset of a member in its struct, in bytes. Raises KeyError if it is not in the contract."""
    _check_listed(kind, member)
    return _of(kind).offset(member)


@functools.cache
def size(kind: str, member: str) -> int:
    """Returns the size of a member, in bytes."""
    _check_listed(kind, member)
    return _of(kind).members[member][2]


@functools.cache
def struct_size(kind: str) -> int:
    """Returns the size of a struct, in bytes."""
    if kind not in CONTRACT and kind not in FREEZING:
        raise KeyError(kind)
    return _of(kind).size


@functools.cache
def plain_regions(kind: str) -> list[tuple[int, int]]:
    """Returns [(offset, size)] in bytes of all that a struct contains except addresses."""
    if kind not in CONTRACT:
        raise KeyError(kind)
    _of(kind)  # which raises Broken
    found: list[tuple[int, int]] = []
    for offset, size in _plain(layout.structs(), kind, 0):
        if found and sum(found[-1]) == offset:
            found[-1] = found[-1][0], found[-1][1] + size
        else:
            found.append((offset, size))
    return found


def _plain(structs: dict[str, layout.Struct], kind: str, start: int) -> Iterator[tuple[int, int]]:
    for name, (offset, of_type, size) in structs[kind].members.items():
        if name[0] in "*(":
            continue
        if of_type in structs:
            for place in range(offset, offset + size, structs[of_type].size):
                yield from _plain(structs, of_type, start + place)
        else:
            yield start + offset, size


@functools.cache
def unused_byte(kind: str) -> int:
    """Returns the offset in a struct of a byte that Blender does not use."""
    if kind not in MARKED:
        raise KeyError(kind)
    return _of(kind).padding()  # type: ignore[return-value]  # not None: differences() checks it


@functools.cache
def place() -> tuple[str, int]:
    """Returns the name of the member of Object that contains its matrix to world space, or the address that leads to
    it; and the member's offset in bytes."""
    found = _of("Object")
    name: Any = _place_in(found)  # a str: differences() checks that there is one
    return name, found.offset(name)


def region(struct: bpy.types.bpy_struct, kind: str, member: str) -> tuple[int, int]:
    """Returns the address of a member and its size in bytes. struct: any of Blender's structs; kind: its name in
    Blender's description."""
    return struct.as_pointer() + offset(kind, member), size(kind, member)


def address_at(address: int) -> int:
    """Returns the address that is stored at an address."""
    return ctypes.c_uint64.from_address(address).value
