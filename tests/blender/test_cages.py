"""Modifiers that follow the shape of another object: Lattice, Surface Deform, Mesh Deform."""

import bpy
import numpy as np
import pytest

from characters import (
    accelerate,
    add_shape_keys,
    animate,
    by_keys,
    in_a_cage,
    linked,
    make_armature,
    make_cage,
    make_mesh_cage,
    make_tube,
    pose,
    smoothed,
)
from helpers import (
    addon_module,
    assert_plays_without_the_addon,
    assert_same_on_all_frames,
    assert_same_shape,
    diagonal,
    end,
    evaluated,
    into_a_shot,
    needs_memory,
    own_positions,
    reopened,
    select,
    stages,
    twin_of,
    way,
)
from test_render import add_camera, assert_same_pictures, pictures_of_both, with_motion_blur

SPLINES = ("KEY_LINEAR", "KEY_CARDINAL", "KEY_CATMULL_ROM", "KEY_BSPLINE")


def by_a_hook(cage):
    target = linked("Puller")
    hook = cage.modifiers.new("Hook", "HOOK")
    hook.object, hook.falloff_type = target, "NONE"
    hook.vertex_indices_set([0, 1, 5, 8])
    for frame, place in ((1, (0, 0, 0)), (15, (1, 0.5, 0.2))):
        target.location = place
        target.keyframe_insert("location", frame=frame)


def by_its_place(cage):
    for frame, place in ((1, (0, 0, 2)), (15, (1, 0.5, 2.9))):
        cage.location = cage.rotation_euler = place
        cage.keyframe_insert("location", frame=frame)
        cage.keyframe_insert("rotation_euler", frame=frame)


def by_an_armature(cage):
    armature = make_armature()
    for frame in (1, 8, 15):
        pose(armature, frame, False)
    group = cage.vertex_groups.new(name="bone2")
    group.add(range(15), 1, "REPLACE")
    cage.vertex_groups.new(name="bone0").add(range(10, 30), 0.7, "REPLACE")
    cage.modifiers.new("Armature", "ARMATURE").object = armature


def by_its_parent(cage):
    parent = linked("Parent")
    cage.parent = parent
    by_its_place(parent)


MOVED = (by_keys, by_a_hook, by_its_place, by_an_armature, by_its_parent)


def assert_it_is_sinew(ob):
    entry = addon_module("run.characters").character(ob)
    assert entry.is_deforming and entry.status.error == ""


def assert_moves(scene, ob, twin, frames=range(1, 21)):
    """The same on all frames, and not still."""
    shapes = []
    for frame in frames:
        scene.frame_set(frame)
        assert_same_shape(ob, twin, 2e-6)
        shapes.append(evaluated(ob))
    assert np.ptp(shapes, axis=0).max() > 1e-3 * diagonal(shapes[0])
    assert_it_is_sinew(ob)


def assert_reopens(folder, ob, twin):
    """The same after the file was saved and opened."""
    ob, twin = reopened(folder, ob, twin)
    assert_same_shape(ob, twin)
    assert_moves(bpy.context.scene, ob, twin, (5, 6, 12))


def assert_same_in_another_graph(scene, ob, twin):
    """A second view layer, as a render has, evaluates the other object too."""
    layer = scene.view_layers.new("Other")
    for frame in (3, 7, 8):
        scene.frame_set(frame)
        layer.update()
        graph = layer.depsgraph
        ours, theirs = evaluated(ob, graph), evaluated(twin, graph)
        assert np.abs(ours - theirs).max() < 2e-6 * diagonal(theirs)
        assert_same_shape(ob, twin)


def nothing(ob):
    pass


def smooth(ob):
    smoothed(ob, factor=0.8, iterations=3)


def on_an_armature(ob):
    armature = make_armature()
    for frame in (1, 8, 15):
        pose(armature, frame, False)
    smoothed(ob, "Armature", "ARMATURE", object=armature)


@needs_memory
@pytest.mark.parametrize("moved", MOVED, ids=lambda part: part.__name__)
@pytest.mark.parametrize("before", (nothing, add_shape_keys, on_an_armature), ids=lambda part: part.__name__)
def test_twenty_frames(fresh_scene, before, moved):
    moved(make_cage())
    ob = make_tube()
    before(ob)
    in_a_cage(ob)
    smooth(ob)
    twin = twin_of(ob)
    accelerate(ob)
    assert_moves(fresh_scene, ob, twin)
    assert stages(ob) == ["Lattice", "Corrective"] and end(ob) == ("", "")
    assert way(ob) == ("KEYS" if before is add_shape_keys else "ATTRIBUTE")


