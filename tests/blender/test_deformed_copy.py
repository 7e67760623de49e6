"""The output Mesh: an object beside the bound one has the shape in its own vertices on each frame, and never gets in
the way of the bound one."""

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, hook, make_armature, make_mesh, make_tube, pose, smoothed, with_twin
from helpers import (
    addon_module,
    assert_same_shape,
    data_counts,
    evaluated,
    into_a_shot,
    make_fail,
    needs_memory,
    own_positions,
    select,
    traces,
    twin_of,
    way,
)
from test_safety import put_away

pytestmark = needs_memory


@pytest.fixture(params=(lambda ob: None, add_shape_keys), ids=("plain", "shape keys"))
def tube(fresh_scene, request):
    """A bound mesh that is moved and animated over frames 1 to 10."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    request.param(ob)
    ob.location, ob.scale = (1, 2, 3), (1, 2, 0.5)
    for frame in (1, 4, 7, 10):
        pose(armature, frame, False)
    accelerate(ob, "MESH")
    return ob


def assert_follows(ob, frames=(2, 8)):
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        copy = ob.sinew.deformed
        assert np.allclose(own_positions(copy), evaluated(ob), atol=1e-5)
        assert copy.matrix_world == ob.matrix_world


def copies():
    return [ob for ob in bpy.data.objects if ob.sinew.copied_from]


def show_copy(ob):
    """As somebody does who wants to see it or select it."""
    copy = ob.sinew.deformed
    copy.hide_viewport = copy.hide_render = False
    bpy.context.view_layer.update()
    return copy


# --- what it is -----------------------------------------------------------------------------------


def test_what_a_script_finds(tube):
    rest = own_positions(tube)
    copy = tube.sinew.deformed
    assert copy.name == copy.data.name == "Tube.deformed" and copy.sinew.copy_of == tube
    assert copy.hide_viewport and copy.hide_render and copy.users_collection == tube.users_collection
    assert copy.data.shape_keys is None and list(copy.modifiers) == []
    assert not any("sinew" in name for name in copy.data.attributes.keys())
    assert np.array_equal(own_positions(copy), evaluated(tube))  # at once
    assert_follows(tube)
    assert np.array_equal(own_positions(tube), rest)


def test_posed_by_hand_and_moved(tube):
    bone = tube.sinew.armature.pose.bones["bone1"]
    for _ in range(3):
        before = own_positions(tube.sinew.deformed)
        bone.location.x += 0.2
        tube.rotation_euler.z += 0.3
        bpy.context.view_layer.update()
        assert not np.array_equal(own_positions(tube.sinew.deformed), before)
        assert np.array_equal(own_positions(tube.sinew.deformed), evaluated(tube))
        assert tube.sinew.deformed.matrix_world == tube.matrix_world


def test_animated_places_on_show(tube, fresh_scene):
    """Blender moves what is on show, and Sinew what is not."""
    for frame in (1, 10):
        tube.location.x = frame
        tube.keyframe_insert("location", frame=frame)
    assert_follows(tube)
    copy = show_copy(tube)
    assert_follows(tube, (3, 9))
    assert copy.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world == tube.matrix_world
    assert_same_shape(copy, tube)


def test_modifiers_that_follow_are_the_bound_objects(tube):
    tube.modifiers.new("Finer", "SUBSURF")
    bare = twin_of(tube)
    addon_module("install.bind").unbind(bare)
    bare.modifiers.remove(bare.modifiers["Finer"])
    for frame in (2, 8):
        bpy.context.scene.frame_set(frame)
        assert len(evaluated(tube)) > len(tube.data.vertices)
        assert np.allclose(own_positions(tube.sinew.deformed), evaluated(bare), atol=1e-5)


def test_edits_of_the_original_come_along(tube):
    material = bpy.data.materials.new("Skin")
    tube.data.materials.append(material)
    tube.data.uv_layers.new(name="Map")
    tube.data.attributes.new("mine", "FLOAT", "POINT")
    tube.data.update()
    assert_follows(tube)
    mesh = tube.sinew.deformed.data
    assert mesh.materials[0] == material and "Map" in mesh.uv_layers and "mine" in mesh.attributes
    assert mesh.name == "Tube.deformed"
    counts = data_counts()
    assert_follows(tube, (1, 3, 5))
    assert tube.sinew.deformed.data == mesh and data_counts() == counts


def add_shifted_key(ob):
    if ob.data.shape_keys is None:
        ob.shape_key_add(name="Basis")
    key = ob.shape_key_add(name="Shifted")
    key.data[700].co.x += 1
    key.value = 1


def clear_geometry(ob):
    if ob.data.shape_keys:
        ob.shape_key_clear()
    ob.data.clear_geometry()


@pytest.mark.parametrize("edit", (add_shifted_key, clear_geometry))
def test_edits_that_change_what_the_file_needs_come_along_at_once(tube, edit):
    """Blender's own modifiers deform in the evaluation in which Sinew finds that out."""
    tube.modifiers.new("Smooth", "SMOOTH")
    bpy.context.view_layer.update()
    edit(tube)
    bpy.context.view_layer.update()
    assert np.allclose(own_positions(tube.sinew.deformed), evaluated(tube), atol=1e-5)


