"""Decides whether Sinew can evaluate a driver itself, and evaluates it. Does not use Blender.

Blender evaluates the driver of a modifier's setting before the modifier, but there is nothing that Sinew's hook could
wait for: it may run earlier. So the hook has copies of the driver's variables, which Blender evaluates before it calls
Sinew, and Sinew computes the driver's value from them.
"""

import operator
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..native import sinew_native


def compiled(expression: str, names: Sequence[str]) -> Any:
    """Returns a driver's expression as a sinew_native.DriverExpression. names: of its variables. Raises ValueError,
    with a clause, if Blender would run Python for it, or if it depends on the frame."""
    try:
        found = sinew_native.DriverExpression(expression, list(names))
    except ValueError:
        message = "Blender runs Python for its expression: use a simpler one, or variables alone"
        raise ValueError(message) from None
    if found.reads_frame:
        raise ValueError("it depends on the frame: use keyframes instead")
    return found


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


def value(kind: str, expression: Any, numbers: Sequence[float]) -> float:
    """Returns the value of a driver. kind: its type; expression: as returned by `compiled`, or None; numbers: of its
    variables. Raises ArithmeticError if the expression has no value."""
    if kind in _FOLDS:
        return float(_FOLDS[kind]([np.float32(number) for number in numbers]))
    found = expression.value(numbers)
    if found is None:
        raise ArithmeticError("its expression divides by 0 or has no value")
    return float(np.float32(found))
