"""Lists the mends: what a plan needs to have added, moved or removed in the file. The main thread applies them
(install/mending.py). Does not use Blender."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from ..blender import modifier_types
from . import plans, ways
from .plans import Plan
from .situation import Hook, Modifier, Situation

# In the order in which they are applied.
HOOK = "HOOK"  # the hook's driver waits for the wrong data-blocks
RELEASE_CANVAS = "RELEASE_CANVAS"  # Sinew's modifier reads a canvas, or there is one, for nothing
TAKE_OWN_AWAY = "TAKE_OWN_AWAY"  # Sinew's modifier is not needed: remove it, or move it behind all others
MOVE_DISPLACED = "MOVE_DISPLACED"  # Blender put new modifiers before Sinew's: move them behind those that deform
PUT_OWN_FIRST = "PUT_OWN_FIRST"  # Sinew's modifier is missing, or is not before everything that it replaces
RENEW_GROUP = "RENEW_GROUP"  # Sinew's modifier has the node group of an older version
ADD_ATTRIBUTE = "ADD_ATTRIBUTE"  # the mesh lacks the attribute of deformed positions
READ_CANVAS = "READ_CANVAS"  # the object has no canvas of its mesh, or Sinew's modifier does not read it
REMOVE_ATTRIBUTE = "REMOVE_ATTRIBUTE"  # the mesh has the attribute for nothing


@dataclass(frozen=True)
class Mend:
    """One change of the file."""

    what: str
    modifiers: tuple[str, ...] = ()  # names of the modifiers to move
    is_blocking: bool = False  # Blender's own modifiers deform until it is applied


def needed(plan: Plan, situation: Situation, newcomers: Collection[int]) -> tuple[Mend, ...]:
    """Returns the mends that the file needs for the plan, in the order in which to apply them.

    situation: of the original object; newcomers: modifiers that were added since the main thread last applied mends, as
    returned by nodes.identity.
    """
    own = situation.own
    found = []
    if plan.way.in_pass and not _has_its_hook(plan, situation):
        found.append(Mend(HOOK, is_blocking=True))
    moved = _displaced(situation, newcomers)
    if plan.way.kind != ways.CANVAS and (situation.canvas is not None or own is not None and own.reads_canvas):
        found.append(Mend(RELEASE_CANVAS, is_blocking=plan.way.kind == ways.ATTRIBUTE))
    if _has_own_for_nothing(plan, situation, moved):
        found.append(Mend(TAKE_OWN_AWAY))
    # Even if none moves: applying clears newcomers.
    if moved or any(modifier.identity in newcomers for modifier in _before_own(situation)):
        found.append(Mend(MOVE_DISPLACED, moved))
    if plan.way.has_own:
        if own is None or not _is_first(plan, situation):
            found.append(Mend(PUT_OWN_FIRST, is_blocking=own is None or not is_in_place(plan, situation)))
        if own is not None and own.has_old_group:
            found.append(Mend(RENEW_GROUP))
    if plan.way.kind == ways.ATTRIBUTE and not situation.has_attribute:
        found.append(Mend(ADD_ATTRIBUTE, is_blocking=True))
    if plan.way.kind == ways.CANVAS:
        is_read = own is not None and own.reads_canvas and own.canvas == situation.canvas is not None
        takes_enough = own is not None and (own.reads_front or not plan.way.on_canvas)
        is_slow = own is not None and plan.way.takes_all and not own.reads_front and not situation.is_linked
        is_wrong = not is_read or not takes_enough or own is not None and own.reads_front and not plan.way.takes_all
        if is_wrong or is_slow:
            found.append(Mend(READ_CANVAS, is_blocking=is_wrong))
        if situation.has_attribute and not situation.is_mesh_linked:
            found.append(Mend(REMOVE_ATTRIBUTE))
    return tuple(found)


def _has_its_hook(plan: Plan, situation: Situation) -> bool:
    """Whether the hook waits for the object's own mesh and keys, and for everything that the plan's modifiers
    follow."""
    hook = situation.hook
    keys = situation.keys.identity if situation.keys is not None else None
    is_on_canvas, has_copy = plan.way.kind == ways.CANVAS, plan.way.has_copy
    mesh = situation.mesh if has_copy or not is_on_canvas else None
    wanted = mesh, keys, situation.canvas if is_on_canvas else None, situation.copied if has_copy else None
    if hook is None or hook.path != plan.hook_path or (hook.mesh, hook.keys, hook.canvas, hook.copied) != wanted:
        return False
    if is_on_canvas and hook.canvas is None:
        return False
    modifiers = plans.replaced_in(situation, plan.run)
    if hook.driven != tuple(each for modifier in modifiers for driven in modifier.driven for each in driven.variables):
        return False
    if not all(modifier.switch_drivers <= hook.awaited for modifier in modifiers):
        return False
    return waits_for(hook, (modifier.awaits for modifier in modifiers))


def waits_for(hook: Hook, targets: Iterable[tuple[int, str] | None]) -> bool:
    """Whether the hook waits for all these targets, and all that it waits for still exists.

    targets: `awaits` of the modifiers that Sinew replaces. They may change at any time, and objects and bones may be
    added and removed.
    """
    return not hook.has_lost_target and {target for target in targets if target is not None} <= hook.targets


def is_in_place(plan: Plan, situation: Situation) -> bool:
    """Whether all modifiers before Sinew's are replaced by the plan or keep the shape, and those that depend on the
    shape before it is deformed come before Sinew's."""
    ours = {*plan.replaced, *plan.way.front}
    return (
        _is_behind_front(plan, situation)
        and _sees_rest(situation)
        and all(
            modifier.name in ours or modifier.does_nothing or modifier.keeps_shape
            for modifier in _before_own(situation)
        )
    )


