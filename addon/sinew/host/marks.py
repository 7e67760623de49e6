"""Marks on evaluated data-blocks: a byte that Blender does not use. It is lost when Blender copies the block anew, so a
copy without it has been edited since it was seen."""

import ctypes

from . import contract

_SEEN = 0x53  # what a mark is
_STRUCT_OF = {"OBJECT": "Object", "MESH": "Mesh", "KEY": "Key", "ARMATURE": "bArmature"}


def mark_region(block, kind):
    """(address, size) of the mark, in bytes. kind: "OBJECT", "MESH", "KEY" or "ARMATURE"."""
    return block.as_pointer() + contract.unused_byte(_STRUCT_OF[kind]), 1


def _mark(block, kind):
    return ctypes.c_uint8.from_address(mark_region(block, kind)[0])


def take_mark(block, kind):
    """Whether an evaluated data-block is the copy that was seen last; it counts as seen from now on. The mark is a
    byte that Blender does not use, so it goes when Blender copies the block anew: after an edit.

    An original has none, unless it was made from an evaluated copy (`evaluated.data.copy()`) or comes from a file: all
    its copies would be marked from the beginning. It is healed."""
    byte, of_original = _mark(block, kind), _mark(block.original, kind)
    seen = byte.value == _SEEN and of_original.value == 0
    of_original.value = 0
    byte.value = _SEEN
    return seen


def is_marked(block, kind):
    return not contract.trouble() and _mark(block, kind).value == _SEEN


def clear_mark(block, kind):
    _mark(block, kind).value = 0
