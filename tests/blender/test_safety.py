"""What people do to a file while a mesh is bound: the shape stays right, nothing is left behind."""

import bpy
import numpy as np
import pytest

from characters import accelerate, make_armature, make_mesh, pose
from helpers import (
    addon_module, assert_same_shape, builtin_copy, evaluated, import_rig, own_positions, select,
    twin_of)

OUTPUTS = ("MODIFIER", "MESH")


@pytest.fixture
def character(fresh_scene):
    """(bound mesh, a twin that the modifier deforms, armature), animated over frames 1 to 10."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    twin = twin_of(ob)
    for frame in (1, 4, 7, 10):
        pose(armature, frame, False)
    accelerate(ob)
    fresh_scene.frame_set(3)
    assert_same_shape(ob, twin)
    return ob, twin, armature


def traces():
    """What Sinew has left in the file."""
    names = [group.name for group in bpy.data.node_groups if "Sinew" in group.name]
    for ob in bpy.data.objects:
        names += [modifier.name for modifier in ob.modifiers if "Sinew" in modifier.name]
        if ob.type == "MESH":
            names += [name for name in ob.data.attributes.keys()
                      if "sinew" in name or name == "rest_position"]
    return names


def reload(path):
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True)


# --- undo -----------------------------------------------------------------------------------------

@pytest.mark.parametrize("output", OUTPUTS)
def test_undo_and_redo_of_bind_and_unbind(fresh_scene, output):
    armature = make_armature()
    name = make_mesh(armature, False).name
    twin_name = twin_of(bpy.data.objects[name]).name
    pose(armature, 1, False)
    pose(armature, 10, False)
    bpy.ops.ed.undo_push(message="free")

    def check(bound):
        ob, twin = bpy.data.objects[name], bpy.data.objects[twin_name]
        for frame in (6, 2):
            bpy.context.scene.frame_set(frame)
            assert_same_shape(ob, twin)
        assert ob.sinew.is_bound == bound
        assert bool(traces()) == bound
        assert ob.modifiers["Armature"].show_viewport != bound

    select(bpy.data.objects[name])
    bpy.ops.object.sinew_bind(output=output)
    bpy.ops.ed.undo_push(message="bound")
    bpy.ops.ed.undo()
    check(False)
    bpy.ops.ed.redo()
    check(True)
    select(bpy.data.objects[name])
    bpy.ops.object.sinew_unbind()
    bpy.ops.ed.undo_push(message="given back")
    bpy.ops.ed.undo()
    check(True)
    bpy.ops.ed.redo()
    check(False)


def test_undo_of_import(fresh_scene):
    bpy.ops.ed.undo_push(message="empty")
    before = len(bpy.data.objects), len(bpy.data.node_groups)
    import_rig("capsule")
    bpy.ops.ed.undo_push(message="imported")
    bpy.ops.ed.undo()
    bpy.context.scene.frame_set(4)
    assert (len(bpy.data.objects), len(bpy.data.node_groups)) == before
    bpy.ops.ed.redo()
    ob = next(ob for ob in bpy.data.objects if ob.type == "MESH")
    bpy.context.scene.frame_set(9)
    assert_same_shape(ob, builtin_copy(ob))


def test_undo_of_poses_to_keyframes(fresh_scene):
    ob, _ = import_rig("capsule")
    name = ob.name
    bpy.ops.ed.undo_push(message="imported")
    select(ob)
    bpy.ops.object.sinew_clip_to_keyframes()
    bpy.ops.ed.undo_push(message="keyed")
    bpy.ops.ed.undo()
    ob = bpy.data.objects[name]
    assert ob.sinew.source == "CLIP" and not bpy.data.actions
    bpy.context.scene.frame_set(9)
    assert_same_shape(ob, builtin_copy(ob))
    bpy.ops.ed.redo()
    ob = bpy.data.objects[name]
    assert ob.sinew.source == "ARMATURE" and bpy.data.actions
    bpy.context.scene.frame_set(12)
    assert_same_shape(ob, builtin_copy(ob))


def test_undo_of_a_pose(fresh_scene, character):
    name, twin_name, armature_name = (ob.name for ob in character)
    fresh_scene.frame_set(5)
    bpy.ops.ed.undo_push(message="as animated")
    before = evaluated(character[0])
    character[2].pose.bones["bone1"].location = (0.5, 0, 0)
    bpy.context.view_layer.update()
    after = evaluated(character[0])
    bpy.ops.ed.undo_push(message="moved")
    bpy.ops.ed.undo()
    assert np.allclose(evaluated(bpy.data.objects[name]), before, atol=1e-6)
    bpy.ops.ed.redo()
    assert np.allclose(evaluated(bpy.data.objects[name]), after, atol=1e-6)
    assert_same_shape(bpy.data.objects[name], bpy.data.objects[twin_name])
    bpy.data.objects[armature_name].pose.bones["bone2"].location = (0, 0.3, 0)
    bpy.context.view_layer.update()
    assert_same_shape(bpy.data.objects[name], bpy.data.objects[twin_name])


# --- files ----------------------------------------------------------------------------------------

def test_appended_with_its_armature(fresh_scene, character, tmp_path):
    names = [ob.name for ob in character]
    path = tmp_path / "library.blend"
    reload(path)
    with bpy.data.libraries.load(str(path)) as (_, to):
        to.objects = names
    for ob in to.objects:
        bpy.context.collection.objects.link(ob)
    ob, twin, _ = to.objects
    for frame in (2, 8):
        bpy.context.scene.frame_set(frame)
        assert_same_shape(ob, twin)
    select(ob)
    bpy.ops.object.sinew_unbind()
    assert traces() == []
    bpy.context.scene.frame_set(5)
    assert_same_shape(ob, twin)


def test_appended_twice_and_into_a_file_with_sinew(fresh_scene, character, tmp_path):
    names = [ob.name for ob in character]
    path = tmp_path / "library.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    pairs = [character[:2]]
    for _ in range(2):
        with bpy.data.libraries.load(str(path)) as (_, to):
            to.objects = list(names)
        for ob in to.objects:
            bpy.context.collection.objects.link(ob)
        pairs.append(to.objects[:2])
    for frame in (2, 8):
        fresh_scene.frame_set(frame)
        for ob, twin in pairs:
            assert_same_shape(ob, twin)
    assert len([group for group in bpy.data.node_groups if group.name == "Sinew"]) == 1


def test_linked_shows_its_file_and_says_nothing(fresh_scene, character, tmp_path, caplog):
    """A linked mesh cannot be written: it keeps the shape with which its file was saved."""
    name = character[0].name
    saved = evaluated(character[0])
    path = tmp_path / "library.blend"
    reload(path)
    with bpy.data.libraries.load(str(path), link=True) as (_, to):
        to.objects = [name]
    bpy.context.collection.objects.link(to.objects[0])
    bpy.context.scene.frame_set(3)
    bpy.context.scene.frame_set(8)
    assert np.allclose(evaluated(to.objects[0]), saved, atol=1e-6)
    assert not caplog.records


# --- objects --------------------------------------------------------------------------------------

@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("linked", (False, True), ids=("full", "sharing the mesh"))
def test_duplicated(fresh_scene, character, output, linked):
    ob, twin, armature = character
    ob.sinew.output = output
    select(ob)
    bpy.ops.object.duplicate(linked=linked)
    copy = bpy.context.active_object
    assert copy != ob
    for frame in (5, 8):
        fresh_scene.frame_set(frame)
        for each in (ob, copy):
            assert_same_shape(each, twin)
    bpy.data.objects.remove(ob)
    fresh_scene.frame_set(2)
    assert_same_shape(copy, twin)
    if not linked:
        select(copy)
        bpy.ops.object.sinew_unbind()
        assert traces() == []
        fresh_scene.frame_set(3)
        assert_same_shape(copy, twin)


def test_duplicated_with_its_armature(fresh_scene, character):
    """The copies follow the copied armature, as with the modifier."""
    ob, twin, armature = character
    select(ob, twin, armature)
    bpy.ops.object.duplicate()
    copies = {copy.name.partition(".")[0]: copy for copy in bpy.context.selected_objects}
    copy = next(c for c in bpy.context.selected_objects if c.type == "MESH" and c.sinew.is_bound)
    copied_twin = next(
        c for c in bpy.context.selected_objects if c.type == "MESH" and not c.sinew.is_bound)
    assert copies and copy.sinew.armature != armature
    copy.sinew.armature.animation_data_clear()
    copy.sinew.armature.pose.bones["bone1"].location = (0.4, 0, 0)
    for frame in (5, 8):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)
        assert_same_shape(copy, copied_twin)


def test_deleted_by_the_operator(fresh_scene, character):
    ob, twin, armature = character
    select(ob)
    bpy.ops.object.delete()
    fresh_scene.frame_set(5)
    fresh_scene.frame_set(6)
    assert addon_module("session").bound_objects() == []
    bpy.ops.outliner.orphans_purge(do_recursive=True)
    assert traces() == []


def test_armature_deleted_and_chosen_anew(fresh_scene, character):
    ob, twin, armature = character
    spare = armature.copy()
    fresh_scene.collection.objects.link(spare)
    bpy.data.objects.remove(armature)
    fresh_scene.frame_set(5)
    assert "armature is gone" in addon_module("session").character(ob).error
    ob.sinew.armature = twin.modifiers["Armature"].object = spare
    fresh_scene.frame_set(6)
    assert addon_module("session").character(ob).error == ""
    assert_same_shape(ob, twin)


def test_renamed_objects_meshes_and_armatures(fresh_scene, character):
    ob, twin, armature = character
    ob.name, ob.data.name, armature.name, armature.data.name = "a", "b", "c", "d"
    fresh_scene.frame_set(5)
    assert_same_shape(ob, twin)


def test_given_another_mesh(fresh_scene, character):
    ob, twin, armature = character
    other = make_mesh(armature, False)
    other.data.vertices.foreach_set("co", own_positions(other).reshape(-1) * 1.2)
    ob.data = other.data.copy()
    twin.data = other.data
    bpy.data.objects.remove(other)
    for frame in (5, 8):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)


# --- modes ----------------------------------------------------------------------------------------

@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("mode", ("EDIT", "WEIGHT_PAINT", "VERTEX_PAINT", "SCULPT"))
def test_through_a_mode_and_back(fresh_scene, character, mode, output):
    ob, twin, _ = character
    ob.sinew.output = output
    select(ob)
    bpy.ops.object.mode_set(mode=mode)
    fresh_scene.frame_set(6)
    if mode == "WEIGHT_PAINT":
        bpy.ops.object.vertex_group_normalize_all(lock_active=False)
        assert_same_shape(ob, twin)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert_same_shape(ob, twin)
    fresh_scene.frame_set(8)
    assert_same_shape(ob, twin)
    assert addon_module("session").character(ob).error == ""


def test_armature_in_edit_mode_and_edited(fresh_scene, character):
    ob, twin, armature = character
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.context.view_layer.update()
    assert_same_shape(ob, twin)
    assert np.allclose(evaluated(ob), own_positions(ob), atol=1e-6)
    armature.data.edit_bones["bone2"].head.x += 0.3
    armature.data.edit_bones.remove(armature.data.edit_bones["side"])
    bpy.ops.object.mode_set(mode="OBJECT")
    assert_same_shape(ob, twin)
    for frame in (6, 8):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)


# --- scenes and what is shown ---------------------------------------------------------------------

def test_two_scenes(fresh_scene, character):
    ob, twin, armature = character
    second = bpy.data.scenes.new("second")
    for each in character:
        second.collection.objects.link(each)
    for frame in (5, 8):
        bpy.context.window.scene = second
        second.frame_set(frame)
        graph = second.view_layers[0].depsgraph
        shapes = [evaluated(each, graph) for each in (ob, twin)]
        assert np.allclose(*shapes, atol=1e-5)
        bpy.context.window.scene = fresh_scene
        fresh_scene.frame_set(frame + 1)
        assert_same_shape(ob, twin)


def test_mesh_that_is_not_shown(fresh_scene, character):
    ob, twin, _ = character
    ob.hide_viewport = True
    fresh_scene.frame_set(6)
    ob.hide_viewport = False
    fresh_scene.frame_set(7)
    assert_same_shape(ob, twin)
    assert addon_module("session").character(ob).error == ""


# --- the add-on itself ----------------------------------------------------------------------------

def test_disabled_and_enabled_with_bound_meshes(fresh_scene, character):
    """Switched off it shows the last frame's shape, like a file opened without it; then it goes on."""
    ob, twin, _ = character
    package = bpy.types.VIEW3D_PT_sinew.__module__.rpartition(".")[0]
    last = evaluated(ob)
    try:
        bpy.ops.preferences.addon_disable(module=package)
        fresh_scene.frame_set(8)
        assert np.allclose(evaluated(ob), last, atol=1e-6)
    finally:
        bpy.ops.preferences.addon_enable(module=package)
    fresh_scene.frame_set(6)
    assert_same_shape(ob, twin)
    select(ob)
    bpy.ops.object.sinew_unbind()
    assert traces() == []
    fresh_scene.frame_set(7)
    assert_same_shape(ob, twin)


def test_an_error_in_one_mesh_leaves_the_others_alone(fresh_scene, character, caplog):
    ob, twin, armature = character
    broken = make_mesh(armature, False)
    accelerate(broken)
    broken.modifiers.remove(broken.modifiers["Sinew"])
    other = twin_of(twin)
    accelerate(other)
    for frame in (5, 6, 7):
        fresh_scene.frame_set(frame)
        assert_same_shape(other, twin)
    said = [record for record in caplog.records if broken.name in record.getMessage()]
    assert len(said) == 1
    assert "lost its Sinew modifier; unbind it" in addon_module("session").character(broken).error
    select(broken)
    bpy.ops.object.sinew_unbind()
    fresh_scene.frame_set(8)
    assert_same_shape(broken, twin)
