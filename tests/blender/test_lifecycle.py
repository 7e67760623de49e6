"""Undo, save, reload, modes, unbinding: the shape stays right and nothing is left behind."""

import sys

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, pose, with_twin
from helpers import (
    addon_module,
    assert_plays_without_the_addon,
    assert_same_shape,
    builtin_copy,
    data_counts,
    depsgraph,
    evaluated,
    import_rig,
    needs_memory,
    own_positions,
    reopened,
    select,
    traces,
    twin_of,
    way,
)


@pytest.mark.parametrize("output", ("MODIFIER", "MESH"))
def test_unbind_gives_the_mesh_back(fresh_scene, output):
    ob, armature = import_rig("capsule")
    rest = own_positions(ob)
    bpy.ops.object.sinew_unbind()
    plain = attributes(ob), modifiers(ob), data_counts()
    assert modifiers(ob) == [("Armature", True, True)]
    select(ob)
    assert bpy.ops.object.sinew_bind(output=output) == {"FINISHED"}
    fresh_scene.frame_set(9)
    assert not np.allclose(evaluated(ob), rest)
    bpy.ops.object.sinew_unbind()
    assert (attributes(ob), modifiers(ob), data_counts()) == plain
    assert np.array_equal(own_positions(ob), rest)
    assert not ob.sinew.is_bound


def test_what_the_driver_sets_is_set_back(character):
    ob, _, _ = character
    for name in ("Armature", ob.modifiers.new("Copy", "ARMATURE").name):  # as Duplicate takes it along
        ob.modifiers[name].use_apply_on_spline = True
    bpy.ops.object.sinew_unbind()
    assert not any(modifier.use_apply_on_spline for modifier in ob.modifiers)


def attributes(ob):
    """Blender's own hidden attributes come and go by themselves."""
    return {name for name in ob.data.attributes.keys() if "sinew" in name or name[0] != "."}


def modifiers(ob):
    return [(m.name, m.show_viewport, m.show_render) for m in ob.modifiers]


@needs_memory
def test_switching_the_output(fresh_scene):
    ob, _ = import_rig("capsule")
    rest = own_positions(ob)
    fresh_scene.frame_set(9)
    shape = evaluated(ob)
    for output in ("MESH", "MODIFIER", "MESH", "MODIFIER"):
        ob.sinew.output = output
        assert np.allclose(evaluated(ob), shape, atol=1e-6)
        assert np.array_equal(own_positions(ob), rest)
        copy = ob.sinew.deformed
        assert copy is None if output == "MODIFIER" else np.array_equal(own_positions(copy), shape)
        assert addon_module("run.characters").character(ob).status.error == ""
    assert [other.name for other in bpy.data.objects if "deformed" in other.name] == []


