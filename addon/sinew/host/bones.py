"""Reads all bytes of the bones of an armature's data that are not addresses."""

import functools
from typing import Any

from ..native import sinew_native
from . import contract, features


@functools.cache
def _layout() -> tuple[int, Any]:
    """Returns the byte offset of the first bone in an armature's data, and what is read of bones."""
    children = contract.offset("Bone", "childbase") + contract.offset("ListBase", "*first")
    bones = sinew_native.host.Described(contract.plain_regions("Bone"), [], [], [(children, None)])
    return contract.offset("bArmature", "bonebase") + contract.offset("ListBase", "*first"), bones


def can_read() -> bool:
    """Whether read_bytes works in this Blender."""
    return contract.has(features.EDITIONS)


def read_bytes(data: Any) -> bytes:
    """Returns bytes that are equal for two copies of an armature's data if their bones are: names, rest positions, all
    settings, and which bone is whose child. They may differ for equal bones, by bytes that do not matter."""
    first, bones = _layout()
    return bones.bytes_of_list(contract.address_at(data.as_pointer() + first))
