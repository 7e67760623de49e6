"""addon/sinew/weights/mirrored_bones.py, which needs no Blender: which bone is on the other side of which."""

import importlib
import sys
import types
from pathlib import Path

import numpy as np
import pytest

from side_names import SIDE_NAMES

ADDON = Path(__file__).resolve().parents[2] / "addon/sinew"

# Without the add-on's __init__, which registers it in Blender.
package = sys.modules.setdefault("addon", types.ModuleType("addon"))
package.__path__ = [str(ADDON)]
mirrored_bones = importlib.import_module("addon.weights.mirrored_bones")


def ends(*heads):
    heads = np.array(heads, float)
    return np.stack((heads, heads + (0, 0, 0.3)), axis=1)


@pytest.mark.parametrize("left, right, is_flipped", SIDE_NAMES)
def test_sides_are_found_however_they_are_named(left, right, is_flipped):
    """A strap lies beside each arm, and rest positions are a little off, as in all rigs."""
    names = ("Hips", left, right, "Strap 1", "Strap 2", "Head")
    flipped = ("Hips", right, left, "Strap 1", "Strap 2", "Head") if is_flipped else names
    heads = ((0, 0, 1), (0.4, 0, 1.4), (-0.4, 0.001, 1.4), (-0.41, 0, 1.43), (0.41, 0, 1.43), (0.001, 0, 1.7))
    assert mirrored_bones.pairs(names, flipped, ends(*heads), 0).tolist() == [0, 2, 1, 4, 3, 5]


def test_names_that_tell_are_believed():
    names, flipped = ("arm.L", "arm.R", "toe.L"), ("arm.R", "arm.L", "toe.R")
    places = ends((0.4, 0, 1.4), (-0.1, 0, 0), (0, 0, 0))
    assert mirrored_bones.pairs(names, flipped, places, 0).tolist() == [1, 0, -1]


def test_bones_at_the_same_place_are_paired_by_the_likeness_of_their_names():
    names = ("LeftArm", "LeftArmTwist", "RightArmTwist", "RightArm")
    places = ends((0.4, 0, 1), (0.4, 0, 1), (-0.4, 0, 1), (-0.4, 0, 1))
    assert mirrored_bones.pairs(names, names, places, 0).tolist() == [3, 2, 1, 0]


def test_a_bone_of_one_side_alone_has_no_other():
    names = ("Hips", "Sword", "LeftArm")
    assert mirrored_bones.pairs(names, names, ends((0, 0, 1), (0.5, 0, 1), (0.3, 0, 2)), 0).tolist() == [0, -1, -1]
    assert mirrored_bones.pairs(names, names, ends((1, 0, 0), (1, 0.5, 0), (2, -0.5, 0)), 1).tolist() == [0, -1, -1]
