"""The arguments that can follow `sinew` in a shell. Independent of Blender and of the commands themselves."""

import argparse
import os
from typing import Any

from ..bake import frame_range as bake_range
from ..bake import job
from ..profiling import costs
from . import rig_options, to_bones_options, weight_options
from .option_types import blend_path, frames_by, identifier, positive_integer, positive_number, share
from .shared_options import add_file, add_frames, add_objects, add_save

BLENDERS_METHODS = ("linear", "dual-quaternion")  # those of its Armature modifier
METHODS = (*BLENDERS_METHODS, "blended", "rotation-centers", "direct-delta-mush")


def make_parser() -> argparse.ArgumentParser:
    """Returns the parser. In its result, `command` is the name of the command; rig options that were not given are
    absent."""
    parser = argparse.ArgumentParser(
        prog="sinew",
        description="Skeletal deformation with a native core.",
        epilog="Exit codes: 0 done, 1 failed (stderr says why), 2 wrong usage.",
    )
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", dest="command", required=True)
    add_info(commands)
    add_import(commands)
    add_export(commands)
    add_weights(commands)
    weight_options.add(lambda name, summary: add_command(commands, name, summary))
    add_bake(commands)
    add_bake_to_bones(commands)
    rig_options.add(lambda name, summary: add_command(commands, name, summary))
    add_bench(commands)
    return parser


def add_command(commands: Any, name: str, summary: str) -> argparse.ArgumentParser:
    command = commands.add_parser(name, help=summary, description=summary, allow_abbrev=False)
    command.add_argument("--json", action="store_true", help="end stdout with one line of JSON")
    return command


def add_info(commands: Any) -> None:
    command = add_command(commands, "info", "what is in a rig folder, or which meshes of a .blend an armature deforms")
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
        type=frames_by(costs.parse_frames),
        help=f"the frames to play for --profile, at most {costs.MOST_FRAMES} of them, evenly spread "
        "(default: the scene's; if the first is negative, --frames=-5-10)",
    )
    add_file_options(command)


def add_import(commands: Any) -> None:
    command = add_command(commands, "import", "make a .blend from a rig folder")
    command.add_argument("path", metavar="FOLDER", type=os.path.abspath, help="the rig folder, or its skeleton file")
    command.add_argument(
        "-o", "--output", dest="blend", metavar="FILE.blend", type=blend_path, required=True, help="where to save it"
    )
    add_file_options(command)
    group = command.add_argument_group("the scene", argument_default=argparse.SUPPRESS)
    group.add_argument(
        "--up-axis", type=identifier, choices=("Y", "Z"), help="the axis of the files that points up (Y)"
    )
    group.add_argument("--scale", metavar="S", type=positive_number, help="size of the imported rig (1)")
    group.add_argument("--method", choices=METHODS, help="how the joints' motions are blended (linear)")
    group.add_argument(
        "--source",
        choices=("clip", "armature"),
        help="where the pose comes from: the rig's own poses, or the armature (clip)",
    )
    group.add_argument(
        "--frame-rate",
        metavar="N",
        type=positive_number,
        help="poses per second in the file, played at the scene's frame rate (one pose per frame)",
    )
    group.add_argument(
        "--keep-frame-range",
        dest="set_frame_range",
        action="store_false",
        help="do not end the scene with the last pose",
    )
    add_output_kind(group)


def add_export(commands: Any) -> None:
    command = add_command(commands, "export", "write a character of a .blend as a rig folder")
    command.add_argument("path", metavar="FILE.blend", type=blend_path)
    command.add_argument("folder", metavar="FOLDER", type=os.path.abspath, help="made if it is missing")
    command.add_argument("--object", metavar="NAME", help="which mesh, if several are deformed")
    command.add_argument(
        "--animation",
        choices=("auto", "frames", "none"),
        default="auto",
        help="auto (the default): the imported poses if they are shown, else the scene's "
        "frames if the armature is animated; frames: always those",
    )
    command.add_argument(
        "--up-axis",
        type=identifier,
        choices=("Y", "Z"),
        default="Y",
        help="the axis of the files that the mesh's Z axis becomes, if it was not imported (Y)",
    )


