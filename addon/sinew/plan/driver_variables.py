"""The variables of drivers, as plain data, and which of the hook's variables are copies of other drivers' variables."""

import math
from typing import Any

import bpy

from ..blender import values

COPIED = "driven"  # how the names of the hook's copies begin
_OF_TARGETS = "data_path", "bone_target", "transform_type", "transform_space", "rotation_mode"


def description(variable: Any) -> tuple[Any, ...]:
    """Returns what a variable of a driver reads, as plain data. A copy of the variable has an equal one."""
    return variable.type, *(
        (target.id and values.key_of(target.id), _fallback_of(target), *(getattr(target, name) for name in _OF_TARGETS))
        for target in variable.targets
    )


def _fallback_of(target: Any) -> float | None:
    """Returns the value of a variable whose property does not exist, or None if its driver is invalid then."""
    if not getattr(target, "use_fallback_value", False) or math.isnan(target.fallback_value):
        return None
    return target.fallback_value


def is_data(variable: Any) -> bool:
    """Whether a variable of a driver hands one of Blender's structs over to Python, not a number or a text."""
    if variable.type not in {"SINGLE_PROP", "CONTEXT_PROP"}:
        return False
    target = variable.targets[0]
    if variable.type == "CONTEXT_PROP" or target.id is None:
        return False
    try:
        return isinstance(target.id.path_resolve(target.data_path), bpy.types.bpy_struct)
    except ValueError:
        return False  # the property does not exist


def is_copy(variable: Any) -> bool:
    """Whether a variable of a hook is a copy of another driver's variable."""
    return variable.name.startswith(COPIED)


def copies(hook: bpy.types.FCurve) -> list[Any]:
    """Returns the variables of a hook that are copies of other drivers' variables, in order."""
    return [each for each in hook.driver.variables if is_copy(each)]
