"""Meshes that no armature deforms: shape keys alone, smoothing and hooks alone, and both."""

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, animate, hook, make_armature, make_tube, pose, smoothed
from helpers import (
    addon_module,
    assert_plays_without_the_addon,
    assert_same_on_all_frames,
    assert_same_shape,
    data_counts,
    diagonal,
    end,
    evaluated,
    into_a_shot,
    needs_memory,
    own_positions,
    reopened,
    select,
    stages,
    traces,
    twin_of,
    way,
)


def nothing(ob):
    pass


def driven_keys(ob):
    """By an empty, which is animated, and set by hand."""
    add_shape_keys(ob)
    keys = ob.data.shape_keys
    keys.animation_data_clear()
    target = bpy.data.objects.new("Driver", None)
    bpy.context.collection.objects.link(target)
    for frame, x in ((1, 0), (15, 1)):
        target.location.x = x
        target.keyframe_insert("location", frame=frame)
    driver = keys.key_blocks["Wide"].driver_add("value").driver
    variable = driver.variables.new()
    variable.type, variable.targets[0].id, variable.targets[0].transform_type = "TRANSFORMS", target, "LOC_X"
    driver.type = "SUM"
    keys.key_blocks["Bumpy"].value = 0.7


def corrective(ob):
    animate(smoothed(ob, factor=0.8, iterations=3, vertex_group="bone2"), scale=(0.3, 1.4))


def by_length(ob):
    animate(smoothed(ob, smooth_type="LENGTH_WEIGHTED", use_only_smooth=True), iterations=(1, 9))


def plain(ob):
    animate(smoothed(ob, "Smooth", "SMOOTH", use_y=False), factor=(0.2, 0.9), iterations=(1, 6))


def hooked(ob):
    hook(ob, falloff_type="SMOOTH", falloff_radius=3).vertex_indices_set(range(0, 1200, 3))


def all_of_them(ob):
    hooked(ob)
    corrective(ob)
    smoothed(ob, "Smooth", "SMOOTH", iterations=2)


def hidden_first(ob):
    """What is off does not count, nor an Armature modifier that has no armature or is off."""
    ob.modifiers.new("Empty", "ARMATURE")
    off = smoothed(ob, "Off", "ARMATURE", object=make_armature(), show_viewport=False, show_render=False)
    assert off.object is not None
    ob.modifiers.new("Finer", "SUBSURF").show_viewport = ob.modifiers["Finer"].show_render = False
    hooked(ob)


CHAINS = (corrective, by_length, plain, hooked, all_of_them, hidden_first)


@pytest.fixture
def make(fresh_scene):
    """Function that makes (bound tube, twin) with that on it."""

    def make(*parts, bind=True):
        ob = make_tube()
        for part in parts:
            part(ob)
        twin = twin_of(ob)
        keys = ob.data.shape_keys
        if keys and keys.animation_data and keys.animation_data.action:  # a copy's keys play the original's action
            twin.data.shape_keys.animation_data.action = keys.animation_data.action
        if bind:
            accelerate(ob)
        return ob, twin

    return make


def test_hooks_are_added_behind_others(fresh_scene, make):
    """From Blender 5.0 on they are put before Sinew's modifier, and so before the others."""
    ob, twin = make(smoothed)
    fresh_scene.frame_set(3)
    for each in (ob, twin):
        for name in ("First", "Second"):
            hook(each, name, strength=0.7).vertex_indices_set(range(0, 400, 3))
    bpy.context.view_layer.update()
    assert names_but_own(ob) == names_but_own(twin)
    assert_same_on_all_frames(fresh_scene, ob, twin, (4, 5, 9))


def names_but_own(ob):
    return [m.name for m in ob.modifiers if m.type != "NODES"]


