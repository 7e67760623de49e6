"""Drivers and animated values as rows."""

import ast
from collections.abc import Iterator
from typing import Any

import bpy

from ..blender import animation, spoken_paths, values
from ..host import driver_memory
from . import curves, other_data, rna_paths, strips, targets

VARIABLES = {"SINGLE_PROP", "TRANSFORMS", "LOC_DIFF", "ROTATION_DIFF"}
# Of the rig: what a variable reads of the object itself is outside.
OF_RIG = ("pose.", '["', "data.")


class Outside:
    """Properties of other data-blocks that drivers read, by name, and data-blocks of which keyframes set some."""

    def __init__(self) -> None:
        self.read: dict[str, tuple[bpy.types.ID, str]] = {}  # as drivers name them
        self.owned: dict[str, other_data.Property] = {}  # these, and what is computed, by path
        self.keyed: dict[str, other_data.Property] = {}  # what keyframes set, by where the description has it
        self.through: dict[bpy.types.ID, None] = {}  # the data-blocks by which drivers name them, but no objects' own
        self.computed: dict[str, tuple[bpy.types.ID, str]] = {}  # what drivers read of them, by path
        self._animated: dict[int, other_data.Animated] = {}

    def row_of(self, block: bpy.types.ID, path: str, found: targets.Targets) -> dict[str, str]:
        """Returns what a variable says of a property that it reads. Raises Refused."""
        owner, own = other_data.owned(block, path)
        if owner == found.ob and found.moves and rna_paths.moves_object(own):
            return {"path": other_data.path_of(found.ob, own)}
        if owner == found.ob.data:
            return {"path": f"data.{own}"}
        if owner == found.ob and block != owner and own.startswith(OF_RIG):
            return {"path": own}
        key = values.key_of(owner)
        if key not in self._animated:
            self._animated[key] = other_data.Animated.of(owner)
        described, animated = other_data.path_of(owner, own), self._animated[key]
        self.owned[described] = other_data.Property(owner, own)
        if animated.place and rna_paths.moves_object(own):
            found.of(owner, "")
            return {"path": described}
        whole = animated.whole(own)
        if not whole:
            return {"outside": self.name_of(block, path, owner, own)}
        self.keyed[other_data.path_of(owner, whole)] = other_data.Property(owner, whole)
        self.computed[described] = (block, path)
        if block != owner or not isinstance(owner, bpy.types.Object):
            self.through[block] = None
        return {"path": described}

    def name_of(self, block: bpy.types.ID, path: str, owner: bpy.types.ID, own: str) -> str:
        """owner, own: of other_data.Property. Raises Refused for what is no number."""
        kind = "" if isinstance(block, bpy.types.Object) else f"{block.id_type}/"
        name = f"{kind}{block.name_full}: {path}"
        if name not in self.read:
            try:
                value = block.path_resolve(path)
            except ValueError:
                value = None
            if not isinstance(value, int | float):
                raise curves.Refused(f"it reads {spoken_paths.spoken(path)} of {block.name}, which is no number")
            self.read[name], self.owned[name] = (block, path), other_data.Property(owner, own)
        return name

    def of_data(self) -> list[tuple[str, other_data.Property]]:
        """Returns what is read of other data-blocks than objects and is not computed, by name."""
        own = ((name, self.owned[name]) for name in self.read)
        return [each for each in own if not isinstance(each[1].block, bpy.types.Object)]

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
        if block == ob and strips.play(ob):
            continue
        try:
            yield from rows_of(ob, curves.curves_in_effect(block), start, found)
        except curves.Refused as reason:
            found.refused.append(str(reason))


