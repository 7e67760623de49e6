"""Reads the bytes that tell what the drivers of a data-block set, and what they read."""

import ctypes
import functools
import hashlib
from typing import Any

from ..native import sinew_native
from . import contract, features, proof


def _region(kind: str, name: str, start: int = 0) -> tuple[int, int]:
    return start + contract.offset(kind, name), contract.size(kind, name)


@functools.cache
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


@functools.cache
def _variables() -> int:
    """Returns where a driver has the address of its first variable."""
    return contract.offset("ChannelDriver", "variables") + contract.offset("ListBase", "*first")


@functools.cache
def _drivers(is_whole: bool = False) -> Any:
    """Returns what is read of a driver's F-curve. is_whole: as above."""
    own = [_region("ChannelDriver", name) for name in ("type", "flag", "expression")]
    driver = sinew_native.host.Described(own, [], [], [(_variables(), _variable(is_whole))])
    place = contract.offset("FCurve", "*driver")
    return sinew_native.host.Described([], [contract.offset("FCurve", "*rna_path")], [(place, driver)], [])


def read(drivers: Any, is_whole: bool = False) -> bytes | None:
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
