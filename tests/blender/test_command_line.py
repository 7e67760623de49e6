"""The command line: what it says, writes and returns."""

import json
import re
import subprocess

import bpy
import numpy as np
import pytest

from characters import accelerate, animate, make_armature, make_mesh, make_tube, pose, smoothed
from helpers import RIGS, addon_module, copied_rig, evaluated, needs_memory, needs_program, own_positions

CAPSULE = str(RIGS["capsule"].parent)


@pytest.fixture
def document(sinew):
    """Runs a command that succeeds. Returns its JSON document."""

    def run(*words):
        code, out, err = sinew(*words, "--json")
        assert (code, err) == (0, "")
        return json.loads(out.splitlines()[-1])

    return run


@pytest.fixture
def capsule_blend(sinew, tmp_path):
    path = tmp_path / "capsule.blend"
    assert sinew("import", CAPSULE, "-o", path, "--pose", "walk.dmat")[0] == 0
    return path


def read_rig(folder, **names):
    return addon_module("native").sinew_native.read_rig(str(folder), **names)


def save(tmp_path):
    path = tmp_path / "saved.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


# --- info -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ("capsule", "ogre"))
def test_info_of_a_rig_folder(document, name):
    found = document("info", RIGS[name].parent)
    rig = read_rig(RIGS[name].parent)
    counts = (rig.weights > 0).sum(axis=1)
    assert found == {
        "path": str(RIGS[name]),
        "convention": {"capsule": "joint", "ogre": "bone"}[name],
        "vertices": len(rig.positions),
        "faces": len(rig.face_offsets) - 1,
        "joints": rig.skeleton.joint_count,
        "weight_columns": rig.weights.shape[1],
        "poses": rig.poses.pose_count,
        "animation_frames": 0,
        "mean_influences": pytest.approx(counts.mean()),
        "most_influences": counts.max(),
        "unweighted_vertices": 0,
        "clamped_weights": 0,
    }


def test_info_reads_the_files_that_are_named(document, tmp_path):
    folder = copied_rig(tmp_path)
    (folder / "weights.dmat").rename(folder / "other.dmat")
    (folder / "skeleton.bf").rename(folder / "other.bf")
    found = document(
        "info", folder / "other.bf", "--weights", "other.dmat", "--pose", "walk.dmat", "--convention", "bone"
    )
    assert (found["poses"], found["convention"]) == (48, "bone")


def test_info_counts_vertices_without_weights(document, tmp_path):
    (tmp_path / "mesh.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n")
    (tmp_path / "skeleton.bf").write_text("0 -1 0 0 0\n1 0 0 1 0\n")
    (tmp_path / "weights.dmat").write_text("2 3\n1\n0\n0.5\n0\n0\n0.5\n")
    found = document("info", tmp_path)
    assert (found["unweighted_vertices"], found["most_influences"]) == (1, 2)
    assert found["mean_influences"] == 1.0
    assert (found["poses"], found["animation_frames"]) == (0, 0)


def test_info_for_people(sinew, capsule_blend):
    code, out, _ = sinew("info", CAPSULE)
    assert code == 0 and "vertices             3,986\n" in out
    code, out, _ = sinew("info", capsule_blend)
    assert code == 0
    header, row = out.splitlines()[2:4]
    assert row.split() == ["capsule", "3,986", "4", "Sinew", "linear", "clip", "modifier"]
    assert header.index("vertices") + len("vertices") == row.index("3,986") + len("3,986")


