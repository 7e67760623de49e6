"""Reads again what posing and keyframes have changed of an armature that was read before, if nothing else has changed.

To read and build a large rig takes as long as several frames, and after most edits nearly all of it is as it was."""

import json
from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np

from ..blender import animation, dependencies, values
from ..host import bone_memory, driver_memory, keyframes
from . import bone_rows, curves, custom_properties, objects, other_data, reading, rna_paths, splines, strips, tables

# Of a constraint, on each frame if they are animated, and by which names.
_WRITTEN = ("influence",), rna_paths.SWITCHES


class Known:
    """What an armature object was read from: what has to be the same, and the numbers that may have changed."""

    def __init__(
        self, ob: bpy.types.Object, read: reading.Reading, graph: bpy.types.Depsgraph, seen: bpy.types.Object
    ) -> None:
        """seen: as reading.read is given it."""
        self.targets, self.outside, self.follows = read.targets, read.outside, read.follows()
        rows, mixed = read.description["curves"], strips.numbers_of(read.description)
        self._curves = {(row["path"], row["index"]) for row in rows}
        is_clear = not read.targets.has_actions() and len(self._curves) == len(rows)
        self._state = _state(ob, self.targets.moves) if is_clear else None
        animated = {row["path"] for row in (*rows, *read.description["drivers"])} | {path for path, _index in mixed}
        paths_of = [each.path_from_id() for bone in ob.pose.bones for each in dependencies.constraints_of(bone)]
        self._is_written = [
            tuple(any(f"{path}.{name}" in animated for name in names) for names in _WRITTEN) for path in paths_of
        ]
        self._switches = list(self._read_switches(ob))
        self._modes, self._objects = self._read_modes(), self._read_objects()
        self._names, self._places = ob.pose.bones.keys(), bone_rows.places_of(ob)
        self._is_keyed = _which_are_keyed(ob, self._curves | mixed)
        self._numbers = self._read(ob, graph, seen)

    def edit(
        self, ob: bpy.types.Object, graph: bpy.types.Depsgraph, edited: list[bpy.types.FCurve], seen: bpy.types.Object
    ) -> tuple[dict[str, Any], list[dict[str, Any]]] | None:
        """Returns what RigProgram.edited is given, or None if something else has changed. From then on, these are the
        numbers that are known. edited: the curves of the object's action whose keyframes are others; seen: as
        reading.read is given it. Raises ValueError if something from outside can no longer be read."""
        if (
            self._state is None
            or _state(ob, self.targets.moves) != self._state
            or list(self._read_switches(ob)) != self._switches
        ):
            return None
        if self._read_modes() != self._modes or self._read_objects() != self._objects:
            return None
        own = {curve.as_pointer() for curve in animation.slot_curves(ob)} if edited else set()
        edited = [curve for curve in edited if curve.as_pointer() in own]  # other slots are others'
        rows = [self._row_of(curve) for curve in edited if rna_paths.has_effect(rna_paths.normalised(curve.data_path))]
        before, self._numbers = self._numbers, self._read(ob, graph, seen)
        if None in rows or [_limits(row) for row in before[1]] != [_limits(row) for row in self._numbers[1]]:
            return None
        given: dict[str, Any] = dict(self._given_of_bones(ob, before[0]))
        for old, new in zip(before[1], self._numbers[1]):
            if old["value"] != new["value"]:
                given[new["path"]] = _given(new["value"])
        return given | self._numbers[2], [row for row in rows if row is not None]

    def _read_modes(self) -> list[str]:
        """Returns the modes of rotation of what is outside, on which it depends how that is read."""
        return [each.rotation_mode for each in self.follows if isinstance(each, bpy.types.Object)]

    def _read_objects(self) -> str:
        """Returns the places and the keyframes of other objects that are computed, too, and splines, as text."""
        itself = [(self.targets.ob, "")] if self.targets.moves else []
        own = objects.moving([*self.targets.outside.values(), *itself])
        for name, curve in self.targets.splines.items():
            splines.check(curve, self.targets.along_splines[name])
        values = splines.values_of(self.targets, self.outside)
        keyed = other_data.properties_of(self.outside.keyed.values())
        paths = splines.rows_of(self.targets), splines.curves_of(self.targets)
        rows = objects.unkeyed_rows_of(own), keyed, paths, list(values)
        return json.dumps(rows, default=reading.as_list)

    def _read_switches(self, ob: bpy.types.Object) -> Iterator[tuple[Any, ...]]:
        """Yields influence, mute and validity of each constraint, None for what is written on each frame."""
        constraints = (each for bone in ob.pose.bones for each in dependencies.constraints_of(bone))
        for each, is_written in zip(constraints, self._is_written):
            own = each.influence, each.mute
            yield (*(None if known else value for value, known in zip(own, is_written)), each.is_valid)

    def keyed(self) -> Iterator[tuple[str, Any]]:
        """Yields what the bones had of what keyframes set, by path, as RigProgram.evaluate is given it."""
        numbers = self._numbers[0]
        for name, own, is_of_rest in tables.bone_columns():
            for bone in np.flatnonzero(self._is_keyed[:, own].any(axis=1)).tolist():
                yield self._path_of(bone, name, is_of_rest), _given(numbers[bone, own])

    def from_outside(self) -> dict[str, Any]:
        """Returns what came from outside, as RigProgram.evaluate is given it."""
        return self._numbers[2]

    def _path_of(self, bone: int, name: str, is_of_rest: bool) -> str:
        return f'{"data" if is_of_rest else "pose"}.bones["{bpy.utils.escape_identifier(self._names[bone])}"].{name}'

    def _read(
        self, ob: bpy.types.Object, graph: bpy.types.Depsgraph, seen: bpy.types.Object
    ) -> tuple[np.ndarray, list, dict[str, Any]]:
        """Returns the numbers of bones, the custom properties, and what comes from outside."""
        outside = self.outside.values(graph) | self.targets.matrices(graph)
        known = self._places, bone_memory.read_numbers(ob)
        return bone_rows.values_of(ob, *known), list(custom_properties.properties_of(seen, *known)), outside

    def _given_of_bones(self, ob: bpy.types.Object, before: np.ndarray) -> Iterator[tuple[str, Any]]:
        now = self._numbers[0]
        differs = (now.view(np.int32) != before.view(np.int32)) & ~self._is_keyed
        for name, own, is_of_rest in tables.bone_columns():
            for bone in np.flatnonzero(differs[:, own].any(axis=1)).tolist():
                yield self._path_of(bone, name, is_of_rest), _given(now[bone, own])

    def _row_of(self, curve: bpy.types.FCurve) -> dict[str, Any] | None:
        """Returns the row of a curve, or None if it had none, or has none any more."""
        (row,) = curves.rows_of([curve])
        row["path"] = rna_paths.normalised(row["path"])
        if (row["path"], row["index"]) not in self._curves or not curves.unmuted([curve]):
            return None
        try:
            return curves.animated(row, curve)
        except curves.Refused:
            return None


