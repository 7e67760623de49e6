"""addon/sinew/plan/drivers.py without Blender: which drivers Sinew evaluates itself, and their values."""

import importlib
import math
import sys
import types
from pathlib import Path

import numpy as np
import pytest
import sinew_native

ADDON = Path(__file__).resolve().parents[2] / "addon" / "sinew"
package = sys.modules["sinew_alone"] = types.ModuleType("sinew_alone")
package.__path__ = [str(ADDON)]
native = sys.modules["sinew_alone.native"] = types.ModuleType("sinew_alone.native")
native.sinew_native = sinew_native
drivers = importlib.import_module("sinew_alone.plan.drivers")


def value(expression, **variables):
    return drivers.value("SCRIPTED", drivers.compiled(expression, list(variables)), list(variables.values()))


@pytest.mark.parametrize(
    "expression, expected",
    [
        ("var", 0.25),
        ("1 - var", 0.75),
        ("-var + 2 * other / 4", 1.25),
        ("sin(var) + pi", math.sin(0.25) + math.pi),
        ("clamp(other)", 1),
        ("clamp(other, 2, 2.5)", 2.5),
        ("lerp(1, 3, var)", 1.5),
        ("smoothstep(0, 0.5, var)", 0.5),
        ("min(var, other, 2) if other > 2 else 7", 0.25),
        ("0.2 < var <= 0.25 and not other < 3", 1),
        ("True", 1),
        (" pow(var, 0.5) ", 0.5),
        ("round(other / 2)", 2),
    ],
)
def test_expressions_that_blender_evaluates_without_python(expression, expected):
    assert value(expression, var=0.25, other=3.0) == np.float32(expected)


@pytest.mark.parametrize(
    "expression",
    [
        "__import__('os')",
        "var.real",
        "bpy.context.scene.frame_current",
        "self.factor",
        "[var][0]",
        "(lambda: var)()",
        "'text'",
        "gone + 1",
        "var ** 9",
        "clamp(x=var)",
        "sin",
        "",
        "var +",
        "\0",
    ],
)
def test_other_expressions_are_left_to_blender(expression):
    with pytest.raises(ValueError, match="runs Python for its expression"):
        drivers.compiled(expression, ["var"])


def test_expressions_that_depend_on_the_frame():
    with pytest.raises(ValueError, match="depends on the frame: use keyframes instead"):
        drivers.compiled("frame / 100", ["var"])
    assert value("frame", frame=3.0) == 3


def test_an_expression_without_a_value():
    for expression, number in (("1 / var", 0.0), ("sqrt(var)", -1.0)):
        with pytest.raises(ArithmeticError, match="divides by 0 or has no value"):
            value(expression, var=number)


def test_what_is_folded():
    numbers = [1e8, 3.0, -1e8]  # summed in float32, in this order
    for kind, expected in (("SUM", 0), ("AVERAGE", 0), ("MIN", -1e8), ("MAX", 1e8)):
        assert drivers.value(kind, None, numbers) == expected
        assert drivers.value(kind, None, []) == 0
