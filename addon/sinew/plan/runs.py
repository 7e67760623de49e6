"""The run: which modifiers behind its Armature modifier, or without one from the beginning of the stack, Sinew stands
in for as well, and where it ends.

What Sinew does not know goes on in Blender, with Sinew's shape as its input.
"""

from dataclasses import dataclass

from ..blender import modifier_types, nodes
from ..host import vector_arrays
from . import wiring


@dataclass(frozen=True)
class Run:
    stages: tuple = ()  # names of modifiers, in their order
    end: str = ""  # name of the first that goes on in Blender
    reason: str = ""  # why, a sentence for people
    shown: tuple = (True, True)  # (in the viewport, in renders): as all of it is, Armature modifiers included


def of(ob, taken):
    """ob: a mesh object, original or evaluated; taken: names of its Armature modifiers that Sinew stands in for, in
    their order."""
    original = ob.original
    # What the others have to be shown like: Armature modifiers, else shape keys, else the first of them.
    like, shown = None, (True, True)
    if taken:
        like, shown = taken[0], wiring.shown_of(ob, original.modifiers[taken[0]])
    elif original.data.shape_keys is not None:
        like = "the mesh"
    start = original.modifiers.find(taken[-1]) + 1 if taken else 0
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


def _why_not(ob, modifier, like, shown):
    """Why Sinew cannot stand in for a modifier, or "". shown: as wiring.shown_of has it, of what is named `like`."""
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


def why_not_bound(ob, modifier):
    """Why a Corrective Smooth that asks for it has no bound positions of this mesh, or ""."""
    if modifier.type != "CORRECTIVE_SMOOTH" or modifier.rest_source != "BIND" or modifier.use_only_smooth:
        return ""
    if not modifier.is_bind:
        return "it is not bound: press Bind in that modifier"
    bound, own = vector_arrays.bound_count(modifier), len(ob.data.vertices)
    return f"it was bound to {bound:,} vertices, and the mesh has {own:,}: bind it again" if bound != own else ""


def hooks(ob, run):
    """[(object, name of a bone or "")] that the run's hooks follow. ob: original. A bone that is not there has no part
    in it; if the driver waited for it, Blender would give the driver up."""
    found = [ob.modifiers[name] for name in run.stages if name in ob.modifiers]
    found = [modifier for modifier in found if modifier.type == "HOOK" and modifier.object is not None]
    return [(hook.object, hook.subtarget if _has_bone(hook.object, hook.subtarget) else "") for hook in found]


def _has_bone(ob, name):
    return ob.type == "ARMATURE" and name in ob.data.bones
