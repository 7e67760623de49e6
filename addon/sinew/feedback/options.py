"""Options that people choose in a dialog or in a shell: the fields of a dataclass, each with its name, what it does and
its limits. An operator's properties (ui/option_properties.py) and a command's arguments (cli/arguments.py) are made
from them. Independent of Blender."""

import dataclasses
from typing import Any, NamedTuple


class Option(NamedTuple):
    """label, text: in the interface, the text without a stop. limits: of a number, the least, the largest and how far
    its slider goes; None, or left out, for none. items: choices. more: further arguments of Blender's property; with
    the subtype ANGLE, the field is in degrees.

    word: what the argument is called, "" as the field; help: of the argument, "" the text; value: what stands for its
    value."""

    label: str
    text: str
    limits: tuple[float | None, ...] = ()
    items: tuple[tuple[str, str, str], ...] = ()  # identifier, name, what it means
    word: str = ""
    help: str = ""
    value: str = ""
    more: dict[str, Any] = {}


def option(default: Any, label: str, text: str, **others: Any) -> Any:
    """Returns a field of a dataclass. The other arguments are those of Option."""
    return dataclasses.field(default=default, metadata={"option": Option(label, text, **others)})


def of(kind: Any) -> dict[str, tuple[Any, Option]]:
    """Returns {name: (default, option)} of the fields of a dataclass that are options."""
    fields = [each for each in dataclasses.fields(kind) if "option" in each.metadata]
    return {each.name: (each.default, each.metadata["option"]) for each in fields}
