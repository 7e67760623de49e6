"""Arguments that several commands have. Independent of Blender."""

import argparse

from ..bake import frame_range
from .option_types import blend_path, frames_by


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
    command.add_argument("--frames", metavar="A-B[:STEP]", type=frames_by(frame_range.parse), help=text)
