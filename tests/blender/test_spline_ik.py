"""Spline IK in programs: the bits of Blender, whatever hooks do to the curve."""

from random import Random

import bpy
import numpy as np
import pytest
from mathutils import Vector

from helpers import needs_memory, needs_rig_programs, select
from test_accelerated_rigs import accelerate, accelerating, keep_live
from test_played import FRAMES, Cast
from test_played_who import both
from test_rigs_as_programs import differences, refusal

pytestmark = needs_rig_programs

TIMES = (1, 7.5, 20, -3, 33)
HANDLES = ("FREE", "AUTO", "VECTOR", "ALIGNED")
LENGTHS, WIDTHS = (
    ("NONE", "FIT_CURVE", "BONE_ORIGINAL"),
    ("NONE", "BONE_ORIGINAL", "INVERSE_PRESERVE", "VOLUME_PRESERVE"),
)


def make_bones(random, count):
    """An armature with a chain of bones along Z, a bone at its end, and handles beside it."""
    armature = bpy.data.objects.new("Tentacle", bpy.data.armatures.new("Tentacle"))
    bpy.context.collection.objects.link(armature)
    armature.location, armature.rotation_euler = (0.3, -1, 0.2), (0.1, 0.4, -0.2)
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    bones, parent, height = armature.data.edit_bones, None, 0.0
    for number in range(count):
        bone = bones.new(f"Chain{number}")
        length = random.uniform(0.3, 1.2)
        bone.head, bone.tail = (0, 0, height), (random.uniform(-0.1, 0.1), 0, height + length)
        bone.parent, bone.roll, height = parent, random.uniform(-1, 1), height + length
        bone.use_connect = parent is not None and bone.head == parent.tail
        parent = bone
    leaf = bones.new("Leaf")
    leaf.head, leaf.tail, leaf.parent = (0, 0.1, height), (0, 0.3, height + 0.2), parent
    for number in range(4):
        bone = bones.new(f"Handle{number}")
        bone.head = (0.2 * number % 0.3, 0, height * number / 3)
        bone.tail = bone.head + Vector((0, 0.3, 0.1))
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature, height


def read_channel(driver, armature, bone, channel):
    driver.type = "SUM"
    variable = driver.variables.new()
    variable.type = "TRANSFORMS"
    target = variable.targets[0]
    target.id, target.bone_target, target.transform_type = armature, bone, channel
    target.transform_space = "LOCAL_SPACE"


def make_curve(random, armature, height, kind):
    """A spline beside the chain. Each of its points is hooked to a bone, as a whole or without a handle."""
    curve = bpy.data.objects.new("Rail", bpy.data.curves.new("Rail", "CURVE"))
    bpy.context.collection.objects.link(curve)
    curve.location, curve.scale = (0.3, -1, 0.3), (1, 1.1, 0.9)
    curve.data.dimensions = "3D"
    spline = curve.data.splines.new(kind)
    spline.resolution_u = random.choice((1, 4, 12))
    spline.radius_interpolation = random.choice(("LINEAR", "CARDINAL", "BSPLINE", "EASE"))
    points = spline.bezier_points if kind == "BEZIER" else spline.points
    points.add(3)
    for number, point in enumerate(points):
        place = Vector((random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3), height * number / 3))
        point.co = place if kind == "BEZIER" else (*place, 1)
        point.radius = random.uniform(0.5, 1.5)
        if kind == "BEZIER":
            point.handle_left_type, point.handle_right_type = random.choice(HANDLES), random.choice(HANDLES)
            point.handle_left, point.handle_right = place - Vector((0.1, 0, 0.2)), place + Vector((0, 0.1, 0.3))
    for number in range(4):
        hook = curve.modifiers.new(f"Hook{number}", "HOOK")
        hook.object, hook.subtarget, hook.falloff_type = armature, f"Handle{number}", "NONE"
        hook.strength = random.choice((1, 1, 0.7))
        hook.matrix_inverse = (
            armature.matrix_world @ armature.pose.bones[hook.subtarget].bone.matrix_local
        ).inverted() @ curve.matrix_world
        own = range(3 * number, 3 * number + random.choice((2, 3))) if kind == "BEZIER" else (number,)
        hook.vertex_indices_set(list(own))
    driver = curve.data.driver_add(f"splines[0].{'bezier_points' if kind == 'BEZIER' else 'points'}[1].radius").driver
    read_channel(driver, armature, "Handle1", "SCALE_X")
    return curve


def animate(random, armature):
    for bone in armature.pose.bones:
        bone.rotation_mode = "XYZ"
        for frame in (0, 15, 30):
            bone.location = [random.uniform(-0.4, 0.4) for _ in range(3)]
            bone.rotation_euler = [random.uniform(-0.8, 0.8) for _ in range(3)]
            bone.scale = [random.uniform(0.7, 1.4) for _ in range(3)]
            for path in ("location", "rotation_euler", "scale"):
                bone.keyframe_insert(path, frame=frame)


