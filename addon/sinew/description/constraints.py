"""Constraints as rows."""

import itertools
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from operator import attrgetter
from typing import Any

import bpy

from ..blender import dependencies
from . import curves, rna_paths, splines, tables, targets

WORLD, CUSTOM = 0, 5  # spaces, as Blender numbers them
LEAST_ALONG = 1e-6  # Blender takes less for the head
_SPACES = {1: "LOCAL", 2: "POSE", 3: "LOCAL_WITH_PARENT"}  # into which Object.convert_space converts
_of_target = attrgetter("target", "subtarget", "weight")


@cache
def reader_of(kind: str, struct: Any) -> Callable[[Any], dict[str, Any]]:
    """Returns a function that reads all settings of a constraint of that type."""
    properties = struct.bl_rna.properties
    names = [name for name in tables.constraint_settings()[kind] if name in properties]
    get = attrgetter(*names)
    choices = {
        name: {item.identifier: item.value for item in properties[name].enum_items}
        for name in names
        if properties[name].type == "ENUM"
    }
    lists = [name for name in names if getattr(properties[name], "is_array", False)]

    def read(constraint: Any) -> dict[str, Any]:
        settings = dict(zip(names, get(constraint), strict=True))
        for name, numbers in choices.items():
            settings[name] = numbers[settings[name]]
        for name in lists:
            value = settings[name]
            # A matrix is stored column after column.
            settings[name] = (
                [float(x) for column in value.transposed() for x in column] if len(value) == 4 else [*value]
            )
        return settings

    return read


def constraints_of(
    ob: bpy.types.Object, bones: Iterable[dict[str, Any]], found: targets.Targets
) -> Iterator[dict[str, Any]]:
    """Yields the constraints, bone after bone. What cannot be said is added to `found.refused`. bones: of the
    description."""
    known = tables.constraint_settings()
    for bone in itertools.compress(ob.pose.bones, [row["has_constraints"] for row in bones]):
        name = bone.name
        for constraint in dependencies.constraints_of(bone):
            try:
                if (kind := constraint.type) not in known:
                    title = constraint.bl_rna.properties["type"].enum_items[kind].name
                    raise curves.Refused(f"the type {title} is not covered")
                if not splines.is_passed_over(constraint):
                    yield row_of(name, constraint, kind, found)
                    continue
            except curves.Refused as reason:
                if not constraint.mute or is_animated(constraint, found):
                    found.refused.append(f'the constraint "{constraint.name}" of the bone "{name}": {reason}')
            found.without_row.add(rna_paths.normalised(constraint.path_from_id()))


def is_animated(constraint: bpy.types.Constraint, found: targets.Targets) -> bool:
    """Whether a curve or a driver may unmute it."""
    path = rna_paths.normalised(constraint.path_from_id())
    return any(f"{path}.{name}" in found.switches for name in rna_paths.SWITCHES)


def set_switches(settings: dict[str, Any], constraint: bpy.types.Constraint, found: targets.Targets) -> None:
    """Has that one of the two switches of a constraint alone count that is animated. Blender stores them as one. Raises
    Refused if both are."""
    if not found.switches:
        return
    path = rna_paths.normalised(constraint.path_from_id())
    animated = [name for name in rna_paths.SWITCHES if f"{path}.{name}" in found.switches]
    if len(animated) > 1:
        raise curves.Refused("both Enabled and Mute are animated: keep one of the two")
    if animated:
        settings |= {"mute": False, "enabled": True} | {animated[0]: settings[animated[0]]}


def row_of(bone: str, constraint: bpy.types.Constraint, kind: str, found: targets.Targets) -> dict[str, Any]:
    settings = reader_of(kind, type(constraint))(constraint)  # type: ignore[arg-type] # a type is hashable
    set_switches(settings, constraint, found)
    row: dict[str, Any] = {"bone": bone, "name": constraint.name, "type": kind, "settings": settings}
    if kind == "ARMATURE":
        if settings["use_bone_envelopes"]:
            raise curves.Refused("bone envelopes are not covered: turn them off")
        read = [_of_target(target) for target in constraint.targets]
        row["targets"] = [
            None if name and target and target.pose and name not in target.pose.bones else found.of(target, name)
            for target, name, _weight in read
        ]
        if any(target and "outside" in target for target in row["targets"]):
            raise curves.Refused("bones of another armature are not covered here")
        row["weights"] = [weight for _target, _bone_name, weight in read]
    elif kind == "SPLINE_IK":
        splines.check(constraint.target, [kind])
        row |= {"spline": found.spline(constraint.target, kind), "joints": [*constraint.joint_bindings]}
    elif kind == "FOLLOW_PATH":
        if splines.is_curve(constraint.target):
            splines.check(constraint.target, [kind])
            row["spline"] = found.spline(constraint.target, kind)
    elif hasattr(constraint, "target"):
        bone_name, space = getattr(constraint, "subtarget", ""), _SPACES.get(settings["target_space"])
        along = _along(constraint, bone_name, found) if "head_tail" in settings else 0
        reached = constraint.target
        if kind == "IK" and reached is not None and reached.type == "ARMATURE" and not bone_name:
            reached = None  # as for Blender, which passes IK without a target over
        target = found.of(reached, bone_name, ("WORLD", space) if space else None, along)
        if target and "outside" in target:
            if along:
                settings["head_tail"] = 0.0  # the matrix that is given is there
            if space:
                settings["target_space"] = WORLD  # the matrix that is given is in that space
            elif bone_name and settings["target_space"] not in (WORLD, CUSTOM):
                raise curves.Refused(
                    "the owner's orientation is not covered for another armature's bone: choose another space"
                )
        row["targets"] = [target]
    if kind == "IK":
        if reached == found.ob and constraint.subtarget not in found.bones and constraint.is_valid:
            raise curves.Refused(f"the bone {constraint.subtarget} that it follows is not there: choose another one")
        row["targets"].append(found.of(constraint.pole_target, constraint.pole_subtarget))
    if CUSTOM in (settings["owner_space"], settings["target_space"]):
        row["space"] = found.of(constraint.space_object, constraint.space_subtarget)
    if kind == "ACTION":
        row["action"] = list(action_channels(bone, constraint, found))
    return row


def _along(constraint: Any, bone: str, found: targets.Targets) -> float:
    """Returns how far from its head to its tail a constraint looks at a bone of another armature; 0 for others. Raises
    Refused."""
    if constraint.target in (None, found.ob) or not bone:
        return 0
    if rna_paths.normalised(f"{constraint.path_from_id()}.head_tail") in found.animated:
        raise curves.Refused("an animated place along a bone of another armature is not covered")
    if constraint.head_tail < LEAST_ALONG:
        return 0
    if constraint.use_bbone_shape:
        raise curves.Refused("a place along a B-bone of another armature is not covered: turn Follow B-Bone off")
    return float(constraint.head_tail)


def action_channels(bone: str, constraint: bpy.types.Constraint, found: targets.Targets) -> Iterator[dict[str, Any]]:
    if constraint.use_bone_object_action:
        raise curves.Refused("Object Action is not covered: turn it off")
    if constraint.action is None:
        return
    own = found.channels_of(constraint.action, getattr(constraint, "action_slot_handle", 0))
    for name, index, curve, row in own.get(bone, ()):
        if name in tables.CHANNELS:
            yield {"channel": tables.CHANNELS[name] + index, **curves.complete(row, curve)}