@pytest.fixture
def left_to_blender(fresh_scene, make):
    """Bound, and nothing left that Sinew could stand in for: its modifier, which has the hook, stands at the end."""
    ob, twin = make(hooked)
    for each in (ob, twin):
        each.modifiers["Hook"].show_viewport = each.modifiers["Hook"].show_render = False
        each.modifiers.new("Cast", "CAST").factor = 0.2
    fresh_scene.frame_set(4)
    assert way(ob) == "BLENDER" and ob.modifiers[-1].type == "NODES"
    return ob, twin


def test_a_hook_is_added_behind_an_armature_that_came_later(fresh_scene, left_to_blender):
    """It stands behind Sinew's modifier, before which Blender puts the Hook."""
    ob, twin = left_to_blender
    armature = make_armature()
    pose(armature, 1, False)
    for each in (ob, twin):
        each.modifiers.new("Armature", "ARMATURE").object = armature
        hook(each, "New").vertex_indices_set(range(0, 1200, 5))
    assert_same_on_all_frames(fresh_scene, ob, twin, (4, 5, 9))
    assert names_but_own(ob) == names_but_own(twin) == ["Hook", "Cast", "Armature", "New"]


def test_armatures_that_came_later_are_mixed(fresh_scene, left_to_blender):
    """Blender mixes with the modifier right before: Sinew's, which stands in between, is moved away."""
    ob, twin = left_to_blender
    armatures = [make_armature(), make_armature()]
    for turn, armature in enumerate(armatures, start=1):
        pose(armature, turn, False)
        for each in (ob, twin):
            modifier = each.modifiers.new(f"Armature {turn}", "ARMATURE")
            modifier.object, modifier.use_multi_modifier = armature, turn == 2
        if turn == 1:  # it is at the end when the second one is added
            nodes = addon_module("blender.nodes")
            nodes.move_modifier_back(ob, nodes.find_modifier(ob))
    bpy.context.view_layer.update()
    addon_module("main.handlers").look_into_the_mail()
    assert_same_on_all_frames(fresh_scene, ob, twin, (4, 5))
    assert names_but_own(ob) == names_but_own(twin) and ob.modifiers[-1].type == "NODES"


def test_multires_is_added_behind_what_came_later(fresh_scene, left_to_blender):
    ob, twin = left_to_blender
    for each in (ob, twin):
        each.modifiers.new("Smooth", "SMOOTH").iterations = 3
        each.modifiers.new("Finer", "MULTIRES")
    assert_same_on_all_frames(fresh_scene, ob, twin, (4, 5, 9))
    assert names_but_own(ob) == names_but_own(twin) == ["Hook", "Cast", "Smooth", "Finer"]


def test_a_hook_that_stands_first_is_copied(fresh_scene, left_to_blender):
    ob, twin = left_to_blender
    for each in (ob, twin):
        each.modifiers.remove(each.modifiers["Cast"])
        each.modifiers.new("Smooth", "SMOOTH").show_viewport = False
        select(each)
        bpy.ops.object.modifier_copy(modifier="Hook")
    assert_same_on_all_frames(fresh_scene, ob, twin, (4, 5))
    assert names_but_own(ob) == names_but_own(twin) and len(ob.modifiers) == 4


def test_a_hook_that_stands_first_is_renamed(fresh_scene, left_to_blender):
    ob, twin = left_to_blender
    for each in (ob, twin):
        each.modifiers["Hook"].name = "Renamed"
    assert_same_on_all_frames(fresh_scene, ob, twin, (4, 5))
    assert names_but_own(ob) == names_but_own(twin) == ["Renamed", "Cast"]


@pytest.mark.parametrize("kind", ("", "MIRROR", "SOLIDIFY"))
def test_a_hook_of_nothing_is_added_behind_others_that_only_deform(make, kind):
    def with_more(ob):
        smoothed(ob)
        if kind:
            ob.modifiers.new("More", kind)

    ob, twin = make(with_more)
    for each in (ob, twin):
        each.modifiers.new("Of nothing", "HOOK")
    bpy.context.view_layer.update()
    assert names_but_own(ob) == names_but_own(twin)


