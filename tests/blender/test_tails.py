"""Modifiers behind those that deform whose vertices are weighted sums: Sinew finds the sums and makes the vertices, and
the shape is as that of a twin that Blender deforms, with all that its mesh has."""

import itertools
from random import Random

import bmesh
import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, pose
from decorated import decorate, of_result
from helpers import (
    addon_module,
    assert_plays_without_the_addon,
    assert_same_shape,
    data_counts,
    depsgraph,
    end,
    evaluated,
    needs_memory,
    needs_rig_programs,
    reopened,
    select,
    shortcut_of,
    traces,
    twin_of,
    way,
)
from test_canvases import are_deforming, assert_all_same, bound, canvases
from test_panel import draw
from test_render import add_camera, assert_same_pictures, pictures_of_both, with_motion_blur, with_persistent_data
from test_stencils import TAILS, add_modifiers, make_rough

pytestmark = pytest.mark.skipif(bpy.app.version < (4, 1, 0), reason="left to Blender in this version")
BEHIND = "UV_WARP", {}  # for which Blender has to make the vertices before it
OTHERS = {"ARMATURE", "NODES", "CORRECTIVE_SMOOTH"}


@pytest.fixture(autouse=True)
def with_a_window(monkeypatch):
    """Where somebody looks, Blender need not make what a last Subdivision makes."""
    monkeypatch.setattr(addon_module("stencils.searching"), "IS_READ", False)


