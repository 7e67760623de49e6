"""Reads and writes all vertex groups and weights of a mesh at once."""

import ctypes
from typing import Any

import numpy as np

from ..native import sinew_native
from . import contract, features

_DEFORM_VERTICES = 2  # CD_MDEFORMVERT, Blender's number for weights in CustomDataLayer.type
_MOST_GROUPS = 1 << 20
_SOME = 64  # about how many vertices are checked


def group_names(data: Any, struct: str = "Mesh") -> tuple[str, ...]:
    """Returns the names of the vertex groups of this copy of a mesh or lattice. struct: "Mesh" or "Lattice"."""
    first = contract.address_at(contract.region(data, struct, "vertex_group_names")[0])
    offset, size = contract.offset("bDeformGroup", "name"), contract.size("bDeformGroup", "name")
    addresses = sinew_native.host.list_addresses(first, _MOST_GROUPS).tolist()
    return tuple(ctypes.string_at(address + offset, size).partition(b"\0")[0].decode() for address in addresses)


def deform_vertices(mesh: Any) -> int | None:
    """Returns the address of the mesh's array of weights; 0 if it has none, None if it cannot be found."""
    if not contract.has(features.WEIGHTS):
        return None
    vertex_data = contract.region(mesh, "Mesh", "vdata")[0]
    layers = contract.address_at(vertex_data + contract.offset("CustomData", "*layers"))
    count = ctypes.c_int32.from_address(vertex_data + contract.offset("CustomData", "totlayer")).value
    for number in range(count):
        at = layers + number * contract.struct_size("CustomDataLayer")
        if ctypes.c_int32.from_address(at + contract.offset("CustomDataLayer", "type")).value == _DEFORM_VERTICES:
            address = contract.address_at(at + contract.offset("CustomDataLayer", "*data"))
            return address if _is_where_the_api_says(mesh, address) else _distrusted()
    return _distrusted() if _lacks_what_the_api_says(mesh) else 0


def _distrusted() -> int | None:
    contract.distrust(features.WEIGHTS, "weights are not where they were")
    return None


def read(address: int, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Reads the array of weights at an address. Returns offsets (V + 1,) int64, groups (N,) int32, weights (N,)
    float32. count: V."""
    return sinew_native.host.read_weights(address, count)


def can_write(mesh: Any) -> bool:
    """Whether `write` can find the mesh's weights. The first call must come from the main thread."""
    return not mesh.is_editmode and deform_vertices(mesh) is not None


def write(mesh: Any, offsets: np.ndarray, groups: np.ndarray, weights: np.ndarray) -> bool:
    """Replaces the weights of all vertices of an original mesh, each of which keeps its number of entries. offsets
    (V + 1,) int64, groups (N,) int32 and weights (N,) float32: as `read` returns them.

    Returns False if they could not be written: they were not found, or a vertex has a different number of entries, and
    nothing was changed; or what the API then shows is not what was written, and the mesh's weights are lost."""
    filled = np.flatnonzero(np.diff(offsets))
    if not can_write(mesh):
        return False
    if not len(filled):
        address = deform_vertices(mesh)
        return not address or len(read(address, len(offsets) - 1)[1]) == 0
    # First through the API, so that later versions give the mesh its own weights, not shared with copies or undo steps.
    said = mesh.vertices[filled[0]].groups
    first = said[0].as_pointer() if len(said) else 0
    address = deform_vertices(mesh)
    if not first or not address or _first_entry(address, filled[0]) != first:
        return False
    try:
        sinew_native.host.write_weights(address, offsets, groups, weights)
    except ValueError:
        return False
    return all(
        [(entry.group, entry.weight) for entry in mesh.vertices[v].groups]
        == list(zip(groups[offsets[v] : offsets[v + 1]].tolist(), weights[offsets[v] : offsets[v + 1]].tolist()))
        for v in {filled[0], filled[len(filled) // 2], filled[-1]}
    )


def _first_entry(address: int, vertex: int) -> int:
    """Returns the address of a vertex's first entry. address: of the mesh's array of weights."""
    at = address + contract.struct_size("MDeformVert") * int(vertex)
    return contract.address_at(at + contract.offset("MDeformVert", "*dw"))


_weights_are_known = False  # whether their address was confirmed


def _is_where_the_api_says(mesh: Any, address: int) -> bool:
    """Whether the weights of a few vertices at that address match the API. Checked only until some weights have been
    compared, because reading them through the API makes later versions copy the weights of the whole mesh."""
    global _weights_are_known
    if _weights_are_known:
        return True
    count = len(mesh.vertices)
    compared = 0
    for index in {0, count // 2, count - 1} if count else ():
        _offsets, groups, weights = read(address + contract.struct_size("MDeformVert") * index, 1)
        said = [(entry.group, entry.weight) for entry in mesh.vertices[index].groups]
        if said != list(zip(groups.tolist(), weights.tolist())):
            return False
        compared += len(said)
    _weights_are_known = compared > 0
    return True


def _lacks_what_the_api_says(mesh: Any) -> bool:
    """Whether the API shows weights of a mesh in which none were found: then Blender stores them elsewhere."""
    count = len(mesh.vertices)
    some = range(0, count, max(1, count // _SOME))
    return not _weights_are_known and any(len(mesh.vertices[index].groups) for index in some)
