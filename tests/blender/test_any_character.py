"""Characters as people make them, each with everything that the Armature modifier can be told:
accelerated, and compared with a copy that the modifier deforms."""

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

from characters import accelerate, add_shape_keys, make_armature, make_mesh, pose, with_bendy_bones
from helpers import addon_module, assert_same_shape, diagonal, evaluated, needs_memory, select, twin_of, way

METHODS = ("LINEAR", "DUAL_QUATERNION")


def with_mask(ob, invert=False):
    group = ob.vertex_groups.new(name="mask")
    for v in range(0, 1200, 3):
        group.add([v], (v % 400) / 400, "REPLACE")
    ob.modifiers["Armature"].vertex_group = "mask"
    ob.modifiers["Armature"].invert_vertex_group = invert


def with_envelopes(ob):
    """A third of the vertices has no weights; those of the upper bones are multiplied."""
    modifier = ob.modifiers["Armature"]
    modifier.use_bone_envelopes = True
    for group in ob.vertex_groups:
        group.remove(range(400))
    for i, bone in enumerate(modifier.object.data.bones):
        bone.head_radius, bone.tail_radius = 0.1 + 0.05 * i, 0.3
        bone.envelope_distance, bone.envelope_weight = 0.3 + 0.1 * i, 0.5 + 0.3 * i
        bone.use_envelope_multiply = i > 2


def with_envelopes_alone(ob):
    with_envelopes(ob)
    ob.modifiers["Armature"].use_vertex_groups = False


def with_bones_that_do_not_deform(ob):
    bones = ob.modifiers["Armature"].object.data.bones
    bones["bone1"].use_deform = bones["bone4"].use_deform = False
    group = ob.vertex_groups.new(name="no bone")
    group.add(range(200, 900), 0.7, "REPLACE")
    for g in ob.vertex_groups:
        g.remove(range(500, 550))
        g.add(range(550, 600), 2e-5, "REPLACE")


def with_a_modifier_before(ob):
    wave = ob.modifiers.new("Cast", "CAST")
    wave.factor = 0.4
    select(ob)
    bpy.ops.object.modifier_move_up(modifier="Cast")


def with_another_armature_before(ob):
    with_a_modifier_before(ob)
    second = ob.modifiers.new("Second", "ARMATURE")
    second.object = ob.modifiers["Armature"].object


def mixed(ob):
    """Multi Modifier: linear where the mask says so, preserving volume elsewhere, or the other way
    round in later versions."""
    first = ob.modifiers["Armature"]
    second = ob.modifiers.new("Second", "ARMATURE")
    second.object, second.use_multi_modifier = first.object, True
    second.use_deform_preserve_volume = not first.use_deform_preserve_volume
    with_mask(ob)
    first.vertex_group, second.vertex_group = "", "mask"


def mixed_without_a_mask(ob):
    mixed(ob)
    ob.modifiers["Second"].vertex_group = ""


def mixed_thrice_by_two_armatures(ob):
    """With keys, a masked first one, and one in between that is switched off."""
    add_shape_keys(ob)
    mixed(ob)
    ob.modifiers["Armature"].vertex_group = "bone3"
    off = ob.modifiers.new("Off", "ARMATURE")
    off.object, off.use_multi_modifier = ob.modifiers["Armature"].object, True
    off.show_viewport = off.show_render = False
    other = make_armature()
    other.location.x = 0.3
    other.pose.bones["bone1"].rotation_mode = "XYZ"
    other.pose.bones["bone1"].rotation_euler.y = 0.5
    third = ob.modifiers.new("Third", "ARMATURE")
    third.object, third.use_multi_modifier = other, True
    third.vertex_group, third.invert_vertex_group = "bone2", True


def with_curved_bendy_bones(ob):
    with_bendy_bones(ob)
    for bone in ob.modifiers["Armature"].object.data.bones:
        bone.bbone_curveinx, bone.bbone_curveoutz = 0.3, -0.4
        if bpy.app.version >= (4, 0, 0):
            bone.bbone_mapping_mode = "CURVED"


