"""Sets which modifiers of an evaluated object deform it in the current pass: Blender's own, or Sinew's for them."""

from typing import Any

from ..blender import modifier_types
from ..chain.leaving import LeaveToBlender
from ..host import evaluations, modifier_memory
from ..plan import plans, ways

_is_on = False
OFF = (False, False)


def stands_aside() -> bool:
    return _is_on


class StandAside:
    """Has Blender's own modifiers deform all meshes in evaluations inside the `with` block."""

    def __enter__(self) -> None:
        global _is_on
        _is_on = True

    def __exit__(self, *_: object) -> None:
        global _is_on
        _is_on = False


def shown(ob: Any, plan: plans.Plan) -> tuple[str, ...]:
    """Returns the names of those modifiers that the plan replaces which are switched on in this evaluation of an
    evaluated object. Their switches may be driven or animated. Raises
    LeaveToBlender if that cannot be told."""
    modes = {name: _switches(ob.modifiers[name]) for name in plan.replaced}
    if all(viewport == render for viewport, render in modes.values()):
        return tuple(name for name, (viewport, _render) in modes.items() if viewport)
    is_render = evaluations.is_render(ob)
    if is_render is None:
        if plan.way.kind == ways.KEYS or len(set(modes.values())) > 1:
            raise LeaveToBlender("some modifiers are on for the viewport or for renders only")
        return tuple(modes)  # Sinew's modifier gets the switches that all have, so Blender decides
    return tuple(name for name, mode in modes.items() if mode[is_render])


def stencils(ob: Any, plan: plans.Plan) -> Any:
    """Returns the sinew_native.Stencils of the plan's tail in this evaluation of an evaluated object, or None. Raises
    LeaveToBlender if it cannot be told which."""
    viewport, render = plan.way.tail.stencils if plan.way.tail is not None else (None, None)
    if viewport is render:
        return viewport
    is_render = evaluations.is_render(ob)
    if is_render is None:
        raise LeaveToBlender("its last modifiers are not the same in the viewport and in renders")
    return render if is_render else viewport


def aside(plan: plans.Plan, has_stencils: bool) -> tuple[str, ...]:
    """Returns the names of the modifiers that Blender must not evaluate while Sinew deforms. has_stencils: whether the
    result is made by those of the tail."""
    tail = plan.way.tail.names if plan.way.tail is not None and has_stencils else ()
    return *plan.way.front, *plan.replaced, *tail


def _switches(modifier: Any) -> tuple[bool, bool]:
    """Returns the user's switches of an evaluated modifier: for the viewport, for renders."""
    return modifier.show_viewport, modifier.show_render


def switches_of_own(ob: Any, plan: plans.Plan) -> tuple[bool, bool]:
    """Returns the switches of Sinew's modifier while it deforms, for the viewport and for renders."""
    if plan.way.kind == ways.KEYS:
        return OFF
    modes = [_switches(ob.modifiers[name]) for name in plan.replaced]
    return any(viewport for viewport, _render in modes), any(render for _viewport, render in modes)


def switch(ob: Any, plan: plans.Plan, deforms: bool, has_stencils: bool = True) -> None:
    """Switches the modifiers of an evaluated object. deforms: Sinew deforms, otherwise Blender's own modifiers do;
    has_stencils: see `aside`."""
    modifiers = ob.modifiers
    if plan.own is not None:
        modifier_memory.switch_modifier(modifiers[plan.own], *(switches_of_own(ob, plan) if deforms else OFF))
    for name in aside(plan, has_stencils):
        modifier_memory.put_aside(modifiers[name], deforms)


def release(ob: Any) -> None:
    """Lets Blender evaluate all modifiers of an evaluated object again, except for those that an exporter keeps it from
    evaluating: in the original. After an edit, Sinew may no longer replace some of those that it did, and Blender does
    not always copy the object anew."""
    if modifier_memory.can_put_aside():
        for modifier, original in zip(ob.modifiers, ob.original.modifiers):
            modifier_memory.put_aside(modifier, modifier_memory.is_aside(original))


def release_original(ob: Any) -> None:
    """Lets Blender evaluate the modifiers of an original object, which a script may have made from an evaluated copy.
    Exporters keep it from evaluating those of DEFERRED for a while: these are left as they are."""
    if modifier_memory.can_put_aside():
        for modifier in ob.modifiers:
            if modifier.type not in modifier_types.DEFERRED:
                modifier_memory.put_aside(modifier, False)