def add_weights(commands: Any) -> None:
    command = add_command(
        commands, "weights", "make weights for meshes from the bones of an armature; exit code 1 if any vertex has none"
    )
    add_file(command)
    command.add_argument("--armature", metavar="NAME", required=True, help="the armature whose bones move the meshes")
    add_objects(command, "which meshes, as one body (default: all that belong to the armature)")
    command.add_argument("--check", action="store_true", help="change nothing: report what is wrong with the weights")
    command.add_argument(
        "--angle",
        metavar="DEGREES",
        type=positive_number,
        default=60.0,
        help="with --check: by how much each bone is bent to see how far it stretches the mesh (60)",
    )
    command.add_argument("--sheet", metavar="FILE.png", help="with --check: write a picture of these poses")
    add_save(command)
    command.add_argument(
        "--bones",
        choices=("automatic", "tail", "child"),
        default="automatic",
        help="where the line ends that each bone stands for: at its tail, or at the next bone's head",
    )
    command.add_argument(
        "--stiffness",
        metavar="S",
        type=positive_number,
        default=8.0,
        help="how closely weights follow the nearest bone (8)",
    )
    command.add_argument(
        "--resolution", metavar="N", type=positive_integer, default=128, help="voxels along the longest side (128)"
    )
    command.add_argument(
        "--max-influences",
        metavar="N",
        type=positive_integer,
        default=0,
        help="the largest number of bones per vertex (no limit); with --check, what counts as too many (4)",
    )
    command.add_argument(
        "--rigid-size",
        metavar="S",
        type=share,
        default=0.02,
        help="loose parts that are smaller than this share of the mesh's size do not bend (0.02; 0: all bend)",
    )
    command.add_argument(
        "--rigid-follow",
        choices=("attachment", "bone"),
        default="attachment",
        help="what those parts follow: the closest point of the rest of the mesh, or one bone (attachment)",
    )
    command.add_argument(
        "--rigid-group",
        metavar="NAME",
        default="Rigid",
        help="vertices in this vertex group do not bend: each connected piece of them is rigid (Rigid)",
    )


def add_bake(commands: Any) -> None:
    command = add_command(commands, "bake", "write the shapes of every frame to files: point caches, or USD")
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
    add_frames(command, "the frames of the whole bake (default: the scene's; if the first is negative, --frames=-5-10)")
    command.add_argument(
        "--chunk",
        metavar="A-B,...",
        type=frames_by(bake_range.parse_chunk),
        help="bake only these frames, into the same files as other processes",
    )
    add_objects(command, "which meshes (default: all visible ones with modifiers or shape keys)")
    command.add_argument(
        "--format", choices=job.FORMATS, default="pc2", help="point caches pc2 (the default) or mdd, or usd"
    )
    command.add_argument(
        "--until-subdivision", action="store_true", help="the shape before the first Subdivision Surface modifier"
    )
    command.add_argument(
        "--usd-points", action="store_true", help="USD with points on each frame, even where a skeleton would do"
    )
    command.add_argument(
        "--overwrite", action="store_true", help="replace what is there, finished or not; not with --chunk"
    )
    command.add_argument(
        "--verify",
        action="store_true",
        help="bake nothing: exit with 0 if everything is baked and complete, else say what is missing",
    )


def add_bake_to_bones(commands: Any) -> None:
    command = add_command(
        commands,
        "bake-to-bones",
        "make an armature with keyframes and meshes with weights that play what meshes do, whatever deforms them",
    )
    add_file(command)
    add_objects(command, "which meshes, for one armature (default: all visible ones with modifiers or shape keys)")
    add_frames(command, "the frames to bake (default: the scene's; if the first is negative, --frames=-5-10)")
    bones = command.add_mutually_exclusive_group()
    bones.add_argument(
        "--bones", metavar="N", type=positive_integer, default=20, help="the largest number of bones to find (20)"
    )
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
    to_bones_options.add_exact(command)
    command.add_argument(
        "--max-influences", metavar="N", type=positive_integer, default=4, help="the most bones per vertex (4)"
    )
    command.add_argument("--iterations", metavar="N", type=positive_integer, default=30, help="how many at most (30)")
    command.add_argument(
        "--tolerance",
        metavar="S",
        type=share,
        default=1e-3,
        help="stop when three iterations lower the error by less than this share of it (0.001)",
    )
    command.add_argument(
        "--max-error",
        metavar="D",
        type=positive_number,
        help="fail, and save nothing, if a vertex, or with --exact a bone, is further off than this on any frame, in "
        "Blender's unit",
    )
    add_save(command)


def add_bench(commands: Any) -> None:
    command = add_command(commands, "bench", "how long a frame takes with Sinew and with Blender's Armature modifier")
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
    add_output_kind(command, default="modifier")
    add_file_options(command)


def add_file_options(command: argparse.ArgumentParser) -> None:
    group = command.add_argument_group("how to read a rig folder", argument_default=argparse.SUPPRESS)
    group.add_argument("--mesh", metavar="FILE", help="the mesh's file, beside the skeleton (mesh.obj)")
    group.add_argument(
        "--weights",
        metavar="FILE",
        help="the weights' file (weights.dmat), or auto: made from the bones, as without a file",
    )
    group.add_argument("--pose", metavar="FILE", help="file of the poses (default: pose.dmat, else anim.dmat)")
    group.add_argument(
        "--convention",
        choices=("auto", "bone", "joint"),
        help="what a row of a .bf file stands for (auto: as the file says)",
    )
    group.add_argument(
        "--quaternion-order", choices=("wxyz", "xyzw"), help="the order of the numbers in the poses (wxyz)"
    )


def add_output_kind(command: Any, **default: str) -> None:
    command.add_argument(
        "--output-kind",
        dest="output",
        choices=("modifier", "mesh"),
        **default,
        help="where the shape goes: through a modifier (the default), or also into a copy of the mesh",
    )