def with_subdivision_after(ob):
    ob.modifiers.new("Subdivision", "SUBSURF").levels = 1


def with_keys_and_subdivision(ob):
    add_shape_keys(ob)
    with_subdivision_after(ob)


def with_keys_and_the_lot_after(ob):
    add_shape_keys(ob)
    ob.modifiers.new("Solidify", "SOLIDIFY").thickness = 0.05
    ob.modifiers.new("Mirror", "MIRROR").use_mirror_merge = False
    ob.modifiers.new("Array", "ARRAY").count = 2


def with_keys_and_bendy_bones(ob):
    add_shape_keys(ob)
    with_bendy_bones(ob)


def moving_against_bendy_bones(ob):
    """The object itself is animated, its armature is not its parent."""
    with_bendy_bones(ob)
    for frame, place in ((1, (0, 0, 0)), (10, (0.2, 0.1, 0.7))):
        ob.location = place
        ob.keyframe_insert("location", frame=frame)


def with_keys_and_curved_bendy_bones(ob):
    add_shape_keys(ob)
    with_curved_bendy_bones(ob)


def with_keys_mask_envelopes_and_bendy_bones(ob):
    add_shape_keys(ob)
    with_envelopes(ob)
    with_bendy_bones(ob)
    with_mask(ob)


def apart(ob):
    ob.matrix_world = Matrix.Translation((1, 2, 3)) @ Euler((0.3, 0.8, -1)).to_matrix().to_4x4()


def parented_and_squashed(ob):
    armature = ob.modifiers["Armature"].object
    armature.matrix_world = Euler((0.1, 0.2, 0.3)).to_matrix().to_4x4() @ Matrix.Diagonal((2, 1, 1, 1))
    ob.parent = armature
    ob.scale = (1, 0.5, 1.5)
    with_bendy_bones(ob)


KINDS = (
    lambda ob: None,
    add_shape_keys,
    with_mask,
    lambda ob: with_mask(ob, invert=True),
    with_bendy_bones,
    with_envelopes,
    with_envelopes_alone,
    with_bones_that_do_not_deform,
    with_a_modifier_before,
    with_another_armature_before,
    mixed,
    mixed_without_a_mask,
    mixed_thrice_by_two_armatures,
    with_curved_bendy_bones,
    with_subdivision_after,
    with_keys_and_subdivision,
    with_keys_and_the_lot_after,
    with_keys_mask_envelopes_and_bendy_bones,
    with_keys_and_bendy_bones,
    moving_against_bendy_bones,
    with_keys_and_curved_bendy_bones,
    apart,
    parented_and_squashed,
)
NAMES = [kind.__name__ for kind in KINDS]
NAMES[0], NAMES[3] = "plain", "with_mask_turned_round"
# Which Blender's own modifier goes on deforming:
LEFT_TO_BLENDER = (with_a_modifier_before, with_another_armature_before, with_keys_mask_envelopes_and_bendy_bones)
if bpy.app.version >= (4, 0, 0):  # before there are none that are curved
    LEFT_TO_BLENDER += (with_keys_and_curved_bendy_bones,)


@pytest.fixture(params=METHODS)
def method(request):
    return request.param


@pytest.mark.parametrize("scaled", (False, True), ids=("rigid", "scaled"))
@pytest.mark.parametrize("kind", KINDS, ids=NAMES)
def test_same_as_the_modifier(fresh_scene, method, kind, scaled):
    armature = make_armature()
    ob = make_mesh(armature, method == "DUAL_QUATERNION")
    kind(ob)
    reference = twin_of(ob)
    for frame in (1, 4, 7, 10):
        pose(armature, frame, scaled)
    accelerate(ob)
    assert ob.sinew.method == method
    shapes = []
    for frame in range(1, 11):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, reference)
        shapes.append(evaluated(reference))
    assert np.abs(shapes[0] - shapes[-1]).max() > 0.05 * diagonal(shapes[0])
    assert bpy.context.scene.objects[ob.name].sinew.is_bound
    wanted = "KEYS" if ob.data.shape_keys else "ATTRIBUTE"
    assert way(ob) == ("BLENDER" if kind in LEFT_TO_BLENDER else wanted)


