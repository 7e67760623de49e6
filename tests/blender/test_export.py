"""What is exported imports to the same thing."""

import signal

import bpy
import numpy as np
import pytest

from characters import accelerate, make_armature, make_mesh
from helpers import RIGS, addon_module, evaluated, import_rig, needs_memory, own_positions, select


def read(folder, skeleton):
    return addon_module("native").sinew_native.read_rig(str(folder), skeleton=skeleton)


@pytest.mark.parametrize("name", RIGS)
def test_round_trip(fresh_scene, tmp_path, name):
    ob, armature = import_rig(name)
    skeleton = RIGS[name].name
    frames = (1, 8, 20)
    shapes = []
    for frame in frames:
        fresh_scene.frame_set(frame)
        shapes.append(evaluated(ob))
    result = bpy.ops.export_scene.sinew_rig(filepath=str(tmp_path / skeleton))
    assert result == {"FINISHED"}
    pose = {"pose": "walk.dmat"} if name in ("capsule", "ogre") else {}
    before = addon_module("native").sinew_native.read_rig(str(RIGS[name].parent), skeleton=skeleton, **pose)
    after = read(tmp_path, skeleton)
    assert np.array_equal(after.positions, before.positions)
    assert np.array_equal(after.face_offsets, before.face_offsets)
    assert np.array_equal(after.face_vertices, before.face_vertices)
    assert after.material_names == before.material_names
    assert np.array_equal(after.skeleton.parents, before.skeleton.parents)
    assert np.allclose(after.skeleton.heads, before.skeleton.heads, atol=1e-12)
    assert np.allclose(after.weights, np.maximum(before.weights, 0), atol=1e-7)
    assert after.skeleton.convention == before.skeleton.convention

    bpy.ops.import_scene.sinew_rig(filepath=str(tmp_path / skeleton))
    again = bpy.context.active_object
    again.sinew.armature.sinew_clip.mode = armature.sinew_clip.mode
    for frame, shape in zip(frames, shapes):
        fresh_scene.frame_set(frame)
        assert np.allclose(evaluated(again), shape, atol=1e-6 * np.abs(shape).max())


@needs_memory
def test_mesh_output_exports_the_rest(fresh_scene, tmp_path):
    ob, _ = import_rig("capsule", output="MESH")
    fresh_scene.frame_set(9)
    bpy.ops.export_scene.sinew_rig(filepath=str(tmp_path / "skeleton.bf"))
    rest = addon_module("native").sinew_native.read_rig(str(RIGS["capsule"].parent)).positions
    assert np.array_equal(read(tmp_path, "skeleton.bf").positions, rest)


def test_edited_keyframes_are_exported_not_the_poses_of_old(fresh_scene, tmp_path):
    ob, armature = import_rig("capsule")
    bpy.ops.object.sinew_clip_to_keyframes()
    fresh_scene.frame_start, fresh_scene.frame_end = 4, 6
    assert bpy.ops.export_scene.sinew_rig(filepath=str(tmp_path / "skeleton.bf")) == {"FINISHED"}
    rig = read(tmp_path, "skeleton.bf")
    assert rig.poses is None and rig.animation.shape[:2] == (3, len(armature.data.bones))


def blender_rig():
    """A bent tube with an armature made in Blender, moved and keyed, never seen by the importer."""
    bpy.ops.mesh.primitive_cylinder_add(vertices=16, depth=4, location=(0, 0, 2))
    tube = bpy.context.active_object
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide(number_cuts=5)
    bpy.ops.object.mode_set(mode="OBJECT")
    armature = bpy.data.objects.new("bones", bpy.data.armatures.new("bones"))
    bpy.context.collection.objects.link(armature)
    armature.location = (0.5, 0, 0)
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    lower = armature.data.edit_bones.new("lower")
    lower.head, lower.tail = (-0.5, 0, 0), (-0.5, 0, 2)
    upper = armature.data.edit_bones.new("upper")
    upper.head, upper.tail, upper.parent = (-0.5, 0, 2), (-0.3, 0, 4), lower
    bpy.ops.object.mode_set(mode="OBJECT")
    height = own_positions(tube)[:, 2] + 2
    for name, weights in (("lower", np.clip(3 - height, 0, 1)), ("upper", np.clip(height - 2, 0, 1))):
        group = tube.vertex_groups.new(name=name)
        for vertex, weight in enumerate(weights):
            group.add([vertex], float(weight), "REPLACE")
    modifier = tube.modifiers.new("Armature", "ARMATURE")
    modifier.object = armature
    bone = armature.pose.bones["upper"]
    for frame, quaternion in ((1, (1, 0, 0, 0)), (5, (0.8, 0.6, 0, 0))):
        bone.rotation_quaternion = quaternion
        bone.keyframe_insert("rotation_quaternion", frame=frame)
    return tube, armature


