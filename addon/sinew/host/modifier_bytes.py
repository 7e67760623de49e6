"""Copies modifiers as a whole: Blender's API does not show all of their settings. A Mirror that was made before Blender
3.0 merges the vertices in another order, in each newer Blender, too.
"""

import ctypes
from typing import Any

from . import contract, features, members

_WEIGHTS = "edge_weight_name", "vertex_weight_name"  # attributes
# What every modifier has, such as its name and switches; what Blender writes when it evaluates one; and the names of
# vertex groups and attributes, all of which the API shows.
_WITHOUT = "modifier", "face_count", "defgrp_name", "shell_defgrp_name", "rim_defgrp_name", "vgroup", *_WEIGHTS


def can_copy() -> bool:
    """Whether modifiers can be copied as a whole in this Blender."""
    return contract.has(features.WHOLE)


def read(modifier: Any) -> bytes:
    """Returns the settings of a modifier except those that every modifier has, and other data-blocks. Two modifiers of
    one type have the same if these bytes are equal; they may differ for equal ones, by bytes that do not matter. b"" if
    this cannot be told."""
    return b"".join(ctypes.string_at(*each) for each in _regions(modifier))


def copy(modifier: Any, made: Any) -> None:
    """Gives a modifier, which is new, these settings of another one of its type, whose shown settings it has already.
    Raises contract.Broken if they are not the same any more."""
    own = _regions(modifier)
    if not own or read(modifier) == read(made):
        return
    shown = _shown(made)
    for (start, size), (to, _size) in zip(own, _regions(made)):
        ctypes.memmove(to, start, size)
    if _shown(made) != shown:
        raise contract.distrust(
            features.WHOLE, f"the settings of {members.MODIFIERS[made.type]} are not where they were"
        )


def _regions(modifier: Any) -> list[tuple[int, int]]:
    """Returns [(address, size)]."""
    kind = members.MODIFIERS.get(modifier.type)
    if kind is None or not can_copy():
        return []
    address = modifier.as_pointer()
    return [(address + offset, size) for offset, size in contract.plain_regions(kind, *_WITHOUT)]


def _shown(modifier: Any) -> list[str]:
    """What Blender's API shows of a modifier."""
    return [f"{name} {getattr(modifier, name)!r}" for name in modifier.bl_rna.properties.keys()]
