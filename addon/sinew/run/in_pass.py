"""The full path of a frame: what Blender calls, during its own evaluation, through the hook (plan/wiring.py).

Blender calls it in the thread that evaluates the object, once per dependency graph (viewport, view layers, render,
sub-frames of motion blur), with that graph's evaluated copy of the object. It writes only to evaluated copies, and
must not raise.
"""

from time import perf_counter
from typing import Any

import numpy as np

from ..blender import meshes, nodes, values
from ..clips import posing
from ..host import contract, evaluations, key_blocks, marks, switches, vector_arrays
from ..plan import ways, wiring
from . import (
    cage_stages,
    characters,
    driven_settings,
    frame_shapes,
    graph_copies,
    mixes,
    shape_keys,
    shortcuts,
    stages,
    switching,
)


def deform_now(ob: Any) -> None:
    """Deforms the mesh of an evaluated object in the current evaluation, or leaves it to Blender's own modifiers. Does
    nothing outside an evaluation, for a script that reads the hook's property."""
    try:
        if not evaluations.is_running(ob):
            return
        if not shortcuts.deform(ob) and ob.is_evaluated and ob.sinew.is_bound:
            entry = characters.of(ob)
            if contract.is_broken():
                _stand_back(entry, entry.copy_of(ob), ob)
                if entry.way.in_pass:
                    entry.look(ob)
                return
            _deform(entry, entry.copy_of(ob), ob)
    # Flat: versions of Blender differ in what they do
    except (mixes.NotYet, cage_stages.NotReadable, switching.NotTold, driven_settings.NoValue, values.Flat):
        entry = characters.of(ob)
        _stand_back(entry, entry.copy_of(ob), ob)
    except Exception as error:
        entry = characters.of(ob)
        copy = entry.copy_of(ob)
        characters.keep_error(entry, error)
        _stand_back(entry, copy, ob)


def _deform(entry: characters.Character, copy: graph_copies.GraphCopy, ob: Any) -> None:
    """Runs the full path, or switches Blender's own modifiers on if Sinew does not deform the object now."""
    start = perf_counter()
    with entry.lock:  # a render may evaluate the same object at the same time
        if copy.leaves_dabs(ob) and _is_dab(copy, ob):
            raise mixes.NotYet
        work = _prepare(copy, ob) if entry.is_at_work(copy, ob) and copy.has_work(ob) else None
    if work is not None:
        deformer, poses, out, key_values, rest, in_order = work
        milliseconds = np.empty(len(in_order) + 2)
        milliseconds[0] = 1e3 * (perf_counter() - start)
        # This releases the GIL, so other Python threads keep running.
        deformer.deform(poses, out, key_values, rest, in_order, milliseconds[1:])
        entry.status.error = ""
        frame_shapes.note(ob, copy.identity(ob), poses, key_values, in_order, out)
        if shortcuts.learn(copy, ob):
            entry.status.timings.add(milliseconds)
        else:
            entry.status.timings.forget()
    copy.is_deforming = work is not None
    switching.switch(ob, copy.plan, copy.is_deforming)
    if work is None:
        _give_keys_back(copy, ob)
        _rest(copy, ob)


def _is_dab(copy: graph_copies.GraphCopy, ob: Any) -> bool:
    """Whether the mesh was edited since the last evaluation. Then it is read in the next one that does not follow an
    edit."""
    hook = copy.hook_of(ob)
    mesh = hook and wiring.source_of(hook)
    if mesh is None or _test_and_mark(hook, mesh):
        return False
    copy.mesh_address = 0
    return True


def _test_and_mark(hook: Any, mesh: Any) -> bool:
    """Whether Sinew has seen this evaluated copy of the mesh that a hook reads. From now on, it has."""
    canvas = wiring.waits_for(hook, "canvas")
    return marks.test_and_mark(mesh, "MESH", canvas and canvas.original.data)


def _rest(copy: graph_copies.GraphCopy, ob: Any) -> None:
    """Has Blender no longer call the hook of a mesh that is left to Blender, until it copies the object again. That it
    does at the latest when Sinew takes another path, for which the hook has to wait for more."""
    hook = copy.hook_of(ob)
    if hook is not None and copy.plan.way.kind == ways.BLENDER and wiring.waits_for_nothing(hook):
        switches.mute_driver(hook)


