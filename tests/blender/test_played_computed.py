"""A character that can be a program needs no recording: frames that were never played are computed, and look like those
of a live one, to the bit."""

import bpy
import pytest

from helpers import addon_module, needs_memory, needs_rig_programs, select
from test_played import EDITS, FRAMES, layer, opened_cast, recorded, states
from test_played_who import both, drive_keys

pytestmark = [needs_rig_programs, needs_memory]


def computing():
    return addon_module("played.computing")


@pytest.fixture
def cast():
    return opened_cast(last=10)


def take_over_unplayed(cast):
    """Takes it over on one frame. Nothing is recorded, before or after."""
    states().take_over([cast.rig], cast.scene, layer())
    assert cast.rig.is_played, cast.rig.reason
    assert cast.rig.source.is_proven and len(cast.rig.motion.record) == 0


def test_frames_that_were_never_played_are_computed(cast):
    take_over_unplayed(cast)
    cast.play([*FRAMES, 3, -7, 400])
    assert cast.rig.is_played
    assert len(cast.rig.motion.record) == 0
    cast.hand_back()
    cast.play()
    assert not cast.rig.trust.is_distrusted


def test_shape_keys_that_it_drives_are_computed(cast):
    for armature, ob, *_ in both(cast):
        drive_keys(armature, ob)
    layer().update()
    take_over_unplayed(cast)
    cast.play([*FRAMES, 30])
    assert cast.rig.is_played
    assert len({computing().moment(cast.rig, frame).keys for frame in FRAMES}) > 5


def test_a_key_that_also_follows_what_moves_by_itself_is_recorded(cast):
    """The object has no keyframes of its own: the curve that it follows has."""
    data = bpy.data.curves.new("Path", "CURVE")
    spline = data.splines.new("POLY")
    spline.points.add(1)
    spline.points[1].co = (0, 0, 0.8, 1)
    path, follower = (bpy.data.objects.new("Path", data), bpy.data.objects.new("Follower", None))
    data.use_path = True
    for frame, time in ((1, 0), (10, 100)):
        data.eval_time = time
        data.keyframe_insert("eval_time", frame=frame)
    for ob in (path, follower):
        cast.scene.collection.objects.link(ob)
    follower.constraints.new("FOLLOW_PATH").target = path
    for armature, ob, *_ in both(cast):
        drive_keys(armature, ob)
        variable = ob.data.shape_keys.animation_data.drivers[0].driver.variables.new()
        variable.name, variable.type = "more", "TRANSFORMS"
        variable.targets[0].id, variable.targets[0].transform_type = follower, "LOC_Z"
    layer().update()
    states().take_over([cast.rig], cast.scene, layer())
    cast.play()
    assert "Follower, which may move" in cast.rig.source.refusal
    states().take_over([cast.rig], cast.scene, layer())
    cast.play()


def test_there_is_nothing_to_record(cast):
    played = []
    bpy.app.handlers.frame_change_pre.append(lambda scene, *_: played.append(scene.frame_current))
    try:
        select(cast.played[0])
        assert bpy.ops.object.sinew_record() == {"FINISHED"}
    finally:
        bpy.app.handlers.frame_change_pre.pop()
    assert played == []
    assert len(cast.rig.motion.record) == 0
    select()
    states().take_over([cast.rig], cast.scene, layer())
    cast.play()
    assert cast.rig.is_played


@pytest.mark.parametrize("edit", EDITS)
@pytest.mark.parametrize("is_updated", [False, True])
def test_an_edit_is_never_missed(cast, edit, is_updated):
    take_over_unplayed(cast)
    cast.scene.frame_set(5)
    for armature, *_ in both(cast):
        edit(armature)
    if is_updated:
        layer().update()
        cast.assert_same()
    cast.scene.frame_set(8)
    cast.assert_same()
    states().take_over([cast.rig], cast.scene, layer())
    cast.play()


# --- posed: Blender evaluates an edit, and the next frame is computed again -----------------------


def state(name):
    return recorded().State[name]


def move(cast, distance, bone="bone1"):
    """Moves a bone of both by hand."""
    for armature, *_ in both(cast):
        armature.pose.bones[bone].location.x += distance
    layer().update()


def key(cast, frame, bone="bone1"):
    for armature, *_ in both(cast):
        armature.pose.bones[bone].keyframe_insert("location", frame=frame)
    layer().update()


