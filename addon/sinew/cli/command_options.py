"""The arguments that can follow `sinew` in a shell. Independent of Blender and of the commands themselves."""

import argparse
import os
from typing import Any

from ..bake import frame_range, job
from ..deform import choices
from ..profiling import costs
from ..rig_files import file_options
from ..to_bones import bake_options
from ..to_bones.bone_names import read_names
from ..weights import weight_settings
from . import arguments
from .arguments import add_file, add_frames, add_objects, add_save, blend_path, positive_integer, positive_number, word

BLENDERS_METHODS = tuple(word(name) for name, *_ in choices.METHODS[:2])  # those of its Armature modifier
NEGATIVE = "default: the scene's; if the first is negative, --frames=-5-10"


def joined(words: list[str]) -> list[str]:
    """Returns the words of a shell, with a command of two words as one."""
    own = " ".join(words[:2])
    return [own, *words[2:]] if own in COMMANDS else words


def make_parser() -> argparse.ArgumentParser:
    """Returns the parser. In its result, `command` is the name of the command."""
    parser = argparse.ArgumentParser(
        prog="sinew",
        description="Skeletal deformation with a native core.",
        epilog="Exit codes: 0 done, 1 failed (stderr says why), 2 wrong usage.",
    )
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", dest="command", required=True)
    for name, (summary, add) in COMMANDS.items():
        command = commands.add_parser(name, help=summary, description=summary, allow_abbrev=False)
        command.add_argument("--json", action="store_true", help="end stdout with one line of JSON")
        add(command)
    return parser


def add_info(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "path", metavar="PATH", type=os.path.abspath, help="a rig folder, its skeleton file, or a .blend"
    )
    command.add_argument(
        "--profile",
        action="store_true",
        help="of a .blend: play its scene and list what evaluating each object costs, most expensive first, "
        "and what Accelerate would save; nothing is saved",
    )
    command.add_argument(
        "--frames",
        metavar="A-B",
        type=arguments.read_by(costs.parse_frames),
        help=f"the frames to play for --profile, at most {costs.MOST_FRAMES} of them, evenly spread ({NEGATIVE})",
    )
    add_file_options(command)


def add_import(command: argparse.ArgumentParser) -> None:
    command.add_argument("path", metavar="FOLDER", type=os.path.abspath, help="the rig folder, or its skeleton file")
    command.add_argument(
        "-o", "--output", dest="blend", metavar="FILE.blend", type=blend_path, required=True, help="where to save it"
    )
    add_file_options(command)
    scene = ("up_axis", "scale", "method", "source", "frame_rate", "set_frame_range", "output")
    arguments.add(command.add_argument_group("the scene"), file_options.ImportOptions, *scene)


def add_export(command: argparse.ArgumentParser) -> None:
    command.add_argument("path", metavar="FILE.blend", type=blend_path)
    command.add_argument("folder", metavar="FOLDER", type=os.path.abspath, help="made if it is missing")
    command.add_argument("--object", metavar="NAME", help="which mesh, if several are deformed")
    arguments.add(command, file_options.ExportOptions)


def add_weights(command: argparse.ArgumentParser) -> None:
    add_file(command)
    command.add_argument("--armature", metavar="NAME", required=True, help="the armature whose bones move the meshes")
    add_objects(command, "which meshes, as one body (default: all that belong to the armature)")
    command.add_argument("--check", action="store_true", help="change nothing: report what is wrong with the weights")
    arguments.add(command, weight_settings.CheckSettings, "angle")
    command.add_argument("--sheet", metavar="FILE.png", help="with --check: write a picture of these poses")
    add_save(command)
    arguments.add(command, weight_settings.AutomaticSettings)


def add_transfer(command: argparse.ArgumentParser) -> None:
    add_file(command)
    add_save(command)
    for name, dest, text in (
        ("--from", "sources", "the meshes to copy from, as one; may be repeated"),
        ("--to", "targets", "the meshes to copy to; may be repeated"),
    ):
        command.add_argument(name, dest=dest, metavar="NAME,...", action="append", required=True, help=text)
    arguments.add(command, weight_settings.TransferSettings)
    command.add_argument(
        "--add-modifier",
        action="store_true",
        help="parent targets that belong to no armature to that of the source, with an Armature modifier",
    )
    command.add_argument("--measure", action="store_true", help="change nothing: report what would be matched")


def add_edit(command: argparse.ArgumentParser, settings: Any) -> None:
    """Adds the arguments of an edit of the weights of meshes, one by one."""
    add_file(command)
    add_save(command)
    add_objects(command, "which meshes", required=True)
    arguments.add(command, settings)


def add_reduce(command: argparse.ArgumentParser) -> None:
    add_edit(command, weight_settings.ReduceSettings)
    add_frames(
        command, "the frames on which moves are measured (default: the scene's, at most 50 of them, evenly spread)"
    )
    command.add_argument(
        "--test-poses",
        action="store_true",
        help="measure with each bone turned by 90 degrees, instead of frames; the default if nothing moves on them",
    )
    command.add_argument("--measure", action="store_true", help="change nothing: report how far vertices would move")


