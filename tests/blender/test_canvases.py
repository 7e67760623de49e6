"""Several objects have one mesh: each is deformed through a canvas of its own, as its twin with its own mesh."""

import bmesh
import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, pose
from decorated import decorate, empty_at_a_vertex, of_result
from helpers import (
    add_hair,
    addon_module,
    assert_plays_without_the_addon,
    assert_same_hair,
    assert_same_shape,
    data_counts,
    depsgraph,
    evaluated,
    into_a_shot,
    needs_memory,
    override,
    reopened,
    select,
    shortcut_of,
    traces,
    twin_of,
    way,
)
from test_render import add_camera, assert_same_pictures, render_frames, with_motion_blur, with_persistent_data


def family(count=3, add_modifier=None):
    """[(object, its twin with a mesh of its own)]: the objects share a mesh; each has another place, so that their
    shapes differ, as the armature does not move with them."""
    armature = make_armature()
    first = make_mesh(armature, False)
    for frame in (1, 4, 7, 10):
        pose(armature, frame, False)
    if add_modifier is not None:
        add_modifier(first)
    objects = [first]
    for number in range(1, count):
        copy = first.copy()
        bpy.context.collection.objects.link(copy)
        copy.location.x = 0.3 * number
        objects.append(copy)
    twins = [twin_of(ob) for ob in objects]
    return list(zip(objects, twins))


def bound(pairs):
    for ob, _twin in pairs:
        accelerate(ob)
    return pairs


def assert_all_same(pairs, frames=range(1, 11)):
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        for ob, twin in pairs:
            assert_same_shape(ob, twin)


def canvases():
    return [ob for ob in bpy.data.objects if addon_module("blender.nodes").is_canvas(ob)]


def are_deforming(pairs):
    characters = addon_module("run.characters")
    return [characters.character(ob).is_deforming for ob, _twin in pairs]


def takes_all(ob):
    """Whether all of an object's result is that of its canvas."""
    modifier = addon_module("blender.nodes").find_modifier(ob)
    return addon_module("blender.nodes").reads_front(modifier)


@pytest.fixture
def pairs(fresh_scene):
    found = bound(family())
    fresh_scene.frame_set(3)
    assert [way(ob) for ob, _twin in found] == ["CANVAS"] * 3 and len(canvases()) == 3
    return found


def test_each_has_its_own_shape(pairs):
    assert_all_same(pairs)
    assert are_deforming(pairs) == [True] * 3
    shapes = [evaluated(ob) for ob, _twin in pairs]
    assert np.abs(shapes[0] - shapes[1]).max() > 0.01


def test_the_fast_path_watches_the_canvas(pairs):
    assert_all_same(pairs)
    graph = bpy.context.evaluated_depsgraph_get()
    assert all(shortcut_of(ob, graph) is not None for ob, _twin in pairs)
    for block in (pairs[0][0].data, *(twin.data for _ob, twin in pairs)):
        block.vertices[7].co.x += 0.2
        block.update()
    assert_all_same(pairs, (4, 5, 6, 7, 8, 9))
    assert are_deforming(pairs) == [True] * 3


@needs_memory
def test_armatures_of_their_own(fresh_scene):
    pairs = family(2)
    other = make_armature()
    other.location.z = 0.5
    for frame in (1, 5, 10):
        pose(other, frame, False)
    for ob in pairs[1]:
        ob.modifiers["Armature"].object = other
    bound(pairs)
    assert_all_same(pairs)
    assert are_deforming(pairs) == [True] * 2


@needs_memory
def test_modifiers_behind_it(fresh_scene):
    def add(ob):
        ob.modifiers.new("Corrective", "CORRECTIVE_SMOOTH").iterations = 3
        ob.modifiers.new("Subdivision", "SUBSURF").levels = 1

    pairs = family(2, add)
    bound(pairs)
    assert_all_same(pairs)
    assert addon_module("run.characters").character(pairs[0][0]).run.stages == ("Corrective",)


def test_only_one_of_them_is_bound(fresh_scene):
    pairs = family()
    accelerate(pairs[1][0])
    assert_all_same(pairs)
    assert way(pairs[1][0]) == "CANVAS" and len(canvases()) == 1


def edit_weights(mesh, ob):
    ob.vertex_groups[0].add(range(100), 0.4, "REPLACE")


def edit_vertices(mesh, _ob):
    mesh.vertices[20].co.z += 0.3
    mesh.update()