def assert_it_is_sinew(ob):
    entry = addon_module("run.characters").character(ob)
    assert entry.is_deforming and entry.status.error == ""


@needs_memory
@pytest.mark.parametrize(
    "keys, behind",
    [
        *((nothing, chain) for chain in CHAINS),
        *((add_shape_keys, chain) for chain in (nothing, *CHAINS)),
        (driven_keys, nothing),
        (driven_keys, all_of_them),
    ],
    ids=lambda part: part.__name__,
)
def test_twenty_frames(fresh_scene, make, keys, behind):
    ob, twin = make(keys, behind)
    shapes = []
    for frame in range(1, 21):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)
        shapes.append(evaluated(ob))
    assert np.ptp(shapes, axis=0).max() > 1e-3 * diagonal(shapes[0])
    assert_it_is_sinew(ob)
    assert way(ob) == ("ATTRIBUTE" if keys is nothing else "KEYS")
    expected = [m.name for m in twin.modifiers if m.type in {"CORRECTIVE_SMOOTH", "SMOOTH", "HOOK"}]
    assert stages(ob) == expected and end(ob) == ("", "")


@needs_memory
def test_output_mesh(fresh_scene, make):
    for keys in (nothing, add_shape_keys):
        ob, twin = make(keys, all_of_them, bind=False)
        accelerate(ob, "MESH")
        for frame in (3, 7):
            fresh_scene.frame_set(frame)
            assert_same_shape(ob, twin)
            assert np.array_equal(own_positions(ob.sinew.deformed), evaluated(ob))
        assert_it_is_sinew(ob)


@needs_memory
def test_bound_again(fresh_scene, make):
    """An Armature modifier that is off still does not count."""
    ob, twin = make(add_shape_keys, hidden_first)
    accelerate(ob, "MESH")
    assert_same_on_all_frames(fresh_scene, ob, twin, (3, 7))
    assert_it_is_sinew(ob)
    assert ob.sinew.armature is None and ob.sinew.deformed is not None


def in_renders_alone(ob):
    smoothed(ob, "First", show_viewport=False)
    smoothed(ob, "Second", show_viewport=False)


def test_shown_in_renders_alone(fresh_scene, make):
    ob, twin = make(in_renders_alone)
    fresh_scene.frame_set(3)
    assert_same_shape(ob, twin)
    assert np.array_equal(evaluated(ob), own_positions(ob)) and stages(ob) == ["First", "Second"]
    ob, twin = make(add_shape_keys, in_renders_alone)
    assert_same_on_all_frames(fresh_scene, ob, twin, (3, 7))
    assert way(ob) == "KEYS"
    if bpy.app.version >= (4, 0, 0):  # where the data-block of an evaluated object leads to its graph
        assert stages(ob) == ["First", "Second"] and end(ob) == ("", "")
    else:
        assert stages(ob) == []
        assert end(ob) == ("First", "its switches for viewport and renders differ from those of the mesh")


# --- edits ----------------------------------------------------------------------------------------


def another_setting(ob):
    ob.modifiers["Corrective"].scale = -1
    ob.modifiers["Hook"].strength = 0.5


def painted(ob):
    ob.vertex_groups["bone2"].add(range(0, 1200, 5), 0.3, "REPLACE")


def moved_vertices(ob):
    points = ob.data.shape_keys.key_blocks[0].data if ob.data.shape_keys else ob.data.vertices
    for point in points:
        point.co.x *= 1 + 0.2 * np.sin(9 * point.co.z)
    ob.data.update()


def another_target(ob):
    other = bpy.data.objects.get("Other") or bpy.data.objects.new("Other", None)
    if not other.users_collection:
        bpy.context.collection.objects.link(other)
    other.location = (0, 1, 2)
    ob.modifiers["Hook"].object = other


def switched_off(ob):
    ob.modifiers["Hook"].show_viewport = ob.modifiers["Hook"].show_render = False