def character_with(*modifiers, add=None):
    """[(object, its twin)]: not bound. modifiers: (type, settings) behind the Armature modifier."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    ob.parent = armature
    for frame in (1, 4, 7, 10):
        pose(armature, frame, False)
    if add is not None:
        add(ob)
    add_modifiers(ob, modifiers)
    return [(ob, twin_of(ob))]


def find_stencils():
    """Plays so long that stencils are found, and that the fast path is taken."""
    for frame in range(28):
        bpy.context.scene.frame_set(1 + frame % 10)


def tail_of(ob):
    tail = addon_module("run.characters").character(ob).way.tail
    return tail and tail.names


def says(ob):
    return addon_module("stencils.searching").says(ob)


STACKS = {
    **{name: [*modifiers, BEHIND] for name, modifiers in TAILS.items()},
    "smoothed": [("CORRECTIVE_SMOOTH", {"iterations": 3}), ("SUBSURF", {"levels": 1}), BEHIND],
    "mask before a last subdivision": [("MASK", {"vertex_group": "side"}), ("SUBSURF", {"levels": 1})],
    "in front of a mirror": [("SUBSURF", {"levels": 1}), ("MIRROR", {"use_axis": (False, True, False)})],
    "in front of an array": [("EDGE_SPLIT", {"use_edge_angle": False}), ("ARRAY", {"count": 2})],
}


@pytest.mark.sampled(3)
@pytest.mark.parametrize("rough", (False, True), ids=("quads", "rough"))
@pytest.mark.parametrize("modifiers", STACKS.values(), ids=STACKS.keys())
def test_the_same_shape(fresh_scene, request, modifiers, rough):
    pairs = bound(character_with(*modifiers, add=make_rough if rough else None))
    ((ob, _twin),) = pairs
    assert_all_same(pairs, (1, 2, 3, 4, 5))
    assert way(ob) == "ATTRIBUTE" and tail_of(ob) is None and canvases() == []
    find_stencils()
    assert_all_same(pairs)
    if rough and "TRIANGULATE" == modifiers[0][0]:
        assert tail_of(ob) is None and "more than four corners" in says(ob)
        return
    kinds = [ob.modifiers[name].type for name in tail_of(ob)]
    wanted = [kind for kind, _settings in modifiers if kind in addon_module("blender.modifier_types").TAILS]
    is_left = modifiers[-1][0] == "SUBSURF" or "in front" in request.node.name
    assert kinds == (wanted[:-1] if is_left else wanted)
    assert way(ob) == "CANVAS" and len(canvases()) == 1 and are_deforming(pairs) == [True]
    assert shortcut_of(ob, depsgraph()) is not None and says(ob) == ""


PAIRS = {
    "with keys": [("SUBSURF", {"levels": 1, "render_levels": 1}), BEHIND],
    "subdivision": [("SUBSURF", {"levels": 1, "render_levels": 1}), BEHIND],
    "masked": [
        ("CORRECTIVE_SMOOTH", {"iterations": 2}),
        ("MASK", {"vertex_group": "side"}),
        ("SUBSURF", {"levels": 1}),
    ],
}


@pytest.fixture(params=PAIRS.items(), ids=PAIRS.keys())
def pairs(request, fresh_scene):
    name, modifiers = request.param
    found = bound(character_with(*modifiers, add=add_shape_keys if name == "with keys" else None))
    find_stencils()
    assert_all_same(found, (2, 3, 4, 5))
    assert are_deforming(found) == [True] and tail_of(found[0][0])
    return found


def first_of_tail(ob):
    return ob.modifiers[(tail_of(ob) or [next(each.name for each in ob.modifiers if each.type not in OTHERS)])[0]]


@needs_memory
def test_all_that_a_mesh_has(pairs, fresh_scene):
    ob, twin = pairs[0]
    for each in pairs[0]:
        decorate(each)
    find_stencils()
    assert tail_of(ob)
    for frame in (2, 5, 6, 7, 8):
        fresh_scene.frame_set(frame)
        ours, theirs = of_result(ob), of_result(twin)
        assert ours.keys() == theirs.keys()
        assert [name for name in ours if name != "materials" and ours[name] != theirs[name]] == []
        assert_same_shape(ob, twin)
    assert are_deforming(pairs) == [True]


def move_a_vertex(ob):
    ob.data.vertices[20].co.z += 0.3
    ob.data.update()


def paint(ob):
    ob.vertex_groups[0].add(range(100), 0.4, "REPLACE")


def mask_others(ob):
    ob.vertex_groups["side"].add(range(300), 0.9, "REPLACE")


def set_it(ob):
    modifier = ob.modifiers[first_name(ob)]
    if modifier.type == "SUBSURF":
        modifier.levels = 2
    else:
        modifier.invert_vertex_group = True


def first_name(ob):
    return next(each.name for each in ob.modifiers if each.type in {"SUBSURF", "MASK"})


def hide_it(ob):
    ob.modifiers[first_name(ob)].show_viewport = False


def add_to_it(ob):
    modifier = ob.modifiers.new("Triangulate", "TRIANGULATE")
    modifier.quad_method = "FIXED"
    ob.modifiers.move(ob.modifiers.find(modifier.name), ob.modifiers.find(first_name(ob)) + 1)


def remove_it(ob):
    ob.modifiers.remove(ob.modifiers[first_name(ob)])


def move_it(ob):
    ob.modifiers.move(ob.modifiers.find(first_name(ob)), 0)


def delete_faces(ob):
    mesh = bmesh.new()
    mesh.from_mesh(ob.data)
    bmesh.ops.delete(mesh, geom=list(mesh.faces)[:40], context="FACES")
    mesh.to_mesh(ob.data)
    mesh.free()


def crease(ob):
    attribute = ob.data.attributes.get("crease_edge") or ob.data.attributes.new("crease_edge", "FLOAT", "EDGE")
    for number, each in enumerate(attribute.data):
        each.value = 1.0 if number % 5 == 0 else 0.0
    ob.data.update()


def map_it(ob):
    ob.data.uv_layers.new(name="New")


def rename_a_group(ob):
    ob.vertex_groups["side"].name = "elsewhere"


def animate_it(ob):
    ob.modifiers[first_name(ob)].keyframe_insert("show_viewport", frame=1)


EDITS = (
    move_a_vertex,
    paint,
    mask_others,
    set_it,
    hide_it,
    add_to_it,
    remove_it,
    move_it,
    delete_faces,
    crease,
    map_it,
    rename_a_group,
    animate_it,
)


@needs_memory
@pytest.mark.sampled(3)
@pytest.mark.parametrize("edit", EDITS)
def test_an_edit_is_right_at_once(pairs, edit):
    for each in pairs[0]:
        edit(each)
    bpy.context.view_layer.update()
    for frame in (5, *range(1, 11)):
        bpy.context.scene.frame_set(frame)
        assert_same_shape(*pairs[0])
    find_stencils()
    assert_all_same(pairs)
    has_keys = pairs[0][0].data.shape_keys is not None  # and then all modifiers before the armature are Blender's
    assert are_deforming(pairs) == [not (has_keys and edit is move_it)]
    assert of_result(pairs[0][0]).keys() == of_result(pairs[0][1]).keys()


@needs_memory
def test_what_does_not_change_the_sums_needs_no_other_search(pairs, monkeypatch):
    monkeypatch.setattr(addon_module("stencils.searching"), "Search", None)
    for each in pairs[0]:
        move_a_vertex(each)
        map_it(each)
    bpy.context.view_layer.update()
    assert_all_same(pairs)
    assert tail_of(pairs[0][0]) and are_deforming(pairs) == [True]


@needs_memory
def test_undo_and_redo(fresh_scene):
    names = [each.name for each in character_with(*PAIRS["subdivision"])[0]]

    def check(is_bound=True):
        pairs = [tuple(bpy.data.objects[name] for name in names)]
        assert_all_same(pairs, (2, 5, 3, 6))
        find_stencils()
        assert_all_same(pairs, (2, 5, 3, 6))
        if is_bound:
            assert tail_of(pairs[0][0]) and are_deforming(pairs) == [True]
        return pairs[0]

    bpy.ops.ed.undo_push(message="free")
    accelerate(check(False)[0])
    bpy.ops.ed.undo_push(message="bound")
    for each in check():
        each.modifiers["SUBSURF"].levels = each.modifiers["SUBSURF"].render_levels = 2
    bpy.ops.ed.undo_push(message="levels")
    for each in check():
        delete_faces(each)
    bpy.ops.ed.undo_push(message="cut")
    check()
    for _ in range(2):
        for _step in range(2):
            bpy.ops.ed.undo()
            check()
        bpy.ops.ed.undo()
        assert not check(False)[0].sinew.is_bound and canvases() == []
        for _step in range(3):
            bpy.ops.ed.redo()
            check()
    assert len(canvases()) == 1


@needs_memory
@pytest.mark.parametrize("is_linked", (False, True))
def test_duplicated(pairs, is_linked):
    ob, twin = pairs[0]
    select(ob)
    bpy.ops.object.duplicate(linked=is_linked)
    found = [*pairs, (bpy.context.active_object, twin)]
    assert_all_same(found)
    find_stencils()
    assert_all_same(found)
    assert [bool(tail_of(each)) for each, _twin in found] == [not is_linked] * 2
    assert are_deforming(found) == [not is_linked or ob.data.shape_keys is None] * 2


@needs_memory
def test_unbound_nothing_is_left(fresh_scene):
    pairs = character_with(*PAIRS["subdivision"])
    before = data_counts()
    bound(pairs)
    find_stencils()
    assert tail_of(pairs[0][0]) and len(bpy.data.scenes) == 1
    select(pairs[0][0])
    bpy.ops.object.sinew_unbind()
    assert traces() == [] and data_counts() == before
    assert_all_same(pairs, (3, 6))


@needs_memory
@pytest.mark.parametrize("mode", ("EDIT", "SCULPT", "WEIGHT_PAINT", "VERTEX_PAINT", "TEXTURE_PAINT"))
def test_modes(pairs, mode):
    ob, _twin = pairs[0]
    select(ob)
    bpy.ops.object.mode_set(mode=mode)
    if mode != "EDIT":
        assert_all_same(pairs, (4, 5))
        assert are_deforming(pairs) == [False]
    bpy.ops.object.mode_set(mode="OBJECT")
    assert_all_same(pairs, (6, 7, 8))
    assert are_deforming(pairs) == [True] and tail_of(ob)


@needs_memory
def test_a_saved_file_has_none_of_it(pairs, tmp_path):
    ob, _twin = pairs[0]
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "copy.blend"), copy=True)
    with bpy.data.libraries.load(str(tmp_path / "copy.blend")) as (source, target):
        target.objects = list(source.objects)
    loaded = [each for each in target.objects if each is not None]
    nodes = addon_module("blender.nodes")
    assert not any(nodes.is_canvas(each) for each in loaded)
    bpy.data.batch_remove(loaded)
    bpy.context.view_layer.update()
    assert_all_same(pairs, (6, 7, 8))
    assert tail_of(ob) and are_deforming(pairs) == [True]  # in the open file it goes on
    pairs = [tuple(reopened(tmp_path, *pairs[0]))]
    assert_all_same(pairs)
    assert way(pairs[0][0]) in {"ATTRIBUTE", "KEYS"} and are_deforming(pairs) == [True] and canvases() == []
    find_stencils()
    assert tail_of(pairs[0][0])


@needs_memory
def test_it_plays_without_the_addon(pairs, tmp_path):
    assert_plays_without_the_addon(tmp_path, *pairs[0])


@needs_memory
@pytest.mark.sampled(3)
@pytest.mark.parametrize("render_levels", (1, 2))
@pytest.mark.parametrize("set_up", (with_motion_blur, with_persistent_data))
def test_rendered(pairs, fresh_scene, tmp_path, set_up, render_levels):
    for each in pairs[0]:
        for modifier in each.modifiers:
            if modifier.type == "SUBSURF":
                modifier.render_levels = render_levels
    bpy.context.view_layer.update()
    find_stencils()
    add_camera(fresh_scene)
    fresh_scene.camera.location = (0, -12, 2.5)
    set_up(fresh_scene)
    assert tail_of(pairs[0][0])
    assert_same_pictures(*pictures_of_both(fresh_scene, tmp_path, *pairs[0]))


@needs_memory
def test_the_scene_is_simplified(pairs, fresh_scene):
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
        find_stencils()
        assert_all_same(pairs, (6, 7, 8, 9))
        assert are_deforming(pairs) == [True] and tail_of(pairs[0][0])


def test_what_is_last_is_left_to_the_viewport(fresh_scene):
    pairs = bound(character_with(("SUBSURF", {"levels": 1})))
    find_stencils()
    assert way(pairs[0][0]) == "ATTRIBUTE" and tail_of(pairs[0][0]) is None
    follower = bpy.data.objects.new("Follower", None)
    bpy.context.collection.objects.link(follower)
    constraint = follower.constraints.new("COPY_LOCATION")
    constraint.target = follower.parent = pairs[0][0]
    bpy.context.view_layer.update()
    find_stencils()
    assert tail_of(pairs[0][0]) is None  # it follows the object, not its vertices
    follower.parent, constraint.subtarget = None, "bone1"
    bpy.context.view_layer.update()
    find_stencils()
    assert tail_of(pairs[0][0]) == ("SUBSURF",)
    assert_all_same(pairs)
    bpy.data.objects.remove(follower)
    bpy.context.view_layer.update()
    find_stencils()
    assert way(pairs[0][0]) == "ATTRIBUTE" and tail_of(pairs[0][0]) is None
    assert_all_same(pairs)


# --- any settings ---------------------------------------------------------------------------------

FIXED = {"name", "is_active", "use_pin_to_last", "use_apply_on_spline", "show_viewport", "show_render"}
LEVELS = {"count": (1, 2), "levels": (0, 2), "render_levels": (0, 2), "quality": (1, 5), "min_vertices": (4, 6)}


def set_at_random(modifier, random):
    """Every setting that its type has."""
    for each in modifier.bl_rna.properties:
        name = each.identifier
        if each.is_readonly or name in FIXED or name.startswith("show_"):
            continue
        if each.type == "BOOLEAN":
            value = random.random() < 0.5
        elif each.type == "ENUM":
            value = random.choice([item.identifier for item in each.enum_items])
        elif each.type == "INT":
            value = random.randint(*LEVELS[name])
        elif each.type == "FLOAT":
            value = random.uniform(0.0, 1.0)
        elif each.type == "STRING":
            value = random.choice(("", "side", "bone2"))
        else:
            continue  # another object
        try:
            setattr(modifier, name, value)
        except (TypeError, ValueError):  # an item that Blender does not offer on this mesh, or several values
            pass


def add_any_tail(ob, seed, is_rough):
    """is_rough: its faces have any number of corners, which Triangulate cuts by the shape."""
    random, kinds = Random(seed), ["SUBSURF", "SUBSURF", "MASK", "EDGE_SPLIT", "MIRROR", "ARRAY", "TRIANGULATE"]
    for _ in range(random.randint(1, 3)):
        kind = random.choice(kinds[:-1] if is_rough else kinds)
        modifier = ob.modifiers.new(kind, kind)
        set_at_random(modifier, random)
        if kind == "EDGE_SPLIT":  # what decides by the shape decides by its last bits
            modifier.use_edge_angle = False
        elif kind == "TRIANGULATE":
            modifier.quad_method = random.choice(("FIXED", "FIXED_ALTERNATE"))
        elif kind == "MIRROR":
            modifier.use_mirror_merge = False
            modifier.use_axis = [random.random() < 0.5 for _ in range(3)]
        elif kind == "ARRAY":
            modifier.fit_type, modifier.use_constant_offset = "FIXED_COUNT", True
            modifier.use_relative_offset = modifier.use_merge_vertices = modifier.use_object_offset = False
            modifier.constant_offset_displace = [random.uniform(-4, 4) for _ in range(3)]
    for modifier in [each for each in ob.modifiers if each.type == "SUBSURF"][1:]:
        modifier.levels = min(modifier.levels, 1)
    ob.modifiers.new("Behind", random.choice(("UV_WARP", "WEIGHTED_NORMAL")))


def normals_of(ob):
    mesh = ob.evaluated_get(depsgraph()).data
    normals = np.empty((len(mesh.loops), 3), np.float32)
    mesh.corner_normals.foreach_get("vector", normals.reshape(-1))
    return normals


@needs_memory
def test_any_settings(fresh_scene):
    """Positions, corners, normals, UVs and all else are those of the twin. Each of two Blenders of a series has its own
    half of the settings."""
    with_tail, first = [], 20 * (bpy.app.version[1] % 2)
    for seed in range(first, first + 20):
        armature = make_armature()
        ob = make_mesh(armature, seed % 2 == 0)
        for frame in (1, 5, 10):
            pose(armature, frame, True)
        is_rough = seed % 3 == 0
        if is_rough:
            make_rough(ob)
        layer = ob.data.uv_layers.new(name="Map").data
        layer.foreach_set("uv", np.random.default_rng(seed).random(2 * len(layer)))
        if seed % 4 == 1:
            ob.data.normals_split_custom_set_from_vertices([(0.6, 0.0, 0.8)] * len(ob.data.vertices))
        add_any_tail(ob, seed, is_rough)
        pairs = bound([(ob, twin_of(ob))])
        find_stencils()
        with_tail += [seed] if tail_of(ob) else []
        own = addon_module("blender.modifiers").settings_of
        said = seed, [(each.type, own(each)) for each in ob.modifiers if each.type not in OTHERS]
        for frame in (2, 6, 9):
            fresh_scene.frame_set(frame)
            ours, theirs = of_result(ob), of_result(pairs[0][1])
            assert ours.keys() == theirs.keys() and [name for name in ours if ours[name] != theirs[name]] == [], said
            if len(evaluated(ob)):
                assert_same_shape(*pairs[0])
            one, other = map(normals_of, pairs[0])
            off = np.abs(one - other).max(axis=1, initial=0.0)
            assert len(off) == 0 or (off > 1e-3).mean() < 2e-3, (said, off.max())
        for each in (*pairs[0], armature):
            bpy.data.objects.remove(each)
    assert len(with_tail) >= 7, with_tail


@needs_memory
def test_what_is_last_is_read_in_the_background(fresh_scene, monkeypatch):
    monkeypatch.setattr(addon_module("stencils.searching"), "IS_READ", True)
    pairs = bound(character_with(("SUBSURF", {"levels": 1, "render_levels": 2})))
    find_stencils()
    assert tail_of(pairs[0][0]) == ("SUBSURF",)
    assert_all_same(pairs)


@needs_memory
@pytest.mark.parametrize("is_persistent", (False, True))
def test_an_animation_is_rendered_in_the_background(fresh_scene, monkeypatch, tmp_path, capsys, is_persistent):
    """With levels of its own: after some frames, their stencils are found, too, if canvases stay evaluated. The
    user is told."""
    searching = addon_module("stencils.searching")
    monkeypatch.setattr(searching, "IS_READ", True)
    monkeypatch.setattr(searching, "FRAMES_AHEAD", 3)
    fresh_scene.render.use_persistent_data = is_persistent
    pairs = bound(character_with(("SUBSURF", {"levels": 1, "render_levels": 2})))
    entry = addon_module("run.characters").character(pairs[0][0])
    add_camera(fresh_scene)
    fresh_scene.camera.location = (0, -12, 2.5)
    assert_same_pictures(*pictures_of_both(fresh_scene, tmp_path, *pairs[0]))
    said = capsys.readouterr().out
    assert ("Sinew: SUBSURF of Tube: computed natively from the next frame on" in said) == is_persistent
    assert (
        "SUBSURF of Tube: evaluated by Blender in each frame; in animations, Persistent Data lets" in said
    ) != is_persistent
    if is_persistent:
        viewport, render = entry.way.tail.stencils
        assert render is not None and render is not viewport and entry.plan.lacks_stencils[0] == (viewport is None)
    assert is_persistent or entry.way.tail is None or entry.way.tail.stencils[1] is None
    assert_all_same(pairs)
    assert are_deforming(pairs) == [True] and len(bpy.data.scenes) == 1


@needs_memory
@pytest.mark.parametrize("levels_are_found", (False, True))
def test_exporters_switch_subdivision_off(fresh_scene, monkeypatch, levels_are_found):
    """Those of Alembic and USD do, with a bit of the original, and write the faces before it."""
    monkeypatch.setattr(addon_module("stencils.searching"), "IS_READ", levels_are_found)
    pairs = bound(character_with(("SUBSURF", {"levels": 1})))
    find_stencils()
    assert bool(tail_of(pairs[0][0])) == levels_are_found
    put_aside = addon_module("host.modifier_memory").put_aside
    for is_off in (True, False, True, False):
        for each in pairs[0]:
            put_aside(each.modifiers["SUBSURF"], is_off)
            each.update_tag(refresh={"DATA"})
        for frame in (3, 4, 5, 6, 7):
            fresh_scene.frame_set(frame)
            assert (len(evaluated(pairs[0][0])) == 1200) == is_off
            assert_same_shape(*pairs[0])
        assert are_deforming(pairs) == [True]


@pytest.mark.skipif("alembic_export" not in dir(bpy.ops.wm), reason="this build has no Alembic")
@pytest.mark.parametrize("applies", (False, True))
def test_exported_to_alembic(fresh_scene, monkeypatch, tmp_path, applies):
    monkeypatch.setattr(addon_module("stencils.searching"), "IS_READ", True)
    pairs = bound(character_with(("SUBSURF", {"levels": 1, "render_levels": 1})))
    find_stencils()
    assert tail_of(pairs[0][0])
    path = str(tmp_path / "it.abc")
    bpy.ops.wm.alembic_export(filepath=path, start=1, end=6, apply_subdiv=applies, as_background_job=False)
    assert_all_same(pairs)
    assert tail_of(pairs[0][0])
    before = set(bpy.data.objects)
    bpy.ops.wm.alembic_import(filepath=path, as_background_job=False)
    found = sorted((ob for ob in set(bpy.data.objects) - before if ob.type == "MESH"), key=lambda ob: ob.name)
    assert len(found) == 2
    for frame in (1, 3, 6):
        fresh_scene.frame_set(frame)
        assert (len(evaluated(found[0])) == 1200) != applies
        assert_same_shape(*found)


LEFT = {
    "animated": ([("SUBSURF", {}), BEHIND], lambda ob: ob.modifiers[-2].keyframe_insert("levels", frame=1)),
    "angle": ([("EDGE_SPLIT", {}), BEHIND], None),
    "bones": ([("MASK", {"mode": "ARMATURE"}), BEHIND], None),
    "only in renders": ([("SUBSURF", {"show_viewport": False}), BEHIND], None),
}


@pytest.mark.parametrize("modifiers, add", LEFT.values(), ids=LEFT.keys())
def test_what_is_left_to_blender(fresh_scene, modifiers, add):
    pairs = character_with(*modifiers)
    for each in pairs[0] if add is not None else ():
        add(each)
    bound(pairs)
    find_stencils()
    assert_all_same(pairs)
    assert way(pairs[0][0]) == "ATTRIBUTE" and canvases() == [] and are_deforming(pairs) == [True]
    kinds = {pairs[0][0].modifiers[name].type for name in tail_of(pairs[0][0]) or ()}
    assert kinds == set()


def test_keys(fresh_scene):
    """Their values are followed, and edits of their points; muted ones add nothing. Other readers find them."""
    pairs = bound(character_with(*PAIRS["with keys"], add=add_shape_keys))
    ((ob, twin),) = pairs
    assert way(ob) == "KEYS"
    find_stencils()
    assert_all_same(pairs)
    assert way(ob) == "CANVAS" and tail_of(ob) == ("SUBSURF",) and are_deforming(pairs) == [True]
    assert shortcut_of(ob, depsgraph()) is not None and ob.sinew.canvas.data.shape_keys is None
    for change in (
        lambda each: setattr(each.data.shape_keys.key_blocks[1], "value", 0.8),
        lambda each: setattr(each.data.shape_keys.key_blocks[2], "mute", True),
        lambda each: each.data.shape_keys.key_blocks[1].data[5].co.__setitem__(0, 2.0),
        lambda each: each.data.shape_keys.key_blocks[2].keyframe_insert("value", frame=3),
        lambda each: each.shape_key_add(name="More", from_mix=True),
        lambda each: each.shape_key_remove(each.data.shape_keys.key_blocks[1]),
    ):
        for each in pairs[0]:
            change(each)
            each.data.update()
            each.data.shape_keys.update_tag()
        bpy.context.view_layer.update()
        assert_same_shape(ob, twin)
        assert_all_same(pairs)
        assert are_deforming(pairs) == [True] and tail_of(ob)
        for ours, theirs in zip(*(each.evaluated_get(depsgraph()).data.shape_keys.key_blocks for each in pairs[0])):
            assert (ours.value, ours.relative_key.name) == (theirs.value, theirs.relative_key.name)
    for each in pairs[0]:
        each.data.shape_keys.use_relative = False
    assert_all_same(pairs)
    assert way(ob) == "BLENDER" and canvases() == []


@needs_memory
def test_generated_coordinates_stay_in_place(fresh_scene):
    """Only the path through shape keys keeps them there."""
    pairs = bound(character_with(*PAIRS["with keys"], add=add_shape_keys))
    ((ob, _twin),) = pairs
    find_stencils()
    assert tail_of(ob)
    material = bpy.data.materials.new("Marble")
    material.use_nodes = True
    noise = material.node_tree.nodes.new("ShaderNodeTexNoise")
    material.node_tree.links.new(noise.outputs[0], material.node_tree.nodes["Principled BSDF"].inputs[0])
    ob.data.materials.append(material)
    bpy.context.view_layer.update()
    find_stencils()
    assert way(ob) == "KEYS" and tail_of(ob) is None and "Generated coordinates of Marble" in end(ob)[1]
    assert_all_same(pairs)
    ob.data.materials.clear()
    bpy.context.view_layer.update()
    find_stencils()
    assert tail_of(ob)


def test_the_last_key_is_removed(fresh_scene):
    pairs = bound(character_with(*PAIRS["with keys"], add=add_shape_keys))
    find_stencils()
    for each in pairs[0]:
        each.shape_key_clear()
    bpy.context.view_layer.update()
    assert_all_same(pairs)
    find_stencils()
    assert_all_same(pairs)
    assert way(pairs[0][0]) == "CANVAS" and tail_of(pairs[0][0]) and are_deforming(pairs) == [True]


@needs_memory
def test_a_mismatch_leaves_it_to_blender(fresh_scene, monkeypatch):
    for name in ("TOLERANCE", "ROUNDING"):
        monkeypatch.setattr(addon_module("stencils.probing"), name, 0.0)
    pairs = bound(character_with(*PAIRS["subdivision"]))
    find_stencils()
    assert_all_same(pairs)
    assert tail_of(pairs[0][0]) is None and "in a shape with which it was compared" in says(pairs[0][0])
    assert are_deforming(pairs) == [True]


@needs_memory
def test_a_long_search_is_not_begun(fresh_scene, monkeypatch):
    monkeypatch.setattr(addon_module("stencils.searching"), "MOST_SECONDS", 0.0)
    pairs = bound(character_with(*PAIRS["subdivision"]))
    find_stencils()
    assert tail_of(pairs[0][0]) is None and "seconds to find its weights" in says(pairs[0][0])
    assert_all_same(pairs)
    monkeypatch.undo()
    for each in pairs[0]:
        move_a_vertex(each)  # an edit has it tried again
    find_stencils()
    assert tail_of(pairs[0][0])


@needs_memory
@pytest.mark.parametrize("limit", ("MOST_SECONDS", "MOST_EVALUATIONS"))
def test_a_long_search_is_begun_by_a_button(fresh_scene, monkeypatch, limit):
    monkeypatch.setattr(addon_module("stencils.searching"), limit, 1e-9 if limit == "MOST_SECONDS" else 1)
    ((ob, twin),) = bound(character_with(*PAIRS["subdivision"]))
    select(ob)
    find_stencils()
    assert tail_of(ob) is None and ("take longer" if limit == "MOST_EVALUATIONS" else "seconds") in says(ob)
    assert "object.sinew_find_weights" in draw()
    bpy.ops.object.sinew_find_weights()
    find_stencils()
    assert tail_of(ob) and "object.sinew_find_weights" not in draw()
    assert_all_same([(ob, twin)])
    with pytest.raises(RuntimeError, match="lacks no weights"):
        bpy.ops.object.sinew_find_weights()


def only_edges(mesh):
    own = bmesh.new()
    own.from_mesh(mesh)
    bmesh.ops.delete(own, geom=list(own.faces), context="FACES_ONLY")
    own.to_mesh(mesh)
    own.free()


def nothing(mesh):
    if mesh.shape_keys is not None:
        pytest.skip("keys of other meshes are an error")
    mesh.clear_geometry()


@needs_memory
@pytest.mark.parametrize("change", (nothing, only_edges))
def test_bad_meshes(pairs, change):
    for each in pairs[0]:
        change(each.data)
        each.data.update()
    bpy.context.view_layer.update()
    find_stencils()
    ours, theirs = (each.evaluated_get(depsgraph()).data for each in pairs[0])
    assert len(ours.vertices) == len(theirs.vertices)
    if len(theirs.vertices):
        assert_all_same(pairs)
        assert are_deforming(pairs) == [True]
    assert len(bpy.data.scenes) == 1


@needs_memory
def test_two_graphs_of_different_levels(pairs, fresh_scene):
    """A second scene simplifies what the first does not."""
    ob, twin = pairs[0]
    other = bpy.data.scenes.new("Other")
    for each in (ob, twin, ob.parent):
        other.collection.objects.link(each)
    other.render.use_simplify, other.render.simplify_subdivision = True, 0
    for _ in range(3):
        for scene in (fresh_scene, other):
            scene.frame_set(3)
            layer = scene.view_layers[0]
            counts = [len(each.evaluated_get(layer.depsgraph).data.vertices) for each in (ob, twin)]
            shapes = [
                addon_module("blender.meshes").read_evaluated(each.evaluated_get(layer.depsgraph)).copy()
                for each in (ob, twin)
            ]
            assert counts[0] == counts[1] and np.abs(shapes[0] - shapes[1]).max() < 1e-4


@needs_memory
def test_the_panel(fresh_scene):
    """Blender's part before, Sinew's after."""
    pairs = bound(character_with(*PAIRS["subdivision"]))
    fresh_scene.frame_set(2)
    said = " ".join(draw())
    assert "Blender takes over at SUBSURF: Sinew has not found the weights of its vertices yet" in said
    find_stencils()
    said = draw()
    assert f"1,200, made into {len(evaluated(pairs[0][0])):,}" in said and "in Blender" not in said
    assert said[said.index("SUBSURF") + 1].endswith(" ms") and are_deforming(pairs) == [True]


@needs_memory
@pytest.mark.parametrize("is_edited", (False, True))
@pytest.mark.parametrize("is_applied", (False, True))
def test_the_modifier_is_removed_or_applied_after_an_edit(fresh_scene, is_applied, is_edited):
    """Only if it was applied, those that it stands in for are switched off. The canvas has not what was edited."""
    ((ob, twin),) = bound(character_with(("SUBSURF", {"levels": 1}), BEHIND))
    find_stencils()
    for each in (ob, twin) if is_edited else ():
        select(each)
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.transform.translate(value=(0.1, 0, 0))
        bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.update()
    addon_module("main.handlers").look_into_the_mail()
    assert tail_of(ob) is not None
    own = addon_module("blender.nodes").find_modifier(ob)
    select(ob)
    if is_applied:
        bpy.ops.object.modifier_apply(modifier=own.name)
    else:
        ob.modifiers.remove(own)
    bpy.context.view_layer.update()
    assert not ob.sinew.is_bound and ob.modifiers["Armature"].show_viewport != is_applied
    if not is_applied:
        for frame in (2, 5):
            bpy.context.scene.frame_set(frame)
            assert_same_shape(ob, twin)


@needs_memory
@pytest.mark.parametrize("stack", PAIRS)
def test_originals_of_what_was_evaluated_are_there_until_all_handlers_are_done(fresh_scene, stack):
    """Another add-on looks for them, after Sinew's handlers."""
    ob = character_with(*PAIRS[stack], add=add_shape_keys if stack == "with keys" else None)[0][0]
    accelerate(ob)
    find_stencils()
    assert tail_of(ob) is not None
    contract = addon_module("host.contract")
    place, missing = contract.offset("ID", "*orig_id"), []

    def look(_scene, graph):
        known = {block.as_pointer() for kind in (bpy.data.objects, bpy.data.meshes) for block in kind}
        for update in graph.updates:
            original = contract.address_at(update.id.as_pointer() + place)
            if isinstance(update.id, (bpy.types.Object, bpy.types.Mesh)) and original not in known:
                missing.append(update.id.name)

    package = addon_module("main").__name__.removesuffix(".main")
    bpy.ops.preferences.addon_disable(module=package)
    bpy.ops.preferences.addon_enable(module=package)
    bpy.app.handlers.depsgraph_update_post.append(look)
    try:
        for _ in range(3):
            for each in ob, ob.data:
                each.update_tag()
            bpy.context.view_layer.update()
    finally:
        bpy.app.handlers.depsgraph_update_post.remove(look)
    assert not missing