def constrain(armature, curve, count, **settings):
    constraint = armature.pose.bones[f"Chain{count - 1}"].constraints.new("SPLINE_IK")
    constraint.target, constraint.chain_count = curve, count
    for name, value in settings.items():
        setattr(constraint, name, value)
    return constraint


def tentacle(seed, kind="BEZIER", count=5, **settings):
    random = Random(seed)
    armature, height = make_bones(random, count)
    bpy.context.view_layer.update()
    curve = make_curve(random, armature, height, kind)
    animate(random, armature)
    constraint = constrain(armature, curve, count, **settings)
    bpy.context.view_layer.update()
    return armature, curve, constraint


@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("kind", ["BEZIER", "POLY", "NURBS"])
def test_bits(fresh_scene, length, width, kind):
    seed = f"{length} {width} {kind}"
    armature, curve, constraint = tentacle(seed, kind, y_scale_mode=length, xz_scale_mode=width)
    before = [bone.matrix.copy() for bone in armature.pose.bones]
    constraint.mute = True
    bpy.context.view_layer.update()
    assert before != [bone.matrix for bone in armature.pose.bones]
    constraint.mute = False
    assert differences(armature, TIMES) == []


@pytest.mark.parametrize("number", range(60))
@pytest.mark.sampled(3)
def test_random_settings(fresh_scene, number):
    random = Random(f"settings {number}")
    settings = {
        "y_scale_mode": random.choice(LENGTHS),
        "xz_scale_mode": random.choice(WIDTHS),
        "use_chain_offset": random.random() < 0.3,
        "use_even_divisions": random.random() < 0.3,
        "use_curve_radius": random.random() < 0.7,
        "use_original_scale": random.random() < 0.5,
        "bulge": random.uniform(0.2, 3),
        "use_bulge_min": random.random() < 0.5,
        "use_bulge_max": random.random() < 0.5,
        "bulge_min": random.uniform(0.3, 1),
        "bulge_max": random.uniform(1, 1.5),
        "bulge_smooth": random.random(),
        "influence": random.choice((1, 1, random.random())),
    }
    kind, count = random.choice(("BEZIER", "BEZIER", "POLY", "NURBS")), random.choice((1, 2, 5, 9))
    armature, curve, constraint = tentacle(f"rig {number}", kind, count, **settings)
    if random.random() < 0.3:
        for frame, influence in ((0, 0), (10, 0.4), (30, 1)):
            constraint.influence = influence
            constraint.keyframe_insert("influence", frame=frame)
    if random.random() < 0.3:  # it ends before the chain does
        curve.scale = (0.4, 0.4, 0.4)
    assert differences(armature, TIMES) == []


@pytest.mark.parametrize("kind", ["BEZIER", "POLY"])
@pytest.mark.parametrize("hooked", [True, False])
def test_shape_keys(fresh_scene, kind, hooked):
    armature, curve, _constraint = tentacle(f"keys {kind} {hooked}", kind)
    random = Random(1)
    if not hooked:
        curve.modifiers.clear()
    curve.shape_key_add(name="Basis")
    for name in ("Wide", "Wave", "More"):
        for point in curve.shape_key_add(name=name, from_mix=False).data:
            point.co = [x + random.uniform(-0.3, 0.3) for x in point.co]
            point.radius = random.uniform(0.5, 2)
            if kind == "BEZIER":
                point.handle_left = [x + random.uniform(-0.2, 0.2) for x in point.handle_left]
    keys = curve.data.shape_keys
    keys.key_blocks["More"].relative_key = keys.key_blocks["Wave"]
    keys.key_blocks["Wave"].value, keys.key_blocks["More"].value = 0.4, 0.7
    driver = keys.key_blocks["Wide"].driver_add("value").driver
    read_channel(driver, armature, "Handle2", "LOC_X")
    bpy.context.view_layer.update()
    assert differences(armature, TIMES) == []
    keys.key_blocks["Wave"].mute = True
    assert "relative to one that is muted" in refusal(armature)
    keys.key_blocks["More"].mute = True
    bpy.context.view_layer.update()
    assert differences(armature, TIMES) == []
    keys.use_relative = False
    assert "absolute shape keys" in refusal(armature)


def test_a_curve_without_hooks_stays_as_it_is(fresh_scene):
    armature, curve, constraint = tentacle("still")
    curve.modifiers.clear()
    curve.data.splines[0].bezier_points[1].co.x += 0.2
    bpy.context.view_layer.update()
    assert differences(armature, TIMES) == []