def test_an_edit_that_sinew_has_to_mend_comes_along_in_a_moment(fresh_scene):
    """Blender 5 puts the hook first, and Sinew last: in a handler, of whose edits no handler is told."""
    tube = smoothed(make_tube()).id_data
    accelerate(tube, "MESH")
    hook(tube).vertex_indices_set(range(0, 400, 3))
    bpy.context.view_layer.update()
    addon_module("main.handlers").look_into_the_mail()  # as a timer does
    assert np.allclose(own_positions(tube.sinew.deformed), evaluated(tube), atol=1e-5)


def test_painting_does_not_renew_it(tube):
    """It takes time, and no vertex comes or goes."""
    mesh = tube.sinew.deformed.data
    select(tube)
    bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
    tube.vertex_groups["bone1"].add(range(300, 700), 1.0, "REPLACE")
    tube.data.update()
    assert_follows(tube)
    assert tube.sinew.deformed.data == mesh
    bpy.ops.object.mode_set(mode="OBJECT")
    assert_follows(tube)


# --- when it stays --------------------------------------------------------------------------------


def warnings(ob):
    return " ".join(warning.text for warning in addon_module("ui.advice").warnings(ob))


@pytest.mark.parametrize("mode", ("EDIT", "SCULPT"))
def test_while_the_original_is_edited_it_stays(tube, fresh_scene, mode):
    assert "keeps its last shape" not in warnings(tube)
    shape = own_positions(tube.sinew.deformed)
    select(tube)
    bpy.ops.object.mode_set(mode=mode)
    fresh_scene.frame_set(8)
    assert np.array_equal(own_positions(tube.sinew.deformed), shape)
    assert f"Tube.deformed keeps its last shape while Tube is in {mode.capitalize()} Mode" in warnings(tube)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert_follows(tube)


def test_a_modifier_put_before_the_armature(tube, fresh_scene):
    """Blender's own modifier deforms then. If others follow, their outcome is all that is to be had."""
    twin = twin_of(tube)
    addon_module("install.bind").unbind(twin)
    for ob in tube, twin:
        select(ob)
        ob.modifiers.new("Wave", "WAVE")
        while ob.modifiers[0].name != "Wave":
            bpy.ops.object.modifier_move_up(modifier="Wave")
    bpy.context.view_layer.update()
    assert_follows(tube)
    assert_same_shape(tube, twin)
    assert way(tube) == "BLENDER" and "Wave comes before Armature" in warnings(tube)
    assert "keeps its last shape" not in warnings(tube)
    tube.modifiers.new("Finer", "SUBSURF")
    bpy.context.view_layer.update()
    shape = own_positions(tube.sinew.deformed)
    fresh_scene.frame_set(3)
    assert np.array_equal(own_positions(tube.sinew.deformed), shape)
    assert "keeps its last shape while Blender's own modifier deforms Tube among others" in warnings(tube)


def test_a_hidden_original(tube, fresh_scene):
    shape = own_positions(tube.sinew.deformed)
    tube.hide_viewport = True
    fresh_scene.frame_set(8)
    assert np.array_equal(own_positions(tube.sinew.deformed), shape)
    assert "keeps its last shape while Tube is hidden" in warnings(tube)
    tube.hide_viewport = False
    assert_follows(tube)


