"""Measures shapes. Does not use bpy."""

import numpy as np


def diagonal(positions: np.ndarray) -> float:
    """Returns the diagonal of the bounding box of (V, 3) positions, 0 without any."""
    return float(np.linalg.norm(np.ptp(positions, axis=0))) if len(positions) else 0.0
