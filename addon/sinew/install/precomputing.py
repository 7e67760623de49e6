"""Computes, in a thread of the library, the data that a skinning method needs once for each mesh."""

import logging

import bpy
import numpy as np

from ..blender import kept_arrays, meshes, values
from ..chain import methods
from ..feedback import notice
from ..native import sinew_native
from ..run import characters, errors

log = logging.getLogger("sinew")
SECONDS_BETWEEN_LOOKS = 0.1
_jobs: dict[int, "Job"] = {}  # key of a mesh object -> Job


class Impossible(ValueError):
    """Nothing can be computed. The message gives the reason."""


class Job:
    """One computation in a thread of its own."""

    def __init__(self, ob, layer, method):
        """Starts the thread. layer: layers.Layer; method: methods.Method, one that is precomputed."""
        self.key, self.name, self.made_of = values.key_of(ob), ob.name, layer.wanted
        self.progress = sinew_native.Progress()
        self.arrays = self.error = None
        skin = layer.skin
        faces = meshes.read_faces(ob.data)[:2]

        def run():
            try:
                self.arrays = methods.compute(method.kind, method.settings, skin, faces, self.progress)
            except Exception as error:
                self.error = error

        self.task = sinew_native.Task(run)


def lacks(ob: bpy.types.Object) -> str:
    """Returns why the saved data of a bound mesh's method cannot be used: a value of methods.py, or ""."""
    entry = characters.character(ob)
    return entry.layers[0].lacks if entry is not None and entry.layers else ""


def job_of(ob: bpy.types.Object) -> Job | None:
    """Returns the running job of a mesh, or None."""
    return _jobs.get(values.key_of(ob))


def start(ob: bpy.types.Object) -> None:
    """Starts to compute the data that the method of a bound mesh needs.

    In a window the result follows some time later; in the background the function waits for it. Raises Impossible.
    """
    cancel(ob)
    bpy.context.view_layer.update()
    entry = characters.of(ob)
    if entry.method.kind not in methods.PRECOMPUTED or not entry.layers:
        reason = entry.status.error or entry.way.reason or "no armature deforms it by such a method"
        raise Impossible(f"Nothing can be computed for {ob.name}: {reason}")
    job = Job(ob, entry.layers[0], entry.method)
    if bpy.app.background:
        job.task.wait()
        _finish(job)
        bpy.context.view_layer.update()
        return
    _jobs[job.key] = job
    if not bpy.app.timers.is_registered(_look):
        bpy.app.timers.register(_look, first_interval=SECONDS_BETWEEN_LOOKS)


def cancel(ob: bpy.types.Object) -> None:
    """Cancels the running job of a mesh. The mesh keeps the data that it has."""
    job = _jobs.pop(values.key_of(ob), None)
    if job is not None:
        job.progress.cancel()


def drop(ob: bpy.types.Object) -> None:
    """Cancels the object's job and removes its data."""
    cancel(ob)
    text, ob.sinew.skinning.data = ob.sinew.skinning.data, None
    kept_arrays.remove(text)


def forget() -> None:
    """Cancels all jobs and waits for them, before another file is opened or the add-on is switched off."""
    for job in _jobs.values():
        job.progress.cancel()
        job.task.wait()
    _jobs.clear()


def _look():
    """Finishes the jobs whose threads have ended. A timer: returns the seconds to its next call, or None."""
    for job in [job for job in _jobs.values() if job.task.is_done]:
        del _jobs[job.key]
        _finish(job)
    notice.redraw()
    return SECONDS_BETWEEN_LOOKS if _jobs else None


def _finish(job):
    """Saves the result of a job, or reports its error."""
    ob = characters.find(job.key)
    if ob is None:
        return  # it was deleted or unbound meanwhile
    if job.error is not None:
        log.error("%s: %s", job.name, job.error, exc_info=job.error)
        errors.report(ob, f"The skinning method of {job.name} could not be prepared: {job.error}")
    elif job.arrays is not None:
        keep(ob, job.made_of, job.arrays)
        if not bpy.app.background:
            bpy.ops.ed.undo_push(message="Prepare Skinning Method")


def keep(ob: bpy.types.Object, made_of: str, arrays: dict[str, np.ndarray]) -> None:
    """Saves the computed data of a mesh's method in the .blend.

    made_of: as returned by methods.made_of; arrays: {name: array}.
    """
    skinning = ob.sinew.skinning
    text = kept_arrays.write(skinning.data, ob.name, made_of, arrays)
    if skinning.data != text:
        skinning.data = text
    characters.of(ob).look_again()
    ob.update_tag()
