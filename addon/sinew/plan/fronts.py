"""Finds the front: the modifiers before the first Armature modifier that make other vertices, and those between them.

Blender evaluates a front on a canvas, once, as long as nothing of it is edited; Sinew begins with the result. Does not
use Blender.
"""

import itertools
from collections.abc import Sequence

from ..blender import modifier_types
from .situation import Modifier, Situation


def of(modifiers: Sequence[Modifier], taken: Sequence[str]) -> tuple[Modifier, ...]:
    """Returns the front, in stack order; none if all modifiers before the first taken one keep the vertices. A
    Collision before it is no part of it: the object keeps it, and it sees the same there. modifiers: of an object, in
    stack order; taken: as in Situation."""
    found = []
    for modifier in modifiers if taken else ():
        if modifier.name == taken[0]:
            break
        if not modifier.is_own and not modifier.does_nothing:
            found.append(modifier)
    found = list(itertools.dropwhile(lambda each: each.type == "COLLISION", found))
    return () if all(modifier.keeps_shape for modifier in found) else tuple(found)


def why_not(situation: Situation) -> tuple[str, str]:
    """Returns why Sinew cannot begin with the result of the object's front, a clause about a modifier or a sentence,
    and the name of that modifier, or ""; "" twice if it can."""
    front = of(situation.modifiers, situation.taken)
    unable = [each for each in front if each.type not in modifier_types.FRONTS or situation.keys is not None]
    for modifier in front:
        if modifier in unable:  # without one that changes the shape, those that keep it may not be in the way
            found = next((each for each in unable if not each.keeps_shape), modifier)
            return f"{found.full_name} comes before {situation.taken[0]}, with which Sinew has to begin", found.name
        reason = "it is animated" if modifier.is_animated else modifier.front_trouble
        if not reason and situation.is_linked and situation.canvas is None:
            reason = "the object is linked, so Sinew cannot add what it needs to begin with the result"
        if reason:
            return f"{modifier.full_name} comes before {situation.taken[0]}, and {reason}", modifier.name
    if situation.wants_more:
        reason = (
            "Its method or output needs the mesh's own vertices, and modifiers before the Armature modifier make others"
        )
        return reason, ""
    return situation.front_trouble, ""
