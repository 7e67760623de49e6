"""The whole run of deforming modifiers, shape keys to smoothing, in one pass: Blender's own chain on a twin is the
judge."""

import bmesh
import bpy
import numpy as np
import pytest

from characters import (
    accelerate,
    add_shape_keys,
    animate,
    hook,
    make_armature,
    make_mesh,
    pose,
    remove_group,
    smoothed,
    with_bendy_bones,
)
from helpers import (
    addon_module,
    assert_same_on_all_frames,
    assert_same_shape,
    diagonal,
    end,
    evaluated,
    select,
    shortcut_of,
    stages,
    twin_of,
    way,
)


def simple(ob):
    smoothed(ob)


def length_weighted(ob):
    smoothed(ob, smooth_type="LENGTH_WEIGHTED", factor=0.8, iterations=3, scale=0.7)


def part(ob):
    smoothed(ob, vertex_group="bone2", use_pin_boundary=True)


def all_but_a_part(ob):
    smoothed(ob, vertex_group="bone2", invert_vertex_group=True)


def no_such_group(ob):
    smoothed(ob, vertex_group="gone")


def only_smooth(ob):
    smoothed(ob, use_only_smooth=True, iterations=8)


def out_of_range(ob):
    smoothed(ob, factor=-0.2, iterations=2, scale=-1.5)
    smoothed(ob, "Second", iterations=0)


def animated(ob):
    modifier = smoothed(ob)
    animate(modifier, factor=(0.1, 0.9), iterations=(1, 9), scale=(0.2, 1.5), use_pin_boundary=(False, True))
    animate(
        smoothed(ob, "Second", vertex_group="bone1"), invert_vertex_group=(False, True), use_only_smooth=(True, False)
    )


def plain_smooth(ob):
    smoothed(ob, "Smooth", "SMOOTH", factor=0.6, iterations=4, use_y=False)
    animate(smoothed(ob, "Part", "SMOOTH", vertex_group="bone3"), factor=(0.2, 1.3), iterations=(1, 5))


def against_it(ob):
    smoothed(ob, "Smooth", "SMOOTH", factor=-0.3, iterations=2)
    smoothed(ob, "Part", "SMOOTH", factor=-0.3, iterations=2, vertex_group="bone3")


def hooks(ob):
    hook(ob).vertex_indices_set(range(0, 1200, 3))
    hook(ob, "By a bone", "side", vertex_group="bone3", falloff_type="SMOOTH", falloff_radius=2.5, center=(0, 0, 3))
    animate(
        hook(ob, "Uniform", "bone4", vertex_group="bone1", use_falloff_uniform=True, falloff_type="ROOT"),
        strength=(0.2, 0.9),
        falloff_radius=(1, 3.1),  # the root is steep at its edge: no vertex may be within rounding of it
    )


def all_of_them(ob):
    hooks(ob)
    part(ob)
    smoothed(ob, "Smooth", "SMOOTH", vertex_group="bone4", iterations=2)
    smoothed(ob, "Last", smooth_type="LENGTH_WEIGHTED")


def hooks_of_vertices_that_are_gone(ob):
    hook(ob).vertex_indices_set(range(0, 2400, 7))
    hook(ob, "Nothing").vertex_indices_set((5000, 6000))
    simple(ob)


CHAINS = (
    simple,
    length_weighted,
    part,
    all_but_a_part,
    no_such_group,
    only_smooth,
    out_of_range,
    animated,
    plain_smooth,
    against_it,
    hooks,
    hooks_of_vertices_that_are_gone,
    all_of_them,
)


def by_two_armatures(ob):
    """Multi Modifier, the second one turned and masked."""
    second = make_armature()
    second.name, second.location = "Second", (0.2, 0.1, 0)
    for frame in (1, 10, 20):
        pose(second, frame + 1, scaled=False)
    modifier = smoothed(ob, "Armature2", "ARMATURE", object=second, use_multi_modifier=True, vertex_group="bone2")
    assert ob.modifiers.find(modifier.name) == 1