@needs_memory
@pytest.mark.parametrize("before", (nothing, add_shape_keys, on_an_armature), ids=lambda part: part.__name__)
def test_animated_switches_and_driven_strength(fresh_scene, before):
    by_its_place(make_cage())
    ob = make_tube()
    before(ob)
    lattice = in_a_cage(ob)
    smooth(ob)
    for frame, is_on in ((1, True), (5, False), (8, True)):
        lattice.show_viewport = lattice.show_render = is_on
        for setting in ("show_viewport", "show_render"):
            lattice.keyframe_insert(setting, frame=frame)
    driver = ob.driver_add('modifiers["Lattice"].strength').driver
    driver.expression = "0.2 + var / 2"
    variable = driver.variables.new()
    variable.name, variable.type = "var", "TRANSFORMS"
    variable.targets[0].id, variable.targets[0].transform_type = bpy.data.objects["Cage"], "LOC_X"
    twin = twin_of(ob)
    accelerate(ob)
    assert_moves(fresh_scene, ob, twin, (*range(1, 13), 5, 3, 6, 9))
    assert stages(ob) == ["Lattice", "Corrective"] and end(ob) == ("", "")


@needs_memory
@pytest.mark.parametrize("spline", SPLINES)
def test_every_interpolation_and_resolution(fresh_scene, spline):
    for counts in ((2, 2, 2), (1, 4, 1), (5, 3, 4)):
        cage = make_cage((spline,) * 3, counts)
        by_its_place(cage)
        ob = make_tube()
        in_a_cage(ob, cage)
        twin = twin_of(ob)
        accelerate(ob)
        assert_moves(fresh_scene, ob, twin, (1, 5, 9))


@needs_memory
def test_settings(fresh_scene):
    """Of the modifier and of the lattice: strength, groups, outside."""
    cage = make_cage(counts=(4, 4, 4))
    by_its_place(cage)
    ob = make_tube()
    modifier = in_a_cage(ob)
    animate(modifier, strength=(0.3, 1.4))
    twin = twin_of(ob)
    accelerate(ob)
    assert_moves(fresh_scene, ob, twin, (1, 5, 9))

    def both(change):
        for each in (ob, twin):
            change(each.modifiers["Lattice"])
        check()

    def check():
        bpy.context.view_layer.update()
        assert_same_shape(ob, twin, 2e-6)
        before = evaluated(ob)
        assert_moves(fresh_scene, ob, twin, (2, 3, 12, 9))
        return before

    both(lambda m: setattr(m, "vertex_group", "bone2"))
    both(lambda m: setattr(m, "invert_vertex_group", True))
    both(lambda m: setattr(m, "vertex_group", "there is none"))
    cage.data.use_outside = True
    check()
    cage.data.interpolation_type_u = "KEY_CATMULL_ROM"
    check()
    group = cage.vertex_groups.new(name="Part")
    for i in range(0, 64, 3):
        group.add([i], 0.1 + i / 70, "REPLACE")
    before = check()
    cage.data.vertex_group = "Part"
    assert np.abs(check() - before).max() > 0.01
    cage.data.vertex_group = "there is none"
    check()
    cage.vertex_groups.remove(group)
    check()
    both(lambda m: setattr(m, "strength", 0))


@needs_memory
def test_edits_are_seen_at_once(fresh_scene):
    cage = make_cage()
    by_keys(cage)
    other = make_cage(("KEY_LINEAR",) * 3, (2, 3, 2))
    other.scale = (3, 3, 3)
    ob = make_tube()
    in_a_cage(ob, cage)
    smooth(ob)
    twin = twin_of(ob)
    accelerate(ob)

    def check(sinew=True):
        bpy.context.view_layer.update()
        assert_same_shape(ob, twin)
        assert_same_on_all_frames(fresh_scene, ob, twin, (4, 5, 6))
        assert not sinew or assert_it_is_sinew(ob) is None

    check()
    cage.location.x += 0.5
    check()
    cage.data.shape_keys.key_blocks["Bent"].data[3].co = (2, 1, 0)
    check()
    by_a_hook(cage)
    check()
    bpy.data.objects["Puller"].location = (0, 0, 3)
    check()
    for each in (ob, twin):
        each.modifiers["Lattice"].object = other
    check()
    other.data.points[3].co_deform = (1, 1, 1)
    check()
    other.data.points_u = 4
    check()
    for each in (ob, twin):
        for vertex in each.data.vertices:
            vertex.co.x *= 1.2
        each.data.update()
    check()
    for each in (ob, twin):
        in_a_cage(each, cage, "Second", strength=0.4)
    check()
    assert stages(ob) == ["Lattice", "Corrective", "Second"]
    bpy.data.objects.remove(other)
    check()
    assert stages(ob) == ["Corrective", "Second"]
    ob.location = twin.location = (0.3, 0.2, 0.1)
    ob.rotation_euler = twin.rotation_euler = (0.3, 0.2, 0.1)
    check()


