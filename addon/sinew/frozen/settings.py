"""All that the pose of an armature depends on besides the keyframes of its own action: a digest, to find out whether an
edit has changed any of it. And the keyframes themselves, as stored_keys compares them."""

from collections.abc import Iterable
from typing import Any

import bpy
import numpy as np

from ..blender import animation, values
from ..host import keyframes
from . import stored_keys

_POSE = 'pose.bones["'
_CHANNELS = (
    *("location", "rotation_euler", "rotation_quaternion", "rotation_axis_angle", "scale", "bbone_rollin"),
    *("bbone_rollout", "bbone_curveinx", "bbone_curveinz", "bbone_curveoutx", "bbone_curveoutz", "bbone_easein"),
    *("bbone_easeout", "bbone_scalein", "bbone_scaleout"),
)
_NUMBERS = {"FLOAT": np.float32, "INT": np.int32, "BOOLEAN": np.bool_}
_OF_REST = {("Bone", "matrix_local"), ("Bone", "length")}  # read-only, but not computed in each frame
# Of no account for the pose, or computed from the rest.
_SKIPPED = ("select", "hide", "show_", "is_", "custom_shape", "use_custom_shape", "bone_group", "color", "lock_")


def curves_of(rig: Any) -> dict[Any, stored_keys.Curve]:
    """Returns the F-curves of an original object's action and NLA strips, by their owner, path and index. Raises
    contract.Broken."""
    data = rig.animation_data
    if data is None:
        return {}
    strips = [strip for track in data.nla_tracks for strip in track.strips]
    actions = dict.fromkeys([data.action, *(strip.action for strip in strips)])
    actions.pop(None, None)
    found = {}
    for action in actions:
        for number, curve in enumerate(animation.action_curves(action)):
            frames, keys = keyframes.read(curve)
            group = curve.group
            found[values.key_of(action), number, curve.data_path, curve.array_index] = stored_keys.Curve(
                frames,
                keys,
                not len(curve.modifiers) and not len(curve.sampled_points) and not strips,
                curve.extrapolation == "CONSTANT",
                (
                    curve.extrapolation,
                    curve.mute,
                    group.mute if group is not None else False,
                    curve.is_valid,
                    *map(_plain, curve.modifiers),
                ),
            )
    return found


def has_samples(rig: Any) -> bool:
    """Whether an F-curve has samples in place of keyframes, whose edits cannot be compared."""
    return any(len(curve.sampled_points) for curve in animation.keyed_curves(rig))


def has_other_keys(rig: Any) -> bool:
    """Whether keyframes set anything besides the channels of bones, such as custom properties."""
    ends = tuple(f'"].{name}' for name in _CHANNELS)
    return any(
        not (
            curve.data_path.startswith(_POSE)
            and curve.data_path.endswith(ends)
            and "constraints[" not in curve.data_path
        )
        for curve in animation.keyed_curves(rig)
    )


def digest(rig: Any, outside: Iterable[Any]) -> int:
    """Returns a number that changes if anything changes on which the pose of an original armature object depends,
    except for keyframes and what keyframes and drivers set. outside: other objects on which it depends."""
    animated = animation.animated_paths(rig)
    parts: list[Any] = [
        _structs(rig.pose.bones, "PoseBone", _animated_of(animated, rig)),
        _structs(rig.data.bones, "Bone", {}),
        [_own_properties(bone, animated) for bone in rig.pose.bones if bone.keys()],
        [
            _plain(constraint, animated, f'{_path_of(bone)}.constraints["{_escaped(constraint.name)}"]')
            for bone in rig.pose.bones
            for constraint in bone.constraints
        ],
        _own_properties(rig, animated),
        _own_properties(rig.data, animation.animated_paths(rig.data)),
        [_driver(curve) for block in (rig, rig.data) for curve in animation.drivers_of(block)],
        _animation(rig),
        [tuple(map(tuple, each.matrix_world)) for each in (rig, *outside)],
        rig.data.pose_position,
        [(scene.render.frame_map_old, scene.render.frame_map_new) for scene in bpy.data.scenes],
        [bone.name for bone in rig.pose.bones],
        [bone.parent.name if bone.parent else "" for bone in rig.data.bones],
    ]
    return hash(repr(parts))