@pytest.fixture
def searching(monkeypatch):
    """The module, as in a window, where a look is one evaluation."""
    searching = addon_module("stencils.searching")
    monkeypatch.setattr(searching, "FRAMES_AHEAD", 1000)
    monkeypatch.setattr(searching, "_is_busy", lambda _context: False)
    monkeypatch.setattr(searching, "perf_counter", itertools.count().__next__)
    monkeypatch.setattr(searching, "SECONDS_AT_ONCE", 1.5)
    return searching


def bits(searching):
    """Yields after each bit of a search but the last."""
    for _ in range(300):
        searching.look()
        addon_module("run.mail").deliver()
        if searching.is_running():
            yield
        elif not searching._lacking():
            bpy.context.view_layer.update()
            return
    raise AssertionError(searching._search.says if searching.is_running() else "it does not begin or end")


@needs_memory
@needs_rig_programs
def test_a_search_hands_back_rigs_once(fresh_scene, searching, monkeypatch):
    monkeypatch.setattr(addon_module("played.accelerating"), "LEAST_WORK", 0)
    pairs = bound(character_with(*PAIRS["subdivision"]))
    find_stencils()
    accelerating, states = addon_module("played.accelerating"), addon_module("played.states")
    rig = addon_module("played.rigs").learn(pairs[0][0].parent)
    accelerating.accelerate(fresh_scene, bpy.context.view_layer)
    assert rig.is_played
    handed_back = count = 0
    for _ in bits(searching):
        bpy.context.view_layer.update()
        count, handed_back = count + 1, handed_back + (not rig.is_played)
        states.take_over_again(fresh_scene, bpy.context.view_layer)
        assert rig.is_played
    assert count > 8 and handed_back <= 1 and tail_of(pairs[0][0])
    assert_all_same(pairs)


