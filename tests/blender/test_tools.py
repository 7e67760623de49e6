"""Blender's own tools on a bound mesh do what they do on its twin that the Armature modifier deforms."""

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, pose
from helpers import ROOT, addon_module, assert_same_shape, needs_memory, own_positions, select, twin_of, way


@pytest.fixture
def pair(fresh_scene):
    """A bound mesh and its twin, with a group that is no bone's, by one armature."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    ob.vertex_groups.new(name="no bone").add(range(100, 1000), 0.9, "REPLACE")
    ob.parent = armature
    armature.data.bones["bone4"].use_deform = False
    twin = twin_of(ob)
    pose(armature, 1, False)
    accelerate(ob)
    fresh_scene.frame_set(2)
    return ob, twin


def weights(ob):
    names = [group.name for group in ob.vertex_groups]
    return [{names[entry.group]: entry.weight for entry in vertex.groups} for vertex in ob.data.vertices]


def assert_same_weights(ours, theirs):
    assert [each.keys() for each in ours] == [each.keys() for each in theirs]
    assert all(each == pytest.approx(other, abs=1e-4) for each, other in zip(ours, theirs))


def select_bones(armature, *names):
    for bone in armature.pose.bones:
        owner = bone if hasattr(bone, "select") else bone.bone  # 5.0 on, before
        owner.select = bone.name in names


def paint_weights(ob, bones=("bone1", "bone2")):
    """Weight Paint, with these bones selected in Pose Mode, as Blender's manual has it."""
    if bpy.context.object.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    armature = ob.parent
    if armature.mode != "POSE":
        select(armature)
        bpy.ops.object.mode_set(mode="POSE")
    select_bones(armature, *bones)
    select(ob, armature)
    bpy.ops.object.mode_set(mode="WEIGHT_PAINT")


OPERATORS = {
    "vertex_group_normalize_all": {"lock_active": False},
    "vertex_group_limit_total": {"limit": 1},
    "vertex_group_clean": {"limit": 0.4},
    "vertex_group_quantize": {"steps": 3},
    "vertex_group_levels": {"gain": 0.5},
    "vertex_group_smooth": {"factor": 0.5},
}


@pytest.mark.parametrize("selection", ("BONE_DEFORM", "BONE_SELECT"))
@pytest.mark.parametrize("operator", OPERATORS)
def test_weight_tools_know_the_bones(pair, operator, selection):
    before, after = weights(pair[1]), []
    for each in pair:
        paint_weights(each)
        assert getattr(bpy.ops.object, operator)(group_select_mode=selection, **OPERATORS[operator]) == {"FINISHED"}
        bpy.ops.object.mode_set(mode="OBJECT")
        after.append(weights(each))
    assert_same_weights(*after)
    assert after[1] != before
    assert [each.get("no bone") for each in after[1]] == [each.get("no bone") for each in before]
    assert_same_shape(*pair)


@pytest.mark.parametrize("kind", ("AUTOMATIC", "ENVELOPES"))
def test_weights_assigned_from_bones(pair, kind):
    before, after = weights(pair[1]), []
    for each in pair:
        paint_weights(each)
        assert bpy.ops.paint.weight_from_bones(type=kind) == {"FINISHED"}
        bpy.ops.object.mode_set(mode="OBJECT")
        after.append(weights(each))
    assert_same_weights(*after)
    assert after[1] != before
    assert_same_shape(*pair)


def test_the_armature_is_at_hand_in_weight_paint(pair):
    """What posing and picking bones while painting asks for."""
    for each in pair:
        paint_weights(each)
        assert bpy.context.pose_object == each.parent
        assert bpy.context.mode == "PAINT_WEIGHT"
        assert bpy.ops.pose.select_all.poll() and bpy.ops.pose.rot_clear.poll()
        assert bpy.ops.pose.select_all(action="INVERT") == {"FINISHED"}
        assert {bone.name for bone in bpy.context.selected_pose_bones} == {"bone0", "bone3", "bone4", "side"}


@pytest.mark.parametrize("parented", (True, False), ids=("parented", "free"))
def test_vertex_groups_follow_a_bone_that_is_renamed(pair, parented):
    armature = pair[0].parent
    if not parented:
        for each in pair:
            each.parent = None
    armature.data.bones["bone2"].name = "elbow"
    bpy.context.view_layer.update()
    for each in pair:
        assert "elbow" in each.vertex_groups and "bone2" not in each.vertex_groups
    bpy.context.scene.frame_set(3)
    assert_same_shape(*pair)


