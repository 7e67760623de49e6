"""Properties of other data-blocks that drivers read, as rows: what keyframes of a data-block's own action set of it. It
does not matter of which type it is."""

import re
from collections.abc import Iterable
from typing import Any, NamedTuple

import bpy

from ..blender import animation, spoken_paths
from . import curves, custom_properties, objects, rna_paths

_START = 'blocks["'  # of paths in a description, of all but objects
_COLOUR = re.compile(r"\.([rgba])$")
_TIMES = re.compile(r"frame_(current|current_final|float|subframe)$")  # of a scene
_LAST = re.compile(r"(?:\[\d+\]|\.[xyzw])$")  # an element of an array
_TYPES = "FLOAT", "INT", "BOOLEAN"


class Property(NamedTuple):
    """A property of a data-block, and the path to it from there."""

    block: bpy.types.ID
    path: str


def owned(block: bpy.types.ID, path: str) -> Property:
    """Returns the property that a path leads to from a data-block: `data.lens` of an object is one of its camera."""
    path = _COLOUR.sub(lambda match: f"[{'rgba'.index(match[1])}]", rna_paths.normalised(path))
    for place in sorted((i for i, character in enumerate(path) if character in ".["), reverse=True):
        try:
            holder = block.path_resolve(path[:place]) if place else block
            if isinstance(holder, bpy.types.bpy_struct):
                start = "" if isinstance(holder, bpy.types.ID) else holder.path_from_id()
                return Property(holder.id_data, start + path[place:] if start else path[place:].lstrip("."))
        except ValueError:  # no place in the path, but in a name
            continue
    return Property(block, path)


def is_of_other(path: str) -> bool:
    """Whether a path in a description is of another data-block."""
    return path.startswith((objects.START, _START))


def path_of(block: bpy.types.ID, path: str) -> str:
    """Returns where a description has a property of another data-block."""
    return _start_of(block) + ("" if path.startswith("[") else ".") + path


def _start_of(block: bpy.types.ID) -> str:
    if isinstance(block, bpy.types.Object):
        return objects.start_of(block)
    name = repr(block) if block.is_embedded_data else block.name_full
    return f'{_START}{bpy.utils.escape_identifier(f"{block.id_type}/{name}")}"]'


class Animated(NamedTuple):
    """What keyframes set of another data-block, if nothing else sets it: what is known of it on each frame."""

    place: bool  # the channels of an object
    properties: frozenset[str]  # paths of others

    @classmethod
    def of(cls, block: bpy.types.ID) -> "Animated":
        is_object = isinstance(block, bpy.types.Object)
        if is_object and (block.type == "ARMATURE" or objects.why_not(block)):
            return cls(False, frozenset())
        return cls(is_object and objects.may_move(block), frozenset(_rows_by_path(block)))

    def whole(self, path: str) -> str:
        """Returns which of the properties has this path, or an element with it; "" if none does."""
        return next((each for each in (path, _LAST.sub("", path)) if each in self.properties), "")


def properties_of(own: Iterable[Property]) -> list[tuple[dict[str, Any], list[dict[str, Any]]]]:
    """Returns the rows of properties that keyframes set, with those of their curves."""
    found, paths = [], dict[bpy.types.ID, set[str]]()
    for each in own:
        paths.setdefault(each.block, set()).add(each.path)
    for block, wanted in paths.items():
        effective = [each for each in curves.curves_in_effect(block) if _path_of(each) in wanted]
        by_path: dict[str, list[dict[str, Any]]] = {}
        for curve, row in zip(effective, curves.rows_of(effective)):
            row["path"] = path_of(block, _path_of(curve))
            by_path.setdefault(row["path"], []).append(curves.animated(row, curve))
        found += [(row, by_path[row["path"]]) for row in _rows_by_path(block).values() if row["path"] in by_path]
    return found


def why_unknown(block: bpy.types.ID, path: str) -> str:
    """Returns why it is not known what a property of a data-block, no object, is on each frame, as a clause that begins
    with its name; "" if it is computed, or only edits change it."""
    name = f"{spoken_paths.spoken(path)} of {block.name}"
    own, data = {path, _LAST.sub("", path)}, getattr(block, "animation_data", None)
    if isinstance(block, bpy.types.Scene) and _TIMES.match(path):
        return f"{name}, which is the time: use the word frame in the expression"
    if isinstance(block, bpy.types.NodeTree):
        return f"{name}, after an edit of which Blender evaluates no bones: let it read a custom property"
    if data is None:
        return ""
    driven = {_path_of(each) for each in data.drivers}
    if not driven.isdisjoint(own):
        return f"{name}, which has a driver: bake it into keyframes"
    try:
        keyed = {_path_of(each) for each in curves.curves_in_effect(block)}
    except curves.Refused as reason:
        return f"{name}, and {reason}"
    if not keyed.isdisjoint(own):
        return "" if Animated.of(block).whole(path) else f"{name}, whose keyframes are not covered: remove them"
    if (keyed or driven) and not path.startswith("[") and not _is_stored(block, path):
        return f"{name}, which follows from others: let it read what can be keyed"
    return ""


def _path_of(curve: bpy.types.FCurve) -> str:
    return rna_paths.normalised(curve.data_path)


def _holder_of(block: bpy.types.ID, path: str) -> tuple[Any, str]:
    """Returns what has a property, and its name."""
    holder, _separator, name = path.rpartition(".")
    return block.path_resolve(holder) if holder else block, name


def _is_stored(block: bpy.types.ID, path: str) -> bool:
    holder, name = _holder_of(block, _LAST.sub("", path))
    setting = holder.bl_rna.properties.get(name)
    return setting is not None and setting.is_animatable


def _rows_by_path(block: bpy.types.ID) -> dict[str, dict[str, Any]]:
    """Returns the rows of the properties that keyframes, and no drivers, set, but not those of an object's place."""
    if getattr(block, "animation_data", None) is None:
        return {}
    try:
        keyed = dict.fromkeys(map(_path_of, curves.curves_in_effect(block)))
    except curves.Refused:
        return {}
    driven = {_path_of(each) for each in animation.drivers_of(block)}
    custom = {row["path"]: row for row in custom_properties.of_holder(block, "")}
    found = {}
    for path in keyed:
        is_place = isinstance(block, bpy.types.Object) and rna_paths.moves_object(path)
        row = None if is_place or path in driven else custom.get(path) or _row_of(block, path)
        if row is not None:
            found[path] = row | {"path": path_of(block, path)}
    return found


def _row_of(block: bpy.types.ID, path: str) -> dict[str, Any] | None:
    """Returns the row of a property that is no custom one, or None if it is no number."""
    if path.endswith("]"):
        return None
    holder, name = _holder_of(block, path)
    setting = holder.bl_rna.properties[name]
    if setting.type not in _TYPES:
        return None
    value = getattr(holder, name)
    limits = (getattr(setting, "hard_min", 0), getattr(setting, "hard_max", 1))
    if isinstance(holder, bpy.types.ShapeKey) and name == "value":
        limits = holder.slider_min, holder.slider_max
    return {
        "type": setting.type,
        "min": max(float(limits[0]), -custom_properties.UNLIMITED),
        "max": min(float(limits[1]), custom_properties.UNLIMITED),
        "value": [float(each) for each in (value if setting.is_array else [value])],
    }
