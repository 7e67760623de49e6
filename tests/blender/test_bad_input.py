"""Bad files give one sentence and leave the scene as it was."""

import struct

import bpy
import pytest

from characters import accelerate, make_armature, make_mesh, pose
from helpers import (
    addon_module,
    assert_same_shape,
    copied_rig,
    data_counts,
    import_rig,
    needs_memory,
    select,
    twin_of,
    way,
)


def write(name, text):
    return lambda folder: (folder / name).write_text(text)


def remove(name):
    return lambda folder: (folder / name).unlink()


def replace_line(name, line, text):
    def spoil(folder):
        lines = (folder / name).read_text().splitlines()
        lines[line] = text
        (folder / name).write_text("\n".join(lines) + "\n")

    return spoil


def truncated_binary(folder):
    (folder / "weights.dmat").write_bytes(b"0 0\n5 100\n" + struct.pack("<7d", *range(7)))


def huge_header(folder):
    (folder / "weights.dmat").write_bytes(b"0 0\n25000 50000\n1234")


CASES = {
    "no mesh": (remove("mesh.obj"), "there is no file .*mesh.obj"),
    "too few rows": (write("weights.dmat", "1 2\n0.5\n0.5\n"), r"weights.dmat has 2 rows, mesh.obj"),
    "cycle": (write("skeleton.bf", "0 1 0 0 0\n1 0 0 1 0\n"), "skeleton.bf.*cycle"),
    "parent out of range": (replace_line("skeleton.bf", 1, "1 77 0 1 0"), "skeleton.bf.*joint 1 has parent 77"),
    "NaN": (replace_line("weights.dmat", 3, "nan"), 'weights.dmat, row 2, column 0.*"nan"'),
    "truncated binary": (
        truncated_binary,
        "weights.dmat ends after 7 numbers; its header promises 5 columns x 100 rows",
    ),
    "empty file": (write("weights.dmat", ""), "weights.dmat is empty"),
    "empty skeleton": (write("skeleton.bf", ""), "skeleton.bf holds no joints"),
    "empty mesh": (write("mesh.obj", ""), "mesh.obj holds no vertices"),
    "letters": (replace_line("mesh.obj", 4, "v 1 two 3"), 'mesh.obj, line 5.*found "two"'),
    "weights without columns": (
        lambda folder: [
            spoil(folder)
            for spoil in (
                write("weights.dmat", "0 3986\n"),
                write("skeleton.bf", "-1 -1 0 0 0\n-1 0 0 1 0\n"),
                remove("pose.dmat"),
                write("anim.dmat", "20000000 0\n"),
            )
        ],
        "weights.dmat has no columns; expected one per bone",
    ),
    "columns without end": (
        write("weights.dmat", "9223372036854775807 0\n"),
        "weights.dmat declares 9,223,372,036,854,775,807 columns x 0 rows",
    ),
    "UTF-16": (
        lambda folder: (folder / "weights.dmat").write_text("1 1\n1\n", "utf-16"),
        "weights.dmat is UTF-16 text; save it as UTF-8",
    ),
    "an excerpt in Latin-1": (
        lambda folder: (folder / "pose.dmat").write_text("gr\xf6\xdfe", "latin-1"),
        r'found "gr\\xf6\\xdfe"',
    ),
    "weight column without a bone": (replace_line("skeleton.bf", 1, "9 0 0 1 0"), "joint 1 has weight column 9"),
    "huge header": (huge_header, "weights.dmat ends after 0 numbers; its header promises 25,000 columns x 50,000 rows"),
    "wrong pose": (write("pose.dmat", "2 3\n0 0 0 0 0 0\n"), "pose.dmat: there are 3 numbers per pose"),
    "face without vertex": (
        lambda folder: (folder / "mesh.obj").open("a").write("f 1 2 999999\n"),
        "mesh.obj: face .* names vertex 999999",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_bad_rig_folder(tmp_path, case):
    spoil, sentence = CASES[case]
    folder = copied_rig(tmp_path)
    spoil(folder)
    bpy.ops.mesh.primitive_cube_add()
    before = data_counts(), bpy.context.active_object.name, len(bpy.context.selected_objects)
    with pytest.raises(RuntimeError, match=sentence) as error:
        bpy.ops.import_scene.sinew_rig(filepath=str(folder / "skeleton.bf"))
    assert len(str(error.value).strip().splitlines()) == 1
    after = data_counts(), bpy.context.active_object.name, len(bpy.context.selected_objects)
    assert after == before


@pytest.mark.parametrize("step", ("bind.wiring.wire", "bind.mending.adapt", "bind.show", "weight_writing.replace"))
@pytest.mark.parametrize("output", ("MODIFIER", "MESH"))
@pytest.mark.parametrize("kind", (ValueError, KeyboardInterrupt))
def test_an_import_that_fails_half_way_takes_everything_back(fresh_scene, monkeypatch, tmp_path, kind, step, output):
    bpy.ops.mesh.primitive_cube_add()
    cube, before = bpy.context.active_object, data_counts()
    owner = addon_module("rig_files.rig_import")
    *names, function = step.split(".")
    for name in names:
        owner = getattr(owner, name)

    def fail(*_arguments, **_named):
        raise kind("it was told to fail")

    monkeypatch.setattr(owner, function, fail)
    with pytest.raises(RuntimeError, match="it was told to fail"):
        bpy.ops.import_scene.sinew_rig(
            filepath=str(copied_rig(tmp_path) / "skeleton.bf"), pose="walk.dmat", output=output
        )
    assert data_counts() == before and fresh_scene.frame_end == 250
    assert bpy.context.active_object == cube and bpy.context.selected_objects == [cube]
    monkeypatch.undo()
    import_rig("capsule", output=output)


@pytest.mark.parametrize("step", range(4))
def test_an_import_that_is_interrupted_between_its_steps_takes_everything_back(fresh_scene, tmp_path, step):
    bpy.ops.mesh.primitive_cube_add()
    cube, before = bpy.context.active_object, data_counts()
    rig_import = addon_module("rig_files.rig_import")

    class Interrupted:
        steps = 0

        def step(self, share, text):
            if self.steps == step:
                raise KeyboardInterrupt
            self.steps += 1

    path = copied_rig(tmp_path) / "skeleton.bf"
    with pytest.raises(KeyboardInterrupt):
        rig_import.import_rig(bpy.context, path, rig_import.ImportOptions(pose="walk.dmat"), Interrupted())
    assert data_counts() == before and fresh_scene.frame_end == 250
    assert bpy.context.active_object == cube and bpy.context.selected_objects == [cube]


def test_an_import_without_memory_takes_everything_back(monkeypatch, tmp_path):
    before = data_counts()

    def fail(*_arguments, **_named):
        raise MemoryError

    monkeypatch.setattr(addon_module("blender.weight_writing"), "replace", fail)
    with pytest.raises(RuntimeError, match="There is not enough memory"):
        bpy.ops.import_scene.sinew_rig(filepath=str(copied_rig(tmp_path) / "skeleton.bf"))
    assert data_counts() == before


def test_missing_skeleton_and_named_files(tmp_path):
    folder = copied_rig(tmp_path)
    with pytest.raises(RuntimeError, match="there is no file .*other.bf"):
        bpy.ops.import_scene.sinew_rig(filepath=str(folder / "other.bf"))
    with pytest.raises(RuntimeError, match="there is no file .*run.dmat"):
        bpy.ops.import_scene.sinew_rig(filepath=str(folder / "skeleton.bf"), pose="run.dmat")
    assert not bpy.data.objects


def test_no_file_chosen(tmp_path):
    with pytest.raises(RuntimeError, match="Choose a skeleton file"):
        bpy.ops.import_scene.sinew_rig(filepath=f"{tmp_path}/")


def test_what_cannot_be_bound_is_said():
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.active_object
    with pytest.raises(RuntimeError, match="Cube has no armature, shape keys or smoothing"):
        bpy.ops.object.sinew_bind()
    _, armature = import_rig("capsule")
    select(cube, armature)
    with pytest.raises(RuntimeError, match="No vertex group of Cube"):
        bpy.ops.object.sinew_bind()
    assert not cube.sinew.is_bound and not cube.modifiers


@pytest.mark.parametrize("kind", ("MIRROR", "ARRAY", "SUBSURF", "SOLIDIFY", "BEVEL"))
def test_modifiers_with_other_vertices_before_the_armature(fresh_scene, kind):
    """Blender's own modifier goes on deforming where Sinew cannot begin with their result, there from the start or
    coming later."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    twin = twin_of(ob)
    pose(armature, 1, False)
    for each in ob, twin:
        select(each)
        each.modifiers.new("Early", kind)
        to_front(each, "Early")
    accelerate(ob)
    fresh_scene.frame_set(1)
    assert_same_shape(ob, twin)
    can_begin = bpy.app.version >= (4, 1, 0)
    assert way(ob) == ("CANVAS" if can_begin else "BLENDER")
    assert [m.name for m in ob.modifiers] == ["Early", *(["Sinew"] if can_begin else []), "Armature"]
    for each in ob, twin:
        each.modifiers.remove(each.modifiers["Early"])
    fresh_scene.frame_set(2)
    assert_same_shape(ob, twin)
    assert way(ob) == "ATTRIBUTE"
    for each in ob, twin:
        select(each)
        each.modifiers.new("Early", kind)
        to_front(each, "Early")
    fresh_scene.frame_set(3)
    assert_same_shape(ob, twin)
    assert way(ob) == ("CANVAS" if can_begin else "BLENDER")


def to_front(ob, name):
    while ob.modifiers[0].name != name:
        bpy.ops.object.modifier_move_up(modifier=name)


@needs_memory
def test_what_cannot_be_followed_is_refused_and_left_alone():
    ob, _ = import_rig("capsule")
    select(ob)
    bpy.ops.object.sinew_unbind()
    ob.shape_key_add(name="Basis")
    twin = ob.copy()
    bpy.context.collection.objects.link(twin)
    select(ob)
    with pytest.raises(RuntimeError, match="cannot use the output Mesh.*: 2 objects share this mesh"):
        bpy.ops.object.sinew_bind(output="MESH")
    bpy.data.objects.remove(twin)
    ob.data.shape_keys.use_relative = False
    with pytest.raises(RuntimeError, match="cannot use the output Mesh.*are absolute"):
        bpy.ops.object.sinew_bind(output="MESH")
    assert not ob.sinew.is_bound and [m.name for m in ob.modifiers] == ["Armature"]
    ob.shape_key_clear()
    ob.modifiers.new("Wave", "WAVE")
    ob.modifiers.move(1, 0) if hasattr(ob.modifiers, "move") else bpy.ops.object.modifier_move_up(modifier="Wave")
    with pytest.raises(RuntimeError, match="cannot use the output Mesh.*Wave comes before Armature"):
        bpy.ops.object.sinew_bind(output="MESH")
    armature_name, other = ob.modifiers["Armature"].object.name, ob.modifiers["Armature"].object.copy()
    bpy.context.collection.objects.link(other)
    second = ob.modifiers.new("Second", "ARMATURE")
    second.object, second.use_multi_modifier = other, True
    select(other, ob)
    with pytest.raises(RuntimeError, match=f"capsule mixes Second with .*; bind the mesh to {armature_name} instead"):
        bpy.ops.object.sinew_bind()
    ob.modifiers["Armature"].object = None
    with pytest.raises(RuntimeError, match="capsule mixes Second with .*; Armature has no armature: choose one there"):
        bpy.ops.object.sinew_bind()
    assert not ob.sinew.is_bound
    assert [m.name for m in ob.modifiers] == ["Wave", "Armature", "Second"]


@pytest.mark.skipif(bpy.app.version >= (4, 2, 0), reason="rigs are programs from Blender 4.2 on")
def test_rigs_of_an_old_blender_are_refused_in_a_sentence(sinew, tmp_path):
    make_armature()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "rig.blend"))
    code, out, err = sinew("rig", tmp_path / "rig.blend", "-o", tmp_path / "rig.json")
    assert (code, out) == (1, "") and err.endswith("rigs can be programs from Blender 4.2 on\n")
    assert not (tmp_path / "rig.json").exists()
