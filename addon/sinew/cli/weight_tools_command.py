"""The commands `weights transfer`, `smooth`, `mirror` and `reduce`: edit the weights of meshes of a .blend."""

import argparse
from collections.abc import Callable
from typing import Any

import bpy

from ..blender import units
from ..weights import editing, judging_poses, reducing, transferring, weight_settings
from . import arguments
from .bake_command import names_of
from .weights_command import save

Result = tuple[dict[str, Any], str, int]


def transfer(options: argparse.Namespace, open_blend: Callable[[str], None]) -> Result:
    """Runs the command. Returns the JSON document, the text and the exit code: 1 if a vertex has got no weights.
    open_blend(path) opens a file. Raises ValueError or OSError."""
    _open(options, open_blend)
    settings = arguments.read(options, weight_settings.TransferSettings)
    made = transferring.Transfer(_meshes(options.sources), _meshes(options.targets), settings, options.add_modifier)
    made.compute()
    report = made.report() if options.measure else made.write()
    return _done(options, [report.document()], [report.sentence()], report.unweighted > 0)


def smooth(options: argparse.Namespace, open_blend: Callable[[str], None]) -> Result:
    """Runs the command, as transfer does. The exit code is 0."""
    settings = arguments.read(options, weight_settings.SmoothSettings)
    return _edit(options, open_blend, lambda ob: editing.Smoothing(ob, settings))


def mirror(options: argparse.Namespace, open_blend: Callable[[str], None]) -> Result:
    """Runs the command, as transfer does. The exit code is 0."""
    settings = arguments.read(options, weight_settings.MirrorSettings)
    return _edit(options, open_blend, lambda ob: editing.Mirroring(ob, settings))


def reduce(options: argparse.Namespace, open_blend: Callable[[str], None]) -> Result:
    """Runs the command, as transfer does. The exit code is 1 if a vertex moves farther than the tolerance."""
    _open(options, open_blend)
    scene = bpy.context.scene
    settings = arguments.read(options, weight_settings.ReduceSettings)
    frames = options.frames or judging_poses.spread(scene.frame_start, scene.frame_end)

    def pose(armature, names):
        if not options.test_poses:
            try:
                return judging_poses.on_frames(bpy.context, armature, names, frames)
            except judging_poses.AtRest:
                if options.frames:
                    raise
        return judging_poses.in_test_poses(armature, names)

    made = [reducing.Reduction(ob, pose, settings) for ob in _meshes(options.objects)]
    for each in made:
        each.compute()
    found = [each.report() if options.measure else each.write() for each in made]
    text = [f"{each.objects[0]}: {each.sentence(lambda distance: units.length(scene, distance))}" for each in found]
    return _done(options, [each.document() for each in found], text, any(each.over for each in found))


def _edit(options, open_blend, make):
    _open(options, open_blend)
    made = [make(ob) for ob in _meshes(options.objects)]
    for each in made:
        each.compute()
    found = [each.write() for each in made]
    text = [f"{each.objects[0]}: {each.sentence()}" for each in found]
    return _done(options, [each.document() for each in found], text, False)


def _open(options, open_blend):
    if options.path:
        open_blend(options.path)
    elif not bpy.data.filepath:
        raise ValueError("no file is open: name one before --command, or after the command")
    bpy.context.view_layer.update()


def _meshes(words):
    """Returns the mesh objects of these names."""
    for name in names_of(words):
        ob = bpy.data.objects.get(name)
        if ob is None or ob.type != "MESH":
            raise ValueError(f"there is no mesh {name}")
    return [bpy.data.objects[name] for name in dict.fromkeys(names_of(words))]


def _done(options, documents, text, is_bad):
    is_saved = options.save and not getattr(options, "measure", False)
    if is_saved:
        save()
    whole = {"path": bpy.data.filepath, "saved": is_saved, "results": documents}
    return whole, "\n".join(text), int(is_bad)


COMMANDS = {"weights transfer": transfer, "weights smooth": smooth, "weights mirror": mirror, "weights reduce": reduce}
