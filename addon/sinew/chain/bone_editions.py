"""Editions of the bones of armatures: a number for each version that an evaluated copy has had.

Blender copies an armature again after edits and while its bones are posed by hand. Most copies have the same bones, and
whatever was made from them holds.
"""

import itertools
import threading
from typing import Any

from ..blender import armatures, values
from ..host import bone_memory, marks
from ..plan import animated

MOST_KNOWN = 8  # per armature; another graph may still use an older one
MOST_COPIES = 1024

# key of an armature's data -> [(number, bytes, signature)] of the last editions of its bones, and of the last bytes
_known: dict[int, list[tuple[int, bytes, Any]]] = {}
# address of an evaluated armature's data -> (number of the edition that was read from it, whether it is in Edit Mode)
_copies: dict[int, tuple[int, bool]] = {}
_lock = threading.Lock()
_new_number = itertools.count(1)


def forget() -> None:
    """Discards all editions of bones."""
    with _lock:
        _known.clear()
        _copies.clear()


def of(armature: Any) -> tuple[int, int]:
    """Returns (key of the armature's data, a number that changes when the bones change) of an evaluated armature. Bones
    are compared only when Blender has copied the armature again, but not when only the frame changes."""
    data = armature.data
    key, address = values.key_of(data), data.as_pointer()
    with _lock:
        if marks.test_and_mark(data, "ARMATURE") and address in _copies:
            return key, _copies[address][0]
        animated.forget(data)
        if len(_copies) >= MOST_COPIES:
            _copies.clear()
        number = _number_of(armature, _known.setdefault(key, []))
        _copies[address] = number, data.is_editmode
        return key, number


def known(data: Any) -> int | None:
    """Returns the number of the edition of evaluated armature data, or None if it was not read since Blender has copied
    them."""
    return _copies.get(data.as_pointer(), (None,))[0] if marks.is_marked(data, "ARMATURE") else None


def is_last(address: int, number: int) -> bool:
    """Whether that edition was the last one read from the evaluated armature data at that address, and not in Edit
    Mode, in which bones do not deform."""
    return _copies.get(address) == (number, False)


def _number_of(armature: Any, known: list[tuple[int, bytes, Any]]) -> int:
    # With trouble, a plan leaves them to Blender.
    trouble = animated.why(armature.data, "ARMATURE", looks_at_sources=False).encode()
    found = bone_memory.read_bytes(armature.data) + trouble if bone_memory.can_read() else b""
    number = next((number for number, other, _signature in known if other == found), 0) if found else 0
    if not number:
        # Other bones, or other bytes that do not matter, such as which bones are selected.
        signature = [*armatures.bone_signature(armature), trouble]
        number = next((number for number, _other, other in known if other == signature), 0) or next(_new_number)
        known.append((number, found, signature))
        del known[:-MOST_KNOWN]
    return number
