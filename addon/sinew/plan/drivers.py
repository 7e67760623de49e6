"""Decides whether Sinew can evaluate a driver itself, and evaluates it. Does not use Blender.

Blender evaluates the driver of a modifier's setting before the modifier, but there is nothing that Sinew's hook could
wait for: it may run earlier. So the hook has copies of the driver's variables, which Blender evaluates before it calls
Sinew, and Sinew computes the driver's value from them.
"""

import ast
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from types import CodeType

import numpy as np


def _smoothstep(low: float, high: float, x: float) -> float:
    t = min(max((x - low) / (high - low), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


# What Blender evaluates without Python, whatever is allowed to run in a file. Python gives the same numbers.
FUNCTIONS: dict[str, Callable[..., float]] = {
    **{name: getattr(math, name) for name in ("radians", "degrees", "floor", "ceil", "trunc", "sin", "cos", "tan")},
    **{name: getattr(math, name) for name in ("asin", "acos", "atan", "atan2", "exp", "log", "sqrt", "pow", "fmod")},
    "fabs": math.fabs,
    "abs": abs,
    "min": min,
    "max": max,
    "int": math.trunc,
    "lerp": lambda a, b, x: a * (1.0 - x) + b * x,
    "clamp": lambda x, low=0.0, high=1.0: min(max(x, low), high),
    "smoothstep": _smoothstep,
}
CONSTANTS = {"pi": math.pi, "True": 1.0, "False": 0.0}
_NODES = (
    *(ast.Expression, ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.Compare, ast.IfExp, ast.Call, ast.Name, ast.Constant),
    *(ast.Load, ast.Add, ast.Sub, ast.Mult, ast.Div, ast.USub, ast.UAdd, ast.Not, ast.And, ast.Or),
    *(ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq),
)


def compiled(expression: str, names: Sequence[str]) -> CodeType:
    """Compiles a driver's expression. names: of its variables. Raises ValueError, with a clause, if Blender would run
    Python for it, or if it depends on the frame."""
    try:
        tree = ast.parse(expression.strip(), mode="eval")
    except (SyntaxError, ValueError, RecursionError):
        raise ValueError("its expression cannot be read") from None
    functions = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    for node in ast.walk(tree):
        is_plain = isinstance(node, _NODES)
        if isinstance(node, ast.Call):
            is_plain = isinstance(node.func, ast.Name) and node.func.id in FUNCTIONS and not node.keywords
        elif isinstance(node, ast.Constant):
            is_plain = isinstance(node.value, bool | int | float)
        elif isinstance(node, ast.Name) and id(node) not in functions:
            if node.id == "frame" and "frame" not in names:
                raise ValueError("it depends on the frame: use keyframes instead")
            is_plain = node.id in names or node.id in CONSTANTS
        if not is_plain:
            raise ValueError("Blender runs Python for its expression: use a simpler one, or variables alone")
    return compile(tree, "<driver>", "eval")


_FOLDS: dict[str, Callable[[Sequence[np.float32]], np.float32]] = {
    "SUM": lambda numbers: _sum(numbers),
    "AVERAGE": lambda numbers: np.float32(_sum(numbers) / np.float32(len(numbers))) if numbers else np.float32(0),
    "MIN": lambda numbers: min(numbers, default=np.float32(0)),
    "MAX": lambda numbers: max(numbers, default=np.float32(0)),
}
KINDS = {*_FOLDS, "SCRIPTED"}


def _sum(numbers: Sequence[np.float32]) -> np.float32:
    total = np.float32(0)
    for number in numbers:  # in float32, in this order
        total = np.float32(operator.add(total, number))
    return total


def value(kind: str, code: CodeType | None, names: Sequence[str], numbers: Sequence[float]) -> float:
    """Returns the value of a driver. kind: its type; code: as returned by `compiled`, of its expression; names,
    numbers: of its variables. Raises ArithmeticError, ValueError or TypeError if the expression has no value."""
    if kind in _FOLDS:
        return float(_FOLDS[kind]([np.float32(number) for number in numbers]))
    if code is None:
        raise ValueError("it has no expression")
    known: Mapping[str, object] = FUNCTIONS | CONSTANTS | dict(zip(names, numbers))
    result = eval(code, {"__builtins__": {}}, known)  # only of nodes that `compiled` has let through
    return float(np.float32(result))