@pytest.mark.parametrize("kind", KINDS, ids=NAMES)
def test_given_back_as_it_was(fresh_scene, kind):
    armature = make_armature()
    ob = make_mesh(armature, False)
    kind(ob)
    pose(armature, 1, False)
    fresh_scene.frame_set(1)

    def description():
        return (
            [(m.name, m.type, m.show_viewport, m.show_render, getattr(m, "object", None)) for m in ob.modifiers],
            sorted(a.name for a in ob.data.attributes),
            len(bpy.data.node_groups),
            evaluated(ob).tobytes(),
        )

    before = description()
    accelerate(ob)
    fresh_scene.frame_set(5)
    fresh_scene.frame_set(1)
    select(ob)
    bpy.ops.object.sinew_unbind()
    bpy.context.view_layer.update()
    assert description() == before


def test_weights_painted_and_settings_changed_while_it_plays(fresh_scene, method):
    armature = make_armature()
    ob = make_mesh(armature, method == "DUAL_QUATERNION")
    reference = twin_of(ob)
    pose(armature, 1, False)
    accelerate(ob)
    for change in (lambda o: o.vertex_groups["bone1"].add(range(300), 0.5, "ADD"), add_shape_keys):
        change(ob), change(reference)
        ob.data.update(), reference.data.update()
        fresh_scene.frame_set(3)
        assert_same_shape(ob, reference)
    with_mask(reference)
    group = ob.vertex_groups.new(name="mask")
    for v in range(0, 1200, 3):
        group.add([v], (v % 400) / 400, "REPLACE")
    ob.modifiers["Armature"].vertex_group = "mask"
    fresh_scene.frame_set(4)
    assert_same_shape(ob, reference)
    armature.data.bones["bone2"].use_deform = False
    with_bendy_bones(reference)
    fresh_scene.frame_set(5)
    assert_same_shape(ob, reference)


