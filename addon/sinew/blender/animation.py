"""Finds, adds and removes drivers and keyframes."""

import math
from collections.abc import Iterable
from typing import Any

import bpy
import numpy as np

from ..host import keyframes

PLACE = "location", "rotation_euler", "rotation_quaternion", "rotation_axis_angle", "scale"  # of an object
_ONES = {*(("scale", i) for i in range(3)), ("rotation_quaternion", 0)}  # what an object has that is not moved
GROUPS_MUTE = bpy.app.version < (4, 4, 0)  # later versions evaluate the curves of muted groups


def animated_properties(ob: bpy.types.Object, modifier: bpy.types.Modifier) -> list[str]:
    """Returns the sorted names of the modifier's properties that drivers or keyframes of the object animate."""
    start = f'modifiers["{bpy.utils.escape_identifier(modifier.name)}"].'
    return sorted(path.removeprefix(start) for path in animated_paths(ob) if path.startswith(start))


def animated_paths(block: bpy.types.ID) -> set[str]:
    """Returns the paths of all properties of a data-block that drivers or keyframes animate."""
    return {curve.data_path for curve in (*drivers_of(block), *keyed_curves(block))}


def drivers_of(block: bpy.types.ID) -> list[bpy.types.FCurve]:
    """Returns the drivers of a data-block."""
    data = block.animation_data
    return list(data.drivers) if data is not None else []


def keyed_curves(block: bpy.types.ID) -> list[bpy.types.FCurve]:
    """Returns the F-curves by which a data-block's action and its NLA strips animate it."""
    found: dict[int, bpy.types.FCurve] = {}
    for played in keyframes.actions_of(block):
        found.update((curve.as_pointer(), curve) for curve in curves_in(played.action, played.slot))
    return list(found.values())


def first_animated(block: bpy.types.ID, paths: Iterable[str]) -> str | None:
    """Returns the first of these paths, of properties that are no arrays, that a driver or a keyframe of a data-block
    sets, or None."""
    data = block.animation_data
    if data is None:
        return None
    curves = [data.drivers, *(each for played in keyframes.actions_of(block) for each in _collections_in(*played[:2]))]
    return next((path for path in paths if any(each.find(path) is not None for each in curves)), None)


def curves_in(action: bpy.types.Action, slot: Any) -> list[bpy.types.FCurve]:
    """Returns the F-curves of an action's slot. slot: as below."""
    return [curve for curves in _collections_in(action, slot) for curve in curves]


def _collections_in(action: bpy.types.Action, slot: Any) -> list[Any]:
    """Returns the collections of F-curves of an action's slot. slot: the slot, its number, or None for none."""
    if not hasattr(action, "layers"):  # before 4.4
        return [action.fcurves]
    number = getattr(slot, "handle", slot)
    return [
        bag.fcurves
        for layer in action.layers
        for strip in layer.strips
        for bag in strip.channelbags
        if bag.slot_handle == number
    ]


def action_curves(action: bpy.types.Action) -> list[bpy.types.FCurve]:
    """Returns all F-curves of an action, whatever its slots."""
    if not hasattr(action, "layers"):  # before 4.4
        return list(action.fcurves)
    return [
        curve for layer in action.layers for strip in layer.strips for bag in strip.channelbags for curve in bag.fcurves
    ]


def in_muted_groups(action: bpy.types.Action) -> list[int]:
    """Returns the numbers of those of action_curves that a muted group mutes."""
    if not GROUPS_MUTE or not any(group.mute for group in action.groups):
        return []
    own = enumerate(action.fcurves)
    return [number for number, curve in own if curve.group is not None and curve.group.mute]


def slot_curves(block: bpy.types.ID) -> list[bpy.types.FCurve]:
    """Returns the F-curves by which a data-block's own action moves it."""
    data = block.animation_data
    if data is None or data.action is None:
        return []
    return curves_in(data.action, getattr(data, "action_slot", None))


def played_tracks(data: bpy.types.AnimData) -> list[bpy.types.NlaTrack]:
    """Returns the NLA tracks that are on, the lowest first."""
    solo = [track for track in data.nla_tracks if track.is_solo]
    return solo or [track for track in data.nla_tracks if not track.mute]


