"""Modifiers before the Armature modifier that make other vertices: a canvas evaluates them once, Sinew deforms their
result, and it is as that of a twin that Blender deforms."""

import ctypes

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, pose
from decorated import decorate, empty_at_a_vertex, of_result
from helpers import (
    add_hair,
    addon_module,
    address_of,
    assert_plays_without_the_addon,
    assert_same_hair,
    assert_same_shape,
    data_counts,
    depsgraph,
    evaluated,
    into_a_shot,
    needs_memory,
    reopened,
    select,
    shortcut_of,
    traces,
    twin_of,
    way,
)
from test_canvases import are_deforming, assert_all_same, bound, canvases
from test_render import add_camera, assert_same_pictures, pictures_of_both, with_motion_blur, with_persistent_data

pytestmark = pytest.mark.skipif(bpy.app.version < (4, 1, 0), reason="left to Blender in this version")


def front(ob, kind, **settings):
    """Adds a modifier before the Armature modifier."""
    modifier = ob.modifiers.new(kind.title(), kind)
    for name, value in settings.items():
        setattr(modifier, name, value)
    ob.modifiers.move(ob.modifiers.find(modifier.name), ob.modifiers.find("Armature"))
    return modifier


def character_with(*fronts, add=None):
    """[(object, its twin)]: not bound yet. fronts: (type, settings)."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    ob.parent = armature
    for frame in (1, 4, 7, 10):
        pose(armature, frame, False)
    for kind, settings in fronts:
        front(ob, kind, **settings)
    if add is not None:
        add(ob)
    return [(ob, twin_of(ob))]


def mirrored(ob):
    """Half of the groups are for the other side."""
    ob.vertex_groups["bone2"].name = "bone2.L"
    ob.vertex_groups.new(name="bone2.R")
    rig = ob.modifiers["Armature"].object
    rig.data.bones["bone2"].name = "bone2.L"
    rig.data.bones["side"].name = "bone2.R"


TABLE = {
    "subdivision": [("SUBSURF", {"levels": 1})],
    "simple subdivision": [("SUBSURF", {"levels": 1, "subdivision_type": "SIMPLE"})],
    "mirror": [("MIRROR", {"use_axis": (True, False, False), "use_clip": True})],
    "mirror twice": [("MIRROR", {"use_axis": (True, True, False)})],
    "weld": [("WELD", {"merge_threshold": 0.05})],
    "triangulate": [("TRIANGULATE", {})],
    "solidify": [("SOLIDIFY", {"thickness": 0.1})],
    "mask": [("MASK", {"vertex_group": "bone2"})],
    "bevel": [("BEVEL", {"width": 0.02})],
    "edge split": [("EDGE_SPLIT", {"split_angle": 0.1})],
    "decimate": [("DECIMATE", {"ratio": 0.5})],
    "array": [("ARRAY", {"count": 2})],
    "two": [("MIRROR", {"use_axis": (True, False, False)}), ("SUBSURF", {"levels": 1})],
    "mirror merged": [("MIRROR", {"use_axis": (True, False, False), "merge_threshold": 0.3})],
    "solid behind a collision": [("COLLISION", {}), ("SOLIDIFY", {"thickness": 0.1})],
    "only in renders": [("SUBSURF", {"levels": 1, "show_viewport": False}), ("TRIANGULATE", {})],
}


def hidden_byte(modifier, name):
    """A setting that Blender's API does not show."""
    return ctypes.c_byte.from_address(address_of(modifier, addon_module("host.members").MODIFIERS[modifier.type], name))


@needs_memory
@pytest.mark.parametrize("is_behind", (False, True), ids=("before", "behind"))
def test_a_mirror_from_before_3_0_keeps_its_order(fresh_scene, is_behind):
    """Blender merges its vertices in another order than those of a new one, and its API does not show that."""

    def make_old(ob):
        for modifier in ob.modifiers:
            if modifier.type == "MIRROR":
                hidden_byte(modifier, "use_correct_order_on_merge").value = 0
                if is_behind:
                    ob.modifiers.move(ob.modifiers.find(modifier.name), len(ob.modifiers) - 1)

    ours, new = (character_with(*TABLE["mirror merged"], add=add)[0] for add in (make_old, None))
    shapes = [evaluated(each[1]) for each in (ours, new)]
    assert is_behind or not np.array_equal(*shapes), "nothing shows the order"
    pairs = bound([ours])
    assert_all_same(pairs)
    assert are_deforming(pairs) == [True]