@pytest.mark.says_errors
def test_an_error_in_sinew_leaves_it_to_blender(tube, monkeypatch):
    make_fail(monkeypatch, tube.name)
    assert_follows(tube)


def test_a_mesh_without_vertices(tube):
    tube.shape_key_clear() if tube.data.shape_keys else None
    tube.data.clear_geometry()
    assert_follows(tube)
    assert len(tube.sinew.deformed.data.vertices) == 0


def test_a_mesh_without_vertices_that_is_left_to_blender(tube):
    tube.shape_key_clear() if tube.data.shape_keys else None
    tube.data.clear_geometry()
    tube.modifiers.new("Finer", "SUBSURF")
    tube.parent = tube.sinew.armature
    tube.parent_type = "ARMATURE"
    bpy.context.view_layer.update()
    assert way(tube) == "BLENDER"
    bpy.context.scene.frame_set(5)
    assert "keeps its last shape" in warnings(tube)


def test_a_render_does_not_write_it(tube, fresh_scene, tmp_path):
    fresh_scene.frame_set(2)
    shape = own_positions(tube.sinew.deformed)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    fresh_scene.collection.objects.link(camera)
    fresh_scene.camera, fresh_scene.render.engine = camera, "CYCLES"
    fresh_scene.cycles.samples, fresh_scene.cycles.use_denoising = 1, False
    fresh_scene.render.resolution_x = fresh_scene.render.resolution_y = 4
    fresh_scene.render.filepath = str(tmp_path / "frame")
    fresh_scene.frame_start, fresh_scene.frame_end = 5, 6
    seen = []

    def look(*_):
        seen.append(np.array_equal(own_positions(tube.sinew.deformed), shape))

    bpy.app.handlers.render_post.append(look)
    try:
        bpy.ops.render.render(animation=True)
    finally:
        bpy.app.handlers.render_post.remove(look)
    assert seen == [True, True]
    assert_follows(tube)


# --- where the two go -----------------------------------------------------------------------------


def test_deleted_it_is_made_anew(tube):
    bpy.data.objects.remove(tube.sinew.deformed)
    bpy.context.view_layer.update()
    assert_follows(tube)
    assert len(copies()) == 1


@pytest.mark.parametrize("linked", (False, True), ids=("full", "sharing the mesh"))
def test_duplicated_it_is_let_go(tube, linked):
    copy = show_copy(tube)
    select(copy)
    bpy.ops.object.duplicate(linked=linked)
    second = bpy.context.active_object
    assert_follows(tube)
    assert copies() == [copy] and second.parent is None and second.matrix_world == tube.matrix_world
    shape = own_positions(second)
    bpy.ops.mesh.primitive_cube_add()
    tube.data.vertices[0].co.x += 0.1
    tube.data.update()
    assert_follows(tube, (2, 5))
    assert linked or np.array_equal(own_positions(second), shape)
    select(tube)
    bpy.ops.object.sinew_unbind()
    assert second.name in bpy.data.objects and copies() == [] and len(own_positions(second)) == len(shape)


@pytest.mark.parametrize("with_copy", (False, True), ids=("alone", "with its copy"))
def test_a_duplicated_original_has_a_copy_of_its_own(tube, with_copy):
    copy = show_copy(tube)
    select(tube, *[copy] * with_copy)
    bpy.ops.object.duplicate()
    second = next(ob for ob in bpy.context.selected_objects if ob.sinew.is_bound)
    bpy.context.view_layer.update()
    for ob in tube, second:
        assert_follows(ob)
    assert set(copies()) == {tube.sinew.deformed, second.sinew.deformed}
    assert tube.sinew.deformed == copy != second.sinew.deformed


def test_a_deleted_original_takes_it_along(tube):
    """Nothing keeps the deleted object in the file."""
    select(tube)
    bpy.ops.object.delete()
    bpy.context.view_layer.update()
    addon_module("main.handlers").look_into_the_mail()  # as a timer does in a window
    assert copies() == [] and "Tube" not in bpy.data.objects and "Tube.deformed" not in bpy.data.meshes


