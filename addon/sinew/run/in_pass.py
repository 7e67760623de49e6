"""A frame: what Blender calls, during its own evaluation, through the hook (plan/wiring.py).

Blender calls it in the thread that evaluates the object, once per dependency graph (viewport, view layers, render,
sub-frames of motion blur), with that graph's evaluated copy of the object. It writes only to evaluated copies, and
must not raise. It reads nothing of the file but the object's own original, because the main thread may be changing it.
"""

from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from ..blender import meshes, nodes, values
from ..chain import shape_keys, stages
from ..chain.leaving import LeaveToBlender
from ..clips import posing
from ..host import contract, evaluations, key_blocks, marks, mesh_arrays, modifier_memory
from ..native import sinew_native
from ..plan import survey, ways, wiring
from . import afterwards, characters, errors, graph_copies, switching
from .character import Character
from .graph_copies import GraphCopy


class Frame(NamedTuple):
    """What the deformer needs for a frame."""

    poses: list  # of the layers
    out: np.ndarray  # (V, 3), for the shape; (R, 3) with stencils
    key_values: np.ndarray | None  # of the shape keys
    rest: np.ndarray | None  # what the stages start from, if neither layers nor keys run before them
    stages: list


def deform_now(ob: Any) -> None:
    """Deforms the mesh of an evaluated object in the current evaluation, or leaves it to Blender's own modifiers. Does
    nothing outside an evaluation, for a script that reads the hook's property."""
    try:
        if not evaluations.is_running(ob):
            return
        if not evaluations.ends_in_handlers() and _may_be_left(ob):
            return
        known = graph_copies.at(ob.as_pointer())
        if known is not None and known.fast_path.run(ob):
            known.unrestored = ob.original
        elif ob.is_evaluated and ob.sinew.is_bound:
            entry = characters.of(ob)
            if not _skips(entry, ob):
                _run(entry, entry.copy_of(ob), ob)
    except (LeaveToBlender, values.Flat, contract.Broken):  # flat: versions of Blender differ in what they do
        entry = characters.of(ob)
        _leave(entry, entry.copy_of(ob), ob)
    except Exception as error:
        entry = characters.of(ob)
        copy = entry.copy_of(ob)
        copy.unrestored = ob.original  # which the fast path has not noted
        if not isinstance(error, sinew_native.HalfTurn):  # then it depends on Blender's rounding
            errors.keep(entry, copy, error)
        _leave(entry, copy, ob)


def _run(entry: Character, copy: GraphCopy, ob: Any) -> None:
    """Runs the full path: reads, decides, builds, computes and switches. Raises LeaveToBlender or values.Flat."""
    start = perf_counter()
    with entry.lock:  # a render may evaluate the same object at the same time
        frame = _prepare(copy, ob) if _is_at_work(copy, ob) else None
    if frame is None:
        _leave(entry, copy, ob)
        _rest(copy, ob)
        return
    _compute(copy, ob, frame, start)
    copy.unrestored = ob.original
    copy.is_deforming = True
    switching.switch(ob, copy.plan, True, copy.stencils is not None)


def _may_be_left(ob: Any) -> bool:
    """Whether Blender's own modifiers, which are on, may deform an evaluated object if nobody restores its shape keys
    after the evaluation."""
    return (
        ob.type == "MESH"  # any object has the property, and a script may read it
        and ob.original.data.shape_keys is not None
        and not survey.wants_more(ob.original.sinew)
        and not afterwards.is_waiting(ob)
    )


def _skips(entry: Character, ob: Any) -> bool:
    """Whether Blender's own modifiers, which are on since a failure, deform an object without another try. Nothing of
    the object and its mesh was edited since."""
    hook = wiring.find_hook(ob) if entry.status.failures else None
    mesh = hook and wiring.source_of(hook)
    return bool(mesh) and marks.is_marked(ob, "OBJECT") and marks.is_marked(mesh, "MESH") and entry.status.skips()


def _is_at_work(copy: GraphCopy, ob: Any) -> bool:
    """Whether Sinew deforms this evaluated object in this evaluation. Raises LeaveToBlender."""
    if contract.is_broken():
        if copy.character.way.in_pass:
            copy.character.look(ob)
        raise LeaveToBlender(contract.trouble())
    if copy.leaves_mode(ob):
        return False  # it is looked at again afterwards: Blender copies it then
    if copy.leaves_dabs(ob) and _is_dab(copy, ob):
        raise LeaveToBlender("somebody paints on it")
    copy.follow_edits(ob)
    if not copy.character.may_work(copy.plan, ob):
        return False
    copy.read_switches(ob)
    return copy.has_work()


