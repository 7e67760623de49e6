"""Reads the bytes that tell what the drivers of a data-block set, and what they read."""

import functools
from typing import Any

from ..native import sinew_native
from . import contract, features, proof


@functools.cache
def _drivers() -> Any:
    """Returns what is read of a driver's F-curve."""

    def at(kind: str, *names: str) -> list[int]:
        return [contract.offset(kind, name) for name in names]

    def plain(kind: str, *names: str) -> list[tuple[int, int]]:
        return [(contract.offset(kind, name), contract.size(kind, name)) for name in names]

    first, stride = contract.offset("DriverVar", "targets"), contract.struct_size("DriverTarget")
    targets = range(first, first + contract.size("DriverVar", "targets"), stride)
    block, size = *at("DriverTarget", "*id"), contract.size("DriverTarget", "*id")
    path = contract.offset("DriverTarget", "*rna_path")
    variable = sinew_native.host.Described(
        plain("DriverVar", "name", "type") + [(target + block, size) for target in targets],
        [target + path for target in targets],
        [],
        [],
    )
    variables = contract.offset("ChannelDriver", "variables") + contract.offset("ListBase", "*first")
    driver = sinew_native.host.Described(
        plain("ChannelDriver", "type", "flag", "expression"), [], [], [(variables, variable)]
    )
    return sinew_native.host.Described(
        [], at("FCurve", "*rna_path"), [(contract.offset("FCurve", "*driver"), driver)], []
    )


def read(drivers: Any) -> bytes | None:
    """Returns bytes that are equal for two collections of drivers if these set the same properties by the same types
    and expressions, of variables with the same names and types that read the same properties of the same data-blocks.
    None if this Blender's drivers cannot be read."""
    if not len(drivers):
        return b""
    if not contract.has(features.DRIVERS):
        return None
    found = _drivers().bytes_of_list(drivers[0].as_pointer())
    if proof.is_due("drivers"):
        if not found.startswith(b"+" + drivers[0].data_path.encode() + b"\0"):
            contract.distrust(features.DRIVERS, "a driver's path is not where it was")
            return None
        proof.give("drivers")
    return found