def nothing(ob):
    pass


@pytest.fixture
def make(fresh_scene):
    """Function that makes (bound mesh, twin) with that before and behind its Armature modifier."""

    def make(*parts, volume=False, bind=True):
        armature = make_armature()
        for frame in (1, 7, 14, 20):
            pose(armature, frame, scaled=True)
        ob = make_mesh(armature, volume)
        for part in parts:
            part(ob)
        twin = twin_of(ob)
        if ob.data.shape_keys:  # a copy's keys play the original's action
            twin.data.shape_keys.animation_data.action = ob.data.shape_keys.animation_data.action
        if bind:
            accelerate(ob)
        return ob, twin

    return make


@pytest.mark.parametrize(
    "before", (nothing, add_shape_keys, by_two_armatures, with_bendy_bones), ids=lambda part: part.__name__
)
@pytest.mark.parametrize("behind", CHAINS, ids=lambda part: part.__name__)
@pytest.mark.parametrize("volume", (False, True), ids=("linear", "volume"))
def test_chain_on_twenty_frames(fresh_scene, make, before, behind, volume):
    ob, twin = make(before, behind, volume=volume)
    assert_same_on_all_frames(fresh_scene, ob, twin)
    assert way(ob) == ("KEYS" if before == add_shape_keys else "ATTRIBUTE")
    assert stages(ob) == [m.name for m in ob.modifiers if m.type not in {"ARMATURE", "NODES"}] and end(ob) == ("", "")
    timings = addon_module("run.characters").character(ob).status.timings.last
    assert len(timings.stages) == len(stages(ob)) and timings.total >= sum(timings.stages)
    # It is the chain that was compared: the smoothing and the hooks do something.
    with_all = evaluated(ob)
    for name in stages(ob):
        ob.modifiers[name].show_viewport = ob.modifiers[name].show_render = False
    bpy.context.view_layer.update()
    assert np.abs(evaluated(ob) - with_all).max() > 1e-4 * diagonal(with_all)


def bound_while_bent(ob, frame):
    bpy.context.scene.frame_set(frame)
    select(ob)
    assert bpy.ops.object.correctivesmooth_bind(modifier="Corrective") == {"FINISHED"}
    bpy.context.view_layer.update()


def test_bind_coordinates(fresh_scene, make):
    ob, twin = make(simple, bind=False)
    for each in (ob, twin):
        each.modifiers["Corrective"].rest_source = "BIND"
        bound_while_bent(each, 7)
    accelerate(ob)
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 5, 9))
    assert stages(ob) == ["Corrective"]
    for each in (ob, twin):  # bound anew, to another shape
        bound_while_bent(each, 7)
        assert not each.modifiers["Corrective"].is_bind
        bound_while_bent(each, 14)
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 5, 9))
    assert stages(ob) == ["Corrective"]


def test_binding_with_only_smooth(fresh_scene, make):
    """Only Smooth needs no binding, but has to find it when it is switched off."""
    ob, twin = make(simple, bind=False)
    for each in (ob, twin):
        each.modifiers["Corrective"].rest_source, each.modifiers["Corrective"].use_only_smooth = "BIND", True
    accelerate(ob)
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 5, 9))
    for each in (ob, twin):
        bound_while_bent(each, 7)
        assert each.modifiers["Corrective"].is_bind
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 5, 9))
    assert stages(ob) == ["Corrective"]
    for each in (ob, twin):
        each.modifiers["Corrective"].use_only_smooth = False
    assert_same_on_all_frames(fresh_scene, ob, twin, (2, 6, 10))


def test_not_bound(fresh_scene, make):
    ob, twin = make(lambda ob: smoothed(ob, rest_source="BIND"))
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 5))
    assert stages(ob) == [] and end(ob) == ("Corrective", "it is not bound: press Bind in that modifier")