@needs_memory
def test_nothing_of_a_search_is_saved_or_outlives_undo(fresh_scene, searching, tmp_path):
    """Undo steps may be made while it goes on."""
    name, probing = addon_module("stencils.probing").NAME, addon_module("stencils.probing")
    pairs = bound(character_with(*PAIRS["subdivision"]))
    names = [each.name for each in pairs[0]]
    find_stencils()
    bpy.ops.ed.undo_push(message="before")
    going_on = bits(searching)
    for _ in range(3):
        next(going_on)
    assert bpy.data.scenes.get(name) is not None
    path = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    with bpy.data.libraries.load(path) as (saved, _wanted):
        assert name not in [*saved.scenes, *saved.objects, *saved.meshes]
    next(going_on)
    bpy.data.objects[names[0]].location.x += 1
    bpy.data.objects[names[1]].location.x += 1
    bpy.ops.ed.undo_push(message="while it goes on")
    bpy.data.objects[names[0]].location.x += 1
    bpy.ops.ed.undo_push(message="later")
    for step in (bpy.ops.ed.undo, bpy.ops.ed.undo, bpy.ops.ed.redo):
        step()
        left = [*bpy.data.scenes, *bpy.data.objects, *bpy.data.meshes]
        assert not [each.name for each in left if each.name.startswith(probing.NAME)]
    bpy.context.view_layer.update()
    find_stencils()
    for _ in bits(searching):
        pass
    pairs = [tuple(bpy.data.objects[each] for each in names)]
    assert tail_of(pairs[0][0])
    assert_all_same(pairs)
    assert bpy.data.scenes.get(name) is None
