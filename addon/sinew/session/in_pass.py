"""A vertex's way through one frame: what Blender calls, in its own evaluation, through the hook of wiring.py.

It is called in whatever thread Blender evaluates the object, for each dependency graph (viewport, view layers,
render, sub-frames of motion blur) with that graph's evaluated copy of the object. It writes to evaluated copies
alone, and must not raise.
"""

from time import perf_counter

import numpy as np

from ..binding import ways, wiring
from ..blender import memory, meshes, nodes, values
from ..rigs import posing
from . import character, characters, shape_keys, shortcuts, stages


def deform_now(ob):
    """Deforms the mesh of an evaluated object for the evaluation that goes on, or leaves it to Blender's own
    modifiers."""
    if not ob.is_evaluated or not ob.sinew.is_bound:
        return
    entry = characters.of(ob)
    try:
        if shortcuts.take(entry, ob):
            return
        start = perf_counter()
        with entry.lock:  # the same object may be evaluated for a render meanwhile
            work = _prepare(entry, ob) if entry.is_at_work(ob) else None
        if work is not None:
            prepared = perf_counter()
            deformer, poses, out, key_values, rest, in_order = work
            milliseconds = np.empty(len(in_order) + 1)
            # Other threads of Python go on meanwhile.
            deformer.deform(poses, out, key_values, rest, in_order, milliseconds)
            entry.timings.take(prepared - start, milliseconds)
            entry.error = ""
        entry.is_deforming = work is not None
        entry.switch(ob, entry.is_deforming)
        if work is None:
            _give_keys_back(entry, ob)
        else:
            shortcuts.learn(entry, ob)
    except (character.NotYetWired, values.Flat):  # flat: each version of Blender has its own way with that
        _stand_back(entry, ob)
    except Exception as error:
        characters.keep_error(entry, error)
        _stand_back(entry, ob)


def _stand_back(entry, ob):
    """After an error: Blender's own modifiers deform."""
    entry.is_deforming = False
    try:
        entry.switch(ob, False)
        _give_keys_back(entry, ob)
    except Exception as error:
        characters.keep_error(entry, error)


def _prepare(entry, ob):
    """What the frame needs: input, pose, and where the shape goes."""
    mesh = wiring.waits_for(entry.hook_of(ob), "mesh")
    key_values = addresses = None
    is_edited = not memory.take_mark(mesh, "MESH")
    if is_edited or not entry.edition:
        entry.edition = characters.new_edition()
    is_fresh = is_edited or not entry.is_read()
    if is_fresh:
        entry.read_weights(mesh, _group_names(ob))
    if entry.way.kind == ways.KEYS:
        addresses = memory.key_addresses(mesh.shape_keys)
        _read_keys(entry, ob, mesh)
        key_values = memory.silence_keys(addresses)
    elif is_fresh:
        entry.forget_keys()
        entry.take_rest(meshes.read_positions(mesh))
    entry.read_method(ob, mesh)
    count = len(mesh.vertices)
    poses = entry.poses(
        ob, [ob.modifiers[name] for name in entry.taken], lambda modifier: posing.channels_of(ob, modifier.object)
    )
    entry.check_it_pays()
    if entry.way.kind == ways.KEYS:
        out = memory.key_positions(addresses[0], count)
    else:
        out = memory.attribute_vectors(mesh.attributes[nodes.POSITION_ATTRIBUTE], count)
    if out is None:
        out = np.empty((count, 3), np.float32)  # no vertex
    in_order = entry.stages.at(
        ob, entry.stage_names(ob), lambda: stages.Source(mesh, meshes.read_positions(mesh), entry.weights)
    )
    return entry.deformer, poses, out, key_values, entry.rest_of_stages(), in_order


def _group_names(ob):
    return tuple(group.name for group in ob.original.vertex_groups)


def _read_keys(entry, ob, mesh):
    """A fresh copy of the keys may have been edited. One that is silenced has no base of its own any more: if it is
    not known here, the original has it."""
    fresh = not memory.take_mark(mesh.shape_keys, "KEY")
    if not fresh and entry.keys is not None:
        return
    source = mesh.shape_keys if fresh else ob.original.data.shape_keys
    entry.keys = shape_keys.read(source, len(mesh.vertices), entry.weights)
    entry.take_rest(entry.keys.base)
    entry.deformer = None


def _give_keys_back(entry, ob):
    """What was put into this copy of the shape keys goes, for Blender blends them now."""
    hook = entry.hook_of(ob)
    keys = hook and wiring.waits_for(hook, "keys")
    original = ob.original.data
    if not keys or not memory.is_marked(keys, "KEY") or keys.original != original.shape_keys:
        return  # they are as they were, or of a mesh that the object no longer has
    if entry.keys is None:
        entry.read_weights(original, _group_names(ob))
        entry.keys = shape_keys.read(original.shape_keys, len(original.vertices), entry.weights)
    shape_keys.give_back(keys, entry.keys)
