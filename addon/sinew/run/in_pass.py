"""A vertex's way through one frame: what Blender calls, in its own evaluation, through the hook of wiring.py.

It is called in whatever thread Blender evaluates the object, for each dependency graph (viewport, view layers,
render, sub-frames of motion blur) with that graph's evaluated copy of the object. It writes to evaluated copies
alone, and must not raise.
"""

from time import perf_counter

import numpy as np

from ..blender import meshes, nodes, values
from ..clips import posing
from ..host import contract, key_blocks, marks, vector_arrays
from ..plan import wiring
from . import characters, graph_copies, shape_keys, shortcuts, stages


def deform_now(ob):
    """Deforms the mesh of an evaluated object for the evaluation that goes on, or leaves it to Blender's own
    modifiers."""
    try:
        if not shortcuts.take(ob) and ob.is_evaluated and ob.sinew.is_bound:
            entry = characters.of(ob)
            if contract.is_broken():
                _stand_back(entry, entry.copy_of(ob), ob)
                if entry.way.in_pass:
                    entry.look(ob)
                return
            _deform(entry, entry.copy_of(ob), ob)
    except (graph_copies.NotYet, values.Flat):  # flat: each version of Blender has its own way with that
        entry = characters.of(ob)
        _stand_back(entry, entry.copy_of(ob), ob)
    except Exception as error:
        entry = characters.of(ob)
        copy = entry.copy_of(ob)
        characters.keep_error(entry, error)
        _stand_back(entry, copy, ob)


def _deform(entry, copy, ob):
    start = perf_counter()
    with entry.lock:  # the same object may be evaluated for a render meanwhile
        work = _prepare(copy, ob) if entry.is_at_work(copy, ob) else None
    if work is not None:
        deformer, poses, out, key_values, rest, in_order = work
        milliseconds = np.empty(len(in_order) + 2)
        milliseconds[0] = 1e3 * (perf_counter() - start)
        # Other threads of Python go on meanwhile.
        deformer.deform(poses, out, key_values, rest, in_order, milliseconds[1:])
        entry.status.error = ""
        if shortcuts.learn(copy, ob):
            entry.status.timings.add(milliseconds)
        else:
            entry.status.timings.forget()
    copy.is_deforming = work is not None
    copy.plan.switch(ob, copy.is_deforming)
    if work is None:
        _give_keys_back(copy, ob)


def _stand_back(entry, copy, ob):
    """After an error: Blender's own modifiers deform."""
    copy.is_deforming = False
    if copy.plan is None:
        return
    try:
        copy.plan.switch(ob, False)
        _give_keys_back(copy, ob)
    except Exception as error:
        characters.keep_error(entry, error)


def _prepare(copy, ob):
    """What the frame needs: input, pose, and where the shape goes."""
    mesh = wiring.waits_for(copy.hook_of(ob), "mesh")
    key_values = addresses = None
    is_edited = not marks.take_mark(mesh, "MESH") or copy.mesh_address != mesh.as_pointer()
    is_fresh = is_edited or not copy.is_read()
    if is_fresh:
        copy.read_mesh(mesh, is_edited)
    if copy.goes_through_keys():
        addresses = key_blocks.key_addresses(mesh.shape_keys)
        _read_keys(copy, ob, mesh)
        key_values = key_blocks.silence_keys(addresses)
    elif is_fresh:
        copy.forget_keys()
        copy.set_rest(meshes.read_positions(mesh))
    copy.read_method(ob, mesh)
    count = len(mesh.vertices)
    poses = copy.poses(
        ob, [ob.modifiers[name] for name in copy.plan.taken], lambda modifier: posing.channels_of(ob, modifier.object)
    )
    copy.check_it_pays()
    if copy.goes_through_keys():
        out = key_blocks.key_positions(addresses[0], count)
    else:
        out = vector_arrays.attribute_vectors(mesh.attributes[nodes.POSITION_ATTRIBUTE], count)
    if out is None:
        out = np.empty((count, 3), np.float32)  # no vertex
    in_order = copy.stages.at(
        ob, copy.stage_names(ob), lambda: stages.Source(mesh, meshes.read_positions(mesh), copy.weights)
    )
    return copy.deformer, poses, out, key_values, copy.rest_of_stages(), in_order


def _read_keys(copy, ob, mesh):
    """A fresh copy of the keys may have been edited. One that is silenced has no base of its own any more: if it is
    not known here, the original has it."""
    keys = mesh.shape_keys
    fresh = not marks.take_mark(keys, "KEY")
    if not fresh and copy.keys is not None and copy.keys_address == keys.as_pointer():
        return
    copy.keys_address = keys.as_pointer()
    source = keys if fresh else ob.original.data.shape_keys
    copy.keys = shape_keys.read(source, len(mesh.vertices), copy.weights)
    copy.set_rest(copy.keys.base)
    copy.deformer = None


def _give_keys_back(copy, ob):
    """What was put into this copy of the shape keys goes, for Blender blends them now."""
    hook = copy.hook_of(ob)
    keys = hook and wiring.waits_for(hook, "keys")
    original = ob.original.data
    if not keys or not marks.is_marked(keys, "KEY") or keys.original != original.shape_keys:
        return  # they are as they were, or of a mesh that the object no longer has
    if copy.keys is None or copy.keys_address != keys.as_pointer():
        copy.read_weights(original)
        copy.keys = shape_keys.read(original.shape_keys, len(original.vertices), copy.weights)
        copy.keys_address = 0
    shape_keys.give_back(keys, copy.keys)