def remove_vertices(mesh, _ob):
    bm = bmesh.new()
    bm.from_mesh(mesh)
    bmesh.ops.delete(bm, geom=list(bm.verts)[30:60], context="VERTS")
    bm.to_mesh(mesh)
    bm.free()


def rename_a_group(_mesh, ob):
    ob.vertex_groups["bone1"].name = "elsewhere"


@pytest.mark.parametrize("edit", (edit_weights, edit_vertices, remove_vertices, rename_a_group))
def test_an_edit_is_right_at_once(pairs, edit):
    assert_all_same(pairs)
    edit(pairs[0][0].data, pairs[0][0])
    for _ob, twin in pairs:
        edit(twin.data, twin)
    bpy.context.view_layer.update()
    assert_all_same(pairs, (bpy.context.scene.frame_current,))
    assert_all_same(pairs)
    assert are_deforming(pairs) == [True] * 3


def test_undo_and_redo(fresh_scene):
    pairs = bound(family(1))
    ob, twin = pairs[0]
    name, twin_name = ob.name, twin.name
    bpy.ops.ed.undo_push(message="one")
    fresh_scene.frame_set(2)
    assert way(ob) == "ATTRIBUTE"
    select(ob)
    bpy.ops.object.duplicate(linked=True)
    second = bpy.context.active_object.name
    bpy.ops.ed.undo_push(message="two")

    def check(names, kind, frames=(5, 2, 6)):
        found = [(bpy.data.objects[each], bpy.data.objects[twin_name]) for each in names]
        assert_all_same(found, frames)
        assert [way(each) for each, _twin in found] == [kind] * len(names)
        assert all(are_deforming(found))

    for _ in range(3):
        check((name, second), "CANVAS")
        bpy.ops.ed.undo()
        assert second not in bpy.data.objects
        check((name,), "ATTRIBUTE")
        bpy.ops.ed.redo()
    bpy.data.objects[name].data.vertices[5].co.x += 0.2
    bpy.data.objects[twin_name].data.vertices[5].co.x += 0.2
    bpy.ops.ed.undo_push(message="moved")
    check((name, second), "CANVAS")
    bpy.ops.ed.undo()
    check((name, second), "CANVAS")
    bpy.ops.ed.redo()
    check((name, second), "CANVAS")
    assert len(canvases()) == 2


def test_shared_and_single_again(fresh_scene):
    pairs = bound(family(2))
    (first, twin), (second, _) = pairs
    assert_all_same(pairs, (2, 3))
    bpy.data.objects.remove(second)
    bpy.context.view_layer.update()
    fresh_scene.frame_set(4)
    assert_same_shape(first, twin)
    assert way(first) == "ATTRIBUTE" and canvases() == [] and first.data.users == 1
    third = first.copy()
    bpy.context.collection.objects.link(third)
    pairs = [(first, twin), (third, twin)]
    assert_all_same(pairs)
    assert [way(ob) for ob, _twin in pairs] == ["CANVAS"] * 2 and len(canvases()) == 2
    select(third)
    assert bpy.ops.object.make_single_user(object=True, obdata=True, type="SELECTED_OBJECTS") == {"FINISHED"}
    assert_all_same(pairs)
    assert [way(ob) for ob, _twin in pairs] == ["ATTRIBUTE"] * 2 and canvases() == []


def test_duplicated_with_its_mesh(pairs):
    (first, twin) = pairs[0]
    select(first)
    bpy.ops.object.duplicate(linked=False)
    copy = bpy.context.active_object
    found = [*pairs, (copy, twin)]
    assert_all_same(found)
    assert way(copy) == "ATTRIBUTE" and len(canvases()) == 3


def test_the_mesh_is_replaced(pairs):
    (first, twin) = pairs[0]
    first.data = first.data.copy()
    assert_all_same(pairs)
    assert way(first) == "ATTRIBUTE" and len(canvases()) == 2
    first.data = pairs[1][0].data
    assert_all_same(pairs)
    assert way(first) == "CANVAS" and len(canvases()) == 3


def test_unbound_nothing_is_left(fresh_scene):
    pairs = family()
    before = data_counts()
    bound(pairs)
    assert_all_same(pairs, (2, 5))
    for ob, _twin in pairs:
        select(ob)
        bpy.ops.object.sinew_unbind()
    assert traces() == [] and data_counts() == before
    assert_all_same(pairs, (3, 6))