@pytest.mark.parametrize("before", (nothing, add_shape_keys), ids=lambda part: part.__name__)
def test_bound_to_the_rest_pose_by_the_button(fresh_scene, make, before):
    ob, twin = make(before, lambda ob: smoothed(ob, rest_source="BIND"))
    bpy.context.scene.frame_set(7)
    bent, keys = evaluated(ob), ob.data.shape_keys
    for each in (ob, twin):
        select(each)
        assert bpy.ops.object.sinew_bind_smoothing.poll() == (each == ob)
    select(ob)
    assert bpy.ops.object.sinew_bind_smoothing() == {"FINISHED"}
    bpy.context.view_layer.update()
    assert ob.modifiers["Armature"].object.data.pose_position == "POSE"
    assert keys is None or not ob.show_only_shape_key
    assert stages(ob) == ["Corrective"] and end(ob) == ("", "")
    assert np.abs(evaluated(ob) - bent).max() > 1e-4 * diagonal(bent)
    twin.modifiers["Corrective"].rest_source = "ORCO"  # the same shape
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 5, 9))
    # Bound to another number of vertices it is bound anew.
    for each in (ob, twin):
        one_vertex_more(each)
    bpy.context.view_layer.update()
    assert end(ob)[0] == "Corrective" and "vertices" in end(ob)[1]
    select(ob)
    assert bpy.ops.object.sinew_bind_smoothing() == {"FINISHED"}
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 5))
    assert stages(ob) == ["Corrective"]


def test_nothing_to_bind(fresh_scene, make):
    ob, _twin = make(simple)
    select(ob)
    with pytest.raises(RuntimeError, match="has no Corrective Smooth that needs to be bound"):
        bpy.ops.object.sinew_bind_smoothing()


def subdivided(ob):
    smoothed(ob)
    ob.modifiers.new("Finer", "SUBSURF")
    smoothed(ob, "After it")


def by_number(ob):
    """Blender would take others behind a Geometry Nodes modifier."""
    smoothed(ob)
    ob.modifiers.new("Cast", "CAST").factor = 0.2
    hook(ob, strength=0.7).vertex_indices_set(range(0, 400, 3))


@pytest.mark.parametrize("before", (nothing, add_shape_keys), ids=lambda part: part.__name__)
def test_hooks_left_to_blender_take_the_right_vertices(fresh_scene, make, before):
    ob, twin = make(before, by_number)
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 5, 9))
    assert way(ob) == ("KEYS" if before == add_shape_keys else "BLENDER")


