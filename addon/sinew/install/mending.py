"""Applies, in the main thread, the mends that the file needs for the plan of a bound mesh."""

import bpy

from ..blender import meshes, nodes, values
from ..host import contract, modifier_memory
from ..plan import canvas_survey, mends, survey, tails, ways, wiring
from ..run import characters, errors, switching
from . import canvases

_adapting: set[int] = set()  # keys of objects; before 3.5, moving a modifier evaluates, which delivers mail


def is_adapting(key: int) -> bool:
    """Whether the object with that key is being adapted by a caller further up the stack."""
    return key in _adapting


def adapt(ob: bpy.types.Object) -> None:
    """Applies to the file what the plan of a bound mesh needs, and no more."""
    key = values.key_of(ob)
    if not ob.sinew.is_bound or ob.library is not None or key in _adapting:
        return
    _adapting.add(key)
    try:
        _adapt(ob)
    finally:
        _adapting.discard(key)


def _adapt(ob):
    modifier_memory.prove()
    if not contract.trouble():
        switching.release_original(ob)
    carrier = wiring.carrier_of(ob)
    entry = characters.of(ob)
    entry.planning.surroundings = None
    if entry.planning.tail is not None and entry.planning.tail.digest != tails.digest(ob, entry.planning.tail.names):
        entry.planning.tail = None  # it is searched for anew
    entry.look_again()
    plan = entry.look(ob)
    canvas = _canvas(entry, ob) if plan.way.kind == ways.CANVAS else None
    if carrier is not None:  # even without the mend HOOK: the bones that it waits for depend on the weights
        wiring.wire(
            ob,
            carrier,
            wiring.followed_by(ob, plan.run.stages),
            waits=plan.way.kind != ways.BLENDER,
            canvas=canvas,
            replaced=plan.replaced,
        )
    needs_attribute = plan.way.has_own
    if ob.sinew.needs_attribute != needs_attribute:
        ob.sinew.needs_attribute = needs_attribute
    try:
        for mend in entry.planning.mends:
            _apply(mend, plan, ob)
    except ValueError as error:
        errors.report(ob, str(error))
        return
    entry.planning.newcomers = frozenset()
    entry.look(ob)


def _canvas(entry, ob):
    """Returns the canvas of an object, as its plan wants it."""
    way, planning = entry.plan.way, entry.planning
    is_stale, planning.is_copy_stale = planning.is_copy_stale, False
    shown = way.tail.shown if way.tail is not None else canvas_survey.BOTH
    return canvases.provide(ob, way.on_canvas, shown, way.has_copy, is_stale)


def _apply(mend, plan, ob):
    """Applies one mend. Raises ValueError if Blender does not allow it."""
    if mend.what == mends.RELEASE_CANVAS:
        if plan.own is not None:
            nodes.set_canvas(ob.modifiers[plan.own], None)
        canvases.remove(ob)
    elif mend.what == mends.READ_CANVAS:
        nodes.set_canvas(nodes.find_modifier(ob), ob.sinew.canvas, plan.way.takes_all)
    elif mend.what == mends.REMOVE_ATTRIBUTE:
        remove_attribute(ob)
    elif mend.what == mends.TAKE_OWN_AWAY:
        _take_own_away(plan, ob)
    elif mend.what == mends.MOVE_DISPLACED:
        for name in mend.modifiers:
            nodes.move_behind_deforming(ob, ob.modifiers[name])
    elif mend.what == mends.PUT_OWN_FIRST:
        _put_own_first(plan, ob)
    elif mend.what == mends.RENEW_GROUP:
        nodes.renew_group(ob.modifiers[plan.own])
    elif mend.what == mends.ADD_ATTRIBUTE and not ob.data.is_editmode:  # a mesh shows none then: after it
        meshes.write_attribute(ob.data, nodes.POSITION_ATTRIBUTE, meshes.read_positions(ob.data))


def _put_own_first(plan, ob):
    """Adds Sinew's modifier, or moves it, right before everything that the plan replaces."""
    own = nodes.find_modifier(ob)
    index = ob.modifiers.find(plan.taken[0]) if plan.taken else 0
    if own is None:
        nodes.add_modifier(ob, index)
        return
    if ob.modifiers.find(own.name) < index:
        index -= 1  # which becomes free when it moves
    try:
        nodes.move_modifier(ob, own, index)
    except ValueError:
        if not mends.is_in_place(plan, survey.of(ob)):
            raise


def _take_own_away(plan, ob):
    """Removes Sinew's modifier, or moves it behind all others if it carries the hook."""
    own = ob.modifiers[plan.own]
    if plan.hook_path == wiring.path_of(own):
        nodes.move_modifier_back(ob, own)
        remove_attribute(ob)
    else:
        remove_own_modifier(ob)


def remove_own_modifier(ob: bpy.types.Object) -> None:
    """Removes Sinew's modifier and its attribute."""
    nodes.remove_modifiers(ob)
    remove_attribute(ob)


def remove_attribute(ob: bpy.types.Object) -> None:
    """Removes the attribute of deformed positions, unless another object with the same mesh needs it."""
    others = (nodes.find_modifier(other) for other in _sharers(ob) if other.sinew.is_bound)
    if not any(own is not None and not nodes.reads_canvas(own) for own in others):
        meshes.remove_attribute(ob.data, nodes.POSITION_ATTRIBUTE)


def _sharers(ob):
    """Returns the other mesh objects with the same mesh."""
    if ob.data.users < 2:
        return []
    return [other for other in bpy.data.objects if other.type == "MESH" and other != ob and other.data == ob.data]