@needs_memory
def test_switching_the_output_of_an_accelerated_mesh(fresh_scene):
    """Its modifier has to be moved in the stack, which evaluates the scene in the middle of the switch."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    twin = builtin_copy(ob)
    pose(armature, 1, False)
    accelerate(ob)
    for output in ("MESH", "MODIFIER", "MESH", "MODIFIER"):
        fresh_scene.frame_set(fresh_scene.frame_current + 1)
        ob.sinew.output = output
        assert_same_shape(ob, twin)
    select(ob)
    bpy.ops.object.sinew_unbind()
    assert_same_shape(ob, twin)


def test_bound_again_to_the_same_armature(fresh_scene):
    """Poses that have become keyframes, and keyframes that were edited, are not played over."""
    ob, armature = import_rig("capsule")
    assert ob.sinew.source == "CLIP"
    for source in ("ARMATURE", "CLIP"):
        ob.sinew.source = source
        bpy.ops.object.sinew_unbind()
        assert bpy.ops.object.sinew_bind() == {"FINISHED"} and ob.sinew.source == source


def test_a_hand_moved_bone_in_clip_mode_is_followed_until_the_next_frame(fresh_scene):
    ob, armature = import_rig("capsule")
    reference = builtin_copy(ob)
    fresh_scene.frame_set(5)
    at_five = evaluated(ob)
    bone = armature.pose.bones[1]
    bone.rotation_quaternion = (0.7, 0.7, 0, 0)
    bpy.context.view_layer.update()
    assert not np.allclose(evaluated(ob), at_five, atol=1e-3)
    assert_same_shape(ob, reference)
    fresh_scene.frame_set(6)
    assert_same_shape(ob, reference)
    fresh_scene.frame_set(5)
    assert np.allclose(evaluated(ob), at_five, atol=1e-6)


def test_undo_and_redo_of_a_setting(fresh_scene):
    ob, armature = import_rig("capsule", pose="pose.dmat")
    name, armature_name = ob.name, armature.name
    armature.sinew_clip.mode = "POSED"
    bpy.ops.ed.undo_push(message="posed")
    posed = evaluated(ob)
    armature.sinew_clip.mode = "REST"
    bpy.ops.ed.undo_push(message="rest")
    rest = evaluated(ob)
    assert not np.allclose(rest, posed)
    bpy.ops.ed.undo()
    assert bpy.data.objects[armature_name].sinew_clip.mode == "POSED"
    assert np.allclose(evaluated(bpy.data.objects[name]), posed, atol=1e-6)
    bpy.ops.ed.redo()
    assert np.allclose(evaluated(bpy.data.objects[name]), rest, atol=1e-6)


@needs_memory
def test_undo_of_bind_and_unbind():
    ob, _ = import_rig("capsule")
    name = ob.name
    bpy.ops.ed.undo_push(message="bound")
    select(ob)
    bpy.ops.object.sinew_unbind()
    bpy.ops.ed.undo_push(message="unbound")
    bpy.ops.ed.undo()
    ob = bpy.data.objects[name]
    assert ob.sinew.is_bound and "Sinew" in ob.modifiers
    reference = builtin_copy(ob)
    bpy.context.scene.frame_set(9)
    assert_same_shape(ob, reference)


@pytest.mark.parametrize("output", ("MODIFIER", "MESH"))
def test_save_and_reload(fresh_scene, tmp_path, output):
    ob, armature = import_rig("capsule", output=output)
    fresh_scene.frame_set(9)
    before = evaluated(ob)
    fresh_scene.frame_set(14)
    later = evaluated(ob)
    fresh_scene.frame_set(9)
    (ob,) = reopened(tmp_path, ob)
    assert np.allclose(evaluated(ob), before, atol=1e-6)
    bpy.context.scene.frame_set(14)
    assert np.allclose(evaluated(ob), later, atol=1e-6)


@pytest.mark.parametrize("hidden", (False, True), ids=("armature shown", "armature hidden"))
@pytest.mark.parametrize("keys", (False, True), ids=("plain", "shape keys"))
def test_a_file_plays_without_the_addon(fresh_scene, tmp_path, keys, hidden):
    """As if Sinew had never been there: by Blender's own modifier, on every frame, without a word."""
    armature = make_armature()
    ob = make_mesh(armature, True)
    if keys:
        add_shape_keys(ob)
    ob.modifiers.new("Corrective", "CORRECTIVE_SMOOTH").vertex_group = "bone2"
    ob.modifiers.new("Smooth", "SMOOTH").vertex_group = "bone3"
    twin = twin_of(ob)
    for frame in (1, 7, 14, 20):
        pose(armature, frame, True)
    accelerate(ob)
    armature.hide_viewport = hidden
    fresh_scene.frame_set(9)
    assert_same_shape(ob, twin)
    assert way(ob) == ("KEYS" if keys else "ATTRIBUTE")
    assert_plays_without_the_addon(tmp_path, ob, twin)


