"""What people do to a file while a mesh is bound: the shape stays right, nothing is left behind."""

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, pose, with_bendy_bones
from helpers import (
    addon_module,
    assert_same_shape,
    builtin_copy,
    evaluated,
    import_rig,
    make_fail,
    needs_memory,
    override,
    own_positions,
    select,
    traces,
    twin_of,
    way,
)

OUTPUTS = ("MODIFIER", "MESH")


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


def groups():
    """Sinew's node group; there are two more that read a canvas, and that of canvases. All but the last have one other
    within."""
    names = sorted(group.name for group in bpy.data.node_groups)
    nested = [f"Sinew{kind}" for kind in ("", " Front", " Shared")]
    assert names in ([], sorted([*nested, *(f"{name} Placing" for name in nested), "Sinew Canvas"]))
    return [(group.name, group.as_pointer()) for group in bpy.data.node_groups if group.name == "Sinew"]


def test_the_node_group_stays_while_a_mesh_is_bound(fresh_scene, character, tmp_path):
    """Also while none uses it. Made anew by a handler it would be unknown to the step that is undone, and an object
    that undo keeps would point to it: Blender crashed."""
    ob, _, armature = character
    with_keys = make_mesh(armature, False)
    add_shape_keys(with_keys)
    accelerate(with_keys)
    before = groups()
    assert len(before) == 1 and way(with_keys) == "KEYS"
    select(ob)
    bpy.ops.object.sinew_unbind()
    assert groups() == before
    reload(tmp_path / "saved.blend")
    assert groups() == []
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    assert len(groups()) == 1
    bpy.ops.outliner.orphans_purge(do_recursive=True)
    assert len(groups()) == 1
    bpy.data.objects.remove(next(ob for ob in bpy.data.objects if ob.sinew.is_bound))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    assert groups() == []


def test_an_appended_mesh_brings_the_node_group(fresh_scene, character, tmp_path):
    ob, name, path = character[0], character[0].name, tmp_path / "library.blend"
    add_shape_keys(ob)
    bpy.context.view_layer.update()
    reload(path)
    bpy.ops.wm.append(filepath=str(path / "Object" / name), directory=str(path / "Object"), filename=name)
    bpy.context.view_layer.update()
    assert way(bpy.data.objects[name]) == "KEYS" and len(groups()) == 1


def test_undo_past_a_modifier_that_a_handler_gave(fresh_scene, character):
    """As its keys are removed the mesh gets Sinew's modifier, outside of Blender's steps."""
    ob, twin, armature = character
    for each in (ob, twin):
        add_shape_keys(each)
    bpy.context.view_layer.update()
    assert way(ob) == "KEYS"
    for message in ("keys", "another step"):
        armature.location.x += 1
        bpy.ops.ed.undo_push(message=message)
    for _ in range(3):
        for each in (ob, twin):
            each.shape_key_clear()
        bpy.context.view_layer.update()
        assert way(ob) == "ATTRIBUTE" and len(groups()) == 1
        bpy.ops.ed.undo_push(message="without keys")
        bpy.ops.ed.undo()
        ob, twin = (bpy.data.objects[each] for each in ("Tube", "Tube.001"))
        bpy.context.view_layer.update()
        assert_same_shape(ob, twin)
        assert way(ob) == "KEYS" and len(groups()) == 1
    bpy.ops.ed.undo()
    assert_same_shape(*(bpy.data.objects[each] for each in ("Tube", "Tube.001")))


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