@pytest.mark.parametrize(
    "change, why",
    [
        (lambda curve: setattr(curve.data.splines[0], "use_cyclic_u", True), "closed"),
        (lambda curve: setattr(curve.data, "dimensions", "2D"), "not 3D"),
        (lambda curve: curve.data.splines.clear(), "is empty"),
        (lambda curve: setattr(curve.data.splines.new("POLY"), "resolution_u", 3), "several resolutions"),
        (lambda curve: setattr(curve.data, "bevel_factor_mapping_start", "SEGMENTS"), "bevel by segment"),
        (lambda curve: setattr(curve.data, "bevel_factor_mapping_end", "SPLINE"), "bevel by segment"),
        (lambda curve: setattr(curve, "show_only_shape_key", bool(curve.shape_key_add())), "shown alone"),
        (lambda curve: curve.modifiers.new("Wave", "WAVE"), "only hooks"),
        (lambda curve: setattr(curve.modifiers[0], "falloff_type", "SMOOTH"), None),
        (lambda curve: curve.data.splines[0].bezier_points[0].keyframe_insert("co"), "is keyed"),
        (lambda curve: curve.data.driver_add("splines[0].bezier_points[0].co", 0), "has a driver"),
        (lambda curve: curve.modifiers[0].driver_add("strength"), "has a driver"),
    ],
)
def test_what_is_not_covered_is_refused_by_name(fresh_scene, change, why):
    armature, curve, _constraint = tentacle("refused")
    curve.modifiers[0].falloff_radius = 0
    change(curve)
    if why is None:
        assert differences(armature, TIMES) == []
        curve.modifiers[0].falloff_radius, why = 1, "falloff"
    assert why in refusal(armature) and "Rail" in refusal(armature)


def test_an_invalid_driver_of_the_curve_sets_nothing(fresh_scene):
    armature, curve, _constraint = tentacle("invalid")
    driver = curve.data.driver_add("splines[0].bezier_points[1].radius").driver
    driver.expression = "no_such_name"
    fresh_scene.frame_set(2)
    assert not driver.is_valid
    assert differences(armature, TIMES) == []


def test_bones_that_two_constraints_move_are_refused(fresh_scene):
    armature, curve, _constraint = tentacle("twice")
    other = armature.pose.bones["Chain3"].constraints.new("SPLINE_IK")
    other.target, other.chain_count = curve, 2
    assert "another IK constraint moves" in refusal(armature)
    other.mute = True
    assert differences(armature, TIMES) == []


@pytest.mark.parametrize("is_first", (False, True))
def test_without_a_curve_it_is_passed_over(fresh_scene, is_first):
    """Alone, beside another one on the same bone, and whatever keyframes and drivers set of it."""
    armature, curve, constraint = tentacle("none")
    tip, other = armature.pose.bones["Chain4"], armature.pose.bones["Chain3"]
    alone, beside = constrain(armature, None, 5, chain_count=3), other.constraints.new("SPLINE_IK")
    if is_first:
        tip.constraints.move(1, 0)
    beside.influence = 0.5
    beside.keyframe_insert("influence", frame=2)
    read_channel(alone.driver_add("influence").driver, armature, "Handle2", "SCALE_X")
    assert differences(armature, TIMES) == []
    constraint.target = None
    bpy.context.view_layer.update()
    assert differences(armature, TIMES) == []
    alone.target = curve
    bpy.context.view_layer.update()
    assert differences(armature, TIMES) == []


def hook_to_side(curve, armature):
    """Has the bone `side` bend a Bezier curve at its second point."""
    hook = curve.modifiers.new("Hook", "HOOK")
    hook.object, hook.subtarget, hook.falloff_type = armature, "side", "NONE"
    hook.matrix_inverse = armature.data.bones["side"].matrix_local.inverted()
    hook.vertex_indices_set([3, 4, 5])


def assert_is_computed(cast):
    accelerate(cast)
    shapes = cast.play([*FRAMES, 3, -7, 400, 5])
    assert cast.rig.is_played and np.ptp(shapes, axis=0).max() > 0.1
    assert len(cast.rig.source.compared) > 1


def assert_bones_are_not_updated(cast):
    """Blender evaluates those of the live character alone."""
    accelerate(cast)
    updated = set()

    def note(scene, graph):
        updated.update(each.id.name for each in graph.updates)

    bpy.app.handlers.depsgraph_update_post.append(note)
    bpy.app.handlers.frame_change_post.append(note)
    for frame in FRAMES:
        cast.scene.frame_set(frame)
        assert cast.played[0].name not in updated, updated
    assert cast.live[0].name in updated


