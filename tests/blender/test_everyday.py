"""What people do to a bound character without thinking of Sinew: copy its modifiers, apply them, convert it,
parent it anew, delete its armature."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys
from helpers import (
    RIGS,
    addon_module,
    assert_same_on_all_frames,
    assert_same_shape,
    evaluated,
    is_deforming,
    needs_memory,
    own_positions,
    select,
    traces,
    twin_of,
    way,
)


def errors(ob):
    return [warning for warning in addon_module("ui.advice").warnings(ob) if warning.is_error]


def test_modifiers_copied_to_another_mesh(character):
    ob, _, armature = character
    other = twin_of(ob)
    addon_module("install.bind").unbind(other)
    other.modifiers.clear()
    before = own_positions(other)
    select(ob, other)
    bpy.ops.object.make_links_data(type="MODIFIERS")
    bpy.context.view_layer.update()
    assert not np.array_equal(evaluated(other), before)
    assert_same_shape(other, ob)  # by Blender's own modifier, which came along
    assert not any("Sinew" in modifier.name for modifier in other.modifiers)
    select(other, armature)
    bpy.context.view_layer.objects.active = other
    assert bpy.ops.object.sinew_bind() == {"FINISHED"}
    assert_same_shape(other, ob)


def assert_released(scene, ob, shape, rounding=0.0):
    """It keeps that shape for good."""
    for frame in (2, 5):
        scene.frame_set(frame)
        assert np.allclose(evaluated(ob), shape, rtol=0, atol=rounding)
    assert not ob.sinew.is_bound and not traces()


@needs_memory
def test_the_modifier_is_applied(fresh_scene, character):
    ob, _, _ = character
    shape = evaluated(ob)
    select(ob)
    bpy.ops.object.modifier_apply(modifier="Sinew")
    assert_released(fresh_scene, ob, shape)
    assert ob.modifiers["Armature"].object and not ob.modifiers["Armature"].show_viewport


def test_converted_to_a_mesh(fresh_scene, character):
    ob, _, _ = character
    ob.modifiers.new("Finer", "SUBSURF")
    bpy.context.view_layer.update()
    shape = evaluated(ob)
    select(ob)
    bpy.ops.object.convert(target="MESH")
    # Blender 3.4 converts what its own modifiers have deformed.
    assert_released(fresh_scene, ob, shape, 1e-5 if bpy.app.version < (4, 0, 0) else 0.0)
    assert not ob.modifiers


def test_parented_anew(fresh_scene, character):
    """Blender sees that it has an Armature modifier already."""
    ob, twin, armature = character
    select(ob, armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.parent_set(type="ARMATURE")
    assert [modifier.type for modifier in ob.modifiers].count("ARMATURE") == 1
    assert errors(ob) == []
    fresh_scene.frame_set(5)
    assert_same_shape(ob, twin)


def test_a_second_deformation(fresh_scene, character):
    ob, twin, armature = character
    ob.modifiers.new("Again", "ARMATURE").object = armature
    select(ob)
    (warning,) = errors(ob)
    assert "a second time" in warning.text
    assert bpy.ops.object.sinew_remove_doubles() == {"FINISHED"}
    assert errors(ob) == []
    fresh_scene.frame_set(5)
    assert_same_shape(ob, twin)


def test_the_armature_is_deleted(fresh_scene, character):
    ob, twin, armature = character
    name = armature.name
    select(armature)
    bpy.ops.object.delete()
    fresh_scene.frame_set(5)
    select(ob)
    (warning,) = errors(ob)
    assert warning.text.startswith(f"{name} was deleted")
    twin.modifiers["Armature"].object = None
    bpy.ops.object.sinew_unbind()
    assert armature.users == 0  # so it will not be saved


def test_the_armature_is_brought_back(fresh_scene, character):
    ob, twin, armature = character
    select(armature)
    bpy.ops.object.delete()
    select(ob)
    assert bpy.ops.object.sinew_show_skeleton() == {"FINISHED"}
    assert errors(ob) == [] and armature.visible_get()
    fresh_scene.frame_set(7)
    twin.modifiers["Armature"].object = armature
    assert_same_shape(ob, twin)


@pytest.mark.parametrize("means", ("driver", "keyframe"))
@pytest.mark.parametrize("output", ("MODIFIER", "MESH"))
def test_switches_that_are_animated_later_are_followed(fresh_scene, character, means, output):
    ob, twin, _ = character
    ob.sinew.output = output
    fresh_scene.frame_set(2)
    for each in (ob, twin):
        modifier = each.modifiers["Armature"]
        if means == "driver":
            modifier.driver_add("show_viewport").driver.expression = "frame < 6"
        else:
            for frame, is_on in ((1, True), (6, False)):
                modifier.show_viewport = is_on
                modifier.keyframe_insert("show_viewport", frame=frame)
    shapes = []
    for frame in (3, 8, 1, 12, 5):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)
        shapes.append(evaluated(ob))
    assert way(ob) == "ATTRIBUTE" and not np.allclose(shapes[0], shapes[1]) and np.array_equal(shapes[1], shapes[3])


@pytest.mark.parametrize("first", ((False, False), (True, False), (False, True)))
def test_a_mix_that_is_not_shown_alike(fresh_scene, character, first):
    ob, twin, armature = character
    for each in (ob, twin):
        second = each.modifiers.new("Second", "ARMATURE")
        second.object, second.use_multi_modifier = armature, True
        each.modifiers["Armature"].show_viewport, each.modifiers["Armature"].show_render = first
    assert_same_on_all_frames(fresh_scene, ob, twin, (3, 8))
    assert not np.allclose(evaluated(ob), own_positions(ob))
    # The data-block of an evaluated object leads to its graph since Blender 4.0.
    assert way(ob) == ("ATTRIBUTE" if bpy.app.version >= (4, 0, 0) else "BLENDER")
    for each in (ob, twin):
        each.modifiers["Armature"].show_viewport = each.modifiers["Armature"].show_render = True
    assert_same_on_all_frames(fresh_scene, ob, twin, (5, 6))
    assert way(ob) == "ATTRIBUTE"


@pytest.mark.parametrize("means", ("driver", "keyframe"))
def test_settings_that_are_animated_are_followed(fresh_scene, character, means):
    ob, twin, _ = character
    for each in ob, twin:
        modifier = each.modifiers["Armature"]
        if means == "driver":
            modifier.driver_add("use_deform_preserve_volume").driver.expression = "frame < 5"
        else:
            for frame, value in ((1, True), (5, False)):
                modifier.use_deform_preserve_volume = value
                modifier.keyframe_insert("use_deform_preserve_volume", frame=frame)
    for frame in (3, 7, 4, 8):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)
    assert way(ob) == ("BLENDER" if means == "driver" else "ATTRIBUTE")


@needs_memory
@pytest.mark.parametrize("mode", ("EDIT", "SCULPT"))
def test_where_people_edit_what_they_see_blender_deforms(fresh_scene, character, mode):
    """Its tools look for its own modifier there, and its switches for Edit Mode count."""
    ob, twin, _ = character

    def who():
        bpy.context.view_layer.update()
        modifiers = ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).modifiers
        assert modifiers["Armature"].show_viewport and not modifiers["Sinew"].show_viewport
        return ["Sinew" if is_deforming(ob) else "Armature"]

    assert who() == ["Sinew"]
    select(ob)
    bpy.ops.object.mode_set(mode=mode)
    assert who() == ["Armature"]
    fresh_scene.frame_set(5)
    assert who() == ["Armature"]
    bpy.ops.object.mode_set(mode="OBJECT")
    fresh_scene.frame_set(6)
    assert who() == ["Sinew"]
    assert_same_shape(ob, twin)


@pytest.mark.parametrize("keys", (False, True), ids=("plain", "shape keys"))
def test_the_eye_of_the_modifier(fresh_scene, character, keys):
    """It can be clicked, and counts."""
    ob, twin, _ = character
    for each in ob, twin:
        if keys:
            add_shape_keys(each)
    for shown in (False, True):
        for each in ob, twin:
            each.modifiers["Armature"].show_viewport = shown
        for frame in (4, 5):
            fresh_scene.frame_set(frame)
            assert_same_shape(ob, twin)
    assert way(ob) == ("KEYS" if keys else "ATTRIBUTE")


@needs_memory
def test_the_modifiers_are_removed(fresh_scene, character):
    """Sinew's: Blender's own takes over. The Armature modifier: nothing deforms the mesh any more."""
    ob, twin, _ = character
    ob.modifiers.remove(ob.modifiers["Sinew"])
    fresh_scene.frame_set(5)
    bpy.context.view_layer.update()
    assert not ob.sinew.is_bound and not traces()
    assert_same_shape(ob, twin)
    accelerate(ob)
    for each in ob, twin:
        each.modifiers.remove(each.modifiers["Armature"])
    bpy.context.view_layer.update()
    assert not ob.sinew.is_bound and not traces()
    assert_same_shape(ob, twin)


def test_locked_groups_are_not_normalized(character):
    ob, _, _ = character
    group = ob.vertex_groups["bone2"]
    group.lock_weight = True

    def weights():
        return {
            vertex.index: entry.weight
            for vertex in ob.data.vertices
            for entry in vertex.groups
            if entry.group == group.index
        }

    before = weights()
    select(ob)
    bpy.ops.object.sinew_normalize_weights()
    assert weights() == before
    sums = [sum(entry.weight for entry in vertex.groups) for vertex in ob.data.vertices]
    free = [vertex for vertex, total in enumerate(sums) if before.get(vertex, 0) < 0.5]
    assert len(free) > 100 and np.allclose(np.array(sums)[free], 1, atol=1e-5)


def test_files_of_the_importer_can_be_chosen_from_a_list():
    """Not those that are something else."""
    rig_files = addon_module("ui.rig_files")
    of_weights = rig_files.files_beside(".dmat", "pose.dmat", "anim.dmat")
    of_poses = rig_files.files_beside(".dmat", "weights.dmat", "anim.dmat")
    chosen = SimpleNamespace(directory="", filepath=str(RIGS["ogre"]), mesh="", weights="", pose="")
    nobody = SimpleNamespace(space_data=None)
    assert of_poses(chosen, nobody, "") == ["pose.dmat", "walk.dmat"]
    assert of_weights(chosen, nobody, "") == ["walk.dmat", "weights.dmat"]
    chosen.weights = "walk.dmat"
    assert of_poses(chosen, nobody, "") == ["pose.dmat"]
    assert of_weights(chosen, nobody, "walk.dmat") == ["walk.dmat"]
    chosen.weights = ""
    browser = SimpleNamespace(params=SimpleNamespace(directory=str(RIGS["capsule"].parent).encode()))
    assert of_poses(chosen, SimpleNamespace(space_data=browser), "WA") == ["walk.dmat"]
    chosen.directory, chosen.filepath = "/nowhere/", ""
    assert of_poses(chosen, nobody, "") == []


@needs_memory
@pytest.mark.says_errors
def test_what_cannot_be_mended_is_asked_for_once(fresh_scene, character, monkeypatch):
    """Else the main thread would tag the object, and be asked again by the evaluation that follows, for ever."""
    ob, twin, _ = character
    nodes, bind, mending = addon_module("blender.nodes"), addon_module("install.bind"), addon_module("install.mending")
    adapt, asked = mending.adapt, []

    def refuse(*_):
        raise ValueError("Blender does not let it be put there")

    monkeypatch.setattr(nodes, "add_modifier", refuse)
    monkeypatch.setattr(mending, "adapt", lambda ob: asked.append(ob) or adapt(ob))
    monkeypatch.setattr(bind, "release_if_undone", lambda ob: False)
    ob.modifiers.remove(ob.modifiers["Sinew"])
    for _ in range(6):
        bpy.context.view_layer.update()
        addon_module("run.mail").deliver()
        ob.update_tag()
    assert 1 <= len(asked) <= 3
    assert_same_shape(ob, twin)
