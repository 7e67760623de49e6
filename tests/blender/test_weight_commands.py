"""The commands that transfer, smooth, mirror and reduce weights without a window."""

import json

import bpy
import numpy as np
import pytest

from helpers import addon_module
from test_automatic_weights import dense
from test_weight_reduction import make_animated
from test_weight_tools import SIDES, entries, make_body, make_symmetric, run, suit_of, transfer


@pytest.fixture
def saved(tmp_path):
    """Saves the scene. Returns the path."""

    def save():
        path = tmp_path / "scene.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
        return path

    return save


def result_of(out):
    return json.loads(out.splitlines()[-1])


def test_transfer(sinew, saved):
    body, _ = make_body()
    suit_of(body), suit_of(body, 1.1, "Coat")
    path = saved()
    words = "weights", "transfer", path, "--from", "Body", "--to", "Suit,Coat"
    code, out, err = sinew(*words, "--json", "--save", "--add-modifier")
    found = result_of(out)
    assert (code, err, found["path"], found["saved"]) == (0, "", str(path), True)
    first, second = found["results"][0]["objects"]
    assert (first["name"], first["vertices"], first["matched"], first["filled"]) == ("Suit", 1200, 1200, 0)
    assert second["name"] == "Coat" and found["results"][0]["sources"] == ["Body"]
    bpy.ops.wm.open_mainfile(filepath=str(path))
    body, suit = bpy.data.objects["Body"], bpy.data.objects["Suit"]
    made = dense(suit)
    assert suit.modifiers[0].object == bpy.data.objects["Rig"] and np.allclose(made.sum(axis=1), 1, atol=1e-5)
    suit.vertex_groups.clear()
    transfer(body, suit)
    assert np.array_equal(dense(suit), made)


def test_measuring_a_transfer_changes_nothing(sinew, saved):
    body, _ = make_body()
    suit_of(body)
    path = saved()
    before = path.read_bytes()
    code, out, _ = sinew("weights", "transfer", path, "--from", "Body", "--to", "Suit", "--measure", "--save")
    assert (code, out.splitlines()[-1]) == (0, "1,200 vertices: 1,200 matched")
    assert path.read_bytes() == before and not len(bpy.data.objects["Suit"].vertex_groups)


def test_a_transfer_far_from_what_is_painted_leaves_no_vertex_without_weights(sinew, saved):
    body, _ = make_body()
    suit_of(body)
    for group in body.vertex_groups:
        group.remove(range(1200))
    body.vertex_groups["bone4"].add([1199], 1.0, "REPLACE")
    badge = bpy.data.meshes.new("Badge")
    badge.from_pydata([(9, 0, 0), (9, 1, 0), (9, 0, 1)], [], [(0, 1, 2)])
    bpy.context.collection.objects.link(bpy.data.objects.new("Badge", badge))
    code, out, _ = sinew("weights", "transfer", saved(), "--from", "Body", "--to", "Badge")
    assert code == 0 and "1 island follows its nearest point" in out and "without weights" not in out


def test_smooth(sinew, saved):
    make_animated()
    path = saved()
    run("smooth_weights", bpy.data.objects["Tube"], steps=2, factor=0.25)
    expected = entries(bpy.data.objects["Tube"])
    code, out, err = sinew("weights", "smooth", path, "--objects", "Tube", "--steps", 2, "--factor", 0.25, "--json")
    assert (code, err) == (0, "") and entries(bpy.data.objects["Tube"]) == expected
    assert result_of(out)["results"][0]["changed"] == 1200 and result_of(out)["saved"] is False


def test_mirror(sinew, saved):
    make_symmetric()
    path = saved()
    run("mirror_weights", bpy.data.objects["Ball"])
    expected = dense(bpy.data.objects["Ball"], SIDES)
    code, out, _ = sinew("weights", "mirror", path, "--objects", "Ball")
    assert code == 0 and np.array_equal(dense(bpy.data.objects["Ball"], SIDES), expected)
    assert out.splitlines()[-1].startswith("Ball: ") and out.rstrip().endswith("vertices mirrored")
    assert sinew("weights", "mirror", path, "--objects", "Ball", "--axis", "z", "--from", "negative")[0] == 0


def test_reduce(sinew, saved):
    make_animated()
    path = saved()
    run("reduce_influences", bpy.data.objects["Tube"], max_influences=2)
    expected = entries(bpy.data.objects["Tube"])
    words = "weights", "reduce", path, "--objects", "Tube", "--max-influences", 2
    code, out, err = sinew(*words, "--json")
    found = result_of(out)["results"][0]
    assert (code, err) == (0, "") and entries(bpy.data.objects["Tube"]) == expected
    assert found["poses"] == 10 and 0 < found["mean_move"] < found["largest_move"]
    code, out, _ = sinew(*words, "--frames", "1-10:3", "--tolerance", 0.001, "--measure", "--save")
    assert code == 1 and "in 4 poses" in out and "would be reduced to 2 bones" in out
    assert entries(bpy.data.objects["Tube"]) != expected
    assert sinew(*words, "--test-poses", "--fade", 0, "--tolerance", 99)[0] == 0


def test_mistakes(sinew, saved):
    body, _ = make_body()
    path = saved()
    assert sinew("weights", "transfer", path, "--from", "Body", "--to", "Suit")[::2] == (
        1,
        "sinew: there is no mesh Suit\n",
    )
    assert sinew("weights", "transfer", path, "--from", "Body", "--to", "Body")[::2] == (
        1,
        "sinew: Body is both where weights come from and where they go: choose another mesh\n",
    )
    assert sinew("weights", "reduce", path, "--objects", "Body", "--frames", "1-3")[::2] == (
        1,
        "sinew: Rig is at rest on the frames 1 to 3: choose frames on which it moves, or use test poses\n",
    )
    code, out, _ = sinew("weights", "reduce", path, "--objects", "Body", "--max-influences", 1, "--measure")
    assert code == 0 and f"in {4 * 6} poses" in out
    assert sinew("weights", "smooth", path)[0] == 2 and sinew("weights", "stretch", path)[0] == 2
    assert sinew("weights", "smooth", path, "--objects", "Body", "--factor", 2)[0] == 2
    assert sinew("weights", "reduce", path, "--objects", "Body", "--frames", "9-3")[0] == 2
    assert sinew("weights", "transfer", path, "--from", "Body", "--to", "Rig")[0] == 1
    assert sinew("weights", "transfer", "--help")[0] == 0


def test_the_commands_are_those_that_the_shell_knows():
    options, tools = addon_module("cli.command_options"), addon_module("cli.command_line")
    assert list(options.COMMANDS) == list(tools.COMMANDS)
    assert options.joined(["weights", "smooth", "x"]) == ["weights smooth", "x"]
    assert options.joined(["weights", "x.blend"]) == ["weights", "x.blend"] and options.joined([]) == []