def one_in_front(ob):
    smoothed(ob, "Front", "SMOOTH", iterations=3)
    to_front(ob, "Front")


def one_behind(ob):
    smoothed(ob, "Behind", "SMOOTH", iterations=3)


def one_less(ob):
    ob.modifiers.remove(ob.modifiers["Hook"])


def renamed(ob):
    ob.name, ob.modifiers["Hook"].name = f"Other {ob.name}", "Otherwise"


def to_front(ob, name):
    select(ob)
    bpy.ops.object.modifier_move_to_index(modifier=name, index=0)


@needs_memory
@pytest.mark.parametrize("keys", (nothing, add_shape_keys), ids=lambda part: part.__name__)
@pytest.mark.parametrize(
    "edit",
    (
        another_setting,
        painted,
        moved_vertices,
        another_target,
        switched_off,
        one_in_front,
        one_behind,
        one_less,
        renamed,
    ),
    ids=lambda edit: edit.__name__,
)
def test_an_edit_is_seen_at_once(fresh_scene, make, keys, edit):
    ob, twin = make(keys, all_of_them)
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 2, 3))
    for each in (ob, twin):
        edit(each)
    bpy.context.view_layer.update()
    assert_same_shape(ob, twin)
    assert_same_on_all_frames(fresh_scene, ob, twin, (4, 5, 6))
    assert_it_is_sinew(ob)
    assert stages(ob) == [m.name for m in twin.modifiers if m.show_viewport]


@needs_memory
def test_keys_by_hand(fresh_scene, make):
    ob, twin = make(driven_keys)
    fresh_scene.frame_set(5)
    for value in (0.1, 0.9):
        for each in (ob, twin):
            each.data.shape_keys.key_blocks["Bumpy"].value = value
        bpy.context.view_layer.update()
        assert_same_shape(ob, twin)
    for each in (ob, twin):
        each.data.shape_keys.key_blocks["Bumpy"].mute = True
    bpy.context.view_layer.update()
    assert_same_shape(ob, twin)
    assert_it_is_sinew(ob)


def test_keys_come_and_go(fresh_scene, make):
    ob, twin = make(corrective)
    fresh_scene.frame_set(3)
    assert way(ob) == "ATTRIBUTE" and ob.modifiers[0].name == "Sinew"
    for each in (ob, twin):
        add_shape_keys(each)
    assert_same_on_all_frames(fresh_scene, ob, twin, (3, 4, 5))
    assert way(ob) == "KEYS" and ".sinew_position" not in ob.data.attributes
    for each in (ob, twin):
        each.shape_key_clear()
    assert_same_on_all_frames(fresh_scene, ob, twin, (6, 7, 8))
    assert way(ob) == "ATTRIBUTE" and ob.modifiers[0].name == "Sinew"
    assert_it_is_sinew(ob)


@needs_memory
def test_nothing_is_left_to_take_over(fresh_scene, make):
    ob, twin = make(corrective)
    for each in (ob, twin):
        each.modifiers.remove(each.modifiers["Corrective"])
    assert_same_on_all_frames(fresh_scene, ob, twin, (2, 3))
    reason = addon_module("run.characters").character(ob).way.reason
    assert reason == "It has no armature, shape keys or smoothing that Sinew could take over: add one of them"
    for each in (ob, twin):
        plain(each)
    assert_same_on_all_frames(fresh_scene, ob, twin, (4, 5, 6))
    assert_it_is_sinew(ob)
    assert stages(ob) == ["Smooth"]


@pytest.mark.parametrize("keys", (nothing, add_shape_keys), ids=lambda part: part.__name__)
def test_multires_behind_smoothing(fresh_scene, make, keys):
    """Blender lets it stand behind deforming modifiers alone: Sinew's must be out of its way."""
    ob, twin = make(keys, corrective)
    fresh_scene.frame_set(2)
    for each in (ob, twin):
        each.modifiers.new("Multires", "MULTIRES")
    assert_same_on_all_frames(fresh_scene, ob, twin, (3, 4, 5))
    assert [m.name for m in ob.modifiers] == ["Corrective", "Multires", "Sinew"]
    assert way(ob) == ("BLENDER" if keys is nothing else "KEYS")


