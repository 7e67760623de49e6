"""Converts words of a shell to what options need, or says what is wrong with them. Independent of Blender."""

import argparse
import os
from collections.abc import Callable
from typing import Any


def blend_path(word: str) -> str:
    if not word.endswith(".blend"):
        raise argparse.ArgumentTypeError(f"{word} does not end in .blend")
    return os.path.abspath(word)


def frames_by(parse: Callable[[str], Any]) -> Callable[[str], Any]:
    """Returns the type of an option whose value is converted by `parse`."""

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
    try:
        number = float(word)
    except ValueError:
        number = 0.0
    if not 0 < number < float("inf"):
        raise argparse.ArgumentTypeError(f"{word} is not a number above 0")
    return number


def share(word: str) -> float:
    try:
        number = float(word)
    except ValueError:
        number = -1.0
    if not 0 <= number <= 1:
        raise argparse.ArgumentTypeError(f"{word} is not a number from 0 to 1")
    return number


def identifier(word: str) -> str:
    """Converts dual-quaternion to DUAL_QUATERNION, the spelling of the add-on's properties."""
    return word.upper().replace("-", "_")


def word(name: str) -> str:
    """Converts DUAL_QUATERNION to dual-quaternion."""
    return name.lower().replace("_", "-")
