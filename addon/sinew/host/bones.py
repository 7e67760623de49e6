"""Reads all bytes of the bones of an armature's data that are not addresses."""

import functools
from typing import Any

from ..native import sinew_native
from . import contract


@functools.cache
def _layout() -> tuple[int, int, list[tuple[int, int]]]:
    """Returns byte offsets of the list of bones in an armature's data and of the list of children in a bone, and what
    `sinew_native.host.tree_bytes` takes as regions."""
    return (
        contract.offset("bArmature", "bonebase") + contract.offset("ListBase", "*first"),
        contract.offset("Bone", "childbase") + contract.offset("ListBase", "*first"),
        contract.plain_regions("Bone"),
    )


def read_bytes(data: Any) -> bytes:
    """Returns bytes that are equal for two copies of an armature's data if their bones are: names, rest positions, all
    settings, and which bone is whose child. They may differ for equal bones, by bytes that do not matter."""
    list_at, children_at, regions = _layout()
    return sinew_native.host.tree_bytes(contract.address_at(data.as_pointer() + list_at), children_at, regions)
