"""The library's tables of settings."""

import itertools
from functools import cache

from ..native import sinew_native

# The channels of a bone that an Action constraint sets: where they begin among a bone's numbers.
CHANNELS = {"location": 0, "rotation_quaternion": 3, "rotation_axis_angle": 7, "rotation_euler": 11, "scale": 14}


@cache
def bone_settings() -> list[tuple[str, int, bool]]:
    """Returns the numbers of a bone that may change: name, how many, and whether they are the rest bone's."""
    seen: set[str] = set()
    found = []
    for name, count in sinew_native.rig_bone_settings():
        found.append((name, count, name in seen))  # those of the pose come first
        seen.add(name)
    return found


@cache
def bone_columns() -> list[tuple[str, slice, bool]]:
    """Returns the same, with where each is among a bone's numbers."""
    ends = itertools.accumulate(count for _name, count, _is_of_rest in bone_settings())
    return [(name, slice(end - count, end), of_rest) for (name, count, of_rest), end in zip(bone_settings(), ends)]


@cache
def constraint_settings() -> dict[str, dict[str, tuple]]:
    """Returns the settings of each type of constraint that is computed: how many numbers, type, default, limits."""
    return sinew_native.rig_constraint_settings()