@needs_memory
def test_edit_mode_of_the_lattice(fresh_scene):
    """Blender follows the points that are being edited."""
    cage = make_cage()
    ob = make_tube()
    in_a_cage(ob)
    twin = twin_of(ob)
    accelerate(ob)
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 2))
    assert_it_is_sinew(ob)
    select(cage)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.lattice.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(0.3, 0, 0))
    assert_same_shape(ob, twin)
    assert not addon_module("run.characters").character(ob).is_deforming
    bpy.ops.object.mode_set(mode="OBJECT")
    assert_same_on_all_frames(fresh_scene, ob, twin, (3, 4))
    assert_it_is_sinew(ob)


@needs_memory
def test_a_lattice_without_size(fresh_scene):
    cage = make_cage()
    ob = make_tube()
    in_a_cage(ob)
    smooth(ob)
    twin = twin_of(ob)
    accelerate(ob)
    cage.scale.x = 0
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 2))
    cage.scale.x = 1
    assert_same_on_all_frames(fresh_scene, ob, twin, (3, 4))
    assert_it_is_sinew(ob)


@needs_memory
def test_a_lattice_that_depends_on_the_mesh(fresh_scene):
    cage = make_cage()
    ob = make_tube()
    in_a_cage(ob)
    smooth(ob)
    cage.modifiers.new("Shrinkwrap", "SHRINKWRAP").target = ob
    with pytest.raises(RuntimeError) as error:
        accelerate(ob)
    assert "Cage, which it follows, depends on Tube itself: remove one of the two" in str(error.value)


@needs_memory
def test_undo(fresh_scene):
    cage = make_cage()
    by_its_place(cage)
    ob = make_tube()
    in_a_cage(ob)
    twin = twin_of(ob)
    accelerate(ob)
    names = ob.name, twin.name
    fresh_scene.frame_set(4)
    bpy.ops.ed.undo_push(message="Before")
    bpy.data.objects["Cage"].data.points[4].co_deform = (1, 1, 1)
    for name in names:
        bpy.data.objects[name].modifiers["Lattice"].strength = 0.4
    bpy.ops.ed.undo_push(message="Changed")
    for step in (bpy.ops.ed.undo, bpy.ops.ed.redo, bpy.ops.ed.undo):
        step()
        ob, twin = (bpy.data.objects[name] for name in names)
        assert_same_shape(ob, twin)
        assert_same_on_all_frames(bpy.context.scene, ob, twin, (5, 6))
        assert_it_is_sinew(ob)


@needs_memory
def test_output_mesh(fresh_scene):
    by_keys(make_cage())
    ob = make_tube()
    in_a_cage(ob)
    twin = twin_of(ob)
    accelerate(ob, "MESH")
    for frame in (3, 7):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)
        assert np.array_equal(own_positions(ob.sinew.deformed), evaluated(ob))
    assert_it_is_sinew(ob)


@needs_memory
@pytest.mark.parametrize("moved", (by_keys, by_a_hook), ids=lambda part: part.__name__)
def test_save_and_reload(fresh_scene, tmp_path, moved):
    moved(make_cage())
    ob = make_tube()
    in_a_cage(ob)
    twin = twin_of(ob)
    accelerate(ob)
    fresh_scene.frame_set(4)
    assert_reopens(tmp_path, ob, twin)