@pytest.mark.parametrize("output", ("MODIFIER", "MESH"))
def test_a_file_of_the_first_version(fresh_scene, tmp_path, output):
    """0.1 left the Armature modifier switched off, without its armature; put together here by hand."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    twin = twin_of(ob)
    for frame in (1, 10):
        pose(armature, frame, False)
    modifier, settings = ob.modifiers["Armature"], ob.sinew
    entry = settings.replaced.add()
    entry.name, entry.object, entry.show_viewport, entry.show_render = "Armature", armature, True, True
    modifier.object, modifier.show_viewport, modifier.show_render = None, False, False
    if output == "MESH":
        rest = ob.data.attributes.new("rest_position", "FLOAT_VECTOR", "POINT")
        rest.data.foreach_set("vector", own_positions(ob).reshape(-1))
        ob.data.vertices.foreach_set("co", 2 * own_positions(ob).reshape(-1))  # the shape of some frame
    else:
        own = ob.modifiers.new("Sinew", "NODES")
        own.node_group = bpy.data.node_groups.new("Sinew", "GeometryNodeTree")
        own.node_group["sinew_version"] = 2
        ob.data.attributes.new(".sinew_position", "FLOAT_VECTOR", "POINT")
    ob["sinew_anchor"] = 0.0
    ob.driver_add('["sinew_anchor"]').driver.type = "SUM"
    path, names = str(tmp_path / "old.blend"), (ob.name, twin.name)
    own_handler = addon_module("main.handlers").on_depsgraph_update  # would see a mesh that nobody has bound
    bpy.app.handlers.depsgraph_update_post.remove(own_handler)
    try:
        settings.is_bound, settings.installed_output = True, output
        bpy.ops.wm.save_as_mainfile(filepath=path)
    finally:
        bpy.app.handlers.depsgraph_update_post.append(own_handler)
    bpy.ops.wm.open_mainfile(filepath=path)
    ob, twin = (bpy.data.objects[name] for name in names)
    for frame in (3, 7):
        bpy.context.scene.frame_set(frame)
        assert_same_shape(ob, twin)
    assert way(ob) == "ATTRIBUTE" and "sinew_anchor" not in ob
    assert ob.sinew.installed_output == output and "rest_position" not in ob.data.attributes
    if output == "MESH":
        assert np.array_equal(own_positions(ob), own_positions(twin))
        assert np.array_equal(own_positions(ob.sinew.deformed), evaluated(ob))
    assert ob.modifiers["Armature"].object == ob.sinew.armature == twin.modifiers["Armature"].object
    select(ob)
    bpy.ops.object.sinew_unbind()
    bpy.context.scene.frame_set(5)
    assert_same_shape(ob, twin)


def test_mail_of_a_mesh_that_an_undo_step_has_put_into_edit_mode(character):
    """A mesh shows no attributes then."""
    ob, mending = character[0], addon_module("install.mending")
    select(ob)
    bpy.ops.object.mode_set(mode="EDIT")
    addon_module("run.characters").of(ob).look_again()
    mending.adapt(ob)
    bpy.ops.object.mode_set(mode="OBJECT")
    mending.adapt(ob)
    bpy.context.scene.frame_set(4)
    assert_same_shape(*character[:2])


def test_edit_mode_shows_the_rest_and_edits_are_kept(fresh_scene):
    ob, _ = import_rig("capsule")
    fresh_scene.frame_set(9)
    select(ob)
    bpy.ops.object.mode_set(mode="EDIT")
    fresh_scene.frame_set(10)  # a frame change in Edit Mode does no harm
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(0.25, 0, 0))
    bpy.ops.object.mode_set(mode="OBJECT")
    reference = builtin_copy(ob)
    assert_same_shape(ob, reference)
    fresh_scene.frame_set(12)
    assert_same_shape(ob, reference)


def test_added_and_removed_vertices(fresh_scene):
    ob, _ = import_rig("capsule")
    fresh_scene.frame_set(9)
    select(ob)
    count = len(ob.data.vertices)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert len(ob.data.vertices) > count
    reference = builtin_copy(ob)
    for frame in (9, 12):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, reference)


def test_painted_weights_show_at_once(fresh_scene):
    ob, _ = import_rig("capsule")
    fresh_scene.frame_set(9)
    reference = builtin_copy(ob)
    for each in (ob, reference):
        each.vertex_groups[0].add(range(1000, 2000), 1.0, "REPLACE")
        each.data.update()
    bpy.context.view_layer.update()
    assert_same_shape(ob, reference)


def test_renamed_and_deleted_objects_do_not_disturb(fresh_scene):
    first, _ = import_rig("capsule")
    second, _ = import_rig("capsule")
    first.name, second.name = "x", "capsule"
    reference = builtin_copy(second)
    fresh_scene.frame_set(9)
    assert_same_shape(second, reference)
    bpy.data.objects.remove(first)
    fresh_scene.frame_set(12)
    assert_same_shape(second, reference)


def test_a_renamed_bone_keeps_its_weights(fresh_scene):
    ob, armature = import_rig("capsule")
    reference = builtin_copy(ob)
    armature.data.bones[1].name = "renamed"
    fresh_scene.frame_set(9)
    assert "renamed" in ob.vertex_groups
    assert_same_shape(ob, reference)


def test_armature_in_rest_position(fresh_scene):
    ob, armature = import_rig("capsule")
    fresh_scene.frame_set(9)
    armature.data.pose_position = "REST"
    fresh_scene.frame_set(10)
    assert np.allclose(evaluated(ob), own_positions(ob), atol=1e-6)


@needs_memory
def test_a_deleted_armature_is_said_and_others_play(fresh_scene):
    ob, armature = import_rig("capsule")
    other, _ = import_rig("capsule")
    reference = builtin_copy(other)
    bpy.data.objects.remove(armature)
    fresh_scene.frame_set(9)
    assert "armature is gone" in addon_module("run.characters").character(ob).way.reason
    assert_same_shape(other, reference)


def test_keyframes_from_the_clip_play_the_same(fresh_scene):
    ob, armature = import_rig("capsule")
    shapes = []
    for frame in (1, 7, 20):
        fresh_scene.frame_set(frame)
        shapes.append(evaluated(ob))
    select(ob)
    assert bpy.ops.object.sinew_clip_to_keyframes() == {"FINISHED"}
    assert ob.sinew.source == "ARMATURE" and armature.animation_data.action
    for frame, shape in zip((1, 7, 20), shapes):
        fresh_scene.frame_set(frame)
        assert np.allclose(evaluated(ob), shape, atol=1e-5)


@pytest.mark.skipif("action_slot" not in bpy.types.AnimData.bl_rna.properties, reason="actions have no slots")
def test_keyframes_are_those_of_the_slot_in_use(fresh_scene):
    animation = addon_module("blender.animation")
    first, second = (bpy.data.objects.new(name, None) for name in ("First", "Second"))
    first.keyframe_insert("location")
    action = first.animation_data.action
    second.animation_data_create().action = action
    second.animation_data.action_slot = action.slots.new("OBJECT", "Second")
    second.keyframe_insert("scale")
    assert animation.find_curve(first, "location") and animation.find_curve(second, "scale")
    assert animation.find_curve(second, "location") is None
    assert "scale" in animation.animated_paths(second)
    second.animation_data.action_slot = None
    assert animation.find_curve(second, "scale") is None


def test_disabling_the_addon_leaves_nothing_running():
    package = bpy.types.VIEW3D_PT_sinew.__module__.rpartition(".ui.")[0]

    def handlers():
        return [
            handler
            for name in (
                "frame_change_pre",
                "frame_change_post",
                "depsgraph_update_post",
                "load_post",
                "undo_post",
                "redo_post",
            )
            for handler in getattr(bpy.app.handlers, name)
            if handler.__module__.startswith(package)
        ]

    assert len(handlers()) == 20
    try:
        bpy.ops.preferences.addon_disable(module=package)
        assert handlers() == [] and not hasattr(bpy.types.Object, "sinew")
    finally:
        bpy.ops.preferences.addon_enable(module=package)
    assert len(handlers()) == 20
    assert sys.modules[package]


def test_nothing_of_sinew_is_in_the_evaluated_mesh(fresh_scene):
    """A Subdivision Surface behind it would interpolate it."""
    ob = make_mesh(make_armature(), False)
    accelerate(ob)
    fresh_scene.frame_set(2)
    assert way(ob) == "ATTRIBUTE" and ".sinew_position" in ob.data.attributes
    attributes = ob.evaluated_get(depsgraph()).data.attributes.keys()
    assert "position" in attributes or bpy.app.version < (3, 5)
    assert not [name for name in attributes if "sinew" in name]


@needs_memory
def test_node_group_of_an_older_version_is_renewed(fresh_scene, tmp_path):
    """It would leave the attribute behind, by which an applied modifier is told from a removed one."""
    armature = make_armature()
    for frame in (1, 10):
        pose(armature, frame, False)
    ob, twin = with_twin(make_mesh(armature, False))
    group = ob.modifiers["Sinew"].node_group
    group["sinew_version"] -= 1
    within = next(node.node_tree for node in group.nodes if node.type == "GROUP")
    forget = next(node for node in within.nodes if node.bl_idname == "GeometryNodeRemoveAttribute")
    within.links.new(forget.inputs["Geometry"].links[0].from_socket, within.nodes["Group Output"].inputs[0])
    within.nodes.remove(forget)
    names, path = (ob.name, twin.name), str(tmp_path / "older.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    ob, twin = (bpy.data.objects[name] for name in names)
    bpy.context.scene.frame_set(7)
    assert_same_shape(ob, twin)
    select(ob)
    bpy.ops.object.modifier_apply(modifier="Sinew")
    bpy.context.view_layer.update()
    assert not ob.sinew.is_bound and not ob.modifiers["Armature"].show_viewport
    assert_same_shape(ob, twin)
    addon_module("main.handlers").look_into_the_mail()  # as a timer does in a window
    assert len(bpy.data.node_groups) == 0


def test_an_inner_group_that_lost_its_outer_one_goes(fresh_scene, tmp_path):
    """Blender does not save a group that nothing uses, but the one inside of it."""
    ob = make_mesh(make_armature(), False)
    accelerate(ob)
    (group,) = (each for each in bpy.data.node_groups if each.name == "Sinew")
    group.copy().use_fake_user = False
    inner = group.nodes["Group"].node_tree.copy()
    bpy.data.node_groups["Sinew.001"].nodes["Group"].node_tree = inner
    path, name = str(tmp_path / "orphan.blend"), ob.name
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    select(bpy.data.objects[name])
    bpy.ops.object.sinew_unbind()
    assert not traces()


def test_who_deletes_the_driver_unbinds(fresh_scene):
    armature = make_armature()
    for frame in (1, 10):
        pose(armature, frame, False)
    ob, twin = with_twin(make_mesh(armature, False))
    fresh_scene.frame_set(4)
    ob.driver_remove(ob.animation_data.drivers[0].data_path)
    if bpy.app.version < (4, 0):  # where Blender tells nobody until the object is edited
        ob.update_tag()
    bpy.context.view_layer.update()
    assert not ob.sinew.is_bound and not ob.modifiers.get("Sinew")
    fresh_scene.frame_set(7)
    assert_same_shape(ob, twin)
