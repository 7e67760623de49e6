"""Measures from its phases how far a clip walks. Pure.

Letters: P phases, one cycle of the clip; V vertices. In the crowd's space, Z is up. Phase P would be phase 0 again.
"""

import numpy as np

NEAR_GROUND = 0.02  # vertices no higher than this fraction of the height may stand on the ground
STANDING = 0.01  # the fraction of the vertices, the lowest ones, that are compared from one phase to the next
LEAST = 0.05  # the smallest motion of a cycle that counts as walking, as a fraction of the height


def drift_of(first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Returns (3,) float64: how far the clip carries the character over the ground from phase 0 to phase P, given the
    positions (V, 3) of both; zero if it stays in place."""
    moved = (last - first).mean(axis=0, dtype=np.float64) * (1, 1, 0)
    return moved if np.linalg.norm(moved) > LEAST * height_of(first) else np.zeros(3)


def closes(first: np.ndarray, last: np.ndarray) -> bool:
    """Whether the character has the same shape in both phases."""
    return bool(np.abs(last - first).max(initial=0) <= 0.01 * height_of(first))


def stride_of(phases: np.ndarray) -> np.ndarray:
    """Returns (3,) float64: how far a character that walks in place, phases (P, V, 3), would move in a cycle if its
    feet did not slide; zero if it does not walk. The lowest vertices are taken for the feet: those on the ground move
    backwards as the body moves forwards."""
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


def height_of(positions: np.ndarray) -> float:
    return float(np.ptp(positions[:, 2])) if len(positions) else 0.0


def velocities(phases: np.ndarray, cycle_seconds: float) -> np.ndarray:
    """Returns (P, V, 3) float32: the velocity of each vertex at each phase, from the phases before and after it, in
    units per second."""
    ahead, behind = np.roll(phases, -1, axis=0), np.roll(phases, 1, axis=0)
    return ((ahead - behind) * np.float32(len(phases) / (2 * cycle_seconds))).astype(np.float32)
