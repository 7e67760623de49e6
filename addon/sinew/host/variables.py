"""Reads the variables of many drivers in one step."""

import functools
from collections.abc import Sequence
from operator import attrgetter
from typing import Any

import bpy

from ..native import sinew_native
from . import contract, features, proof

_CHOICES = "transform_type", "transform_space", "rotation_mode"
_OF_TWO = "LOC_DIFF", "ROTATION_DIFF"
_get = attrgetter("id", "data_path", "bone_target", *_CHOICES)
_OF_TARGET = (
    ("*id", "P"),
    ("*rna_path", "s"),
    ("pchan_name", "s"),
    ("transChan", "h"),
    ("flag", "h"),
    ("rotation_mode", "b"),
)

Target = tuple[bpy.types.ID | None, str, str, str, str, str]  # as above
Variables = list[tuple[str, str, list[Target]]]  # name, type


@functools.cache
def _layout() -> Any:
    """Returns what is read of a driver's F-curve: of variables, with the first target."""
    first = contract.offset("DriverVar", "targets")
    members = [([contract.offset("DriverVar", name)], kind) for name, kind in (("name", "s"), ("type", "b"))]
    for name, kind in _OF_TARGET:
        members.append(([first + contract.offset("DriverTarget", name)] + [0] * (name == "*rna_path"), kind))
    variables = contract.offset("ChannelDriver", "variables") + contract.offset("ListBase", "*first")
    of_curve = [contract.offset("FCurve", "*driver"), variables], sinew_native.host.StructValues(members)
    return sinew_native.host.StructValues([of_curve])


@functools.cache
def _chosen(kind: Any, names: Sequence[str], *numbers: int) -> list[str]:
    """Returns the choices that properties have by numbers, which may have other bits besides."""
    tables = [{item.value: item.identifier for item in kind.bl_rna.properties[name].enum_items} for name in names]
    return [own.get(number & functools.reduce(int.__or__, own), "") for own, number in zip(tables, numbers)]


def read(drivers: Sequence[Any]) -> list[Variables]:
    """Returns the variables of each driver's F-curve."""
    if not contract.has(features.VARIABLES):
        return _shown(drivers)
    found = _stored(drivers)
    if any(found) and proof.is_due("variables"):
        if found != _shown(drivers):
            contract.distrust(features.VARIABLES, "the variables of drivers are not where they were")
            return _shown(drivers)
        proof.give("variables")
    return found


def _shown(drivers: Sequence[Any]) -> list[Variables]:
    own = (curve.driver.variables for curve in drivers)
    return [[(each.name, each.type, [_get(target) for target in each.targets]) for each in some] for some in own]


def _stored(drivers: Sequence[Any]) -> list[Variables]:
    of_variable, of_target = bpy.types.DriverVariable, bpy.types.DriverTarget  # to look these up takes long
    blocks: dict[int, bpy.types.ID | None] = {0: None}
    found: list[Variables] = [[] for _curve in drivers]
    for curve, own, (variables,) in zip(drivers, found, _layout().of([each.as_pointer() for each in drivers])):
        for name, number, at, path, bone, *choices in variables:
            (kind,) = _chosen(of_variable, ("type",), number)
            stored: Any = curve.driver.variables[len(own)].targets if at not in blocks or kind in _OF_TWO else ()
            if at not in blocks:
                blocks[at] = stored[0].id
            targets = [(blocks[at], path or "", bone, *_chosen(of_target, _CHOICES, *choices))]
            targets += [_get(each) for each in stored[1:]]
            own.append((name, kind, targets))
    return found
