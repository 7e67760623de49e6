"""Follow Path in programs: the bits of Blender, along open and closed curves."""

from random import Random

import bpy
import pytest
from mathutils import Vector

from helpers import needs_memory, needs_rig_programs, select
from test_accelerated_rigs import accelerate, accelerating, keep_live, refused
from test_played import FRAMES, Cast
from test_played_who import both
from test_rigs_as_programs import differences, refusal
from test_spline_ik import (
    animate,
    assert_bones_are_not_updated,
    assert_is_computed,
    constrain,
    hook_to_side,
    make_bones,
    make_curve,
    read_channel,
)

pytestmark = needs_rig_programs

TIMES = (1, 7.5, 20, -3, 33, 12.25)
FORWARD = ("FORWARD_X", "FORWARD_Y", "FORWARD_Z", "TRACK_NEGATIVE_X", "TRACK_NEGATIVE_Y", "TRACK_NEGATIVE_Z")
UP = ("UP_X", "UP_Y", "UP_Z")
INTERPOLATIONS = ("LINEAR", "CARDINAL", "BSPLINE", "EASE")


def key_time(curve, values=((0, -20), (10, 35), (30, 130))):
    for frame, value in values:
        curve.data.eval_time = value
        curve.data.keyframe_insert("eval_time", frame=frame)


def follow(armature, bone, curve, **settings):
    constraint = armature.pose.bones[bone].constraints.new("FOLLOW_PATH")
    constraint.target = curve
    for name, value in settings.items():
        setattr(constraint, name, value)
    return constraint


def train(seed, kind="BEZIER", is_closed=False, is_hooked=True, has_tilt=True):
    """A chain of bones whose second one follows a curve, and a leaf that follows it otherwise."""
    random = Random(seed)
    armature, height = make_bones(random, 4)
    bpy.context.view_layer.update()
    curve = make_curve(random, armature, height, kind)
    spline = curve.data.splines[0]
    spline.use_cyclic_u = is_closed
    spline.tilt_interpolation = random.choice(INTERPOLATIONS)
    if not is_hooked:
        curve.modifiers.clear()
    if has_tilt:
        for point in spline.bezier_points if kind == "BEZIER" else spline.points:
            point.tilt = random.uniform(-1, 1)
    animate(random, armature)
    return armature, curve


@pytest.mark.parametrize("is_closed", [False, True])
@pytest.mark.parametrize("kind", ["BEZIER", "POLY", "NURBS"])
@pytest.mark.parametrize("twist", ["MINIMUM", "Z_UP"])
@pytest.mark.parametrize("up", UP)
@pytest.mark.parametrize("forward", FORWARD)
def test_axes(fresh_scene, forward, up, twist, kind, is_closed):
    armature, curve = train(f"{forward} {up} {twist} {kind} {is_closed}", kind, is_closed)
    curve.data.twist_mode = twist
    key_time(curve)
    settings = {"forward_axis": forward, "up_axis": up, "use_curve_follow": True}
    constraint = follow(armature, "Chain1", curve, **settings)
    follow(armature, "Leaf", curve, use_fixed_location=True, offset_factor=0.4, use_curve_radius=True, **settings)
    bpy.context.view_layer.update()
    before = [bone.matrix.copy() for bone in armature.pose.bones]
    constraint.mute = True
    bpy.context.view_layer.update()
    assert constraint.is_valid == (forward[-1] != up[-1]) == (before != [bone.matrix for bone in armature.pose.bones])
    constraint.mute = False
    assert differences(armature, TIMES) == []


@pytest.mark.parametrize("number", range(60))
@pytest.mark.sampled(3)
def test_random_settings(fresh_scene, number):
    random = Random(f"path {number}")
    kind, is_closed = random.choice(("BEZIER", "BEZIER", "POLY", "NURBS")), random.random() < 0.5
    armature, curve = train(f"rig {number}", kind, is_closed, random.random() < 0.6, random.random() < 0.7)
    curve.data.twist_mode = random.choice(("MINIMUM", "MINIMUM", "Z_UP"))
    if kind == "NURBS":
        spline = curve.data.splines[0]
        spline.order_u, spline.use_endpoint_u = random.choice((2, 3, 4)), not is_closed and random.random() < 0.5
        for point in spline.points:
            point.co.w = random.choice((1, 1, random.uniform(0.3, 3)))
    curve.data.path_duration = random.choice((100, 37, 1))
    for name in ("use_path", "use_path_clamp", "use_path_follow", "use_radius"):
        setattr(curve.data, name, random.random() < 0.5)
    if random.random() < 0.7:
        key_time(curve, [(frame, random.uniform(-60, 160)) for frame in (0, 8, 30)])
    else:
        curve.data.eval_time = random.uniform(-60, 160)
    for bone in ("Chain1", "Leaf", "Handle3"):
        if bone == "Handle3" and curve.modifiers:
            continue  # its curve would wait for it
        constraint = follow(
            armature,
            bone,
            curve,
            forward_axis=random.choice(FORWARD),
            up_axis=random.choice(UP),
            use_fixed_location=random.random() < 0.5,
            offset_factor=random.choice((0, 1, random.random())),
            offset=random.uniform(-80, 80),
            use_curve_follow=random.random() < 0.7,
            use_curve_radius=random.random() < 0.5,
            influence=random.choice((1, 1, random.random())),
            owner_space=random.choice(("WORLD", "WORLD", "LOCAL", "POSE", "LOCAL_WITH_PARENT")),
        )
        for name in ("offset_factor", "offset", "influence"):
            if random.random() < 0.3:
                for frame, value in ((0, 0), (12, 0.8), (30, 0.3)):
                    setattr(constraint, name, value)
                    constraint.keyframe_insert(name, frame=frame)
    bpy.context.view_layer.update()
    assert differences(armature, TIMES) == []


