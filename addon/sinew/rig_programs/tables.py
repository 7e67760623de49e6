"""The library's tables of settings."""

from functools import cache

from ..native import sinew_native


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
def constraint_settings() -> dict[str, dict[str, int]]:
    """Returns the settings of each type of constraint that is computed, and how many numbers each has."""
    return sinew_native.rig_constraint_settings()
