"""Reads the variables of many drivers in one step."""

import functools
from collections.abc import Sequence
from operator import attrgetter
from typing import Any

import bpy

from ..native import sinew_native
from . import contract, features, proof

# Of a target, by what Blender's API calls it: the member, and how it is read.
_OF_TARGET = {
    "id": ("*id", "P"),
    "data_path": ("*rna_path", "s"),
    "bone_target": ("pchan_name", "s"),
    "transform_type": ("transChan", "h"),
    "transform_space": ("flag", "h"),
    "rotation_mode": ("rotation_mode", "b"),
}
_OF_TWO = "LOC_DIFF", "ROTATION_DIFF"
_get = attrgetter(*_OF_TARGET)

Target = tuple[bpy.types.ID | None, str, str, str, str, str]  # in the same order
Variable = tuple[str, str, list[Target]]  # name, type


@functools.cache
def _layout() -> Any:
    """Returns what is read of a driver's F-curve."""

    def of(kind: str, *names: str) -> list[int]:
        return [contract.offset(kind, name) for name in names]

    fields = [(of("DriverVar", "name"), "s"), (of("DriverVar", "type"), "b")]
    first, stride = contract.offset("DriverVar", "targets"), contract.struct_size("DriverTarget")
    for target in (first, first + stride):
        for member, kind in _OF_TARGET.values():
            path = [target + contract.offset("DriverTarget", member)]
            fields.append((path + [0] * (member == "*rna_path"), kind))
    variables = contract.offset("ChannelDriver", "variables") + contract.offset("ListBase", "*first")
    path = [contract.offset("FCurve", "*driver"), variables]
    return sinew_native.host.StructValues([(path, sinew_native.host.StructValues(fields))])


@functools.cache
def _choices(kind: Any, name: str) -> dict[int, str]:
    """Returns the choices of a property by number."""
    return {item.value: item.identifier for item in kind.bl_rna.properties[name].enum_items}


@functools.cache
def _chosen(channel: int, space: int, mode: int) -> tuple[str, str, str]:
    """Returns what a target has chosen. space: with other bits."""
    names = "transform_type", "transform_space", "rotation_mode"
    channels, spaces, modes = (_choices(bpy.types.DriverTarget, name) for name in names)
    bits = functools.reduce(int.__or__, spaces)
    return channels.get(channel, ""), spaces.get(space & bits, ""), modes.get(mode, "")


def forget() -> None:
    """Discards the layout. For tests."""
    _layout.cache_clear()


def read(drivers: Sequence[Any]) -> list[list[Variable]]:
    """Returns the variables of each driver's F-curve."""
    if contract.has(features.VARIABLES):
        found = _stored(drivers)
        if not any(found) or not proof.is_due("variables"):
            return found
        if found == (shown := _shown(drivers)):
            proof.give("variables")
            return found
        contract.distrust(features.VARIABLES, "the variables of drivers are not where they were")
        return shown
    return _shown(drivers)


def _shown(drivers: Sequence[Any]) -> list[list[Variable]]:
    own = (curve.driver.variables for curve in drivers)
    return [[(each.name, each.type, [_get(target) for target in each.targets]) for each in some] for some in own]


def _stored(drivers: Sequence[Any]) -> list[list[Variable]]:
    blocks: dict[int, bpy.types.ID | None] = {0: None}
    kinds, found = _choices(bpy.types.DriverVariable, "type"), []
    for curve, (variables,) in zip(drivers, _layout().of([curve.as_pointer() for curve in drivers])):
        own: list[Variable] = []
        for name, of_kind, at, path, bone, channel, space, mode, *others in variables:
            if at not in blocks:
                blocks[at] = curve.driver.variables[len(own)].targets[0].id
            targets: list[Target] = [(blocks[at], path or "", bone, *_chosen(channel, space, mode))]
            if (kind := kinds.get(of_kind, "")) in _OF_TWO:
                at, path, bone, *choices = others
                if at not in blocks:
                    blocks[at] = curve.driver.variables[len(own)].targets[1].id
                targets.append((blocks[at], path or "", bone, *_chosen(*choices)))
            own.append((name, kind, targets))
        found.append(own)
    return found