def _prepare(copy: GraphCopy, ob: Any) -> Frame:
    """Reads what may have changed, and builds what depends on it. Raises LeaveToBlender or values.Flat."""
    hook, reading, chain = copy.hook_of(ob), copy.reading, copy.chain
    mesh, target = _meshes(copy, hook)
    addresses: Any
    key_values = addresses = None
    is_edited = not _test_and_mark(hook, target) or not reading.is_at(mesh)
    is_fresh = is_edited or not reading.is_done()
    if is_fresh:
        reading.read_mesh(mesh, is_edited)
        copy.look_at_mesh_again()
    if copy.plan.way.has_keys:
        addresses = key_blocks.key_addresses(mesh.shape_keys)
        reading.read_keys(ob, mesh)
        copy.unrestored = ob.original  # from here on, the keys are not what they were
        key_values = key_blocks.silence_keys(addresses)
    elif is_fresh:
        reading.read_rest(mesh)
    reading.read_method(ob, mesh)
    count = len(target.vertices)

    def channels_of(armature: Any) -> np.ndarray | None:
        return posing.channels_of(ob, armature)

    poses = chain.poses(ob, channels_of)
    chain.check_it_pays()
    if copy.goes_through_keys():
        out = key_blocks.key_positions(addresses[0], count)
    else:
        out = mesh_arrays.attribute_vectors(target.attributes[nodes.POSITION_ATTRIBUTE], count)
        if count != chain.deformer.result_count:
            raise LeaveToBlender("its canvas has other vertices")
    if out is None and count:
        raise LeaveToBlender("there is nowhere to write the shape to")
    if out is None:
        out = np.empty((0, 3), np.float32)

    def source() -> stages.Source:
        return stages.Source(mesh, meshes.read_positions(mesh), reading.weights)

    in_order = chain.stages_at(ob, source, channels_of)
    return Frame(poses, out, key_values, chain.rest_of_stages(), in_order)


def _meshes(copy: GraphCopy, hook: Any) -> tuple[Any, Any]:
    """Returns the evaluated mesh that is read, and the one that the shape is written to: with a tail, only the latter
    is the canvas's. Raises LeaveToBlender if the canvas has another mesh."""
    source, plan = wiring.source_of(hook), copy.plan
    mesh = wiring.waits_for(hook, "mesh") if plan.way.has_copy else None
    if mesh is not None:
        if plan.way.tail is not None and not marks.is_marked(mesh, "MESH"):
            copy.reading.forget_mesh()
        copy.reading.canvas.check(mesh, wiring.waits_for(hook, "copied"))
    if copy.goes_through_canvas():
        characters.note_canvas(copy.character)
        if nodes.POSITION_ATTRIBUTE not in source.attributes:
            raise LeaveToBlender("Blender has not evaluated its canvas")
    return (source if plan.way.tail is None else mesh), source


def _compute(copy: GraphCopy, ob: Any, frame: Frame, start: float) -> None:
    """Deforms, and has the fast path learn from it."""
    milliseconds = np.empty(len(frame.stages) + (2 if copy.stencils is None else 3))
    milliseconds[0] = 1e3 * (perf_counter() - start)
    poses, out, key_values, rest, in_order = frame
    # This releases the GIL, so other Python threads keep running.
    copy.chain.deformer.deform(poses, out, key_values, rest, in_order, milliseconds[1:])
    status = copy.character.status
    status.note_success()
    if copy.fast_path.learn(ob):
        status.timings.add(milliseconds)
    else:
        status.timings.forget()


def _is_dab(copy: GraphCopy, ob: Any) -> bool:
    """Whether the mesh was edited since the last evaluation. Then it is read in the next one that does not follow an
    edit."""
    hook = copy.hook_of(ob)
    mesh = hook and wiring.source_of(hook)
    if mesh is None or _test_and_mark(hook, mesh):
        return False
    copy.reading.forget_mesh()
    return True


def _test_and_mark(hook: Any, mesh: Any) -> bool:
    """Whether Sinew has seen this evaluated copy of the mesh that a hook reads. From now on, it has."""
    canvas = wiring.waits_for(hook, "canvas")
    return marks.test_and_mark(mesh, "MESH", canvas and canvas.original.data)


def _leave(entry: Character, copy: GraphCopy, ob: Any) -> None:
    """Has Blender's own modifiers deform the mesh."""
    copy.is_deforming = False
    if copy.plan is None:
        return
    try:
        if copy.has_all_modifiers(ob):  # otherwise Blender has copied the object again, with the switches of the file
            switching.switch(ob, copy.plan, False)
        _give_keys_back(copy, ob)
    except Exception as error:
        errors.keep(entry, copy, error)


def _rest(copy: GraphCopy, ob: Any) -> None:
    """Has Blender no longer call the hook of a mesh that is left to Blender, until it copies the object again. That it
    does at the latest when Sinew takes another path, for which the hook has to wait for more."""
    hook = copy.hook_of(ob) if copy.plan is not None else None
    if hook is not None and copy.plan.way.kind == ways.BLENDER and wiring.waits_for_nothing(hook):
        modifier_memory.mute_driver(hook)


def _give_keys_back(copy: GraphCopy, ob: Any) -> None:
    """Restores the evaluated shape keys if Sinew has overwritten them, because Blender blends them now. If they were
    restored after the last evaluation, drivers and keyframes may have written into them since."""
    hook = copy.hook_of(ob)
    keys = hook and wiring.waits_for(hook, "keys")
    original = ob.original.data
    if not keys or not marks.is_marked(keys, "KEY") or keys.original != original.shape_keys:
        return  # unchanged, or of a mesh that the object no longer has
    if copy.unrestored is None:
        marks.clear_mark(keys, "KEY")
        return
    shape_keys.give_back(keys, copy.reading.keys_of(keys, original))