def test_two_points(fresh_scene):
    for kind in ("POLY", "BEZIER", "NURBS"):
        for is_closed in (False, True):
            armature, _curve = train(f"two {kind} {is_closed}")
            curve = make_line(kind, [(0, 0, 0), (1, 2, 0.5)], is_closed)
            key_time(curve)
            follow(armature, "Chain1", curve, use_curve_follow=True)
            bpy.context.view_layer.update()
            assert differences(armature, TIMES) == []


def make_line(kind, places, is_closed=False):
    curve = bpy.data.objects.new("Line", bpy.data.curves.new("Line", "CURVE"))
    bpy.context.collection.objects.link(curve)
    curve.data.dimensions = "3D"
    spline = curve.data.splines.new(kind)
    points = spline.bezier_points if kind == "BEZIER" else spline.points
    points.add(len(places) - 1)
    for point, place in zip(points, places):
        point.co = place if kind == "BEZIER" else (*place, 1)
        if kind == "BEZIER":
            point.handle_left_type = point.handle_right_type = "VECTOR"
    if kind == "NURBS":
        spline.order_u = min(4, len(places))
    spline.use_cyclic_u = is_closed
    return curve


@pytest.mark.parametrize("is_closed", [False, True])
@pytest.mark.parametrize("places", [(0, 0, 1, 2, 2, 2), (0, 1, 1, 3, 4, 0), (1, 2, 5, 6, 6, 1)])
@pytest.mark.parametrize("kind", ["BEZIER", "POLY", "NURBS"])
def test_points_at_the_same_place(fresh_scene, places, is_closed, kind):
    """At the ends, of which Blender leaves out one, and between; in straight lines, too."""
    armature, _curve = train("doubled")
    curve = make_line(kind, [(x, x * x % 3, 0.1 * x) for x in places], is_closed)
    key_time(curve, ((0, 0), (30, 100)))
    follow(armature, "Chain1", curve, use_curve_follow=True)
    bpy.context.view_layer.update()
    assert differences(armature, (*TIMES, 0, 30, 15, 22.5)) == []


@pytest.mark.parametrize("direction", [(0, 0, 1), (0, 0, -1), (0, 1, 0), (1, 0, 0), (0, -1, 0)])
def test_straight_along_an_axis(fresh_scene, direction):
    armature, _curve = train("straight")
    curve = make_line("POLY", [Vector(direction) * x for x in (0, 1, 1.5, 4)])
    key_time(curve, ((0, 0), (30, 100)))
    follow(armature, "Chain1", curve, use_curve_follow=True)
    bpy.context.view_layer.update()
    assert differences(armature, TIMES) == []


def test_drivers_of_the_time_and_of_the_offset(fresh_scene):
    armature, curve = train("driven")
    driver = curve.data.driver_add("eval_time").driver
    read_channel(driver, armature, "Handle2", "LOC_X")
    driver.type, driver.expression = "SCRIPTED", f"50 + 100 * {driver.variables[0].name}"
    constraint = follow(armature, "Chain1", curve, use_curve_follow=True)
    read_channel(constraint.driver_add("offset").driver, armature, "Handle1", "SCALE_X")
    bpy.context.view_layer.update()
    assert differences(armature, TIMES) == []


def test_the_path_that_blender_adds(fresh_scene):
    """NURBS that reach their ends."""
    armature, _curve = train("path")
    select()
    bpy.ops.curve.primitive_nurbs_path_add(location=(1, 2, 0.5), rotation=(0.2, 0.5, 1))
    curve = bpy.context.object
    key_time(curve)
    follow(armature, "Chain1", curve, use_curve_follow=True)
    bpy.context.view_layer.update()
    assert differences(armature, TIMES) == []


