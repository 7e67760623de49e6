"""Finds in memory the matrix from an object's space to world space."""

import ctypes
import functools
from typing import Any

from mathutils import Matrix

from . import contract, layout


@functools.lru_cache(maxsize=1)
def place_layout() -> tuple[int | None, int] | None:
    """Returns two byte offsets: of the pointer in an object that leads to its matrix to world space, or None if the
    object itself contains the matrix; and of the matrix, from the pointer's target or from the object. Returns None if
    the matrix cannot be found. The first call must come from the main thread."""
    if contract.trouble():
        return None
    name, offset = contract.place()
    if not name.startswith("*"):
        return None, offset
    # The pointer leads to a struct that Blender's description does not contain. The matrix should be its first member;
    # an object with a distinctive matrix shows whether it is.
    with layout.temporary_data() as data:
        probe = data.objects.new("", None)
        probe.matrix_world = Matrix.Translation((3, 5, 7)) @ Matrix.Diagonal((11, 13, 17, 1))
        place = offset, 0
        return place if _matrix_at(_place_address(probe, place)) == _columns(probe.matrix_world) else None


def _place_address(ob: Any, place: tuple[int | None, int]) -> int:
    pointer, offset = place
    start = ob.as_pointer()
    return (start if pointer is None else contract.address_at(start + pointer)) + offset


def _matrix_at(address: int) -> list[float]:
    return list((ctypes.c_float * 16).from_address(address))


def _columns(matrix: Matrix) -> list[float]:
    return [number for column in matrix.transposed() for number in column]


def place_address(ob: Any) -> int | None:
    """Returns the address of an evaluated object's matrix to world space, 16 float32, column by column; None if it
    cannot be found. The address is valid while the memory of `place_regions` is unchanged."""
    place = place_layout()
    address = place and _place_address(ob, place)
    return address if address and _matrix_at(address) == _columns(ob.matrix_world) else None


def place_regions(ob: Any) -> list[tuple[int, int]]:
    """Returns [(address, size)] of the memory that shows whether `place_address` is still valid: if Blender copies an
    object again, it allocates new memory for its matrix."""
    place = place_layout()
    return [] if place is None or place[0] is None else [(ob.as_pointer() + place[0], layout.POINTER)]
