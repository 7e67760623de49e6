"""The judge: Blender's own Armature modifier on a copy of the same mesh."""

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

from helpers import RIGS, assert_same_shape, builtin_copy, diagonal, evaluated, import_rig, needs_memory, own_positions

FRAMES = range(1, 41, 2)
METHODS = ("LINEAR", "DUAL_QUATERNION")


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", RIGS)
def test_clip_on_twenty_frames(fresh_scene, name, method):
    ob, _ = import_rig(name, method=method)
    reference = builtin_copy(ob)
    shapes = []
    for frame in FRAMES:
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, reference)
        shapes.append(evaluated(ob))
    moved = max(np.abs(shape - shapes[0]).max() for shape in shapes)
    assert moved > 1e-2 * diagonal(shapes[0])


@needs_memory
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", RIGS)
def test_mesh_output_on_twenty_frames(fresh_scene, name, method):
    ob, _ = import_rig(name, method=method, output="MESH")
    reference = builtin_copy(ob)
    for frame in FRAMES:
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, reference)
        assert np.array_equal(own_positions(ob.sinew.deformed), evaluated(ob))


def pose_randomly(armature, random):
    for bone in armature.pose.bones:
        bone.rotation_quaternion = Euler(random.uniform(-0.9, 0.9, 3)).to_quaternion()
        if not bone.bone.use_connect:
            bone.location = random.uniform(-0.1, 0.1, 3)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", RIGS)
def test_posed_by_hand(name, method):
    """Live posing: no frame changes, the shape follows each update."""
    ob, armature = import_rig(name, method=method, source="ARMATURE")
    reference = builtin_copy(ob)
    random = np.random.default_rng(7)
    for _ in range(5):
        pose_randomly(armature, random)
        bpy.context.view_layer.update()
        assert_same_shape(ob, reference)


@pytest.mark.parametrize("method", METHODS)
def test_keyframed_armature(fresh_scene, method):
    ob, armature = import_rig("ogre", method=method, source="ARMATURE")
    reference = builtin_copy(ob)
    random = np.random.default_rng(11)
    for frame in (1, 10, 20):
        pose_randomly(armature, random)
        for bone in armature.pose.bones:
            bone.keyframe_insert("rotation_quaternion", frame=frame)
    for frame in range(1, 21):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, reference)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "matrix",
    (
        Matrix.Translation((1, 2, 3)) @ Euler((0.3, 0.8, -1)).to_matrix().to_4x4(),
        Matrix.Diagonal((2, 2, 2, 1)),
        Matrix.Diagonal((1, 2, 0.5, 1)),
    ),
    ids=("rigid", "uniform scale", "non-uniform scale"),
)
def test_mesh_and_armature_in_different_places(fresh_scene, method, matrix):
    ob, armature = import_rig("capsule", method=method)
    ob.matrix_world = armature.matrix_world @ matrix
    reference = builtin_copy(ob)
    for frame in (3, 9, 15):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, reference)


@pytest.mark.parametrize("method", METHODS)
def test_weights_that_are_not_normalised(fresh_scene, method):
    """Also a group without a bone, a bone that does not deform, and vertices of no weight."""
    ob, armature = import_rig("capsule", method=method)
    group = ob.vertex_groups.new(name="no bone")
    group.add(range(500), 0.7, "REPLACE")
    ob.vertex_groups[0].add(range(300, 900), 0.3, "ADD")
    ob.vertex_groups[1].add(range(700, 1200), 0.25, "REPLACE")
    for g in ob.vertex_groups:
        g.remove(range(1500, 1600))
        g.add(range(1600, 1650), 2e-5, "REPLACE")  # sums to less than Blender's threshold
    armature.data.bones[ob.vertex_groups[2].name].use_deform = False
    reference = builtin_copy(ob)
    for frame in (3, 9, 15):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, reference)
    assert ob.sinew.is_bound


def test_modes_of_the_clip(fresh_scene):
    """Swing is |sin(seconds)|; factor, rest and posed are what they say."""
    ob, armature = import_rig("capsule", pose="pose.dmat")
    clip = armature.sinew_clip
    assert clip.mode == "SWING"
    rest = own_positions(ob)

    def shape(mode, factor=0.0):
        clip.mode, clip.factor = mode, factor
        return evaluated(ob)

    posed = shape("POSED")
    assert np.allclose(shape("REST"), rest, atol=1e-6)
    assert np.allclose(shape("FACTOR", 0.0), rest, atol=1e-6)
    assert np.allclose(shape("FACTOR", 1.0), posed, atol=1e-6)
    clip.mode = "SWING"
    for frame in (1, 12, 37, 60):
        clip.mode = "SWING"
        fresh_scene.frame_set(frame)
        swung = evaluated(ob)
        seconds = (frame - 1) / fresh_scene.render.fps
        assert np.allclose(swung, shape("FACTOR", abs(np.sin(seconds))), atol=1e-5)


def test_animated_factor(fresh_scene):
    ob, armature = import_rig("capsule", pose="pose.dmat")
    clip = armature.sinew_clip
    clip.mode = "FACTOR"
    for frame, factor in ((1, 0.0), (11, 1.0)):
        clip.factor = factor
        armature.keyframe_insert("sinew_clip.factor", frame=frame)
    fresh_scene.frame_set(1)
    start = evaluated(ob)
    fresh_scene.frame_set(11)
    end = evaluated(ob)
    assert np.allclose(start, own_positions(ob), atol=1e-6)
    clip.mode = "POSED"
    assert np.allclose(end, evaluated(ob), atol=1e-6)


def test_playback_between_frames_and_around_the_end(fresh_scene):
    ob, armature = import_rig("capsule")
    count = fresh_scene.frame_end
    fresh_scene.frame_set(1)
    first = evaluated(ob)
    fresh_scene.frame_set(1 + count)
    assert np.allclose(evaluated(ob), first, atol=1e-6)
    fresh_scene.frame_set(1, subframe=0.5)
    between = evaluated(ob)
    fresh_scene.frame_set(2)
    assert 0 < np.abs(between - first).max() < np.abs(evaluated(ob) - first).max()
    armature.sinew_clip.loop = False
    fresh_scene.frame_set(count)
    last = evaluated(ob)
    fresh_scene.frame_set(count + 20)
    assert np.array_equal(evaluated(ob), last)


def test_the_twisted_capsule_collapses_only_linearly():
    """What the capsule is for: a twist of 170 degrees about its own axis."""
    ob, armature = import_rig("capsule", pose="pose.dmat")
    armature.sinew_clip.mode = "POSED"
    rest = own_positions(ob)
    middle = (rest[:, 1] > 0.6) & (rest[:, 1] < 1.9)

    def thinnest():
        return np.linalg.norm(evaluated(ob)[middle][:, [0, 2]], axis=1).min()

    assert thinnest() < 0.1 * 0.25
    ob.sinew.method = "DUAL_QUATERNION"
    assert thinnest() > 0.99 * 0.25
