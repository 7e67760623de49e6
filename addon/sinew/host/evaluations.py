"""Tells whether Blender is evaluating an object."""

import ctypes
from typing import Any

from . import contract

_has_been_set = False  # the flags of any object


def is_running(ob: Any) -> bool:
    """Whether Blender is evaluating the evaluated object, or is about to: it has been tagged, or a handler runs that
    was called because of an evaluation.

    Blender sets flags for what it evaluates in an object, and clears them afterwards. True as long as they have never
    been seen set, because then they do not have this meaning.
    """
    global _has_been_set
    if contract.is_broken():
        return True
    if ctypes.c_uint32.from_address(ob.as_pointer() + contract.offset("ID", "recalc")).value:
        _has_been_set = True
        return True
    return not _has_been_set


def is_tagged(block: Any) -> bool:
    """Whether anything of an evaluated data-block is tagged to be evaluated."""
    return bool(ctypes.c_uint32.from_address(contract.region(block, "ID", "recalc")[0]).value)
