"""Converts identities, matrices and custom properties of Blender to numbers."""

from typing import Any

import bpy
import numpy as np

VERSION = bpy.app.version


# Whether the key of a data-block stays the same when a step is undone: otherwise it is an address.
KEYS_OUTLIVE_UNDO = "session_uid" in bpy.types.ID.bl_rna.properties


def key_of(id_block: bpy.types.ID) -> int:
    """Returns a number that identifies a data-block within the session. Its evaluated copies have the same number."""
    original = id_block.original
    return getattr(original, "session_uid", None) or original.as_pointer()


def choice_name(owner: Any, name: str) -> str:
    """Returns what Blender's interface calls the present choice of a property, such as "Follow Path" for a type."""
    choice = owner.bl_rna.properties[name].enum_items.get(getattr(owner, name))
    return choice.name if choice is not None else str(getattr(owner, name))


def matrix_to_numpy(matrix: Any) -> np.ndarray:
    """Returns a matrix as float64."""
    return np.array(matrix, dtype=np.float64)


class Flat(ValueError):
    """An object's matrix cannot be inverted, because its scale is 0 along an axis, or is not finite."""


def is_flat(ob: bpy.types.Object) -> bool:
    """Whether the object's scale is 0 along an axis."""
    return ob.matrix_world.determinant() == 0


def refuse_flat(*objects: bpy.types.Object) -> None:
    """Raises Flat if the matrix of an object cannot be inverted."""
    for each in objects:
        if not np.isfinite(matrix_to_numpy(each.matrix_world)).all():
            raise Flat(f"{each.name} is at a place that is not a number")
        if is_flat(each):
            raise Flat(f"{each.name} has a scale of 0 along an axis; set another scale")


def relative_matrix(ob: bpy.types.Object, armature: bpy.types.Object) -> np.ndarray:
    """Returns the matrix (4, 4) from the armature's space to the object's. Raises Flat."""
    refuse_flat(ob, armature)
    return np.linalg.inv(matrix_to_numpy(ob.matrix_world)) @ matrix_to_numpy(armature.matrix_world)


def to_property(array: np.ndarray) -> list[float]:
    """Converts an array to a flat list of numbers, for a custom property."""
    flat = np.ascontiguousarray(array).reshape(-1)
    if flat.dtype.kind == "i":
        flat = flat.astype(np.int32)
    return flat.tolist()


def from_property(values: Any, dtype: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Converts a custom property with a list of numbers to an array."""
    return np.array(values.to_list() if hasattr(values, "to_list") else values, dtype).reshape(shape)


def is_alive(block: Any) -> bool:
    """Whether a data-block still exists."""
    try:
        return block is not None and bool(block.as_pointer())
    except ReferenceError:
        return False
