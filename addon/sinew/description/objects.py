"""Other objects that bones follow, as rows: where each is follows from its own keyframes and those of its parents."""

import contextlib
from collections.abc import Iterable, Iterator
from typing import Any

import bpy

from ..blender import animation, dependencies, spoken_paths
from . import curves, rna_paths, tables

START = 'objects["'  # of paths in a description
# In the order of a description; there is no delta of an axis and an angle.
_CHANNELS = tuple(tables.CHANNELS)
_DELTAS = ("delta_location", "delta_rotation_quaternion", "", "delta_rotation_euler", "delta_scale")


def may_move(ob: bpy.types.Object) -> bool:
    """Whether time may change where an object is."""
    try:
        return bool(_keyed(ob))
    except curves.Refused:
        return True


def why_not(ob: bpy.types.Object) -> str:
    """Returns why it is not known on each frame where an object is, as a clause; "" if it is."""
    try:
        _keyed(ob)
    except curves.Refused as reason:
        return str(reason)
    return ""


def moving(outside: Iterable[tuple[bpy.types.Object, str]]) -> list[bpy.types.Object]:
    """Returns the objects that keyframes move, and their parents, each one after these. outside: objects, and bones of
    armatures, as Targets.outside has them."""
    found = []
    for ob, bone in outside:
        with contextlib.suppress(curves.Refused):
            found += [ob] if not bone and _keyed(ob) else []
    return dependencies.with_parents(found)


def rows_of(own: Iterable[bpy.types.Object]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Returns the rows of objects and of their curves. own: as returned by moving."""
    return [_row_of(each) for each in own], [row for each in own for row in _curves_of(each)]


def unkeyed_rows_of(own: Iterable[bpy.types.Object]) -> Any:
    """Returns the same without those numbers that keyframes set, which are others on each frame."""
    rows, keyed = rows_of(own)
    keyed_numbers = {(row["path"], row["index"]) for row in keyed}
    for ob, row in zip(own, rows):
        names = [(name, i) for name in (*_CHANNELS, *_DELTAS) for i in range(len(getattr(ob, name)) if name else 4)]
        for number, (name, index) in enumerate(names):
            if (f"{start_of(ob)}.{name}", index) in keyed_numbers:
                row["values"][number] = None
    return rows, keyed


def start_of(ob: bpy.types.Object) -> str:
    """Returns what the paths of an object's numbers begin with in a description."""
    return f'{START}{bpy.utils.escape_identifier(ob.name_full)}"]'


def _keyed(ob: bpy.types.Object) -> list[dict[str, Any]]:
    """Returns the curves that say where an object and its parents are. Raises Refused if anything else may."""
    lineage = dependencies.with_parents([ob])
    for each in lineage:
        _check(each)
    return [row for each in lineage for row in _curves_of(each)]


def has_constraints(ob: bpy.types.Object) -> bool:
    """Whether constraints may say where an object is: some are not muted, or animation may unmute them."""
    own = dependencies.constraints_of(ob)
    switches = [f"{each.path_from_id()}.{name}" for each in own for name in rna_paths.SWITCHES]
    return any(not each.mute for each in own) or animation.first_animated(ob, switches) is not None


def _check(ob: bpy.types.Object) -> None:
    """Raises Refused if anything but keyframes and parents may say where an object is."""
    if has_constraints(ob):
        raise curves.Refused(f"{ob.name} has constraints: bake them into keyframes")
    if ob.rigid_body is not None:
        raise curves.Refused(f"{ob.name} is simulated: bake that into keyframes")
    if ob.parent is not None and (ob.parent_type != "OBJECT" or ob.parent.type == "CURVE"):
        raise curves.Refused(f"{ob.name} is a child of a part of {ob.parent.name}: parent it to the object")
    own = (each for each in animation.drivers_of(ob) if rna_paths.moves_object(each.data_path))
    driven = next((each for each in own if not animation.sets_nothing(ob, each)), None)
    if driven is not None:
        raise curves.Refused(
            f"{spoken_paths.spoken(driven.data_path)} of {ob.name} has a driver: bake it into keyframes"
        )


def _curves_of(ob: bpy.types.Object) -> Iterator[dict[str, Any]]:
    """Yields the curves that say where an object is. Raises Refused."""
    own = curves.curves_in_effect(ob)
    for curve, row in zip(own, curves.rows_of(own)):
        path = rna_paths.normalised(row["path"])
        if not rna_paths.moves_object(path):
            continue
        if path not in (*_CHANNELS, *_DELTAS):
            raise curves.Refused(
                f"{spoken_paths.spoken(path)} of {ob.name} is keyed, which is not covered: remove those keyframes"
            )
        row["path"] = f"{start_of(ob)}.{path}"
        yield curves.animated(row, curve)


def _row_of(ob: bpy.types.Object) -> dict[str, Any]:
    numbers = [getattr(ob, name) if name else (0.0,) * 4 for name in (*_CHANNELS, *_DELTAS)]
    return {
        "name": ob.name_full,
        "parent": ob.parent.name_full if ob.parent is not None else None,
        "matrix_parent_inverse": [list(row) for row in ob.matrix_parent_inverse],
        "rotation_mode": ob.rotation_mode,
        "values": [number for each in numbers for number in each],
    }
