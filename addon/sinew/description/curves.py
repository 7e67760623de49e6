"""F-curves as numbers."""

from collections.abc import Iterable, Sequence
from typing import Any

import bpy
import numpy as np

from ..blender import animation, spoken_paths, values
from ..host import contract, features, keyframes
from . import tables

KEY_NUMBERS = (
    11  # left handle, point, right handle (frame and value each), amplitude, period, back, interpolation, easing
)
# Interpolations as Blender numbers them: up to LINEAR handles have no effect, up to BEZIER easings have none.
LINEAR, BEZIER = 1, 2
_SETTINGS = {
    "CYCLES": ("mode_before", "mode_after", "cycles_before", "cycles_after"),
    "GENERATOR": ("use_additive",),
    "FNGENERATOR": ("function_type", "use_additive", "amplitude", "phase_multiplier", "phase_offset", "value_offset"),
    "ENVELOPE": ("reference_value", "default_min", "default_max"),
    "LIMITS": (),
    "STEPPED": ("frame_step", "frame_offset"),
}  # of modifiers, by type
_CHANNELS = tuple(tables.CHANNELS)  # most curves set one of these


class Refused(ValueError):
    """What a description cannot say. The message is a reason for people."""


def rows_of(curves: Sequence[bpy.types.FCurve]) -> list[dict[str, Any]]:
    """Returns path, index, keys (K x 11, float32) and extrapolation of F-curves, in which complete adds what is not
    yet there."""
    if contract.has(features.PLAYING):
        return keyframes.read(curves).described()
    return [
        {"path": curve.data_path, "index": curve.array_index, "keys": keys_of(curve), "modifiers": None}
        | ({"is_extrapolated": True} if curve.extrapolation == "LINEAR" else {})
        for curve in curves
    ]


def animated(row: dict[str, Any], curve: bpy.types.FCurve) -> dict[str, Any]:
    """Returns a row of rows_of as that of an animated value. Raises Refused."""
    complete(row, curve)
    return row if row["path"].endswith(_CHANNELS) else row | rounding_of(curve)


def complete(row: dict[str, Any], curve: bpy.types.FCurve) -> dict[str, Any]:
    """Returns a row of rows_of with the modifiers. Raises Refused."""
    if "modifiers" in row:
        if not len(row["keys"]) and len(curve.sampled_points):
            raise Refused(
                f"the curve of {spoken_paths.spoken(curve.data_path)} holds samples instead of keys: convert it to keys"
            )
        if modifiers := modifiers_of(curve):
            row["modifiers"] = modifiers
        else:
            del row["modifiers"]
    return row


def rounding_of(curve: bpy.types.FCurve) -> dict[str, bool]:
    """Returns what a description says of the rounding of an F-curve of whole numbers, switches or choices."""
    return {"is_free": True} if contract.has(features.PLAYING) and not keyframes.is_rounded(curve) else {}


def keys_of(curve: bpy.types.FCurve) -> np.ndarray:
    """Returns the keys by Blender's API."""
    points = curve.keyframe_points
    count = len(points)
    keys = np.zeros((count, KEY_NUMBERS), np.float32)
    if not count:
        return keys
    pair, single, choice = np.empty(2 * count, np.float32), np.empty(count, np.float32), np.empty(count, np.int32)
    points.foreach_get("interpolation", choice)
    keys[:, 9] = choice
    highest = choice.max()
    for column, name in enumerate(("handle_left", "co", "handle_right")):
        if name == "co" or highest > LINEAR:
            points.foreach_get(name, pair)
            keys[:, 2 * column : 2 * column + 2] = pair.reshape(count, 2)
    if highest > BEZIER:
        points.foreach_get("easing", choice)
        keys[:, 10] = choice
        for column, name in enumerate(("amplitude", "period", "back"), 6):
            points.foreach_get(name, single)
            keys[:, column] = single
    return keys