def _is_behind_front(plan: Plan, situation: Situation) -> bool:
    """Whether Sinew's modifier comes after the whole front."""
    return {modifier.name for modifier in _before_own(situation)}.issuperset(plan.way.front)


def _sees_rest(situation: Situation) -> bool:
    """Whether each modifier before the first that Sinew replaces, if it depends on the shape, comes before Sinew's."""
    before = _before_own(situation)
    for modifier in situation.modifiers:
        if modifier.name in situation.taken[:1]:
            break
        if modifier.keeps_shape and modifier.reads_shape and modifier.is_shown and modifier not in before:
            return False
    return True


def _before_own(situation: Situation) -> list[Modifier]:
    """Returns the modifiers before Sinew's; none if there is no such modifier."""
    own = situation.own
    return [] if own is None else list(situation.modifiers[: situation.modifiers.index(own)])


def _is_first(plan: Plan, situation: Situation) -> bool:
    """Whether Sinew's modifier comes before the first Armature modifier that it replaces, and behind what keeps the
    shape but depends on it; or before all others."""
    names = [modifier.name for modifier in _before_own(situation)]
    if not plan.taken:
        return not names
    return plan.taken[0] not in names and _is_behind_front(plan, situation) and _sees_rest(situation)


def _has_own_for_nothing(plan: Plan, situation: Situation, moved: tuple[str, ...]) -> bool:
    """Whether Sinew's modifier or the attribute is in the file although the plan does without.

    A modifier that carries the hook stays where it is, unless it keeps others from where they belong: those of `moved`,
    or an Armature modifier with Multi Modifier, which mixes with the modifier right before it.
    """
    own = situation.own
    if own is None or plan.way.has_own:
        return False
    if situation.hook is not None and situation.hook.carrier == own.name:
        following = situation.modifiers[situation.modifiers.index(own) + 1 :][:1]
        is_between = any(modifier.is_mixed for modifier in following)
        return is_between or bool(moved) or situation.has_attribute
    return not own.is_fixed


def _displaced(situation: Situation, newcomers: Collection[int]) -> tuple[str, ...]:
    """Returns the names of the modifiers that Blender put before Sinew's, and so before others that deform.

    Blender allows some types only behind deforming modifiers: Multires, Soft Body and, since 5.0, Hook. Modifiers that
    the user moved there are left alone, unless they were just added or are not allowed before Sinew's while that is
    first.
    """
    before = _before_own(situation)
    kinds = modifier_types.ONLY_BEHIND_DEFORMING if situation.has_attribute else ()
    found = [modifier for modifier in before if modifier.type in kinds]
    while before and before[-1].comes_first and before[-1].identity in newcomers:
        newcomer = before.pop()
        last = before[-1] if before else None
        is_copy = last is not None and last.identity not in newcomers and _is_copy(newcomer, last)
        if newcomer not in found and not is_copy:
            found.insert(0, newcomer)
    return tuple(modifier.name for modifier in found)


def _is_copy(modifier: Modifier, of: Modifier) -> bool:
    """Whether a modifier is a copy of the one before it: Blender inserts a copy directly behind its original."""
    return modifier.type == of.type == "HOOK" and modifier.likeness == of.likeness
