"""Edits of a mesh that shows its deformed shape in its own vertices (output Mesh), carried back to the rest
shape: else the next frame would write over them.

Where a vertex of the shape stands is an affine function of where it stands at rest, x' = A x + t, however the
joints' motions are blended. Four shapes of the same pose give A and t of every vertex.
"""

import numpy as np

from ..blender import meshes
from .mesh_output import REST_ATTRIBUTE

SMALLEST = 1e-6  # edit, as a share of the mesh's size: what rounding may do


def carry_back(ob, deformer, poses):
    """Moves the rest positions so that the vertices that somebody has moved stay where they are in this pose.
    deformer, poses: of the last frame. Vertices that came or went are Blender's to interpolate."""
    attribute = meshes.point_attribute(ob.data, REST_ATTRIBUTE)
    own = meshes.read_positions(ob.data)
    if attribute is None or len(own) != deformer.vertex_count:
        return
    if not ob.sinew.show_shape:
        meshes.write_attribute(ob.data, REST_ATTRIBUTE, own)
        return
    rest = meshes.read_attribute(attribute)

    def shape_of(rest):
        shape = np.empty_like(rest)
        deformer.deform(poses, shape, rest_positions=rest)
        return shape

    size = float(np.ptp(rest, axis=0).max(initial=0)) or 1.0
    shape = shape_of(rest)
    moved = np.abs(own - shape).max(axis=1) > SMALLEST * size
    if not moved.any():
        return
    columns = [(shape_of(rest + step) - shape)[moved] / size for step in size * np.eye(3, dtype=np.float32)]
    inverse = np.linalg.pinv(np.stack(columns, axis=2).astype(np.float64), rcond=1e-4)
    for _ in range(2):  # again for what rounding has left
        rest[moved] += np.einsum("vij,vj->vi", inverse, (own - shape)[moved]).astype(np.float32)
        shape = shape_of(rest)
    meshes.write_attribute(ob.data, REST_ATTRIBUTE, rest)
