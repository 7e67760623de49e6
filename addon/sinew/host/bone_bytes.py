"""Reads bytes of the bones of an armature's data."""

import functools
from typing import Any

from ..native import sinew_native
from . import contract, features

_HANDLES = "*bbone_prev", "*bbone_next"


@functools.cache
def _layout(has_handles: bool) -> tuple[int, Any]:
    """Returns the byte offset of the first bone in an armature's data, and what is read of bones: the addresses of
    their handles, or all that is no address."""
    children = contract.offset("Bone", "childbase") + contract.offset("ListBase", "*first")
    handles = [(contract.offset("Bone", name), contract.size("Bone", name)) for name in _HANDLES if has_handles]
    bones = sinew_native.host.Described(handles or contract.plain_regions("Bone"), [], [], [(children, None)])
    return contract.offset("bArmature", "bonebase") + contract.offset("ListBase", "*first"), bones


def can_read() -> bool:
    """Whether read_bytes works in this Blender."""
    return contract.has(features.EDITIONS)


def read_bytes(data: Any) -> bytes:
    """Returns bytes that are equal for two copies of an armature's data if their bones are: names, rest positions, all
    settings but other bones, and which bone is whose child. They may differ for equal bones, by bytes that do not
    matter."""
    return _read(data, False)


def read_handles(data: Any) -> bytes:
    """Returns bytes that are equal at two times if the B-bones of an original armature's data have the same bones as
    their custom handles. Blender's API lets nobody set other bones of a bone."""
    return _read(data, True)


def _read(data: Any, has_handles: bool) -> bytes:
    first, bones = _layout(has_handles)
    return bones.bytes_of_list(contract.address_at(data.as_pointer() + first))