@needs_memory
@pytest.mark.parametrize("overridden", (False, True), ids=("linked", "overridden"))
def test_from_a_library(fresh_scene, tmp_path, overridden):
    cage = make_cage()
    by_keys(cage)
    by_a_hook(cage)
    ob = make_tube()
    in_a_cage(ob)
    twin = twin_of(ob)
    accelerate(ob)
    names = ob.name, twin.name
    collection = bpy.data.collections.new("Character")
    fresh_scene.collection.children.link(collection)
    for each in (ob, twin, cage, bpy.data.objects["Puller"]):
        collection.objects.link(each)
    scene = into_a_shot(tmp_path, overridden)
    ob, twin = (next(each for each in scene.objects if each.name == name) for name in names)
    assert_moves(scene, ob, twin, (1, 5, 9))


def test_a_file_plays_without_the_addon(fresh_scene, tmp_path):
    by_keys(make_cage())
    ob = make_tube()
    in_a_cage(ob)
    twin = twin_of(ob)
    accelerate(ob)
    fresh_scene.frame_set(9)
    assert_same_shape(ob, twin)
    assert_plays_without_the_addon(tmp_path, ob, twin)


def test_another_graph(fresh_scene):
    by_a_hook(make_cage())
    ob = make_tube()
    in_a_cage(ob)
    twin = twin_of(ob)
    accelerate(ob)
    assert_same_in_another_graph(fresh_scene, ob, twin)


def test_a_small_mesh_is_left_to_blender(fresh_scene):
    addon_module("plan.ways").FEWEST_VERTICES = {"ATTRIBUTE": 3000, "KEYS": 500}
    make_cage()
    ob = make_tube()
    in_a_cage(ob)
    accelerate(ob)
    fresh_scene.frame_set(2)
    assert way(ob) == "BLENDER"
    smooth(ob)
    fresh_scene.frame_set(3)
    assert way(ob) == "ATTRIBUTE"


# --- Surface Deform ---------------------------------------------------------------------------------


def make_body():
    """A tube on an armature that moves, and is at rest on frame 0."""
    body = make_tube()
    body.name = "Body"
    on_an_armature(body)
    for bone in body.modifiers["Armature"].object.pose.bones:
        bone.matrix_basis.identity()
        for path in ("rotation_quaternion", "location"):
            bone.keyframe_insert(path, frame=0)
    return body


def make_clothes(body, bind=True, **settings):
    """A wider tube around the body, bound to it."""
    random = np.random.default_rng(4)
    ob = make_tube()
    ob.name = "Clothes"
    ob.location, ob.rotation_euler = (0.05, 0, 0.1), (0.1, 0, 0.2)
    for vertex in ob.data.vertices:
        vertex.co = np.array(vertex.co) * (1.3, 1.3, 0.95) + random.uniform(-0.05, 0.05, 3)
    smoothed(ob, "Surface", "SURFACE_DEFORM", target=body, **settings)
    if bind:
        bind_surface(ob)
    return ob


def bind_surface(ob):
    """Binds it, or unbinds it."""
    select(ob)
    frame = bpy.context.scene.frame_current
    bpy.context.scene.frame_set(0)
    assert bpy.ops.object.surfacedeform_bind(modifier="Surface") == {"FINISHED"}
    bpy.context.view_layer.update()
    bpy.context.scene.frame_set(frame)


@pytest.fixture
def dressed(fresh_scene):
    """(clothes that Sinew deforms, twin, body)"""
    body = make_body()
    ob = make_clothes(body)
    twin = twin_of(ob)
    accelerate(ob)
    return ob, twin, body


@needs_memory
@pytest.mark.parametrize("bound", (False, True), ids=("body of Blender", "body of Sinew"))
@pytest.mark.parametrize("keys", (False, True), ids=("", "keys"))
def test_clothes(fresh_scene, bound, keys):
    body = make_body()
    fresh_scene.frame_set(1)
    ob = make_clothes(body)
    if keys:
        add_shape_keys(ob)
    smooth(ob)
    twin = twin_of(ob)
    if keys:
        twin.data.shape_keys.animation_data.action = ob.data.shape_keys.animation_data.action
    accelerate(ob)
    if bound:
        accelerate(body)
    assert_moves(fresh_scene, ob, twin)
    assert stages(ob) == ["Surface", "Corrective"] and end(ob) == ("", "")
    assert not bound or assert_it_is_sinew(body) is None


@needs_memory
def test_clothes_by_an_armature_too(fresh_scene):
    body = make_body()
    ob = make_tube()
    smoothed(ob, "Armature", "ARMATURE", object=body.modifiers["Armature"].object)
    smoothed(ob, "Surface", "SURFACE_DEFORM", target=body, strength=0.6)
    bind_surface(ob)
    twin = twin_of(ob)
    accelerate(ob)
    assert_moves(fresh_scene, ob, twin)
    assert stages(ob) == ["Surface"]