@needs_memory
@pytest.mark.parametrize("kind", sorted(addon_module("host.members").MODIFIERS))
def test_a_copy_of_a_modifier_has_what_the_api_does_not_show(fresh_scene, kind):
    modifiers, contract = addon_module("blender.modifiers"), addon_module("host.contract")
    own, other = (bpy.data.objects.new(name, bpy.data.meshes.new(name)) for name in ("own", "other"))
    modifier = own.modifiers.new("", kind)
    shown = modifiers.settings_of(modifier)
    regions = contract.plain_regions(
        addon_module("host.members").MODIFIERS[kind], *addon_module("host.modifier_memory")._WITHOUT
    )
    hidden = 0
    for offset, size in regions:
        for address in range(modifier.as_pointer() + offset, modifier.as_pointer() + offset + size):
            byte = ctypes.c_ubyte.from_address(address)
            before, byte.value = byte.value, byte.value ^ 1
            if modifiers.settings_of(modifier) == shown:
                made = modifiers.copy(modifier, other)
                assert modifiers.content_of(made) == modifiers.content_of(modifier)
                other.modifiers.clear()
                hidden += 1
            byte.value = before
    assert hidden > 0


@pytest.mark.parametrize("fronts", TABLE.values(), ids=TABLE.keys())
def test_the_same_shape(fresh_scene, fronts):
    pairs = bound(character_with(*fronts))
    assert_all_same(pairs)
    assert way(pairs[0][0]) == "CANVAS" and are_deforming(pairs) == [True]
    graph = depsgraph()
    assert shortcut_of(pairs[0][0], graph) is not None


@needs_memory
def test_mirrored_groups(fresh_scene):
    pairs = bound(character_with(("MIRROR", {"use_axis": (True, False, False)}), add=mirrored))
    assert_all_same(pairs)
    assert are_deforming(pairs) == [True]


@pytest.fixture(params=("SUBSURF", "MIRROR"))
def pairs(request, fresh_scene):
    settings = {"use_bisect_axis": (True, False, False)} if request.param == "MIRROR" else {}
    found = bound(character_with((request.param, settings)))
    assert_all_same(found, (2, 3, 4, 5))
    assert are_deforming(found) == [True]
    return found


@needs_memory
def test_all_that_a_mesh_has(pairs, fresh_scene):
    ob, twin = pairs[0]
    for each in pairs[0]:
        decorate(each)
    for frame in (2, 5, 6, 7, 8):
        fresh_scene.frame_set(frame)
        ours, theirs = of_result(ob), of_result(twin)
        assert ours.keys() == theirs.keys()
        assert [name for name in ours if name != "materials" and ours[name] != theirs[name]] == []
        assert_same_shape(ob, twin)
    assert are_deforming(pairs) == [True]
    evaluated = [each.evaluated_get(depsgraph()) for each in (ob, twin)]
    slots = [[slot.material.name.split(".")[0] for slot in each.material_slots] for each in evaluated]
    assert slots[0] == slots[1]


def move_a_vertex(ob):
    ob.data.vertices[20].co.z += 0.3
    ob.data.update()


def paint(ob):
    ob.vertex_groups[0].add(range(100), 0.4, "REPLACE")


def set_the_front(ob):
    modifier = ob.modifiers[0]
    if modifier.type == "SUBSURF":
        modifier.levels = 2
    else:
        modifier.use_axis = modifier.use_bisect_axis = (False, True, False)


def hide_the_front(ob):
    ob.modifiers[0].show_viewport = False


def add_to_the_front(ob):
    front(ob, "TRIANGULATE")


def remove_the_front(ob):
    ob.modifiers.remove(ob.modifiers[0])


def move_the_front(ob):
    ob.modifiers.move(0, len(ob.modifiers) - 1)


def map_it(ob):
    ob.data.uv_layers.new(name="New")


def rename_a_group(ob):
    ob.vertex_groups["bone1"].name = "elsewhere"


def make_solid_behind(ob):
    ob.modifiers.new("Solidify", "SOLIDIFY").thickness = 0.05


EDITS = (
    move_a_vertex,
    paint,
    set_the_front,
    hide_the_front,
    add_to_the_front,
    remove_the_front,
    move_the_front,
    map_it,
    rename_a_group,
    make_solid_behind,
)


