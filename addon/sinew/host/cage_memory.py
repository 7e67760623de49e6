"""Reads what Surface Deform and Mesh Deform modifiers were bound with, which Blender's API does not show, and what it
does not show of lattices, or shows slowly."""

import ctypes
from typing import Any, NamedTuple

import numpy as np

from ..native import sinew_native
from . import contract, deform_verts, features, proof

_SURFACE, _MESH = "SurfaceDeformModifierData", "MeshDeformModifierData"
_IS_BOUND = 1  # a bit of the flags; without it, Blender drops the binding at the next evaluation
_INFLUENCE = np.dtype([("vertex", np.int32), ("weight", np.float32)])  # MDefInfluence
_FIRST_POINT, _STEP = ("fu", "fv", "fw"), ("du", "dv", "dw")


class Counts(NamedTuple):
    """The numbers of vertices with which a modifier was bound."""

    mesh: int
    target: int


def _integer(modifier: Any, struct: str, name: str) -> int:
    return ctypes.c_int32.from_address(contract.region(modifier, struct, name)[0]).value


def _address(modifier: Any, struct: str, name: str) -> int:
    return contract.address_at(contract.region(modifier, struct, name)[0])


def _matrix(modifier: Any, struct: str, name: str) -> np.ndarray:
    """Returns a copy of a matrix, (4, 4) float32."""
    address = contract.region(modifier, struct, name)[0]
    return np.array((ctypes.c_float * 16).from_address(address), np.float32).reshape(4, 4).T.copy()


def _prove(feature: str, modifier: Any, address: int) -> bool:
    """Compares with the API whether a modifier is bound. address: of its binding, 0 for none. Returns whether there is
    one. Raises contract.Broken."""
    if proof.is_due(feature) and modifier.is_bound != bool(address):
        raise contract.distrust(feature, f"what {feature} was bound with is not where it was")
    if address:
        proof.give(feature)
    return address != 0


def surface_counts(modifier: Any) -> Counts | None:
    """Returns with how many vertices a Surface Deform modifier was bound; None if it is not bound, or no longer. The
    target's count is 0 if it was bound by Blender 2.93 or before."""
    has_binding = _prove(features.SURFACE, modifier, _address(modifier, _SURFACE, "*verts"))
    if not has_binding or not _integer(modifier, _SURFACE, "flags") & _IS_BOUND:
        return None
    return Counts(*(_integer(modifier, _SURFACE, name) for name in ("num_mesh_verts", "target_verts_num")))


def read_surface(modifier: Any) -> tuple[np.ndarray, ...]:
    """Returns what a Surface Deform modifier was bound with, as sinew_native.host.read_surface_binding does. The
    modifier must be bound."""
    count = _integer(modifier, _SURFACE, "numverts")
    return sinew_native.host.read_surface_binding(_address(modifier, _SURFACE, "*verts"), count)


def surface_matrix(modifier: Any) -> np.ndarray:
    """Returns the matrix from the target's space to the mesh's when the modifier was bound, (4, 4) float32."""
    return _matrix(modifier, _SURFACE, "mat")


def mesh_counts(modifier: Any) -> Counts | None:
    """Returns with how many vertices a Mesh Deform modifier was bound; None if it is not bound, or with Dynamic."""
    if not _prove(features.CAGE, modifier, _address(modifier, _MESH, "*bindcagecos")):
        return None
    if not _address(modifier, _MESH, "*bindoffsets"):
        return None
    return Counts(*(_integer(modifier, _MESH, name) for name in ("totvert", "totcagevert")))


def read_mesh(modifier: Any) -> tuple[np.ndarray, ...]:
    """Returns what a Mesh Deform modifier was bound with: offsets (V + 1,) and cage vertices (N,), int32; weights (N,)
    and the positions of the cage (C, 3), float32. The modifier must be bound, without Dynamic."""
    mesh, target = Counts(*(_integer(modifier, _MESH, name) for name in ("totvert", "totcagevert")))
    offsets = _copied(_address(modifier, _MESH, "*bindoffsets"), mesh + 1, np.int32)
    influences = _copied(_address(modifier, _MESH, "*bindinfluences"), int(offsets[-1]), _INFLUENCE)
    positions = _copied(_address(modifier, _MESH, "*bindcagecos"), 3 * target, np.float32)
    return offsets, influences["vertex"].copy(), influences["weight"].copy(), positions.reshape(-1, 3)


def _copied(address: int, count: int, dtype: Any) -> np.ndarray:
    """Returns a copy of the numbers at an address, (count,)."""
    if address == 0 or count <= 0:
        return np.empty(0, dtype)
    memory: Any = (ctypes.c_char * (count * np.dtype(dtype).itemsize)).from_address(address)
    return np.frombuffer(memory, dtype).copy()


def mesh_matrix(modifier: Any) -> np.ndarray:
    """Returns the matrix from the cage's space to that of its positions when the modifier was bound, (4, 4)
    float32."""
    return _matrix(modifier, _MESH, "bindmat")


def rest_grid(lattice: Any) -> tuple[list[float], list[float]]:
    """Returns where the points of a lattice at rest begin along u, v and w, and the distance between them."""
    first, step = (
        [ctypes.c_float.from_address(contract.region(lattice, "Lattice", name)[0]).value for name in names]
        for names in (_FIRST_POINT, _STEP)
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