def _given(numbers: Any) -> Any:
    """Returns the numbers of a path as RigProgram.evaluate is given them."""
    return numbers if len(numbers) > 1 else numbers[0]


def _limits(row: dict[str, Any]) -> list[Any]:
    return [value for name, value in row.items() if name != "value"]


def _which_are_keyed(ob: bpy.types.Object, keyed: set[tuple[str, int]]) -> np.ndarray:
    """Returns which numbers of the bones follow curves, in the order of bones.values_of."""
    columns = {name: own.start for name, own, is_of_rest in tables.bone_columns() if not is_of_rest}
    rows = {bone.name: number for number, bone in enumerate(ob.pose.bones)}
    found = np.zeros((len(rows), tables.bone_columns()[-1][1].stop), bool)
    for path, index in keyed:
        match = rna_paths.BONE.match(path)
        column = columns.get(path[match.end() + 1 :]) if match and path.startswith("pose.") else None
        row = rows.get(bpy.utils.unescape_identifier(match[1])) if match else None
        if column is not None and row is not None:
            found[row, column + index] = True
    return found


def _modifiers_of(curve: bpy.types.FCurve) -> Any:
    try:
        return curves.modifiers_of(curve)
    except curves.Refused as reason:
        return str(reason)


def settings_of(ob: bpy.types.Object) -> Any:
    """Returns what is equal at two times if the bones, constraints, drivers, action and strips of an armature object
    have the same settings, wherever it is and however it is posed. None if that cannot be told."""
    found = _state(ob)
    return None if found is None else found[:-1]


def _state(ob: bpy.types.Object, moves: bool = False) -> Any:
    """Returns what is equal at two times if all that an armature object is read from is, except for how it is posed,
    its custom properties, its keyframes, and what comes from outside. None if that cannot be told. moves: wherever its
    object is, too."""
    data = ob.animation_data
    if not bone_memory.can_read() or data is not None and data.use_tweak_mode:
        return None
    bones_now = bone_memory.read_bytes(ob.data), bone_memory.read_handles(ob.data)
    found: list[Any] = [bone_memory.read_settings(ob), bones_now, strips.state_of(ob)]
    for block in (ob, ob.data):
        own = animation.drivers_of(block)
        stored = keyframes.read(own)
        found.append(driver_memory.read_bytes(own, is_whole=True))
        found.append([(stored.settings(i), stored.keys(i).tobytes()) for i in range(len(own))])
        found.append([_modifiers_of(each) for i, each in enumerate(own) if not stored.is_local(i)])
    if None in found:
        return None
    if animation.keyed_curves(ob.data):
        return None
    found += [
        None if each is None else values.key_of(each) for each in (getattr(data, "action", None), ob.parent, ob.data)
    ]
    found += [getattr(data, "action_slot_handle", 0), ob.parent_type, ob.parent_bone, len(ob.constraints)]
    found += [ob.rigid_body is None, ob.data.pose_position, ob.pose.ik_solver, ob.mode == "EDIT", ob.data.is_editmode]
    return [*found, None if moves else [list(row) for row in ob.matrix_world]]
