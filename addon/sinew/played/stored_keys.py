"""Compares the stored keyframes of an armature's F-curves, to find which frames an edit has changed. Does not use
Blender."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

ALL = (-math.inf, math.inf)


class Curve(NamedTuple):
    """An F-curve as it is stored."""

    frames: np.ndarray  # (K,) float32, of its keyframes, in order
    keys: np.ndarray  # (K, N) uint8: all that a keyframe's value and its segments depend on
    is_local: bool  # a keyframe matters only between its neighbors: no modifiers, no samples
    is_flat_outside: bool  # it is constant before its first and after its last keyframe
    settings: tuple[Any, ...]  # all else that its values depend on


def changed(before: Mapping[Any, Curve], after: Mapping[Any, Curve]) -> list[tuple[float, float]]:
    """Returns the ranges of frames, without their ends, on which two states of the same F-curves may differ.

    before, after: by path and index.
    """
    if before.keys() != after.keys():
        return [ALL]
    found: set[tuple[float, float]] = set()
    for name, old in before.items():
        found.update(_changed(old, after[name]))
        if ALL in found:
            return [ALL]
    return sorted(found)


def _changed(old: Curve, new: Curve) -> list[tuple[float, float]]:
    is_same = old.keys.shape == new.keys.shape and np.array_equal(old.keys, new.keys)
    if old[2:] != new[2:]:
        return [ALL]
    if is_same:
        return []
    if not (old.is_local and len(old.keys) and len(new.keys)):
        return [ALL]
    first = _equal_count(old.keys, new.keys)
    last = min(_equal_count(old.keys[::-1], new.keys[::-1]), min(len(old.keys), len(new.keys)) - first)
    # Outside its keyframes a curve may go on in the direction of its first or last segment.
    least = 1 if new.is_flat_outside else 2
    low = float(new.frames[first - 1]) if first >= least else -math.inf
    high = float(new.frames[-last]) if last >= least else math.inf
    return [(low, high)]


def _equal_count(old: np.ndarray, new: np.ndarray) -> int:
    """Returns how many keyframes are equal from the beginning."""
    count = min(len(old), len(new))
    differs = (old[:count] != new[:count]).any(axis=1)
    return int(np.argmax(differs)) if differs.any() else count