class Tentacles(Cast):
    """A cast whose characters have a chain along a curve of their own, which their bone `side` bends."""

    def __init__(self, scene, hooked=True):
        super().__init__(scene)
        self.curves = []
        for armature, *_ in both(self):
            curve = bpy.data.objects.new("Rail", bpy.data.curves.new("Rail", "CURVE"))
            scene.collection.objects.link(curve)
            curve.location, curve.data.dimensions = armature.location, "3D"
            spline = curve.data.splines.new("BEZIER")
            spline.bezier_points.add(2)
            for number, point in enumerate(spline.bezier_points):
                point.co, point.handle_left_type, point.handle_right_type = (
                    (0.2 * number, 0, 1.2 * number),
                    "AUTO",
                    "AUTO",
                )
            if hooked:
                hook_to_side(curve, armature)
            constraint = armature.pose.bones["bone4"].constraints.new("SPLINE_IK")
            constraint.target, constraint.chain_count = curve, 3
            self.curves.append(curve)
        select()
        scene.frame_set(2)
        scene.frame_set(1)
        keep_live(self)


@pytest.fixture(params=["hooked", "hidden", "still"])
def cast(request, fresh_scene, monkeypatch):
    monkeypatch.setattr(accelerating(), "LEAST_WORK", 0)
    fresh_scene.frame_start, fresh_scene.frame_end = 1, 10
    cast = Tentacles(fresh_scene, request.param != "still")
    for curve in cast.curves:
        curve.hide_viewport = request.param == "hidden"
    bpy.context.view_layer.update()
    return cast


@needs_memory
def test_it_is_computed_in_blender(cast):
    assert_is_computed(cast)


@needs_memory
def test_blender_does_not_evaluate_its_bones_again(cast):
    """Although its curve is bent on each frame."""
    assert_bones_are_not_updated(cast)


def edit_a_point(curve):
    curve.data.splines[0].bezier_points[2].co.x += 0.4


def edit_the_object(curve):
    curve.location.x += 0.3


def edit_a_radius(curve):
    curve.data.splines[0].bezier_points[0].radius = 2.0


def add_a_modifier(curve):
    curve.modifiers.new("Wave", "WAVE")


@needs_memory
@pytest.mark.parametrize("edit", [edit_a_point, edit_the_object, edit_a_radius, add_a_modifier])
def test_edits_of_its_curve_are_seen(cast, edit):
    accelerate(cast)
    cast.scene.frame_set(4)
    for curve in cast.curves:
        edit(curve)
    bpy.context.view_layer.update()
    cast.assert_same()
    cast.play(FRAMES)
    if edit is not add_a_modifier:
        accelerate(cast)
    cast.play(FRAMES)


@needs_memory
def test_its_curve_is_taken_away_and_given_back(cast):
    accelerate(cast)
    cast.scene.frame_set(4)
    for curves in ([None] * len(cast.curves), cast.curves):
        for (armature, *_), curve in zip(both(cast), curves):
            armature.pose.bones["bone4"].constraints["Spline IK"].target = curve
        bpy.context.view_layer.update()
        cast.assert_same()
        cast.play(FRAMES)
        accelerate(cast)
        cast.play(FRAMES)


@needs_memory
@pytest.mark.parametrize("bone", ["side", "bone3", "bone0"])
def test_it_can_be_posed(cast, bone):
    accelerate(cast)
    cast.scene.frame_set(4)
    for _ in range(3):
        for armature, *_ in both(cast):
            armature.pose.bones[bone].location.x += 0.2
            armature.pose.bones[bone].scale.x += 0.1
        bpy.context.view_layer.update()
        cast.assert_same()
    cast.play(FRAMES)
    accelerate(cast)
    cast.play(FRAMES)


def key_settings(cast):
    """Keys a custom property and an influence of both."""
    for armature, *_ in both(cast):
        copied = armature.pose.bones["side"].constraints.new("COPY_ROTATION")
        copied.target, copied.subtarget, copied.influence = armature, "bone0", 0.2
        armature["level"] = 0.5
        for frame in (1, 10):
            armature.keyframe_insert('["level"]', frame=frame)
            copied.keyframe_insert("influence", frame=frame)
    cast.scene.frame_set(2)


@needs_memory
@pytest.mark.parametrize("bone", ["side", "bone3"])
def test_a_pose_is_kept_where_settings_are_keyed_too(cast, bone):
    key_settings(cast)
    accelerate(cast)
    cast.scene.frame_set(4)
    for moved in (3.0, 4.0):
        for armature, *_ in both(cast):
            armature.pose.bones[bone].location.x = moved
        bpy.context.view_layer.update()
        cast.assert_same()
        assert {each[0].pose.bones[bone].location.x for each in both(cast)} == {moved}
    cast.play(FRAMES)
    accelerate(cast)
    cast.play(FRAMES)
