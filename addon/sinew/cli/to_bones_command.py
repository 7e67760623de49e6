"""The command `bake-to-bones`: makes an armature and meshes with weights that play meshes, or a rig, of a .blend."""

import argparse
from collections.abc import Callable
from typing import Any

import bpy

from ..bake import evaluation, frame_range
from ..plan import bindable
from ..to_bones import bake_options, conversion, exact, gltf, report
from . import arguments
from .bake_command import names_of
from .rig_command import chosen_armature


def run(options: argparse.Namespace, open_blend: Callable[[str], None]) -> tuple[dict[str, Any], str, int]:
    """Runs the command. Returns the JSON document, the text and the exit code. open_blend(path) opens a file. Raises
    ValueError, also if the error is larger than --max-error: then nothing is saved."""
    if options.path:
        open_blend(options.path)
    elif not bpy.data.filepath:
        raise ValueError("no file is open: name one before --command, or after bake-to-bones")
    if bpy.context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    scene = bpy.context.scene
    frames = options.frames or frame_range.FrameRange(scene.frame_start, scene.frame_end)
    if options.exact:
        return _exact(options, frames)
    if arguments.given(options, bake_options.ExactOptions) or hasattr(options, "armature"):
        raise ValueError("these options are for bakes with --exact: add it, or leave them out")
    found = arguments.given(options, bake_options.FoundOptions)
    settings = conversion.Settings(frames, **found | {"bones": 0} if options.rig_bones else found)
    objects = evaluation.objects_to_bake(bpy.context, names_of(options.objects))
    made = conversion.run(bpy.context, objects, settings)
    if options.max_error is not None and made.largest > options.max_error:
        raise ValueError(
            f"the largest error is {made.largest:.3g} ({report.length(made.largest)}), which is more than "
            f"{options.max_error:g}: allow more bones, influences or iterations"
        )
    return _saved(options, made)


def _exact(options, frames):
    rig = chosen_armature(getattr(options, "armature", None))
    own = bindable.meshes_of(bpy.context, rig)
    names = names_of(options.objects)
    meshes = evaluation.objects_to_bake(bpy.context, names) if names else own
    for ob in meshes:
        if ob not in own:
            raise ValueError(f"{rig.name} does not deform {ob.name}: name others with --objects")
    given = arguments.given(options, bake_options.ExactOptions)
    glb = given.pop("gltf", "")
    if "skeleton" in given:
        given["target"] = given.pop("skeleton")
    made = exact.run(bpy.context, rig, meshes, exact.ExactSettings(frames, **given))
    if options.max_error is not None and made.largest > options.max_error:
        raise ValueError(f"{made.sentence()}; that is more than {options.max_error:g}: bake with --flat")
    if glb:
        objects = [bpy.data.objects[name] for name in (made.armature, *made.objects)]
        gltf.export(bpy.context, objects, glb)
    return _saved(options, made)


def _saved(options, made):
    """Saves the file if that is wanted, and returns the JSON document, the text and the exit code."""
    if options.save:
        try:
            bpy.ops.wm.save_mainfile()
        except RuntimeError as error:
            raise ValueError(str(error).strip().removeprefix("Error: ")) from error
    document = {"path": bpy.data.filepath, "saved": options.save, **made.document()}
    return document, made.sentence(), 0
