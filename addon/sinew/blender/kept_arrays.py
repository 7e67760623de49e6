"""Arrays that are kept in the .blend: in custom properties of a text with a hidden name. Blender's evaluation neither
copies nor looks at texts, so large ones cost nothing on a frame or an edit."""

import bpy
import numpy as np

ARRAYS, MADE_OF = "sinew_arrays", "sinew_made_of"


def write(text, name, made_of, arrays):
    """Returns the text, a new one for None and for one that a duplicate of its object has too. made_of: any string,
    which tells these arrays from others; arrays: {name: array}."""
    if text is None or text.library is not None or len(bpy.data.user_map(subset={text})[text]) > 1:
        text = bpy.data.texts.new(f".sinew {name}")
    text[MADE_OF] = made_of
    text[ARRAYS] = {
        key: {"type": array.dtype.str, "shape": list(array.shape), "bytes": array.tobytes()}
        for key, array in ((key, np.ascontiguousarray(array)) for key, array in arrays.items())
    }
    return text


def made_of(text):
    """What was said when they were written, or "" if there are none."""
    return text.get(MADE_OF, "") if text is not None else ""


def read(text):
    """{name: array}, read-only."""
    return {
        key: np.frombuffer(kept["bytes"], np.dtype(kept["type"])).reshape(tuple(kept["shape"]))
        for key, kept in text[ARRAYS].items()
    }


def remove(text):
    """Unless somebody else has it."""
    if text is not None and text.library is None and text.users <= 1:
        bpy.data.texts.remove(text)
