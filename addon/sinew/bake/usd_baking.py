"""Bakes objects of the open scene into USD files: with a skeleton if that gives the same shape, else with points."""

import os
import sys
from collections.abc import Generator, Sequence
from contextlib import ExitStack

import bpy
import numpy as np

from ..blender import bounds
from . import evaluation, part_files, usd
from .evaluation import Shapes
from .job import Baked, Job
from .skinned_mesh import LinearCharacter, NotLinear

TOLERANCE = 1e-5  # how far skinning may differ from Blender's result, as a fraction of the diagonal


def steps(
    context: bpy.types.Context, job: Job, objects: Sequence[bpy.types.Object]
) -> Generator[tuple[float, str], None, list[Baked]]:
    """Bakes step by step: a generator like that of baking.py, which calls it."""
    usd.load(getattr(bpy.utils, "expose_bundled_modules", None), _advice())
    for ob in objects:
        path = job.path_of(ob.name)
        if os.path.exists(path) and not job.overwrite:
            raise ValueError(f"{path} already exists; {part_files.ADVICE}")
    baked: dict[bpy.types.Object, Baked]
    by_points, baked = dict.fromkeys(objects, ""), {}
    if not job.usd_points:
        by_points = yield from _bake(context, job, objects, _Skinned, baked)
    yield from _bake(context, job, list(by_points), _Pointed, baked)
    for ob, reason in by_points.items():
        said = f"points, since {reason}" if reason else "points"
        baked[ob].remark = "; ".join(filter(None, (said, baked[ob].remark)))
    return [baked[ob] for ob in objects]


def _advice():
    folder = bpy.utils.user_resource("SCRIPTS", path=os.path.join("addons", "modules"))
    version = "{}.{}".format(*sys.version_info)
    return f": pip install --only-binary=:all: --python-version {version} --target {folder} usd-core"


def _bake(context, job, objects, kind, baked):
    """Bakes all objects frame by frame. Puts results into baked {object: Baked}; returns {object: why it was not}."""
    scene, sinks, refused = context.scene, {}, {}
    with ExitStack() as stack:
        shapes = Shapes(stack)
        for number, frame in enumerate(job.frames if objects else ()):
            yield number / len(job.frames), f"baking frame {frame}"
            scene.frame_set(frame)
            depsgraph = context.evaluated_depsgraph_get()
            for ob in objects:
                try:
                    if number == 0:
                        sinks[ob] = kind(scene, job, ob, depsgraph, stack, shapes)
                        if kind is _Pointed:
                            yield from shapes.prepare(context, {ob: len(job.frames)})
                    if ob in sinks:
                        sinks[ob].write(frame, depsgraph)
                except NotLinear as error:
                    refused[ob] = str(error)
                    sinks.pop(ob, None)
            if len(refused) == len(objects):
                break
        for ob, sink in sinks.items():
            sink.file.save()
            baked[ob] = Baked(ob.name, sink.file.path, sink.vertex_count, len(job.frames), len(job.frames))
            baked[ob].remark = "skeleton" if kind is _Skinned else shapes.remark(ob)
    return refused


def _open(kind, scene, job, ob, stack):
    rate = scene.render.fps / scene.render.fps_base
    file = kind(job.path_of(ob.name), ob.name, job.frames, rate, scene.unit_settings.scale_length)
    return stack.enter_context(file)


def _scheme(job, ob):
    """Returns the subdivision scheme for readers: "catmullClark" if the bake ended before subdivision, or "none"."""
    is_cut = job.until_subdivision and any(modifier.type == "SUBSURF" for modifier in ob.modifiers)
    return "catmullClark" if is_cut else "none"


class _Pointed:
    """A mesh that is written as points on each frame."""

    def __init__(self, scene, job, ob, depsgraph, stack, shapes):
        self._ob, self._shapes = ob, shapes
        topology, self.vertex_count = evaluation.read_topology(ob, depsgraph)
        self.file = _open(usd.PointsFile, scene, job, ob, stack)
        self.file.begin(topology, _scheme(job, ob))

    def write(self, frame: int, depsgraph: bpy.types.Depsgraph) -> None:
        positions, world = self._shapes.read(self._ob, depsgraph)
        evaluation.check_count(self._ob, frame, len(positions), self.vertex_count)
        self.file.write(frame, positions, world)


class _Skinned:
    """A mesh that is written with its skeleton. Raises NotLinear if the shape would differ from Blender's."""

    def __init__(self, scene, job, ob, depsgraph, stack, shapes):
        self._ob, self._shapes = ob, shapes
        self._character = character = LinearCharacter(ob, depsgraph)
        topology, self.vertex_count = evaluation.read_topology(ob, depsgraph)
        self.file = _open(usd.SkeletonFile, scene, job, ob, stack)
        self.file.begin(topology, _scheme(job, ob), character.rest, character.influences, character.skeleton)

    def write(self, frame: int, depsgraph: bpy.types.Depsgraph) -> None:
        positions, world = self._shapes.read(self._ob, depsgraph)
        try:
            kept = self.file.write(frame, self._character.posed(depsgraph), world)
        except np.linalg.LinAlgError as error:
            raise NotLinear(f"on frame {frame} a bone has a scale of 0") from error
        skinned = self._character.skinned(kept)
        if skinned.shape != positions.shape:
            raise NotLinear("its vertices are not those of its mesh")
        size = bounds.diagonal(positions)
        off = float(np.abs(skinned - positions).max(initial=0.0))
        if not off <= TOLERANCE * size:
            share = off / size if size else off
            raise NotLinear(f"on frame {frame} a skeleton without scale would be off by {share:.2g} of the diagonal")
