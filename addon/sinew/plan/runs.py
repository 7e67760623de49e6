"""Finds the run: the modifiers after the first Armature modifiers that Sinew replaces too, and where it ends.

Without an armature, the run begins at the top of the stack. Blender evaluates the remaining modifiers, with Sinew's
shape as their input. Does not use Blender.
"""

import itertools
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from ..blender import modifier_types
from . import fronts
from .situation import Modifier, Situation


@dataclass(frozen=True)
class Run:
    """The modifiers that Sinew replaces besides the Armature modifiers, and why the next one is not among them."""

    stages: tuple[str, ...] = ()  # names of modifiers, in stack order
    end: str = ""  # name of the first that Blender still evaluates
    reason: str = ""  # why, a sentence for users
    mixes: tuple[tuple[str, ...], ...] = ()  # its Armature modifiers, those together that Multi Modifier mixes
    tail: tuple[str, ...] = ()  # names of the modifiers from `end` on that stencils may replace, see _tail


def of(situation: Situation) -> Run:
    """Returns the run of a mesh object."""
    modifiers, taken = situation.modifiers, situation.taken
    # An evaluation skips what is switched off in it. If it cannot tell whether it is for a render, all must have the
    # same switches: those of the Armature modifiers, else of shape keys, else of the first.
    like, shown = "", (True, True)
    if taken:
        like, shown = taken[0], situation.modifier(taken[0]).shown
    elif situation.keys is not None:
        like = "the mesh"
    start = [modifier.name for modifier in modifiers].index(taken[-1]) + 1 if taken else 0
    has_front = bool(fronts.of(modifiers, taken))
    stages: list[str] = []
    mixes: list[tuple[str, ...]] = []
    end = "", ""
    for i, modifier in enumerate(modifiers[start:], start):
        if modifier.is_own or modifier.does_nothing or modifier.is_beside_shape or modifier.name in stages:
            continue
        if not like:
            like, shown = modifier.name, modifier.shown
        mix = _mix_at(modifiers, i)
        asked = None if situation.tells_renders else shown
        reason = (
            _why_not(modifier, like, asked)
            or _why_not_mixed(mix[1:], like, asked)
            or _why_not_mixed_in(modifier, modifiers[i + 1 :])
            or why_not_known(mix[-1], modifiers)
            or _why_not_picked(modifier, modifiers[:i])
        )
        if modifier.type == "ARMATURE" and not taken:
            reason = _without_armature(stages)
        if has_front and not reason and modifier.type != "ARMATURE":
            reason = f"modifiers before {like} make other vertices than the mesh's own"
        if reason:
            end = modifier.name, reason
            break
        stages += [each.name for each in mix]
        if modifier.type == "ARMATURE":
            mixes.append(tuple(each.name for each in mix))
    tail = _tail(modifiers, end[0], situation.is_followed) if (taken or stages) and not has_front else ()
    if tail:
        reason = _why_no_tail(situation, stages)
        end = end[0], reason or "Sinew has not found the weights of its vertices yet"
        tail = () if reason else tail
    return Run(tuple(stages), *end, tuple(mixes), tail)


def _why_no_tail(situation: Situation, stages: Collection[str]) -> str:
    """Returns why Sinew cannot compute any tail of the object, a clause, or "". stages: of the run."""
    if situation.sharer_count > 1:
        return "other objects share the mesh: make it single-user"
    if situation.is_linked:
        return "the object is linked, so Sinew cannot add what it needs: make a library override of it"
    if situation.wants_more:
        return "its method or output needs the mesh's own vertices"
    if situation.generated_in:
        return f"the Generated coordinates of {situation.generated_in} stay in place only while Blender evaluates it"
    return (
        why_no_own(situation, stages)
        or situation.front_trouble
        or ("" if situation.tells_renders else "nothing was evaluated yet")
    )


def why_no_own(situation: Situation, stages: Collection[str]) -> str:
    """Returns why Sinew's modifier cannot place the vertices, a clause, or "". stages: of the run."""
    for modifier in situation.modifiers:
        if modifier.type in modifier_types.ONLY_BEHIND_DEFORMING:
            return f"{modifier.name} allows only deforming modifiers before it"
    for modifier in situation.modifiers:
        if modifier.picks_by_index and not modifier.does_nothing and modifier.name not in stages:
            return f"{modifier.name} picks vertices by index, and Blender mixes these up behind Sinew's modifier"
    return ""


def _tail(modifiers: Sequence[Modifier], first: str, is_followed: bool) -> tuple[str, ...]:
    """Returns the names of the modifiers from `first` on whose results are weighted sums, without those that Blender
    does not evaluate in a viewport before somebody needs their vertices. is_followed: as in Situation."""
    found: list[Modifier] = []
    behind = itertools.dropwhile(lambda each: each.name != first, modifiers)
    shown = [each for each in behind if not each.is_own and not each.does_nothing]
    while len(found) < len(shown) and not shown[len(found)].tail_trouble and all(shown[len(found)].shown):
        found.append(shown[len(found)])
    if len(found) == len(shown) and not is_followed:
        while found and found[-1].type in modifier_types.DEFERRED:
            found.pop()
    return tuple(each.name for each in found) if any(each.type != "TRIANGULATE" for each in found) else ()