def rows_of(
    ob: bpy.types.Object, own: list[bpy.types.FCurve], start: str, found: targets.Targets
) -> Iterator[dict[str, Any]]:
    """Yields the values of the rig that curves animate. start: what their paths begin with. Raises Refused."""
    known: dict[str, str | None] = {}  # by the path of curves, of which several have the same: that of their rows
    for curve, row in zip(own, curves.rows_of(own)):
        if (stored := row["path"]) not in known:
            path = path_of(start, stored)
            if not start and animation.stays(ob, curve):
                continue
            known[stored] = path if is_wanted(ob, path, found) else None
        if own_path := known[stored]:
            row["path"] = own_path
            yield curves.animated(row, curve)


def drivers_of(ob: bpy.types.Object, found: targets.Targets, outside: Outside) -> Iterator[dict[str, Any]]:
    """Yields the rig's drivers."""
    for block, start in blocks_of(ob):
        own = animation.drivers_of(block)
        for curve, row, read in zip(own, curves.rows_of(own), driver_memory.read_variables(own)):
            path = path_of(start, row["path"])
            if curve.mute or not curve.is_valid or animation.sets_nothing(block, curve):
                continue
            try:
                if not curve.driver.is_valid:
                    if rna_paths.has_effect(path):
                        _check_invalid(block, curve)
                elif is_wanted(ob, path, found):
                    yield driver_of(path, curve, row, read, found, outside)
            except curves.Refused as reason:
                found.refused.append(f"the driver of {spoken_paths.spoken(path)}: {reason}")


def _check_invalid(block: bpy.types.ID, curve: bpy.types.FCurve) -> None:
    """Raises Refused if keyframes set the same as an invalid driver. Blender evaluates the driver once after a file was
    opened or a step was undone, and then no longer, so its value may be there on one frame."""
    keyed = {(each.data_path, each.array_index) for each in animation.keyed_curves(block)}
    if (curve.data_path, curve.array_index) in keyed:
        raise curves.Refused("it is invalid, and keyframes set the same: mend or delete it")


def path_of(start: str, path: str) -> str:
    return start + rna_paths.normalised(path)


def is_wanted(ob: bpy.types.Object, path: str, found: targets.Targets) -> bool:
    """Whether poses depend on it. Refuses what moves the object."""
    if rna_paths.moves_object(path):
        if found.moves:  # as do other objects that move
            return False
        found.refused.append(
            f"{ob.name} itself moves (its {spoken_paths.spoken(path)} is animated): move a bone instead"
        )
        return False
    return rna_paths.has_effect(path) and path.rpartition(".")[0] not in found.without_row


def driver_of(
    path: str, curve: bpy.types.FCurve, row: Any, own: driver_memory.Variables, found: targets.Targets, outside: Outside
) -> dict[str, Any]:
    """row, own: of curves.rows_of and driver_memory.read_variables. Raises Refused."""
    driver = curve.driver
    result: dict[str, Any] = {
        "path": path,
        "index": row.pop("index"),
        "type": driver.type,
        "variables": [variable_of(*variable, found, outside) for variable in own],
        "curve": curves.complete(row, curve),
    }
    del row["path"]
    if driver.type == "SCRIPTED":
        if not driver.is_simple_expression:  # "Use Self" has no part in one
            raise curves.Refused(
                f'"{driver.expression}" is not one of Blender\'s simple expressions: write it without Python'
            )
        result["expression"] = driver.expression
    return result


def reads_variables_only(driver: bpy.types.Driver) -> bool:
    """Whether a driver's value follows from its variables and, if its expression has that word, from the frame. Python
    may read anything else: so it may have neither other names, nor calls and attributes of what it has."""
    if driver.type != "SCRIPTED" or driver.is_simple_expression:
        return True
    try:
        nodes = list(ast.walk(ast.parse(driver.expression.strip(), mode="eval")))
    except (SyntaxError, ValueError):  # Blender finds no value either, and sets nothing
        return True
    known = {"frame", *(variable.name for variable in driver.variables)}
    is_calling = any(isinstance(each, ast.Call | ast.Attribute) for each in nodes)
    return not is_calling and all(each.id in known for each in nodes if isinstance(each, ast.Name))


