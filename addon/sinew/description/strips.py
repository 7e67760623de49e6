"""Strips of the NLA as rows."""

from collections.abc import Container, Iterable, Iterator
from typing import Any

import bpy

from ..blender import animation, spoken_paths
from . import curves, custom_properties, rna_paths, tables

_MIXES = {"rotation_quaternion": "QUATERNION", "scale": "MULTIPLY", "bbone_scalein": "MULTIPLY"}
_MIXES["bbone_scaleout"] = "MULTIPLY"
_NUMBERS = (
    *("type", "frame_start", "frame_end", "action_frame_start", "action_frame_end", "scale", "repeat"),
    *("blend_in", "blend_out", "blend_type", "extrapolation", "use_reverse", "mute"),
)
_ACTIVE = "blend_type", "extrapolation", "influence"


class Actions:
    """The actions that strips play, as rows."""

    def __init__(self, ob: bpy.types.Object, without_row: Container[str]) -> None:
        self._ob, self._without_row = ob, without_row
        self.rows: dict[str, list[dict[str, Any]]] = {}  # by name
        self.mixed: dict[str, dict[str, Any]] = {}  # by path
        self._known: dict[str, str | None] = {}  # paths as the curves have them: as rows have them, None without effect

    def name_of(self, action: bpy.types.Action, slot: int) -> str:
        """Returns the name of a row. Raises Refused."""
        name = f"{action.name_full}/{slot}"
        if name not in self.rows:
            own = curves.that_set_anything(self._ob, curves.of_slot(action, slot))
            self.rows[name] = [row for each in zip(own, curves.rows_of(own)) for row in self._row_of(*each)]
        return name

    def _row_of(self, curve: bpy.types.FCurve, row: dict[str, Any]) -> Iterator[dict[str, Any]]:
        stored = row["path"]
        if animation.stays(self._ob, curve):
            return
        if stored not in self._known:
            path = rna_paths.normalised(stored)
            if rna_paths.moves_object(path):
                raise curves.Refused(
                    f"{self._ob.name} itself moves (its {spoken_paths.spoken(path)} is animated): move a bone instead"
                )
            has_effect = rna_paths.has_effect(path) and path.rpartition(".")[0] not in self._without_row
            self._known[stored] = path if has_effect else None
            if has_effect:
                self.mixed[path] = _mixed(self._ob, path)
        if known := self._known[stored]:
            row["path"] = known
            yield curves.animated(row, curve)


def play(ob: bpy.types.Object) -> bool:
    """Whether strips animate an object."""
    return ob.animation_data is not None and animation.plays_strips(ob.animation_data)


def rows_of(ob: bpy.types.Object, without_row: Container[str] = ()) -> dict[str, list[dict[str, Any]]]:
    """Returns the rows `actions`, `tracks` and `mixed` of an object whose strips play. without_row: see
    targets.Targets. Raises Refused."""
    data, found = ob.animation_data, Actions(ob, without_row)
    if data.use_tweak_mode:
        raise curves.Refused(f"an NLA strip of {ob.name} is being edited: leave its tweak mode")
    tracks = [{"strips": [_row_of(each, found) for each in track.strips]} for track in animation.played_tracks(data)]
    if data.action is not None:
        tracks.append({"strips": [_active_row(data, found)]})
    actions = [{"name": name, "curves": rows} for name, rows in found.rows.items()]
    return {"actions": actions, "tracks": tracks, "mixed": list(found.mixed.values())}


def numbers_of(description: dict[str, Any]) -> set[tuple[str, int]]:
    """Returns the paths and indices of the numbers that strips of a description set."""
    whole = {row["path"]: len(row["default"]) for row in description.get("mixed", ()) if row["mix"] == "QUATERNION"}
    rows = [(row["path"], row["index"]) for action in description.get("actions", ()) for row in action["curves"]]
    return {(path, each) for path, index in rows for each in (range(whole[path]) if path in whole else (index,))}


def state_of(ob: bpy.types.Object) -> Any:
    """Returns what is equal at two times if the strips that animate an object are; None if they cannot be read."""
    if not play(ob):
        return ()
    try:
        found = rows_of(ob)
    except curves.Refused:
        return None
    played = [
        (row["name"], [row | {"keys": row["keys"].tobytes()} for row in row["curves"]]) for row in found["actions"]
    ]
    return played, _plain(found["tracks"]), found["mixed"]


