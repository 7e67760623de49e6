"""Sinew from a shell, for render farms and tests: `info`, `import`, `export`, `weights`, `bake`,
`bake-to-bones`, `rig` and `bench`.

    blender -b --command sinew info PATH                                      Blender 4.2 and later
    blender -b --addons sinew --python-expr "from sinew.cli import command_line; command_line.main()" -- info PATH

Exit codes: 0 done; 1 failed, with the reason on stderr; 2 wrong usage. With --json the last
line on stdout is a JSON document.
"""

import argparse
import ctypes
import json
import os
import sys
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

import bpy

from ..main import memory_use
from ..plan import bindable
from ..profiling import costs, measure
from ..rig_files import rig_export, rig_import
from ..rig_files.file_options import ExportOptions, FileOptions, ImportOptions
from . import bake_commands, bench_command, command_options, output, rig_command, weight_commands
from .arguments import identifier, read
from .blend_files import open_blend, sentence


def run(arguments: Sequence[str]) -> int:
    """Runs one command. arguments: the words after `sinew`. Returns the exit code."""
    try:
        options = command_options.make_parser().parse_args(command_options.joined(list(arguments)))
    except SystemExit as stop:  # argparse has printed help or an error
        return stop.code or 0  # type: ignore[return-value] # argparse's codes are numbers
    try:
        document, text, *code = COMMANDS[options.command](options)
    except (ValueError, OSError, MemoryError) as error:
        print(f"sinew: {sentence(error)}", file=sys.stderr, flush=True)
        return 1
    if os.name == "posix":  # in a pipe, Blender's own output would otherwise appear after ours
        ctypes.CDLL(None).fflush(None)
    print(json.dumps(document) if options.json else text, flush=True)
    return code[0] if code else 0


def main() -> NoReturn:
    """Runs the words after `--` and ends the process."""
    sys.exit(run(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []))


# --- commands: options -> JSON document, text, exit code if not 0 -----------------------------------------------------


def info(options: argparse.Namespace) -> tuple[dict[str, Any], str]:
    if options.profile:
        return profile(options)
    if options.frames:
        raise ValueError("--frames needs --profile")
    if options.path.endswith(".blend"):
        open_blend(options.path)
        document, text = output.report_meshes(options.path, bench_command.deformed_meshes(bpy.data.objects))
        return document | {"program": memory_use.facts()}, "\n".join((text, "", *memory_use.states()))
    return output.report_rig(skeleton_path(options.path), read(options, FileOptions))


def profile(options: argparse.Namespace) -> tuple[dict[str, Any], str]:
    if not options.path.endswith(".blend"):
        raise ValueError(f"--profile needs a .blend file, which {options.path} is not")
    open_blend(options.path)
    found = measure.run(bpy.context, *(options.frames or costs.frames_of(bpy.context.scene)))
    return output.report_profile(options.path, found)


def import_(options: argparse.Namespace) -> tuple[dict[str, Any], str]:
    folder = os.path.dirname(options.blend)
    if not os.path.isdir(folder):
        raise ValueError(f"there is no folder {folder}: make it first")
    if os.path.isdir(options.blend):  # Blender would move the folder out of the way
        raise ValueError(f"{options.blend} is a folder: name a file")
    mesh_object = import_into_empty_file(options)
    try:
        bpy.ops.wm.save_as_mainfile(filepath=options.blend)  # writes a temporary file, then renames it
    except RuntimeError as error:
        raise ValueError(sentence(error)) from error
    return output.report_meshes(options.blend, [mesh_object])


def export(options: argparse.Namespace) -> tuple[dict[str, Any], str]:
    """Exports a rig folder, and reports its content as the importer reads it."""
    open_blend(options.path)
    ob = chosen_mesh(options.object)
    if bindable.find_armature(ob) is None:
        raise ValueError(f"{ob.name} has no armature: give it one, or choose another mesh")
    os.makedirs(options.folder, exist_ok=True)
    path = os.path.join(options.folder, "skeleton.bf")
    rig_export.export_rig(bpy.context, ob, path, read(options, ExportOptions))
    return output.report_rig(path, FileOptions())


