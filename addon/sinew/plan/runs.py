"""Finds the run: the modifiers after the Armature modifiers that Sinew replaces too, and where it ends.

Without an armature, the run begins at the top of the stack. Blender evaluates the remaining modifiers, with Sinew's
shape as their input.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..blender import modifier_types, nodes
from ..host import vector_arrays
from . import wiring


@dataclass(frozen=True)
class Run:
    """The modifiers that Sinew replaces besides the Armature modifiers, and why the next one is not among them."""

    stages: tuple[str, ...] = ()  # names of modifiers, in stack order
    end: str = ""  # name of the first that Blender still evaluates
    reason: str = ""  # why, a sentence for users
    shown: tuple[bool, bool] = (True, True)  # (in the viewport, in renders), the same for all, Armature modifiers too


def of(ob: Any, taken: Sequence[str]) -> Run:
    """Returns the run of a mesh object.

    ob: original or evaluated; taken: names of the Armature modifiers that Sinew replaces, in stack order.
    """
    original = ob.original
    # All must have the same switches: those of the Armature modifiers, else of shape keys, else of the first.
    like: str | None
    shown: Any  # None if animated: then the run has no stages
    like, shown = None, (True, True)
    if taken:
        like, shown = taken[0], wiring.shown_of(ob, original.modifiers[taken[0]])
    elif original.data.shape_keys is not None:
        like = "the mesh"
    start = original.modifiers.find(taken[-1]) + 1 if taken else 0
    stages: list[str]
    stages, end = [], ("", "")
    for modifier in list(original.modifiers)[start:]:
        if nodes.is_sinew(modifier) or wiring.does_nothing(modifier):
            continue
        if like is None:
            like, shown = modifier.name, wiring.shown_of(ob, modifier)
        reason = _why_not(original, modifier, like, shown)
        if modifier.type == "ARMATURE" and not taken and not stages:
            reason = "the mesh was bound without it: unbind the mesh and accelerate it again"
        if reason:
            end = modifier.name, reason
            break
        stages.append(modifier.name)
    return Run(tuple(stages), *end, shown)


def _why_not(ob: Any, modifier: Any, like: str, shown: tuple[bool, bool] | None) -> str:
    """Returns why Sinew cannot replace a modifier, or "".

    shown: the switches, as returned by wiring.shown_of, of what is named `like`.
    """
    if modifier.type not in modifier_types.STAGES:
        return f"Sinew cannot evaluate modifiers of the type {modifier_types.title(modifier)}"
    if wiring.is_switched(ob, modifier):
        return "it is switched by drivers or keyframes"
    if wiring.shown_of(ob, modifier) != shown:
        return f"its switches for viewport and renders differ from those of {like}"
    driven = wiring.driven_settings(ob, [modifier])
    if driven:
        return f"its {driven[0]} is driven, and the driver may run too late"
    if modifier.type == "HOOK" and modifier.falloff_type == "CURVE":
        return "Sinew cannot evaluate its falloff curve"
    return why_not_bound(ob, modifier)


def why_not_bound(ob: Any, modifier: Any) -> str:
    """Returns why a Corrective Smooth with rest source Bind has no bound positions of this mesh, or ""."""
    if modifier.type != "CORRECTIVE_SMOOTH" or modifier.rest_source != "BIND" or modifier.use_only_smooth:
        return ""
    if not modifier.is_bind:
        return "it is not bound: press Bind in that modifier"
    bound, own = vector_arrays.bound_count(modifier), len(ob.data.vertices)
    return f"it was bound to {bound:,} vertices, and the mesh has {own:,}: bind it again" if bound != own else ""


def hooks(ob: Any, run: Run) -> list[tuple[Any, str]]:
    """Returns [(object, name of a bone or "")] that the run's Hook modifiers follow.

    ob: original. A bone that does not exist is left out (""): a driver that waited for it would become invalid.
    """
    found = [ob.modifiers[name] for name in run.stages if name in ob.modifiers]
    found = [modifier for modifier in found if modifier.type == "HOOK" and modifier.object is not None]
    return [(hook.object, hook.subtarget if _has_bone(hook.object, hook.subtarget) else "") for hook in found]


def _has_bone(ob: Any, name: str) -> bool:
    return ob.type == "ARMATURE" and name in ob.data.bones