_escaped = bpy.utils.escape_identifier


def _path_of(bone: Any) -> str:
    return f'{_POSE}{_escaped(bone.name)}"]'


def _animated_of(animated: Iterable[str], rig: Any) -> dict[str, list[int]]:
    """Returns {name of a bone's property: numbers of the bones for which it is animated}."""
    numbers = {_escaped(bone.name): number for number, bone in enumerate(rig.pose.bones)}
    found: dict[str, list[int]] = {}
    for path in animated:
        name, separator, member = path.removeprefix(_POSE).rpartition('"].')
        if path.startswith(_POSE) and separator and name in numbers:
            found.setdefault(member, []).append(numbers[name])
    return found


def _structs(structs: Any, kind: str, animated: dict[str, list[int]]) -> list[Any]:
    """Returns the settings of all bones, property by property."""
    found: list[Any] = []
    for member in getattr(bpy.types, kind).bl_rna.properties:
        name = member.identifier
        if name.startswith(_SKIPPED) or member.is_readonly and (kind, name) not in _OF_REST:
            continue
        if kind == "PoseBone" and name.startswith("matrix"):
            continue  # follows from location, rotation and scale
        if member.type in _NUMBERS:
            width = max(member.array_length, 1)
            numbers = np.empty(len(structs) * width, _NUMBERS[member.type])
            structs.foreach_get(name, numbers)
            numbers.reshape(len(structs), width)[animated.get(name, [])] = 0
            found.append((name, numbers.tobytes()))
        elif member.type in {"ENUM", "STRING"}:
            skipped = set(animated.get(name, ()))
            found.append((name, [None if i in skipped else getattr(each, name) for i, each in enumerate(structs)]))
    return found


def _own_properties(block: Any, animated: Iterable[str]) -> list[Any]:
    """Returns the custom properties that are not animated."""
    start = _path_of(block) if isinstance(block, bpy.types.PoseBone) else ""
    return [
        (name, _value(value))
        for name, value in block.items()
        if f'{start}["{_escaped(name)}"]' not in animated
        and (isinstance(value, (int, float, str)) or hasattr(value, "to_list"))
    ]


def _value(value: Any) -> Any:
    return value.to_list() if hasattr(value, "to_list") else value


def _plain(struct: Any, animated: Iterable[str] = (), path: str = "") -> list[Any]:
    """Returns the settings of a struct, such as a constraint."""
    found: list[Any] = [struct.bl_rna.identifier]
    for member in struct.bl_rna.properties:
        name = member.identifier
        if member.is_readonly or name.startswith(_SKIPPED) or name == "active" or f"{path}.{name}" in animated:
            continue
        value = getattr(struct, name)
        if member.type == "POINTER":
            found.append((name, values.key_of(value) if isinstance(value, bpy.types.ID) else None))
        elif member.type in {"FLOAT", "INT", "BOOLEAN"} and member.is_array:
            found.append((name, str(value) if member.subtype == "MATRIX" else tuple(value)))
        elif member.type != "COLLECTION":
            found.append((name, value))
    targets = getattr(struct, "targets", None)
    return [*found, *([_plain(target) for target in targets] if targets is not None else ())]


def _driver(curve: Any) -> list[Any]:
    driver = curve.driver
    variables = [
        (variable.name, variable.type, [_plain(target) for target in variable.targets]) for variable in driver.variables
    ]
    keys = keyframes.read(curve)[1].tobytes()
    modifiers = list(map(_plain, curve.modifiers))
    return [curve.data_path, curve.array_index, curve.mute, driver.type, driver.expression, variables, keys, modifiers]


def _animation(rig: Any) -> list[Any]:
    data = rig.animation_data
    if data is None:
        return []
    strips = [_plain(strip) for track in data.nla_tracks for strip in track.strips]
    return [_plain(data), [_plain(track) for track in data.nla_tracks], strips]
