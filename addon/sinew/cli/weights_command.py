"""The command `weights`: makes or checks the weights of meshes of a .blend."""

import argparse
from collections.abc import Callable
from typing import Any

import bpy

from ..plan import bindable
from ..weights import assigning, checking, parenting, pose_sheet
from ..weights.weight_settings import AutomaticSettings
from . import arguments
from .bake_command import names_of


def run(options: argparse.Namespace, open_blend: Callable[[str], None]) -> tuple[dict[str, Any], str, int]:
    """Runs the command. Returns the JSON document, the text and the exit code: 1 if a vertex has no weights.
    open_blend(path) opens a file. Raises ValueError or OSError."""
    if options.path:
        open_blend(options.path)
    elif not bpy.data.filepath:
        raise ValueError("no file is open: name one before --command, or after weights")
    armature = _armature(options.armature)
    objects = _objects(names_of(options.objects), armature)
    if options.check:
        return _check(objects, options)
    if options.sheet:
        raise ValueError("--sheet is a picture of what is checked: give --check, too")
    assigning.refuse(objects, armature)
    for ob in objects:
        why = parenting.why_not(ob, armature)
        if why:
            raise ValueError(f"{ob.name} {why}")
    made = assigning.Assignment(objects, armature, arguments.read(options, AutomaticSettings))
    made.compute()
    report = made.write()
    for ob in objects:
        parenting.parent(ob, armature)
    if options.save:
        save()
    warnings = [warning for warning in (parenting.deformed_twice(ob, armature) for ob in objects) if warning]
    document = {"path": bpy.data.filepath, "saved": options.save, **report.document(), "warnings": warnings}
    return document, "\n".join([report.sentence(), *warnings]), int(report.unweighted > 0)


def save() -> None:
    """Saves the open file in its place. Raises ValueError."""
    try:
        bpy.ops.wm.save_mainfile()
    except RuntimeError as error:
        raise ValueError(str(error).strip().removeprefix("Error: ")) from error


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


def _objects(names, armature):
    """Returns the meshes of these names; without names, those that belong to the armature."""
    if not names:
        found = [ob for ob in bpy.context.scene.objects if ob.type == "MESH" and bindable.find_armature(ob) == armature]
        found = [ob for ob in found if ob.sinew.copy_of is None]
        if not found:
            raise ValueError(f"no mesh belongs to {armature.name}: name the meshes with --objects NAME,...")
        return found
    for name in names:
        ob = bpy.data.objects.get(name)
        if ob is None or ob.type != "MESH":
            raise ValueError(f"there is no mesh {name}")
    return [bpy.data.objects[name] for name in dict.fromkeys(names)]