@needs_memory
def test_info_says_what_deforms_a_mesh_and_what_sinew_cannot(document, tmp_path):
    armature = make_armature()
    bound, _plain = make_mesh(armature, True), make_mesh(armature, True)
    refused = make_mesh(armature, False)
    refused.vertex_groups.clear()
    accelerate(bound)
    bpy.ops.mesh.primitive_cube_add()
    smoothed(make_tube(), iterations=2).id_data.name = "Free"
    found = document("info", save(tmp_path))["meshes"]
    assert {mesh["name"]: mesh for mesh in found} == {
        "Free": {
            "name": "Free",
            "vertices": 1200,
            "armature": None,
            "bones": 0,
            "deformed_by": "Blender",
            "method": None,
            "source": None,
            "output": None,
            "problem": None,
        },
        "Tube": {
            "name": "Tube",
            "vertices": 1200,
            "armature": "Rig",
            "bones": 6,
            "deformed_by": "Sinew",
            "method": "dual-quaternion",
            "source": "armature",
            "output": "modifier",
            "problem": None,
        },
        "Tube.001": {
            "name": "Tube.001",
            "vertices": 1200,
            "armature": "Rig",
            "bones": 6,
            "deformed_by": "modifier Armature",
            "method": "dual-quaternion",
            "source": "armature",
            "output": None,
            "problem": None,
        },
        "Tube.002": {
            "name": "Tube.002",
            "vertices": 1200,
            "armature": "Rig",
            "bones": 6,
            "deformed_by": "modifier Armature",
            "method": "linear",
            "source": "armature",
            "output": None,
            "problem": "No vertex group of Tube.002 is named after a deforming bone of Rig: rename the groups, or "
            "parent the mesh with automatic weights",
        },
    }


# --- import and export ----------------------------------------------------------------------------


@needs_memory
def test_import_takes_the_importers_options(document, tmp_path):
    path = tmp_path / "a.blend"
    found = document(
        "import",
        CAPSULE,
        "-o",
        path,
        "--pose",
        "walk.dmat",
        "--up-axis",
        "z",
        "--scale",
        "2",
        "--method",
        "dual-quaternion",
        "--source",
        "armature",
        "--output-kind",
        "mesh",
        "--convention",
        "joint",
        "--quaternion-order",
        "wxyz",
        "--frame-rate",
        "12",
        "--keep-frame-range",
    )
    assert found["path"] == str(path)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    assert [ob.name for ob in bpy.data.objects if ob.type == "MESH"] == ["capsule", "capsule.deformed"]
    ob = bpy.data.objects["capsule"]
    assert (ob.sinew.method, ob.sinew.source, ob.sinew.installed_output) == ("DUAL_QUATERNION", "ARMATURE", "MESH")
    assert np.allclose(ob.matrix_world, np.diag((2, 2, 2, 1)))
    assert ob.sinew.armature.sinew_clip.speed == 0.5  # at 24 frames a second
    assert bpy.context.scene.frame_end == 250
    assert document("info", path)["meshes"] == found["meshes"]


def test_import_starts_with_an_empty_file(sinew, tmp_path):
    bpy.ops.mesh.primitive_cube_add()
    assert sinew("import", CAPSULE, "-o", tmp_path / "a.blend")[0] == 0
    assert {ob.name for ob in bpy.data.objects} == {"capsule", "capsule_armature"}
    assert bpy.data.objects["capsule"].sinew.is_bound


def test_import_says_which_weights_it_has_changed(sinew, document, tmp_path):
    folder, native = copied_rig(tmp_path), addon_module("native").sinew_native
    weights = native.read_dmat(folder / "weights.dmat")
    weights[7, :2] = 1.25, -0.25
    native.write_dmat(folder / "weights.dmat", weights)
    assert document("info", folder)["clamped_weights"] == 2
    code, _out, said = sinew("import", folder, "-o", tmp_path / "a.blend")
    assert code == 0
    assert said.startswith("sinew: weights.dmat has 2 weights below 0 or above 1, ") and said.count("\n") == 1


def test_export_gives_the_folder_back(document, capsule_blend, tmp_path):
    folder = tmp_path / "new" / "rig"
    found = document("export", capsule_blend, folder)
    before, after = read_rig(CAPSULE, pose="walk.dmat"), read_rig(folder)
    assert found == {**document("info", CAPSULE, "--pose", "walk.dmat"), "path": str(folder / "skeleton.bf")}
    assert np.array_equal(after.positions, before.positions)
    assert np.array_equal(after.face_vertices, before.face_vertices)
    assert np.allclose(after.weights, before.weights, atol=1e-7)
    assert np.allclose(after.poses.rotations, before.poses.rotations)


