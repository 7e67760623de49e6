"""Sets what animation sets of a constraint, as animation does: Blender does not take it for an edit."""

import ctypes
from typing import Any

from . import contract, features, proof

_MUTED = 512  # a bit of a constraint's flags


def can_set() -> bool:
    """Whether this Blender's constraints can be set."""
    return contract.has(features.CONSTRAINTS)


def set_influence(constraint: Any, value: float) -> None:
    """Sets the influence of a constraint. Raises contract.Broken."""
    place = ctypes.c_float.from_address(_address(constraint, "enforce"))
    place.value = value


def set_mute(constraint: Any, value: float) -> None:
    """Mutes a constraint, or lets Blender evaluate it. Raises contract.Broken."""
    flags = ctypes.c_int16.from_address(_address(constraint, "flag"))
    flags.value = flags.value & ~_MUTED | _MUTED * bool(value)


def set_enabled(constraint: Any, value: float) -> None:
    """Lets Blender evaluate a constraint, or mutes it. Raises contract.Broken."""
    set_mute(constraint, not value)


SETTERS = {"influence": set_influence, "mute": set_mute, "enabled": set_enabled}


def _address(constraint: Any, name: str) -> int:
    address = constraint.as_pointer()
    if proof.is_due("constraints"):
        influence = ctypes.c_float.from_address(address + contract.offset("bConstraint", "enforce")).value
        flags = ctypes.c_int16.from_address(address + contract.offset("bConstraint", "flag")).value
        is_same = influence == constraint.influence and bool(flags & _MUTED) == constraint.mute
        proof.give("constraints", is_same, "the influence of a constraint is not where it was", features.CONSTRAINTS)
    return address + contract.offset("bConstraint", name)
