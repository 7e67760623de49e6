"""`sinew rig`: an armature as a description of its rig, and whether its program computes what Blender does."""

import argparse
import json
from typing import Any

import bpy
import numpy as np

from ..description import equality, reading
from ..played import followers
from ..rig_files import rig_export
from .blend_files import chosen_armature, open_blend

SHOWN = 3  # differences


def run(options: argparse.Namespace) -> tuple[dict[str, Any], str, int]:
    """Returns a JSON document, the same as text, and the exit code: 1 if the rig is refused or computed differently."""
    open_blend(options.path)
    ob = chosen_armature(options.object)
    read = reading.read(ob, may_move=True)
    try:
        if not read.targets.moves:
            followers.check_parent(ob)
    except followers.NotPlayable as error:
        read.description["refused"].append(str(error))
    document: dict[str, Any] = {"object": ob.name, "bones": len(ob.pose.bones)}
    lines = [f"{ob.name}: {len(ob.pose.bones):,} bones"]
    if options.output:
        with open(options.output, "w", encoding="utf-8") as file:
            json.dump(read.description, file, default=reading.as_list)
        document["output"] = options.output
        lines.append(f"written to {options.output}")
    if options.skin:
        mesh = rig_export.mesh_to_export(bpy.context, ob, options.mesh)
        with open(options.skin, "wb") as skin:
            np.savez(skin, **rig_export.skin_of(bpy.context, mesh, ob))
        document |= {"mesh": mesh.name, "skin": options.skin}
        lines.append(f"the skin of {mesh.name} written to {options.skin}")
    document["refused"] = refusals(read)
    lines += [f"cannot be a program: {reason}" for reason in document["refused"]]
    if document["refused"] or not options.check:
        return document, "\n".join(lines), int(bool(document["refused"]))
    _show(ob)
    program = equality.program_of(read)
    first = bpy.context.scene.frame_start
    times = [first + step for step in range(options.frames)] + [first + 0.25, first + 1.5]
    different = []
    for name, recorded in (
        ("frames", equality.record_frames(ob, read, times)),
        ("random_poses", equality.record_random_poses(ob, read, options.random_poses)),
    ):
        found = equality.differences(program, recorded)
        document[name] = {"compared": len(recorded.times), "different": len(found)}
        lines.append(f"{name.replace('_', ' ')}: {len(recorded.times) - len(found)} of {len(recorded.times)} equal")
        different += found
    lines += [f"  {difference}" for difference in different[:SHOWN]]
    document["differences"] = [str(difference) for difference in different]
    return document, "\n".join(lines), int(bool(different))


def _show(ob: bpy.types.Object) -> None:
    """Has Blender evaluate an armature object that is hidden."""
    own = bpy.context.scene.collection.objects
    if ob not in own.values():
        own.link(ob)
    ob.hide_viewport = False
    ob.hide_set(False)
    bpy.context.view_layer.update()


def refusals(read: reading.Reading) -> list[str]:
    """Returns the reasons why the rig cannot be a program."""
    if read.description["refused"]:
        return list(read.description["refused"])
    try:
        equality.program_of(read)
    except ValueError as error:
        return [str(error)]
    return []