@pytest.mark.parametrize("kind", ["bezier", "nurbs"])
def test_the_circles_that_blender_adds(fresh_scene, kind):
    armature, _curve = train("circle")
    select()
    getattr(bpy.ops.curve, f"primitive_{kind}_circle_add")(location=(1, 2, 0.5), rotation=(0.2, 0.5, 1))
    curve = bpy.context.object
    key_time(curve, ((0, 0), (30, 250)))
    follow(armature, "Chain1", curve, use_curve_follow=True)
    follow(armature, "Leaf", curve, use_curve_follow=True, offset=20)
    bpy.context.view_layer.update()
    assert differences(armature, TIMES) == []


def test_the_curve_moves(fresh_scene):
    armature, curve = train("moving", is_hooked=False)
    for frame, x in ((0, 0), (30, 3)):
        curve.location.x = x
        curve.rotation_euler.z = x
        curve.keyframe_insert("location", frame=frame)
        curve.keyframe_insert("rotation_euler", frame=frame)
    key_time(curve)
    follow(armature, "Chain1", curve, use_curve_follow=True)
    bpy.context.view_layer.update()
    assert differences(armature, TIMES) == []


@pytest.mark.parametrize("kind", ["BEZIER", "POLY", "NURBS"])
def test_shape_keys(fresh_scene, kind):
    armature, curve = train(f"keys {kind}", kind)
    random = Random(1)
    curve.shape_key_add(name="Basis")
    for point in curve.shape_key_add(name="Wide", from_mix=False).data:
        point.co = [x + random.uniform(-0.3, 0.3) for x in point.co]
        point.radius = random.uniform(0.5, 2)
    key = curve.data.shape_keys.key_blocks["Wide"]
    key.value = 0.6
    follow(armature, "Chain1", curve, use_curve_follow=True, use_curve_radius=True)
    key_time(curve)
    bpy.context.view_layer.update()
    assert differences(armature, TIMES) == []
    key.data[1].tilt = 1.5
    assert "different tilts" in refusal(armature)


def test_spline_ik_along_the_same_curve(fresh_scene):
    armature, curve = train("both")
    key_time(curve)
    constrain(armature, curve, 4, chain_count=2)
    follow(armature, "Leaf", curve, use_curve_follow=True)
    bpy.context.view_layer.update()
    assert differences(armature, TIMES) == []
    curve.data.splines[0].use_cyclic_u = True
    assert "closed" in refusal(armature)


def test_without_a_curve(fresh_scene):
    armature, curve = train("none")
    constraint = follow(armature, "Chain1", None)
    for target in (None, curve, None):
        constraint.target = target
        curve.update_tag()  # without that, Blender does not compute its path
        bpy.context.view_layer.update()
        assert differences(armature, TIMES) == []


def make_nurbs(curve, **settings):
    curve.modifiers.clear()
    spline = curve.data.splines[0]
    spline.type = "NURBS"
    for name, value in settings.items():
        setattr(spline, name, value)


@pytest.mark.parametrize(
    "change, why",
    [
        (lambda curve: setattr(curve.data, "twist_mode", "TANGENT"), "the twist Tangent"),
        (lambda curve: setattr(curve.data, "twist_smooth", 1), "smooths it"),
        (lambda curve: setattr(curve.data, "dimensions", "2D"), "not 3D"),
        (lambda curve: curve.data.splines.clear(), "is empty"),
        (lambda curve: make_nurbs(curve, use_bezier_u=True), "begins with NURBS"),
        (
            lambda curve: make_nurbs(curve, use_bezier_u=False, use_endpoint_u=True, use_cyclic_u=True),
            "begins with NURBS",
        ),
        (lambda curve: curve.data.keyframe_insert("path_duration"), "is keyed"),
        (lambda curve: curve.data.driver_add("path_duration"), "has a driver"),
        (lambda curve: curve.data.driver_add("splines[0].bezier_points[0].tilt"), "has a driver"),
    ],
)
def test_what_is_not_covered_is_refused_by_name(fresh_scene, change, why):
    armature, curve = train("refused")
    follow(armature, "Chain1", curve, use_curve_follow=True)
    change(curve)
    assert why in refusal(armature) and "Rail" in refusal(armature)


def test_a_hook_of_a_bone_that_follows_is_a_cycle(fresh_scene):
    armature, curve = train("cycle")
    follow(armature, "Handle1", curve)
    assert "Handle1" in refusal(armature)


