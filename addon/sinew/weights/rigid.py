"""Which vertices are rigid when weights are made: those of a vertex group, or chosen ones."""

import bpy
import numpy as np

from ..blender import bounds
from . import checks
from .entries import Entries


def members(ob: bpy.types.Object, weights: Entries, name: str) -> np.ndarray:
    """Returns (V,) bool: the vertices with weight in the vertex group of a name. weights: all of the object's, with
    groups in place of bones."""
    found = np.zeros(len(ob.data.vertices), bool)
    group = ob.vertex_groups.get(name) if name else None
    if group is not None:
        found[weights.vertices[(weights.bones == group.index) & (weights.weights > 0)]] = True
    return found


def pieces(marked: np.ndarray, positions: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Returns (V,) int32: the same number for the marked vertices (V,) bool that edges (E, 2) between them connect, or
    that are at the same place; -1 for all others."""
    size = bounds.diagonal(positions)
    weld = checks.welded(positions, size)
    marked = marked & np.isin(weld, weld[marked])
    inside = edges[marked[edges].all(axis=1)]
    label = checks.islands(len(marked), weld[inside])[weld]
    return np.where(marked, label, -1).astype(np.int32)
