"""Marks evaluated data-blocks of any kind, to find out whether Blender has copied one again.

Blender counts users in originals only: it sets the number in an evaluated copy to 0 whenever it makes that copy, and
does not touch it afterwards. So a number that is written there stays as long as the copy does. What animation and
drivers set, they set in place. So only time has changed a copy that still has its mark."""

import ctypes
from typing import Any

from . import contract, features, proof

_MARK = 0x53


def _users(block: Any) -> ctypes.c_int32:
    return ctypes.c_int32.from_address(contract.region(block, "ID", "us")[0])


def mark(copy: Any) -> None:
    """Marks an evaluated data-block. Raises contract.Broken."""
    if proof.is_due("users"):
        original = copy.original
        if _users(original).value != original.users or _users(copy).value not in (0, _MARK):
            raise contract.distrust(features.FREEZING, "the number of users is not where it was")
        proof.give("users")
    _users(copy).value = _MARK


def is_marked(copy: Any) -> bool:
    """Whether an evaluated data-block is the copy that was marked."""
    return _users(copy).value == _MARK