@needs_memory
@pytest.mark.parametrize("first", (True, False), ids=("in front", "behind"))
@pytest.mark.parametrize(
    "keys, behind",
    ((nothing, corrective), (add_shape_keys, nothing), (add_shape_keys, corrective)),
    ids=lambda part: part.__name__,
)
def test_an_armature_modifier_is_added(fresh_scene, make, keys, behind, first):
    """Blender's own goes on with it. In front the panel says how Sinew would stand in for it, too."""
    ob, twin = make(keys, behind)
    fresh_scene.frame_set(2)
    armature = make_armature()
    pose(armature, 1, False)
    pose(armature, 9, False)
    for each in (ob, twin):
        smoothed(each, "Armature", "ARMATURE", object=armature)
        if first:
            to_front(each, "Armature")
    assert_same_on_all_frames(fresh_scene, ob, twin, (3, 4, 5))
    entry = addon_module("run.characters").character(ob)
    said = "Armature comes first, and the mesh was bound without it: unbind the mesh and accelerate it again"
    if keys is nothing and first:
        assert said in entry.way.reason and not entry.is_deforming
    else:
        assert_it_is_sinew(ob)
        assert end(ob)[0] == "Armature"
        assert (end(ob)[1] in said) == (first or behind is nothing)
    select(ob)
    bpy.ops.object.sinew_unbind()
    accelerate(ob)
    assert_same_on_all_frames(fresh_scene, ob, twin, (3, 4, 5))
    if first or behind is nothing:
        assert_it_is_sinew(ob)
        assert ob.sinew.armature == armature


@needs_memory
@pytest.mark.parametrize("keys", (nothing, add_shape_keys), ids=lambda part: part.__name__)
def test_sinews_modifier_is_moved_or_removed(fresh_scene, make, keys):
    ob, twin = make(keys, corrective, lambda ob: ob.modifiers.new("Finer", "SUBSURF"))
    fresh_scene.frame_set(2)
    select(ob)
    for index in (2, 0):
        bpy.ops.object.modifier_move_to_index(modifier="Sinew", index=index)
        assert_same_on_all_frames(fresh_scene, ob, twin, (3, 4, 5))
        assert_it_is_sinew(ob)
    ob.modifiers.remove(ob.modifiers["Sinew"])
    bpy.context.view_layer.update()
    assert_same_on_all_frames(fresh_scene, ob, twin, (6, 7))
    assert not ob.sinew.is_bound and traces() == []


def posed(ob):
    smoothed(ob, "Armature", "ARMATURE", object=make_armature())
    pose(ob.modifiers["Armature"].object, 1, False)


@needs_memory
@pytest.mark.parametrize("before", (nothing, posed), ids=lambda part: part.__name__)
def test_sinews_modifier_is_applied(fresh_scene, make, before):
    """Nothing of what it stood in for deforms the mesh a second time."""
    ob, _twin = make(before, corrective, plain)
    fresh_scene.frame_set(3)
    shape = evaluated(ob)
    select(ob)
    ob.modifiers["Sinew"].show_viewport = True
    assert bpy.ops.object.modifier_apply(modifier="Sinew") == {"FINISHED"}
    bpy.context.view_layer.update()
    assert np.allclose(own_positions(ob), shape, atol=1e-6) and np.allclose(evaluated(ob), shape, atol=1e-6)
    assert not ob.sinew.is_bound and traces() == []


