"""Arguments of commands: what several have, those that are made of options (feedback/options.py), and what words of a
shell stand for. Independent of Blender."""

import argparse
import os
from collections.abc import Callable, Mapping
from typing import Any

from ..bake import frame_range
from ..feedback import options as tables

_VALUES = {int: "N", float: "S", str: "NAME"}  # what stands for a value in the help


def add_file(command: argparse.ArgumentParser, text: str = "default: the file that is open") -> None:
    """The .blend to work on, which may be left out."""
    command.add_argument("path", metavar="FILE.blend", nargs="?", type=blend_path, help=text)


def add_save(command: argparse.ArgumentParser) -> None:
    command.add_argument("--save", action="store_true", help="save the file in its place (default: nothing is saved)")


def add_objects(command: argparse.ArgumentParser, text: str, required: bool = False) -> None:
    command.add_argument(
        "--objects", metavar="NAME,...", action="append", required=required, help=f"{text}; may be repeated"
    )


def add_frames(command: argparse.ArgumentParser, text: str) -> None:
    command.add_argument("--frames", metavar="A-B[:STEP]", type=read_by(frame_range.parse), help=text)


# --- those of options -----------------------------------------------------------------------------


def add(command: Any, kind: Any, *names: str, types: Mapping[str, Any] = {}) -> None:
    """Adds an argument for each option of a dataclass, or for those of these names. types: how the values of some are
    read. Choices are words of a shell until `read`."""
    for name, (default, option) in tables.of(kind).items():
        if not names or name in names:
            flag = f"--{option.word or word(name)}"
            text = option.help or option.text[:1].lower() + option.text[1:]
            if isinstance(default, bool):
                command.add_argument(flag, dest=name, action="store_false" if default else "store_true", help=text)
                continue
            how: dict[str, Any] = {"metavar": option.value or _VALUES[type(default)]}
            if option.items:
                choices = [word(each) for each, *_ in option.items]
                how, default = {"choices": choices, "type": _as_one_of(choices)}, word(default)
            elif isinstance(default, int):
                how["type"] = positive_integer if option.limits[0] else whole_number
            elif isinstance(default, float):
                how["type"] = share if option.limits == (0.0, 1.0) else positive_number
            if option.more.get("subtype") == "ANGLE":
                how["metavar"] = "DEGREES"
            if "type" in how and name not in types and default != 0.0:
                text += f" ({default:g})" if isinstance(default, int | float) else f" ({default})"
            how |= {"type": types[name]} if name in types else {}
            if command.argument_default != argparse.SUPPRESS:
                how["default"] = default
            command.add_argument(flag, dest=name, help=text, **how)


def read(options: argparse.Namespace, kind: Any) -> Any:
    """Returns a dataclass with the values of the arguments, and its own for those that the command does not have."""
    return kind(**given(options, kind))


def given(options: argparse.Namespace, kind: Any) -> dict[str, Any]:
    """Returns the values of the options of a dataclass that the command has."""
    found = {name: getattr(options, name) for name in tables.of(kind) if hasattr(options, name)}
    for name, (_default, option) in tables.of(kind).items():
        for each, *_ in option.items if name in found else ():
            if word(each) == found[name]:
                found[name] = each
    return found


def _as_one_of(choices: list[str]) -> Callable[[str], str]:
    def choose(own: str) -> str:
        return next((each for each in choices if each.lower() == own.lower()), own)

    return choose


# --- words ----------------------------------------------------------------------------------------


def blend_path(word: str) -> str:
    if not word.endswith(".blend"):
        raise argparse.ArgumentTypeError(f"{word} does not end in .blend")
    return os.path.abspath(word)


def read_by(parse: Callable[[str], Any]) -> Callable[[str], Any]:
    """Returns the type of an argument whose value is converted by `parse`."""

    def read(word):
        try:
            return parse(word)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from error

    return read


def positive_integer(word: str) -> int:
    if not word.isdecimal() or int(word) == 0:
        raise argparse.ArgumentTypeError(f"{word} is not a whole number above 0")
    return int(word)


def whole_number(word: str) -> int:
    if not word.isdecimal():
        raise argparse.ArgumentTypeError(f"{word} is not a whole number")
    return int(word)


def positive_number(word: str) -> float:
    number = _number(word)
    if not 0 < number < float("inf"):
        raise argparse.ArgumentTypeError(f"{word} is not a number above 0")
    return number


def share(word: str) -> float:
    number = _number(word)
    if not 0 <= number <= 1:
        raise argparse.ArgumentTypeError(f"{word} is not a number from 0 to 1")
    return number


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return float("nan")


def identifier(word: str) -> str:
    """Converts dual-quaternion to DUAL_QUATERNION, the spelling of the add-on's properties."""
    return word.upper().replace("-", "_")


def word(name: str) -> str:
    """Converts DUAL_QUATERNION to dual-quaternion. Names of axes stay."""
    return name if len(name) == 1 else name.lower().replace("_", "-")