@needs_memory
@pytest.mark.parametrize("edit", EDITS)
def test_an_edit_is_right_at_once(pairs, edit):
    for each in pairs[0]:
        edit(each)
    bpy.context.view_layer.update()
    tolerance = 5e-5 if edit is make_solid_behind else 1e-5  # it magnifies, by normals of small faces
    for frame in (5, *range(1, 11)):
        bpy.context.scene.frame_set(frame)
        assert_same_shape(*pairs[0], tolerance)
    assert are_deforming(pairs) == [True]
    if edit is not move_the_front:
        assert of_result(pairs[0][0]).keys() == of_result(pairs[0][1]).keys()


@needs_memory
def test_an_edit_on_each_frame_is_left_to_blender(pairs, fresh_scene):
    """It renews nothing until the mesh has stayed as it is for an evaluation."""
    ob = pairs[0][0]
    copied = ob.sinew.canvas.data
    for frame in range(1, 8):
        for each in pairs[0]:
            each.data.vertices[3].co.x += 0.01
            each.data.update()
        assert_all_same(pairs, (frame,))
        assert are_deforming(pairs) == [False] and ob.sinew.canvas.data == copied
    assert_all_same(pairs)
    assert are_deforming(pairs) == [True]


@needs_memory
def test_the_armature_is_moved_and_posed(pairs):
    rig = pairs[0][0].modifiers["Armature"].object
    rig.location.x = 1
    rig.pose.bones["bone1"].rotation_quaternion = (0.5, 0.5, 0.5, 0.5)
    bpy.context.view_layer.update()
    for ob, twin in pairs:
        assert_same_shape(ob, twin)
    assert are_deforming(pairs) == [True]


def test_undo_and_redo(fresh_scene):
    names = [each.name for each in character_with(("SUBSURF", {"levels": 1}))[0]]

    def check(kind=None):
        pairs = [tuple(bpy.data.objects[name] for name in names)]
        assert_all_same(pairs, (2, 5, 3, 6))
        if kind is not None:
            assert way(pairs[0][0]) == kind and are_deforming(pairs) == [True]
        return pairs[0]

    bpy.ops.ed.undo_push(message="free")
    accelerate(check()[0])
    bpy.ops.ed.undo_push(message="bound")
    for each in check("CANVAS"):
        each.modifiers[0].levels = 2
    bpy.ops.ed.undo_push(message="levels")
    for each in check("CANVAS"):
        move_a_vertex(each)
    bpy.ops.ed.undo_push(message="moved")
    check("CANVAS")
    for _ in range(2):
        for _step in range(2):
            bpy.ops.ed.undo()
            check("CANVAS")
        bpy.ops.ed.undo()
        assert not check()[0].sinew.is_bound and canvases() == []
        for _step in range(3):
            bpy.ops.ed.redo()
            check("CANVAS")
    assert len(canvases()) == 1


@needs_memory
@pytest.mark.parametrize("is_linked", (False, True))
def test_duplicated(pairs, is_linked):
    ob, twin = pairs[0]
    select(ob)
    bpy.ops.object.duplicate(linked=is_linked)
    found = [*pairs, (bpy.context.active_object, twin)]
    assert_all_same(found)
    assert [way(each) for each, _twin in found] == ["CANVAS"] * 2 and len(canvases()) == 2
    assert are_deforming(found) == [True] * 2
    bpy.data.objects.remove(found[1][0])
    bpy.context.view_layer.update()
    assert_all_same(pairs)
    assert way(ob) == "CANVAS" and len(canvases()) == 1 and are_deforming(pairs) == [True]
    assert ob.data.users == 1


def test_unbound_nothing_is_left(fresh_scene):
    pairs = character_with(("SUBSURF", {"levels": 1}))
    before = data_counts()
    bound(pairs)
    assert_all_same(pairs, (2, 5, 3, 4))
    select(pairs[0][0])
    bpy.ops.object.sinew_unbind()
    assert traces() == [] and data_counts() == before
    assert_all_same(pairs, (3, 6))


def apply_to(pairs, name):
    for each in pairs[0]:
        select(each)
        if name in each.modifiers:
            bpy.ops.object.modifier_apply(modifier=name)
    bpy.context.view_layer.update()


@needs_memory
def test_the_front_is_applied(pairs):
    apply_to(pairs, pairs[0][0].modifiers[0].name)
    assert_all_same(pairs)
    assert way(pairs[0][0]) == "ATTRIBUTE" and canvases() == []


