"""While somebody paints on a mesh, each dab changes it, and Blender deforms it where that is faster than to read all
weights again. From the next frame on it is Sinew again."""

import bpy
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, pose, smoothed
from helpers import assert_same_shape, is_deforming, select, twin_of, way


def linear(ob):
    pass


def volume(ob):
    ob.modifiers["Armature"].use_deform_preserve_volume = True


def two(ob):
    ob.modifiers.new("Second", "ARMATURE").object = ob.modifiers["Armature"].object


def smooth(ob):
    smoothed(ob, iterations=3)


def corrected(ob):
    smoothed(ob, "Smooth", "SMOOTH", iterations=2)


@pytest.fixture
def painted(request, fresh_scene):
    """scene, bound mesh in Weight Paint Mode, its twin."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    request.param(ob)
    for frame in (1, 4, 7, 10):
        pose(armature, frame, False)
    twin = twin_of(ob)
    accelerate(ob)
    fresh_scene.frame_set(2)
    select(ob)
    bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
    fresh_scene.frame_set(3)
    assert is_deforming(ob)
    return fresh_scene, ob, twin


def dab(ob, weight):
    ob.vertex_groups["bone3"].add(range(0, 1200, 3), weight, "REPLACE")
    bpy.context.view_layer.update()


@pytest.mark.parametrize("painted", (linear, volume, two, add_shape_keys), indirect=True)
def test_blender_deforms_in_the_evaluation_of_a_dab(painted):
    scene, ob, twin = painted
    for weight in (0.2, 0.9, 0.5):
        for each in (ob, twin):
            dab(each, weight)
        assert not is_deforming(ob)
        assert_same_shape(ob, twin)
    assert way(ob) in {"ATTRIBUTE", "KEYS"}
    for frame in (4, 5, 6, 7):
        scene.frame_set(frame)
        assert is_deforming(ob)
        assert_same_shape(ob, twin)
    bpy.context.view_layer.update()
    assert is_deforming(ob)


@pytest.mark.parametrize("painted", (smooth, corrected), indirect=True)
def test_sinew_deforms_what_is_smoothed(painted):
    _scene, ob, twin = painted
    for weight in (0.2, 0.9):
        for each in (ob, twin):
            dab(each, weight)
        assert is_deforming(ob)
        assert_same_shape(ob, twin)


@pytest.mark.parametrize("painted", (linear, add_shape_keys), indirect=True)
@pytest.mark.parametrize("mode", ("OBJECT", "POSE"))
def test_weights_are_read_when_the_mode_is_left(painted, mode):
    scene, ob, twin = painted
    for each in (ob, twin):
        dab(each, 0.8)
    bpy.ops.object.mode_set(mode="OBJECT")
    if mode == "POSE":
        select(ob.modifiers["Armature"].object)
        bpy.ops.object.mode_set(mode="POSE")
    assert not is_deforming(ob)
    assert_same_shape(ob, twin)
    scene.frame_set(5)
    assert is_deforming(ob)
    assert_same_shape(ob, twin)
    bpy.ops.object.mode_set(mode="OBJECT")
    for each in (ob, twin):
        dab(each, 0.1)
    assert is_deforming(ob)
    assert_same_shape(ob, twin)


@pytest.mark.parametrize("painted", (linear, add_shape_keys, smooth), indirect=True)
def test_the_evaluation_in_which_a_mode_is_left_is_blenders(painted):
    """What was edited is read in the next one, or at once where Blender's modifiers take longer."""
    scene, ob, twin = painted
    for mode in ("OBJECT", "EDIT", "OBJECT", "VERTEX_PAINT", "EDIT", "WEIGHT_PAINT", "OBJECT"):
        before = ob.mode
        bpy.ops.object.mode_set(mode=mode)
        if mode == "EDIT":
            continue
        assert is_deforming(ob) == ("Corrective" in ob.modifiers), (before, mode)
        for each in (ob, twin):
            each.data.vertices[7].co[2] += 0.1
            each.data.update_tag()
        for frame in (4, 5):
            scene.frame_set(frame)
            assert_same_shape(ob, twin)
        assert is_deforming(ob)


@pytest.mark.parametrize("painted", (linear, add_shape_keys), indirect=True)
def test_a_modifier_edited_while_painting(painted):
    """A dab and another edit in one evaluation."""
    scene, ob, twin = painted
    for edit in (
        lambda each: setattr(each.modifiers["Armature"], "use_deform_preserve_volume", True),
        lambda each: setattr(each.modifiers["Armature"], "vertex_group", "bone2"),
        lambda each: setattr(each.modifiers["Armature"], "name", "Renamed"),
        lambda each: setattr(each.modifiers["Renamed"], "show_viewport", False),
        lambda each: setattr(each.modifiers["Renamed"], "show_viewport", True),
        lambda each: each.modifiers.remove(each.modifiers["Renamed"]),
    ):
        for each in (ob, twin):
            edit(each)
            dab(each, 0.4)
        assert_same_shape(ob, twin)
        scene.frame_set(scene.frame_current + 1)
        assert_same_shape(ob, twin)


@pytest.mark.parametrize("painted", (linear, add_shape_keys), indirect=True)
def test_modifiers_added_between_dabs(painted):
    scene, ob, twin = painted
    for add in (two, smooth, two):
        for each in (ob, twin):
            add(each)
        bpy.context.view_layer.update()
        for weight in (0.3, 0.6):
            for each in (ob, twin):
                dab(each, weight)
            assert_same_shape(ob, twin)
        scene.frame_set(scene.frame_current + 1)
        assert_same_shape(ob, twin)


@pytest.mark.parametrize("painted", (linear,), indirect=True)
def test_a_method_that_blender_lacks_is_shown_while_its_weights_are_painted(painted):
    _scene, ob, twin = painted
    ob.sinew.method = "BLENDED"
    twin.modifiers["Armature"].use_deform_preserve_volume = True
    ob.sinew.skinning.share = 1
    bpy.context.view_layer.update()
    for each in (ob, twin):
        dab(each, 0.7)
    assert is_deforming(ob)
    assert_same_shape(ob, twin)