@needs_memory
@pytest.mark.parametrize("keys", (nothing, add_shape_keys), ids=lambda part: part.__name__)
def test_edit_mode(fresh_scene, make, keys):
    ob, twin = make(keys, corrective)
    fresh_scene.frame_set(3)
    for each in (ob, twin):
        select(each)
        bpy.ops.object.mode_set(mode="EDIT")
        fresh_scene.frame_set(4)
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.mesh.subdivide()
        bpy.ops.object.mode_set(mode="OBJECT")
    assert_same_on_all_frames(fresh_scene, ob, twin, (4, 5, 6))
    assert_it_is_sinew(ob)


@needs_memory
@pytest.mark.parametrize("keys", (nothing, add_shape_keys), ids=lambda part: part.__name__)
def test_undo_and_redo(fresh_scene, make, keys):
    ob, twin = make(keys, all_of_them)
    names = ob.name, twin.name
    fresh_scene.frame_set(5)
    bpy.ops.ed.undo_push(message="before")
    for each in (ob, twin):
        each.modifiers["Corrective"].iterations = 30
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="after")
    for step in (bpy.ops.ed.undo, bpy.ops.ed.redo):
        step()
        ob, twin = (bpy.data.objects[name] for name in names)
        assert_same_on_all_frames(bpy.context.scene, ob, twin, (5, 6, 7))
        assert_it_is_sinew(ob)


@needs_memory
@pytest.mark.parametrize("keys", (nothing, add_shape_keys), ids=lambda part: part.__name__)
def test_a_duplicate_is_bound_as_well(fresh_scene, make, keys):
    ob, twin = make(keys, all_of_them)
    fresh_scene.frame_set(3)
    select(ob)
    bpy.ops.object.duplicate()
    copy = bpy.context.active_object
    assert_same_on_all_frames(fresh_scene, copy, twin, (4, 5, 6))
    assert_same_shape(ob, twin)
    for each in (ob, copy):
        assert_it_is_sinew(each)
    ob.modifiers["Corrective"].scale = copy.modifiers["Corrective"].scale = 3


def test_objects_that_share_the_mesh(fresh_scene, make):
    ob, twin = make(all_of_them)
    fresh_scene.frame_set(3)
    copy = ob.copy()
    bpy.context.collection.objects.link(copy)
    for each in (ob, copy):
        assert_same_on_all_frames(fresh_scene, each, twin, (4, 5))
        assert way(each) == ("BLENDER" if ob.data.shape_keys else "CANVAS")
    select(copy)
    assert bpy.ops.object.sinew_make_single_user() == {"FINISHED"}
    for each in (ob, copy):
        assert_same_on_all_frames(fresh_scene, each, twin, (6, 7))
        assert_it_is_sinew(each)
    for each in (ob, copy):
        select(each)
        bpy.ops.object.sinew_unbind()
    assert traces() == []


# --- files ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "keys, behind",
    ((nothing, all_of_them), (add_shape_keys, nothing), (add_shape_keys, plain)),
    ids=lambda part: part.__name__,
)
def test_unbinding_leaves_no_trace(fresh_scene, make, keys, behind):
    ob, _twin = make(keys, behind, bind=False)

    def state():
        drivers = [curve.data_path for curve in ob.animation_data.drivers] if ob.animation_data else None
        return (
            [(m.name, m.show_viewport, m.show_render, m.use_apply_on_spline) for m in ob.modifiers],
            drivers,
            (set(ob.data.attributes.keys())),
            own_positions(ob).tobytes(),
            data_counts(),
        )

    before = state()
    accelerate(ob)
    fresh_scene.frame_set(5)
    assert "Sinew" in ob.modifiers
    select(ob)
    assert bpy.ops.object.sinew_unbind() == {"FINISHED"}
    assert state() == before and traces() == [] and not ob.sinew.is_bound


