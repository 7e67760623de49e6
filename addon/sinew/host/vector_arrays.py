"""Arrays of vectors: of attributes, and those that a Corrective Smooth was bound with."""

import ctypes
import functools

import numpy as np

from . import contract, proof


@functools.lru_cache(maxsize=64)
def _floats(count):
    return ctypes.c_float * count


def vectors_at(address, count):
    """(count, 3) float32 at that address, to be used at once and forgotten."""
    return np.frombuffer(_floats(3 * count).from_address(address), np.float32).reshape(count, 3)


def attribute_vectors(attribute, count):
    """(count, 3) float32: the numbers of a vector attribute themselves, or None if they cannot be had. Asking for
    their address makes Blender give the mesh numbers of its own, no longer shared with other copies, as any write
    through its API does; but it does not see what is written here."""
    data = attribute.data
    if count == 0 or len(data) != count:
        return None
    address = data[0].as_pointer()
    if data[count - 1].as_pointer() != address + 12 * (count - 1):
        return None
    found = vectors_at(address, count)
    if proof.is_due("attributes"):
        said = np.empty(3 * count, np.float32)
        data.foreach_get("vector", said)
        is_same = np.array_equal(found.reshape(-1), said, equal_nan=True)
        proof.give("attributes", is_same, "attributes are not where they were")
    return found


_SMOOTH = "CorrectiveSmoothModifierData"


def bound_count(modifier):
    """Of how many vertices a Corrective Smooth keeps the positions."""
    return ctypes.c_uint32.from_address(contract.region(modifier, _SMOOTH, "bind_coords_num")[0]).value


def bound_positions(modifier):
    """(N, 3) float32, a copy of these positions, which the API does not show; None if there are none."""
    address = contract.address_at(contract.region(modifier, _SMOOTH, "(*bind_coords)()")[0])
    return vectors_at(address, bound_count(modifier)).copy() if address else None