def add_bake(command: argparse.ArgumentParser) -> None:
    add_file(command, "default: the file that is open; nothing is saved")
    command.add_argument(
        "-o",
        "--output",
        dest="folder",
        metavar="FOLDER",
        type=os.path.abspath,
        required=True,
        help="made if it is missing",
    )
    add_frames(command, f"the frames of the whole bake ({NEGATIVE})")
    command.add_argument(
        "--chunk",
        metavar="A-B,...",
        type=arguments.read_by(frame_range.parse_chunk),
        help="bake only these frames, into the same files as other processes",
    )
    add_objects(command, "which meshes (default: all visible ones with modifiers or shape keys)")
    command.add_argument(
        "--format", choices=job.FORMATS, default="pc2", help="point caches pc2 (the default) or mdd, or usd"
    )
    for name, text in (
        ("until-subdivision", "the shape before the first Subdivision Surface modifier"),
        ("usd-points", "USD with points on each frame, even where a skeleton would do"),
        ("overwrite", "replace what is there, finished or not; not with --chunk"),
        ("verify", "bake nothing: exit with 0 if everything is baked and complete, else say what is missing"),
    ):
        command.add_argument(f"--{name}", action="store_true", help=text)


def add_bake_to_bones(command: argparse.ArgumentParser) -> None:
    add_file(command)
    add_objects(command, "which meshes, for one armature (default: all visible ones with modifiers or shape keys)")
    add_frames(command, f"the frames to bake ({NEGATIVE})")
    bones = command.add_mutually_exclusive_group()
    arguments.add(bones, bake_options.FoundOptions, "bones")
    bones.add_argument(
        "--rig-bones",
        action="store_true",
        help="find no bones: copy the deforming bones of the meshes' armature with their motion, and find weights",
    )
    bones.add_argument(
        "--exact",
        action="store_true",
        help="find neither bones nor weights: a skeleton for games with exactly the motion of a rig's deforming bones",
    )
    exact = command.add_argument_group("with --exact", argument_default=argparse.SUPPRESS)
    exact.add_argument("--armature", metavar="NAME", help="the rig, if there are several armatures")
    exact.add_argument(
        "--all-actions",
        dest="actions",
        action="store_const",
        const="*",
        help="bake each action that moves the rig's bones, on its own frames, with the step of --frames (default: the "
        "scene as it plays)",
    )
    types = {"names": arguments.read_by(read_names), "gltf": os.path.abspath}
    arguments.add(exact, bake_options.ExactOptions, types=types)
    arguments.add(command, bake_options.FoundOptions, "max_influences", "iterations", "tolerance")
    command.add_argument(
        "--max-error",
        metavar="D",
        type=positive_number,
        help="fail, and save nothing, if a vertex, or with --exact a bone, is further off than this on any frame, in "
        "Blender's unit",
    )
    add_save(command)


def add_rig(command: argparse.ArgumentParser) -> None:
    command.add_argument("path", metavar="FILE.blend", type=blend_path)
    command.add_argument("--object", metavar="NAME", help="which armature, if there are several")
    command.add_argument("-o", "--output", metavar="FILE.json", type=os.path.abspath, help="where to write the rig")
    command.add_argument(
        "--skin", metavar="FILE.npz", type=os.path.abspath, help="where to write the weights of a mesh for this rig"
    )
    command.add_argument("--mesh", metavar="NAME", help="which mesh, if the armature deforms several")
    command.add_argument(
        "--check",
        action="store_true",
        help="compare what is computed with Blender, number by number; exit code 1 if the rig is refused or differs",
    )
    for name, count, text in (
        ("frames", 20, "how many frames, from the scene's first (20)"),
        ("random-poses", 5, "how many poses with random values (5)"),
    ):
        command.add_argument(f"--{name}", metavar="N", type=positive_integer, default=count, help=text)


def add_bench(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "path",
        metavar="PATH",
        type=os.path.abspath,
        help="a rig folder, its skeleton file, or a .blend, whose visible deformed meshes "
        "are measured together; nothing is saved",
    )
    command.add_argument(
        "--frames",
        metavar="N",
        type=positive_integer,
        default=40,
        help="how many frames, counted from the scene's first (40)",
    )
    command.add_argument("--method", dest="methods", choices=(*BLENDERS_METHODS, "both"), default="both")
    arguments.add(command, file_options.ImportOptions, "output")
    add_file_options(command)


def add_file_options(command: argparse.ArgumentParser) -> None:
    arguments.add(command.add_argument_group("how to read a rig folder"), file_options.FileOptions)


# What each command does, and the function that adds its arguments.
COMMANDS: dict[str, tuple[str, Any]] = {
    "info": ("what is in a rig folder, or which meshes of a .blend an armature deforms", add_info),
    "import": ("make a .blend from a rig folder", add_import),
    "export": ("write a character of a .blend as a rig folder", add_export),
    "weights": (
        "make weights for meshes from the bones of an armature; exit code 1 if any vertex has none",
        add_weights,
    ),
    "weights transfer": ("copy weights to other meshes; exit code 1 if any vertex gets none", add_transfer),
    "weights smooth": (
        "smooth the weights of meshes along the edges of faces",
        lambda command: add_edit(command, weight_settings.SmoothSettings),
    ),
    "weights mirror": (
        "copy weights from one side of meshes to the other",
        lambda command: add_edit(command, weight_settings.MirrorSettings),
    ),
    "weights reduce": (
        "leave each vertex only so many bones; exit code 1 if any moves farther than the tolerance",
        add_reduce,
    ),
    "bake": ("write the shapes of every frame to files: point caches, or USD", add_bake),
    "bake-to-bones": (
        "make an armature with keyframes and meshes with weights that play what meshes do, whatever deforms them",
        add_bake_to_bones,
    ),
    "rig": ("write an armature as a rig that is computed without Blender, or check it", add_rig),
    "bench": ("how long a frame takes with Sinew and with Blender's Armature modifier", add_bench),
}
