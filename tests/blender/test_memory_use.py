"""Sinew without Blender's memory, because somebody wants it so: what is said, and that all shapes are right."""

import json
import os
import subprocess

import bpy
import pytest

from characters import accelerate, make_armature, make_mesh, pose
from helpers import (
    COMMAND,
    addon_module,
    assert_same_shape,
    evaluated,
    is_deforming,
    needs_memory,
    own_positions,
    reopened,
    shortcut_of,
    twin_of,
    way,
)
from zoo import Zoo, forget_memory

pytestmark = needs_memory  # to begin with
SWITCH = "Use Blender's Memory is off, so Blender's own modifiers deform: switch it on in Sinew's preferences"
SAFE = "SINEW_SAFE is set, so Blender's own modifiers deform: start Blender without it"


@pytest.fixture
def preferences():
    yield addon_module("main.addon_preferences").of_sinew()
    addon_module("main.addon_preferences").of_sinew().uses_memory = True


def facts():
    return addon_module("main.memory_use").facts()


def test_all_is_on_unless_somebody_wants_it_off(preferences):
    every = list(addon_module("host.features").FEATURES)
    assert preferences.uses_memory
    assert facts() == {
        "sinew": addon_module("native").VERSION,
        "blender": bpy.app.version_string,
        "on": every,
        "off": [],
        "why": [],
    }
    preferences.uses_memory = False
    assert facts()["on"] == [] and facts()["off"] == every and facts()["why"] == [SWITCH]
    first, second = addon_module("main.memory_use").states()
    assert first == f"Sinew {addon_module('native').VERSION} in Blender {bpy.app.version_string}"
    assert second == f"Blender's memory: none of {len(every)} features on"


def test_the_preference_works_at_once_and_back(fresh_scene, preferences):
    """Bound meshes of all kinds keep their shapes, and a played one is live."""
    zoo = Zoo(fresh_scene)
    zoo.reopen()
    every = set(addon_module("host.features").FEATURES)
    states = addon_module("played.states")
    try:
        assert zoo.play() + zoo.differences(set()) == []
        states.take_over([zoo.rig], fresh_scene, bpy.context.view_layer)
        assert zoo.rig.is_played
        preferences.uses_memory = False
        assert not zoo.rig.is_played
        assert zoo.play() + zoo.differences(every) == []
        assert zoo.take_over() == (False, [])
        preferences.uses_memory = True
        assert zoo.play() + zoo.differences(set()) == []
        assert zoo.take_over() == (True, [])
    finally:
        preferences.uses_memory = True
        forget_memory()


def test_a_loss_is_named_among_what_is_on(monkeypatch):
    contract = addon_module("host.contract")
    monkeypatch.setattr(contract, "off", lambda: ["B-bones", "Weights"])
    second = addon_module("main.memory_use").states()[1]
    count = len(addon_module("host.features").FEATURES)
    assert second == f"Blender's memory: {count - 2} of {count} features on, without B-bones, Weights"


def test_nothing_is_read_by_address(fresh_scene, preferences, character, monkeypatch):
    """Not even what every version of Blender keeps in the same way."""
    ob, twin, _ = character
    preferences.uses_memory = False
    mesh_arrays = addon_module("host.mesh_arrays")
    monkeypatch.setattr(mesh_arrays, "ctypes", None)
    assert mesh_arrays.read_connections(ob.data.loops, "vertex_index").shape == (len(ob.data.loops), 1)
    fresh_scene.frame_set(6)
    assert (evaluated(ob) == evaluated(twin)).all() and way(ob) == "BLENDER" and shortcut_of(ob) is None


def test_the_command_line_says_it(character, sinew, preferences, tmp_path):
    path = tmp_path / "character.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    code, out, _ = sinew("info", path, "--json")
    found = json.loads(out.splitlines()[-1])
    assert code == 0 and found["program"]["off"] == [] and found["unknown"] == []
    assert sinew("info", path)[1].splitlines()[-2:] == list(addon_module("main.memory_use").states())


