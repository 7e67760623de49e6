"""The arguments that follow `sinew bake-to-bones --exact`."""

import argparse
import os
from typing import Any

from ..to_bones.bone_names import read_names
from .option_types import frames_by, identifier, positive_number


def add_exact(command: argparse.ArgumentParser) -> None:
    group = command.add_argument_group("with --exact", argument_default=argparse.SUPPRESS)
    group.add_argument("--armature", metavar="NAME", help="the rig, if there are several armatures")
    group.add_argument(
        "--all-actions",
        dest="actions",
        action="store_const",
        const="*",
        help="bake each action that moves the rig's bones, on its own frames, with the step of --frames (default: the "
        "scene as it plays)",
    )
    group.add_argument("--actions", metavar="GLOB", help="only actions with such names, for example 'walk*'")
    group.add_argument("--skeleton", dest="target", metavar="NAME", help="the armature to update (default: a new one)")
    group.add_argument("--root", metavar="BONE", help="the bone of the rig below which all others are put")
    group.add_argument(
        "--root-motion",
        choices=("bones", "root", "in-place"),
        help="root: it gets what moves the others along the ground; in-place: that is left out (bones)",
    )
    group.add_argument("--flat", dest="is_flat", action="store_true", help="no bone but the root has children")
    group.add_argument(
        "--segments", dest="has_segments", action="store_true", help="a bone for each end of a B-bone's segments"
    )
    group.add_argument(
        "--only-roots-move", dest="roots_alone_move", action="store_true", help="no bone with a parent has a location"
    )
    group.add_argument(
        "--key-error",
        type=positive_number,
        metavar="LENGTH",
        help="leave out keyframes for which lines do, as long as no bone is further off than this on any frame",
    )
    group.add_argument("--no-meshes", dest="copies_meshes", action="store_false", help="do not copy the meshes")
    group.add_argument(
        "--names", metavar="FILE", type=frames_by(read_names), help="other names for bones, a line NAME = NEW NAME each"
    )
    group.add_argument(
        "--gltf", metavar="FILE.glb", type=os.path.abspath, help="also write the skeleton and the meshes to this file"
    )


def given(options: argparse.Namespace) -> dict[str, Any]:
    """Returns those that were given, by name, without the rig and the file to write."""
    names = ("actions", "target", "root", "root_motion", "is_flat", "has_segments", "roots_alone_move")
    found = {
        name: getattr(options, name)
        for name in (*names, "copies_meshes", "names", "key_error")
        if hasattr(options, name)
    }
    if "root_motion" in found:
        found["root_motion"] = identifier(found["root_motion"])
    return found
