"""What game engines get: glTF and FBX by Blender's own exporters, read back by assimp and skinned by the file's joints,
weights and clip, have the shape that Blender shows."""

import bpy
import numpy as np
import pytest
from mathutils import Vector
from mathutils.kdtree import KDTree

from characters import accelerate, make_armature, make_mesh, pose, smoothed
from exporting import enable_exporters, operator, skip_without
from helpers import addon_module, diagonal, evaluated, select, way
from skinned_files import Y_UP_TO_Z_UP, SkinnedFile

FRAMES = range(1, 11)
MOST = 4  # influences of a vertex
# Of the diagonal. Blender's glTF exporter leaves out weights below 1e-4, FBX keeps angles in degrees, and assimp writes
# six digits.
TOLERANCE = 3e-4
EXPORTERS = {
    "glTF": ("export_scene.gltf", "glb", {"use_selection": True, "export_anim_single_armature": False}, 1.0),
    "FBX": (
        "export_scene.fbx",
        "fbx",
        {
            "use_selection": True,
            "add_leaf_bones": False,
            "bake_anim_use_all_actions": False,
            "bake_anim_use_nla_strips": False,
            "bake_anim_simplify_factor": 0.0,
        },
        0.01,  # it counts in centimetres
    ),
}


@pytest.fixture(scope="module", autouse=True)
def addons():
    enable_exporters()


@pytest.fixture
def figure(fresh_scene):
    """(mesh, armature): a tube with at most four influences, animated on the scene's ten frames."""
    fresh_scene.frame_start, fresh_scene.frame_end = FRAMES[0], FRAMES[-1]
    armature = make_armature()
    ob = make_mesh(armature, False)
    ob.parent = armature
    for frame in FRAMES:
        pose(armature, frame, False)
    return ob, armature


def reduced(ob):
    """Leaves each vertex its best influences in the ten poses, by reduce_weights."""
    meshes, native = addon_module("blender.meshes"), addon_module("native").sinew_native
    armatures, writing = addon_module("blender.armatures"), addon_module("blender.weight_writing")
    offsets, groups, weights = meshes.read_object_weights(ob)
    dense = np.zeros((len(ob.data.vertices), len(ob.vertex_groups)))
    dense[np.repeat(np.arange(len(dense)), np.diff(offsets)), groups] = weights
    dense /= dense.sum(axis=1, keepdims=True)
    motions = []
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        motions.append(armatures.read_channels(ob.parent))
    assert [group.name for group in ob.vertex_groups] == [bone.name for bone in ob.parent.pose.bones]
    found, largest, _mean = native.reduce_weights(
        dense, meshes.read_positions(ob.data), np.array(motions), max_influences=2
    )
    assert largest.max() > 0, "there was something to reduce"
    own = native.WeightTable.from_dense(found)
    writing.replace(ob, own.offsets, own.bones, own.weights)


def exported(name, tmp_path, *objects):
    write, ending, options, _ = EXPORTERS[name]
    skip_without(write, options=options)
    select(*objects)
    path = tmp_path / f"character.{ending}"
    assert operator(write)(filepath=str(path), **options) == {"FINISHED"}
    return SkinnedFile(path)


def check(name, file, ob, most):
    """The file's shape is the object's in ten poses."""
    scale, scene = EXPORTERS[name][3], bpy.context.scene
    assert file.counts.min() >= 1 and file.counts.max() <= most
    own = addon_module("blender.meshes").read_positions(ob.data)
    vertex, off = nearest(own, file.rest if name == "FBX" else file.rest @ Y_UP_TO_Z_UP.T)
    assert off.max() < 1e-5 * diagonal(own) and set(vertex) == set(range(len(own)))
    rate = scene.render.fps / scene.render.fps_base
    assert file.seconds[1] - file.seconds[0] == pytest.approx((len(FRAMES) - 1) / rate, rel=1e-3)
    moved = []
    for number, frame in enumerate(FRAMES):
        scene.frame_set(frame)
        matrix = np.array(ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world)
        shown = evaluated(ob) @ matrix[:3, :3].T + matrix[:3, 3]
        ours = scale * file.posed(file.seconds[0] + number / rate)
        assert np.abs(ours - shown[vertex]).max() < TOLERANCE * diagonal(shown), frame
        moved.append(shown)
    assert np.ptp(moved, axis=0).max() > 1


def nearest(points, others):
    """For each of the others: which of the points is nearest, and how far it is."""
    tree = KDTree(len(points))
    for i, place in enumerate(points):
        tree.insert(place, i)
    tree.balance()
    found = [tree.find(Vector(place)) for place in others]
    return np.array([each[1] for each in found]), np.array([each[2] for each in found])


@pytest.mark.parametrize("is_bound", (False, True))
@pytest.mark.parametrize("name", EXPORTERS)
def test_a_bound_and_reduced_character(figure, tmp_path, name, is_bound):
    ob, armature = figure
    reduced(ob)
    if is_bound:
        accelerate(ob)
        assert way(ob) == "ATTRIBUTE"
    check(name, exported(name, tmp_path, armature, ob), ob, most=2)


@pytest.mark.parametrize("source", ("NEW", "RIG"))
@pytest.mark.parametrize("name", EXPORTERS)
def test_what_was_baked_to_bones(figure, tmp_path, name, source):
    """A shape that no file's skeleton could say, smoothed and deformed by Sinew: the bake's shape arrives."""
    ob, _ = figure
    smoothed(ob, iterations=5)
    accelerate(ob)
    select(ob)
    assert bpy.ops.object.sinew_bake_to_bones(source=source, bones=8, max_influences=MOST) == {"FINISHED"}
    armature, made = bpy.data.objects["Tube_bones"], bpy.data.objects["Tube_baked"]
    file = exported(name, tmp_path, armature, made)
    assert set(file.joints) <= {bone.name for bone in armature.data.bones}
    check(name, file, made, MOST)