@pytest.mark.parametrize("animation, frames", (("none", 0), ("frames", 3)))
def test_export_of_a_chosen_mesh(document, tmp_path, animation, frames):
    armature = make_armature()
    make_mesh(armature, False)
    second = make_mesh(armature, False)
    name = second.name
    second.data.vertices[0].co = (9, 8, 7)
    pose(armature, 1, False)
    bpy.context.scene.frame_end = 3
    found = document("export", save(tmp_path), tmp_path / "rig", "--object", name, "--animation", animation)
    assert (found["animation_frames"], found["poses"]) == (frames, 0)
    assert read_rig(tmp_path / "rig").positions[0].tolist() == [9, 7, -8]
    document(
        "export",
        tmp_path / "saved.blend",
        tmp_path / "rig",
        "--object",
        name,
        "--animation",
        animation,
        "--up-axis",
        "Z",
    )
    assert read_rig(tmp_path / "rig").positions[0].tolist() == [9, 8, 7]


# --- bench ----------------------------------------------------------------------------------------


def assert_times(found, methods):
    assert [result["method"] for result in found["results"]] == methods
    for result in found["results"]:
        for stage in ("sinew", "modifier", "pose", "skin"):
            assert result[f"{stage}_ms"] > 0
        assert result["sinew_ms"] > result["pose_ms"] + result["skin_ms"]
        assert 0.05 < result["largest_motion"]
        assert result["largest_distance"] < 1e-5


@needs_memory
@pytest.mark.parametrize("output", ("modifier", "mesh"))
def test_bench_of_a_rig_folder(document, output):
    found = document("bench", CAPSULE, "--frames", 4, "--output-kind", output)
    assert_times(found, ["linear", "dual-quaternion"])
    assert found["meshes"] == [{"name": "capsule", "vertices": 3986, "bones": 4}]
    assert (found["frames"], found["output"], found["skipped"]) == (4, output, {})


@needs_memory
def test_bench_of_a_blend_leaves_it_alone(document, capsule_blend):
    before = capsule_blend.read_bytes()
    found = document("bench", capsule_blend, "--frames", 12, "--method", "dual-quaternion")
    assert_times(found, ["dual-quaternion"])
    assert capsule_blend.read_bytes() == before


@needs_memory
def test_bench_of_a_scene_of_several_meshes(document, tmp_path):
    """Bound or not; masked and mixed as it was set since it was bound; hung by its parent alone; one
    that Sinew cannot deform, and one that is hidden."""
    armature = make_armature()
    masked, _, child, refused, hidden = (make_mesh(armature, False) for _ in range(5))
    second = masked.modifiers.new("Second", "ARMATURE")
    second.object, second.use_multi_modifier = armature, True
    second.use_deform_preserve_volume = True
    second.vertex_group = "bone2"
    accelerate(masked)
    second.vertex_group, second.invert_vertex_group = "bone1", True
    child.modifiers.clear()
    child.parent = armature
    accelerate(child)
    refused.vertex_groups.clear()
    hidden.hide_viewport = True
    for frame in (1, 4):
        pose(armature, frame, False)
    found = document("bench", save(tmp_path), "--frames", 4)
    assert_times(found, ["linear", "dual-quaternion"])
    assert {mesh["name"] for mesh in found["meshes"]} == {"Tube", "Tube.001", "Tube.002"}
    assert list(found["skipped"]) == ["Tube.003"]
    assert "No vertex group of Tube.003" in found["skipped"]["Tube.003"]


@needs_memory
def test_bench_of_a_mesh_without_an_armature(document, tmp_path):
    animate(smoothed(make_tube(), "Smooth", "SMOOTH", iterations=30), factor=(0, 9))
    found = document("bench", save(tmp_path), "--frames", 4, "--method", "linear")
    assert_times(found, ["linear"])
    assert found["meshes"] == [{"name": "Tube", "vertices": 1200, "bones": 0}]