def modifiers_of(curve: bpy.types.FCurve) -> list[dict[str, Any]]:
    """Returns those that have an effect: Cycles has none behind another one, be that muted. Raises Refused."""
    return [
        modifier_of(curve, each)
        for number, each in enumerate(curve.modifiers)
        if not each.mute and each.is_valid and not (each.type == "CYCLES" and number)
    ]


def modifier_of(curve: bpy.types.FCurve, modifier: bpy.types.FModifier) -> dict[str, Any]:
    def refused(why: str) -> Refused:
        what = spoken_paths.spoken(curve.data_path)
        where = f"the modifier {values.choice_name(modifier, 'type')} of the curve of {what}"
        return Refused(f"{where} {why}")

    if modifier.type not in _SETTINGS:
        raise refused("is not covered: bake it into keys")
    is_partial = modifier.use_restricted_range or modifier.use_influence
    if is_partial and modifier.type == "CYCLES" or modifier.use_restricted_range and modifier.type == "STEPPED":
        raise refused("has a frame range or an influence: remove it")
    row = {"type": modifier.type} | {name: getattr(modifier, name) for name in _SETTINGS[modifier.type]}
    if modifier.type == "GENERATOR":
        row["coefficients"] = list(modifier.coefficients)
        row["is_factorised"] = modifier.mode == "POLYNOMIAL_FACTORISED"
    elif modifier.type == "ENVELOPE":
        row["points"] = [[point.frame, point.min, point.max] for point in modifier.control_points]
    elif modifier.type == "LIMITS":
        limits = ("min_x", "max_x", "min_y", "max_y")
        row |= {name: getattr(modifier, name) for name in limits if getattr(modifier, f"use_{name}")}
    elif modifier.type == "STEPPED":
        row |= {"first_stepped": modifier.frame_start} if modifier.use_frame_start else {}
        row |= {"last_stepped": modifier.frame_end} if modifier.use_frame_end else {}
    if modifier.use_influence:
        row["influence"] = modifier.influence
    if modifier.use_restricted_range:
        row["range"] = [modifier.frame_start, modifier.frame_end]
        row |= {name: getattr(modifier, name) for name in ("blend_in", "blend_out")}
    return row


def curves_in_effect(block: bpy.types.ID) -> list[bpy.types.FCurve]:
    """Returns the curves of the data-block's action that Blender evaluates. Raises Refused for several layers, and for
    the NLA."""
    data = block.animation_data
    if data is None:
        return []
    if animation.plays_strips(data):
        raise Refused(f"{block.name} is animated by NLA strips: bake them into one action")
    if data.action is None:
        return []
    return that_set_anything(block, of_slot(data.action, getattr(data, "action_slot_handle", 0)))


def that_set_anything(block: bpy.types.ID, own: Iterable[bpy.types.FCurve]) -> list[bpy.types.FCurve]:
    """Returns the curves for which a data-block has what they set."""
    counts: dict[str, float] = {}  # by path, which several curves have
    found = []
    for curve in own:
        path = curve.data_path
        if path not in counts:
            counts[path] = animation.count_at(block, path)
        if curve.array_index < counts[path]:
            found.append(curve)
    return found


def of_slot(action: bpy.types.Action, handle: int | None) -> list[bpy.types.FCurve]:
    """Returns the curves of a slot that are not muted. Raises Refused for several layers."""
    if not hasattr(action, "layers"):  # before 4.4
        return unmuted(action.fcurves)
    strips = [strip for layer in action.layers for strip in layer.strips]
    if len(action.layers) > 1 or len(strips) > 1:
        raise Refused(f"the action {action.name} has several layers: merge them")
    bags = [bag for strip in strips for bag in strip.channelbags if bag.slot_handle == handle]
    return [curve for bag in bags for curve in unmuted(bag.fcurves)]


def unmuted(curves: Iterable[bpy.types.FCurve]) -> list[bpy.types.FCurve]:
    found = [
        curve
        for curve in curves
        if not curve.mute and curve.is_valid and (not curve.is_empty or len(curve.sampled_points))
    ]
    return [each for each in found if each.group is None or not each.group.mute] if animation.GROUPS_MUTE else found
