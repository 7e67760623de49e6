"""Reads the drivers of modifiers' settings, and whether Sinew can evaluate them as Blender does; the variables of
drivers, as plain data, and which of the hook's variables are copies of other drivers' variables."""

import math
from typing import Any

import bpy

from ..blender import values
from ..host import contract, features
from . import drivers
from .situation import Driven

COPIED = "driven"  # how the names of the hook's copies begin
_OF_TARGETS = "data_path", "bone_target", "transform_type", "transform_space", "rotation_mode"
TYPES_OF_VARIABLES = {"SINGLE_PROP", "TRANSFORMS", "ROTATION_DIFF", "LOC_DIFF"}
HAS_FALLBACKS = values.VERSION >= (4, 1, 0)  # a variable has a value even if its property was removed
TYPES = {"FLOAT", "INT", "BOOLEAN", "ENUM"}  # of settings


def variable_description(variable: Any) -> tuple[Any, ...]:
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


def is_data_variable(variable: Any) -> bool:
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


def is_copied(variable: Any) -> bool:
    """Whether a variable of a hook is a copy of another driver's variable."""
    return variable.name.startswith(COPIED)


def copies_in(hook: bpy.types.FCurve) -> list[Any]:
    """Returns the variables of a hook that are copies of other drivers' variables, in order."""
    return [each for each in hook.driver.variables if is_copied(each)]


def read(modifier: Any, curve: bpy.types.FCurve) -> Driven:
    """Reads a driver of a modifier's setting. modifier: original."""
    name = curve.data_path.rpartition(".")[2]
    variables = tuple(map(variable_description, curve.driver.variables))
    return Driven(name, variables, _why_not_evaluated(modifier, name, curve))


def _why_not_evaluated(modifier: Any, name: str, curve: bpy.types.FCurve) -> str:
    """Returns why Sinew cannot evaluate a driver as Blender does, a clause, or ""."""
    driver, setting = curve.driver, modifier.bl_rna.properties.get(name)
    if setting is None or setting.type not in TYPES or getattr(setting, "is_array", False):
        return "Sinew cannot set it"
    if not driver.is_valid or any(target.id is None for each in driver.variables for target in each.targets):
        return "the driver is invalid"
    if driver.use_self or driver.type not in drivers.KINDS:
        return "Blender runs Python for it"
    for variable in driver.variables:
        if variable.type not in TYPES_OF_VARIABLES:
            return f"its variable {variable.name} depends on the context"
        if not HAS_FALLBACKS and any('["' in target.data_path for target in variable.targets):
            return "before Blender 4.1, Sinew could not tell if the custom property was removed"
    if driver.type == "SCRIPTED":
        try:
            drivers.compiled(driver.expression, [each.name for each in driver.variables])
        except ValueError as error:
            return str(error)
    if not is_plain(curve):
        return "the driver's curve has modifiers"
    return contract.why_not(features.DRIVEN)


def is_plain(curve: bpy.types.FCurve) -> bool:
    """Whether `mapped` gives what Blender computes: the curve has keyframes and no modifiers, or only the formula that
    Blender gives it, or neither."""
    if len(curve.keyframe_points) > 0:
        return len(curve.modifiers) == 0
    return all(
        number == 0
        and each.type == "GENERATOR"
        and not (each.use_additive or each.mute or each.use_restricted_range or each.use_influence)
        for number, each in enumerate(curve.modifiers)
    )


def mapped(curve: bpy.types.FCurve, x: float) -> float:
    """Returns what a plain curve makes of a driver's value."""
    return curve.evaluate(x) if len(curve.keyframe_points) or len(curve.modifiers) else x
