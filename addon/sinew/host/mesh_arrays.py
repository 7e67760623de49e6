"""Reads arrays of numbers: what connects a mesh's vertices, attributes, and the bind coordinates of Corrective Smooth
modifiers."""

import ctypes
import functools
from typing import Any

import numpy as np

from . import contract, features, proof

_BYTES = 4  # of a number
_SMOOTH = "CorrectiveSmoothModifierData"


def read_connections(items: Any, member: str, width: int = 1) -> np.ndarray:
    """Returns a copy of a member with which each item begins, (N, width) int32.

    items: a mesh's edges, loops or polygons; member: "vertices", "vertex_index" or "loop_start". Blender's API looks up
    each item by itself, which takes a hundred times as long. It is asked only until it has once said the same, and
    where the numbers are not in a row."""
    count = len(items)
    found = _in_a_row(items, count, width)
    if found is not None and not proof.is_due(member):
        return found
    said = np.empty(count * width, np.int32)
    items.foreach_get(member, said)
    said = said.reshape(count, width)
    if found is not None and np.array_equal(found, said):
        proof.give(member)
    return said


def _in_a_row(items: Any, count: int, width: int) -> np.ndarray | None:
    if count < 2 or contract.is_forbidden():
        return None
    address = items[0].as_pointer()
    size = items[1].as_pointer() - address
    if size < _BYTES * width or size % _BYTES or items[count - 1].as_pointer() != address + size * (count - 1):
        return None
    numbers = np.frombuffer((ctypes.c_char * (size * count)).from_address(address), np.int32)
    return numbers.reshape(count, size // _BYTES)[:, :width].copy()


@functools.lru_cache(maxsize=64)
def _floats(count: int) -> Any:
    return ctypes.c_float * count


def vectors_at(address: int, count: int) -> np.ndarray:
    """Returns a view of the vectors at an address, (count, 3) float32. Use it at once and do not keep it."""
    return np.frombuffer(_floats(3 * count).from_address(address), np.float32).reshape(count, 3)


def attribute_vectors(attribute: Any, count: int) -> np.ndarray | None:
    """Returns a view of the values of a vector attribute, (count, 3) float32, or None if it has another number of
    values or they cannot be found.

    Getting their address makes Blender give the mesh its own values, no longer shared with other copies, as any write
    through its API does. But Blender does not notice what is written into the view."""
    data = attribute.data
    if count == 0 or len(data) != count or not contract.has(features.ATTRIBUTES):
        return None
    address = data[0].as_pointer()
    if data[count - 1].as_pointer() != address + 12 * (count - 1):
        return None
    found = vectors_at(address, count)
    if proof.is_due("attributes"):
        said = np.empty(3 * count, np.float32)
        data.foreach_get("vector", said)
        if not np.array_equal(found.reshape(-1), said, equal_nan=True):
            contract.distrust(features.ATTRIBUTES, "attributes are not where they were")
            return None
        proof.give("attributes")
    return found


def bound_count(modifier: Any) -> int:
    """Returns the number of vertices whose positions a Corrective Smooth modifier was bound with."""
    return ctypes.c_uint32.from_address(contract.region(modifier, _SMOOTH, "bind_coords_num")[0]).value


def bound_positions(modifier: Any) -> np.ndarray | None:
    """Returns a copy of the positions that a Corrective Smooth modifier was bound with, (N, 3) float32; None if there
    are none. The API does not show them."""
    address = contract.address_at(contract.region(modifier, _SMOOTH, "(*bind_coords)()")[0])
    if proof.is_due("bound positions"):
        is_same = modifier.is_bind == bool(address)
        proof.give("bound positions", is_same, "bound positions are not where they were", features.BOUND)
    return vectors_at(address, bound_count(modifier)).copy() if address else None
