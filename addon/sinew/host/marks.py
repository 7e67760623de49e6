"""Sets and reads marks in evaluated data-blocks, to find out whether Blender has copied one again since it was seen.

Of some kinds it is a byte that Blender does not use. A mark is lost when Blender copies the block again, so a copy
without one has been edited.

Of any kind it is the number of users. Blender counts users in originals only: it sets the number in an evaluated copy
to 0 whenever it makes that copy, and does not touch it afterwards. So a number that is written there stays as long as
the copy does. What animation and drivers set, they set in place. So only time has changed a copy that still has its
mark.
"""

import ctypes
from typing import Any

from . import contract, features, members, proof

_SEEN = 0x53  # the value of a mark
_STRUCT_OF = {"OBJECT": "Object", "MESH": "Mesh", "KEY": "Key", "ARMATURE": "bArmature", "ACTION": "bAction"}


def mark_region(block: Any, kind: str) -> tuple[int, int]:
    """Returns the address of a data-block's mark and its size in bytes. kind: one of _STRUCT_OF. Raises
    contract.Broken if there is no room for a mark."""
    return block.as_pointer() + contract.unused_byte(_STRUCT_OF[kind]), 1


def has_room(kind: str) -> bool:
    """Whether data-blocks of a kind can be marked. Otherwise all count as never seen."""
    return contract.holds(_STRUCT_OF[kind], members.UNUSED)


def _mark(block: Any, kind: str) -> ctypes.c_uint8:
    return ctypes.c_uint8.from_address(mark_region(block, kind)[0])


def test_and_mark(block: Any, kind: str, original: Any = None) -> bool:
    """Whether an evaluated data-block is the copy that was seen last; marks it as seen. The mark is lost when Blender
    copies the block again, which it does after an edit.

    An original has no mark, unless it was made from an evaluated copy (`evaluated.data.copy()`) or loaded from a file.
    Then all its copies would be marked from the beginning, so its mark is cleared. original: that of a result of
    modifiers, which does not know it."""
    if not has_room(kind):
        return False
    byte, of_original = _mark(block, kind), _mark(original or block.original, kind)
    seen = byte.value == _SEEN and of_original.value == 0
    of_original.value = 0
    byte.value = _SEEN
    return seen


def is_marked(block: Any, kind: str) -> bool:
    return has_room(kind) and _mark(block, kind).value == _SEEN


def clear_mark(block: Any, kind: str) -> None:
    if has_room(kind):
        _mark(block, kind).value = 0


def _users(block: Any) -> ctypes.c_int32:
    return ctypes.c_int32.from_address(contract.region(block, "ID", "us")[0])


def mark_copy(copy: Any) -> None:
    """Marks an evaluated data-block. Raises contract.Broken."""
    if proof.is_due("users"):
        original = copy.original
        if _users(original).value != original.users or _users(copy).value not in (0, _SEEN):
            raise contract.distrust(features.PLAYING, "the number of users is not where it was")
        proof.give("users")
    _users(copy).value = _SEEN


def is_marked_copy(copy: Any) -> bool:
    """Whether an evaluated data-block is the copy that was marked."""
    return _users(copy).value == _SEEN
