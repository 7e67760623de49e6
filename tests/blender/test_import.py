"""What the importer makes of a rig folder."""

import bpy
import numpy as np
import pytest

import helpers
from helpers import RIGS, SHARED, addon_module, evaluated, import_rig, needs_memory, own_positions


@pytest.mark.parametrize("name", RIGS)
def test_objects_of_a_rig(name):
    ob, armature = import_rig(name)
    rig = addon_module("native").sinew_native.read_rig(str(RIGS[name].parent), skeleton=RIGS[name].name)
    assert np.array_equal(own_positions(ob), rig.positions)
    assert ob.parent == armature and ob.sinew.is_bound
    assert len(armature.data.bones) == rig.skeleton.joint_count
    assert len(ob.vertex_groups) == rig.weights.shape[1]
    assert len(ob.data.polygons) == len(rig.face_offsets) - 1
    assert {group.name for group in ob.vertex_groups} == {bone.name for bone in armature.data.bones if bone.use_deform}
    for bone, joint in ((b, b["sinew_joint"]) for b in armature.data.bones):
        assert np.allclose(bone.head_local, rig.skeleton.heads[joint], atol=1e-5)
        parent = rig.skeleton.parents[joint]
        assert (bone.parent["sinew_joint"] if bone.parent else -1) == parent


def test_weights_arrive():
    ob, _ = import_rig("capsule")
    weights = addon_module("native").sinew_native.read_dmat(str(RIGS["capsule"].parent / "weights.dmat"))
    for vertex in list(ob.data.vertices)[::97]:
        found = {ob.vertex_groups[entry.group].name: entry.weight for entry in vertex.groups}
        names = [group.name for group in ob.vertex_groups]
        expected = {names[j]: w for j, w in enumerate(weights[vertex.index]) if w > 0}
        assert found == pytest.approx(expected, abs=1e-7)


def test_pose_1_of_the_shared_ogre():
    ob, armature = import_rig("shared ogre")
    armature.sinew_clip.mode = "POSED"
    expected = np.fromfile(SHARED / "ogre/expected-pose1.f32", "<f4").reshape(-1, 3)
    distance = np.linalg.norm(evaluated(ob) - expected, axis=1)
    assert np.median(distance) < 0.0005
    assert distance.mean() < 0.004


def test_the_wrong_convention_is_far_off():
    ob, armature = import_rig("shared ogre", convention="JOINT")
    armature.sinew_clip.mode = "POSED"
    expected = np.fromfile(SHARED / "ogre/expected-pose1.f32", "<f4").reshape(-1, 3)
    assert np.linalg.norm(evaluated(ob) - expected, axis=1).mean() > 0.19


@pytest.mark.parametrize("frame", (0, 100, 228, 456))
@pytest.mark.parametrize("method, name", (("LINEAR", "lbs"), ("DUAL_QUATERNION", "dqs")))
def test_shared_elephant_plays(fresh_scene, frame, method, name):
    ob, _ = import_rig("shared elephant", method=method)
    fresh_scene.frame_set(1 + frame)
    expected = np.fromfile(SHARED / f"elephant/expected-{name}-{frame:03}.f32", "<f4")
    expected = expected.reshape(-1, 3)
    assert np.abs(evaluated(ob) - expected).max() < 1e-6 * helpers.diagonal(expected)


@needs_memory
def test_options(fresh_scene):
    ob, armature = import_rig(
        "capsule",
        up_axis="Z",
        scale=2.0,
        method="DUAL_QUATERNION",
        source="ARMATURE",
        output="MESH",
        set_frame_range=False,
    )
    assert ob.sinew.method == "DUAL_QUATERNION"
    assert ob.sinew.source == "ARMATURE"
    assert ob.sinew.output == ob.sinew.installed_output == "MESH"
    assert fresh_scene.frame_end == 250
    assert np.allclose(ob.matrix_world, np.diag((2, 2, 2, 1)))


def test_y_up_stands_upright():
    ob, _ = import_rig("capsule")
    world = np.array(ob.matrix_world)[:3, :3]
    assert np.allclose(world @ (0, 1, 0), (0, 0, 1), atol=1e-6)


def test_frame_range_ends_with_the_clip(fresh_scene):
    _, armature = import_rig("ogre")
    count = addon_module("clips.clip_store").pose_count(armature.data)
    assert (fresh_scene.frame_start, fresh_scene.frame_end) == (1, count)
    assert armature.sinew_clip.mode == "PLAYBACK"