class Trains(Cast):
    """A cast of which two bones follow a curve of their character's own, which their bone `side` bends."""

    def __init__(self, scene, is_hooked=True, is_keyed=True):
        super().__init__(scene)
        self.curves = []
        for armature, *_ in both(self):
            curve = make_line("BEZIER", [(0, 0, 0), (0.2, 1, 0.4), (1, 0.2, 1)], is_closed=True)
            curve.location = armature.location
            for point in curve.data.splines[0].bezier_points:
                point.handle_left_type = point.handle_right_type = "AUTO"
            if is_hooked:
                hook_to_side(curve, armature)
            if is_keyed:
                key_time(curve, ((1, 0), (10, 90)))
            follow(armature, "bone3", curve, use_curve_follow=True)
            follow(armature, "bone4", curve, use_fixed_location=True, offset_factor=0.3)
            self.curves.append(curve)
        select()
        scene.frame_set(2)
        scene.frame_set(1)
        keep_live(self)


@pytest.fixture(params=["hooked and keyed", "keyed", "hooked", "still", "still and hidden"])
def cast(request, fresh_scene, monkeypatch):
    monkeypatch.setattr(accelerating(), "LEAST_WORK", 0)
    fresh_scene.frame_start, fresh_scene.frame_end = 1, 10
    cast = Trains(fresh_scene, "hooked" in request.param, "keyed" in request.param)
    for curve in cast.curves:
        curve.hide_viewport = "hidden" in request.param
    bpy.context.view_layer.update()
    return cast


@needs_memory
def test_it_is_computed_in_blender(cast):
    assert_is_computed(cast)


@needs_memory
@pytest.mark.parametrize("cast", ["keyed", "hooked"], indirect=True)
def test_a_hidden_curve_that_changes_keeps_it_live(cast):
    """Blender might not evaluate it."""
    for curve in cast.curves:
        curve.hide_viewport = True
    bpy.context.view_layer.update()
    refused(cast, "is hidden: show it")


@needs_memory
def test_blender_does_not_evaluate_its_bones_again(cast):
    assert_bones_are_not_updated(cast)


def edit_the_offset_factor(armature, curve):
    armature.pose.bones["bone4"].constraints[0].offset_factor = 0.7


def edit_the_offset(armature, curve):
    armature.pose.bones["bone3"].constraints[0].offset = 12


def edit_the_axis(armature, curve):
    armature.pose.bones["bone3"].constraints[0].forward_axis = "TRACK_NEGATIVE_X"


def edit_the_time(armature, curve):
    curve.data.eval_time = 33


def edit_the_keys_of_the_time(armature, curve):
    data = curve.data.animation_data
    if data is None:
        key_time(curve, ((1, 20), (10, 40)))
        return
    curve.data.keyframe_delete("eval_time", frame=10)
    key_time(curve, ((8, 55),))


def edit_the_duration(armature, curve):
    curve.data.path_duration = 60


def edit_a_point(armature, curve):
    curve.data.splines[0].bezier_points[2].co.x += 0.4


def edit_a_tilt(armature, curve):
    curve.data.splines[0].bezier_points[2].tilt += 0.8


def open_it(armature, curve):
    curve.data.splines[0].use_cyclic_u = False


def edit_the_object(armature, curve):
    curve.location.x += 0.3


def add_a_modifier(armature, curve):
    curve.modifiers.new("Wave", "WAVE")


@needs_memory
@pytest.mark.parametrize(
    "edit",
    [
        edit_the_offset_factor,
        edit_the_offset,
        edit_the_axis,
        edit_the_time,
        edit_the_keys_of_the_time,
        edit_the_duration,
        edit_a_point,
        edit_a_tilt,
        open_it,
        edit_the_object,
        add_a_modifier,
    ],
)
def test_edits_are_seen(cast, edit):
    accelerate(cast)
    cast.scene.frame_set(4)
    for (armature, *_), curve in zip(both(cast), cast.curves):
        edit(armature, curve)
    bpy.context.view_layer.update()
    cast.assert_same()
    cast.play(FRAMES)
    is_hidden_and_keyed = edit is edit_the_keys_of_the_time and cast.curves[0].hide_viewport
    if edit is not add_a_modifier and not is_hidden_and_keyed:
        accelerate(cast)
    cast.play(FRAMES)


@needs_memory
def test_its_curve_is_taken_away_and_given_back(cast):
    accelerate(cast)
    cast.scene.frame_set(4)
    for curves in ([None] * len(cast.curves), cast.curves):
        for (armature, *_), curve in zip(both(cast), curves):
            armature.pose.bones["bone3"].constraints[0].target = curve
        bpy.context.view_layer.update()
        cast.assert_same()
        cast.play(FRAMES)
        accelerate(cast)
        cast.play(FRAMES)