@pytest.mark.parametrize("up_axis", ("Y", "Z"))
def test_a_character_made_in_blender(fresh_scene, tmp_path, up_axis):
    tube, armature = blender_rig()
    fresh_scene.frame_end = 5
    select(tube)
    assert bpy.ops.object.sinew_bind() == {"FINISHED"}
    shapes = []
    for frame in range(1, 6):
        fresh_scene.frame_set(frame)
        shapes.append(evaluated(tube))
    assert np.abs(shapes[4] - shapes[0]).max() > 0.5
    bpy.ops.export_scene.sinew_rig(filepath=str(tmp_path / "skeleton.bf"), up_axis=up_axis)
    bpy.ops.import_scene.sinew_rig(filepath=str(tmp_path / "skeleton.bf"), up_axis=up_axis)
    again = bpy.context.active_object
    upright = np.array(again.matrix_world)[:3, :3]  # the same in the world, whatever the files' axes
    rest = own_positions(tube)
    assert np.allclose(own_positions(again) @ upright.T, rest, atol=1e-6)
    assert [b.name.split(".")[0] for b in again.sinew.armature.data.bones] == ["lower", "upper"]
    for frame, shape in enumerate(shapes, 1):
        fresh_scene.frame_set(frame)
        assert np.allclose(evaluated(again) @ upright.T, shape, atol=1e-5)


@pytest.mark.parametrize("left", ("pose.dmat", "anim.dmat"))
def test_poses_of_another_rig_in_the_folder(fresh_scene, tmp_path, left):
    import_rig("capsule")
    (tmp_path / left).write_text("0 0")
    with pytest.raises(
        RuntimeError, match=f"has {left} from another rig, which the next import would read with this one"
    ):
        bpy.ops.export_scene.sinew_rig(filepath=str(tmp_path / "skeleton.bf"), animation="NONE")
    assert [path.name for path in tmp_path.iterdir()] == [left]
    (tmp_path / left).unlink()
    assert bpy.ops.export_scene.sinew_rig(filepath=str(tmp_path / "skeleton.bf"), animation="NONE") == {"FINISHED"}


def test_errors_are_sentences(tmp_path):
    bpy.ops.mesh.primitive_cube_add()
    with pytest.raises(RuntimeError, match="Cube has no armature: give it one, or choose another mesh"):
        bpy.ops.export_scene.sinew_rig(filepath=str(tmp_path / "skeleton.bf"))
    import_rig("capsule")
    with pytest.raises(RuntimeError, match="There is no folder"):
        bpy.ops.export_scene.sinew_rig(filepath=str(tmp_path / "nowhere" / "skeleton.bf"))
    with pytest.raises(RuntimeError, match="ends in .bf or .tgf"):
        bpy.ops.export_scene.sinew_rig(filepath=str(tmp_path / "skeleton.xyz"))
    with pytest.raises(RuntimeError, match="joint convention"):
        bpy.ops.export_scene.sinew_rig(filepath=str(tmp_path / "skeleton.tgf"))


def test_a_mesh_without_size_along_an_axis(fresh_scene, tmp_path):
    ob = make_mesh(make_armature(), False)
    accelerate(ob)
    ob.scale.x = 0
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match="Tube has a scale of 0 along an axis; set another scale"):
        bpy.ops.export_scene.sinew_rig(filepath=str(tmp_path / "skeleton.bf"))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("most_bytes", (0, 200, 10_000, 200_000))
def test_a_full_disk_leaves_the_rig_that_was_there(fresh_scene, tmp_path, most_bytes):
    resource = pytest.importorskip("resource")
    ob, _ = import_rig("ogre")
    bpy.ops.export_scene.sinew_rig(filepath=str(tmp_path / "skeleton.bf"))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert "mesh.mtl" in before and len(before["mesh.obj"]) > 200_000
    ob.data.vertices[0].co.x += 1
    ob.data.materials[0].diffuse_color[0] /= 2
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, limits[1]))
    try:
        with pytest.raises(RuntimeError, match="File too large"):
            bpy.ops.export_scene.sinew_rig(filepath=str(tmp_path / "skeleton.bf"))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    bpy.ops.export_scene.sinew_rig(filepath=str(tmp_path / "skeleton.bf"))
    assert (tmp_path / "mesh.obj").read_bytes() != before["mesh.obj"]
    assert (tmp_path / "mesh.mtl").read_bytes() != before["mesh.mtl"]
    assert {path.name for path in tmp_path.iterdir()} == set(before)