@pytest.mark.parametrize("name", ("Armature", "Sinew"))
def test_a_modifier_is_applied(pairs, name):
    (first, twin) = pairs[0]
    assert_all_same(pairs, (2, 5))
    select(first)
    bpy.ops.object.modifier_apply(modifier=name, single_user=True)
    bpy.context.view_layer.update()
    assert not first.sinew.is_bound
    assert_same_shape(first, twin)
    assert_all_same(pairs[1:])
    assert len(canvases()) == 2


def reopened_pairs(folder, pairs):
    objects = reopened(folder, *(ob for both in pairs for ob in both))
    return list(zip(objects[::2], objects[1::2]))


def test_saved_and_opened(pairs, tmp_path):
    assert_all_same(pairs, (2, 3))
    pairs = reopened_pairs(tmp_path, pairs)
    assert_all_same(pairs)
    assert [way(ob) for ob, _twin in pairs] == ["CANVAS"] * 3 and len(canvases()) == 3
    assert are_deforming(pairs) == [True] * 3


def test_it_plays_without_the_addon(pairs, tmp_path):
    assert_plays_without_the_addon(tmp_path, *pairs[1])


def test_appended(pairs, tmp_path):
    path = str(tmp_path / "library.blend")
    names = [each.name for both in pairs for each in both]
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(path) as (_, to):
        to.objects = names
    for ob in to.objects:
        bpy.context.collection.objects.link(ob)
    pairs = list(zip(to.objects[::2], to.objects[1::2]))
    assert_all_same(pairs)
    assert [way(ob) for ob, _twin in pairs] == ["CANVAS"] * 3 and len(canvases()) == 3


@pytest.mark.parametrize("is_bound", (False, True), ids=("bound in the shot", "bound in the library"))
@pytest.mark.parametrize("count", (1, 2), ids=("one mesh each", "shared in the library"))
def test_several_overrides_of_one_character(fresh_scene, tmp_path, is_bound, count):
    pairs = family(count)
    if is_bound:
        bound(pairs)
        assert_all_same(pairs, (2, 3))
    collection = bpy.data.collections.new("Character")
    for each in [ob for ob in fresh_scene.objects if ob.type in {"MESH", "ARMATURE"}]:
        for other in each.users_collection:
            other.objects.unlink(each)
        collection.objects.link(each)
    fresh_scene.collection.children.link(collection)
    names = [(ob.name, twin.name) for ob, twin in pairs]
    into_a_shot(tmp_path, overridden=True)
    linked = next(each for each in bpy.data.collections if each.library is not None and each.name == "Character")
    for _ in range(2):
        override(linked)
    found = []
    for each in bpy.data.collections:
        if each.library is None and each.override_library is not None:
            by_name = {ob.override_library.reference.name: ob for ob in each.all_objects if ob.override_library}
            if all(name in by_name for both in names for name in both):
                found.append([(by_name[ob], by_name[twin]) for ob, twin in names])
    assert len(found) == 3
    for number, extra in enumerate(found):
        rig = extra[0][0].modifiers["Armature"].object
        assert rig.library is None
        rig.location.x = number
    pairs = [both for extra in found for both in extra]
    if not is_bound:
        for ob, _twin in pairs:
            accelerate(ob)
    assert_all_same(pairs)
    assert [way(ob) for ob, _twin in pairs] == ["CANVAS"] * len(pairs)
    assert all(are_deforming(pairs))
    pairs = reopened_pairs(tmp_path, pairs)
    assert_all_same(pairs)
    assert all(are_deforming(pairs))
    assert len([each for each in canvases() if each.library is None]) <= len(pairs)


def test_shape_keys_are_left_to_blender(fresh_scene):
    pairs = family(1)
    for ob in pairs[0]:
        add_shape_keys(ob)
    ob, twin = pairs[0]
    copy = ob.copy()
    bpy.context.collection.objects.link(copy)
    accelerate(ob)
    assert_all_same([(ob, twin), (copy, twin)])
    assert way(ob) == "BLENDER" and canvases() == []
    assert "make it single-user" in addon_module("run.characters").character(ob).way.reason


def test_modes(pairs):
    """The tools of the modes for editing and painting need to know which vertex each one was made from."""
    first = pairs[0][0]
    select(first)
    for mode in ("EDIT", "SCULPT", "WEIGHT_PAINT", "VERTEX_PAINT"):
        bpy.ops.object.mode_set(mode=mode)
        if mode != "EDIT":
            assert_all_same(pairs, (4, 5))
            is_ours = mode in {"WEIGHT_PAINT", "VERTEX_PAINT"} and not takes_all(first)
            assert are_deforming(pairs) == [is_ours, True, True]
        bpy.ops.object.mode_set(mode="OBJECT")
        assert_all_same(pairs, (6, 7))
    assert all(are_deforming(pairs))


