"""Skins and rig programs, pickled and copied."""

import copy
import pickle

import numpy as np
import pytest
import sinew_native as sinew

from test_hostile_input import BONE, MATRICES, POINTS
from test_rigs_from_blender import RIGS

LOCATION = 'pose.bones["Arm"].location'
FRAMES = np.array([1.0, 2.5, 10.0])


def curve(*keys, index=0):
    rows = [[t - 1, y, t, y, t + 1, y, 0, 0, 0, 1, 0] for t, y in keys]
    return {"path": LOCATION, "index": index, "keys": rows}


def same_twice(one):
    return pickle.loads(pickle.dumps(one)), copy.copy(one), copy.deepcopy(one)


def test_a_skin_has_the_same_bits():
    skin = sinew.Skin(POINTS, np.array([0, 2, 2, 3, 5]), np.array([1, 0, 1, 0, 0]), np.array([0.1, 0.7, 1, 0, 0.3]), 2)
    skin.set_rest_positions(POINTS / 3)
    for other in same_twice(skin):
        assert other is not skin and other.joint_count == 2
        for name in ("rest_positions", "offsets", "joints", "weights"):
            assert getattr(other, name).tobytes() == getattr(skin, name).tobytes()
        assert sinew.skin_linear(other, MATRICES).tobytes() == sinew.skin_linear(skin, MATRICES).tobytes()
    other.set_rest_positions(POINTS)
    assert (skin.rest_positions == np.float32(POINTS / 3)).all()


@pytest.mark.parametrize("number", range(0, len(RIGS), 7))
def test_a_program_computes_the_same_bits(number):
    rig, _ = RIGS[number]
    program, frames = sinew.RigProgram(rig["description"]), np.array(rig["frames"], np.float32)
    wanted = program.evaluate(frames, rig["inputs"])
    for other in same_twice(program):
        assert other.evaluate(frames, rig["inputs"]).tobytes() == wanted.tobytes()


def test_an_edited_program_keeps_its_edits():
    program = sinew.RigProgram({"blender": 502, "bones": [BONE], "curves": [curve((0, 1), (10, 2))]})
    given = np.array([4.0, 5, 6])
    for edit in (
        ({LOCATION: given}, []),
        ({f"{LOCATION}[1]": 7}, [curve((0, 3), (10, 9))]),
        ({'pose.bones["Arm"].scale': [1, 2, 3]}, []),
        ({LOCATION: [0, 8, 9]}, [curve((0, 5))]),
    ):
        program = program.edited(*edit)
        given[:] = -1  # it was copied
        wanted = program.evaluate(FRAMES).tobytes()
        for other in same_twice(program):
            assert other.evaluate(FRAMES).tobytes() == wanted
            assert same_twice(other)[0].evaluate(FRAMES).tobytes() == wanted


def test_the_description_may_change_afterwards():
    description = {"blender": 502, "bones": [BONE | {"values": [0.0] * 61}]}
    program = sinew.RigProgram(description)
    wanted = program.evaluate(FRAMES).tobytes()
    description["bones"][0]["length"] = 3
    description["bones"][0]["values"][0] = 5.0
    assert pickle.loads(pickle.dumps(program)).evaluate(FRAMES).tobytes() == wanted


def test_a_program_that_did_not_keep_its_description():
    program = sinew.RigProgram({"blender": 502, "bones": [BONE]}, keep_description=False)
    for each in (program, program.edited({LOCATION: [1, 2, 3]}, [])):
        with pytest.raises(TypeError, match="cannot be pickled; make it with keep_description=True"):
            pickle.dumps(each)
        assert copy.copy(each).evaluate(FRAMES).tobytes() == each.evaluate(FRAMES).tobytes()


@pytest.mark.parametrize("cls", (sinew.Skin, sinew.RigProgram))
@pytest.mark.parametrize("state", ((), (1, 2, 3), (None,) * 5, ({}, {}, []), "abc"))
def test_what_is_no_state(cls, state):
    with pytest.raises((ValueError, TypeError)):
        cls.__new__(cls).__setstate__(state)