def test_deleted_undone_and_redone(tube):
    name = tube.name
    bpy.ops.ed.undo_push(message="before")
    select(tube)
    bpy.ops.object.delete()
    bpy.ops.ed.undo_push(message="deleted")
    bpy.ops.ed.undo()
    assert_follows(bpy.data.objects[name])
    bpy.ops.ed.redo()
    bpy.context.view_layer.update()
    bpy.context.scene.frame_set(3)
    assert name not in bpy.data.objects
    bpy.ops.ed.undo()
    assert_follows(bpy.data.objects[name])
    assert len(copies()) == 1


def test_given_another_mesh_by_a_join_it_is_let_go(tube):
    """What was joined into it is not lost."""
    copy = show_copy(tube)
    bpy.ops.mesh.primitive_cube_add(location=(3, 0, 0))
    cube, count = bpy.context.active_object, len(copy.data.vertices)
    select(copy, cube)
    assert bpy.ops.object.join() == {"FINISHED"}
    assert_follows(tube)
    assert tube.sinew.deformed != copy and len(copy.data.vertices) == count + 8
    assert not copy.sinew.copied_from and copies() == [tube.sinew.deformed]


def test_joined_into_another_mesh(tube):
    copy = show_copy(tube)
    bpy.ops.mesh.primitive_cube_add(location=(3, 0, 0))
    select(bpy.context.active_object, copy)
    assert bpy.ops.object.join() == {"FINISHED"}
    bpy.context.view_layer.update()
    assert_follows(tube)
    assert len(copies()) == 1


def test_its_parent_is_cleared(tube):
    copy = show_copy(tube)
    select(copy)
    bpy.ops.object.parent_clear(type="CLEAR_KEEP_TRANSFORM")
    assert_follows(tube)
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.view_layer.update()
    assert copy.name in bpy.data.objects and copies() == [tube.sinew.deformed] != [copy]


def test_moved_to_another_collection(tube):
    collection = bpy.data.collections.new("Other")
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(tube)
    bpy.context.scene.collection.objects.unlink(tube)
    bpy.context.view_layer.update()
    assert_follows(tube)
    assert tube.sinew.deformed.users_collection == (collection,)


def test_renamed(tube):
    copy = tube.sinew.deformed
    tube.name, copy.name, copy.data.name = "a", "b", "c"
    assert_follows(tube)
    assert tube.sinew.deformed == copy and copies() == [copy]


def test_its_name_is_taken(fresh_scene):
    other = bpy.data.objects.new("Tube.deformed", None)
    ob = make_mesh(make_armature(), False)
    accelerate(ob, "MESH")
    assert ob.sinew.deformed.name == "Tube.deformed.001" and other.name == "Tube.deformed"


def test_it_cannot_be_bound(tube):
    select(show_copy(tube))
    with pytest.raises(RuntimeError, match="Tube.deformed is the deformed copy of Tube; bind that mesh instead"):
        bpy.ops.object.sinew_bind()


@pytest.mark.parametrize("how", ("unbound", "other output", "applied"))
def test_it_goes_with_the_output(tube, how):
    select(tube)
    if how == "unbound":
        bpy.ops.object.sinew_unbind()
    elif how == "other output":
        tube.sinew.output = "MODIFIER"
    else:
        bpy.ops.object.convert(target="MESH")
        bpy.context.scene.frame_set(3)
        bpy.context.scene.frame_set(4)
    assert copies() == [] and [mesh.name for mesh in bpy.data.meshes if "deformed" in mesh.name] == []


# --- files ----------------------------------------------------------------------------------------


def test_saved_and_opened(tube, tmp_path):
    path, names = str(tmp_path / "saved.blend"), (tube.name, tube.sinew.deformed.name)
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    ob, copy = (bpy.data.objects[name] for name in names)
    assert ob.sinew.deformed == copy and copy.hide_viewport
    assert_follows(ob)
    assert copies() == [copy]


def test_a_file_that_was_saved_in_another_pose_than_its_keyframes_say(tube, tmp_path):
    """Opening it, Blender takes the one of the keyframes, without a word to handlers."""
    bpy.context.scene.frame_set(4)
    tube.sinew.armature.pose.bones["bone1"].rotation_quaternion = 0.6, 0.8, 0, 0
    bpy.context.view_layer.update()
    before = own_positions(tube.sinew.deformed)
    path, name = str(tmp_path / "saved.blend"), tube.name
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    ob = bpy.data.objects[name]
    due = evaluated(ob)
    addon_module("main.handlers").look_into_the_mail()  # as a timer does in a window
    assert np.allclose(own_positions(ob.sinew.deformed), due, atol=1e-5)
    assert np.abs(due - before).max() > 0.1


