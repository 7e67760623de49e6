"""Finds in memory the matrix from an object's space to world space, and writes where objects are, as Blender does when
it evaluates them: the API would count it as an edit."""

import ctypes
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from mathutils import Matrix

from ..native import sinew_native
from . import contract, features, layout, members, proof

MATRIX = 64  # bytes
_MIRRORED = 4  # a bit of an object's flags
Channel = tuple[str, int]  # path and index of a number of an object's place


class Row(NamedTuple):
    """An object whose place is computed."""

    parent: int  # the number of its parent's row, which is in front of it; -1 for one that is not computed
    matrices: bytes  # as matrices_of returns them, or world_of without a parent
    objects: Sequence[Any] = ()  # that get the place: originals, evaluated copies
    posed: Any = None  # an evaluated armature that does


@contract.kept
def place_layout() -> tuple[int | None, int] | None:
    """Returns two byte offsets: of the pointer in an object that leads to its matrix to world space, or None if the
    object itself contains the matrix; and of the matrix, from the pointer's target or from the object. Returns None if
    the matrix cannot be found. The first call must come from the main thread."""
    if not contract.has(features.FAST_ARMATURES):
        return None
    name, offset = contract.place()
    # A pointer leads to a struct that Blender's description does not contain. The matrix should be its first member; an
    # object with a distinctive matrix shows whether it is.
    place = (offset, 0) if name.startswith("*") else (None, offset)
    with layout.temporary_data() as data:
        probe = data.objects.new("", None)
        probe.matrix_world = Matrix.Translation((3, 5, 7)) @ Matrix.Diagonal((11, 13, 17, 1))
        if _matrix_at(_place_address(probe, place)) == _columns(probe.matrix_world):
            return place
    contract.distrust(features.FAST_ARMATURES, "the matrices of objects to the world are not where they were")
    return None


def place_at(ob: Any) -> tuple[int, int]:
    """Returns where an evaluated object's matrix to world space is, 16 float32, column by column: its address and -1,
    or the address at which the address of a struct is stored, and the matrix's offset in that struct in bytes. Blender
    allocates new memory for the struct when it copies the object again."""
    place = place_layout()
    assert place is not None  # is_found
    pointer, offset = place
    start = ob.as_pointer()
    return (start + offset, -1) if pointer is None else (start + pointer, offset)


def is_found(ob: Any) -> bool:
    """Whether an evaluated object's matrix to world space is where place_at says."""
    return place_layout() is not None and _matrix_at(_place_address(ob, place_layout())) == _columns(ob.matrix_world)


def _place_address(ob: Any, place: Any) -> int:
    pointer, offset = place
    start = ob.as_pointer()
    return (start if pointer is None else contract.address_at(start + pointer)) + offset


def _matrix_at(address: int) -> list[float]:
    return list((ctypes.c_float * 16).from_address(address))


def _columns(matrix: Matrix) -> list[float]:
    return [number for column in matrix.transposed() for number in column]


def matrices_of(ob: Any) -> bytes:
    """Returns what an original object's own channels, and how it hangs on its parent, say of its place."""
    return _bytes_of(ob.matrix_parent_inverse) + _bytes_of(ob.matrix_basis)


def world_of(ob: Any) -> bytes:
    """Returns an object's matrix to world space."""
    return _bytes_of(ob.matrix_world)


def state_of(ob: Any) -> bytes:
    """Returns what is equal at two times if matrices_of is."""
    first, size = _span()
    return ctypes.string_at(ob.as_pointer() + first, size)


def write(rows: Sequence[Row]) -> list[bytes]:
    """Computes places in Blender's steps, and writes them. Returns of each its matrix to world space and the inverse,
    as place_in returns them. Raises contract.Broken."""
    return sinew_native.host.write_places(
        _native_layout(),
        [
            (
                row.parent,
                row.matrices,
                [ob.as_pointer() for ob in row.objects],
                row.posed.as_pointer() if row.posed else 0,
            )
            for row in rows
        ],
    )


def place_in(ob: Any, size: int = 2 * MATRIX) -> bytes:
    """Returns an object's matrix to world space and its inverse, as many bytes as size."""
    return ctypes.string_at(_place_address(ob, place_layout()), size)


def set_channels(ob: Any, channels: Sequence[Channel], numbers: Sequence[float]) -> None:
    """Sets numbers of an object's place, original or evaluated."""
    start = ob.as_pointer()
    for channel, number in zip(channels, numbers):
        ctypes.c_float.from_address(start + _offset_of(*channel)).value = number


def channels_in(ob: Any, channels: Sequence[Channel]) -> tuple[float, ...]:
    """Returns numbers of an object's place."""
    start = ob.as_pointer()
    return tuple(ctypes.c_float.from_address(start + _offset_of(*channel)).value for channel in channels)


def prove(ob: Any, rows: Sequence[Row], channels: Sequence[Channel]) -> None:
    """Compares with an evaluated object what `write` would write into it, and with the API where its channels are.
    rows: the last one is that object's, and none of them writes. Raises contract.Broken."""
    if not proof.is_due(channels):
        return
    wanted = tuple(getattr(ob, path)[index] for path, index in channels)
    is_same = channels_in(ob, channels) == wanted
    found, known = np.frombuffer(write(rows)[-1], np.float32), np.frombuffer(place_in(ob), np.float32)
    count = 32 if known[16:].any() else 16  # without an inverse there are zeros
    is_same &= np.allclose(found[:count], known[:count], rtol=1e-5, atol=1e-6, equal_nan=True)
    is_same &= np.array_equal(known[:16], np.frombuffer(world_of(ob), np.float32), equal_nan=True)
    flags = ctypes.c_int16.from_address(ob.as_pointer() + contract.offset("Object", "transflag")).value
    is_same &= bool(flags & _MIRRORED) == ob.matrix_world.is_negative
    proof.give(channels, bool(is_same), "the places of objects are not where they were", features.MOVING)


@contract.kept
def _offset_of(path: str, index: int) -> int:
    for name, size in members.PLACE_CHANNELS[path].items():
        if 4 * index < size:
            return contract.offset("Object", name) + 4 * index
        index -= size // 4
    raise IndexError(path)


@contract.kept
def _span() -> tuple[int, int]:
    names = ["parentinv", "rotmode", *(name for own in members.PLACE_CHANNELS.values() for name in own)]
    first = min(contract.offset("Object", name) for name in names)
    return first, max(contract.offset("Object", name) + contract.size("Object", name) for name in names) - first


@contract.kept
def _native_layout() -> Any:
    place = place_layout()
    if place is None or place[0] is None:
        raise contract.distrust(features.MOVING, "objects hold their matrices themselves")
    return sinew_native.host.PlaceLayout(*place, contract.offset("Object", "transflag"), _MIRRORED)


def _bytes_of(matrix: Matrix) -> bytes:
    return np.array(matrix, np.float32).T.tobytes()
