"""Rigs whose poses Blender computed; tests/blender/make_rigs_from_blender.py made the file."""

import gzip
import json
from pathlib import Path

import numpy as np
import pytest
import sinew_native as sinew

RIGS = json.loads(gzip.decompress((Path(__file__).parent / "rigs_from_blender.json.gz").read_bytes()))


def constraint_types(rig):
    return {row["type"] for row in rig["description"]["constraints"] if not row["settings"].get("mute")}


def test_all_types_of_constraints_are_there():
    assert set().union(*map(constraint_types, RIGS)) == set(sinew.rig_constraint_settings())


@pytest.mark.parametrize("number", range(len(RIGS)))
def test_poses_are_blenders(number):
    rig = RIGS[number]
    poses = sinew.RigProgram(rig["description"]).evaluate(np.array(rig["frames"], np.float32))
    # Not to the bit: the C library may round sine and cosine otherwise than that of the Blender that made them.
    expected = np.array(rig["poses"], np.float32).reshape(poses.shape)
    np.testing.assert_allclose(poses, expected, atol=5e-5)