@pytest.mark.parametrize("before", (nothing, add_shape_keys), ids=lambda part: part.__name__)
def test_the_bone_of_a_hook_is_deleted_and_made_again(fresh_scene, make, before):
    """Blender gives up a driver that waits for a bone that is not there."""
    ob, twin = make(before, lambda ob: hook(ob, bone="side", strength=0.7).vertex_indices_set(range(0, 400, 3)))
    armature = ob.modifiers["Armature"].object
    fresh_scene.frame_set(3)

    def assert_it_is_sinew():
        assert_same_on_all_frames(fresh_scene, ob, twin, (4, 5, 9))
        entry = addon_module("run.characters").character(ob)
        assert stages(ob) == ["Hook"] and entry.plan.hook_of(ob).driver.is_valid and entry.is_deforming

    assert_it_is_sinew()
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    armature.data.edit_bones.remove(armature.data.edit_bones["side"])
    bpy.ops.object.mode_set(mode="OBJECT")
    assert_it_is_sinew()
    bpy.ops.object.mode_set(mode="EDIT")
    armature.data.edit_bones.new("side").tail = (1, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    armature.pose.bones["side"].location = (0.3, 0.1, 0)
    assert_it_is_sinew()


@pytest.mark.parametrize("before", (nothing, add_shape_keys), ids=lambda part: part.__name__)
def test_the_object_of_a_hook_is_deleted(fresh_scene, make, before):
    """Blender gives up a driver that waits for it."""

    def two(ob):
        for name, bone in (("One", "side"), ("Two", "")):
            hook(ob, name, bone, strength=0.7).vertex_indices_set(range(0, 400, 3))

    ob, twin = make(before, two)
    assert_same_on_all_frames(fresh_scene, ob, twin, (3, 4))
    bpy.data.objects.remove(bpy.data.objects["Target"])
    assert_same_on_all_frames(fresh_scene, ob, twin, (5, 6))
    for each in (ob, twin):
        each.data.vertices[0].co.x += 1
        each.data.update()
    assert_same_on_all_frames(fresh_scene, ob, twin, (7, 8))
    entry = addon_module("run.characters").character(ob)
    assert stages(ob) == ["One"] and entry.plan.hook_of(ob).driver.is_valid and entry.is_deforming


@pytest.mark.parametrize("before", (nothing, add_shape_keys), ids=lambda part: part.__name__)
def test_a_hook_is_added(fresh_scene, make, before):
    """From Blender 5.0 on it is put before Sinew's modifier, since that is no deforming one."""
    ob, twin = make(before, simple)
    fresh_scene.frame_set(3)
    for each in (ob, twin):
        hook(each, strength=0.7).vertex_indices_set(range(0, 400, 3))
    bpy.context.view_layer.update()
    assert_same_on_all_frames(fresh_scene, ob, twin, (4, 5, 9))
    assert [m.name for m in ob.modifiers if m.type != "NODES"] == [m.name for m in twin.modifiers]
    assert stages(ob) == ["Corrective", "Hook"]


def test_a_hook_is_moved_to_the_front(fresh_scene, make):
    ob, twin = make(lambda ob: hook(ob, strength=0.7).vertex_indices_set(range(0, 400, 3)))
    fresh_scene.frame_set(3)
    for each in (ob, twin):
        select(each)
        assert bpy.ops.object.modifier_move_to_index(modifier="Hook", index=0) == {"FINISHED"}
    assert_same_on_all_frames(fresh_scene, ob, twin, (4, 5, 9))
    assert ob.modifiers[0].name == "Hook" and way(ob) == "BLENDER"


# Why Subdivision is Blender's, with another modifier behind it.
NO_TAIL = (
    "Sinew has not found the weights of its vertices yet"
    if bpy.app.version >= (4, 1, 0)
    else "In this version of Blender Sinew cannot begin with the result of other modifiers"
)


def by_curve(ob):
    smoothed(ob)
    hook(ob, vertex_group="bone2", falloff_type="CURVE", falloff_radius=3)


@pytest.mark.parametrize(
    "behind, name, reason",
    [(subdivided, "Finer", NO_TAIL), (by_curve, "Hook", "falloff curve")],
    ids=lambda part: getattr(part, "__name__", ""),
)
def test_where_the_run_ends(fresh_scene, make, behind, name, reason):
    ob, twin = make(behind)
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 5, 9))
    assert stages(ob) == ["Corrective"]
    assert end(ob)[0] == name and reason in end(ob)[1]


def test_what_is_off_is_passed_over(fresh_scene, make):
    def off_between(ob):
        smoothed(ob, "Off", show_viewport=False, show_render=False)
        smoothed(ob)
        ob.modifiers.new("Nobody", "HOOK")

    ob, twin = make(off_between)
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 5))
    assert stages(ob) == ["Corrective"]


# --- edits ----------------------------------------------------------------------------------------


def settings(ob):
    ob.modifiers["Corrective"].iterations = 12


def another_group(ob):
    ob.modifiers["Corrective"].vertex_group = "bone3"


def paint(ob):
    ob.vertex_groups["bone2"].add(range(0, 1200, 5), 0.3, "REPLACE")


def remove_the_group(ob):
    remove_group(ob, "bone2")


def move_vertices(ob):
    for vertex in ob.data.vertices:
        vertex.co.x *= 1 + 0.2 * np.sin(9 * vertex.co.z)
    ob.data.update()


def one_more(ob):
    smoothed(ob, "More", "SMOOTH")


