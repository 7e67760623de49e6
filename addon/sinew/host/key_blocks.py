"""Reads the shape keys of evaluated meshes, their values and coordinates, and silences them for an evaluation."""

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..native import sinew_native
from . import contract, features, mesh_arrays, proof


@contract.kept
def key_layout() -> tuple[int, ...]:
    """Returns the byte offsets in a key of its flags, its value, the number of the key that it is relative to, the
    address of its points, and their number."""
    return tuple(contract.offset("KeyBlock", name) for name in ("flag", "curval", "relative", "*data", "totelem"))


def key_addresses(keys: Any) -> np.ndarray:
    """Returns the addresses of the keys of an evaluated key data-block, (K,) int64."""
    blocks = keys.key_blocks
    count = len(blocks)
    addresses = sinew_native.host.list_addresses(blocks[0].as_pointer(), count) if count else np.empty(0, np.int64)
    if count and proof.is_due("keys"):
        _prove(blocks, addresses)
    return addresses


def key_positions(address: int, count: int) -> np.ndarray | None:
    """Returns a view of a key's coordinates, (count, 3) float32, or None if it has a different number of points."""
    *_, data, total = key_layout()
    address = int(address)
    if ctypes.c_int32.from_address(address + total).value != count:
        return None
    return mesh_arrays.vectors_at(contract.address_at(address + data), count)


def values_of(keys: Any, numbers: Sequence[int]) -> tuple[float, ...]:
    """Returns the values of the keys with these numbers, of a key data-block, original or evaluated."""
    return tuple(each.value for each in _values(keys, numbers))


def set_values(keys: Any, numbers: Sequence[int], values: Sequence[float]) -> None:
    """Sets the values of the keys with these numbers, of a key data-block. Blender does not notice."""
    for place, value in zip(_values(keys, numbers), values):
        place.value = value


def _values(keys: Any, numbers: Sequence[int]) -> list[ctypes.c_float]:
    addresses, offset = key_addresses(keys).tolist(), key_layout()[1]
    return [ctypes.c_float.from_address(addresses[number] + offset) for number in numbers]


def relative_numbers(addresses: np.ndarray) -> list[int]:
    """Returns for each key the number of the key that it is relative to, as Blender stores it."""
    offset = key_layout()[2]
    return [ctypes.c_int16.from_address(address + offset).value for address in addresses.tolist()]


def settings(keys: Any) -> bytes:
    """Returns all of the keys of a key data-block but their points and values."""
    read = sinew_native.host.Described(contract.plain_regions("KeyBlock", "curval"), [], [], [])
    return read.bytes_of_list(int(next(iter(key_addresses(keys)), 0)))


def silence_keys(addresses: np.ndarray) -> np.ndarray:
    """Makes the keys of an evaluated copy relative to a key that does not exist, so that Blender adds nothing to the
    reference key. What mutes them, the user, a driver or keyframes, is left as it is. Returns the keys' values, (K,)
    float32, 0 for muted keys."""
    return sinew_native.host.silence_keys(addresses, key_layout()[:3])


def restore_keys(addresses: np.ndarray, numbers: Sequence[int], base: np.ndarray) -> None:
    """Undoes silence_keys, and restores the points of the reference key. numbers: as relative_numbers returned them;
    base (V, 3): the points. Does nothing with another number of keys or points."""
    points = key_positions(addresses[0], len(base)) if len(addresses) == len(numbers) > 0 else None
    if points is not None:
        sinew_native.host.restore_keys(addresses, key_layout()[:3], numbers)
        points[:] = base


_MUTED = 1  # a bit of a key's flags


def _relative_key(blocks: Any, number: int) -> Any:
    """Returns the key of that number, or None."""
    return blocks[number] if 0 <= number < len(blocks) else None


def _prove(blocks: Any, addresses: np.ndarray) -> None:
    """Compares each key's address, value, mute flag and relative key with the API, and the coordinates of the last
    key."""
    flag, value, relative, _data, _total = key_layout()
    is_same = [block.as_pointer() for block in blocks] == addresses.tolist() and all(
        np.array_equal(ctypes.c_float.from_address(address + value).value, block.value, equal_nan=True)
        and bool(ctypes.c_uint16.from_address(address + flag).value & _MUTED) == block.mute
        and _relative_key(blocks, ctypes.c_int16.from_address(address + relative).value) == block.relative_key
        for block, address in zip(blocks, addresses.tolist())
    )
    count = len(blocks[-1].data)
    if is_same and count:
        said = np.empty(3 * count, np.float32)
        blocks[-1].data.foreach_get("co", said)
        found = key_positions(addresses[-1], count)
        is_same = found is not None and np.array_equal(found.reshape(-1), said, equal_nan=True)
    proof.give("keys", is_same, "shape keys are not where they were", features.KEYS)