def test_it_is_posed_while_it_is_played(cast):
    take_over_unplayed(cast)
    cast.scene.frame_set(3)
    select(cast.played[0])
    layer().update()
    bpy.ops.object.mode_set(mode="POSE")
    layer().update()
    for distance in (0.5, 0.2, -1.7):
        move(cast, distance)
        cast.assert_same()
        assert cast.rig.state is state("POSED")
    layer().update()
    cast.assert_same()
    key(cast, 3)
    cast.assert_same()
    cast.scene.frame_set(4)
    cast.assert_same()
    assert cast.rig.state is state("PLAYED")
    cast.play()
    bpy.ops.object.mode_set(mode="OBJECT")
    cast.play([5, 2])
    assert cast.rig.state is state("PLAYED")
    key(cast, 2)
    cast.hand_back()
    cast.play()
    assert not cast.rig.trust.is_distrusted


def test_a_pose_that_is_not_keyed_is_lost_on_another_frame_as_ever(cast):
    take_over_unplayed(cast)
    move(cast, 2)
    for armature, *_ in both(cast):
        armature.pose.bones["bone2"].bbone_rollin = 0.4  # which nothing animates
    cast.play([1, 2, 1])
    assert cast.rig.state is state("PLAYED")
    assert cast.played[0].pose.bones["bone2"].bbone_rollin == pytest.approx(0.4)


def test_an_edit_and_a_new_frame_at_once(cast):
    take_over_unplayed(cast)
    for armature, *_ in both(cast):
        armature.pose.bones["bone1"].location.x += 2
        armature.pose.bones["bone1"].keyframe_insert("location", frame=4)
        armature.pose.bones["side"].constraints.new("LIMIT_SCALE").use_max_x = True
    cast.play([4, 5, 1])


def move_key(armature):
    curve = addon_module("blender.animation").action_curves(armature.animation_data.action)[0]
    for point in curve.keyframe_points:
        point.co.y += 0.5
    curve.update()


@pytest.fixture(params=[False, True], ids=["played", "posed"])
def idle(cast, request):
    """Blender has built relations without its keyframes."""
    take_over_unplayed(cast)
    cast.scene.frame_set(3)
    if request.param:
        move(cast, 2, "bone2")
    return cast


def test_a_key_that_is_moved_is_seen_at_once(idle):
    cast = idle
    for armature, *_ in both(cast):
        move_key(armature)
    layer().update()
    cast.assert_same()
    assert cast.rig.is_idle
    cast.play()


def test_what_makes_blender_build_relations_keeps_the_pose(idle):
    cast = idle
    cast.scene.collection.objects.link(bpy.data.objects.new("New", None))
    layer().update()
    cast.assert_same()
    layer().update()
    cast.assert_same()
    states().take_over_again(cast.scene, layer())
    cast.assert_same()
    cast.play()
    states().take_over_again(cast.scene, layer())
    assert cast.rig.is_played
    cast.play()


def test_custom_properties_that_are_keyed(cast):
    """Blender reads them when it evaluates the edit."""
    for armature, *_ in both(cast):
        for owner, name, values in (
            (armature, 'a "quoted" one', (0.1, 0.9)),
            (armature.pose.bones["bone0"], "whole", (1, 3)),
            (armature.pose.bones["bone0"], "yes", (False, True)),
        ):
            path = f'["{bpy.utils.escape_identifier(name)}"]'
            for frame, value in zip((1, 10), values):
                owner[name] = value
                owner.keyframe_insert(path, frame=frame)
        curve = armature.pose.bones["side"].driver_add("scale", 0)
        curve.driver.type, curve.driver.expression = "SCRIPTED", "1 + a * b + c"
        for letter, path in zip(
            "abc", (r'["a \"quoted\" one"]', 'pose.bones["bone0"]["whole"]', 'pose.bones["bone0"]["yes"]')
        ):
            variable = curve.driver.variables.new()
            variable.name, variable.targets[0].id, variable.targets[0].data_path = letter, armature, path
    cast.scene.frame_set(2)
    take_over_unplayed(cast)
    for frame in (7, 10, 4):
        cast.scene.frame_set(frame)
        cast.assert_same()
        move(cast, 0.5)
        cast.assert_same()
        assert cast.rig.state is state("POSED")
        ours, theirs = (each[0] for each in both(cast))
        assert ours['a "quoted" one'] == theirs['a "quoted" one']
        for name in ("whole", "yes"):
            values = [each.pose.bones["bone0"][name] for each in (ours, theirs)]
            assert values[0] == values[1] and type(values[0]) is type(values[1])
    cast.play()


