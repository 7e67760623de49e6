"""Finds in memory the matrix from an object's space to world space."""

import ctypes
from typing import Any

from mathutils import Matrix

from . import contract, features, layout


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
