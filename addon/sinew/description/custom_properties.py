"""Custom properties that are numbers."""

import itertools
from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np

TYPES = {float: "FLOAT", int: "INT", bool: "BOOLEAN"}
UNLIMITED = 3.4e38


def path_of(owner: str, name: str) -> str:
    """Returns the path of a custom property. owner: that of what has it, "" for the object."""
    return f'{owner}["{bpy.utils.escape_identifier(name)}"]'


def owner_and_name(path: str) -> tuple[str, str]:
    """Returns what path_of was given."""
    owner, name = path[:-2].rsplit('["', 1)
    return owner, bpy.utils.unescape_identifier(name)


def properties_of(ob: bpy.types.Object, row: np.ndarray, stored: Any) -> Iterator[dict[str, Any]]:
    """Yields those of the object, of its data, and of all bones of either. row, stored: as bones.values_of is given
    them, of the original."""
    yield from of_holder(ob, "")
    yield from of_holder(ob.data, "data.")
    may_have = [True] * len(row) if stored is None else stored[0].have_properties() | stored[1].have_properties()[row]
    for bone in itertools.compress(ob.pose.bones, may_have):
        for holder, start in ((bone, "pose"), (bone.bone, "data")):
            if holder.keys():
                yield from of_holder(holder, f'{start}.bones["{bpy.utils.escape_identifier(bone.name)}"]')


def of_holder(holder: Any, start: str) -> Iterator[dict[str, Any]]:
    for name, value in holder.items():
        if isinstance(value, int | float):
            values = [value]
        elif isinstance(value, str) or not hasattr(value, "typecode"):
            continue
        else:
            values = list(value)
        if not values:
            continue
        settings = holder.id_properties_ui(name).as_dict()
        low, high = settings.get("min", -UNLIMITED), settings.get("max", UNLIMITED)
        yield {
            "path": path_of(start, name),
            "type": TYPES[type(values[0])],
            "min": max(float(low), -UNLIMITED),
            "max": min(float(high), UNLIMITED),
            "value": [float(number) for number in values],
        }