@needs_memory
def test_both_outputs_of_a_body(fresh_scene, dressed):
    """Clothes on a body with the output Mesh, and with it themselves."""
    ob, twin, body = dressed
    accelerate(body, "MESH")
    assert_moves(fresh_scene, ob, twin, (1, 5, 9))
    accelerate(ob, "MESH")
    for frame in (3, 7):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)
        assert np.array_equal(own_positions(ob.sinew.deformed), evaluated(ob))


@needs_memory
@pytest.mark.parametrize("sparse", (False, True), ids=("", "sparse"))
@pytest.mark.parametrize("invert", (False, True), ids=("", "inverted"))
def test_settings_of_clothes(fresh_scene, sparse, invert):
    body = make_body()
    more = {"use_sparse_bind": True} if sparse else {}
    ob = make_clothes(body, vertex_group="bone2", invert_vertex_group=invert, falloff=8, **more)
    animate(ob.modifiers["Surface"], strength=(0.3, 1.4))
    twin = twin_of(ob)
    accelerate(ob)
    assert_moves(fresh_scene, ob, twin, (1, 5, 9, 12))
    for each in (ob, twin):
        each.vertex_groups["bone2"].add(range(0, 1200, 3), 0.7, "REPLACE")
    bpy.context.view_layer.update()
    assert_same_shape(ob, twin, 2e-6)
    for name in ("bone1", "there is none"):
        for each in (ob, twin):
            each.modifiers["Surface"].vertex_group = name
        assert_moves(fresh_scene, ob, twin, (2, 3))


def check_of(scene, ob, twin):
    """Function that checks the shape after an edit, and whether it is Sinew's."""

    def check(sinew=True):
        bpy.context.view_layer.update()
        assert_same_shape(ob, twin)
        assert_same_on_all_frames(scene, ob, twin, (4, 5, 6))
        assert addon_module("run.characters").character(ob).is_deforming == sinew

    return check


@needs_memory
def test_edits_of_clothes_and_body(fresh_scene, dressed):
    ob, twin, body = dressed
    check = check_of(fresh_scene, ob, twin)
    check()
    for vertex in body.data.vertices:
        vertex.co.x *= 1.2
    body.data.update()
    check()
    body.modifiers["Armature"].show_viewport = False
    check()
    body.modifiers["Armature"].show_viewport = True
    for each in (ob, twin):
        for vertex in each.data.vertices:
            vertex.co.y *= 1.1
        each.data.update()
    check()
    body.modifiers.new("Solid", "SOLIDIFY")  # more vertices, the old ones first
    check()
    body.modifiers["Solid"].show_viewport = False
    mask = body.modifiers.new("Mask", "MASK")  # fewer
    mask.vertex_group = "bone1"
    check(sinew=False)
    body.modifiers.remove(mask)
    check()
    other = make_body()
    for each in (ob, twin):
        each.modifiers["Surface"].target = other
    check()
    ob.location = twin.location = (1, 2, 3)
    other.location = (0, 0, 1)
    check()
    bpy.data.objects.remove(other)
    bpy.context.view_layer.update()
    assert_same_shape(ob, twin)
    for each in (ob, twin):
        each.modifiers["Surface"].target = body
    check()


def smoothed_before(ob):
    """Adds a Smooth modifier at the top of the stack, and returns a twin."""
    smoothed(ob, "Before", "SMOOTH", iterations=3)
    select(ob)
    bpy.ops.object.modifier_move_to_index(modifier="Before", index=0)
    return twin_of(ob)


def assert_binding_is_followed(scene, ob, name, bind, assert_same):
    """The modifier of that name is bound and unbound while Sinew deforms the mesh. bind: function that does the one or
    the other; assert_same: how the shapes are compared while it is bound."""
    twin = smoothed_before(ob)
    accelerate(ob)
    assert_same_on_all_frames(scene, ob, twin, (1, 2))
    assert end(ob) == (name, "it is not bound: press Bind in that modifier")
    for _ in range(2):
        for each in (ob, twin):
            bind(each)
        assert ob.modifiers[name].is_bound and twin.modifiers[name].is_bound
        assert_same(scene, ob, twin, (3, 4, 9, 3))
        assert stages(ob) == ["Before", name]
        for each in (ob, twin):
            bind(each)
        assert not ob.modifiers[name].is_bound and not twin.modifiers[name].is_bound
        assert_same_on_all_frames(scene, ob, twin, (2, 1))
        assert stages(ob) == ["Before"]


