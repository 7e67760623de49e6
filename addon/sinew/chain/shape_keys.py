"""A mesh's relative shape keys: read from Blender, summed natively, silenced in the evaluated copy.

Blender's own evaluation starts from the reference key and adds the others. In the evaluated copy, Sinew makes the
others relative to no key, so that Blender skips them, and writes the deformed shape into the reference key, so that
Blender only copies that shape. After the evaluation, both are restored (afterwards.py). The original is never changed.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..host import key_blocks, marks
from ..native import sinew_native
from . import living


@dataclass
class Keys:
    """The shape keys of one mesh."""

    native: Any  # sinew_native.ShapeKeys
    base: np.ndarray  # (V, 3): the reference key
    relative: list[int]  # for each key, the number of the key that it is relative to, as Blender stores it


def read(keys: Any, vertex_count: int, weights: Any) -> Keys:
    """Reads shape keys. keys: a key data-block that is not silenced; weights: layers.Weights of its mesh. Raises
    ValueError if a key and the mesh have different numbers of vertices."""
    blocks, addresses = list(keys.key_blocks), key_blocks.key_addresses(keys)
    positions = []
    for block, address in zip(blocks, addresses):
        numbers = key_blocks.key_positions(address, vertex_count)
        if numbers is None:
            raise ValueError(f"Shape key {block.name} and the mesh have different numbers of vertices: delete that key")
        positions.append(numbers)
    place = {block.name: number for number, block in enumerate(blocks)}
    relative_to = np.array([place.get(block.relative_key.name, -1) for block in blocks], np.int32)
    of_group = {name: weights.of_group(name) for name in {block.vertex_group for block in blocks} if name}
    own = [of_group.get(block.vertex_group) for block in blocks]
    group_weights = None
    if any(each is not None for each in own):
        group_weights = [None if each is None else each.astype(np.float32) for each in own]
    native = living.note(sinew_native.ShapeKeys(positions, relative_to, group_weights))
    return Keys(native, positions[0].copy(), key_blocks.relative_numbers(addresses))


def restore(keys: Any, known: Keys) -> None:
    """Restores the keys of an evaluated copy after an evaluation. known: what was read of them."""
    if marks.is_marked(keys, "KEY"):
        key_blocks.restore_keys(key_blocks.key_addresses(keys), known.relative, known.base)


def give_back(keys: Any, known: Keys) -> None:
    """Lets Blender sum the keys of an evaluated copy itself again. known: what was read of them."""
    restore(keys, known)
    marks.clear_mark(keys, "KEY")
