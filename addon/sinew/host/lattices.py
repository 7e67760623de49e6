"""Reads what Blender's API does not show of a lattice, or shows slowly."""

import ctypes
from typing import Any

import numpy as np

from . import contract, deform_verts, features, proof

_FIRST, _STEP = ("fu", "fv", "fw"), ("du", "dv", "dw")


def rest_grid(lattice: Any) -> tuple[list[float], list[float]]:
    """Returns where the points of a lattice at rest begin along u, v and w, and the distance between them."""
    first, step = (
        [ctypes.c_float.from_address(contract.region(lattice, "Lattice", name)[0]).value for name in names]
        for names in (_FIRST, _STEP)
    )
    if proof.is_due("lattices"):
        is_same = list(lattice.points[0].co) == first
        proof.give("lattices", is_same, "the points of a lattice at rest are not where they were", features.LATTICES)
    return first, step


def read_weights(lattice: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Returns the weights of the points of a lattice, as deform_verts.read does; None if it has none."""
    address = contract.address_at(contract.region(lattice, "Lattice", "*dvert")[0])
    return deform_verts.read(address, len(lattice.points)) if address else None


def group_names(lattice: Any) -> tuple[str, ...]:
    """Returns the names of the vertex groups of this copy of a lattice."""
    return deform_verts.group_names(lattice, "Lattice")
