"""An operator's properties that are options (feedback/options.py)."""

import inspect
import math
from collections.abc import Callable
from typing import Any

from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ..feedback import options

_KINDS = {bool: BoolProperty, int: IntProperty, float: FloatProperty, str: StringProperty}
_LIMITS = "min", "max", "soft_max"


def added(kind: Any) -> Callable[[Any], Any]:
    """Decorates a class whose annotations are properties: it gets one for each option of a dataclass, before its own. A
    property of its own with the same name is in place of it."""

    def add(cls: Any) -> Any:
        made = {name: one(kind, name) for name in options.of(kind)}
        cls.__annotations__ = made | inspect.get_annotations(cls)
        return cls

    return add


def read(operator: Any, kind: Any) -> Any:
    """Returns a dataclass with the values of an operator's properties."""
    values = {}
    for name, (_default, option) in options.of(kind).items():
        value = getattr(operator, name)
        values[name] = min(math.degrees(value), 180.0) if _is_angle(option) else value  # float32 rounds
    return kind(**values)


def _is_angle(option: options.Option) -> bool:
    return option.more.get("subtype") == "ANGLE"


def one(kind: Any, name: str, **more: Any) -> Any:
    """Returns a property for the option of that name. more: further arguments of it."""
    default, option = options.of(kind)[name]
    texts: dict[str, Any] = {"name": option.label, "description": option.text, **option.more, **more}
    if option.items:
        return EnumProperty(items=option.items, default=default, **texts)
    limits = {name: limit for name, limit in zip(_LIMITS, option.limits) if limit is not None}
    if _is_angle(option):
        default, limits = math.radians(default), {name: math.radians(limit) for name, limit in limits.items()}
    return _KINDS[type(default)](default=default, **texts, **limits)