def one_less(ob):
    ob.modifiers.remove(ob.modifiers["Corrective"])


def other_order(ob):
    select(ob)
    bpy.ops.object.modifier_move_to_index(modifier="Last", index=ob.modifiers.find("Armature") + 1)


def renamed(ob):
    ob.modifiers["Corrective"].name = "Otherwise"


def switched_off(ob):
    ob.modifiers["Corrective"].show_viewport = False


def before_the_armature(ob):
    select(ob)
    bpy.ops.object.modifier_move_to_index(modifier="Corrective", index=0)


def another_target(ob):
    ob.modifiers["Hook"].object = ob.modifiers["Armature"].object
    ob.modifiers["Hook"].subtarget = "bone3"


def other_vertices(ob):
    ob.modifiers["Hook"].vertex_indices_set(range(100, 600))


def cut(ob):
    """Other edges and faces with the same vertices."""
    select(ob)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.quads_convert_to_tris()
    bpy.ops.object.mode_set(mode="OBJECT")


def one_vertex_more(ob):
    select(ob)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide(number_cuts=1)
    bpy.ops.object.mode_set(mode="OBJECT")


def a_loose_vertex(ob):
    """No edge or face is another."""
    select(ob)
    bpy.ops.object.mode_set(mode="EDIT")
    bm = bmesh.from_edit_mesh(ob.data)
    bm.verts.new((0.1, 0.2, 3.3))
    bmesh.update_edit_mesh(ob.data)
    bpy.ops.object.mode_set(mode="OBJECT")


EDITS = (
    settings,
    another_group,
    paint,
    remove_the_group,
    move_vertices,
    one_more,
    one_less,
    other_order,
    renamed,
    switched_off,
    before_the_armature,
    another_target,
    other_vertices,
    cut,
    one_vertex_more,
    a_loose_vertex,
)


@pytest.mark.parametrize("before", (nothing, add_shape_keys), ids=lambda part: part.__name__)
@pytest.mark.parametrize("edit", EDITS, ids=lambda edit: edit.__name__)
def test_an_edit_is_seen_at_once(fresh_scene, make, before, edit):
    behind = hooks if edit in (another_target, other_vertices) else nothing
    ob, twin = make(before, behind, part, lambda ob: smoothed(ob, "Last", smooth_type="LENGTH_WEIGHTED"))
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 2, 3, 4))
    for each in (ob, twin):
        edit(each)
    bpy.context.view_layer.update()
    assert_same_shape(ob, twin)
    assert_same_on_all_frames(fresh_scene, ob, twin, (5, 6, 7, 8))


@pytest.mark.parametrize("leave", ("removed", "without its armature", "switched off"))
def test_a_mix_that_loses_a_modifier(fresh_scene, make, leave):
    ob, twin = make(by_two_armatures)
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 2, 3, 4))
    for each in (ob, twin):
        second = each.modifiers["Armature2"]
        if leave == "removed":
            each.modifiers.remove(second)
        elif leave == "without its armature":
            second.object = None
        else:
            second.show_viewport = second.show_render = False
    bpy.context.view_layer.update()
    assert_same_on_all_frames(fresh_scene, ob, twin, (5, 6, 7, 8))
    assert way(ob) == "ATTRIBUTE" and len(ob.sinew.modifiers) == 1


def test_undo_and_redo(fresh_scene, make):
    ob, twin = make(part)
    name, other = ob.name, twin.name
    fresh_scene.frame_set(5)
    bpy.ops.ed.undo_push(message="before")
    for each in (ob, twin):
        each.modifiers["Corrective"].iterations = 30
        paint(each)
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="after")
    for step in (bpy.ops.ed.undo, bpy.ops.ed.redo):
        step()
        assert_same_on_all_frames(bpy.context.scene, bpy.data.objects[name], bpy.data.objects[other], (5, 6, 7))


