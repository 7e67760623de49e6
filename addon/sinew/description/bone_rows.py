"""Bones as rows."""

from collections.abc import Iterable
from operator import attrgetter
from typing import Any

import bpy
import numpy as np

from ..host import bone_memory
from .tables import bone_columns
from .targets import Targets

OF_REST = {  # what is read of all bones at once: name, how many numbers, type
    "matrix_local": (16, np.float32),
    "matrix": (9, np.float32),
    "head": (3, np.float32),
    "head_local": (3, np.float32),
    "tail_local": (3, np.float32),
    "length": (1, np.float32),
    "use_inherit_rotation": (1, bool),
    "use_local_location": (1, bool),
    "use_connect": (1, bool),
    "use_deform": (1, bool),
    "bbone_segments": (1, np.int32),
}
# Enumerations by Blender's numbers.
ROTATION_MODES = {0: "QUATERNION", 1: "XYZ", 2: "XZY", 3: "YXZ", 4: "YZX", 5: "ZXY", 6: "ZYX", -1: "AXIS_ANGLE"}
INHERIT_SCALES = {0: "FULL", 1: "FIX_SHEAR", 2: "AVERAGE", 3: "NONE", 4: "NONE_LEGACY", 5: "ALIGNED"}
OF_BEND = (  # what only B-bones need
    "bbone_handle_type_start",
    "bbone_handle_type_end",
    "bbone_handle_use_ease_start",
    "bbone_handle_use_ease_end",
    "use_endroll_as_inroll",
    "use_scale_easing",
    "bbone_mapping_mode",
)
HANDLES = "bbone_custom_handle_start", "bbone_custom_handle_end"
SCALED_BY = "bbone_handle_use_scale_start", "bbone_handle_use_scale_end"

Stored = tuple[bone_memory.Numbers, bone_memory.Numbers] | None


def column(collection: Any, name: str, width: int, kind: type) -> np.ndarray:
    """Returns a property of all items: N, or N x width."""
    numbers: np.ndarray = np.empty(len(collection) * width, kind)
    collection.foreach_get(name, numbers)
    return numbers if width == 1 else numbers.reshape(-1, width)


def numbers_of(
    ob: bpy.types.Object, name: str, is_of_rest: bool, width: int, kind: type, row: np.ndarray, stored: Stored
) -> np.ndarray:
    """Returns a property of all bones, of the pose or at rest, in the order of the pose: B, or B x width. row, stored:
    as values_of is given them."""
    if stored is not None and name in stored[is_of_rest].columns:
        numbers = stored[is_of_rest].of(name)
    else:
        numbers = column(ob.data.bones if is_of_rest else ob.pose.bones, name, width, kind)
    return numbers[row] if is_of_rest else numbers


def bones_of(ob: bpy.types.Object, row: np.ndarray, stored: Stored, found: Targets) -> list[dict[str, Any]]:
    """Returns the bones in the order of the pose. Choices of a newer Blender are added to `found.refused`. row,
    stored: as values_of is given them."""
    bones, posed = ob.data.bones, ob.pose.bones
    names = posed.keys()
    columns: dict[str, list] = {"name": names, "values": list(values_of(ob, row, stored))}
    for name, (width, kind) in OF_REST.items():
        numbers = numbers_of(ob, name, True, width, kind, row, stored)
        side = {16: 4, 9: 3}.get(width)
        if side:  # columns in Blender's memory, rows in a description
            numbers = np.ascontiguousarray(numbers.reshape(-1, side, side).swapaxes(1, 2))
        columns[name] = numbers.tolist() if width == 1 else list(numbers)
    data = ob.data.animation_data
    if data is not None and any(curve.data_path.endswith(".use_deform") for curve in data.drivers):
        columns["use_deform"] = [True] * len(names)  # it may become one
    if stored is not None:
        columns["parent"] = [names[i] if i >= 0 else None for i in bone_memory.parents(stored[0])]
        columns["has_constraints"] = bone_memory.have_constraints(stored[0])
    else:
        columns["parent"] = [bone.parent and bone.parent.name for bone in posed]
        columns["has_constraints"] = [len(bone.constraints) > 0 for bone in posed]
    for name, known, numbers in (
        ("rotation_mode", ROTATION_MODES, column(posed, "rotation_mode", 1, np.int32).tolist()),
        ("inherit_scale", INHERIT_SCALES, column(bones, "inherit_scale", 1, np.int32)[row].tolist()),
    ):
        columns[name] = [known.get(number, known[0]) for number in numbers]
        unknown = [bone for bone, number in zip(names, numbers, strict=True) if number not in known]
        found.refused += [f'the {name} of the bone "{bone}" is of a newer Blender, and not covered' for bone in unknown]
    entries = [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]
    bend, handles_of, scaled_by = attrgetter(*OF_BEND), attrgetter(*HANDLES), attrgetter(*SCALED_BY)
    children = connected_children([entries[i] for i in np.argsort(row).tolist()])
    for entry in entries:
        if entry["bbone_segments"] == 1:
            continue
        rest = bones[entry["name"]]
        entry.update(zip(OF_BEND, bend(rest), strict=True))
        entry.update(zip(HANDLES, [handle and handle.name for handle in handles_of(rest)]))
        entry.update(zip(SCALED_BY, map(list, scaled_by(rest))))
        entry["connected_child"] = children.get(entry["name"])
    return entries


def connected_children(entries: Iterable[dict[str, Any]]) -> dict[str, str]:
    """Returns the last connected child of each bone that has one. entries: in the armature's order."""
    return {entry["parent"]: entry["name"] for entry in entries if entry["use_connect"] and entry["parent"]}


def places_of(ob: bpy.types.Object) -> np.ndarray:
    """Returns where the armature has each bone of the pose."""
    places = {name: place for place, name in enumerate(ob.data.bones.keys())}
    return np.array([places[name] for name in ob.pose.bones.keys()], np.intp)


def values_of(ob: bpy.types.Object, row: np.ndarray, stored: Stored) -> np.ndarray:
    """Returns B x N numbers in the order of the library's table of bone settings. row: as places_of returns it; stored:
    as bone_memory.read_numbers returns it."""
    found = np.empty((len(row), bone_columns()[-1][1].stop), np.float32)
    for name, own, is_of_rest in bone_columns():
        kind = bool if name.startswith(("lock_ik", "use_ik_limit")) else np.float32
        width = own.stop - own.start
        found[:, own] = numbers_of(ob, name, is_of_rest, width, kind, row, stored).reshape(-1, width)
    return found
