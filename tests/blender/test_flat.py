"""Bones and objects that have no size along some axis, or are mirrored: as Blender's own modifier has them."""

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, make_tube, pose, with_bendy_bones
from helpers import addon_module, diagonal, evaluated, is_deforming, own_positions, twin_of, way

SCALES = (
    (0, 0, 0),
    (0, 1, 1),
    (1, 0, 1),
    (1, 1, 0),
    (0, 0, 1),
    (0, 1, 0),
    (1, 0, 0),
    (-1, 1, 1),
    (1, -1, 1),
    (1, 1, -1),
    (-1, -1, -1),
    (1e-20, 1e-20, 1e-20),
    (1e-20, 1, 1),
    (1, 1e-20, 1),
    (1, 1, 1e-20),
)
KEYS = pytest.mark.parametrize("keys", (False, True), ids=("attribute", "shape keys"))


def make_pair(preserve_volume, keys):
    """(bound mesh, twin, armature), posed and not yet flattened."""
    armature = make_armature()
    ob = make_mesh(armature, preserve_volume)
    if keys:
        add_shape_keys(ob)
    twin = twin_of(ob)
    pose(armature, 1, False)
    armature.animation_data_clear()
    accelerate(ob)
    return ob, twin, armature


def assert_followed(ob, twin, keys, tolerance=1e-5):
    bpy.context.view_layer.update()
    ours, theirs = evaluated(ob), evaluated(twin)
    assert np.isfinite(theirs).all()
    size = np.maximum(np.ptp(theirs, axis=0), diagonal(own_positions(ob)))  # Blender's may be no more than a point
    assert (np.abs(ours - theirs) < tolerance * size).all()
    assert way(ob) == ("KEYS" if keys else "ATTRIBUTE")
    assert addon_module("run.characters").character(ob).status.error == ""


@KEYS
@pytest.mark.parametrize("preserve_volume", (False, True), ids=("linear", "dual quaternion"))
@pytest.mark.parametrize("turned", (False, True), ids=("at rest", "posed"))
@pytest.mark.parametrize("scale", SCALES, ids=str)
def test_scaled_bones(preserve_volume, keys, turned, scale):
    ob, twin, armature = make_pair(preserve_volume, keys)
    for bone in armature.pose.bones:
        if not turned:
            bone.matrix_basis.identity()
    for name in "bone1", "side":
        armature.pose.bones[name].scale = scale
    # Where one axis alone is left rounding decides how the others turn, and versions differ in their last steps.
    assert_followed(ob, twin, keys, 1e-3 if scale.count(0) == 2 else 1e-5)


@KEYS
@pytest.mark.parametrize("preserve_volume", (False, True), ids=("linear", "dual quaternion"))
@pytest.mark.parametrize("scale", SCALES[:7], ids=str)
def test_flattened_b_bones(fresh_scene, preserve_volume, keys, scale):
    """How Preserve Volume turns what follows them depends on rounding, so Blender does it."""
    armature = make_armature()
    ob = make_mesh(armature, preserve_volume)
    with_bendy_bones(ob)
    if keys:
        add_shape_keys(ob)
    twin = twin_of(ob)
    for frame in (1, 9):
        pose(armature, frame, False)
    for name in "bone1", "bone3":
        for frame, size in ((1, (1, 1, 1)), (5, scale), (9, scale), (13, (1, 1, 1))):
            armature.pose.bones[name].scale = size
            armature.pose.bones[name].keyframe_insert("scale", frame=frame)
    if keys:
        twin.data.shape_keys.animation_data.action = ob.data.shape_keys.animation_data.action
    accelerate(ob)
    for frame in range(1, 17):  # the fast path is used before
        fresh_scene.frame_set(frame)
        ours, theirs = evaluated(ob), evaluated(twin)
        finite = np.isfinite(theirs).all(axis=1)  # Blender's own segments may be nowhere
        assert np.abs(ours - theirs)[finite].max(initial=0) < 1e-5 * diagonal(own_positions(ob))
        is_flat = 5 <= frame <= 9
        assert is_deforming(ob) != (is_flat and preserve_volume)


