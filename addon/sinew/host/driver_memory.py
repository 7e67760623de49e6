"""Reads drivers by address: the bytes that tell what the drivers of a data-block set, and what they read; and the
variables of many drivers in one step."""

import ctypes
import functools
import hashlib
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


def _region(kind: str, name: str, start: int = 0) -> tuple[int, int]:
    return start + contract.offset(kind, name), contract.size(kind, name)


@contract.kept
def _variable(is_whole: bool = False) -> Any:
    """Returns what is read of a driver's variable. is_whole: with all settings of its targets."""
    first, stride = contract.offset("DriverVar", "targets"), contract.struct_size("DriverTarget")
    targets = range(first, first + contract.size("DriverVar", "targets"), stride)
    own = [_region("DriverVar", name) for name in ("name", "type")]
    own += [_region("DriverTarget", "*id", target) for target in targets]
    own.append(_region("DriverTarget", "pchan_name", first))  # of variables of one bone
    if is_whole:
        own += [(at + offset, size) for at in targets for offset, size in contract.plain_regions("DriverTarget")]
    path = contract.offset("DriverTarget", "*rna_path")
    return sinew_native.host.Described(own, [target + path for target in targets], [], [])


@contract.kept
def _variables() -> int:
    """Returns where a driver has the address of its first variable."""
    return contract.offset("ChannelDriver", "variables") + contract.offset("ListBase", "*first")


@contract.kept
def _drivers(is_whole: bool = False) -> Any:
    """Returns what is read of a driver's F-curve. is_whole: as above."""
    own = [_region("ChannelDriver", name) for name in ("type", "flag", "expression")]
    driver = sinew_native.host.Described(own, [], [], [(_variables(), _variable(is_whole))])
    place = contract.offset("FCurve", "*driver")
    return sinew_native.host.Described([], [contract.offset("FCurve", "*rna_path")], [(place, driver)], [])


def read_bytes(drivers: Any, is_whole: bool = False) -> bytes | None:
    """Returns bytes that are equal for two collections of drivers if these set the same properties by the same types
    and expressions, of variables with the same names and types that read the same properties of the same data-blocks.
    is_whole: and if all settings of the variables' targets are equal. None if this Blender's drivers cannot be read."""
    if not len(drivers):
        return b""
    if not contract.has(features.DRIVERS):
        return None
    found = _drivers(is_whole).bytes_of_list(drivers[0].as_pointer())
    if proof.is_due("drivers"):
        if not found.startswith(b"+" + drivers[0].data_path.encode() + b"\0"):
            contract.distrust(features.DRIVERS, "a driver's path is not where it was")
            return None
        proof.give("drivers")
    return found


def _has_bones_as_said(driver: Any) -> bool:
    """Whether the bone of a variable is what the API says, if it was not compared yet."""
    if not proof.is_due("bones of drivers"):
        return True
    target: Any = next((each.targets[0] for each in driver.variables if each.targets[0].bone_target), None)
    if target is not None:
        at, size = contract.region(target, "DriverTarget", "pchan_name")
        if ctypes.string_at(at, size).partition(b"\0")[0].decode() != target.bone_target:
            contract.distrust(features.DRIVERS, "the bone of a driver's variable is not where it was")
            return False
        proof.give("bones of drivers")
    return True


def digest_of_variables(driver: Any) -> bytes | None:
    """Returns bytes that are equal for the same driver at two times if its variables had the same names and types, and
    read the same properties, or by their first target the same bones, of data-blocks at the same addresses. None if
    they cannot be read."""
    if proof.is_due("drivers") or not contract.has(features.DRIVERS) or not _has_bones_as_said(driver):
        return None
    found = _variable().bytes_of_list(contract.address_at(driver.as_pointer() + _variables()))
    return hashlib.blake2b(found, digest_size=16).digest()


@contract.kept
def _values() -> Any:
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


def read_variables(drivers: Sequence[Any]) -> list[Variables]:
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
    for curve, own, (variables,) in zip(drivers, found, _values().of([each.as_pointer() for each in drivers])):
        for name, number, at, path, bone, *choices in variables:
            (kind,) = _chosen(of_variable, ("type",), number)
            stored: Any = curve.driver.variables[len(own)].targets if at not in blocks or kind in _OF_TWO else ()
            if at not in blocks:
                blocks[at] = stored[0].id
            targets = [(blocks[at], path or "", bone, *_chosen(of_target, _CHOICES, *choices))]
            targets += [_get(each) for each in stored[1:]]
            own.append((name, kind, targets))
    return found
