"""Reads the drivers of modifiers' settings, and whether Sinew can evaluate them as Blender does."""

from typing import Any

import bpy

from ..blender import values
from ..host import contract, features
from . import driver_variables, drivers
from .situation import Driven

TYPES_OF_VARIABLES = {"SINGLE_PROP", "TRANSFORMS", "ROTATION_DIFF", "LOC_DIFF"}
HAS_FALLBACKS = values.VERSION >= (4, 1, 0)  # a variable has a value even if its property was removed
TYPES = {"FLOAT", "INT", "BOOLEAN", "ENUM"}  # of settings


def read(modifier: Any, curve: bpy.types.FCurve) -> Driven:
    """Reads a driver of a modifier's setting. modifier: original."""
    name = curve.data_path.rpartition(".")[2]
    variables = tuple(map(driver_variables.description, curve.driver.variables))
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