@needs_memory
@pytest.mark.parametrize("kind", (lambda ob: None, add_shape_keys), ids=("plain", "shape keys"))
def test_nothing_is_built_anew_while_it_plays(fresh_scene, kind):
    """Neither Sinew's own writing nor an animated pose counts as an edit."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    kind(ob)
    pose(armature, 1, False)
    pose(armature, 10, False)
    accelerate(ob)
    fresh_scene.frame_set(1)
    deformer = addon_module("run.characters").character(ob).deformer
    assert deformer is not None
    for frame in range(2, 8):
        fresh_scene.frame_set(frame)
        assert addon_module("run.characters").character(ob).deformer is deformer


@needs_memory
def test_bones_are_compared_after_edits_alone(fresh_scene, monkeypatch):
    """Not on a frame; and once, however many meshes use the armature."""
    armature = make_armature()
    objects = [make_mesh(armature, False) for _ in range(3)]
    twin = twin_of(objects[0])
    pose(armature, 1, False)
    pose(armature, 10, False)
    for ob in objects:
        accelerate(ob)
    fresh_scene.frame_set(1)
    armatures, calls = addon_module("blender.armatures"), []
    compare = armatures.bone_signature
    monkeypatch.setattr(armatures, "bone_signature", lambda *arguments: calls.append(1) or compare(*arguments))
    for frame in range(2, 8):
        fresh_scene.frame_set(frame)
    assert calls == []
    armature.data.bones["bone2"].use_deform = False
    bpy.context.view_layer.update()
    assert len(calls) == 1
    assert_same_shape(objects[0], twin)


@pytest.mark.parametrize("parented", (False, True), ids=("free", "parented"))
def test_bones_renamed_while_bound(fresh_scene, parented):
    armature = make_armature()
    ob = make_mesh(armature, False)
    if parented:
        ob.parent = armature
    reference = twin_of(ob)
    pose(armature, 1, False)
    accelerate(ob)
    armature.data.bones["bone2"].name = "elbow"
    bpy.context.view_layer.update()
    fresh_scene.frame_set(1)
    assert "elbow" in ob.vertex_groups and "bone2" not in ob.vertex_groups
    assert_same_shape(ob, reference)
    select(ob)
    bpy.ops.object.sinew_unbind()
    bpy.context.view_layer.update()
    assert_same_shape(ob, reference)


@needs_memory
def test_bound_again_with_another_output(fresh_scene):
    armature = make_armature()
    ob = make_mesh(armature, False)
    reference = twin_of(ob)
    pose(armature, 1, False)
    accelerate(ob)
    select(ob)
    assert bpy.ops.object.sinew_bind(output="MESH") == {"FINISHED"}
    fresh_scene.frame_set(1)
    assert ob.sinew.installed_output == "MESH"
    assert_same_shape(ob, reference)
    bpy.ops.object.sinew_unbind()
    assert ob.modifiers["Armature"].object == armature


@pytest.mark.parametrize("kind", (lambda ob: None, add_shape_keys), ids=("plain", "shape keys"))
def test_modifiers_that_renumber_vertices(fresh_scene, kind):
    """Behind the armature's, there from the start or coming later."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    kind(ob)
    ob.modifiers.new("Bevel", "BEVEL")
    reference = twin_of(ob)
    pose(armature, 1, False)
    accelerate(ob)
    fresh_scene.frame_set(1)
    assert_same_shape(ob, reference)
    for each in ob, reference:
        each.modifiers.new("Mask", "MASK").vertex_group = "bone2"
    fresh_scene.frame_set(2)
    assert_same_shape(ob, reference)
    assert way(ob) == ("KEYS" if ob.data.shape_keys else "ATTRIBUTE")


def test_a_modifier_moved_before_the_armature(fresh_scene):
    """From then on only Blender knows what goes into it; when it has gone again, Sinew does."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    reference = twin_of(ob)
    pose(armature, 1, False)
    pose(armature, 10, False)
    accelerate(ob)
    fresh_scene.frame_set(2)
    assert way(ob) == "ATTRIBUTE"
    for each in ob, reference:
        with_a_modifier_before(each)
        for _ in range(2):  # Sinew's is there as well
            bpy.ops.object.modifier_move_up(modifier="Cast")
    bpy.context.view_layer.update()
    for frame in (3, 5):
        assert_same_shape(ob, reference)
        fresh_scene.frame_set(frame)
    assert way(ob) == "BLENDER" and "Cast comes before" in addon_module("run.characters").of(ob).way.reason
    for each in ob, reference:
        each.modifiers.remove(each.modifiers["Cast"])
    for frame in (6, 7):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, reference)
    assert way(ob) == "ATTRIBUTE"


def under_constraints(armature, _scene):
    """IK with a target that moves, a damped track, and a copied rotation."""
    target = bpy.data.objects.new("Target", None)
    bpy.context.collection.objects.link(target)
    for frame, place in ((1, (2, 0, 3)), (10, (-2, 1, 2))):
        target.location = place
        target.keyframe_insert("location", frame=frame)
    ik = armature.pose.bones["bone3"].constraints.new("IK")
    ik.target, ik.chain_count = target, 3
    track = armature.pose.bones["side"].constraints.new("DAMPED_TRACK")
    track.target = target
    copied = armature.pose.bones["bone4"].constraints.new("COPY_ROTATION")
    copied.target, copied.subtarget = armature, "side"


def under_drivers(armature, scene):
    for name, expression in (("bone1", "frame / 10"), ("bone3", "sin(frame)")):
        bone = armature.pose.bones[name]
        bone.rotation_mode = "XYZ"
        bone.driver_add("rotation_euler", 0).driver.expression = expression


def under_nla(armature, _scene):
    """Two strips that are blended, one of them scaled and repeated."""
    pose(armature, 1, False)
    pose(armature, 6, False)
    data = armature.animation_data
    first, data.action = data.action, None
    pose(armature, 3, False)
    pose(armature, 9, False)
    second, data.action = data.action, None
    for action, start in ((first, 1), (second, 3)):
        strip = data.nla_tracks.new().strips.new(action.name, start, action)
        if action == second:
            strip.blend_type, strip.influence, strip.scale, strip.repeat = "ADD", 0.5, 0.7, 2


def under_driven_keys(_armature, _scene):
    """Corrective shapes: a bone's rotation drives a key."""


