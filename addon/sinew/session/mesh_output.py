"""The output Mesh: after each evaluation the shape is written into the original mesh, which Blender evaluates again.

This is the handlers' way, late for whatever looks at the mesh during the evaluation.
"""

from time import perf_counter

import numpy as np

from ..binding import mesh_edits, mesh_output, wiring
from ..blender import meshes, values
from ..rigs import posing
from . import characters

_asleep = 0


class Asleep:
    """Handlers do nothing meanwhile: what Blender evaluates is half done, or Sinew itself has asked for it."""

    def __enter__(self):
        global _asleep
        _asleep += 1

    def __exit__(self, *_):
        global _asleep
        _asleep -= 1


def is_asleep():
    return _asleep > 0


def those_of(objects):
    """The bound objects that have this output."""
    return [ob for ob in objects if ob.sinew.is_bound and ob.sinew.installed_output == "MESH"]


def deform(objects, depsgraph):
    """An error in one mesh is kept with it and said once; the others go on."""
    for ob in objects:
        entry = characters.of(ob)
        try:
            _deform_one(entry, ob, depsgraph)
        except Exception as error:  # noqa: BLE001 - whatever it is, playback goes on
            characters.keep_error(entry, error)


def _deform_one(entry, ob, depsgraph):
    evaluated = ob.evaluated_get(depsgraph)
    if not evaluated.is_evaluated or ob.data.is_editmode or not ob.sinew.show_shape:
        return
    entry.look(ob)
    modifiers = [modifier for modifier in wiring.taken_modifiers(evaluated) if modifier.object is not None]
    if not modifiers:
        raise RuntimeError("Its armature is gone: choose another one, or unbind")
    start = perf_counter()
    if not entry.is_read():
        entry.read_weights(ob.data, tuple(group.name for group in ob.vertex_groups))
        entry.take_rest(mesh_output.rest_positions(ob))
    entry.last_poses = entry.poses(evaluated, modifiers,
                                   lambda modifier: posing.channels_of(evaluated, modifier.object))
    out = mesh_output.target(ob)
    is_in_place = out is not None
    if not is_in_place:
        out = np.empty((len(ob.data.vertices), 3), np.float32)
    prepared = perf_counter()
    entry.deformer.deform(entry.last_poses, out)
    entry.timings.pose, entry.timings.skin = 1e3 * (prepared - start), 1e3 * (perf_counter() - prepared)
    if is_in_place:
        meshes.positions_written(ob.data, out)
    else:
        meshes.write_positions(ob.data, out)
    entry.error = ""


def note_edits(objects, changed):
    """Somebody may have moved vertices of the shape, or painted weights. changed: keys of the updated data-blocks;
    what Sinew itself writes in a handler is never among them."""
    for ob in objects:
        entry = characters.of(ob)
        if values.key_of(ob.data) in changed and not ob.data.is_editmode:
            if entry.deformer is not None and entry.last_poses is not None:
                mesh_edits.carry_back(ob, entry.deformer, entry.last_poses)
            entry.forget_shape()
