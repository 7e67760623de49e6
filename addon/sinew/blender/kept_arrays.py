"""Saves arrays in the .blend, as custom properties of a text data-block with a hidden name. Blender's evaluation does
not copy or read texts, so large arrays cost no time on a frame or an edit."""

import bpy
import numpy as np

ARRAYS, MADE_OF = "sinew_arrays", "sinew_made_of"


def write(text: bpy.types.Text | None, name: str, made_of: str, arrays: dict[str, np.ndarray]) -> bpy.types.Text:
    """Writes arrays to a text and returns it. Makes a new text if there is none, or if it is linked or shared with a
    duplicate of the object. made_of: any string that identifies what the arrays were computed from."""
    if text is None or text.library is not None or len(bpy.data.user_map(subset={text})[text]) > 1:
        text = bpy.data.texts.new(f".sinew {name}")
    text[MADE_OF] = made_of
    text[ARRAYS] = {
        key: {"type": array.dtype.str, "shape": list(array.shape), "bytes": array.tobytes()}
        for key, array in ((key, np.ascontiguousarray(array)) for key, array in arrays.items())
    }
    return text


def made_of(text: bpy.types.Text | None) -> str:
    """Returns the `made_of` with which the arrays were written, or "" if there are none."""
    return text.get(MADE_OF, "") if text is not None else ""


def read(text: bpy.types.Text) -> dict[str, np.ndarray]:
    """Returns {name: array}. The arrays are read-only."""
    return {
        key: np.frombuffer(kept["bytes"], np.dtype(kept["type"])).reshape(tuple(kept["shape"]))
        for key, kept in text[ARRAYS].items()
    }


def remove(text: bpy.types.Text | None) -> None:
    """Removes the text, unless it has other users or is linked."""
    if text is not None and text.library is None and text.users <= 1:
        bpy.data.texts.remove(text)