def test_binding_and_unbinding_while_accelerated(fresh_scene):
    ob = make_clothes(make_body(), bind=False)
    assert_binding_is_followed(fresh_scene, ob, "Surface", bind_surface, assert_moves)


def test_clothes_of_another_vertex_count(fresh_scene, dressed):
    ob, twin, _body = dressed
    for each in (ob, twin):
        smooth(each)
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 2))
    for each in (ob, twin):
        select(each)
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.mesh.subdivide()
        bpy.ops.object.mode_set(mode="OBJECT")
    assert_same_on_all_frames(fresh_scene, ob, twin, (3, 4))
    assert end(ob)[0] == "" and way(ob) == "BLENDER"
    count = len(ob.data.vertices)
    reason = addon_module("run.characters").character(ob).way.reason
    assert f"it was bound to 1,200 vertices, and the mesh has {count:,}: bind it again" in reason


@needs_memory
def test_modes_of_the_body(fresh_scene, dressed):
    ob, twin, body = dressed
    for mode in ("EDIT", "SCULPT", "WEIGHT_PAINT"):
        select(body)
        bpy.ops.object.mode_set(mode=mode)
        if mode == "EDIT":
            bpy.ops.mesh.select_all(action="SELECT")
            bpy.ops.transform.translate(value=(0.1, 0, 0))
        assert_same_on_all_frames(fresh_scene, ob, twin, (4, 5, 6))
        assert addon_module("run.characters").character(ob).is_deforming == (mode != "EDIT")
        bpy.ops.object.mode_set(mode="OBJECT")
    assert_moves(fresh_scene, ob, twin, (1, 5))


@needs_memory
@pytest.mark.parametrize("bound", (False, True), ids=("body of Blender", "body of Sinew"))
def test_a_subdivided_body(fresh_scene, bound):
    """Blender may put the subdivision off until somebody asks for the vertices."""
    body = make_body()
    body.modifiers.new("Finer", "SUBSURF").levels = 1
    ob = make_clothes(body)
    twin = twin_of(ob)
    accelerate(ob)
    if bound:
        accelerate(body)
    assert_moves(fresh_scene, ob, twin, (1, 5, 9))
    body.modifiers["Finer"].levels = 2
    assert_moves(fresh_scene, ob, twin, (1, 5, 9))


@needs_memory
def test_undo_of_clothes(fresh_scene, dressed):
    ob, twin, body = dressed
    names = ob.name, twin.name, body.name
    fresh_scene.frame_set(4)
    bpy.ops.ed.undo_push(message="Before")
    for vertex in body.data.vertices:
        vertex.co.x *= 1.2
    body.data.update()
    ob.modifiers["Surface"].strength = twin.modifiers["Surface"].strength = 0.4
    bpy.ops.ed.undo_push(message="Changed")
    for step in (bpy.ops.ed.undo, bpy.ops.ed.redo, bpy.ops.ed.undo):
        step()
        ob, twin, body = (bpy.data.objects[name] for name in names)
        assert_same_shape(ob, twin)
        assert_moves(bpy.context.scene, ob, twin, (5, 6, 11))


@needs_memory
def test_clothes_are_saved_and_reloaded(fresh_scene, dressed, tmp_path):
    ob, twin, _body = dressed
    fresh_scene.frame_set(4)
    assert_reopens(tmp_path, ob, twin)


@needs_memory
@pytest.mark.parametrize("overridden", (False, True), ids=("linked", "overridden"))
def test_clothes_from_a_library(fresh_scene, dressed, tmp_path, overridden):
    ob, twin, body = dressed
    names = ob.name, twin.name
    collection = bpy.data.collections.new("Character")
    fresh_scene.collection.children.link(collection)
    for each in (ob, twin, body, body.modifiers["Armature"].object):
        collection.objects.link(each)
    scene = into_a_shot(tmp_path, overridden)
    ob, twin = (next(each for each in scene.objects if each.name == name) for name in names)
    assert_moves(scene, ob, twin, (1, 5, 9))


