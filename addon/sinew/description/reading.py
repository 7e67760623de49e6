"""Reads an armature into a description for sinew_native.RigProgram."""

import contextlib
import gc
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ..blender import animation, dependencies
from ..host import bone_memory
from . import (
    bone_rows,
    constraints,
    curves,
    custom_properties,
    driven_keys,
    driver_rows,
    objects,
    other_data,
    rna_paths,
    splines,
    strips,
    targets,
)

CAN_READ = bpy.app.version >= (4, 2, 0)  # older ones evaluate in other ways
FORMAT = 1  # of what is written; the library refuses a newer one than its own


@dataclass
class Reading:
    """A description, and where in Blender the numbers are that come from outside."""

    description: dict[str, Any]
    targets: targets.Targets
    outside: driver_rows.Outside

    def follows(self) -> list[bpy.types.ID]:
        """Returns the data-blocks that are read from outside."""
        return [block for block, _what in (*self.targets.outside.values(), *self.outside.read.values())]


def as_list(array: Any) -> Any:
    """Returns what JSON can hold of an array of a description. For `default` of json.dump."""
    if isinstance(array, np.ndarray):
        return array.tolist()
    raise TypeError(f"{type(array).__name__} is no part of a description")


@contextlib.contextmanager
def without_collecting() -> Iterator[None]:
    """Keeps Python from looking for cycles, of which a description has none: it would look again and again."""
    is_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if is_enabled:
            gc.enable()


def is_moved_by_keyframes(ob: bpy.types.Object) -> bool:
    """Whether keyframes, and nothing else, move an object."""
    lineage = dependencies.with_parents([ob])
    if not any(rna_paths.moves_object(curve.data_path) for each in lineage for curve in animation.slot_curves(each)):
        return False  # the usual case
    return not objects.why_not(ob) and any(
        rna_paths.moves_object(rna_paths.normalised(curve.data_path)) and not animation.stays(each, curve)
        for each in lineage
        for curve in curves.curves_in_effect(each)
    )


@without_collecting()
def read(
    ob: bpy.types.Object,
    depsgraph: bpy.types.Depsgraph | None = None,
    keyed: Sequence[driven_keys.Keyed] = (),
    seen: bpy.types.Object | None = None,
    may_move: bool = False,
) -> Reading:
    """Reads an armature object with its animation, and values of shape keys that it drives. What the description cannot
    say is in its `refused`, by name and reason. Raises ValueError for another type of object, and before Blender 4.2.

    depsgraph: in which what comes from outside is evaluated; None: that of the context. seen: its copy whose custom
    properties count; None: it has them itself. may_move: the object itself may be moved by keyframes, of its own and of
    its parents; otherwise that is refused."""
    if ob.type != "ARMATURE":
        raise ValueError(f"{ob.name} is no armature: choose one")
    if not CAN_READ:
        raise ValueError("rigs can be programs from Blender 4.2 on")
    depsgraph = depsgraph or bpy.context.evaluated_depsgraph_get()
    found, outside = targets.Targets(ob, may_move and is_moved_by_keyframes(ob)), driver_rows.Outside()
    if ob.data.pose_position != "POSE":
        found.refused.append(f"{ob.data.name} shows its rest position: switch it to Pose Position")
    if ob.pose.ik_solver != "LEGACY":
        found.refused.append("the IK solver is iTaSC: choose the standard one")
    if objects.has_constraints(ob):
        found.refused.append(f"{ob.name} itself has constraints: apply or remove them")
    row, stored = bone_rows.places_of(ob), bone_memory.read_numbers(ob)
    rows = bone_rows.bones_of(ob, row, stored, found)
    description = {
        "format": FORMAT,
        "name": ob.name,
        "blender": 100 * bpy.app.version[0] + bpy.app.version[1],
        "world": ob.name_full if found.moves else [list(row) for row in ob.evaluated_get(depsgraph).matrix_world],
        "bones": rows,
        "constraints": list(constraints.constraints_of(ob, rows, found)),
        "properties": list(custom_properties.properties_of(seen or ob, row, stored)),
        "curves": list(driver_rows.curves_of(ob, found)),
        "drivers": list(driver_rows.drivers_of(ob, found, outside)),
    }
    if strips.play(ob):
        try:
            description |= strips.rows_of(ob, found.without_row)
        except curves.Refused as reason:
            found.refused.append(str(reason))
    for property_row, driver_row in driven_keys.rows_of(keyed, found, outside):
        description["properties"].append(property_row)
        description["drivers"].append(driver_row)
    description["splines"] = splines.rows_of(found)
    for property_row, rows in splines.values_of(found, outside):
        description["properties"].append(property_row)
        description["drivers"] += rows
    description["curves"] += splines.curves_of(found)
    own = objects.moving([*found.outside.values(), *([(ob, "")] if found.moves else [])])
    found.moving = {each.name_full: each for each in own}
    description["objects"], keyed_places = objects.rows_of(own)
    for name, read_as in found.read_as.items():
        target, bone = found.outside[name]
        if not bone and target.name_full in found.moving:
            row = next(each for each in description["objects"] if each["name"] == target.name_full)
            row["basis" if read_as == targets.BASIS else "local"] = name
    for property_row, its_curves in other_data.properties_of(outside.keyed.values()):
        description["properties"].append(property_row)
        keyed_places += its_curves
    description["curves"] += keyed_places
    description["values"] = [{"name": name, "value": value} for name, value in outside.values(depsgraph).items()]
    description["matrices"] = [
        {"name": name, "matrix": matrix.tolist()} for name, matrix in found.matrices(depsgraph).items()
    ]
    description["refused"] = found.refused
    return Reading(description, found, outside)
