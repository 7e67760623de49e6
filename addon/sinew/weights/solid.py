"""Several mesh objects as one mesh in world space, and which of its vertices are rigid when weights are made."""

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ..blender import bounds, meshes, values
from . import checks
from .entries import Entries


@dataclass(frozen=True)
class Solid:
    """The meshes of some objects, one after the other, in world space."""

    positions: np.ndarray  # (V, 3) float64
    face_offsets: np.ndarray  # (faces + 1,) int32
    face_vertices: np.ndarray  # (C,) int32
    starts: np.ndarray  # (objects + 1,): the first vertex of each object

    def triangles(self) -> np.ndarray:
        """Returns the faces as fans of triangles, (T, 3)."""
        sizes = np.diff(self.face_offsets)
        first = np.repeat(self.face_offsets[:-1], sizes - 2)
        place = np.arange(len(first)) - np.repeat(np.cumsum(sizes - 2) - (sizes - 2), sizes - 2)
        return np.stack([self.face_vertices[at] for at in (first, first + place + 1, first + place + 2)], axis=1)

    def edges(self) -> np.ndarray:
        """Returns the sides of the faces, (C, 2); those of two faces twice."""
        following = np.arange(1, len(self.face_vertices) + 1)
        following[self.face_offsets[1:] - 1] = self.face_offsets[:-1]
        return np.stack((self.face_vertices, self.face_vertices[following]), axis=1)


def rest_positions(mesh: bpy.types.Mesh) -> np.ndarray:
    """Returns the positions of the mesh at rest, (V, 3) float32: of the reference shape key, if there is one."""
    if mesh.shape_keys is None:
        return meshes.read_positions(mesh)
    positions = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.shape_keys.reference_key.data.foreach_get("co", positions)
    return positions.reshape(-1, 3)


def world_positions(ob: bpy.types.Object) -> np.ndarray:
    """Returns the positions of a mesh object at rest in world space, (V, 3) float64."""
    matrix = values.matrix_to_numpy(ob.matrix_world)
    return rest_positions(ob.data) @ matrix[:3, :3].T + matrix[:3, 3]


def refuse_infinite(ob: bpy.types.Object, positions: np.ndarray) -> None:
    """Raises ValueError if one of the positions (V, 3) of an object's vertices is not finite."""
    is_finite = np.isfinite(positions).all(axis=1)
    if not is_finite.all():
        raise ValueError(
            f"Vertex {np.flatnonzero(~is_finite)[0]} of {ob.name} is not at a finite position (NaN or infinite): "
            "delete it or move it"
        )


def collect(objects: Sequence[bpy.types.Object]) -> Solid:
    """Returns the Solid of mesh objects, none of which is in Edit Mode. Raises ValueError if a position is not
    finite."""
    positions, offsets, corners, starts = [], [np.zeros(1, np.int32)], [], [0]
    corner_count = 0
    for ob in objects:
        own = world_positions(ob)
        refuse_infinite(ob, own)
        _edges, own_offsets, own_corners = meshes.read_topology(ob.data)
        if ob.matrix_world.determinant() < 0:  # mirrored: the other side of each face is outside
            own_corners = own_corners[_reversed_corners(own_offsets)]
        corners.append(own_corners + starts[-1])
        offsets.append(own_offsets[1:] + corner_count)
        positions.append(own)
        starts.append(starts[-1] + len(own))
        corner_count += len(own_corners)
    return Solid(
        np.concatenate(positions) if positions else np.empty((0, 3)),
        np.concatenate(offsets).astype(np.int32),
        np.concatenate(corners).astype(np.int32) if corners else np.empty(0, np.int32),
        np.array(starts),
    )


def _reversed_corners(offsets: np.ndarray) -> np.ndarray:
    """Returns (C,): the corners of each face in the opposite order."""
    sizes = np.diff(offsets)
    first, last = np.repeat(offsets[:-1], sizes), np.repeat(offsets[1:] - 1, sizes)
    return first + last - np.arange(offsets[-1])


def rigid_members(ob: bpy.types.Object, weights: Entries, name: str) -> np.ndarray:
    """Returns (V,) bool: the vertices with weight in the vertex group of a name. weights: all of the object's, with
    groups in place of bones."""
    found = np.zeros(len(ob.data.vertices), bool)
    group = ob.vertex_groups.get(name) if name else None
    if group is not None:
        found[weights.vertices[(weights.bones == group.index) & (weights.weights > 0)]] = True
    return found


def rigid_pieces(marked: np.ndarray, positions: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Returns (V,) int32: the same number for the marked vertices (V,) bool that edges (E, 2) between them connect, or
    that are at the same place; -1 for all others."""
    size = bounds.diagonal(positions)
    weld = checks.welded(positions, size)
    marked = marked & np.isin(weld, weld[marked])
    inside = edges[marked[edges].all(axis=1)]
    label = checks.islands(len(marked), weld[inside])[weld]
    return np.where(marked, label, -1).astype(np.int32)