@pytest.mark.parametrize("value", ("1", "yes", "0", ""))
def test_the_environment_keeps_sinew_from_it(character, tmp_path, value):
    """The console says so at the start, and `sinew info` with the reason."""
    path, script = tmp_path / "character.blend", tmp_path / "info.py"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    name = addon_module("cli.command_line").__name__
    script.write_text(
        f"import sys\nfrom {name} import run\n"
        f"code = run(['info', {str(path)!r}, '--json']) or run(['info', {str(path)!r}])\n"
        "sys.exit(code)\n"
    )
    result = subprocess.run(
        [*COMMAND, "-b", "--python-exit-code", "1", "--python", str(script)],
        env={**os.environ, "SINEW_SAFE": value},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0 and "Traceback" not in result.stderr, result.stdout + result.stderr
    found = json.loads(next(line for line in result.stdout.splitlines() if line.startswith("{")))
    said = [line for line in result.stderr.splitlines() if line.startswith("Sinew ")]
    assert len(said) == 1 and bpy.app.version_string in said[0]
    if value in ("1", "yes"):
        assert found["program"]["why"] == found["unknown"] == [SAFE] and found["program"]["on"] == []
        assert said[0].endswith(f"features on; {SAFE}") and "none of" in said[0]
        assert SAFE in result.stdout
    else:
        assert found["program"]["off"] == [] and said[0].endswith("features on") and ": all " in said[0]


@pytest.mark.says_errors
def test_a_shape_that_only_sinew_has_is_not_taken_for_it(fresh_scene, character, preferences, sinew, tmp_path, caplog):
    """Everything says so, and nothing bakes it."""
    ob, _, _ = character
    ob.sinew.method = "ROTATION_CENTERS"
    fresh_scene.frame_set(5)
    assert way(ob) != "BLENDER"
    preferences.uses_memory = False
    fresh_scene.frame_set(6)
    sentence = f"The shape of {ob.name} lacks its method or smoothing, which Blender does not have. {SWITCH}"
    assert [record.getMessage() for record in caplog.records] == [
        f"without their methods or smoothing, which Blender does not have: {ob.name}"
    ]
    assert any(sentence[1:] in advice.text for advice in addon_module("ui.advice").warnings(ob))
    path = tmp_path / "character.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    assert sentence in sinew("info", path)[1]
    code, _out, err = sinew("bake", path, "-o", tmp_path)
    assert code == 1 and sentence in err
    code, _out, err = sinew("bake-to-bones", path, "--rig-bones", "--frames", "1-3")
    assert code == 1 and sentence in err
    ob = next(each for each in bpy.data.objects if each.type == "MESH" and each.sinew.is_bound)
    ob.sinew.method = "LINEAR"
    assert addon_module("plan.survey").lacks_own_shape(ob) == ""


@pytest.mark.parametrize("keys", (False, True))
@pytest.mark.parametrize("output", ("MODIFIER", "MESH"))
def test_a_file_that_is_saved_without_plays_with_it_again(fresh_scene, preferences, tmp_path, keys, output):
    armature = make_armature()
    ob = make_mesh(armature, keys)
    ob.modifiers.new("Smooth", "CORRECTIVE_SMOOTH")
    twin = twin_of(ob)
    for frame in (1, 10):
        pose(armature, frame, keys)
    accelerate(ob, output=output)
    kinds = []
    for uses in (True, False, False, True):
        preferences.uses_memory = uses
        ob, twin = reopened(tmp_path, ob, twin)
        for frame in range(2, 9):
            bpy.context.scene.frame_set(frame)
            assert_same_shape(ob, twin)
            if output == "MESH":
                copy = ob.sinew.deformed
                wanted = evaluated(twin)
                if uses:
                    assert abs(own_positions(copy) - wanted).max() < 1e-4
        assert ob.sinew.installed_output == output
        kinds.append((way(ob), is_deforming(ob), bool(shortcut_of(ob))))
    assert kinds[0] == kinds[3] and kinds[0][1:] == (True, True)
    assert kinds[1] == kinds[2] == ("BLENDER", False, False)