@needs_memory
@pytest.mark.parametrize("keys", (nothing, add_shape_keys), ids=lambda part: part.__name__)
def test_save_and_reload(fresh_scene, make, tmp_path, keys):
    ob, twin = make(keys, all_of_them)
    fresh_scene.frame_set(4)
    ob, twin = reopened(tmp_path, ob, twin)
    assert_same_shape(ob, twin)
    assert_same_on_all_frames(bpy.context.scene, ob, twin, (5, 6))
    assert_it_is_sinew(ob)


@needs_memory
@pytest.mark.parametrize("keys", (nothing, add_shape_keys), ids=lambda part: part.__name__)
@pytest.mark.parametrize("when", ("linked", "overridden", "bound as an override"))
def test_from_a_library(fresh_scene, make, tmp_path, keys, when):
    ob, twin = make(keys, all_of_them, bind=when != "bound as an override")
    names = ob.name, twin.name
    collection = bpy.data.collections.new("Character")
    fresh_scene.collection.children.link(collection)
    for each in (ob, twin, bpy.data.objects["Target"]):
        collection.objects.link(each)
    scene = into_a_shot(tmp_path, overridden=when != "linked")
    ob, twin = (next(each for each in scene.objects if each.name == name) for name in names)
    if when == "bound as an override":
        accelerate(ob)
    assert_same_on_all_frames(scene, ob, twin, (1, 5, 9))
    assert_it_is_sinew(ob)


@pytest.mark.parametrize(
    "keys, behind",
    ((nothing, all_of_them), (add_shape_keys, nothing), (add_shape_keys, plain)),
    ids=lambda part: part.__name__,
)
def test_a_file_plays_without_the_addon(fresh_scene, make, tmp_path, keys, behind):
    ob, twin = make(keys, behind)
    fresh_scene.frame_set(9)
    assert_same_shape(ob, twin)
    assert_plays_without_the_addon(tmp_path, ob, twin)


# --- refused --------------------------------------------------------------------------------------


def driven_smoothing(ob):
    modifier = smoothed(ob)
    ob.driver_add(f'modifiers["{modifier.name}"].factor').driver.expression = "frame / 9"


def lone_basis(ob):
    ob.shape_key_add(name="Basis")


def under_a_lattice(ob):
    plain(ob)
    lattice = bpy.data.objects.new("Cage", bpy.data.lattices.new("Cage"))
    bpy.context.collection.objects.link(lattice)
    ob.parent, ob.parent_type = lattice, "LATTICE"


@pytest.mark.parametrize(
    "part, sentence",
    [
        (nothing, "Tube has no armature, shape keys or smoothing that Sinew could take over: add one of them"),
        (lone_basis, "Tube has no armature, shape keys or smoothing that Sinew could take over: add one of them"),
        (lambda ob: ob.modifiers.new("Mirror", "MIRROR"), "Mirror comes first, and Sinew cannot evaluate"),
        (driven_smoothing, "Corrective comes first, and its factor is driven"),
        (
            under_a_lattice,
            "Tube is deformed by its parent Cage directly, before any modifier: set the parent type to Object",
        ),
    ],
    ids=("nothing", "basis", "mirror", "driver", "lattice"),
)
def test_refused(fresh_scene, make, part, sentence):
    ob, _twin = make(part, bind=False)
    names = [modifier.name for modifier in ob.modifiers]
    with pytest.raises(RuntimeError) as error:
        accelerate(ob)
    assert sentence in str(error.value)
    assert [modifier.name for modifier in ob.modifiers] == names and traces() == [] and not ob.sinew.is_bound


@needs_memory
def test_a_parent_that_is_an_armature(fresh_scene, make):
    """It places the mesh; without vertex groups of its bones it does not deform it."""
    ob, twin = make(add_shape_keys, plain, bind=False)
    armature = make_armature()
    for each in (ob, twin):
        each.parent = armature
        for group in each.vertex_groups:
            group.name = f"not {group.name}"
    accelerate(ob)
    assert_same_on_all_frames(fresh_scene, ob, twin, (2, 3))
    assert_it_is_sinew(ob)
    assert ob.sinew.armature is None
