"""What Sinew relies on in Blender's memory: each struct and member that is read or written, with its type and size.

Offsets are those of the running Blender. What is not in the table cannot be asked for.
"""

import ctypes
import functools
from typing import NamedTuple

import bpy

from . import layout


class Member(NamedTuple):
    """type, size in bytes: as Blender describes them, None for any. offset: where it has to be, None for anywhere."""

    type: str | None
    size: int
    offset: int | None = None


def _pointer(kind=None, offset=None):
    return Member(kind, layout.POINTER, offset)


_NAME = Member("char", 64)  # of a vertex group

# A pointer's name begins with "*". Types of pointers are left open where Blender has changed them between versions.
CONTRACT = {
    "ID": {"*orig_id": _pointer("ID")},
    "Object": {"mode": Member("int", 4), "*data": _pointer(), "*pose": _pointer("bPose")},
    "Mesh": {"*key": _pointer("Key"), "vdata": Member("CustomData", 248), "vertex_group_names": Member("ListBase", 16)},
    "Key": {},
    "bArmature": {"flag": Member("int", 4)},
    # Structs of lists begin with the address of the next one.
    "ListBase": {"*first": _pointer("void", 0), "*last": _pointer("void", 8)},
    "bDeformGroup": {"*next": _pointer("bDeformGroup", 0), "name": _NAME},
    "KeyBlock": {
        "*next": _pointer("KeyBlock", 0),
        "flag": Member("short", 2),
        "curval": Member("float", 4),
        "*data": _pointer("void"),
        "totelem": Member("int", 4),
    },
    "CustomData": {"*layers": _pointer("CustomDataLayer"), "totlayer": Member("int", 4)},
    "CustomDataLayer": {"type": Member("int", 4), "*data": _pointer("void")},
    # Read by native code, which has these offsets and sizes in it.
    "MDeformVert": {"*dw": _pointer("MDeformWeight", 0), "totweight": Member("int", 4, 8)},
    "MDeformWeight": {"def_nr": Member("int", 4, 0), "weight": Member("float", 4, 4)},
    "bPose": {"chanbase": Member("ListBase", 16), "**chan_array": _pointer("bPoseChannel")},
    "bPoseChannel": {
        "*next": _pointer("bPoseChannel", 0),
        "chan_mat": Member("float", 64),
        "runtime": Member("bPoseChannel_Runtime", None),
    },
    "bPoseChannel_Runtime": {"bbone_segments": Member("int", 4), "*bbone_deform_mats": _pointer("Mat4")},
    "DriverTarget": {"*id": _pointer("ID")},
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
    "SmoothModifierData": {
        "fac": Member("float", 4),
        "repeat": Member("short", 2),
        "flag": Member("short", 2),
        "defgrp_name": _NAME,
    },
}
# Whose sizes count, for arrays of them are read.
SIZES = {"MDeformVert": 16, "MDeformWeight": 8}
# With a byte that Blender leaves alone, for a mark.
MARKED = ("Object", "Mesh", "Key", "bArmature")
# Where an object's matrix to the world's space is: in the first of these that there is. Before 4.1 the matrix itself,
# later the address of a struct that Blender does not describe.
PLACES = {"obmat": Member("float", 64), "object_to_world": Member("float", 64), "*runtime": _pointer()}


class Broken(RuntimeError):
    """Blender keeps its data in another way than Sinew knows."""


def differences(structs):
    """What of the contract does not hold, a list of clauses. structs: as layout.structs gives them."""
    found = []
    for kind, members in CONTRACT.items():
        if kind not in structs:
            found.append(f"there is no struct {kind}")
            continue
        for name, wanted in members.items():
            found += _differences_of(structs[kind], kind, name, wanted)
    found += [
        f"{kind} has {structs[kind].size} bytes instead of {size}"
        for kind, size in SIZES.items()
        if kind in structs and structs[kind].size != size
    ]
    found += [f"{kind} has no unused byte" for kind in MARKED if kind in structs and structs[kind].padding() is None]
    if "Object" in structs:
        place = _place_in(structs["Object"])
        found += (
            ["Object has no matrix to the world"]
            if place is None
            else _differences_of(structs["Object"], "Object", place, PLACES[place])
        )
    return found


def _differences_of(struct, kind, name, wanted):
    if name not in struct.members:
        return [f"{kind} has no {name}"]
    offset, of_type, size = struct.members[name]
    if wanted.type not in (None, of_type) or wanted.size not in (None, size):
        expected = " ".join(str(each) for each in (wanted.type, wanted.size and f"of {wanted.size} bytes") if each)
        return [f"{kind}.{name} is {of_type} of {size} bytes instead of {expected}"]
    if wanted.offset not in (None, offset):
        return [f"{kind}.{name} is at byte {offset} instead of {wanted.offset}"]
    return []


def _place_in(struct):
    return next((name for name in PLACES if name in struct.members), None)


# --- of the running Blender -----------------------------------------------------------------------

_trouble = None  # a sentence, "" for none; None: nobody has looked yet


def trouble():
    """Why Blender's own modifiers have to deform, a sentence for people; "" if nothing is wrong. To be called from the
    main thread first: it has Blender write a file."""
    if _trouble is None:
        _look()
    return _trouble


def is_broken():
    """The same as a truth value. From any thread; false as long as nobody has looked."""
    return bool(_trouble)


def distrust(difference):
    """From now on nothing of Blender's memory is read or written. difference: a clause. Returns the error to raise."""
    global _trouble
    _trouble = _trouble or _sentence([difference])
    return Broken(_trouble)


def forget():
    """For tests: it is looked at again."""
    global _trouble
    _trouble = None
    for function in (offset, size, struct_size, unused_byte, place):
        function.cache_clear()


def _look():
    global _trouble
    try:
        found = differences(layout.structs())
    except Exception as error:  # a failure is kept: it would be the same for each mesh and frame
        found = [f"its description of its data cannot be read: {error}"]
    _trouble = _sentence(found) if found else ""


def _sentence(found):
    more = f", and {len(found) - 1} more" if len(found) > 1 else ""
    return (
        f"Blender {bpy.app.version_string} keeps its data in another way than this version of Sinew knows ({found[0]}"
        f"{more}), so Blender's own modifiers deform: look for a newer Sinew"
    )


def _of(kind):
    if trouble():
        raise Broken(_trouble)
    return layout.structs()[kind]


@functools.cache
def offset(kind, member):
    """Of a member in its struct, in bytes. Raises KeyError for one that is not in the contract."""
    CONTRACT[kind][member]
    return _of(kind).offset(member)


@functools.cache
def size(kind, member):
    """Of a member, in bytes."""
    CONTRACT[kind][member]
    return _of(kind).members[member][2]


@functools.cache
def struct_size(kind):
    """In bytes."""
    CONTRACT[kind]
    return _of(kind).size


@functools.cache
def unused_byte(kind):
    """Offset of a byte that Blender leaves alone, in bytes."""
    if kind not in MARKED:
        raise KeyError(kind)
    return _of(kind).padding()


@functools.cache
def place():
    """(name of the member of Object in which its matrix to the world's space is, or whose address leads there; its
    offset in bytes)."""
    found = _of("Object")
    name = _place_in(found)
    return name, found.offset(name)


def region(struct, kind, member):
    """(address, size) of a member, in bytes. struct: anything of Blender's with an address; kind: its name there."""
    return struct.as_pointer() + offset(kind, member), size(kind, member)


def address_at(address):
    """The address that is stored there."""
    return ctypes.c_uint64.from_address(address).value
