"""Rigs whose poses Blender computed; tests/blender/make_rigs_from_blender.py made the files."""

import gzip
import json
from pathlib import Path

import numpy as np
import pytest
import sinew_native as sinew

import c_library

FILES = sorted(Path(__file__).parent.glob("rigs_from_blender_*.json.gz"))
DOCUMENTS = [json.loads(gzip.decompress(path.read_bytes())) for path in FILES]
RIGS = [(rig, document["c_library"]) for document in DOCUMENTS for rig in document["rigs"]]


def constraint_types(rig):
    return {row["type"] for row in rig["description"]["constraints"] if not row["settings"].get("mute")}


def test_all_types_of_constraints_are_there():
    assert len(FILES) == 2
    assert set().union(*(constraint_types(rig) for rig, _ in RIGS)) == set(sinew.rig_constraint_settings())


def test_files_of_them_are_read_to_the_bit(tmp_path):
    path = tmp_path / "rig.json"
    for rig, _ in RIGS:
        path.write_text(json.dumps(rig["description"]), encoding="utf-8")
        frames = np.array(rig["frames"], np.float32)
        poses, of_file = (sinew.RigProgram(each).evaluate(frames, rig["inputs"]) for each in (rig["description"], path))
        assert poses.tobytes() == of_file.tobytes()


@pytest.mark.parametrize("number", range(len(RIGS)))
def test_poses_are_blenders(number):
    rig, c_library_of_blender = RIGS[number]
    poses = sinew.RigProgram(rig["description"]).evaluate(np.array(rig["frames"], np.float32), rig["inputs"])
    expected = np.array(rig["poses"], np.float32).reshape(poses.shape)
    # Another C library rounds sine and cosine in other ways.
    is_same = c_library.fingerprint() == c_library_of_blender
    np.testing.assert_allclose(poses, expected, rtol=0, atol=0 if is_same else 5e-5)