@needs_memory
def test_the_shape_is_applied(pairs, fresh_scene):
    ob, twin = pairs[0]
    select(ob)
    bpy.ops.object.modifier_apply(modifier=ob.modifiers[0].name)
    bpy.ops.object.modifier_apply(modifier="Armature")
    bpy.context.view_layer.update()
    assert not ob.sinew.is_bound and canvases() == []
    assert_same_shape(ob, twin)


@needs_memory
@pytest.mark.parametrize("mode", ("EDIT", "SCULPT", "WEIGHT_PAINT", "VERTEX_PAINT", "TEXTURE_PAINT"))
def test_modes(pairs, mode):
    ob, twin = pairs[0]
    select(ob)
    bpy.ops.object.mode_set(mode=mode)
    if mode != "EDIT":
        assert_all_same(pairs, (4, 5))
        assert are_deforming(pairs) == [False]
    bpy.ops.object.mode_set(mode="OBJECT")
    assert_all_same(pairs, (6, 7, 8))
    assert are_deforming(pairs) == [True]


@needs_memory
def test_saved_and_opened(pairs, tmp_path):
    pairs = [tuple(reopened(tmp_path, *pairs[0]))]
    assert_all_same(pairs)
    assert way(pairs[0][0]) == "CANVAS" and are_deforming(pairs) == [True] and len(canvases()) == 1


@needs_memory
def test_it_plays_without_the_addon(pairs, tmp_path):
    assert_plays_without_the_addon(tmp_path, *pairs[0])


@needs_memory
@pytest.mark.parametrize("set_up", (with_motion_blur, with_persistent_data))
def test_rendered(pairs, fresh_scene, tmp_path, set_up):
    for each in pairs[0]:
        if each.modifiers[0].type == "SUBSURF":
            each.modifiers[0].render_levels = 2
    add_camera(fresh_scene)
    fresh_scene.camera.location = (0, -12, 2.5)
    set_up(fresh_scene)
    assert_same_pictures(*pictures_of_both(fresh_scene, tmp_path, *pairs[0]))


LEFT = {
    "wave": ([("WAVE", {})], None, "comes before Armature, with which Sinew has to begin"),
    "wave behind": (
        [("SOLIDIFY", {}), ("WAVE", {})],
        None,
        "Wave comes before Armature, with which Sinew has to begin: move Wave behind Armature",
    ),
    "collision behind": ([("SOLIDIFY", {}), ("COLLISION", {})], None, "Collision comes before Armature"),
    "keys": ([("SUBSURF", {"levels": 1})], add_shape_keys, "comes before Armature, with which Sinew has to begin"),
    "animated": (
        [("SOLIDIFY", {})],
        lambda ob: ob.modifiers[0].keyframe_insert("thickness", frame=1),
        "it is animated",
    ),
    "driven": ([("SOLIDIFY", {})], lambda ob: ob.modifiers[0].driver_add("thickness"), "it is animated"),
    "mirror object": (
        [("MIRROR", {})],
        lambda ob: setattr(ob.modifiers[0], "mirror_object", ob.parent),
        "it depends on another object",
    ),
    "custom profile": ([("BEVEL", {"profile_type": "CUSTOM"})], None, "it has a curve of its own"),
}


@pytest.mark.parametrize("fronts, add, reason", LEFT.values(), ids=LEFT.keys())
def test_what_is_left_to_blender(fresh_scene, fronts, add, reason):
    pairs = bound(character_with(*fronts, add=add))
    assert_all_same(pairs)
    assert way(pairs[0][0]) == "BLENDER" and canvases() == []
    assert reason in addon_module("run.characters").character(pairs[0][0]).way.reason


@needs_memory
def test_it_becomes_animated(pairs, fresh_scene):
    for each in pairs[0]:
        each.modifiers[0].driver_add("show_viewport")
    assert_all_same(pairs)
    assert way(pairs[0][0]) == "BLENDER" and canvases() == []


@needs_memory
def test_the_output_mesh_is_refused(fresh_scene):
    ob = character_with(("SUBSURF", {}))[0][0]
    select(ob)
    with pytest.raises(RuntimeError, match="cannot use the output Mesh, because Subsurf makes other vertices"):
        bpy.ops.object.sinew_bind(output="MESH")
    assert not ob.sinew.is_bound