@pytest.mark.parametrize("copies", (0, 1, 2), ids=("linked", "overridden", "overridden twice"))
def test_linked_from_a_library_where_it_was_bound(fresh_scene, character, tmp_path, copies):
    """Shots link characters: they follow their armatures there, the library's or an override's, each
    override by itself though all share the library's mesh."""
    collection = bpy.data.collections.new("Character")
    fresh_scene.collection.children.link(collection)
    for each in character:
        collection.objects.link(each)
    names = [each.name for each in character]
    path = tmp_path / "library.blend"
    reload(path)
    with bpy.data.libraries.load(str(path), link=True) as (_, to):
        to.collections = [collection_name := "Character"]
    scene, linked = bpy.context.scene, to.collections[0]
    assert linked.name == collection_name
    if copies:
        shown = [override(linked) for _ in range(copies)]
    else:
        scene.collection.children.link(linked)
        shown = [linked]

    def check():
        for each in shown:
            ob, twin, _ = parts(each)
            assert addon_module("run.characters").character(ob).status.error == ""
            assert_same_shape(ob, twin)

    def parts(each):
        return [
            next(
                ob
                for ob in each.all_objects
                if ob.name.partition(".")[0] == name.partition(".")[0]
                and (name == names[2] or ob.sinew.is_bound == (name == names[0]))
            )
            for name in names
        ]

    for frame in (2, 8):
        scene.frame_set(frame)
        check()
    if copies:
        last = parts(shown[-1])[2]
        last.animation_data_create().action = None
        last.pose.bones["bone1"].location = (0.3, 0, 0)
        last.pose.bones["bone1"].rotation_quaternion = (0.7, 0, 0.7, 0)
        bpy.context.view_layer.update()
        check()
        scene.frame_set(4)
        check()
        shot = str(tmp_path / "shot.blend")
        bpy.ops.wm.save_as_mainfile(filepath=shot)
        bpy.ops.wm.open_mainfile(filepath=shot)
        scene = bpy.context.scene
        shown = [each for each in bpy.data.collections if each.override_library]
        assert len(shown) == copies
        for frame in (5, 6):
            scene.frame_set(frame)
            check()
        # The override goes back to Blender; the library's own, of the same name, stays bound.
        ob, twin, _ = parts(shown[0])
        select(ob)
        assert bpy.ops.object.sinew_unbind() == {"FINISHED"}
        bound = addon_module("run.characters").bound_objects()
        assert ob not in bound and len(set(bound)) == len(bound)
        scene.frame_set(3)
        assert_same_shape(ob, twin)


