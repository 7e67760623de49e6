"""Reads the stored keyframes of an F-curve in one step."""

import ctypes
import functools
from typing import Any

import numpy as np

from . import contract, proof

_MEMBERS = ("vec", "ipo", "easing", "back", "amplitude", "period")  # all that values between keyframes depend on


@functools.cache
def _columns() -> tuple[int, np.ndarray]:
    """Returns the size of a keyframe in bytes, and the numbers of the bytes of these members."""
    places = [(contract.offset("BezTriple", name), contract.size("BezTriple", name)) for name in _MEMBERS]
    return contract.struct_size("BezTriple"), np.concatenate([np.arange(at, at + size) for at, size in places])


def forget() -> None:
    """Discards the layout. For tests."""
    _columns.cache_clear()


def read(curve: Any) -> tuple[np.ndarray, np.ndarray]:
    """Returns (frames, keys) of an F-curve of an original: (K,) float32, and (K, N) uint8 with all that its values
    depend on, without selection and the like. Raises contract.Broken."""
    count = len(curve.keyframe_points)
    size, columns = _columns()
    if count == 0:
        return np.empty(0, np.float32), np.empty((0, len(columns)), np.uint8)
    address = curve.keyframe_points[0].as_pointer()
    if curve.keyframe_points[count - 1].as_pointer() != address + size * (count - 1):
        raise contract.distrust_freezing("keyframes are not where they were")
    stored = np.frombuffer(ctypes.string_at(address, size * count), np.uint8).reshape(count, size)
    keys = stored[:, columns]
    frames = np.ascontiguousarray(keys[:, 12:16]).view(np.float32)[:, 0]  # of (handle, keyframe, handle), three each
    if proof.is_due("keyframes"):
        wanted = np.empty(2 * count, np.float32)
        curve.keyframe_points.foreach_get("co", wanted)
        if not np.array_equal(wanted[::2], frames):
            raise contract.distrust_freezing("keyframes are not where they were")
        proof.give("keyframes")
    return frames, keys
