"""The arguments that can follow `sinew rig`."""

import argparse
import os
from collections.abc import Callable

from .option_types import blend_path, positive_integer


def add(add_command: Callable[[str, str], argparse.ArgumentParser]) -> None:
    command = add_command("rig", "write an armature as a rig that is computed without Blender, or check it")
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
    command.add_argument(
        "--frames", metavar="N", type=positive_integer, default=20, help="how many frames, from the scene's first (20)"
    )
    command.add_argument(
        "--random-poses", metavar="N", type=positive_integer, default=5, help="how many poses with random values (5)"
    )