def plays_strips(data: bpy.types.AnimData) -> bool:
    """Whether the NLA animates what this is of: a single track that is to play alone does also without strips."""
    tracks = played_tracks(data) if data.use_nla else []
    return any(len(track.strips) or track.is_solo for track in tracks)


def _is_full(strip: bpy.types.NlaStrip) -> bool:
    """Whether a strip sets the very values of its action."""
    is_faded = strip.use_animated_influence or strip.blend_in or strip.blend_out
    return strip.type == "CLIP" and strip.blend_type in ("REPLACE", "COMBINE") and not is_faded


def count_at(block: bpy.types.ID, path: str) -> float:
    """Returns how many numbers there are at a path of a data-block; 0 if there is nothing, infinitely many if it is no
    array, of which Blender ignores the index. A curve with a higher index sets nothing."""
    try:
        value = block.path_resolve(path)
    except ValueError:
        return 0
    return len(value) if hasattr(value, "__len__") and not isinstance(value, (str, set)) else math.inf


def sets_nothing(block: bpy.types.ID, curve: bpy.types.FCurve) -> bool:
    """Whether Blender passes over a curve because a data-block has nothing that it could set."""
    return curve.array_index >= count_at(block, curve.data_path)


ROUNDING = 4 * float(np.finfo(np.float32).eps)  # by which a drag may miss a key: auto-keying inserts none for it


def is_near(value: float, keyed: float, rounding: float = ROUNDING) -> bool:
    """Whether a number is the one that keyframes set, up to rounding. rounding: of numbers up to 1; of larger ones in
    proportion; 0: none."""
    return value == keyed or abs(value - keyed) <= rounding * max(1.0, abs(value), abs(keyed))


def unkeyed_path(block: bpy.types.ID, time: float, rounding: float = ROUNDING) -> str:
    """Returns the path of a property that is not as the keyframes of a data-block's own action set it, "" if there is
    none or NLA strips mix. rounding: as for is_near."""
    data = block.animation_data
    if data is None or plays_strips(data):
        return ""
    driven = {(curve.data_path, curve.array_index) for curve in data.drivers}
    for curve in slot_curves(block):
        if curve.mute or (curve.data_path, curve.array_index) in driven or sets_nothing(block, curve):
            continue
        value = block.path_resolve(curve.data_path)
        value = value[curve.array_index] if hasattr(value, "__len__") and not isinstance(value, str) else value
        keyed = _within_limits(block, curve.data_path, curve.evaluate(time))
        if isinstance(value, float) and not is_near(value, keyed, rounding):
            return curve.data_path
        if isinstance(value, int) and abs(value - keyed) > 0.999:  # Blender rounds whole numbers
            return curve.data_path
    return ""


def _within_limits(block: bpy.types.ID, path: str, value: float) -> float:
    """Returns what Blender makes of a value that keyframes set of a property: custom ones have limits of their own."""
    owner, separator, name = path.rpartition('["')
    if not separator or not name.endswith('"]'):
        return value
    holder = block.path_resolve(owner) if owner else block
    settings = holder.id_properties_ui(bpy.utils.unescape_identifier(name[:-2])).as_dict()
    return float(np.float32(min(max(value, settings.get("min", value)), settings.get("max", value))))


def stays(ob: bpy.types.Object, curve: bpy.types.FCurve) -> bool:
    """Whether a curve of keyframes sets, on all frames, a number of an object's place to what it is now: as importers
    key the place of an armature that does not move. Strips that mix several values have to find it at its default.
    curve: one that sets something."""
    if curve.data_path not in PLACE or curve.driver is not None:
        return False
    points, value = curve.keyframe_points, getattr(ob, curve.data_path)[curve.array_index]
    data = ob.animation_data
    if value and data is not None and plays_strips(data):
        is_default = value == 1 and (curve.data_path, curve.array_index) in _ONES
        strips = [strip for track in played_tracks(data) for strip in track.strips]
        if not (is_default and all(map(_is_full, strips)) and (data.action is None or data.action_influence == 1)):
            return False
    numbers = np.empty((3, 2 * len(points)), np.float32)
    for name, row in zip(("co", "handle_left", "handle_right"), numbers):
        points.foreach_get(name, row)
    return len(points) > 0 and not len(curve.modifiers) and bool((numbers[:, 1::2] == np.float32(value)).all())