def test_bound_as_an_override(fresh_scene, tmp_path):
    """The library knows nothing of Sinew; the shot binds the overridden character."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    add_shape_keys(ob)
    twin = twin_of(ob)
    names = [ob.name, twin.name]
    for frame in (1, 4, 7, 10):
        pose(armature, frame, False)
    collection = bpy.data.collections.new("Character")
    fresh_scene.collection.children.link(collection)
    for each in (armature, ob, twin):
        collection.objects.link(each)
    path = tmp_path / "library.blend"
    reload(path)
    with bpy.data.libraries.load(str(path), link=True) as (_, to):
        to.collections = ["Character"]
    override(to.collections[0])

    def overridden():
        return [next(ob for ob in bpy.data.objects if ob.name == name and ob.override_library) for name in names]

    def check(frames):
        ob, twin = overridden()
        for frame in frames:
            bpy.context.scene.frame_set(frame)
            assert_same_shape(ob, twin)

    ob, twin = overridden()
    select(ob)
    assert bpy.ops.object.sinew_bind() == {"FINISHED"}
    assert way(ob) == "KEYS"
    check((2, 8))
    shot = str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=shot)
    bpy.ops.wm.open_mainfile(filepath=shot)
    ob, twin = overridden()
    assert ob.sinew.is_bound and ob.sinew.armature.override_library
    check((5, 3))
    select(ob)
    assert bpy.ops.object.sinew_bind(output="MESH") == {"FINISHED"}  # of a mesh that is the library's
    check((6,))
    assert ob.sinew.deformed.library is None and np.array_equal(own_positions(ob.sinew.deformed), evaluated(ob))
    bpy.ops.object.sinew_unbind()
    assert traces() == []
    check((7,))


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


def test_it_is_given_a_mesh_without_shape_keys(fresh_scene, character):
    """The driver still knows the keys of the old one, which stay as they are."""
    ob, twin, armature = character
    for each in (ob, twin):
        add_shape_keys(each)
    fresh_scene.frame_set(4)
    assert way(ob) == "KEYS"
    keyed = ob.data, twin.data
    other = make_mesh(armature, False).data
    addon_module("run.characters").forget()
    for each in (ob, twin):
        each.data = other if each == twin else other.copy()
    for frame in (5, 6):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)
    ob.data, twin.data = keyed
    for frame in (7, 8):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)
    assert way(ob) == "KEYS"


def test_another_object_is_given_the_mesh(fresh_scene):
    """Blender evaluates both at the same time, so it deforms both."""
    ob = make_mesh(make_armature(), False)
    add_shape_keys(ob)
    other = make_mesh(ob.modifiers[0].object, False)
    accelerate(ob)
    assert way(ob) == "KEYS"
    other.data = ob.data
    bpy.context.view_layer.update()
    assert way(ob) == "BLENDER"


@needs_memory
def test_objects_that_share_a_mesh(fresh_scene):
    """Each by an armature of its own."""
    armatures = [make_armature(), make_armature()]
    objects = [make_mesh(armatures[0], False)]
    objects.append(objects[0].copy())
    fresh_scene.collection.objects.link(objects[1])
    objects[1].modifiers["Armature"].object = armatures[1]
    twins = [twin_of(ob) for ob in objects]
    for frame in (1, 10):
        pose(armatures[0], frame, False)
        pose(armatures[1], 20 + frame, False)
        armatures[1].pose.bones["bone0"].keyframe_insert("location", frame=11 - frame)
    select(*objects)
    bpy.ops.object.sinew_bind()
    assert objects[0].data == objects[1].data and all(ob.sinew.is_bound for ob in objects)
    for frame in (3, 8):
        fresh_scene.frame_set(frame)
        for ob, twin in zip(objects, twins):
            assert_same_shape(ob, twin)
        assert np.abs(evaluated(objects[0]) - evaluated(objects[1])).max() > 0.1
    select(objects[0])
    bpy.ops.object.sinew_unbind()
    fresh_scene.frame_set(5)
    assert_same_shape(objects[1], twins[1])
    assert_same_shape(objects[0], twins[0])
    for ob in (objects[0], twins[0]):
        ob.shape_key_add(name="Basis")
    with pytest.raises(RuntimeError, match="2 objects share this mesh.* Fix that first, or use the output Modifier"):
        bpy.ops.object.sinew_bind(output="MESH")
    select(objects[1])
    bpy.ops.object.sinew_unbind()
    assert traces() == []


def test_all_meshes_of_an_armature_at_once(fresh_scene):
    """One that cannot be taken over is named and left to Blender."""
    armature = make_armature()
    objects = [make_mesh(armature, preserve) for preserve in (False, True, False)]
    twins = [twin_of(ob) for ob in objects]
    for twin in twins:
        twin.modifiers["Armature"].name = "Judge"
        fresh_scene.collection.objects.unlink(twin)
    pose(armature, 1, False)
    pose(armature, 10, False)
    objects[2].vertex_groups.clear()
    select(armature)
    assert bpy.ops.object.sinew_bind() == {"FINISHED"}
    assert [ob.sinew.is_bound for ob in objects] == [True, True, False]
    assert [ob.sinew.method for ob in objects[:2]] == ["LINEAR", "DUAL_QUATERNION"]
    for twin in twins:
        fresh_scene.collection.objects.link(twin)
    fresh_scene.frame_set(6)
    for ob, twin in zip(objects[:2], twins):
        assert_same_shape(ob, twin)
        bpy.data.objects.remove(twin)
    select(armature)
    assert bpy.ops.object.sinew_unbind() == {"FINISHED"}
    assert traces() == [] and not any(ob.sinew.is_bound for ob in objects)


def test_duplicated_with_its_armature(fresh_scene, character):
    """The copies follow the copied armature, as with the modifier."""
    ob, twin, armature = character
    select(ob, twin, armature)
    bpy.ops.object.duplicate()
    copies = {copy.name.partition(".")[0]: copy for copy in bpy.context.selected_objects}
    copy = next(c for c in bpy.context.selected_objects if c.type == "MESH" and c.sinew.is_bound)
    copied_twin = next(c for c in bpy.context.selected_objects if c.type == "MESH" and not c.sinew.is_bound)
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
    assert addon_module("run.characters").bound_objects() == []
    bpy.ops.outliner.orphans_purge(do_recursive=True)
    assert traces() == []


@needs_memory
def test_armature_deleted_and_chosen_anew(fresh_scene, character):
    ob, twin, armature = character
    spare = armature.copy()
    fresh_scene.collection.objects.link(spare)
    bpy.data.objects.remove(armature)
    fresh_scene.frame_set(5)
    assert "armature is gone" in addon_module("run.characters").character(ob).way.reason
    ob.sinew.armature = twin.modifiers["Armature"].object = spare
    fresh_scene.frame_set(6)
    assert way(ob) == "ATTRIBUTE"
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
    assert addon_module("run.characters").character(ob).status.error == ""


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


@needs_memory
def test_modifier_that_was_switched_off_for_the_viewport_stays_off(fresh_scene):
    armature = make_armature()
    ob = make_mesh(armature, False)
    ob.modifiers["Armature"].show_viewport = False
    twin = twin_of(ob)
    pose(armature, 1, False)
    pose(armature, 10, False)
    accelerate(ob)
    fresh_scene.frame_set(6)
    assert_same_shape(ob, twin)
    for shown in (True, False):
        ob.modifiers["Armature"].show_viewport = twin.modifiers["Armature"].show_viewport = shown
        fresh_scene.frame_set(7 + shown)
        assert_same_shape(ob, twin)
    ob.sinew.output = "MESH"
    ob.sinew.output = "MODIFIER"
    assert not ob.modifiers["Armature"].show_viewport and ob.modifiers["Armature"].show_render


def test_mesh_that_is_not_shown(fresh_scene, character):
    ob, twin, _ = character
    ob.hide_viewport = True
    fresh_scene.frame_set(6)
    ob.hide_viewport = False
    fresh_scene.frame_set(7)
    assert_same_shape(ob, twin)
    assert addon_module("run.characters").character(ob).status.error == ""


HIDINGS = {
    "disabled in viewports": lambda armature: setattr(armature, "hide_viewport", True),
    "hidden with the eye": lambda armature: armature.hide_set(True),
    "in an excluded collection": lambda armature: put_away(armature, exclude=True),
    "in a hidden collection": lambda armature: put_away(armature, exclude=False),
    "in no scene": lambda armature: [c.objects.unlink(armature) for c in armature.users_collection],
}


def put_away(armature, exclude):
    collection = bpy.data.collections.new("away")
    bpy.context.scene.collection.children.link(collection)
    for other in armature.users_collection:
        other.objects.unlink(armature)
    collection.objects.link(armature)
    if exclude:
        bpy.context.view_layer.layer_collection.children["away"].exclude = True
    else:
        collection.hide_viewport = True


@pytest.mark.parametrize("when", ("before", "after"))
@pytest.mark.parametrize("parented", (False, True), ids=("free", "parented"))
@pytest.mark.parametrize("hide", HIDINGS.values(), ids=HIDINGS)
def test_armature_that_is_not_shown(fresh_scene, hide, parented, when):
    armature = make_armature()
    ob = make_mesh(armature, False)
    with_bendy_bones(ob)
    if parented:
        ob.parent = armature
    twin = twin_of(ob)
    for frame in (1, 10):
        pose(armature, frame, False)
    if when == "before":
        hide(armature)
    accelerate(ob)
    if when == "after":
        fresh_scene.frame_set(2)
        hide(armature)
    shapes = []
    for frame in (3, 8):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)
        shapes.append(evaluated(ob))
    assert np.abs(shapes[0] - shapes[1]).max() > 0.1
    select(ob)
    bpy.ops.object.sinew_unbind()
    assert ob.animation_data is None
    fresh_scene.frame_set(5)
    assert_same_shape(ob, twin)


def test_parented_and_set_free_while_the_armature_is_hidden(fresh_scene):
    armature = make_armature()
    ob = make_mesh(armature, False)
    ob.parent = armature
    twin = twin_of(ob)
    pose(armature, 1, False)
    pose(armature, 10, False)
    accelerate(ob)
    armature.hide_viewport = True
    for parent in (armature, None, armature):
        ob.parent = twin.parent = parent
        for frame in (3, 8):
            fresh_scene.frame_set(frame)
            assert_same_shape(ob, twin)
    select(ob)
    bpy.ops.object.sinew_unbind()
    assert ob.animation_data is None


def test_a_bone_deleted_and_another_added_is_no_renaming(fresh_scene, character):
    ob, twin, armature = character
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    bones = armature.data.edit_bones
    bones.remove(bones["side"])
    bone = bones.new("more")
    bone.head, bone.tail, bone.parent = (0.2, 0, 3), (1, 0, 3.5), bones["bone2"]
    bpy.ops.object.mode_set(mode="OBJECT")
    fresh_scene.frame_set(5)
    assert "side" in ob.vertex_groups and "more" not in ob.vertex_groups
    assert_same_shape(ob, twin)


def test_bones_added_while_the_armature_is_hidden(fresh_scene, character):
    ob, twin, armature = character
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    bone = armature.data.edit_bones.new("more")
    bone.head, bone.tail = (0.2, 0, 3), (1, 0, 3.5)
    bone.parent = armature.data.edit_bones["bone2"]
    bpy.ops.object.mode_set(mode="OBJECT")
    for each in (ob, twin):
        each.vertex_groups.new(name="more").add(range(600, 900), 0.7, "REPLACE")
    for frame, angle in ((1, 0), (10, 1)):
        armature.pose.bones["more"].rotation_mode = "XYZ"
        armature.pose.bones["more"].rotation_euler.x = angle
        armature.pose.bones["more"].keyframe_insert("rotation_euler", frame=frame)
    armature.hide_viewport = True
    for frame in (4, 9):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)


# --- the add-on itself ----------------------------------------------------------------------------


def test_disabled_and_enabled_with_bound_meshes(fresh_scene, character):
    """Switched off, Blender's own modifier deforms, as in a file opened without it; then it goes on."""
    ob, twin, _ = character
    package = bpy.types.VIEW3D_PT_sinew.__module__.rpartition(".ui.")[0]
    try:
        bpy.ops.preferences.addon_disable(module=package)
        for frame in (8, 4):
            fresh_scene.frame_set(frame)
            assert_same_shape(ob, twin)
    finally:
        bpy.ops.preferences.addon_enable(module=package)
    for frame in (6, 2):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)
    assert way(ob) == "ATTRIBUTE"
    select(ob)
    bpy.ops.object.sinew_unbind()
    assert traces() == []
    fresh_scene.frame_set(7)
    assert_same_shape(ob, twin)


