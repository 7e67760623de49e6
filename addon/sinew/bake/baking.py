"""Bakes objects of the open scene, frame by frame."""

import os
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from typing import Any

from ..feedback import long_work
from . import evaluation, part_files, systems, usd_baking
from . import job as jobs
from . import subject as subjects
from .evaluation import Shapes
from .job import Baked


def run(context: Any, job: jobs.Job) -> list[Baked]:
    """Runs the whole bake. Returns [Baked], or raises ValueError or OSError."""
    return long_work.finish(steps(context, job))


def steps(context: Any, job: jobs.Job) -> Generator[tuple[float, str], None, list[Baked]]:
    """Bakes step by step: a generator of (share done, what comes next) that returns [Baked], one per object. Closing it
    early is safe: the baked frames are kept, and the same job continues from there. Mode, modifiers and frame are
    restored. Raises ValueError or OSError."""
    indices = job.indices()
    objects = evaluation.objects_to_bake(context, job.names)
    job.check_names([ob.name for ob in objects])
    evaluation.refuse_other_shapes(objects)
    with part_files.advising_room(job.folder):
        os.makedirs(systems.native(job.folder), exist_ok=True)
    with ExitStack() as stack:
        stack.enter_context(evaluation.undisturbed(context))
        if job.until_subdivision:
            stack.enter_context(evaluation.until_subdivision(objects))
        if job.format == jobs.USD:
            return (yield from usd_baking.steps(context, job, objects))
        return (yield from _point_caches(context, job, objects, indices))


def _point_caches(context, job, objects, indices):
    frames, scene = list(job.frames), context.scene
    _check_paths(job, objects)
    yield 0.0, f"baking frame {frames[indices[0]]}"
    scene.frame_set(frames[indices[0]])
    depsgraph = context.evaluated_depsgraph_get()
    digest = evaluation.digest_of_file()
    rate = scene.render.fps / scene.render.fps_base
    caches = []
    with ExitStack() as stack:
        shapes = Shapes(stack)
        for ob in objects:
            count = len(shapes.read(ob, depsgraph)[0])
            subject = subjects.Subject(ob.name, job.format, count, job.frames, rate, job.until_subdivision, digest)
            caches.append(_Cache(job, ob, subject, stack))
        missing = {cache.ob: sum(not cache.has(index) for index in indices) for cache in caches}
        yield from shapes.prepare(context, missing)
        for number, index in enumerate(indices):
            waiting = [cache for cache in caches if not cache.has(index)]
            if not waiting:
                continue
            yield number / len(indices), f"baking frame {frames[index]}"
            scene.frame_set(frames[index])
            depsgraph = context.evaluated_depsgraph_get()
            for cache in waiting:
                cache.write(index, frames[index], shapes.read(cache.ob, depsgraph))
        for cache in caches:
            cache.finish()
            cache.baked.remark = shapes.remark(cache.ob)
    return [cache.baked for cache in caches]


def _check_paths(job, objects):
    """Cleans up after dead processes and checks the paths, before anything is evaluated. Raises ValueError if a
    finished cache would be lost."""
    for ob in objects:
        path = job.path_of(ob.name)
        part_files.tidy(path)
        if job.overwrite:
            part_files.discard(path)
        elif os.path.exists(systems.native(path)) and job.chunk is None:
            raise ValueError(f"{path} already exists; {part_files.ADVICE}")


class _Cache:
    """The cache of one object."""

    def __init__(self, job, ob, subject, stack):
        path = job.path_of(ob.name)
        self.ob, self._subject, self._part = ob, subject, None
        self.baked = Baked(ob.name, path, subject.vertex_count, len(subject.frames))
        if job.chunk is not None and subjects.is_whole(path, subject):
            self.baked.found = self.baked.frames
        elif job.chunk is not None and os.path.exists(systems.native(path)):
            raise ValueError(
                f"{path} already exists, from another bake: remove it before the first chunk, or choose another folder"
            )
        else:
            self._part = stack.enter_context(part_files.PartFiles(path, subject))
            self.baked.found = len(self._part.found)

    def has(self, index: int) -> bool:
        """Whether a frame was baked, by whichever process."""
        return self._part is None or self._part.has(index)

    def write(self, index: int, frame: int, shape: tuple[Any, Any]) -> None:
        """shape: as returned by Shapes.read."""
        positions, world = shape
        evaluation.check_count(self.ob, frame, len(positions), self._subject.vertex_count)
        with _advising(f"the frames before {frame}"):
            self._part.write(index, positions, world)
        self.baked.baked += 1

    def finish(self) -> None:
        if self._part is not None:
            with _advising("the frames that were baked"):
                self.baked.missing = len(self._part.finish())


@contextmanager
def _advising(kept):
    """Adds advice to errors of the disk."""
    try:
        yield
    except OSError as error:
        said = f"{error.strerror}; {kept} are kept: bake again to continue from there"
        raise OSError(error.errno, said, error.filename) from error
