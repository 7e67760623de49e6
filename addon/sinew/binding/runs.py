"""The run: which modifiers behind its Armature modifier Sinew stands in for as well, and where it ends.

What Sinew does not know goes on in Blender, with Sinew's shape as its input.
"""

from dataclasses import dataclass

from ..blender import animation, memory
from . import wiring

STAGES = {"CORRECTIVE_SMOOTH", "SMOOTH", "HOOK"}


@dataclass(frozen=True)
class Run:
    stages: tuple = ()  # names of modifiers, in their order
    end: str = ""  # name of the first that goes on in Blender
    reason: str = ""  # why, a sentence for people


def of(ob, taken):
    """ob: a mesh object, original or evaluated; taken: names of its Armature modifiers that Sinew stands in for, in
    their order, at least one."""
    original = ob.original
    modifiers = original.modifiers
    first, stages = modifiers[taken[0]], []
    for modifier in list(modifiers)[modifiers.find(taken[-1]) + 1:]:
        if not wiring.is_shown(modifier) or modifier.type == "HOOK" and modifier.object is None:
            continue
        reason = _why_not(original, modifier, first)
        if reason:
            return Run(tuple(stages), modifier.name, reason)
        stages.append(modifier.name)
    return Run(tuple(stages))


def _why_not(ob, modifier, first):
    """Why Sinew cannot stand in for a modifier, or ""."""
    if modifier.type not in STAGES:
        return "only Blender knows what it does"
    if set(wiring.SHOWS).intersection(animation.animated_properties(ob, modifier)):
        return "it is switched by drivers or keyframes"
    if [getattr(modifier, name) for name in wiring.SHOWS] != [getattr(first, name) for name in wiring.SHOWS]:
        return f"it is not shown where {first.name} is"
    driven = wiring.driven_settings(ob, [modifier])
    if driven:
        return f"its {driven[0]} is driven, and may not be there in time"
    if modifier.type == "HOOK" and modifier.falloff_type == "CURVE":
        return "only Blender knows its curve"
    if modifier.type == "CORRECTIVE_SMOOTH" and modifier.rest_source == "BIND" and not modifier.use_only_smooth:
        return _why_not_bound(ob, modifier)
    return ""


def _why_not_bound(ob, modifier):
    if not modifier.is_bind:
        return "it is not bound: press its Bind"
    bound, own = memory.bound_count(modifier), len(ob.data.vertices)
    return f"it was bound to {bound:,} vertices, and the mesh has {own:,}: bind it anew" if bound != own else ""


def hooks(ob, run):
    """[(object, name of a bone or "")] that the run's hooks follow."""
    found = [ob.modifiers[name] for name in run.stages if ob.modifiers[name].type == "HOOK"]
    return [(hook.object, hook.subtarget if hook.object.type == "ARMATURE" else "") for hook in found]
