"""Modifiers before or between what Sinew replaces that change neither vertices nor positions."""

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, hook, make_armature, make_mesh, pose
from helpers import (
    addon_module,
    assert_plays_without_the_addon,
    assert_same_on_all_frames,
    assert_same_shape,
    depsgraph,
    evaluated,
    select,
    stages,
    twin_of,
    way,
)


@pytest.fixture
def character(fresh_scene):
    """A mesh, not yet bound, whose armature moves over frames 1 to 10."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    for frame in (1, 4, 7, 10):
        pose(armature, frame, False)
    return ob


def reason(ob):
    """Why Blender deforms it."""
    return addon_module("run.characters").character(ob).way.reason


def uv_warp(ob):
    ob.data.uv_layers or ob.data.uv_layers.new()
    modifier = ob.modifiers.new("Before", "UV_WARP")
    modifier.offset = 0.25, 0.5


def weight_edit(ob):
    mask = ob.vertex_groups.new(name="Paint")
    mask.add(range(0, len(ob.data.vertices), 3), 0.5, "REPLACE")
    modifier = ob.modifiers.new("Before", "VERTEX_WEIGHT_EDIT")
    modifier.vertex_group, modifier.default_weight, modifier.falloff_type = "Paint", 0.2, "SHARP"


def weight_mix(ob):
    weight_edit(ob)
    ob.modifiers.remove(ob.modifiers["Before"])
    modifier = ob.modifiers.new("Before", "VERTEX_WEIGHT_MIX")
    modifier.vertex_group_a, modifier.default_weight_b, modifier.mix_mode = "Paint", 0.7, "ADD"
    modifier.mix_set = "ALL"


def weighted_normal(ob):
    ob.modifiers.new("Before", "WEIGHTED_NORMAL").weight = 80


def uv_project(ob):
    uv_warp(ob)
    ob.modifiers.remove(ob.modifiers["Before"])
    projector = bpy.data.objects.new("Projector", None)
    bpy.context.collection.objects.link(projector)
    projector.location = 1, 2, 3
    modifier = ob.modifiers.new("Before", "UV_PROJECT")
    modifier.uv_layer = ob.data.uv_layers[0].name
    modifier.projectors[0].object = projector


def data_transfer(ob):
    bpy.ops.mesh.primitive_uv_sphere_add(radius=3)
    source = bpy.context.object
    modifier = ob.modifiers.new("Before", "DATA_TRANSFER")
    modifier.object, modifier.use_loop_data, modifier.data_types_loops = source, True, {"CUSTOM_NORMAL"}
    modifier.loop_mapping = "POLYINTERP_NEAREST"


def collision(ob):
    ob.modifiers.new("Before", "COLLISION")


BESIDE = uv_warp, weight_edit, weight_mix
READING = weighted_normal, uv_project, data_transfer, collision


def at_the_top(ob):
    """Moves the modifier Before to the top of the stack."""
    select(ob)
    with bpy.context.temp_override(object=ob):
        bpy.ops.object.modifier_move_to_index(modifier="Before", index=0)


def data_of(ob):
    """Returns what the modifiers change besides positions: normals and UVs of corners, weights."""
    mesh = ob.evaluated_get(depsgraph()).data
    if bpy.app.version < (4, 1, 0):
        mesh.calc_normals_split()
    normals = np.array([loop.normal for loop in mesh.loops])
    uv = np.array([each.uv for each in mesh.uv_layers[0].data]) if mesh.uv_layers else np.zeros(0)
    group = ob.vertex_groups.find("Paint")
    weights = [{each.group: each.weight for each in vertex.groups}.get(group, -1) for vertex in mesh.vertices]
    return normals, uv, np.array(weights)


def assert_same_data(ob, twin):
    for ours, theirs in zip(data_of(ob), data_of(twin)):
        np.testing.assert_allclose(ours, theirs, atol=2e-4)


def pair(character, before, with_keys):
    """A character with that modifier at the top of its stack, before it is bound, and its unbound twin."""
    ob = character
    if with_keys:
        ob.shape_key_add(name="Basis")
        key = ob.shape_key_add(name="Wide")
        for point in key.data:
            point.co.x *= 1.3
        key.value = 0.5
    before(ob)
    at_the_top(ob)
    return ob, twin_of(ob)


@pytest.mark.parametrize("with_keys", (False, True))
@pytest.mark.parametrize("before", (*BESIDE, *READING))
def test_before_the_armature(character, before, with_keys):
    ob, twin = pair(character, before, with_keys)
    accelerate(ob)
    assert_same_on_all_frames(bpy.context.scene, ob, twin, range(1, 8))
    is_blenders = with_keys and before in READING
    assert way(ob) == ("BLENDER" if is_blenders else "KEYS" if with_keys else "ATTRIBUTE")
    assert_same_data(ob, twin)
    if is_blenders:
        assert "Before" in reason(ob)


def test_a_file_plays_without_the_addon(character, tmp_path):
    ob, twin = pair(character, weighted_normal, False)
    accelerate(ob)
    assert_plays_without_the_addon(tmp_path, ob, twin)


def cloth_above(ob, name):
    """A square of cloth that falls onto an object alone."""
    around = bpy.data.collections.new(name)
    around.objects.link(ob)
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=12, y_subdivisions=12, size=3, location=(0, 0, 4.6))
    cloth = bpy.context.object
    modifier = cloth.modifiers.new("Cloth", "CLOTH")
    modifier.collision_settings.collection = around
    modifier.settings.quality = 5
    modifier.settings.effector_weights.gravity = 6
    return cloth


def collision_before_solidify(ob):
    ob.modifiers.new("Solidify", "SOLIDIFY").offset = 0
    ob.modifiers.move(ob.modifiers.find("Solidify"), 0)
    collision(ob)


@pytest.mark.parametrize(
    "before, own_way",
    (
        (collision, "ATTRIBUTE"),
        pytest.param(
            collision_before_solidify,
            "CANVAS",
            marks=pytest.mark.skipif(bpy.app.version < (4, 1, 0), reason="left to Blender in this version"),
        ),
    ),
)
def test_what_collides_with_it_sees_the_shape_at_rest(character, before, own_way):
    """As with Blender's own modifiers in that order, though the armature moves the mesh."""
    ob, twin = pair(character, before, False)
    accelerate(ob)
    cloths = [cloth_above(each, each.name) for each in (ob, twin)]
    free = cloth_above(bpy.data.objects.new("None", None), "Nothing")
    assert_same_on_all_frames(bpy.context.scene, ob, twin, range(1, 26))
    shapes = [evaluated(each) for each in (*cloths, free)]
    assert way(ob) == own_way and list(ob.modifiers.keys())[0] == "Before"
    assert np.abs(shapes[0] - shapes[2]).max() > 0.2
    np.testing.assert_allclose(shapes[0], shapes[1], atol=1e-4)