@needs_memory
def test_bench_does_not_depend_on_the_preferences_of_duplication(document, capsule_blend):
    edit = bpy.context.preferences.edit
    edit.use_duplicate_mesh = edit.use_duplicate_armature = edit.use_duplicate_action = False
    try:
        found = document("bench", capsule_blend, "--frames", 3, "--output-kind", "mesh")
    finally:
        edit.use_duplicate_mesh = edit.use_duplicate_armature = edit.use_duplicate_action = True
    assert_times(found, ["linear", "dual-quaternion"])


def test_bench_for_people(sinew):
    code, out, _ = sinew("bench", CAPSULE, "--frames", 2)
    assert code == 0
    for words in (
        "capsule: 3,986 vertices, 4 bones",
        "milliseconds per frame",
        "whole frame, Sinew",
        "whole frame, Armature modifier",
        "largest distance",
    ):
        assert words in out


# --- what goes wrong ------------------------------------------------------------------------------


def one_sentence(result):
    """Of a command that could not be done: the sentence."""
    code, out, err = result
    assert code == 1
    assert all(line.startswith(("Error: ", "Info: ")) for line in out.splitlines())  # Blender's own noise
    assert err.startswith("sinew: ") and err.count("\n") == 1
    return err[len("sinew: ") :].strip()