def test_materials_have_their_colours():
    ob, _ = import_rig("ogre")
    names = [material.name for material in ob.data.materials]
    assert "skin" in names and len(names) >= 3
    used = np.empty(len(ob.data.polygons), np.int32)
    ob.data.polygons.foreach_get("material_index", used)
    assert set(used) == set(range(len(names)))
    assert ob.data.materials[0].diffuse_color[:3] != (0.8, 0.8, 0.8)


def test_unreferenced_vertices_and_polygons_survive(tmp_path):
    (tmp_path / "mesh.obj").write_text("v 9 9 9\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 5 5 5\nf 2 3 4 5\n")
    (tmp_path / "skeleton.bf").write_text("0 -1 0 0 0\n")
    (tmp_path / "weights.dmat").write_text("1 6\n" + "1\n" * 6)
    bpy.ops.import_scene.sinew_rig(filepath=str(tmp_path / "skeleton.bf"))
    ob = bpy.context.active_object
    assert helpers.own_positions(ob)[[0, 5]].tolist() == [[9, 9, 9], [5, 5, 5]]
    assert [tuple(polygon.vertices) for polygon in ob.data.polygons] == [(1, 2, 3, 4)]
    assert ob.sinew.source == "ARMATURE"  # there are no poses


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def write_rig(folder, weights, mesh="", skeleton="0 -1 0 0 0\n1 0 1 0 0\n", encoding="utf-8"):
    """A triangle on two bones; weights: a row a bone."""
    for name, text in (
        ("mesh.obj", f"{mesh}{TRIANGLE}{'usemtl grün' if mesh else ''}\nf 1 2 3\n"),
        ("skeleton.bf", skeleton),
        ("weights.dmat", "2 3\n" + " ".join(map(str, np.ravel(weights)))),
        ("größe.mtl", "newmtl grün\nKd 0 1 0\n"),
        ("pose.dmat", "2 6\n0 0 0 0 0 0\n0 0 0 0 0 90\n"),
    ):
        (folder / name).write_text(text, encoding)
    return str(folder / "skeleton.bf")


def test_weights_out_of_range_are_counted_and_the_shape_is_that_of_python(fresh_scene, tmp_path):
    path = write_rig(tmp_path, [[1.5, -0.25, 3], [-0.5, 0.75, 0.25]])
    sinew = addon_module("native").sinew_native
    rig_import = addon_module("rig_files.rig_import")
    ob, armature, remark = rig_import.import_rig(bpy.context, path, rig_import.ImportOptions())
    assert remark.startswith("weights.dmat has 4 weights below 0 or above 1, which vertex groups cannot hold")
    armature.sinew_clip.mode = "POSED"
    rig = sinew.read_rig(str(tmp_path))
    assert rig.clamped_weights == 4
    local = sinew.rotation_transforms(rig.poses.sample(1.0))
    world = sinew.forward_kinematics(rig.skeleton, local)
    skin = sinew.Skin.from_dense(rig.positions, rig.weights)
    expected = sinew.skin_linear(skin, sinew.skinning_matrices(rig.skeleton, world))
    assert np.abs(evaluated(ob) - expected).max() < 1e-6
    assert np.abs(expected - rig.positions).max() > 0.1


def test_weights_in_range_need_no_words(tmp_path):
    path = write_rig(tmp_path, [[1, 0.5, -1e-9], [0, 0.5, 1]])
    rig_import = addon_module("rig_files.rig_import")
    assert rig_import.import_rig(bpy.context, path, rig_import.ImportOptions())[2] == ""


@pytest.mark.parametrize("encoding", ("utf-8", "latin-1"))
def test_names_of_any_encoding(tmp_path, encoding):
    path = write_rig(
        tmp_path, [[1, 0.5, 0], [0, 0.5, 1]], "mtllib größe.mtl\n", "0 -1 0 0 0 Hüfte\n1 0 1 0 0 Knöchel\n", encoding
    )
    bpy.ops.import_scene.sinew_rig(filepath=path)
    ob = bpy.context.active_object
    assert [group.name for group in ob.vertex_groups] == ["Hüfte", "Knöchel"]
    assert [material.name for material in ob.data.materials] == ["grün"]
    assert tuple(ob.data.materials[0].diffuse_color) == (0, 1, 0, 1)


def test_import_from_edit_mode():
    import_rig("capsule")
    bpy.ops.object.mode_set(mode="EDIT")
    ob, _ = import_rig("capsule")
    assert bpy.context.mode == "OBJECT" and ob.sinew.is_bound


def test_the_same_rig_twice(fresh_scene):
    first, _ = import_rig("capsule")
    second, armature = import_rig("capsule")
    fresh_scene.frame_set(7)
    assert first.name != second.name and second.sinew.armature == armature
    assert np.array_equal(evaluated(first), evaluated(second))