def test_clothes_play_without_the_addon(fresh_scene, dressed, tmp_path):
    ob, twin, _body = dressed
    fresh_scene.frame_set(9)
    assert_same_shape(ob, twin)
    assert_plays_without_the_addon(tmp_path, ob, twin)


def test_clothes_in_another_graph(fresh_scene, dressed):
    ob, twin, body = dressed
    accelerate(body)
    assert_same_in_another_graph(fresh_scene, ob, twin)


# --- Mesh Deform ------------------------------------------------------------------------------------


def bind_mesh(ob):
    """Binds it, or unbinds it."""
    select(ob)
    frame = bpy.context.scene.frame_current
    bpy.context.scene.frame_set(0)
    assert bpy.ops.object.meshdeform_bind(modifier="Box") == {"FINISHED"}
    bpy.context.view_layer.update()
    bpy.context.scene.frame_set(frame)


def boxed(cage, bind=True, **settings):
    """A tube in the cage, bound to it."""
    ob = make_tube()
    ob.location = (0.05, 0, 0.1)
    smoothed(ob, "Box", "MESH_DEFORM", object=cage, precision=4, **settings)
    if bind:
        bind_mesh(ob)
        assert ob.modifiers["Box"].is_bound
    return ob


@pytest.fixture
def box(fresh_scene):
    body = make_body()
    return make_mesh_cage(body.modifiers["Armature"].object)


@needs_memory
@pytest.mark.parametrize("keys", (False, True), ids=("", "keys"))
def test_in_a_box(fresh_scene, box, keys):
    ob = boxed(box)
    if keys:
        add_shape_keys(ob)
    smooth(ob)
    twin = twin_of(ob)
    if keys:
        twin.data.shape_keys.animation_data.action = ob.data.shape_keys.animation_data.action
    accelerate(ob)
    assert_moves(fresh_scene, ob, twin)
    assert stages(ob) == ["Box", "Corrective"] and end(ob) == ("", "")


@needs_memory
def test_in_a_box_of_sinew(fresh_scene, box):
    """And both move against each other."""
    ob = boxed(box)
    twin = twin_of(ob)
    accelerate(ob)
    accelerate(box)
    assert_moves(fresh_scene, ob, twin, (1, 5, 9))
    by_its_place(box)
    assert_moves(fresh_scene, ob, twin, (1, 5, 9))
    box.scale = (1.3, 0.8, 1)
    assert_moves(fresh_scene, ob, twin, (1, 5, 9))
    ob.location = twin.location = (0.3, 0.2, 0.1)
    ob.rotation_euler = twin.rotation_euler = (0.3, 0.2, 0.1)
    assert_moves(fresh_scene, ob, twin, (1, 5, 9))
    box.scale = (0, 1, 1)
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 2))


@needs_memory
@pytest.mark.parametrize("invert", (False, True), ids=("", "inverted"))
def test_settings_in_a_box(fresh_scene, box, invert):
    ob = boxed(box, vertex_group="bone2", invert_vertex_group=invert)
    twin = twin_of(ob)
    accelerate(ob)
    assert_moves(fresh_scene, ob, twin, (1, 5, 9))
    for each in (ob, twin):
        each.vertex_groups["bone2"].add(range(0, 1200, 3), 0.7, "REPLACE")
    bpy.context.view_layer.update()
    assert_same_shape(ob, twin, 2e-6)
    for name in ("bone1", "there is none", ""):
        for each in (ob, twin):
            each.modifiers["Box"].vertex_group = name
        assert_moves(fresh_scene, ob, twin, (2, 3, 9))


@needs_memory
def test_edits_of_a_box(fresh_scene, box):
    ob = boxed(box)
    twin = twin_of(ob)
    accelerate(ob)

    check = check_of(fresh_scene, ob, twin)
    check()
    for vertex in box.data.vertices:
        vertex.co.x *= 1.2
    box.data.update()
    check()
    for each in (ob, twin):
        for vertex in each.data.vertices:
            vertex.co.y *= 1.1
        each.data.update()
    check()
    finer = box.modifiers.new("Finer", "SUBSURF")
    check(sinew=False)  # Blender refuses it, too
    box.modifiers.remove(finer)
    check()
    select(box)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(0.1, 0, 0))
    check(sinew=False)
    bpy.ops.object.mode_set(mode="OBJECT")
    check()
    bpy.data.objects.remove(box)
    bpy.context.view_layer.update()
    assert_same_shape(ob, twin)


