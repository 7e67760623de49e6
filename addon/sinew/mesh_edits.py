"""Edits of a mesh that shows its deformed shape in its own vertices (output Mesh), carried back to the rest
shape: else the next frame would write over them.

Where a vertex of the shape stands is an affine function of where it stands at rest, x' = A x + t, however the
joints' motions are blended. Four shapes of the same pose give A and t of every vertex.
"""

import numpy as np

from . import blender_io, layers
from .native import sinew_native
from .outputs import REST_ATTRIBUTE

SMALLEST = 1e-6  # edit, as a share of the mesh's size: what rounding may do


def shape_of(parts, rest):
    """(V, 3) float32: that rest shape in the pose of the last frame; parts as `layers` has them."""
    shape = np.empty_like(rest)
    for layer, _method, _change in parts:
        layer.deformer.set_rest(rest)
    sinew_native.skin_all(layers.jobs_of(parts, shape))
    layers.finish(parts, shape)
    return shape


def carry_back(ob, parts):
    """Moves the rest positions so that the vertices that somebody has moved stay where they are in this pose.
    parts: of the last frame. Vertices that came or went are Blender's to
    interpolate. Leaves the layers' deformers with the new rest shape."""
    attribute = blender_io.point_attribute(ob.data, REST_ATTRIBUTE)
    own = blender_io.read_positions(ob.data)
    if attribute is None or any(len(own) != layer.deformer.skin.vertex_count for layer, _, _ in parts):
        return
    if not ob.sinew.shows_shape():
        blender_io.write_attribute(ob.data, REST_ATTRIBUTE, own)
        return
    rest = blender_io.read_attribute(attribute)
    size = float(np.ptp(rest, axis=0).max(initial=0)) or 1.0
    shape = shape_of(parts, rest)
    moved = np.abs(own - shape).max(axis=1) > SMALLEST * size
    if not moved.any():
        return
    columns = [(shape_of(parts, rest + step) - shape)[moved] / size
               for step in size * np.eye(3, dtype=np.float32)]
    inverse = np.linalg.pinv(np.stack(columns, axis=2).astype(np.float64), rcond=1e-4)
    for _ in range(2):  # again for what rounding has left
        rest[moved] += np.einsum("vij,vj->vi", inverse, (own - shape)[moved])
        shape = shape_of(parts, rest)
    blender_io.write_attribute(ob.data, REST_ATTRIBUTE, rest)
