"""Small things of Blender's as numbers: identities, matrices, custom properties."""

import bpy
import numpy as np

VERSION = bpy.app.version


def key_of(id_block):
    """A number that tells data-blocks of one session apart, the same for evaluated copies."""
    original = id_block.original
    return getattr(original, "session_uid", None) or original.as_pointer()


def matrix_to_numpy(matrix):
    return np.array(matrix, dtype=np.float64)


class Flat(ValueError):
    """An object's scale is 0 along an axis, so there is no way from its space into another."""


def is_flat(ob):
    return ob.matrix_world.determinant() == 0


def refuse_flat(*objects):
    """Raises Flat."""
    for each in objects:
        if is_flat(each):
            raise Flat(f"{each.name} has a scale of 0 along an axis; set another scale")


def relative_matrix(ob, armature):
    """(4, 4): from the armature's space to the object's. Raises Flat."""
    refuse_flat(ob, armature)
    return np.linalg.inv(matrix_to_numpy(ob.matrix_world)) @ matrix_to_numpy(armature.matrix_world)


def to_property(array):
    """A numpy array as what a custom property holds: flat numbers."""
    flat = np.ascontiguousarray(array).reshape(-1)
    if flat.dtype.kind == "i":
        flat = flat.astype(np.int32)
    return flat.tolist()


def from_property(values, dtype, shape):
    return np.array(values.to_list() if hasattr(values, "to_list") else values, dtype).reshape(shape)
