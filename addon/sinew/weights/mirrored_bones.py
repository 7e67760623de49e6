"""Which bone is on the other side of which. Independent of Blender."""

from collections.abc import Sequence
from difflib import SequenceMatcher

import numpy as np

NEAR = 0.02  # of the size of all bones: how far the ends of a bone may be from those of the mirrored one


def pairs(names: Sequence[str], flipped: Sequence[str], ends: np.ndarray, axis: int) -> np.ndarray:
    """Returns (B,) int: the number of the bone on the other side of each, its own for one in the middle, -1 for one
    that lacks the other.

    names: of the bones; flipped: the names of the other side, as Blender finds them; its own name where it finds no
    side. ends (B, 2, 3): heads and tails, in a space whose origin is in the mirror, across axis 0, 1 or 2. Where names
    do not tell, the bone at the mirrored place is the other one; of several there, the one with the most similar
    name."""
    count, number = len(names), {name: i for i, name in enumerate(names)}
    found = np.full(count, -1)
    for i, other in enumerate(flipped):
        if other != names[i] and number.get(other, -1) >= 0:
            found[i] = number[other]
    found[found[found] != np.arange(count)] = -1
    left = np.flatnonzero(found < 0)
    if not len(left):
        return found
    sign = np.ones(3)
    sign[axis] = -1
    near = max(NEAR * float(np.ptp(ends.reshape(-1, 3), axis=0).max()), 1e-30)
    candidates = []
    for i in left.tolist():
        distances = np.linalg.norm(sign * ends[i] - ends[left], axis=2).max(axis=1)
        for at in np.flatnonzero(distances <= near).tolist():
            j = int(left[at])
            if i <= j:
                candidates.append((int(distances[at] / near * 5), -_likeness(names, i, j), distances[at], i, j))
    for *_, i, j in sorted(candidates):
        # A bone whose name has a side is not in the middle.
        if found[i] < 0 and found[j] < 0 and not (i == j and flipped[i] != names[i]):
            found[i], found[j] = j, i
    return found


def _likeness(names: Sequence[str], one: int, other: int) -> float:
    """Returns how alike two names are: 1 for equal ones."""
    return 1.0 if one == other else SequenceMatcher(None, names[one], names[other]).ratio()
