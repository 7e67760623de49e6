"""Drivers and keyframes."""

import bpy


def animated_properties(ob, modifier):
    """Names of the modifier's properties that drivers or keyframes of the object set."""
    start = f'modifiers["{bpy.utils.escape_identifier(modifier.name)}"].'
    return sorted(path.removeprefix(start) for path in animated_paths(ob) if path.startswith(start))


def animated_paths(block):
    """The paths of all properties of a data-block that drivers or keyframes set."""
    return {curve.data_path for curve in (*drivers_of(block), *keyed_curves(block))}


def drivers_of(block):
    data = block.animation_data
    return list(data.drivers) if data is not None else []


def keyed_curves(block):
    """The keyframes of a data-block, also those of NLA strips."""
    data = block.animation_data
    if data is None:
        return []
    actions = {data.action, *(strip.action for track in data.nla_tracks for strip in track.strips)} - {None}
    return [curve for action in actions for curve in action_curves(action)]


def is_muting_animated(keys):
    """Whether that of some shape key is. keys: the data-block."""
    return any(path.endswith(".mute") for path in animated_paths(keys))


def action_curves(action):
    if not hasattr(action, "layers"):  # before 4.4
        return list(action.fcurves)
    return [
        curve for layer in action.layers for strip in layer.strips for bag in strip.channelbags for curve in bag.fcurves
    ]


def find_curve(block, path):
    """The keyframes of a property of a data-block, or None."""
    data = block.animation_data
    if data is None or data.action is None:
        return None
    if not hasattr(data, "action_slot"):  # before 4.4
        return data.action.fcurves.find(path)
    return next(
        (
            curve
            for layer in data.action.layers
            for strip in layer.strips
            for bag in strip.channelbags
            if bag.slot == data.action_slot
            for curve in bag.fcurves
            if curve.data_path == path
        ),
        None,
    )


def find_driver(ob, path):
    """The object's driver of that property, or None."""
    data = ob.animation_data
    return data.drivers.find(path) if data else None


def remove_driver(ob, path):
    """Whether there was one. Leaves no empty animation data behind."""
    curve = find_driver(ob, path)
    if curve is None:
        return False
    remove_curve(ob, curve)
    return True


def remove_curve(ob, curve):
    """A driver, even of a property that is gone. (`driver_remove` has 5.2 play the object's keyframes anew, so what was
    moved by hand and not keyed would go back.)"""
    data = ob.animation_data
    data.drivers.remove(curve)
    if not (data.action or data.drivers or data.nla_tracks):
        ob.animation_data_clear()


def drive(ob, path, variables, expression=""):
    """Has a driver set that property of the object: to the sum of its variables, or to a simple expression of them,
    for which Blender runs no Python. variables: (name, kind of data-block, data-block, path of the property) each, or
    (name, "BONE", armature, bone), which is done when that bone is, or with "" when the object has its place. Where a
    property does not exist, since the add-on that has it is not there, 0 stands for it."""
    curve = ob.driver_add(path)
    driver = curve.driver
    driver.type = "SCRIPTED" if expression else "SUM"
    if expression:
        driver.expression = expression
    for name, kind, block, place in variables:
        variable = driver.variables.new()
        variable.name = name
        variable.type = "TRANSFORMS" if kind == "BONE" else "SINGLE_PROP"
        target = variable.targets[0]
        if kind == "BONE":
            target.id, target.bone_target = block, place
            continue
        target.id_type, target.id, target.data_path = kind, block, place
        if hasattr(target, "use_fallback_value"):  # 4.1 and later; before it is 0 anyway
            target.use_fallback_value, target.fallback_value = True, 0.0
    return driver