@pytest.mark.parametrize("switch", ("mute", "enabled"))
def test_originals_have_what_keyframes_and_drivers_set(cast, switch):
    """Constraints' influence and switch, and custom properties: of bones, of the object, whole numbers and switches."""
    read = []
    for armature, *_ in both(cast):
        bone, other = armature.pose.bones["side"], armature.pose.bones["bone2"]
        other.constraints.new("LIMIT_SCALE").name = "first"
        for owner, name in ((bone, 'a "keyed" one'), (other, "driven")):
            constraint = owner.constraints.new("COPY_SCALE")
            constraint.name, constraint.target, constraint.subtarget = name, armature, "bone0"
        keyed, driven = bone.constraints[0], other.constraints[1]
        for frame, value in ((1, 0), (10, 1)):
            keyed.influence, keyed.mute = value, frame == 10
            keyed.keyframe_insert("influence", frame=frame)
            keyed.keyframe_insert(switch, frame=frame)
        armature["height"], other["whole"], other["yes"] = 0.5, 2, False
        for owner, path, expression in (
            (driven, "influence", "x / 2"),
            (driven, switch, "x > 0.6"),
            (armature, '["height"]', "x * 3"),
            (other, '["whole"]', "x * 10"),
            (other, '["yes"]', "x > 0.3"),
        ):
            driver = owner.driver_add(path).driver
            driver.expression, variable = expression, driver.variables.new()
            variable.name, variable.targets[0].id = "x", armature
            variable.targets[0].data_path = keyed.path_from_id("influence")
        paths = [keyed.path_from_id(name) for name in ("influence", "mute")]
        paths += [driven.path_from_id(name) for name in ("influence", "mute")]
        read.append([*paths, '["height"]', 'pose.bones["bone2"]["whole"]', 'pose.bones["bone2"]["yes"]'])
    cast.scene.frame_set(2)
    take_over_unplayed(cast)
    seen = set()
    for frame in (7, 10, 4, 1):
        cast.scene.frame_set(frame)
        cast.assert_same()
        values = [[each[0].path_resolve(path) for path in paths] for each, paths in zip(both(cast), read)]
        assert values[0] == values[1] and list(map(type, values[0])) == list(map(type, values[1])), frame
        seen.add(tuple(values[0]))
        if frame == 10:
            select(cast.played[0])
            layer().update()
            move(cast, 2)
            cast.assert_same()
            assert cast.rig.state is state("POSED")
    assert len(seen) == 4 and cast.rig.is_played
    cast.play()


def test_one_whose_keyframes_set_other_things_is_handed_back_to_be_edited(cast):
    for armature, *_ in both(cast):
        constraint = armature.pose.bones["side"].constraints.new("LIMIT_SCALE")
        constraint.use_max_x = True
        for frame, value in ((1, 0.5), (10, 1)):
            constraint.max_x = value
            constraint.keyframe_insert("max_x", frame=frame)
    cast.scene.frame_set(2)
    take_over_unplayed(cast)
    cast.play([5])
    select(cast.played[0])
    layer().update()
    assert not cast.rig.is_idle
    move(cast, 2)
    cast.assert_same()
    cast.play()


def test_between_two_frames(cast):
    take_over_unplayed(cast)
    for frame, part in ((4, 0.5), (4, 0.75), (5, 0), (5, 0.25), (5, 0.25), (-3, 0.1), (4, 0.5)):
        cast.scene.frame_set(frame, subframe=part)
        cast.assert_same()
        assert cast.rig.is_played
    assert len(cast.rig.motion.record) == 0
    cast.play()


def test_half_a_frame_after_an_edit(cast):
    take_over_unplayed(cast)
    move(cast, 2)
    cast.scene.frame_set(4, subframe=0.5)
    cast.assert_same()
    assert cast.rig.is_played
    move(cast, 2)
    cast.assert_same()
    cast.scene.frame_set(4, subframe=0.25)
    cast.assert_same()
    cast.play()


def undo_a_pose(cast):
    bpy.ops.ed.undo_push(message="before")
    move(cast, 2)
    bpy.ops.ed.undo_push(message="posed")
    cast.undo()
    cast.assert_same()


def test_undo_of_a_pose(cast):
    take_over_unplayed(cast)
    undo_a_pose(cast)
    states().take_over_again(cast.scene, layer())
    cast.play()


def test_it_becomes_something_else_while_it_is_posed(cast):
    take_over_unplayed(cast)
    move(cast, 2)
    for armature, *_ in both(cast):
        armature.pose.bones["bone2"].constraints.new("SHRINKWRAP").target = cast.played[3]
    layer().update()
    cast.assert_same()
    cast.play()
    assert not cast.rig.is_idle