@KEYS
@pytest.mark.parametrize("preserve_volume", (False, True), ids=("linear", "dual quaternion"))
@pytest.mark.parametrize("who", ("mesh", "armature", "both", "parent"))
@pytest.mark.parametrize("scale", SCALES[:7] + ((1e-20, 1e-20, 1e-20),), ids=str)
def test_flattened_objects(preserve_volume, keys, who, scale):
    ob, twin, armature = make_pair(preserve_volume, keys)
    if who == "parent":
        ob.parent = twin.parent = armature
    for each in {"mesh": (ob, twin), "armature": (armature,), "both": (ob, twin, armature), "parent": (armature,)}[who]:
        each.scale = scale
        each.rotation_euler = (0.3, 0.2, 0.5)
    assert_followed(ob, twin, keys)
    for each in ob, twin, armature:
        each.scale = (1, 2, 1)
    assert_followed(ob, twin, keys)


SMOOTHING = {
    "no smoothing": None,
    "corrective": ("CORRECTIVE_SMOOTH", {}),
    "corrective by length": ("CORRECTIVE_SMOOTH", {"smooth_type": "LENGTH_WEIGHTED", "iterations": 2}),
    "only smooth": ("CORRECTIVE_SMOOTH", {"use_only_smooth": True}),
    "smooth": ("SMOOTH", {"iterations": 3}),
}


@KEYS
@pytest.mark.parametrize("preserve_volume", (False, True), ids=("linear", "dual quaternion"))
@pytest.mark.parametrize("smoothing", SMOOTHING.values(), ids=SMOOTHING)
def test_a_bone_that_is_nowhere(preserve_volume, keys, smoothing):
    """What it does not move stays where it was."""
    ob, twin, armature = make_pair(preserve_volume, keys)
    for each in (ob, twin) if smoothing else ():
        modifier = each.modifiers.new("Smoothing", smoothing[0])
        for name, value in smoothing[1].items():
            setattr(modifier, name, value)
    armature.pose.bones["side"].location.x = np.nan
    bpy.context.view_layer.update()
    ours, theirs = evaluated(ob), evaluated(twin)
    finite = np.isfinite(theirs).all(axis=1)
    assert finite.any() and not finite.all()
    assert np.array_equal(np.isfinite(ours).all(axis=1), finite)
    assert np.abs(ours - theirs)[finite].max() < 1e-5 * diagonal(own_positions(ob))


@pytest.mark.parametrize("axis", range(3))
def test_a_flat_mesh_with_a_hook_alone(axis):
    ob = make_tube()
    ob.modifiers.new("Hook", "HOOK").object = target = bpy.data.objects.new("Target", None)
    bpy.context.collection.objects.link(target)
    target.location = 1, 2, 3
    twin = twin_of(ob)
    accelerate(ob)
    for each in (ob, twin):
        each.scale[axis] = 0
    bpy.context.view_layer.update()
    assert np.abs(evaluated(ob) - evaluated(twin)).max() < 1e-5 * diagonal(own_positions(ob))
    assert addon_module("run.characters").character(ob).status.error == ""


def test_a_mesh_with_a_hook_that_is_nowhere():
    """As one that hangs on a bone that is."""
    ob = make_tube()
    ob.modifiers.new("Hook", "HOOK").object = target = bpy.data.objects.new("Target", None)
    bpy.context.collection.objects.link(target)
    twin = twin_of(ob)
    accelerate(ob)
    for place in (np.nan, 1, np.nan):
        for each in (ob, twin):
            each.location.x = place
        bpy.context.view_layer.update()
        assert np.allclose(evaluated(ob), evaluated(twin), atol=1e-5, equal_nan=True)
        assert addon_module("run.characters").character(ob).status.error == ""


def test_a_hook_that_follows_a_bone_that_is_nowhere():
    """Blender's own modifiers deform, and nothing is reported."""
    ob, twin, armature = make_pair(False, False)
    for each in (ob, twin):
        hook = each.modifiers.new("Hook", "HOOK")
        hook.object, hook.subtarget = armature, "side"
        hook.vertex_indices_set(range(0, 600, 3))
    bpy.context.view_layer.update()
    addon_module("main.handlers").look_into_the_mail()
    bpy.context.view_layer.update()
    armature.pose.bones["side"].location.x = np.nan
    bpy.context.view_layer.update()
    ours, theirs = evaluated(ob), evaluated(twin)
    finite = np.isfinite(theirs).all(axis=1)
    assert np.array_equal(np.isfinite(ours).all(axis=1), finite) and np.array_equal(ours[finite], theirs[finite])
    assert addon_module("run.characters").character(ob).status.error == ""