def _mix_at(modifiers: Sequence[Modifier], index: int) -> list[Modifier]:
    """Returns the modifier with that index, and those that Multi Modifier mixes with it: the Armature modifiers right
    behind it, as long as they have that setting. They start from the shape from which it starts."""
    mix = [modifiers[index]]
    if mix[0].type == "ARMATURE":
        behind = itertools.takewhile(lambda each: each.type == "ARMATURE" and each.is_mixed, modifiers[index + 1 :])
        mix += [each for each in behind if not each.does_nothing]
    return mix


def _why_not_mixed(others: Sequence[Modifier], like: str, shown: tuple[bool, bool] | None) -> str:
    """Returns why Sinew cannot replace one of the other modifiers of a mix, or "". like, shown: see _why_not."""
    for other in others:
        reason = _why_not(other, like, shown)
        if reason:
            return f"it is mixed with {other.name}, which Sinew cannot replace: {reason}"
    return ""


def _why_not_mixed_in(modifier: Modifier, behind: Sequence[Modifier]) -> str:
    """Returns why Sinew cannot replace a modifier of those whose input Blender keeps for Armature modifiers with Multi
    Modifier right behind them, or ""."""
    if modifier.type not in modifier_types.MIXED_IN:
        return ""
    mixing = itertools.takewhile(lambda each: each.type == "ARMATURE" and each.is_mixed, behind)
    for each in mixing:
        if not each.does_nothing:
            return f"{each.name} behind it mixes with it: turn off Multi Modifier there if it need not"
    return ""


def why_not_known(modifier: Modifier, modifiers: Sequence[Modifier]) -> str:
    """Returns why it is not known what Blender uses the result of a modifier for, or "": on some frames, one behind it
    may start from its input. modifiers: all of the object."""
    if modifier.type != "ARMATURE" and modifier.type not in modifier_types.MIXED_IN:
        return ""
    behind = modifiers[modifiers.index(modifier) + 1 :]
    mixing = itertools.takewhile(lambda each: each.type == "ARMATURE" and (each.is_mixed or each.may_be_mixed), behind)
    for each in mixing:
        if each.may_be_mixed and not each.does_nothing:
            return f"Multi Modifier of {each.name} behind {modifier.name} is animated: remove that"
    return ""


def _why_not_picked(modifier: Modifier, before: Sequence[Modifier]) -> str:
    """Returns why Blender's own result of a Hook is not the one that Sinew would compute, or "". Behind a modifier that
    keeps all vertices and may change something else, Blender moves the mesh's first vertices, as many as there are, in
    place of the chosen ones."""
    changing = [each for each in before if each.type not in modifier_types.ONLY_DEFORMING]
    keeping = next((each for each in changing if each.keeps_shape and each.is_shown), None)
    if not modifier.picks_by_index or keeping is None:
        return ""
    return f"it picks vertices by index, and Blender mixes these up behind {keeping.name}: move it before that one"


def _without_armature(stages: Collection[str]) -> str:
    """Returns why an Armature modifier ends the run of a mesh that was bound without one. stages: before it."""
    if stages:
        return "the mesh was bound without it, because other modifiers come before it"
    return "the mesh was bound without it: unbind the mesh and accelerate it again"


def _why_not(modifier: Modifier, like: str, shown: tuple[bool, bool] | None) -> str:
    """Returns why Sinew cannot replace a modifier, or "". shown: the switches of what is named `like`, which it must
    have too, unless it is None."""
    if modifier.type not in modifier_types.STAGES:
        reason = modifier.tail_trouble if modifier.type in modifier_types.TAILS else ""
        if modifier.type in modifier_types.FRONTS - modifier_types.TAILS and like:
            reason = "before the armature's, it is evaluated once"
        return f"Sinew cannot evaluate modifiers of the type {modifier.title}" + (reason and f": {reason}")
    reason = why_not_driven(modifier, "its {}") or modifier.trouble
    if not reason and shown is not None and not modifier.is_switched and modifier.shown != shown:
        return f"its switches for viewport and renders differ from those of {like}"
    return reason


def why_not_bound(bound: int | None, own: int) -> str:
    """Returns why a modifier that has to be bound has no effect, or another one, on a mesh, or "". bound: number of
    vertices to which it was bound, None if it is not; own: those of the mesh."""
    if bound is None:
        return "it is not bound: press Bind in that modifier"
    return f"it was bound to {bound:,} vertices, and the mesh has {own:,}: bind it again" if bound != own else ""


def why_not_driven(modifier: Modifier, setting: str) -> str:
    """Returns why Sinew cannot follow a driver of a modifier's setting, or "". setting: how to name it, with {}."""
    for each in modifier.driven:
        if each.trouble:
            return f"{setting.format(each.name.replace('_', ' '))} is driven, and {each.trouble}"
    return ""