@needs_memory
def test_the_scene_is_simplified(fresh_scene):
    pairs = bound(character_with(("SUBSURF", {"levels": 2})))
    assert_all_same(pairs, (2, 3, 4, 5))
    render = fresh_scene.render
    for settings in (
        {"use_simplify": True, "simplify_subdivision": 1},
        {"simplify_subdivision": 0},
        {"use_simplify": False},
        {"simplify_subdivision": 2},
    ):
        for name, value in settings.items():
            setattr(render, name, value)
        bpy.context.view_layer.update()
        assert_same_shape(*pairs[0])
        assert_all_same(pairs, (6, 7, 8, 9))
        assert are_deforming(pairs) == [True]


@needs_memory
@pytest.mark.parametrize("overridden", (False, True), ids=("linked", "overridden"))
def test_bound_in_a_library(pairs, tmp_path, overridden):
    collection = bpy.data.collections.new("Character")
    for each in (*pairs[0], pairs[0][0].parent):
        bpy.context.collection.objects.unlink(each)
        collection.objects.link(each)
    bpy.context.scene.collection.children.link(collection)
    names = [each.name for each in pairs[0]]
    scene = into_a_shot(tmp_path, overridden)
    pairs = [tuple(next(each for each in scene.objects if each.name == name) for name in names)]
    assert all((each.override_library if overridden else each.library) is not None for each in pairs[0])
    assert_all_same(pairs)
    assert way(pairs[0][0]) == "CANVAS" and are_deforming(pairs) == [True]
    scene.frame_set(3)
    if overridden:
        pairs[0][0].parent.location.x = 1
        bpy.context.view_layer.update()
        assert_all_same(pairs, (4, 5, 6))
        assert are_deforming(pairs) == [True]


@needs_memory
def test_the_file_has_the_base_mesh_twice_at_most(pairs):
    canvas = pairs[0][0].sinew.canvas
    assert len(canvas.data.vertices) == len(pairs[0][0].data.vertices)
    assert canvas.users_scene == () and canvas.data.users == 1 and pairs[0][0].data.users == 1


@needs_memory
def test_a_new_graph_begins_with_the_result_at_once(pairs, fresh_scene):
    """Its evaluated objects may be where those of an earlier one were."""
    ob, twin = pairs[0]
    characters = addon_module("run.characters")
    for number in range(6):
        layer = fresh_scene.view_layers.new(str(number))
        layer.update()
        evaluated = [each.evaluated_get(layer.depsgraph).data for each in (ob, twin)]
        ours, theirs = (addon_module("blender.meshes").read_positions(mesh) for mesh in evaluated)
        assert ours.shape == theirs.shape and np.abs(ours - theirs).max() < 1e-4
        assert characters.character(ob).copy_of(ob.evaluated_get(layer.depsgraph)).is_deforming
        fresh_scene.view_layers.remove(layer)


@pytest.mark.parametrize("later", (False, True))
def test_children_of_vertices(fresh_scene, later):
    """Blender averages all vertices that were made from that one."""
    pairs = character_with(("MIRROR", {"use_axis": (True, False, False)}))
    if later:
        bound(pairs)
        assert_all_same(pairs, (2, 3, 4, 5))
    empties = [empty_at_a_vertex(each, 700) for each in pairs[0]]
    bpy.context.view_layer.update()
    if not later:
        bound(pairs)
    for frame in (5, 2, 3, 4, 6):
        if frame != 5:
            fresh_scene.frame_set(frame)
        places = [np.array(each.evaluated_get(depsgraph()).matrix_world.translation) for each in empties]
        assert np.abs(places[0] - places[1]).max() < 1e-4
    assert way(pairs[0][0]) == "BLENDER"


@needs_memory
def test_particles(pairs):
    for each in pairs[0]:
        add_hair(each)
    bpy.context.view_layer.update()
    assert_same_hair(*pairs[0])
    assert_all_same(pairs, (2, 3))
    assert way(pairs[0][0]) == "BLENDER"


def test_another_armature_behind(fresh_scene):
    """It is replaced as well."""

    def add(ob):
        rig = make_armature()
        rig.rotation_euler.x = 0.2
        for frame in (1, 10):
            pose(rig, frame, False)
        ob.modifiers.new("Second", "ARMATURE").object = rig

    pairs = bound(character_with(("SUBSURF", {"levels": 1}), add=add))
    assert_all_same(pairs)
    assert way(pairs[0][0]) == "CANVAS" and are_deforming(pairs) == [True]
    assert addon_module("run.characters").character(pairs[0][0]).run.stages == ("Second",)