def _stand_back(entry: characters.Character, copy: graph_copies.GraphCopy, ob: Any) -> None:
    """Switches Blender's own modifiers on again after an error."""
    copy.is_deforming = False
    if copy.plan is None:
        return
    try:
        switching.switch(ob, copy.plan, False)
        _give_keys_back(copy, ob)
    except Exception as error:
        characters.keep_error(entry, error)


def _prepare(copy: graph_copies.GraphCopy, ob: Any) -> tuple[Any, ...]:
    """Returns what the frame needs: the deformer, the poses, the array for the result, the values of the shape keys or
    None, what the stages start from or None, and the stages."""
    hook = copy.hook_of(ob)
    mesh = wiring.source_of(hook)
    if copy.plan.way.has_copy:
        copy.check_copy(wiring.waits_for(hook, "mesh"), wiring.waits_for(hook, "copied"))
    if copy.goes_through_canvas() and nodes.POSITION_ATTRIBUTE not in mesh.attributes:
        raise mixes.NotYet  # Blender has not evaluated the canvas
    addresses: Any
    key_values = addresses = None
    is_edited = not _test_and_mark(hook, mesh) or copy.mesh_address != mesh.as_pointer()
    is_fresh = is_edited or not copy.is_read()
    if is_fresh:
        copy.read_mesh(mesh, is_edited)
    if copy.goes_through_keys():
        addresses = key_blocks.key_addresses(mesh.shape_keys)
        _read_keys(copy, ob, mesh)
        key_values = key_blocks.silence_keys(addresses, copy.plan.animated_mutes)
    elif is_fresh:
        copy.forget_keys()
        copy.set_rest(meshes.read_positions(mesh))
    copy.read_method(ob, mesh)
    count = len(mesh.vertices)

    def channels_of(armature: Any) -> np.ndarray | None:
        return posing.channels_of(ob, armature)

    poses = copy.poses(ob, copy.taken_now(ob), channels_of)
    copy.check_it_pays()
    if copy.goes_through_keys():
        out = key_blocks.key_positions(addresses[0], count)
    else:
        out = vector_arrays.attribute_vectors(mesh.attributes[nodes.POSITION_ATTRIBUTE], count)
    if out is None:
        out = np.empty((count, 3), np.float32)  # no vertex
    in_order = copy.stages_at(ob, lambda: stages.Source(mesh, meshes.read_positions(mesh), copy.weights), channels_of)
    return copy.deformer, poses, out, key_values, copy.rest_of_stages(), in_order


def _read_keys(copy: graph_copies.GraphCopy, ob: Any, mesh: Any) -> None:
    """Reads the shape keys if they may have changed. A new evaluated copy may have been edited. A silenced copy has
    lost its reference shape: if it is not known here, the original is read instead."""
    keys = mesh.shape_keys
    fresh = not marks.test_and_mark(keys, "KEY")
    if not fresh and copy.keys is not None and copy.keys_address == keys.as_pointer():
        return
    characters.note_silencing(copy.character)
    copy.keys_address = keys.as_pointer()
    source = keys if fresh else ob.original.data.shape_keys
    copy.keys = shape_keys.read(source, len(mesh.vertices), copy.weights)
    copy.set_rest(copy.keys.base)
    copy.first.native = None


def _give_keys_back(copy: graph_copies.GraphCopy, ob: Any) -> None:
    """Restores the evaluated shape keys that Sinew has overwritten, because Blender blends them now."""
    hook = copy.hook_of(ob)
    keys = hook and wiring.waits_for(hook, "keys")
    original = ob.original.data
    if not keys or not marks.is_marked(keys, "KEY") or keys.original != original.shape_keys:
        return  # unchanged, or of a mesh that the object no longer has
    if copy.keys is None or copy.keys_address != keys.as_pointer():
        copy.read_weights(original)
        copy.keys = shape_keys.read(original.shape_keys, len(original.vertices), copy.weights)
        copy.keys_address = 0
    shape_keys.give_back(keys, copy.keys)