@pytest.mark.parametrize("which", ((0,), (1,), (0, 1)), ids=("original", "copy", "both"))
def test_appended(tube, tmp_path, which):
    """The one brings the other, or it is made."""
    path, names = str(tmp_path / "library.blend"), (tube.name, tube.sinew.deformed.name)
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(path) as (_, to):
        to.objects = [names[number] for number in which]
    for ob in to.objects:
        bpy.context.collection.objects.link(ob)
    ob = bpy.data.objects[names[0]]
    if which == (1,):
        bpy.context.collection.objects.link(ob)
    bpy.context.scene.frame_set(1)
    assert_follows(ob)
    assert len(copies()) == 1


@pytest.mark.parametrize("overridden", (False, True), ids=("linked", "overridden"))
def test_of_a_library(tube, tmp_path, overridden):
    """What is linked stays as it was saved; an override's copy is written, whose mesh is the shot's own."""
    collection = bpy.data.collections.new("Character")
    for ob in tube, tube.sinew.deformed, tube.sinew.armature:
        collection.objects.link(ob)
        bpy.context.scene.collection.objects.unlink(ob)
    bpy.context.scene.collection.children.link(collection)
    bpy.context.scene.frame_set(2)
    scene = into_a_shot(tmp_path, overridden)
    for _ in range(2):
        ob = next(ob for ob in scene.objects if ob.sinew.is_bound)
        shown = next(ob for ob in copies() if ob.library is not None)
        shape = own_positions(shown)
        for frame in (3, 8):
            scene.frame_set(frame)
            assert np.array_equal(own_positions(shown), shape)  # the library's
            if overridden:
                assert_follows(ob)
                assert ob.sinew.deformed.data.library is None
        assert len([copy for copy in copies() if copy.library is None]) == overridden
        shot = str(tmp_path / "shot.blend")
        bpy.ops.wm.save_as_mainfile(filepath=shot)
        bpy.ops.wm.open_mainfile(filepath=shot)
        scene = bpy.context.scene


def test_in_a_collection_that_is_put_away(tube):
    armature = tube.sinew.armature
    put_away(armature, exclude=True)
    assert_follows(tube)


def test_a_file_whose_mesh_had_the_shape_itself(fresh_scene, tmp_path):
    """As the output Mesh was before: the modifier bound to nothing, the rest shape in an attribute."""
    armature = make_armature()
    for frame in (1, 10):
        pose(armature, frame, False)
    ob, twin = with_twin(make_mesh(armature, False))
    addon_module("install.mending").remove_own_modifier(ob)
    rest = own_positions(ob)
    ob.data.attributes.new("rest_position", "FLOAT_VECTOR", "POINT").data.foreach_set("vector", rest.reshape(-1))
    ob.data.vertices.foreach_set("co", 2 * rest.reshape(-1))
    modifier = ob.modifiers["Armature"]
    modifier.use_vertex_groups = modifier.use_bone_envelopes = False
    path, names = str(tmp_path / "old.blend"), (ob.name, twin.name)
    own_handler = addon_module("main.handlers").on_depsgraph_update
    bpy.app.handlers.depsgraph_update_post.remove(own_handler)
    try:
        ob.sinew.held = "10"
        ob.sinew.installed_output = "MESH"
        bpy.ops.wm.save_as_mainfile(filepath=path)
    finally:
        bpy.app.handlers.depsgraph_update_post.append(own_handler)
    bpy.ops.wm.open_mainfile(filepath=path)
    bpy.context.scene.frame_set(1)
    ob, twin = (bpy.data.objects[name] for name in names)
    assert_follows(ob)
    assert_same_shape(ob, twin)
    assert np.array_equal(own_positions(ob), rest) and "rest_position" not in ob.data.attributes
    assert ob.modifiers["Armature"].use_vertex_groups and not ob.modifiers["Armature"].use_bone_envelopes
    assert ob.sinew.held == "" and ob.sinew.output == "MESH"
    select(ob)
    bpy.ops.object.sinew_unbind()
    assert traces() == []
    assert_same_shape(ob, twin)
