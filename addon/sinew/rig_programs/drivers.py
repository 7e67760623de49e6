"""Drivers and animated values as rows."""

from collections.abc import Iterator
from typing import Any

import bpy

from ..blender import animation
from . import curves, paths, tables, targets

VARIABLES = {"SINGLE_PROP", "TRANSFORMS", "LOC_DIFF", "ROTATION_DIFF"}
CHANNELS = tuple(tables.CHANNELS)  # most curves set one of these
# Of the rig: what a variable reads of the object itself is outside.
OF_RIG = ("pose.", '["', "data.")


class Outside:
    """Properties of other data-blocks that drivers read, by name."""

    def __init__(self) -> None:
        self.read: dict[str, tuple[bpy.types.ID, str]] = {}

    def name_of(self, block: bpy.types.ID, path: str) -> str:
        """Raises Refused for what is no number."""
        name = f"{block.name_full}: {path}"
        if name not in self.read:
            try:
                value = block.path_resolve(path)
            except ValueError:
                value = None
            if not isinstance(value, int | float):
                raise curves.Refused(f"it reads {path} of {block.name}, which is no number")
            self.read[name] = (block, path)
        return name

    def values(self, depsgraph: bpy.types.Depsgraph | None = None) -> dict[str, float]:
        """Returns their present values."""
        return {
            name: float((block if depsgraph is None else block.evaluated_get(depsgraph)).path_resolve(path))
            for name, (block, path) in self.read.items()
        }


def blocks_of(ob: bpy.types.Object) -> tuple[tuple[bpy.types.ID, str], ...]:
    """The data-blocks whose animation poses depend on, and what their paths begin with."""
    return ((ob, ""), (ob.data, "data."))


def curves_of(ob: bpy.types.Object, found: targets.Targets) -> Iterator[dict[str, Any]]:
    """Yields the animated values of the rig."""
    for block, start in blocks_of(ob):
        known: dict[str, str | None] = {}  # by the path of curves, of which several have the same: that of their rows
        wanted: list[tuple[str, bpy.types.FCurve]] = []
        try:
            for curve in curves.curves_in_effect(block):
                if (own := curve.data_path) not in known:
                    path = path_of(start, own)
                    if block == ob and animation.stays(ob, curve):
                        continue
                    known[own] = path if is_wanted(ob, path, found) and exists(block, own) else None
                if own := known[own]:
                    wanted.append((own, curve))
            stored = curves.stored_of([curve for _path, curve in wanted])
            for number, (path, curve) in enumerate(wanted):
                yield curve_row(path, curve, stored, number)
        except curves.Refused as reason:
            found.refused.append(str(reason))


def curve_row(path: str, curve: bpy.types.FCurve, *stored: Any) -> dict[str, Any]:
    """stored: as curves.curve_of is given it. Raises Refused."""
    row = {"path": path, "index": curve.array_index, **curves.curve_of(curve, *stored)}
    return row if path.endswith(CHANNELS) else row | curves.rounding_of(curve)


def drivers_of(ob: bpy.types.Object, found: targets.Targets, outside: Outside) -> Iterator[dict[str, Any]]:
    """Yields the rig's drivers."""
    for block, start in blocks_of(ob):
        own = animation.drivers_of(block)
        stored = curves.stored_of(own)
        for number, curve in enumerate(own):
            path = path_of(start, curve.data_path)
            if curve.mute or not curve.is_valid or not curve.driver.is_valid or not is_wanted(ob, path, found):
                continue
            try:
                yield driver_of(ob, path, curve, found, outside, stored, number)
            except curves.Refused as reason:
                found.refused.append(f"the driver of {path}: {reason}")


def path_of(start: str, path: str) -> str:
    return start + paths.normalised(path)


def exists(block: bpy.types.ID, path: str) -> bool:
    """Whether Blender finds what a curve animates; otherwise it passes over the curve."""
    try:
        block.path_resolve(path, False)
    except ValueError:
        return False
    return True


def is_wanted(ob: bpy.types.Object, path: str, found: targets.Targets) -> bool:
    """Whether poses depend on it. Refuses what moves the object."""
    if paths.moves_object(path):
        found.refused.append(f"{ob.name} itself moves (its {path} is animated): move a bone instead")
        return False
    return paths.has_effect(path)


def driver_of(
    ob: bpy.types.Object, path: str, curve: bpy.types.FCurve, found: targets.Targets, outside: Outside, *stored: Any
) -> dict[str, Any]:
    """stored: as curves.curve_of is given it. Raises Refused."""
    driver = curve.driver
    row: dict[str, Any] = {
        "path": path,
        "index": curve.array_index,
        "type": driver.type,
        "variables": [variable_of(ob, variable, found, outside) for variable in driver.variables],
        "curve": curves.curve_of(curve, *stored),
    }
    if driver.type == "SCRIPTED":
        if driver.use_self or not driver.is_simple_expression:
            raise curves.Refused(f'"{driver.expression}" is not one of Blender\'s simple expressions')
        row["expression"] = driver.expression
    return row


def variable_of(
    ob: bpy.types.Object, variable: bpy.types.DriverVariable, found: targets.Targets, outside: Outside
) -> dict[str, Any]:
    if variable.type not in VARIABLES:
        raise curves.Refused(f"variables of the type {variable.type} are not covered")
    row: dict[str, Any] = {"name": variable.name, "type": variable.type}
    if variable.type == "SINGLE_PROP":
        target = variable.targets[0]
        path, block = paths.normalised(target.data_path), target.id
        if block == ob and path.startswith(OF_RIG):
            row["path"] = path
        elif block == ob.data:
            row["path"] = "data." + path
        elif block is None:
            raise curves.Refused(f"its variable {variable.name} reads nothing")
        else:
            row["outside"] = outside.name_of(block, target.data_path)
        return row
    row["targets"] = [target_of(variable, target, found, outside) for target in variable.targets]
    return row


def target_of(variable: Any, target: Any, found: targets.Targets, outside: Outside) -> dict[str, Any]:
    row = {
        "target": found.of(target.id, target.bone_target),
        "transform_type": target.transform_type,
        "transform_space": target.transform_space,
        "rotation_mode": target.rotation_mode,
    }
    if not row["target"] or "outside" not in row["target"]:
        return row
    # Only world matrices come from outside.
    if variable.type == "ROTATION_DIFF" and target.bone_target:
        raise curves.Refused(f"it reads how a bone of {target.id.name} is turned, which is not covered")
    if variable.type != "ROTATION_DIFF" and target.transform_space != "WORLD_SPACE":
        raise curves.Refused(f"it reads {target.id.name} in another space than the world's, which is not covered")
    holder = target.id.pose.bones[target.bone_target] if target.bone_target else target.id
    if (
        variable.type == "TRANSFORMS"
        and target.rotation_mode == "AUTO"
        and holder.rotation_mode not in ("QUATERNION", "AXIS_ANGLE")
    ):
        start = f"{holder.path_from_id()}." if target.bone_target else ""
        row["stored_mode"] = holder.rotation_mode
        row["stored_angles"] = [outside.name_of(target.id, f"{start}rotation_euler[{i}]") for i in range(3)]
    return row
