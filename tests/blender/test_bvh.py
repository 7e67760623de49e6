"""read_bvh and write_bvh: Blender's own importer reads what is written as the same poses, and its exporter is read."""

import bpy
import numpy as np
import pytest

from characters import make_armature, pose
from exporting import enable_exporters, skip_without
from helpers import addon_module, select

FRAMES, PARENTS = range(1, 9), np.array([-1, 0, 1, 0, -1])
AXES = {"axis_forward": "Y", "axis_up": "Z"}  # Blender's own


@pytest.fixture(scope="module", autouse=True)
def addons():
    enable_exporters()


def native():
    return addon_module("native").sinew_native


def poses(armature, names):
    """(F, J, 4, 4): what moves these bones from rest, in world space, and (F, J, 3): their heads."""
    moved, heads = [], []
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        posed = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        own = [(posed.pose.bones[name], posed.data.bones[name].matrix_local) for name in names]
        moved.append([posed.matrix_world @ bone.matrix @ rest.inverted() for bone, rest in own])
        heads.append([(posed.matrix_world @ bone.matrix).to_translation() for bone, _ in own])
    return np.array(moved), np.array(heads)


def check(clip, armature, names):
    world = native().forward_kinematics(clip.skeleton, clip.local)
    moved, heads = poses(armature, names)
    assert np.abs(world[..., :3, 3] - heads).max() < 1e-5
    assert np.abs((world @ clip.skeleton.inverse_rest)[..., :3, :3] - moved[..., :3, :3]).max() < 1e-5
    assert np.ptp(heads, axis=0).max() > 0.1, "it moves"


def test_blender_imports_what_is_written(fresh_scene, tmp_path):
    skip_without("import_anim.bvh")
    random = np.random.default_rng(3)
    locations = random.uniform(-1, 1, (len(FRAMES), 5, 3))
    locations[:, [1, 3]] = 0
    rotations = random.normal(size=(len(FRAMES), 5, 4))
    names = ["hips", "chest", "head", "leg", "prop"]
    offsets, ends = random.uniform(-1, 1, (2, 5, 3))
    clip = native().BvhClip(names, PARENTS, offsets, 1 / fresh_scene.render.fps, locations, rotations, ends)
    native().write_bvh(tmp_path / "walk.bvh", clip)
    assert bpy.ops.import_anim.bvh(filepath=str(tmp_path / "walk.bvh"), rotate_mode="QUATERNION", **AXES) == {
        "FINISHED"
    }
    check(clip, bpy.context.active_object, names)


def test_what_blender_exports_is_read(fresh_scene, tmp_path):
    skip_without("export_anim.bvh")
    armature = make_armature()
    for frame in FRAMES:
        pose(armature, frame, False)
    select(armature)
    path = tmp_path / "walk.bvh"
    assert bpy.ops.export_anim.bvh(filepath=str(path), frame_start=FRAMES[0], frame_end=FRAMES[-1]) == {"FINISHED"}
    clip = native().read_bvh(path)
    assert clip.frame_count == len(FRAMES) and clip.frame_time == pytest.approx(1 / fresh_scene.render.fps, rel=1e-4)
    assert sorted(clip.names) == sorted(armature.data.bones.keys())
    check(clip, armature, clip.names)