def run_bench(options: argparse.Namespace) -> tuple[dict[str, Any], str]:
    if options.path.endswith(".blend"):
        open_blend(options.path)
    else:
        import_into_empty_file(options)
    contest = bench_command.set_up(identifier(options.output), options.frames)
    methods = command_options.BLENDERS_METHODS if options.methods == "both" else (options.methods,)
    results = []
    for method in methods:
        bench_command.set_method(contest, identifier(method))
        distance, motion = bench_command.compare(contest)  # first, since it warms everything up
        if motion == 0:
            raise ValueError(
                f"nothing moves on these {options.frames} frames, so there is nothing to measure: choose more with "
                "--frames"
            )
        times = bench_command.measure(contest)
        results.append(
            {
                "method": method,
                **{f"{name}_ms": value for name, value in times.items()},
                "largest_distance": distance,
                "largest_motion": motion,
            }
        )
    return output.report_bench(options, contest, results)


COMMANDS: dict[str, Callable[[argparse.Namespace], tuple[Any, ...]]] = {
    "info": info,
    "import": import_,
    "export": export,
    "weights": weight_commands.assign,
    "weights transfer": weight_commands.transfer,
    "weights smooth": weight_commands.smooth,
    "weights mirror": weight_commands.mirror,
    "weights reduce": weight_commands.reduce,
    "bake": bake_commands.bake,
    "bake-to-bones": bake_commands.bake_to_bones,
    "rig": rig_command.run,
    "bench": run_bench,
}


# --- files ----------------------------------------------------------------------------------------


def skeleton_path(path: str) -> str:
    """Returns the path of a rig folder's skeleton, or path itself if it is a skeleton file."""
    if not os.path.exists(path):
        raise ValueError(f"there is no file or folder {path}")
    if os.path.isdir(path):
        for name in ("skeleton.bf", "skeleton.tgf"):
            if os.path.isfile(os.path.join(path, name)):
                return os.path.join(path, name)
        raise ValueError(f"there is neither skeleton.bf nor skeleton.tgf in {path}")
    if not path.endswith((".bf", ".tgf")):
        raise ValueError(f"{path} is neither a rig folder, a skeleton (.bf, .tgf) nor a .blend file")
    return path


def import_into_empty_file(options: argparse.Namespace) -> bpy.types.Object:
    """Imports a rig into an empty file. Returns the mesh object."""
    path = skeleton_path(options.path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    mesh_object, _armature, remark = rig_import.import_rig(bpy.context, path, read(options, ImportOptions))
    if remark:
        print(f"sinew: {remark}", file=sys.stderr, flush=True)
    return mesh_object


def chosen_mesh(name: str | None) -> bpy.types.Object:
    """Returns the mesh object of that name, or without a name the only deformed one. Raises ValueError."""
    meshes = bench_command.deformed_meshes(bpy.data.objects)
    names = ", ".join(ob.name_full for ob in meshes) or "none"
    if name is None and len(meshes) == 1:
        return meshes[0]
    if name is None:
        raise ValueError(f"choose a mesh with --object NAME; those that an armature deforms: {names}")
    ob = bpy.data.objects.get(name)
    if ob is None or ob.type != "MESH":
        raise ValueError(f"there is no mesh {name}; those that an armature deforms: {names}")
    return ob


# --- registration ---------------------------------------------------------------------------------

registered: list[Any] = []  # Blender's handle of the command, which must be kept alive


def register() -> None:
    if hasattr(bpy.utils, "register_cli_command"):
        registered.append(bpy.utils.register_cli_command("sinew", run))


def unregister() -> None:
    while registered:
        bpy.utils.unregister_cli_command(registered.pop())