def _plain(rows: Any) -> Any:
    if isinstance(rows, dict):
        return {key: _plain(value) for key, value in rows.items()}
    return list(map(_plain, rows)) if isinstance(rows, list) else getattr(rows, "tolist", lambda: rows)()


def _row_of(strip: bpy.types.NlaStrip, found: Actions) -> dict[str, Any]:
    if strip.type not in ("CLIP", "TRANSITION", "META"):
        raise curves.Refused(f"the NLA strip {strip.name} is not covered: bake the strips into one action")
    if any(not each.mute for each in strip.modifiers):
        raise curves.Refused(
            f"the NLA strip {strip.name} has modifiers: remove them, or bake the strips into one action"
        )
    row = {name: getattr(strip, name) for name in _NUMBERS}
    for is_animated, name, key in (
        (strip.use_animated_influence, "influence", "influence_curve"),
        (strip.use_animated_time, "strip_time", "time_curve"),
    ):
        if is_animated:
            row[name] = getattr(strip, name)
            row.update((key, each) for each in _curves_of(strip, name))
    if strip.use_animated_time and strip.use_animated_time_cyclic:
        row["use_animated_time_cyclic"] = True
    if strip.action is not None and strip.type == "CLIP":
        row["action"] = found.name_of(strip.action, getattr(strip, "action_slot_handle", 0))
    if strip.type == "META":
        row["strips"] = [_row_of(each, found) for each in strip.strips]
    return row


def _curves_of(strip: bpy.types.NlaStrip, name: str) -> Iterator[dict[str, Any]]:
    """Yields the curve of a setting, if it has one."""
    for curve in curves.unmuted([each for each in strip.fcurves if each.data_path == name]):
        (row,) = curves.rows_of([curve])
        curves.complete(row, curve)
        if not len(row["keys"]):
            raise curves.Refused(f"the NLA strip {strip.name} has a setting whose curve has no keys: key it")
        del row["path"], row["index"]
        yield row


def _active_row(data: bpy.types.AnimData, found: Actions) -> dict[str, Any]:
    """Returns the active action as the strip that it is above all tracks, on the scene's frames."""
    action: Any = data.action
    row = {name: getattr(data, f"action_{name}") for name in _ACTIVE}
    own = animation.slot_curves(data.id_data)
    start, end = 0.0, 1.0
    if row["extrapolation"] != "HOLD":
        if any(len(each.modifiers) for each in own):
            raise curves.Refused(f"curves of {action.name}, which ends below other strips, have modifiers: remove them")
        ranges = [curve.range() for curve in own if len(curve.keyframe_points)] or [(0.0, 1.0)]
        start, end = min(each[0] for each in ranges), max(each[1] for each in ranges)
    row |= {"frame_start": start, "frame_end": end if end > start else start + 1, "keeps_frames": True}
    row["mute"] = any(track.is_solo for track in data.nla_tracks)
    return row | {"action": found.name_of(action, getattr(data, "action_slot_handle", 0))}


def _mixed(ob: bpy.types.Object, path: str) -> dict[str, Any]:
    """Returns how strips mix a property, and what it is where none sets it."""
    value = ob.path_resolve(path)
    count = len(value) if hasattr(value, "__len__") and not isinstance(value, str) else 1
    name = path.rpartition(".")[2]
    if path.endswith('"]'):
        owner, name = custom_properties.owner_and_name(path)
        default = (ob.path_resolve(owner) if owner else ob).id_properties_ui(name).as_dict().get("default", 0)
    elif name in tables.CHANNELS:
        default = {"scale": [1.0] * 3, "rotation_quaternion": [1.0, 0.0, 0.0, 0.0]}.get(name, [0.0] * count)
    else:
        default = _default_of(ob.path_resolve(path.rpartition(".")[0]).bl_rna.properties[name])
    numbers = [float(each) for each in default] if isinstance(default, Iterable) else [float(default)] * count
    numbers = (numbers + [0.0] * count)[:count]
    mix = _MIXES.get(name, "ADD")
    if mix == "MULTIPLY":
        numbers = [each or 1.0 for each in numbers]
    return {"path": path, "mix": mix, "default": numbers}


def _default_of(setting: Any) -> Any:
    """Returns the default of one of Blender's own properties, that of a choice as its number."""
    if setting.type == "ENUM":
        return setting.enum_items[setting.default].value if setting.default in setting.enum_items else 0
    return list(setting.default_array) if getattr(setting, "is_array", False) else setting.default
