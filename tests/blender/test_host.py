"""What Sinew knows of Blender's memory: read from a file that the running Blender writes, checked, and compared with
Blender's API when it is first used. Where it does not hold, Blender's own modifiers deform."""

import dataclasses
import re
import sys

import bpy
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, pose, with_bendy_bones
from helpers import addon_module, assert_same_shape, twin_of, way

says_errors = pytest.mark.says_errors


@pytest.fixture
def host():
    """The room's modules by name. Afterwards all is looked at again."""
    names = ("contract", "layout", "proof", "deform_verts", "motions", "key_blocks", "vector_arrays", "switches")
    modules = {name: addon_module(f"host.{name}") for name in names}
    forget(modules)
    yield modules
    forget(modules)


def forget(modules):
    modules["contract"].forget()
    modules["proof"].forget()
    modules["motions"]._bone_layout.cache_clear()
    modules["motions"].pose_layout.cache_clear()
    modules["key_blocks"].key_layout.cache_clear()
    addon_module("host.places").place_layout.cache_clear()


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


def test_the_running_blender_keeps_the_contract(host):
    assert host["contract"].differences(host["layout"].structs()) == []
    assert host["contract"].trouble() == ""


def test_what_is_not_in_the_contract_cannot_be_asked_for(host):
    with pytest.raises(KeyError):
        host["contract"].offset("Object", "parent")
    with pytest.raises(KeyError):
        host["contract"].unused_byte("Scene")


def changed(structs, kind, change):
    return {**structs, kind: change(structs[kind])}


def without(name):
    def change(struct):
        return dataclasses.replace(struct, members={k: v for k, v in struct.members.items() if k != name})

    return change


def with_member(name, **changes):
    def change(struct):
        offset, kind, size = struct.members[name]
        new = changes.get("offset", offset), changes.get("kind", kind), changes.get("size", size)
        return dataclasses.replace(struct, members={**struct.members, name: new})

    return change


def without_unused_bytes(struct):
    members = {name: found for name, found in struct.members.items() if not name.lstrip("*").startswith("_pad")}
    return dataclasses.replace(struct, members=members)


def wider(struct):
    return dataclasses.replace(struct, size=struct.size + 8)


SPOILED = {
    "gone": ("Mesh", without("vdata"), "Mesh has no vdata"),
    "wider": ("KeyBlock", with_member("curval", kind="double", size=8), "KeyBlock.curval is double of 8 bytes"),
    "moved in a list": ("bPoseChannel", with_member("*next", offset=8), r"bPoseChannel.\*next is at byte 8"),
    "an array's stride": ("MDeformVert", wider, "MDeformVert has 24 bytes instead of 16"),
    "without unused bytes": ("Mesh", without_unused_bytes, "Mesh has no unused byte"),
    "another type": ("bPoseChannel_Runtime", with_member("bbone_segments", kind="float"), "is float of 4 bytes"),
    "no place": (
        "Object",
        lambda struct: without("*runtime")(without("object_to_world")(without("obmat")(struct))),
        "Object has no matrix",
    ),
}


@pytest.mark.parametrize("spoil", SPOILED)
def test_another_layout_is_named_and_blender_deforms(host, monkeypatch, spoil, fresh_scene):
    kind, change, clause = SPOILED[spoil]
    structs = changed(host["layout"].structs(), kind, change)
    monkeypatch.setattr(host["layout"], "structs", lambda: structs)
    assert re.search(clause, "; ".join(host["contract"].differences(structs)))
    assert_blender_deforms(fresh_scene, bpy.app.version_string)


def test_a_struct_that_is_gone_is_named(host):
    structs = {k: v for k, v in host["layout"].structs().items() if k != "KeyBlock"}
    assert "there is no struct KeyBlock" in host["contract"].differences(structs)


def test_a_layout_that_cannot_be_read_is_asked_for_once(host, monkeypatch, fresh_scene):
    asked = []

    def fail():
        asked.append(1)
        raise OSError("no space")

    monkeypatch.setattr(host["layout"], "structs", fail)
    assert_blender_deforms(fresh_scene, "cannot be read: no space")
    assert_blender_deforms(fresh_scene, "cannot be read: no space")
    assert asked == [1]