@pytest.mark.parametrize("under", (under_constraints, under_drivers, under_nla, under_driven_keys))
def test_armatures_moved_in_all_ways(fresh_scene, method, under):
    armature = make_armature()
    ob = make_mesh(armature, method == "DUAL_QUATERNION")
    if under == under_driven_keys:
        add_shape_keys(ob)
        for key in ob.data.shape_keys.key_blocks[1:]:
            key.driver_remove("value")
            ob.data.shape_keys.animation_data_clear()
        for key in ob.data.shape_keys.key_blocks[1:]:
            driver = key.driver_add("value").driver
            driver.type = "SUM"
            variable = driver.variables.new()
            variable.type = "TRANSFORMS"
            target = variable.targets[0]
            target.id, target.bone_target = armature, "bone1"
            target.transform_type, target.transform_space = "LOC_X", "LOCAL_SPACE"
        pose(armature, 1, False)
        pose(armature, 10, False)
    under(armature, fresh_scene)
    twin = twin_of(ob)
    if under == under_driven_keys:
        assert twin.data.shape_keys.animation_data.drivers
    accelerate(ob)
    shapes = []
    for frame in range(1, 11):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)
        shapes.append(evaluated(ob))
    assert np.abs(shapes[0] - shapes[-1]).max() > 0.05
    assert addon_module("run.characters").character(ob).status.error == ""


@pytest.mark.parametrize("update", (True, False), ids=("live", "with the next frame"))
def test_weights_painted_under_animated_shape_keys(fresh_scene, update):
    armature = make_armature()
    ob = make_mesh(armature, False)
    add_shape_keys(ob)
    reference = twin_of(ob)
    pose(armature, 1, False)
    pose(armature, 10, False)
    accelerate(ob)
    fresh_scene.frame_set(2)
    for each in (ob, reference):
        each.vertex_groups["bone1"].add(range(300), 0.5, "ADD")
        each.data.update()
    if update:
        bpy.context.view_layer.update()
        assert_same_shape(ob, reference)
    fresh_scene.frame_set(3)
    assert_same_shape(ob, reference)


@pytest.mark.parametrize("keyed", (False, True), ids=("plain", "keys"))
def test_edit_mode_of_an_armature_that_shares_its_data(fresh_scene, keyed):
    """Blender shows the rest shape of all that follow these bones, however many meshes there are."""
    armature = make_armature()
    pairs = []
    for _ in range(3):
        ob = make_mesh(armature, False)
        if keyed:
            add_shape_keys(ob)
        pairs.append((ob, twin_of(ob)))
        accelerate(ob)
    pose(armature, 1, False)
    pose(armature, 10, False)
    other = bpy.data.objects.new("Other", armature.data)
    fresh_scene.collection.objects.link(other)
    for frame in (3, 4, 5, 6):
        fresh_scene.frame_set(frame)
    posed = evaluated(pairs[0][0])
    select(other)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.context.view_layer.update()

    def assert_all_same():
        for ob, twin in pairs:
            assert_same_shape(ob, twin)

    assert_all_same()
    fresh_scene.frame_set(7)
    assert_all_same()
    assert np.abs(evaluated(pairs[0][0]) - posed).max() > 0.1
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.update()
    assert_all_same()
    fresh_scene.frame_set(5)
    assert_all_same()