def test_files_that_are_not_there(sinew, tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "a.txt").write_text("")
    for path, words in (
        ("nowhere", "no file or folder"),
        ("empty", "neither skeleton.bf nor"),
        ("a.txt", "neither a rig folder, a skeleton"),
    ):
        for words_before, words_after in (
            (["info"], []),
            (["bench"], []),
            (["import"], ["-o", tmp_path / "out.blend"]),
        ):
            assert words in one_sentence(sinew(*words_before, tmp_path / path, *words_after))
    for command in (["info"], ["bench"]):
        assert "there is no file" in one_sentence(sinew(*command, tmp_path / "no.blend"))
    assert "there is no file" in one_sentence(sinew("export", tmp_path / "no.blend", tmp_path / "rig"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.txt", "empty"]


def test_bad_files(sinew, tmp_path):
    (tmp_path / "bad.blend").write_text("this is no file of Blender's")
    assert "not supported" in one_sentence(sinew("info", tmp_path / "bad.blend"))
    folder = copied_rig(tmp_path)
    (folder / "weights.dmat").write_text("1 2\n0.5\n0.5\n")
    for words in (["info", folder], ["bench", folder], ["import", folder, "-o", tmp_path / "a.blend"]):
        assert "weights.dmat has 2 rows, mesh.obj has" in one_sentence(sinew(*words))
    assert not (tmp_path / "a.blend").exists()


def test_places_that_cannot_be_written_to(sinew, capsule_blend, tmp_path):
    assert "there is no folder" in one_sentence(sinew("import", CAPSULE, "-o", tmp_path / "nowhere" / "a.blend"))
    (tmp_path / "folder.blend").mkdir()
    assert "folder.blend is a folder" in one_sentence(sinew("import", CAPSULE, "-o", tmp_path / "folder.blend"))
    assert "Cannot open file" in one_sentence(
        sinew("import", CAPSULE, "-o", tmp_path / f"{300 * 'a'}.blend")
    )  # too long a name
    (tmp_path / "file").write_text("")
    said = one_sentence(sinew("export", capsule_blend, tmp_path / "file"))
    assert re.search(r"\bfile: .*\bexists$", said)  # the system's own words


def test_an_import_that_fails_leaves_the_old_file(sinew, capsule_blend):
    before = capsule_blend.read_bytes()
    one_sentence(sinew("import", CAPSULE, "-o", capsule_blend, "--pose", "run.dmat"))
    assert capsule_blend.read_bytes() == before
    assert [path.name for path in capsule_blend.parent.iterdir()] == [capsule_blend.name]


def test_export_wants_one_mesh(sinew, tmp_path):
    armature = make_armature()
    make_mesh(armature, False), make_mesh(armature, False)
    bpy.ops.mesh.primitive_cube_add()
    path = save(tmp_path)
    assert "--object NAME; those that an armature deforms: Tube, Tube.001" in one_sentence(
        sinew("export", path, tmp_path / "rig")
    )
    assert "no mesh Rig; those" in one_sentence(sinew("export", path, tmp_path / "rig", "--object", "Rig"))
    assert one_sentence(sinew("export", path, tmp_path / "rig", "--object", "Cube")) == (
        "Cube has no armature: give it one, or choose another mesh"
    )
    assert not (tmp_path / "rig").exists()


def test_bench_of_what_does_not_move(sinew, tmp_path):
    assert "no visible mesh is one that Sinew deforms or could deform: show one" in one_sentence(
        sinew("bench", save(tmp_path))
    )
    folder = copied_rig(tmp_path)
    (folder / "pose.dmat").unlink()
    assert "nothing moves on these 3 frames" in one_sentence(sinew("bench", folder, "--frames", 3))


@pytest.mark.parametrize(
    "words, said",
    (
        ([], "required: COMMAND"),
        (["dance"], "invalid choice: 'dance'"),
        (["info"], "required: PATH"),
        (["info", CAPSULE, "--colour"], "unrecognized arguments: --colour"),
        (["import", CAPSULE], "required: -o"),
        (["import", CAPSULE, "-o", "a.txt"], "a.txt does not end in .blend"),
        (["import", CAPSULE, "-o", "a.blend", "--scale", "-1"], "-1 is not a number above 0"),
        (["import", CAPSULE, "-o", "a.blend", "--scale", "big"], "big is not a number above 0"),
        (["bench", CAPSULE, "--frames", "0"], "0 is not a whole number above 0"),
        (["bench", CAPSULE, "--method", "magic"], "invalid choice: 'magic'"),
        (["export", "a.blend"], "required: FOLDER"),
    ),
)
def test_wrong_usage(sinew, words, said):
    code, out, err = sinew(*words)
    assert (code, out) == (2, "")
    assert "usage: sinew" in err and said in err


@pytest.mark.parametrize("words", ([], ["info"], ["import"], ["export"], ["bench"]))
def test_help(sinew, words):
    code, out, err = sinew(*words, "--help")
    assert (code, err) == (0, "")
    assert out.startswith(" ".join(["usage: sinew", *words]))


# --- the real thing -------------------------------------------------------------------------------


def blender(*words):
    """A Blender of its own with these words after `sinew`."""
    if bpy.app.version >= (4, 2, 0):
        before = ["--command", "sinew"]
    else:
        before = ["--addons", "sinew", "--python-expr", "from sinew.cli import command_line; command_line.main()", "--"]
    return subprocess.run(
        [bpy.app.binary_path, "-b", *before, *map(str, words)], capture_output=True, text=True, timeout=120
    )


@needs_program
def test_in_a_blender_of_its_own(tmp_path):
    path = tmp_path / "a.blend"
    done = blender("import", CAPSULE, "-o", path, "--json")
    assert done.returncode == 0, done.stderr
    meshes = json.loads(done.stdout.splitlines()[-1])["meshes"]
    assert [mesh["deformed_by"] for mesh in meshes] == ["Sinew"]
    bpy.ops.wm.open_mainfile(filepath=str(path))
    ob = bpy.data.objects["capsule"]
    bpy.context.scene.frame_set(20)
    assert np.abs(evaluated(ob) - own_positions(ob)).max() > 0.05

    failed = blender("info", tmp_path / "nowhere")
    assert failed.returncode == 1
    assert f"sinew: there is no file or folder {tmp_path / 'nowhere'}\n" in failed.stderr
    assert "command_line.py" not in failed.stderr  # no traceback of ours; Debian's 5.2 prints its own
    assert blender("info").returncode == 2
    helped = blender("--help")
    assert helped.returncode == 0 and "usage: sinew" in helped.stdout