def assert_blender_deforms(scene, reason):
    """A bound character has the right shape on each frame, and says why Blender makes it."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    twin = twin_of(ob)
    for frame in (1, 4, 7):
        pose(armature, frame, False)
    accelerate(ob)
    for frame in (2, 3, 5):
        scene.frame_set(frame)
        assert_same_shape(ob, twin)
    assert way(ob) == "BLENDER"
    assert reason in addon_module("run.characters").character(ob).way.reason
    ob.vertex_groups["bone1"].add(range(300), 0.8, "REPLACE")  # everything else works
    twin.vertex_groups["bone1"].add(range(300), 0.8, "REPLACE")
    scene.frame_set(6)
    assert_same_shape(ob, twin)
    with bpy.context.temp_override(object=ob, active_object=ob, selected_objects=[ob]):
        assert bpy.ops.object.sinew_unbind() == {"FINISHED"}
    assert_same_shape(ob, twin)


# --- what is read is compared with what the API says ------------------------------------------------


def spoil_motions(host, monkeypatch):
    place = host["motions"]._bone_layout()
    monkeypatch.setattr(host["motions"], "_bone_layout", lambda: (place[0], place[1] + 64, *place[2:]))  # pose_mat


def spoil_segments(host, monkeypatch):
    contract = host["contract"]
    other = contract.offset("bPoseChannel_Runtime", "*bbone_deform_mats") - 8  # pose or rest matrices
    place = host["motions"]._bone_layout()
    start = contract.offset("bPoseChannel", "runtime")
    monkeypatch.setattr(host["motions"], "_bone_layout", lambda: (*place[:3], start + other))


def spoil_keys(host, monkeypatch):
    flag, value, *rest = host["key_blocks"].key_layout()
    monkeypatch.setattr(host["key_blocks"], "key_layout", lambda: (flag, value - 4, *rest))  # its place in time


def spoil_attributes(host, monkeypatch):
    vectors_at = host["vector_arrays"].vectors_at
    monkeypatch.setattr(host["vector_arrays"], "vectors_at", lambda address, count: vectors_at(address + 4, count))


def spoil_switches(host, monkeypatch):
    monkeypatch.setattr(host["switches"], "_VIEWPORT", 4)


def spoil_setting_aside(host, monkeypatch):
    monkeypatch.setattr(host["switches"], "_ASIDE", 1 << 30)


def spoil_muting(host, monkeypatch):
    monkeypatch.setattr(host["switches"], "_MUTED", 1 << 5)
    monkeypatch.setattr(addon_module("plan.ways"), "FEWEST_VERTICES", {"ATTRIBUTE": 10_000, "KEYS": 10_000})


def plain(ob):
    pass


@says_errors
@pytest.mark.parametrize(
    ("spoil", "prepare", "clause"),
    (
        (spoil_motions, plain, "the motions of bones are not where they were"),
        (spoil_segments, with_bendy_bones, "the motions of segments are not where they were"),
        (spoil_keys, add_shape_keys, "shape keys are not where they were"),
        (spoil_attributes, plain, "attributes are not where they were"),
        (spoil_switches, plain, "the bits of switches of modifiers have another meaning"),
        (spoil_muting, plain, "the bits of muted drivers have another meaning"),
        (spoil_setting_aside, plain, "the bit that disables modifiers has another meaning"),
    ),
)
def test_another_meaning_is_noticed_before_it_makes_a_wrong_shape(
    host, monkeypatch, fresh_scene, spoil, prepare, clause
):
    armature = make_armature()
    obs = [make_mesh(armature, False) for _ in range(2)]
    for ob in obs:
        prepare(ob)
    twin = twin_of(obs[0])
    for frame in (1, 4, 7):
        pose(armature, frame, False)
    spoil(host, monkeypatch)
    for ob in obs:
        accelerate(ob)
    for frame in (2, 3, 5, 6):
        fresh_scene.frame_set(frame)
        for ob in obs:
            assert_same_shape(ob, twin)
    assert clause in host["contract"].trouble()
    for ob in obs:
        ob.data.update()
    fresh_scene.frame_set(7)
    for ob in obs:
        assert way(ob) == "BLENDER"
        assert_same_shape(ob, twin)


def test_weights_in_another_storage_are_read_through_the_api(host, monkeypatch, fresh_scene):
    """The character would stay in its rest pose otherwise, without a word."""
    monkeypatch.setattr(host["deform_verts"], "_DEFORM_VERTICES", 9999)
    monkeypatch.setattr(host["deform_verts"], "_weights_are_known", False)
    armature = make_armature()
    ob = make_mesh(armature, False)
    twin = twin_of(ob)
    pose(armature, 1, False)
    accelerate(ob)
    for frame in (1, 2):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)
    assert way(ob) == "ATTRIBUTE"


@pytest.mark.parametrize("spoilt", (False, True))
def test_connections_are_what_the_api_says(host, monkeypatch, spoilt):
    """The first time, they are compared: memory that differs is never used."""
    connections, meshes = addon_module("host.connections"), addon_module("blender.meshes")
    read = connections._in_a_row
    if spoilt:
        monkeypatch.setattr(connections, "_in_a_row", lambda *asked: read(*asked) + 1)
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