@needs_memory
@pytest.mark.says_errors
def test_an_error_in_one_mesh_leaves_the_others_alone(fresh_scene, character, caplog, monkeypatch):
    """Blender's own modifier deforms that one."""
    ob, twin, armature = character
    broken = make_mesh(armature, False)
    accelerate(broken)
    make_fail(monkeypatch, broken.name)
    other = twin_of(twin)
    accelerate(other)
    for frame in (5, 6, 7):
        fresh_scene.frame_set(frame)
        assert_same_shape(other, twin)
        assert_same_shape(broken, twin)
    said = [record for record in caplog.records if broken.name in record.getMessage()]
    assert len(said) == 1
    assert "told to fail" in addon_module("run.characters").character(broken).status.error
    select(broken)
    bpy.ops.object.sinew_unbind()
    fresh_scene.frame_set(8)
    assert_same_shape(broken, twin)


def test_as_many_objects_come_as_go(fresh_scene, character, tmp_path):
    """A bound mesh is found though the file has as many objects as before."""
    names = [ob.name for ob in character]
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    for name in "abc":
        bpy.context.collection.objects.link(bpy.data.objects.new(name, None))
    bpy.context.scene.frame_set(1)
    for name in "abc":
        bpy.data.objects.remove(bpy.data.objects[name])
    with bpy.data.libraries.load(str(tmp_path / "saved.blend")) as (_, into):
        into.objects = names
    for ob in into.objects:
        bpy.context.collection.objects.link(ob)
    for frame in (3, 6, 9):
        bpy.context.scene.frame_set(frame)
        assert_same_shape(*into.objects[:2])