def test_vertex_groups_follow_flip_names(pair):
    armature = pair[0].parent
    armature.data.bones["bone2"].name, armature.data.bones["side"].name = "arm.L", "leg.R"
    select(armature)
    bpy.ops.object.mode_set(mode="POSE")
    bpy.ops.pose.select_all(action="SELECT")
    assert bpy.ops.pose.flip_names() == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    for each in pair:
        assert {"arm.R", "leg.L"} <= {group.name for group in each.vertex_groups}
    bpy.context.scene.frame_set(3)
    assert_same_shape(*pair)


def with_keys(pair):
    for each in pair:
        add_shape_keys(each)
    bpy.context.scene.frame_set(3)
    assert way(pair[0]) == "KEYS"


def same_meshes(ob, twin):
    ours, theirs = own_positions(ob), own_positions(twin)
    return ours.shape == theirs.shape and np.allclose(ours, theirs, atol=1e-5)


@pytest.mark.parametrize("name", ("Armature", "Subdivision", "Bevel"))
def test_a_modifier_is_applied(pair, name):
    """The armature's own, or one behind it, which Blender applies to the rest shape."""
    for each in pair:
        select(each)
        each.modifiers.new("Subdivision", "SUBSURF")
        each.modifiers.new("Bevel", "BEVEL")
        bpy.context.view_layer.update()
        assert bpy.ops.object.modifier_apply(modifier=name) == {"FINISHED"}
    assert same_meshes(*pair)
    for frame in (4, 7):
        bpy.context.scene.frame_set(frame)
        assert_same_shape(*pair)
    assert pair[0].sinew.is_bound == (name != "Armature")


def test_a_deleted_mesh_with_keys_is_not_looked_for(pair):
    """That would go through all objects of the file on each update."""
    with_keys(pair)
    twin = pair[1]
    bpy.data.objects.remove(pair[0])
    bpy.context.view_layer.update()
    characters = addon_module("run.characters")
    before = characters.gathering()
    for x in range(3):
        twin.location.x = x
        bpy.context.view_layer.update()
    assert characters.gathering() == before


def key_positions(ob):
    """(K, V, 3)"""
    blocks = ob.data.shape_keys.key_blocks
    return np.array([[point.co for point in block.data] for block in blocks])


@pytest.mark.parametrize("active", (0, 1), ids=("the reference", "another key"))
@pytest.mark.parametrize("kind", ("UV_WARP", "VERTEX_WEIGHT_EDIT"))
def test_applying_what_moves_nothing_leaves_the_keys_alone(pair, kind, active):
    """Blender copies the evaluated keys to the original."""
    names = [each.name for each in pair]
    with_keys(pair)
    for each in pair:
        each.active_shape_key_index = active
        modifier = each.modifiers.new("Moves nothing", kind)
        if kind == "VERTEX_WEIGHT_EDIT":
            modifier.vertex_group = "no bone"
    for frame in (4, 5, 6):  # the last one by the fast path
        bpy.context.scene.frame_set(frame)
    wanted = key_positions(pair[1])
    bpy.ops.ed.undo_push(message="before")
    for each in pair:
        select(each)
        assert bpy.ops.object.modifier_apply(modifier="Moves nothing") == {"FINISHED"}
    bpy.ops.ed.undo_push(message="after")
    for step in (None, bpy.ops.ed.undo, bpy.ops.ed.redo):
        if step is not None:
            step()
        ob, twin = [bpy.data.objects[name] for name in names]
        assert np.array_equal(key_positions(ob), wanted) and np.array_equal(key_positions(twin), wanted)
        assert np.array_equal(own_positions(ob), own_positions(twin))
        assert_same_shape(ob, twin)
    for frame in (7, 8, 9):
        bpy.context.scene.frame_set(frame)
        assert_same_shape(ob, twin)
        assert way(ob) == "KEYS"


@pytest.mark.parametrize("keys", (False, True), ids=("plain", "shape keys"))
@pytest.mark.parametrize("keep", (False, True), ids=("applied", "kept"))
def test_the_shape_is_saved_as_a_shape_key(pair, keys, keep):
    if keys:
        with_keys(pair)
    shapes = []
    for each in pair:
        select(each)
        bpy.ops.object.modifier_apply_as_shapekey(keep_modifier=keep, modifier="Armature")
        key = each.data.shape_keys.key_blocks["Armature"]
        shapes.append(np.array([point.co for point in key.data]))
    assert np.allclose(*shapes, atol=1e-5) and np.abs(shapes[0] - own_positions(pair[0])).max() > 0.1
    for frame in (4, 7):
        bpy.context.scene.frame_set(frame)
        assert_same_shape(*pair)


