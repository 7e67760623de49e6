"""The actions of a rig: which there are, and having one of them play at a time."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

import bpy
import numpy as np

from ..blender import animation
from ..description import custom_properties, rna_paths
from ..host import keyframes

AT_REST = {
    "location": (0.0, 0.0, 0.0),
    "rotation_quaternion": (1.0, 0.0, 0.0, 0.0),
    "rotation_euler": (0.0, 0.0, 0.0),
    "rotation_axis_angle": (0.0, 0.0, 1.0, 0.0),
    "scale": (1.0, 1.0, 1.0),
}


@dataclass(frozen=True)
class RigAction:
    """An action that moves a rig's bones."""

    action: bpy.types.Action
    slot: Any  # of the action; None before Blender 4.4
    curves: tuple[bpy.types.FCurve, ...]

    @property
    def played(self) -> tuple[bpy.types.Action, int | None]:
        """The action, and the number of the slot."""
        return self.action, getattr(self.slot, "handle", None)

    def frames(self, step: int) -> list[int]:
        """Returns the frames of its range, every so many of them, and always the last."""
        first, last = (float(frame) for frame in self.action.frame_range)
        found = list(range(math.floor(first), math.ceil(last) + 1, step))
        return found if found[-1] >= last else [*found, math.ceil(last)]


def find(rig: bpy.types.Object, pattern: str = "*") -> list[RigAction]:
    """Returns the actions that key bones of a rig, by name, whose names match a pattern such as "walk*". Slots that
    other armatures play and this one does not are left out. Raises ValueError if there are none."""
    own: dict[Any, None] = {}  # action and number of the slot
    others: dict[Any, None] = {}
    for ob in bpy.data.objects:
        if ob.type == "ARMATURE":
            played = [(each.action, getattr(each.slot, "handle", each.slot)) for each in keyframes.actions_of(ob)]
            (own if ob == rig else others).update(dict.fromkeys(played))
    found = []
    for action in bpy.data.actions:
        if fnmatchcase(action.name, pattern):
            able = [each for each in _of(rig, action) if each.played in own or each.played not in others]
            found += sorted(able, key=lambda each: each.played not in own)[:1]
    if not found:
        there = ", ".join(dict.fromkeys(action.name for action, _slot in own)) or "none"
        raise ValueError(f"no action named {pattern} moves bones of {rig.name}; those that it plays: {there}")
    return found


def _of(rig: bpy.types.Object, action: bpy.types.Action) -> list[RigAction]:
    """Returns an action with each slot that moves bones of a rig, that of the rig's name first."""
    slots: Sequence[Any] = getattr(action, "slots", (None,))
    slots = [slot for slot in slots if slot is None or slot.target_id_type in ("OBJECT", "UNSPECIFIED")]
    able = []
    for slot in slots:
        curves = animation.curves_in(action, slot)
        if any((bone := rna_paths.BONE.match(curve.data_path)) and _has(rig, bone[1]) for curve in curves):
            able.append(RigAction(action, slot, tuple(curves)))
    return sorted(able, key=lambda each: each.slot is None or each.slot.identifier != f"OB{rig.name}")


def _has(rig: bpy.types.Object, escaped: str) -> bool:
    return bpy.utils.unescape_identifier(escaped) in rig.pose.bones


def assign(ob: bpy.types.Object, action: bpy.types.Action | None, slot: Any) -> None:
    """Has an object, which has animation data, play a slot of an action. slot: None: the one that Blender finds."""
    ob.animation_data.action = action
    if slot is not None:
        ob.animation_data.action_slot = slot


@contextmanager
def playing_each(rig: bpy.types.Object, own: Sequence[RigAction]) -> Iterator[Any]:
    """Inside the `with` block, the rig plays what the function that it returns is given, a RigAction, and nothing else:
    no NLA track. Bones are at rest where it does not key them, and other properties as they were before. Afterwards all
    is as before. Raises ValueError."""
    if rig.library is not None:
        raise ValueError(f"{rig.name} is linked, so its action cannot be changed: make a library override of it")
    is_new = rig.animation_data is None
    data = rig.animation_data or rig.animation_data_create()
    if data.use_tweak_mode:
        raise ValueError(f"a strip of {rig.name} is in tweak mode: leave it first, by Tab in the NLA editor")
    paths = {curve.data_path for each in own for curve in each.curves if not _is_of_pose(curve.data_path)}
    kept = {path: value for path in sorted(paths) if (value := _value(rig, path)) is not None}
    pose = {name: _read(rig, name, len(rest)) for name, rest in AT_REST.items()}
    names = ("use_nla", "action_blend_type", "action_influence", "action_extrapolation")
    settings = {name: getattr(data, name) for name in names}
    action, slot = data.action, getattr(data, "action_slot", None)

    def play(chosen: RigAction) -> None:
        data.action = None
        for path, value in kept.items():
            _set(rig, path, value)
        for name, rest in AT_REST.items():
            rig.pose.bones.foreach_set(name, np.tile(np.array(rest, np.float32), len(rig.pose.bones)))
        assign(rig, chosen.action, chosen.slot)
        rig.update_tag()  # or Blender would not see custom properties

    try:
        data.use_nla, data.action_blend_type = False, "REPLACE"
        data.action_influence, data.action_extrapolation = 1.0, "HOLD"
        yield play
    finally:
        data.action = None
        for path, value in kept.items():
            _set(rig, path, value)
        for name, numbers in pose.items():
            rig.pose.bones.foreach_set(name, numbers)
        assign(rig, action, slot)
        for name, setting in settings.items():
            setattr(data, name, setting)
        if is_new:
            rig.animation_data_clear()


def _is_of_pose(path: str) -> bool:
    return path.startswith("pose.bones[") and path.rpartition(".")[2] in AT_REST


def _read(rig: bpy.types.Object, name: str, size: int) -> np.ndarray:
    numbers = np.empty(size * len(rig.pose.bones), np.float32)
    rig.pose.bones.foreach_get(name, numbers)
    return numbers


def _value(rig: bpy.types.Object, path: str) -> Any:
    """Returns a copy of the value at a path, None if there is none."""
    try:
        value = rig.path_resolve(path)
    except ValueError:
        return None
    return tuple(value) if hasattr(value, "__len__") and not isinstance(value, (str, set)) else value


def _set(rig: bpy.types.Object, path: str, value: Any) -> None:
    if path.endswith('"]'):
        owner, name = custom_properties.owner_and_name(path)
        (rig.path_resolve(owner) if owner else rig)[name] = value
        return
    owner, _, name = path.rpartition(".")
    try:
        setattr(rig.path_resolve(owner) if owner else rig, name, value)
    except AttributeError:  # it is read-only
        return
