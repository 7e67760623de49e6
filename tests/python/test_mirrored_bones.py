"""addon/sinew/weights/mirrored_bones.py, which needs no Blender: which bone is on the other side of which."""

import importlib
import sys
import types
from pathlib import Path

import numpy as np
import pytest

ADDON = Path(__file__).resolve().parents[2] / "addon/sinew"

# Without the add-on's __init__, which registers it in Blender.
package = sys.modules.setdefault("addon", types.ModuleType("addon"))
package.__path__ = [str(ADDON)]
mirrored_bones = importlib.import_module("addon.weights.mirrored_bones")

# What Blender's flip_name leaves alone.
UNKNOWN = (
    ("mixamorig:LeftArm", "mixamorig:RightArm"),
    ("ArmLeft01", "ArmRight01"),
    ("lShldrBend", "rShldrBend"),
    ("Bip01 L Arm", "Bip01 R Arm"),
    ("arm_sx", "arm_dx"),
    ("b_arm_1", "b_arm_2"),
)


def ends(*heads):
    heads = np.array(heads, float)
    return np.stack((heads, heads + (0, 0, 0.3)), axis=1)


@pytest.mark.parametrize("left, right", UNKNOWN)
def test_names_that_tell_nothing_are_paired_by_place(left, right):
    names = ("Hips", left, right, "Head")
    places = ends((0, 0, 1), (0.4, 0, 1.4), (-0.4, 0.001, 1.4), (0.001, 0, 1.7))
    assert mirrored_bones.pairs(names, names, places, 0).tolist() == [0, 2, 1, 3]


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
