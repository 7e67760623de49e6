"""How far a clip walks, from its phases. Pure.

Letters: P phases, one cycle of the clip; V vertices. Space of the crowd: Z is up. Phase P would be phase 0 again.
"""

import numpy as np

NEAR_GROUND = 0.02  # of the height: vertices that low may stand
STANDING = 0.01  # of the vertices, the lowest, are looked at from one phase to the next
LEAST = 0.05  # of the height: what a cycle that walks moves at least


def drift_of(first, last):
    """(3,) float64: how far the clip carries the character over the ground from phase 0 to phase P, positions (V, 3);
    zero if it stays in place."""
    moved = (last - first).mean(axis=0, dtype=np.float64) * (1, 1, 0)
    return moved if np.linalg.norm(moved) > LEAST * height_of(first) else np.zeros(3)


def closes(first, last):
    """Whether the character has the same shape in both."""
    return bool(np.abs(last - first).max(initial=0) <= 0.01 * height_of(first))


def stride_of(phases):
    """(3,) float64: how far a character that walks in place, phases (P, V, 3), would come in a cycle if its feet did
    not slide; zero if it does not walk. The feet are what is lowest: what stands on the ground goes back as the body
    goes ahead."""
    top = max(map(height_of, phases), default=0.0)
    ground = min((phase[:, 2].min() for phase in phases), default=0.0)
    steps = []
    for before, after in zip(phases, np.roll(phases, -1, axis=0)):
        low = np.maximum(before[:, 2], after[:, 2])
        count = max(1, int(STANDING * len(low)))
        standing = np.argpartition(low, count - 1)[:count]
        standing = standing[low[standing] <= ground + NEAR_GROUND * top]
        if len(standing):
            steps.append(np.median(after[standing] - before[standing], axis=0))
    if not steps:
        return np.zeros(3)
    stride = -len(phases) * np.median(steps, axis=0).astype(np.float64) * (1, 1, 0)
    return stride if np.linalg.norm(stride) > LEAST * top else np.zeros(3)


def height_of(positions):
    return float(np.ptp(positions[:, 2])) if len(positions) else 0.0


def velocities(phases, cycle_seconds):
    """(P, V, 3) float32, units a second: of each vertex at each phase, by its neighbours in time."""
    ahead, behind = np.roll(phases, -1, axis=0), np.roll(phases, 1, axis=0)
    return ((ahead - behind) * np.float32(len(phases) / (2 * cycle_seconds))).astype(np.float32)