def find_curve(block: bpy.types.ID, path: str) -> bpy.types.FCurve | None:
    """Returns the F-curve that animates a property of a data-block, or None. NLA strips are not searched."""
    data = block.animation_data
    if data is None or data.action is None:
        return None
    if not hasattr(data, "action_slot"):  # before 4.4
        return data.action.fcurves.find(path)
    return next((curve for curve in slot_curves(block) if curve.data_path == path), None)


def find_driver(block: bpy.types.ID, path: str, index: int = 0) -> bpy.types.FCurve | None:
    """Returns the driver of a property of a data-block, or None."""
    data = block.animation_data
    return data.drivers.find(path, index=index) if data else None


def remove_driver(ob: bpy.types.Object, path: str) -> bool:
    """Removes the driver of a property, and animation data that is then empty. Returns whether there was a driver."""
    curve = find_driver(ob, path)
    if curve is None:
        return False
    remove_curve(ob, curve)
    return True


def remove_curve(ob: bpy.types.Object, curve: bpy.types.FCurve) -> None:
    """Removes a driver, even of a property that no longer exists, and animation data that is then empty.
    (`driver_remove` is not used: in 5.2 it evaluates the object's keyframes again, which discards unkeyed changes.)"""
    data = ob.animation_data
    data.drivers.remove(curve)
    if not (data.action or data.drivers or data.nla_tracks):
        ob.animation_data_clear()


# The space of a variable that only waits for a bone or a transform. Blender writes the values of variables into the
# original driver, and undo compares that with its earlier state. In this space a value is that of the channel itself, 0
# for bones that follow others, so that a pose does not change the driver.
WAITING = "TRANSFORM_SPACE"


def drive(
    ob: bpy.types.Object, path: str, variables: Iterable[tuple[str, str, Any, str]], expression: str = ""
) -> bpy.types.Driver:
    """Adds a driver that sets a property of the object to the sum of its variables, or to a simple expression of them,
    for which Blender runs no Python. Returns the driver.

    variables: tuples (name, type of data-block, data-block, path of the property), or (name, "BONE", armature, bone).
    The latter makes the driver wait until the bone is evaluated, or with "" until the object's transform is. Or (name,
    "COPY", variable of another driver, ""), for a copy of that variable.
    If a property does not exist, because the add-on that defines it is missing, the variable is 0.
    """
    curve = ob.driver_add(path)
    driver = curve.driver
    driver.type = "SCRIPTED" if expression else "SUM"
    if expression:
        driver.expression = expression
    for name, kind, block, place in variables:
        variable = driver.variables.new()
        variable.name = name
        if kind == "COPY":
            _copy_variable(block, variable)
            continue
        variable.type = "TRANSFORMS" if kind == "BONE" else "SINGLE_PROP"
        target = variable.targets[0]
        if kind == "BONE":
            target.id, target.bone_target = block, place
            target.transform_space = WAITING
            continue
        target.id_type, target.id, target.data_path = kind, block, place
        if hasattr(target, "use_fallback_value"):  # 4.1 and later; in earlier versions it is 0 anyway
            target.use_fallback_value, target.fallback_value = True, 0.0
    return driver


def _copy_variable(source: bpy.types.DriverVariable, to: bpy.types.DriverVariable) -> None:
    """Makes a driver's variable read what another one reads."""
    to.type = source.type
    for theirs, ours in zip(source.targets, to.targets):
        if source.type == "SINGLE_PROP":
            ours.id_type = theirs.id_type
        for setting in theirs.bl_rna.properties:
            if not setting.is_readonly and setting.identifier != "id_type":
                setattr(ours, setting.identifier, getattr(theirs, setting.identifier))
        if hasattr(ours, "use_fallback_value") and not ours.use_fallback_value:
            # If the property is removed, the driver with the copy stays valid.
            ours.use_fallback_value, ours.fallback_value = True, MISSING


MISSING = math.nan  # the value of a copied variable whose property does not exist