IN_ALL = bpy.app.version >= (4, 1, 0)  # before, only the positions are a canvas's


def test_all_that_a_mesh_has(pairs, fresh_scene):
    for each in (pairs[0][0], *(twin for _ob, twin in pairs)):  # the objects share a mesh
        decorate(each)
    for frame in (2, 5, 6, 7):
        fresh_scene.frame_set(frame)
        for ob, twin in pairs:
            ours, theirs = of_result(ob), of_result(twin)
            assert ours.keys() == theirs.keys()
            assert [name for name in ours if name != "materials" and ours[name] != theirs[name]] == []
            assert_same_shape(ob, twin)
    assert are_deforming(pairs) == [True] * 3
    assert [takes_all(ob) for ob, _twin in pairs] == [IN_ALL] * 3


def test_a_child_of_a_vertex(pairs, fresh_scene):
    """Blender has to find the vertex of the mesh in the result."""
    empties = [empty_at_a_vertex(each, 70) for each in pairs[1]]
    for frame in (5, 2, 3, 4, 6):
        fresh_scene.frame_set(frame)
        places = [np.array(each.evaluated_get(depsgraph()).matrix_world.translation) for each in empties]
        assert np.abs(places[0] - places[1]).max() < 1e-4
    assert_all_same(pairs, (7, 8))
    assert are_deforming(pairs) == [True] * 3
    assert [takes_all(ob) for ob, _twin in pairs] == [IN_ALL, False, IN_ALL]


def test_particles(pairs):
    for each in pairs[0]:
        add_hair(each)
    bpy.context.view_layer.update()
    assert_same_hair(*pairs[0])
    assert_all_same(pairs, (2, 3))
    assert are_deforming(pairs) == [True] * 3
    assert [takes_all(ob) for ob, _twin in pairs] == [False, IN_ALL, IN_ALL]


@needs_memory
def test_the_output_mesh(fresh_scene):
    pairs = family(2)
    select(pairs[0][0])
    bpy.ops.object.sinew_bind(output="MESH")
    accelerate(pairs[1][0])
    for frame in (2, 5, 7):
        fresh_scene.frame_set(frame)
        for ob, twin in pairs:
            assert_same_shape(ob, twin)
        copy = pairs[0][0].sinew.deformed
        assert_same_shape(copy, pairs[0][1])


@pytest.mark.parametrize("set_up", (with_motion_blur, with_persistent_data))
def test_rendered(fresh_scene, tmp_path, set_up):
    pairs = family(2)
    pairs[1][0].location = pairs[1][1].location = (1.5, 0, 0)
    bound(pairs)
    add_camera(fresh_scene)
    fresh_scene.camera.location = (0, -12, 2.5)
    set_up(fresh_scene)
    pictures = []
    for shown in (0, 1):
        for both in pairs:
            for number, each in enumerate(both):
                each.hide_render = number != shown
        (tmp_path / str(shown)).mkdir()
        pictures.append(render_frames(fresh_scene, tmp_path / str(shown), True))
    assert_same_pictures(*pictures)


@needs_memory
@pytest.mark.parametrize("with_front", (False, True), ids=("plain", "with a front"))
def test_eight_objects_and_many_edits(fresh_scene, with_front):
    """Blender evaluates them at the same time."""
    pairs = family(8)
    if with_front and bpy.app.version >= (4, 1, 0):
        for each in (each for both in pairs for each in both):
            each.modifiers.new("Triangulate", "TRIANGULATE")
            each.modifiers.move(1, 0)
    bound(pairs)
    random = np.random.default_rng(4)
    for number in range(30):
        if number % 3:
            vertex, move = int(random.integers(1200)), random.uniform(-0.1, 0.1, 3)
            for mesh in (pairs[0][0].data, *(twin.data for _ob, twin in pairs)):
                mesh.vertices[vertex].co.x += move[0]
                mesh.update()
        else:
            for mesh_object in (pairs[0][0], *(twin for _ob, twin in pairs)):
                mesh_object.vertex_groups[number % 5].add([number], 0.7, "REPLACE")
        bpy.context.view_layer.update()
        assert_all_same(pairs, (1 + number % 10,))
    assert_all_same(pairs, (2, 3, 4, 5))
    assert are_deforming(pairs) == [True] * 8