def driver_elsewhere(
    path: str, index: int, curve: bpy.types.FCurve, found: targets.Targets, outside: Outside
) -> dict[str, Any]:
    """Returns the row of a driver of another data-block. path, index: what it sets, as the description names it. Raises
    Refused."""
    (row,), (own,) = curves.rows_of([curve]), driver_memory.read_variables([curve])
    return driver_of(path, curve, row, own, found, outside) | {"index": index}


def variable_of(
    name: str, kind: str, read: list[driver_memory.Target], found: targets.Targets, outside: Outside
) -> dict[str, Any]:
    if kind not in VARIABLES:
        kinds = bpy.types.DriverVariable.bl_rna.properties["type"].enum_items
        raise curves.Refused(f"variables of the type {kinds[kind].name} are not covered: use another type")
    row: dict[str, Any] = {"name": name, "type": kind}
    if kind == "SINGLE_PROP":
        block, stored, *_rest = read[0]
        path = rna_paths.normalised(stored)
        if block == found.ob and path.startswith(OF_RIG):
            if (switch := rna_paths.SWITCH.search(path)) and path not in found.switches:
                others = (path.removesuffix(switch[2]) + each for each in rna_paths.SWITCHES)
                if not found.switches.isdisjoint(others):
                    raise curves.Refused(
                        f"its variable {name} reads {spoken_paths.spoken(path)}, of which the contrary is animated"
                    )
            row["path"] = path
        elif block == found.ob.data:
            row["path"] = "data." + path
        elif block is None:
            raise curves.Refused(f"its variable {name} reads nothing: choose what it reads")
        else:
            row |= outside.row_of(block, stored, found)
        return row
    row["targets"] = [target_of(kind, target, found, outside) for target in read]
    return row


def target_of(kind: str, target: driver_memory.Target, found: targets.Targets, outside: Outside) -> dict[str, Any]:
    block: Any
    block, _path, bone, channel, space, mode = target
    if block == found.ob and bone and bone not in found.bones:
        raise curves.Refused(f"{block.name} has no bone {bone}: choose another one")
    read_as: targets.ReadAs | None = targets.HEAD if kind == "LOC_DIFF" and bone else None
    if kind != "ROTATION_DIFF" and space != "WORLD_SPACE":
        read_as = targets.BASIS if space == "TRANSFORM_SPACE" else ("POSE" if bone else "WORLD", "LOCAL")
    row: dict[str, Any] = {"target": found.of(block, bone, read_as), "transform_type": channel}
    row |= {"transform_space": space, "rotation_mode": mode}
    if not row["target"] or "outside" not in row["target"]:
        if row["target"] == {"armature": True} and kind != "ROTATION_DIFF":
            if space == "LOCAL_SPACE" or found.moves and space != "WORLD_SPACE":
                raise curves.Refused(f"it reads {block.name} itself in local space, which is not covered")
            if found.moves and kind == "TRANSFORMS" and channel.startswith("ROT"):
                raise curves.Refused(f"it reads how {block.name} itself is turned, which moves: that is not covered")
        return row
    # What comes from outside is a matrix.
    if kind == "ROTATION_DIFF" and bone:
        raise curves.Refused(f"it reads how a bone of {block.name} is turned, which is not covered")
    if kind == "LOC_DIFF" and read_as == targets.BASIS and not bone and any(block.delta_location):
        raise curves.Refused(f"it reads {block.name}, which has a delta, in transform space, which is not covered")
    holder = block.pose.bones[bone] if bone else block
    if kind == "TRANSFORMS" and mode == "AUTO" and holder.rotation_mode not in ("QUATERNION", "AXIS_ANGLE"):
        start = f"{holder.path_from_id()}." if bone else ""
        row["stored_mode"] = holder.rotation_mode
        angles = [f"{start}rotation_euler[{i}]" for i in range(3)]
        row["stored_angles"] = [next(iter(outside.row_of(block, each, found).values())) for each in angles]
    return row
