"""The commands `weights` and `weights transfer`, `smooth`, `mirror` and `reduce`: make, check and edit the weights of
meshes of a .blend. Each returns a JSON document, the same as text, and the exit code, and raises ValueError or OSError.
"""

import argparse
from typing import Any

import bpy

from ..blender import units
from ..plan import bindable
from ..weights import (
    assigning,
    checking,
    editing,
    judging_poses,
    parenting,
    pose_sheet,
    reducing,
    transferring,
    weight_settings,
)
from . import arguments
from .blend_files import meshes_named, open_named, save

Result = tuple[dict[str, Any], str, int]


def assign(options: argparse.Namespace) -> Result:
    """Makes or checks weights. The exit code is 1 if a vertex has none."""
    open_named(options, "weights")
    armature = _armature(options.armature)
    objects = meshes_named(options.objects) or _own_meshes(armature)
    if options.check:
        return _check(objects, options)
    if options.sheet:
        raise ValueError("--sheet is a picture of what is checked: give --check, too")
    assigning.refuse(objects, armature)
    for ob in objects:
        parenting.refuse(ob, armature)
    made = assigning.Assignment(objects, armature, arguments.read(options, weight_settings.AutomaticSettings))
    made.compute()
    report = made.write()
    for ob in objects:
        parenting.parent(ob, armature)
    if options.save:
        save()
    warnings = [warning for warning in (parenting.deformed_twice(ob, armature) for ob in objects) if warning]
    document = {"path": bpy.data.filepath, "saved": options.save, **report.document(), "warnings": warnings}
    return document, "\n".join([report.sentence(), *warnings]), int(report.unweighted > 0)


def _check(objects, options):
    checkup = checking.check(objects, options.max_influences or checking.checks.MOST_INFLUENCES, options.angle)
    text = "\n".join([*checkup.worst_poses(), checkup.sentence()])
    document = {"path": bpy.data.filepath, **checkup.document()}
    if options.sheet:
        document["sheet"], document["tiles"] = options.sheet, pose_sheet.write(options.sheet, objects, options.angle)
    return document, text, int(checkup.unweighted > 0)


def _armature(name):
    ob = bpy.data.objects.get(name)
    if ob is None or ob.type != "ARMATURE":
        names = ", ".join(each.name for each in bpy.data.objects if each.type == "ARMATURE") or "none"
        raise ValueError(f"there is no armature {name}; those of the file: {names}")
    return ob


def _own_meshes(armature):
    """Returns the meshes that belong to the armature."""
    found = [ob for ob in bpy.context.scene.objects if ob.type == "MESH" and bindable.find_armature(ob) == armature]
    found = [ob for ob in found if ob.sinew.copy_of is None]
    if not found:
        raise ValueError(f"no mesh belongs to {armature.name}: name the meshes with --objects NAME,...")
    return found


def transfer(options: argparse.Namespace) -> Result:
    """Copies weights. The exit code is 1 if a vertex has got none."""
    _open(options)
    settings = arguments.read(options, weight_settings.TransferSettings)
    made = transferring.Transfer(
        meshes_named(options.sources), meshes_named(options.targets), settings, options.add_modifier
    )
    made.compute()
    report = made.report() if options.measure else made.write()
    return _done(options, [report.document()], [report.sentence()], report.unweighted > 0)


def smooth(options: argparse.Namespace) -> Result:
    """Smooths weights."""
    settings = arguments.read(options, weight_settings.SmoothSettings)
    return _edit(options, lambda ob: editing.Smoothing(ob, settings))


def mirror(options: argparse.Namespace) -> Result:
    """Mirrors weights."""
    settings = arguments.read(options, weight_settings.MirrorSettings)
    return _edit(options, lambda ob: editing.Mirroring(ob, settings))


def reduce(options: argparse.Namespace) -> Result:
    """Leaves vertices fewer bones. The exit code is 1 if a vertex moves farther than the tolerance."""
    _open(options)
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

    made = [reducing.Reduction(ob, pose, settings) for ob in meshes_named(options.objects)]
    for each in made:
        each.compute()
    found = [each.report() if options.measure else each.write() for each in made]
    text = [f"{each.objects[0]}: {each.sentence(lambda distance: units.length(scene, distance))}" for each in found]
    return _done(options, [each.document() for each in found], text, any(each.over for each in found))


def _edit(options, make):
    _open(options)
    made = [make(ob) for ob in meshes_named(options.objects)]
    for each in made:
        each.compute()
    found = [each.write() for each in made]
    text = [f"{each.objects[0]}: {each.sentence()}" for each in found]
    return _done(options, [each.document() for each in found], text, False)


def _open(options):
    open_named(options, "the command")
    bpy.context.view_layer.update()


def _done(options, documents, text, is_bad):
    is_saved = options.save and not getattr(options, "measure", False)
    if is_saved:
        save()
    whole = {"path": bpy.data.filepath, "saved": is_saved, "results": documents}
    return whole, "\n".join(text), int(is_bad)