def test_binding_to_a_box_while_accelerated(fresh_scene, box):
    ob = boxed(box, bind=False)
    assert_binding_is_followed(fresh_scene, ob, "Box", bind_mesh, assert_same_on_all_frames)


def in_the_lattice(ob, _):
    by_keys(make_cage())
    in_a_cage(ob, name="Cage")


def in_the_box(ob, cage):
    smoothed(ob, "Cage", "MESH_DEFORM", object=cage, precision=3)
    select(ob)
    bpy.ops.object.meshdeform_bind(modifier="Cage")


@pytest.mark.parametrize("is_armature_first", (True, False), ids=("behind an armature", "first"))
@pytest.mark.parametrize("caged", (in_the_lattice, in_the_box), ids=lambda part: part.__name__)
def test_an_armature_that_mixes_with_the_cage(fresh_scene, box, caged, is_armature_first):
    """Blender keeps the shape before the cage for it."""
    ob = make_tube()
    armature = box.modifiers["Armature"].object
    if is_armature_first:
        smoothed(ob, "Armature", "ARMATURE", object=armature)
    caged(ob, box)
    smoothed(ob, "Mixed", "ARMATURE", object=armature, use_multi_modifier=True, vertex_group="bone2")
    twin = twin_of(ob)
    accelerate(ob)
    assert_same_on_all_frames(fresh_scene, ob, twin, range(1, 12))
    if is_armature_first:
        assert end(ob) == ("Cage", "Mixed behind it mixes with it: turn off Multi Modifier there if it need not")
    for each in (ob, twin):
        each.modifiers["Mixed"].use_multi_modifier = False
    assert_same_on_all_frames(fresh_scene, ob, twin, range(1, 12))
    if is_armature_first:
        assert end(ob) == ("", "")


def test_dynamic_is_left_to_blender(fresh_scene, box):
    ob = boxed(box, use_dynamic_bind=True)
    twin = smoothed_before(ob)
    accelerate(ob)
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 5))
    assert end(ob) == ("Box", "it was bound with Dynamic, which Sinew cannot evaluate: bind it without")


@needs_memory
def test_a_box_is_saved_and_reloaded(fresh_scene, box, tmp_path):
    ob = boxed(box)
    twin = twin_of(ob)
    accelerate(ob)
    names = ob.name, twin.name
    fresh_scene.frame_set(4)
    bpy.ops.ed.undo_push(message="Before")
    for vertex in box.data.vertices:
        vertex.co.x *= 1.2
    bpy.ops.ed.undo_push(message="Changed")
    bpy.ops.ed.undo()
    ob, twin = (bpy.data.objects[name] for name in names)
    assert_moves(bpy.context.scene, ob, twin, (5, 6, 12, 9))
    assert_plays_without_the_addon(tmp_path, ob, twin)
    assert_reopens(tmp_path, ob, twin)


# --- with other parts -------------------------------------------------------------------------------


def test_clothes_that_share_a_mesh(fresh_scene):
    """Linked duplicates, each with a binding of its own: to two bodies, and in a lattice."""
    first, second = make_body(), make_body()
    second.location.x = 3
    by_its_place(make_cage())
    ob = make_clothes(first)
    other = ob.copy()
    bpy.context.collection.objects.link(other)
    other.location.x += 3
    bind_surface(other)
    other.modifiers["Surface"].target = second
    bind_surface(other)
    in_a_cage(other)
    pairs = [(each, twin_of(each)) for each in (ob, other)]
    for each, _twin in pairs:
        accelerate(each)
    for frame in (1, 5, 9, 10):
        fresh_scene.frame_set(frame)
        for each, twin in pairs:
            assert_same_shape(each, twin, 2e-6)
    for each, _twin in pairs:
        assert way(each) == "CANVAS"
        assert_it_is_sinew(each)
    assert stages(other) == ["Surface", "Lattice"]


@needs_memory
def test_clothes_are_rendered(fresh_scene, dressed, tmp_path):
    """With motion blur, on a body that Sinew deforms."""
    ob, twin, body = dressed
    in_a_cage(ob, make_cage())
    in_a_cage(twin)
    accelerate(body)
    body.hide_render = True
    add_camera(fresh_scene)
    with_motion_blur(fresh_scene)
    assert_same_pictures(*pictures_of_both(fresh_scene, tmp_path, ob, twin))
    assert_it_is_sinew(ob)
