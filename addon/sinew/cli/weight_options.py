"""The arguments of `sinew weights transfer`, `smooth`, `mirror` and `reduce`. Independent of Blender."""

import argparse
from collections.abc import Callable

from .option_types import identifier, positive_integer, positive_number, share, whole_number
from .shared_options import add_file, add_frames, add_objects, add_save

# The second words of commands of two words, of which `weights` is the first.
TOOLS = ("transfer", "smooth", "mirror", "reduce")


def joined(words: list[str]) -> list[str]:
    """Returns the words of a shell, with a command of two words as one."""
    if words[:1] == ["weights"] and words[1:2] and words[1] in TOOLS:
        return [" ".join(words[:2]), *words[2:]]
    return words


def add(add_command: Callable[[str, str], argparse.ArgumentParser]) -> None:
    """Adds the commands. add_command(name, summary): returns the parser of a new one."""
    _add_transfer(add_command("weights transfer", "copy weights to other meshes; exit code 1 if any vertex gets none"))
    _add_smooth(add_command("weights smooth", "smooth the weights of meshes along the edges of faces"))
    _add_mirror(add_command("weights mirror", "copy weights from one side of meshes to the other"))
    _add_reduce(
        add_command(
            "weights reduce",
            "leave each vertex only so many bones; exit code 1 if any moves farther than the tolerance",
        )
    )


def _add_transfer(command):
    add_file(command)
    add_save(command)
    for name, dest, text in (
        ("--from", "sources", "the meshes to copy from, as one; may be repeated"),
        ("--to", "targets", "the meshes to copy to; may be repeated"),
    ):
        command.add_argument(name, dest=dest, metavar="NAME,...", action="append", required=True, help=text)
    command.add_argument(
        "--distance",
        metavar="S",
        type=positive_number,
        default=0.05,
        help="how far the closest point may be for a vertex to be matched, as a share of the target's size (0.05)",
    )
    command.add_argument(
        "--angle",
        metavar="DEGREES",
        type=positive_number,
        default=30.0,
        help="the largest angle between the surfaces there (30)",
    )
    command.add_argument("--flipped", action="store_true", help="also match surfaces that face the opposite way")
    command.add_argument(
        "--add-modifier",
        action="store_true",
        help="parent targets that belong to no armature to that of the source, with an Armature modifier",
    )
    command.add_argument("--measure", action="store_true", help="change nothing: report what would be matched")


def _add_smooth(command):
    add_file(command)
    add_save(command)
    add_objects(command, "which meshes", required=True)
    command.add_argument(
        "--steps",
        metavar="N",
        type=positive_integer,
        default=5,
        help="how many times each vertex goes towards the mean of its neighbors (5)",
    )
    command.add_argument("--factor", metavar="S", type=share, default=0.5, help="how far each step goes, 0 to 1 (0.5)")
    command.add_argument(
        "--strength",
        metavar="S",
        type=positive_number,
        default=0.0,
        help="smooth in one solve instead of steps; it reaches about so many edges as the square root of this number",
    )


def _add_mirror(command):
    add_file(command)
    add_save(command)
    add_objects(command, "which meshes", required=True)
    command.add_argument(
        "--axis", type=identifier, choices=("X", "Y", "Z"), default="X", help="the meshes' own axis (X)"
    )
    command.add_argument(
        "--from",
        dest="source_side",
        choices=("positive", "negative"),
        default="positive",
        help="the side to copy from (positive: a character's left)",
    )


def _add_reduce(command):
    add_file(command)
    add_save(command)
    add_objects(command, "which meshes", required=True)
    command.add_argument(
        "--max-influences",
        metavar="N",
        type=positive_integer,
        default=4,
        help="the largest number of bones per vertex (4)",
    )
    add_frames(
        command, "the frames on which moves are measured (default: the scene's, at most 50 of them, evenly spread)"
    )
    command.add_argument(
        "--test-poses",
        action="store_true",
        help="measure with each bone turned by 90 degrees, instead of frames; the default if nothing moves on them",
    )
    command.add_argument(
        "--fade",
        metavar="N",
        type=whole_number,
        default=2,
        help="over how many edges a bone fades out towards vertices that have lost it (2)",
    )
    command.add_argument(
        "--tolerance",
        metavar="S",
        type=positive_number,
        default=0.0,
        help="in world space; exit code 1 if a vertex moves farther (default: none)",
    )
    command.add_argument("--measure", action="store_true", help="change nothing: report how far vertices would move")
