"""A mesh's relative shape keys: read from Blender, summed natively, silenced in the evaluated copy.

Blender's own evaluation starts from the reference key and adds the others. In the evaluated copy, Sinew mutes the
others and writes the deformed shape into the reference key, so that Blender's evaluation only copies that shape. The
original is never changed. The mute flag of a key whose muting is animated is left to drivers and keyframes: it is made
relative to itself instead, so that Blender adds nothing.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..blender import meshes
from ..host import key_blocks, marks
from ..native import sinew_native
from . import living


@dataclass
class Keys:
    """The shape keys of one mesh."""

    native: Any  # sinew_native.ShapeKeys
    base: np.ndarray  # (V, 3): the reference key


def read(keys: Any, vertex_count: int, weights: Any) -> Keys:
    """Reads shape keys. keys: a key data-block that is not silenced; weights: layers.Weights of its mesh. Raises
    ValueError if a key and the mesh have different numbers of vertices."""
    blocks = list(keys.key_blocks)
    positions = []
    for block, address in zip(blocks, key_blocks.key_addresses(keys)):
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
    return Keys(native, positions[0].copy())


def give_back(keys: Any, known: Keys) -> None:
    """Lets Blender sum the keys of an evaluated copy itself again, if they were silenced. known: what was read."""
    addresses = key_blocks.key_addresses(keys)
    if len(addresses) == 0 or not marks.is_marked(keys, "KEY"):
        return
    marks.clear_mark(keys, "KEY")
    key_blocks.give_keys_back(addresses, key_blocks.key_addresses(keys.original))
    base = key_blocks.key_positions(addresses[0], len(known.base))
    if base is not None:
        base[:] = known.base


def mend_original(mesh: Any, keys: Any, known: Keys) -> None:
    """Gives an original mesh and its reference key their shape back if they have been given the one that Sinew has
    written into the evaluated copy. So Blender does where a modifier that moves nothing is applied: it copies the
    evaluated keys, and to the mesh the active one.

    mesh: original; keys: evaluated, not copied again since Sinew wrote into them; known: what was read of them."""
    shape, own = (
        key_blocks.key_positions(key_blocks.key_addresses(each)[0], len(known.base)) for each in (keys, mesh.shape_keys)
    )
    if shape is None or own is None or not np.array_equal(own, shape) or np.array_equal(own, known.base):
        return
    own[:] = known.base
    if np.array_equal(meshes.read_positions(mesh), shape):
        mesh.vertices.foreach_set("co", known.base.ravel())
