"""What Sinew knows of Blender's memory: read from a file that the running Blender writes, and compared with Blender's
API when it is first used. What is lost where it does not hold: test_memory.py."""

import sys
import threading

import bpy
import pytest

from characters import accelerate, make_armature, make_mesh, pose, with_bendy_bones
from helpers import addon_module, assert_same_shape, needs_memory, twin_of, way
from zoo import forget_memory


@pytest.fixture
def host():
    """The room's modules by name. Afterwards all is looked at again."""
    names = ("contract", "proof", "deform_verts")
    forget_memory()
    yield {name: addon_module(f"host.{name}") for name in names}
    forget_memory()


def test_temporary_data_are_not_freed_while_a_name_stands_for_them():
    """Blender gives away its one reference, the one that the name behind `as` holds."""
    name = object()
    _held_by_both_contexts = [name, name]
    expected = sys.getrefcount(name)
    with addon_module("host.layout").temporary_data() as data:
        count = sys.getrefcount(data)
        assert count >= expected
        assert isinstance(data, bpy.types.BlendData)


def test_reading_the_layout_changes_nothing_in_the_open_file():
    before = [repr(one) for one in bpy.data.user_map()]
    structs = addon_module("host.layout").structs.__wrapped__()
    assert structs["Mesh"].size > 0
    assert [repr(one) for one in bpy.data.user_map()] == before


# --- the contract ---------------------------------------------------------------------------------


def test_what_is_not_in_the_contract_cannot_be_asked_for(host):
    with pytest.raises(KeyError):
        host["contract"].offset("Object", "parent")
    with pytest.raises(KeyError):
        host["contract"].unused_byte("Scene")


# --- what is read is compared with what the API says: see also test_memory.py -----------------------


def test_weights_in_another_storage_are_read_through_the_api(host, monkeypatch, fresh_scene):
    """The character would stay in its rest pose otherwise, without a word."""
    monkeypatch.setattr(host["deform_verts"], "_DEFORM_VERTICES", 9999)
    armature = make_armature()
    ob = make_mesh(armature, False)
    twin = twin_of(ob)
    pose(armature, 1, False)
    accelerate(ob)
    for frame in (1, 2):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)
    assert way(ob) == "ATTRIBUTE"


@needs_memory
@pytest.mark.parametrize("spoilt", (False, True))
def test_connections_are_what_the_api_says(host, monkeypatch, spoilt):
    """The first time, they are compared: memory that differs is never used."""
    mesh_arrays, meshes = addon_module("host.mesh_arrays"), addon_module("blender.meshes")
    read = mesh_arrays._in_a_row
    if spoilt:
        monkeypatch.setattr(mesh_arrays, "_in_a_row", lambda *asked: read(*asked) + 1)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=7, ring_count=5)
    mesh = bpy.context.object.data
    mesh.vertices.add(1)
    mesh.edges.add(1)
    mesh.edges[-1].vertices = 0, len(mesh.vertices) - 1
    for _ in range(2):
        edges, offsets, corners = meshes.read_topology(mesh)
        assert edges.tolist() == [list(edge.vertices) for edge in mesh.edges]
        assert offsets.tolist() == [*(face.loop_start for face in mesh.polygons), len(mesh.loops)]
        assert corners.tolist() == [corner.vertex_index for corner in mesh.loops]
        assert [each.dtype for each in (edges, offsets, corners)] == ["int32"] * 3
    assert {"vertices", "loop_start", "vertex_index"}.isdisjoint(host["proof"]._proved) == spoilt


def test_few_connections_are_read_too():
    mesh = bpy.data.meshes.new("Few")
    for points, edges, faces in (([], [], []), ([(0, 0, 0)] * 3, [(0, 1)], []), ([(0, 0, 0)] * 3, [], [(0, 1, 2)])):
        mesh.clear_geometry()
        mesh.from_pydata(points, edges, faces)
        found, offsets, corners = addon_module("blender.meshes").read_topology(mesh)
        assert found.shape == (len(mesh.edges), 2)
        assert (len(offsets), corners.tolist()) == (len(faces) + 1, [v for face in faces for v in face])


def test_each_is_compared_once(host, monkeypatch, fresh_scene):
    """On the frames after that nothing is asked of Blender's API."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    with_bendy_bones(ob)
    pose(armature, 1, False)
    accelerate(ob)
    fresh_scene.frame_set(1)
    assert way(ob) == "ATTRIBUTE"
    on = "switches of modifiers", (True, True)
    assert {"bones", "segments", "attributes", on, "the bit that disables modifiers"} <= host["proof"]._proved
    monkeypatch.setattr(host["proof"], "give", lambda *_: pytest.fail("it was compared again"))
    for frame in (2, 3, 4):
        fresh_scene.frame_set(frame)


def test_evaluations_of_two_threads_are_counted(host):
    """A render's goes on when one of the main thread has ended. One whose thread is gone has ended, too."""
    evaluations, go_on = addon_module("host.evaluations"), threading.Event()
    evaluations.forget()
    other = threading.Thread(target=lambda: (evaluations.announce(), go_on.wait(60)))
    other.start()
    while not evaluations.others_run():
        pass
    evaluations.announce()
    evaluations.conclude()
    assert evaluations.ends_in_handlers() and evaluations.others_run()
    assert not evaluations.others_run({other.ident})
    go_on.set()
    other.join()
    assert not evaluations.others_run()
    evaluations.forget()
    assert not evaluations.ends_in_handlers()
