"""A mesh so small that the node group would cost more than Sinew saves is left to Blender's own modifier."""

import bmesh
import bpy
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, pose, smoothed
from helpers import addon_module, assert_same_on_all_frames, needs_memory, select, twin_of, way

VERTICES = 1_200  # of the tests' tube


@pytest.fixture
def limit(monkeypatch):
    """Function that sets below how many vertices meshes are left to Blender."""
    ways = addon_module("plan.ways")
    return lambda number: monkeypatch.setattr(ways, "FEWEST_VERTICES", {"ATTRIBUTE": number, "KEYS": number})


def character(*parts):
    armature = make_armature()
    for frame in (1, 8, 15):
        pose(armature, frame, False)
    ob = make_mesh(armature, False)
    for part in parts:
        part(ob)
    twin = twin_of(ob)
    accelerate(ob)
    return ob, twin


@pytest.mark.parametrize("parts", ((), (add_shape_keys,)), ids=("plain", "keys"))
def test_fewer_vertices_than_pay(fresh_scene, limit, parts):
    limit(VERTICES + 1)
    ob, twin = character(*parts)
    assert_same_on_all_frames(fresh_scene, ob, twin, range(1, 6))
    reason = addon_module("run.characters").character(ob).way.reason
    assert way(ob) == "BLENDER" and "fewer than 1,201 vertices" in reason
    limit(VERTICES)
    ob.data.update_tag()
    ob.update_tag()
    bpy.context.view_layer.update()
    assert_same_on_all_frames(fresh_scene, ob, twin, range(6, 11))
    assert way(ob) == ("KEYS" if parts else "ATTRIBUTE")


@pytest.fixture
def calls(monkeypatch):
    """The list of names of objects for which Blender has called the full path."""
    in_pass, found = addon_module("run.in_pass"), []
    deform = in_pass._run

    def count(entry, copy, ob):
        found.append(ob.name)
        deform(entry, copy, ob)

    monkeypatch.setattr(in_pass, "_run", count)
    return found


@needs_memory
def test_blender_calls_nothing_on_frames_that_it_deforms(fresh_scene, limit, calls):
    limit(VERTICES + 1)
    ob, twin = character()
    bpy.context.view_layer.update()
    calls.clear()
    assert_same_on_all_frames(fresh_scene, ob, twin, range(1, 6))
    assert calls == [] and "fewer than" in addon_module("run.characters").character(ob).way.reason
    ob.update_tag()  # Blender copies the object again
    bpy.context.view_layer.update()
    assert calls == [ob.name]
    assert_same_on_all_frames(fresh_scene, ob, twin, range(6, 9))
    assert calls == [ob.name]


def subdivide(mesh):
    bm = bmesh.new()
    bm.from_mesh(mesh)
    bmesh.ops.subdivide_edges(bm, edges=list(bm.edges), cuts=1, use_grid_fill=True)
    bm.to_mesh(mesh)
    bm.free()


def test_a_mesh_that_grows_and_shrinks(fresh_scene, limit):
    """Only the mesh is edited, not the object."""
    limit(VERTICES + 1)
    ob, twin = character()
    small = ob.data.copy()
    assert_same_on_all_frames(fresh_scene, ob, twin, range(1, 4))
    for mesh in (ob.data, twin.data):
        subdivide(mesh)
    bpy.context.view_layer.update()
    assert_same_on_all_frames(fresh_scene, ob, twin, range(4, 7))
    assert way(ob) == "ATTRIBUTE" and addon_module("run.characters").character(ob).is_deforming
    for mesh in (ob.data, twin.data):
        bm = bmesh.new()
        bm.from_mesh(small)
        bm.to_mesh(mesh)
        bm.free()
    bpy.context.view_layer.update()
    assert_same_on_all_frames(fresh_scene, ob, twin, range(7, 10))
    assert way(ob) == "BLENDER" and len(ob.data.vertices) == VERTICES


def test_undoing_the_growth(fresh_scene, limit):
    limit(VERTICES + 1)
    ob, twin = character()
    bpy.context.view_layer.update()
    name, other = ob.name, twin.name
    bpy.ops.ed.undo_push(message="small")
    for mesh in (ob.data, twin.data):
        subdivide(mesh)
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="large")
    for step, wanted in ((bpy.ops.ed.undo, "BLENDER"), (bpy.ops.ed.redo, "ATTRIBUTE"), (bpy.ops.ed.undo, "BLENDER")):
        step()
        ob, twin = bpy.data.objects[name], bpy.data.objects[other]
        assert_same_on_all_frames(bpy.context.scene, ob, twin, range(1, 4))
        assert way(ob) == wanted


def another_method(ob):
    ob.sinew.method = "BLENDED"


def output_mesh(ob):
    ob.sinew.output = "MESH"


def own_smoothing(ob):
    ob.sinew.skinning.smooth_iterations = 2


@pytest.mark.parametrize("ask", (another_method, output_mesh, own_smoothing), ids=lambda ask: ask.__name__)
def test_a_small_mesh_with_what_blender_does_not_have(limit, ask):
    limit(VERTICES + 1)
    ob, _ = character()
    assert way(ob) == "BLENDER"
    ask(ob)
    bpy.context.view_layer.update()
    addon_module("run.mail").deliver()
    bpy.context.view_layer.update()
    assert way(ob) == "ATTRIBUTE" and addon_module("run.characters").character(ob).is_deforming


def test_a_small_mesh_that_is_smoothed(fresh_scene, limit):
    limit(VERTICES + 1)
    ob, twin = character(smoothed)
    assert_same_on_all_frames(fresh_scene, ob, twin, range(1, 6))
    assert way(ob) == "ATTRIBUTE"


@needs_memory
def test_of_several_meshes_the_small_ones_are_left_alone(fresh_scene, limit):
    """Each alone is bound if the user asks for it, so that smoothing can be added later."""
    limit(VERTICES)
    armature = make_armature()
    large, small = make_mesh(armature, False), make_mesh(armature, False)
    bm = bmesh.new()
    bm.from_mesh(small.data)
    bmesh.ops.delete(bm, geom=list(bm.verts)[:600])
    bm.to_mesh(small.data)
    bm.free()
    select(armature)
    assert bpy.ops.object.sinew_bind() == {"FINISHED"}
    assert (large.sinew.is_bound, small.sinew.is_bound) == (True, False)
    assert [modifier.type for modifier in small.modifiers] == ["ARMATURE"] and not small.animation_data
    select(small)
    assert bpy.ops.object.sinew_bind() == {"FINISHED"}
    assert small.sinew.is_bound and way(small) == "BLENDER"
