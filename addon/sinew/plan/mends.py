"""Lists the mends: what a plan needs to have added, moved or removed in the file. The main thread applies them
(install/mending.py)."""

from collections.abc import Collection
from dataclasses import dataclass

import bpy

from ..blender import meshes, nodes, values
from . import ways, wiring
from .plans import Plan

# In the order in which they are applied.
HOOK = "HOOK"  # the hook's driver waits for the wrong data-blocks
TAKE_OWN_AWAY = "TAKE_OWN_AWAY"  # Sinew's modifier is not needed: remove it, or move it behind all others
MOVE_DISPLACED = "MOVE_DISPLACED"  # Blender put new modifiers before Sinew's: move them behind those that deform
PUT_OWN_FIRST = "PUT_OWN_FIRST"  # Sinew's modifier is missing, or is not before everything that it replaces
RENEW_GROUP = "RENEW_GROUP"  # Sinew's modifier has the node group of an older version
ADD_ATTRIBUTE = "ADD_ATTRIBUTE"  # the mesh lacks the attribute of deformed positions


@dataclass(frozen=True)
class Mend:
    """One change of the file."""

    what: str
    modifiers: tuple[str, ...] = ()  # names of the modifiers to move
    is_blocking: bool = False  # Blender's own modifiers deform until it is applied


def needed(plan: Plan, ob: bpy.types.Object, newcomers: Collection[int]) -> tuple[Mend, ...]:
    """Returns the mends that the file needs for the plan, in the order in which to apply them.

    ob: original; newcomers: modifiers that were added since the main thread last applied mends, as returned by
    nodes.identity.
    """
    found = []
    if plan.way.in_pass and not _has_its_hook(plan, ob):
        found.append(Mend(HOOK, is_blocking=True))
    moved = displaced(ob, newcomers)
    if _has_own_for_nothing(plan, ob, moved):
        found.append(Mend(TAKE_OWN_AWAY))
    if moved or _are_before_own(plan, ob, newcomers):  # even if none moves: applying clears newcomers
        found.append(Mend(MOVE_DISPLACED, moved))
    if plan.way.kind == ways.ATTRIBUTE:
        if plan.own is None or not _is_first(plan, ob):
            found.append(Mend(PUT_OWN_FIRST, is_blocking=plan.own is None or not is_in_place(plan, ob)))
        elif nodes.has_old_group(ob.modifiers[plan.own]):
            found.append(Mend(RENEW_GROUP))
        if meshes.point_attribute(ob.data, nodes.POSITION_ATTRIBUTE) is None:
            found.append(Mend(ADD_ATTRIBUTE, is_blocking=True))
    return tuple(found)


def _has_its_hook(plan: Plan, ob: bpy.types.Object) -> bool:
    """Whether the hook waits for the object's own mesh and keys, and for everything that the plan's modifiers
    follow."""
    hook = plan.hook_of(ob)
    hooked = wiring.waits_for(hook, "mesh"), wiring.waits_for(hook, "keys")
    if [each and each.original for each in hooked] != [ob.data, ob.data.shape_keys]:
        return False
    return plan.waits_for_targets(ob)


def is_in_place(plan: Plan, ob: bpy.types.Object) -> bool:
    """Whether all modifiers before Sinew's are replaced by the plan or do nothing."""
    before = list(ob.modifiers)[: ob.modifiers.find(plan.own)]
    ours = {*plan.taken, *plan.run.stages}
    return all(modifier.name in ours or wiring.does_nothing(modifier) for modifier in before)


def _is_first(plan: Plan, ob: bpy.types.Object) -> bool:
    """Whether Sinew's modifier comes before the first Armature modifier that it replaces, or before all others."""
    names = ob.modifiers.keys()
    first = plan.taken[0] if plan.taken else names[0]
    return names.index(plan.own) <= names.index(first)


def _has_own_for_nothing(plan: Plan, ob: bpy.types.Object, moved: tuple[str, ...]) -> bool:
    """Whether Sinew's modifier or the attribute is in the file although the plan does without.

    A modifier that carries the hook stays where it is, unless it keeps others from where they belong: those of `moved`,
    or an Armature modifier with Multi Modifier, which mixes with the modifier right before it.
    """
    if plan.own is None or plan.way.kind == ways.ATTRIBUTE:
        return False
    own = ob.modifiers[plan.own]
    if plan.hook_path == wiring.path_of(own):
        following = list(ob.modifiers)[ob.modifiers.find(plan.own) + 1 :][:1]
        is_between = any(modifier.type == "ARMATURE" and modifier.use_multi_modifier for modifier in following)
        has_attribute = meshes.point_attribute(ob.data, nodes.POSITION_ATTRIBUTE) is not None
        return is_between or bool(moved) or has_attribute
    return nodes.is_removable(ob, own)


def _are_before_own(plan: Plan, ob: bpy.types.Object, newcomers: Collection[int]) -> bool:
    """Whether a modifier that has just been added is before Sinew's."""
    if plan.own is None or not newcomers:
        return False
    before = list(ob.modifiers)[: ob.modifiers.find(plan.own)]
    return any(nodes.identity(modifier) in newcomers for modifier in before)


def displaced(ob: bpy.types.Object, newcomers: Collection[int]) -> tuple[str, ...]:
    """Returns the names of the modifiers that Blender put before Sinew's, and so before others that deform.

    Blender allows some types only behind deforming modifiers: Multires, Soft Body and, since 5.0, Hook. Modifiers that
    the user moved there are left alone, unless they were just added or are not allowed before Sinew's while that is
    first.
    """
    own = nodes.find_modifier(ob)
    if own is None:
        return ()
    before = list(ob.modifiers)[: ob.modifiers.find(own.name)]
    came_first = meshes.point_attribute(ob.data, nodes.POSITION_ATTRIBUTE) is not None
    found = [modifier for modifier in before if came_first and modifier.type in ways.WANTS_DEFORM_ONLY]
    kinds = {"HOOK", *ways.WANTS_DEFORM_ONLY} if values.VERSION >= (5, 0, 0) else ways.WANTS_DEFORM_ONLY
    while before and before[-1].type in kinds and nodes.identity(before[-1]) in newcomers:
        newcomer = before.pop()
        last = before[-1] if before else None
        is_copy = last is not None and nodes.identity(last) not in newcomers and _is_copy(newcomer, last)
        if newcomer not in found and not is_copy:
            found.insert(0, newcomer)
    return tuple(modifier.name for modifier in found)


def _is_copy(modifier: bpy.types.Modifier, of: bpy.types.Modifier) -> bool:
    """Whether a modifier is a copy of the one before it: Blender inserts a copy directly behind its original."""
    names = "object", "subtarget", "strength", "falloff_type", "falloff_radius", "vertex_group"
    return modifier.type == of.type == "HOOK" and all(getattr(modifier, name) == getattr(of, name) for name in names)