def test_modifiers_are_as_they_were(fresh_scene, make):
    """In the file nothing of them changes, bound or not."""
    ob, twin = make(all_of_them)

    def said(value):
        return list(value) if isinstance(value, bpy.types.bpy_prop_array) else str(value)

    not_said = {"rna_type", "execution_time", "is_active", "persistent_uid", "falloff_curve"}

    def state(each):
        return {
            m.name: {name: said(getattr(m, name)) for name in m.bl_rna.properties.keys() if name not in not_said}
            for m in each.modifiers
            if m.type != "NODES"
        }

    fresh_scene.frame_set(5)
    assert state(ob) == state(twin)
    bpy.ops.object.sinew_unbind()
    assert state(ob) == state(twin) and len(ob.modifiers) == len(twin.modifiers)
    assert_same_on_all_frames(fresh_scene, ob, twin, (6, 7))


def test_both_are_applied(fresh_scene, make):
    ob, twin = make(simple)
    fresh_scene.frame_set(5)
    for each in (ob, twin):
        select(each)
        assert bpy.ops.object.modifier_apply(modifier="Armature") == {"FINISHED"}
    assert_same_on_all_frames(fresh_scene, ob, twin, (5, 6))
    for each in (ob, twin):
        select(each)
        assert bpy.ops.object.modifier_apply(modifier="Corrective") == {"FINISHED"}
    assert_same_on_all_frames(fresh_scene, ob, twin, (5, 6, 7))


def test_in_edit_mode_and_behind_it(fresh_scene, make):
    ob, twin = make(part)
    fresh_scene.frame_set(3)
    select(ob)
    bpy.ops.object.mode_set(mode="EDIT")
    fresh_scene.frame_set(5)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert_same_on_all_frames(fresh_scene, ob, twin, (5, 6, 7))


def test_mesh_without_faces_or_edges(fresh_scene):
    armature = make_armature()
    for frame in (1, 10):
        pose(armature, frame, scaled=False)
    whole = make_mesh(armature, False)
    for keeps_edges in (True, False):
        ob = twin_of(whole)
        edges = [tuple(edge.vertices) for edge in ob.data.edges] if keeps_edges else []
        mesh = bpy.data.meshes.new("Wires")
        mesh.from_pydata([v.co for v in whole.data.vertices], edges, [])
        ob.data = mesh
        for group in whole.vertex_groups:
            ob.vertex_groups.new(name=group.name).add(range(0, 1200, 2), 0.5, "REPLACE")
        all_of_them(ob)
        twin = twin_of(ob)
        accelerate(ob)
        for frame in (1, 4, 8):
            fresh_scene.frame_set(frame)
            assert_same_shape(ob, twin)
        assert len(stages(ob)) == 6


def test_frames_that_are_alike_go_the_shorter_way(fresh_scene, make):
    ob, twin = make(animated)
    assert_same_on_all_frames(fresh_scene, ob, twin, (16, 17, 18, 19))  # behind the last keyframe
    assert shortcut_of(ob).holds()
    assert_same_on_all_frames(fresh_scene, ob, twin)


@pytest.mark.parametrize("number", (0, 1), ids=("first", "second"))
def test_an_armature_of_a_mix_in_edit_mode(fresh_scene, make, number):
    """Its modifier does nothing meanwhile."""
    ob, twin = make(by_two_armatures)
    assert_same_on_all_frames(fresh_scene, ob, twin, range(1, 6))
    select(ob.sinew.modifiers[number].object)
    bpy.ops.object.mode_set(mode="EDIT")
    assert_same_on_all_frames(fresh_scene, ob, twin, range(6, 9))
    bpy.ops.object.mode_set(mode="OBJECT")
    assert_same_on_all_frames(fresh_scene, ob, twin, range(9, 12))


def test_the_types_of_stages_are_the_same_everywhere():
    types = addon_module("blender.modifier_types").STAGES
    assert {"ARMATURE", *addon_module("chain.stages").KINDS} == types  # mixes.py makes those of Armature modifiers
    assert addon_module("host.watched_tree")._STAGES.keys() < types  # Hooks are read on each frame
