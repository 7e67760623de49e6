"""The commands `bake`, which bakes objects of a .blend or checks whether they were baked completely, and
`bake-to-bones`, which makes an armature and meshes with weights that play meshes, or a rig. Each returns a JSON
document, and the same as text, and raises ValueError or OSError.
"""

import argparse
from typing import Any

import bpy

from ..bake import baking, evaluation, frame_range, verify
from ..bake import job as jobs
from ..plan import bindable
from ..to_bones import bake_options, conversion, exact, gltf, report
from . import arguments
from .blend_files import chosen_armature, names_of, open_named, save


def bake(options: argparse.Namespace) -> tuple[dict[str, Any], str]:
    """Bakes to files, or checks them: with --verify the ValueError lists everything that is wrong."""
    open_named(options, "bake")
    job = job_of(options)
    if options.verify:
        return _verify(job)
    baked = baking.run(bpy.context, job)
    document = {"path": bpy.data.filepath, "frames": str(job.frames), "format": job.format}
    text = "\n".join(each.sentence() for each in baked)
    return {**document, "objects": [vars(each) for each in baked]}, text


def job_of(options: argparse.Namespace) -> jobs.Job:
    scene = bpy.context.scene
    return jobs.Job(
        folder=options.folder,
        frames=options.frames or frame_range.FrameRange(scene.frame_start, scene.frame_end),
        names=names_of(options.objects),
        format=options.format,
        chunk=options.chunk,
        overwrite=options.overwrite,
        until_subdivision=options.until_subdivision,
        usd_points=options.usd_points,
    )


def _verify(job):
    if job.format == jobs.USD:
        raise ValueError("--verify is only for point caches: a USD file does not exist until it is complete")
    names = [ob.name for ob in evaluation.objects_to_bake(bpy.context, job.names)]
    problems = [problem for name in names for problem in verify.problems(job.path_of(name), job.frames)]
    if problems:
        raise ValueError("; ".join(problems))
    document = {"path": bpy.data.filepath, "frames": str(job.frames), "format": job.format, "whole": names}
    return document, "\n".join(f"{job.path_of(name)} is complete: {len(job.frames)} frames" for name in names)


def bake_to_bones(options: argparse.Namespace) -> tuple[dict[str, Any], str]:
    """Makes an armature, and meshes with weights. Raises ValueError also if the error is larger than --max-error: then
    nothing is saved."""
    open_named(options, "bake-to-bones")
    if bpy.context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    scene = bpy.context.scene
    frames = options.frames or frame_range.FrameRange(scene.frame_start, scene.frame_end)
    if options.exact:
        return _exact(options, frames)
    if arguments.given(options, bake_options.ExactOptions) or hasattr(options, "armature"):
        raise ValueError("these options are for bakes with --exact: add it, or leave them out")
    found = arguments.given(options, bake_options.FoundOptions)
    settings = conversion.Settings(frames=frames, **found | {"bones": 0} if options.rig_bones else found)
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
    """Saves the file if that is wanted, and returns the JSON document and the text."""
    if options.save:
        save()
    document = {"path": bpy.data.filepath, "saved": options.save, **made.document()}
    return document, made.sentence()
