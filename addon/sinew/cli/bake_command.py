"""The command `bake`: bakes objects of a .blend, or checks whether they were baked completely."""

import argparse
from collections.abc import Callable, Iterable
from typing import Any

import bpy

from ..bake import baking, evaluation, frame_range, verify
from ..bake import job as jobs


def run(options: argparse.Namespace, open_blend: Callable[[str], None]) -> tuple[dict[str, Any], str]:
    """Runs the command. Returns the JSON document and the text. open_blend(path) opens a file. Raises ValueError or
    OSError; with --verify the ValueError lists everything that is wrong."""
    if options.path:
        open_blend(options.path)
    elif not bpy.data.filepath:
        raise ValueError("no file is open: name one before --command, or after bake")
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


def names_of(words: Iterable[str] | None) -> tuple[str, ...]:
    """Returns the object names in the words, each of which is a name or a comma-separated list of names."""
    return tuple(
        name for word in words or () for name in ([word] if word in bpy.data.objects else word.split(",")) if name
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