@pytest.mark.parametrize("keys", (False, True), ids=("plain", "shape keys"))
def test_nothing_of_the_original_is_written(pair, keys):
    """Frame by frame: neither its positions nor its shape keys, their muting or values."""
    if keys:
        with_keys(pair)
    ob = pair[0]

    def everything():
        found = [own_positions(ob)]
        for block in ob.data.shape_keys.key_blocks if keys else ():
            found += [np.array([point.co for point in block.data]), block.mute]
        found += [
            np.array([item.vector for item in attribute.data])
            for attribute in ob.data.attributes
            if attribute.data_type == "FLOAT_VECTOR" and attribute.domain == "POINT"
        ]
        return found

    before = everything()
    for frame in (4, 7, 9):
        bpy.context.scene.frame_set(frame)
    after = everything()
    assert len(before) == len(after) and all(np.array_equal(a, b) for a, b in zip(before, after))


def cage():
    bpy.ops.mesh.primitive_cube_add(size=20)
    return bpy.context.object


def in_cage(modifier):
    modifier.object = cage()
    modifier.precision = 3  # which is quick


MODIFIERS = {
    "CORRECTIVE_SMOOTH": ("correctivesmooth_bind", lambda modifier: setattr(modifier, "rest_source", "BIND")),
    "MESH_DEFORM": ("meshdeform_bind", in_cage),
    "SURFACE_DEFORM": ("surfacedeform_bind", lambda modifier: setattr(modifier, "target", cage())),
}


@pytest.mark.parametrize("keys", (False, True), ids=("plain", "shape keys"))
@pytest.mark.parametrize("kind", MODIFIERS)
def test_modifiers_behind_it_are_bound_to_the_shape(pair, kind, keys):
    if keys:
        with_keys(pair)
    operator, prepare = MODIFIERS[kind]
    for each in pair:
        modifier = each.modifiers.new("Behind", kind)
        prepare(modifier)
        select(each)
        bpy.context.view_layer.update()
        assert getattr(bpy.ops.object, operator)(modifier="Behind") == {"FINISHED"}
        assert getattr(modifier, "is_bind", getattr(modifier, "is_bound", None))
    for frame in (4, 7):
        bpy.context.scene.frame_set(frame)
        assert_same_shape(*pair)


@needs_memory
def test_the_modifier_sinew_as_a_shape_key_is_refused(pair):
    """By Blender, in its words, for which the manual has the cure."""
    select(pair[0])
    with pytest.raises(RuntimeError, match="Only deforming modifiers can be applied to shapes"):
        bpy.ops.object.modifier_apply_as_shapekey(modifier="Sinew")
    assert_same_shape(*pair)
    assert "Only deforming modifiers can be applied to shapes" in (ROOT / "docs/accelerate.md").read_text()


@needs_memory
def test_painted_weights_are_read_whole(pair, monkeypatch):
    """A dab must not cost a loop over all vertices. Through the API the same comes out."""
    ob, twin = pair
    meshes, weights = addon_module("blender.meshes"), addon_module("host.deform_verts")
    assert all(np.array_equal(a, b) for a, b in zip(meshes.read_weights(ob.data), meshes._weights_by_bmesh(ob.data)))
    one_by_one = []
    monkeypatch.setattr(meshes, "_weights_by_bmesh", one_by_one.append)
    for known in (False, True):
        monkeypatch.setattr(weights, "_weights_are_known", known)
        for each in pair:
            each.vertex_groups["bone1"].add(range(300 + 100 * known), 0.8, "REPLACE")
            each.data.update()
        bpy.context.view_layer.update()
        assert_same_shape(ob, twin)
        assert weights._weights_are_known and one_by_one == []


@needs_memory
@pytest.mark.parametrize("spoil", ("count", "weight"))
def test_weights_that_lie_elsewhere_are_read_one_by_one(pair, monkeypatch, spoil):
    """As they would in a Blender whose memory looks otherwise."""
    ob, twin = pair
    meshes, weights = addon_module("blender.meshes"), addon_module("host.deform_verts")
    monkeypatch.setattr(weights, "_weights_are_known", False)
    read, asked = weights.read, []

    def wrong(address, count):
        offsets, groups, numbers = read(address, count)
        return (offsets, groups, numbers + 1) if spoil == "weight" else (offsets, groups[:-1], numbers[:-1])

    by_bmesh = meshes._weights_by_bmesh
    monkeypatch.setattr(weights, "read", wrong)
    monkeypatch.setattr(meshes, "_weights_by_bmesh", lambda mesh: asked.append(mesh) or by_bmesh(mesh))
    for each in pair:
        each.vertex_groups["bone1"].add(range(300), 0.8, "REPLACE")
        each.data.update()
    bpy.context.view_layer.update()
    assert asked and not weights._weights_are_known
    assert_same_shape(ob, twin)