def test_edit_mode(cast):
    take_over_unplayed(cast)
    for armature, *_ in both(cast):
        select(armature)
        bpy.context.view_layer.objects.active = armature
        bpy.ops.object.mode_set(mode="EDIT")
        armature.data.edit_bones["bone2"].tail.x += 0.3
        cast.scene.frame_set(5)
        bpy.ops.object.mode_set(mode="OBJECT")
    cast.play([4, 6])
    select()
    states().take_over_again(cast.scene, layer())
    cast.play()


def test_a_handler_that_poses_on_each_frame(cast):
    def pose(scene, *_):
        for armature, *_ in both(cast):
            armature.pose.bones["side"].location.x = 0.1 * scene.frame_current

    take_over_unplayed(cast)
    for handlers in (bpy.app.handlers.frame_change_pre, bpy.app.handlers.frame_change_post):
        handlers.append(pose)
        try:
            cast.play()
        finally:
            handlers.remove(pose)
    cast.play()


# --- trust ----------------------------------------------------------------------------------------


@pytest.mark.says_errors
@pytest.mark.says_errors
def test_a_program_that_does_not_compute_this_frame_is_not_used(cast, monkeypatch):
    monkeypatch.setattr(computing().rigs, "shows", lambda *_: False)
    states().take_over([cast.rig], cast.scene, layer())
    monkeypatch.undo()
    assert not cast.rig.is_played and "is not recorded" in cast.rig.reason
    cast.play()


def follow_a_moving_object(armature):
    target = bpy.data.objects.new("Target", None)
    bpy.context.scene.collection.objects.link(target)
    target.parent, target.parent_type, target.parent_bone = armature, "BONE", "bone0"
    armature.pose.bones["side"].constraints.new("COPY_LOCATION").target = target


def use_a_constraint_that_is_not_covered(armature):
    constraint = armature.pose.bones["side"].constraints.new("SHRINKWRAP")
    constraint.target = bpy.data.objects["Prop"]


@pytest.mark.parametrize(
    ("change", "reason"),
    [(follow_a_moving_object, "follows Target"), (use_a_constraint_that_is_not_covered, "Shrinkwrap is not covered")],
)
def test_what_cannot_be_a_program_is_recorded(cast, change, reason):
    for armature, *_ in both(cast):
        change(armature)
    layer().update()
    states().take_over([cast.rig], cast.scene, layer())
    assert not cast.rig.is_played
    assert reason in cast.rig.source.refusal
    cast.play()
    states().take_over([cast.rig], cast.scene, layer())
    cast.play()
    assert cast.rig.is_played


def test_an_unkeyed_pose_is_not_lost(cast):
    for armature, *_ in both(cast):
        armature.pose.bones["bone1"].location.x += 2
    layer().update()
    states().take_over([cast.rig], cast.scene, layer())
    assert not cast.rig.is_played and "not keyed" in cast.rig.reason
    cast.assert_same()
    cast.scene.frame_set(2)
    states().take_over([cast.rig], cast.scene, layer())
    cast.play()
    assert cast.rig.is_played


def test_frames_that_are_mapped_to_other_times_are_played(cast):
    cast.scene.render.frame_map_new = 50
    states().take_over([cast.rig], cast.scene, layer())
    assert not cast.rig.is_played and "maps its frames" in cast.rig.source.refusal
    cast.play()
    cast.scene.render.frame_map_new = 100
    cast.play()
    states().take_over([cast.rig], cast.scene, layer())
    cast.play()
    assert cast.rig.is_played


def test_undo_and_redo(cast):
    bpy.ops.ed.undo_push(message="before")
    take_over_unplayed(cast)
    for armature, *_ in both(cast):
        armature.pose.bones["bone1"].location.x += 2
        armature.pose.bones["bone1"].keyframe_insert("location", frame=5)
    layer().update()
    bpy.ops.ed.undo_push(message="edited")
    cast.undo()
    cast.play()
    states().take_over([cast.rig], cast.scene, layer())
    cast.play([2, 30, 5])
    assert cast.rig.is_played


def test_the_states_of_several(cast):
    rigs = [recorded().learn(armature) for armature, *_ in both(cast)]
    states().take_over(rigs, cast.scene, layer())
    assert all(rig.is_played for rig in rigs)
    computed = cast.play([3, 4])
    states().hand_back(rigs, cast.scene, layer())
    assert (cast.play([3, 4]) == computed).all()
