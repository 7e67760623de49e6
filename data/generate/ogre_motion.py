"""The ogre's target pose and its walk."""
import numpy as np

import posing
from ogre_skeleton import INDEX, NAMES, PARENTS, POSITIONS

POSES = 32


def target_pose():
    """Euler degrees (2, J, 3): rest, and a roar."""
    return np.zeros((2, len(NAMES), 3))


def walk():
    """Quaternions (POSES, J, 4)."""
    poses = np.zeros((POSES, len(NAMES), 4))
    poses[:, :, 0] = 1
    return poses