def test_a_hook_to_chosen_vertices_behind_a_collision(character):
    """Which keeps the vertices in their order, so that Blender moves those that are chosen."""
    ob, _ = pair(character, collision, False)
    hook(ob).vertex_indices_set(range(0, 1200, 5))
    select(ob)  # Blender 5 puts it first
    name = next(each.name for each in ob.modifiers if each.type == "HOOK")
    bpy.ops.object.modifier_move_to_index(modifier=name, index=len(ob.modifiers) - 1)
    twin = twin_of(ob)
    accelerate(ob)
    assert_same_on_all_frames(bpy.context.scene, ob, twin, range(1, 8))
    assert way(ob) == "ATTRIBUTE" and stages(ob) == [name]


@pytest.mark.parametrize("before", (uv_warp, weighted_normal, collision))
def test_moved_there_after_binding(character, before):
    ob = character
    accelerate(ob)
    before(ob)
    twin = twin_of(ob)
    at_the_top(ob)
    at_the_top(twin)
    select(ob)
    bpy.context.view_layer.update()
    assert_same_shape(ob, twin)
    assert_same_on_all_frames(bpy.context.scene, ob, twin, range(1, 5))
    assert way(ob) == "ATTRIBUTE"
    assert_same_data(ob, twin)


def test_between_the_stages(character):
    ob = character
    ob.modifiers.new("Smooth", "SMOOTH").iterations = 3
    uv_warp(ob)
    ob.modifiers.new("Corrective", "CORRECTIVE_SMOOTH")
    twin = twin_of(ob)
    accelerate(ob)
    assert_same_on_all_frames(bpy.context.scene, ob, twin, range(1, 5))
    assert stages(ob) == ["Smooth", "Corrective"]
    assert_same_data(ob, twin)


@pytest.mark.parametrize("with_keys", (False, True))
@pytest.mark.parametrize("before", (None, *BESIDE))
def test_a_hook_to_chosen_vertices_behind_it_is_blenders(character, before, with_keys):
    """Blender moves other vertices there than the chosen ones."""
    ob = character
    if with_keys:
        add_shape_keys(ob)
    if before is not None:
        before(ob)
    behind = hook(ob)
    behind.vertex_indices_set(range(0, 1200, 5))
    select(ob)  # Blender 5 puts it first
    bpy.ops.object.modifier_move_to_index(modifier=behind.name, index=len(ob.modifiers) - 1)
    twin = twin_of(ob)
    accelerate(ob)
    assert_same_on_all_frames(bpy.context.scene, ob, twin, range(1, 5))
    assert way(ob) == ("KEYS" if with_keys else "ATTRIBUTE" if before is None else "BLENDER")
    assert (stages(ob) == [behind.name]) == (before is None)


@pytest.mark.parametrize("with_keys", (False, True))
def test_what_changes_weights_that_deform_is_blenders(character, with_keys):
    def edit_bone(ob):
        modifier = ob.modifiers.new("Before", "VERTEX_WEIGHT_EDIT")
        modifier.vertex_group = ob.vertex_groups[1].name
        modifier.falloff_type = "SHARP"

    ob, twin = pair(character, edit_bone, with_keys)
    accelerate(ob)
    assert_same_on_all_frames(bpy.context.scene, ob, twin, range(1, 5))
    assert way(ob) == "BLENDER"
    assert f"changes the vertex group {ob.vertex_groups[1].name}" in reason(ob)
    for each in ob, twin:  # now it feeds only the paint
        each.modifiers["Before"].vertex_group = "Other"
    assert_same_on_all_frames(bpy.context.scene, ob, twin, range(1, 5))
    assert way(ob) == ("KEYS" if with_keys else "ATTRIBUTE")


def test_a_texture_laid_over_the_shape(character):
    """With shape keys, a modifier whose texture lies in the mesh's space would see the deformed shape."""
    ob, twin = pair(character, weight_edit, True)
    for each in ob, twin:
        each.modifiers["Before"].mask_texture = bpy.data.textures.new("Clouds", "CLOUDS")
    accelerate(ob)
    assert_same_on_all_frames(bpy.context.scene, ob, twin, range(1, 5))
    assert way(ob) == "BLENDER"
    for each in ob, twin:
        each.modifiers["Before"].mask_tex_mapping = "UV"
    assert_same_on_all_frames(bpy.context.scene, ob, twin, range(1, 5))
    assert way(ob) == "KEYS"
