"""The rigs of bound meshes are computed although nobody has played them: while the user does nothing they are read, and
then look and are edited as if they were live. The second character of the cast stays live."""

import json
import re
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from mathutils import Euler

from characters import make_armature, make_mesh, pose
from helpers import addon_module, depsgraph, evaluated, into_a_shot, needs_memory, needs_rig_programs, select
from test_played import EDITS, FRAMES, layer, opened_cast, recorded, states
from test_played_computed import key, move, state, undo_a_pose
from test_played_who import both, can_render, in_a_collection

pytestmark = [needs_rig_programs, needs_memory]


def accelerating():
    return addon_module("played.accelerating")


def cast_of_small_rigs(monkeypatch):
    """A cast whose first rig is worth computing."""
    monkeypatch.setattr(accelerating(), "LEAST_WORK", 0)
    cast = opened_cast(last=10)
    keep_live(cast)
    return cast


@pytest.fixture
def cast(monkeypatch):
    return cast_of_small_rigs(monkeypatch)


def keep_live(cast):
    live = recorded().learn(cast.live[0])
    live.ob.sinew_accelerates_rig, live.trial.needs_program = False, True  # and is not recorded


def evaluations():
    return addon_module("played.playing").evaluation_count()


def wait(cast):
    """What the timer does while the user does nothing. Returns how many steps there were."""
    states().take_over_again(cast.scene, layer())
    for number in range(200):
        if not accelerating().step(cast.scene, layer(), evaluations()):
            return number
    raise AssertionError("it does not come to an end")


def accelerate(cast):
    wait(cast)
    assert cast.rig.is_played and cast.rig.trial.needs_program, cast.rig.reason


def refused(cast, clause):
    """The rig stays Blender's, which says why with this clause."""
    wait(cast)
    assert not cast.rig.is_played and clause in cast.rig.reason, cast.rig.reason
    cast.play()


def test_a_mapping_of_frames_between_two_steps_is_seen(cast):
    """After it was read, and before it is compared on other frames."""
    states().take_over_again(cast.scene, layer())
    while not (cast.rig.source.is_proven or cast.rig.reason):
        assert accelerating().step(cast.scene, layer(), evaluations())
    cast.scene.render.frame_map_new = 200
    wait(cast)
    assert not cast.rig.is_played and not cast.rig.source.compared
    cast.scene.render.frame_map_new = 100
    for frame in range(1, 10):  # it is not tried again at once
        cast.scene.frame_set(frame)
        wait(cast)
    accelerate(cast)


def test_a_mapping_of_frames_after_a_pose_is_seen(cast):
    """The edited rig was read again meanwhile, before the frames were mapped."""
    accelerate(cast)
    cast.scene.frame_set(8)
    for armature, *_ in both(cast):
        armature.pose.bones["bone2"].location.x += 0.1
    layer().update()
    wait(cast)
    assert cast.rig.is_idle and not cast.rig.is_played and cast.rig.source.program is not None
    cast.scene.render.frame_map_new = 200
    cast.play([8, 9, 4])
    assert not cast.rig.is_played


def test_it_needs_no_recording_and_no_memory(cast):
    accelerate(cast)
    cast.play([*FRAMES, 3, -7, 400])
    cast.scene.frame_set(4, subframe=0.5)
    cast.assert_same()
    assert cast.rig.is_played and recorded().used_memory() == 0
    assert not recorded().get(cast.live[0]).is_idle


def test_reading_and_comparing_take_one_step_for_each_rig(cast):
    cast.live[0].sinew_accelerates_rig = True
    assert wait(cast) == 4
    assert all(recorded().get(each[0]).is_played for each in both(cast))


def test_others_are_computed_while_one_is_compared(cast):
    accelerate(cast)
    other = recorded().get(cast.live[0])
    other.ob.sinew_accelerates_rig = True
    for _ in range(5):
        accelerating().step(cast.scene, layer(), evaluations())
        layer().update()
        assert cast.rig.is_played
    assert other.is_played and other.source.compared
    cast.play()


def data_names():
    return [[each.name for each in blocks] for blocks in (bpy.data.scenes, bpy.data.objects, bpy.data.actions)]


def test_it_is_compared_with_blender_before_it_is_shown(cast):
    cast.scene.frame_set(4)
    before, names = [[[*bone.location] for bone in each[0].pose.bones] for each in both(cast)], data_names()
    accelerate(cast)
    assert cast.rig.source.compared and cast.rig.source.compared <= set(range(1, 11))
    assert [[[*bone.location] for bone in each[0].pose.bones] for each in both(cast)] == before
    assert data_names() == names and cast.scene.frame_current == 4
    cast.assert_same()
    text, _reason = addon_module("ui.rig_cures").text_of(cast.rig.ob)
    assert "(Blender " in text
    assert addon_module("ui.rig_cures").compared(cast.rig.ob) == len(cast.rig.source.compared)
    cast.play()


@pytest.mark.parametrize("has_track", (False, True))
def test_an_edit_without_a_key_outlives_the_comparison(cast, has_track):
    """Of what makes no difference on this frame, too: Blender sets all keyed values on each frame that it evaluates.
    has_track: an NLA track without strips."""
    for armature, *_ in both(cast):
        if has_track:
            armature.animation_data.nla_tracks.new()
        for name, value in (("whole", 3), ("part", 0.25)):
            armature[name] = value
            for frame in (1, 10):
                armature.keyframe_insert(f'["{name}"]', frame=frame)
        armature.update_tag()
    cast.scene.frame_set(4)
    for name, value in (("whole", 5), ("part", 0.75)):
        for armature, *_ in both(cast):
            armature[name] = value
            armature.update_tag()
        layer().update()
        wait(cast)
        assert cast.rig.ob[name] == value
        cast.play([3, 4])
    assert (cast.rig.ob["whole"], cast.rig.ob["part"]) == (3, 0.25)
    wait(cast)
    accelerate(cast)
    assert len(cast.rig.source.compared) > 1


def test_a_frame_that_cannot_be_computed_is_found_by_the_comparison(cast):
    for armature, *_ in both(cast):
        armature["by"] = 1.0
        armature.keyframe_insert('["by"]', frame=4)
        armature["by"] = 0.0
        armature.keyframe_insert('["by"]', frame=5)
        driver = armature.pose.bones["side"].driver_add("location", 0).driver
        driver.expression = "1 / by"
        variable = driver.variables.new()
        variable.name, variable.targets[0].id, variable.targets[0].data_path = "by", armature, '["by"]'
        armature.update_tag()
    cast.scene.frame_set(4)
    before = [[*each.location] for each in cast.rig.ob.pose.bones]
    wait(cast)
    assert not cast.rig.is_played and "side" in cast.rig.reason, cast.rig.reason
    assert [[*each.location] for each in cast.rig.ob.pose.bones] == before
    assert all(curve.driver.is_valid for curve in cast.rig.ob.animation_data.drivers)
    cast.play()


def test_of_what_else_moves_nothing_is_evaluated_on_other_frames(cast):
    """It may have been edited without a key."""
    shape = bpy.data.objects.new("Shape", None)
    for frame in (1, 10):
        shape.location.x = frame
        shape.keyframe_insert("location", frame=frame)
    cast.scene.collection.objects.link(shape)
    for armature, *_ in both(cast):
        armature.pose.bones["bone1"].custom_shape = shape
    cast.scene.frame_set(4)
    shape.location.x = 50
    layer().update()
    wait(cast)
    assert shape.location.x == 50
    assert cast.rig.reason == "Shape, on which Rig depends, has changes that are not keyed: key them"
    cast.play()


def test_a_character_that_is_played_is_compared_first(cast):
    select(cast.rig.ob)
    bpy.ops.object.sinew_record()
    assert cast.rig.is_played and len(cast.rig.source.compared) > 1 and not cast.rig.trial.needs_program
    cast.play()


def compare_more(cast):
    """What the timer does while the user does nothing for long."""
    for number in range(100):
        if not accelerating().compare_more(cast.scene, layer()):
            return number
    raise AssertionError("it does not come to an end")


def test_all_frames_are_compared_while_nothing_is_done(cast, monkeypatch):
    monkeypatch.setattr(addon_module("played.comparing"), "SECONDS", 0.02)
    cast.scene.frame_end = 60
    cast.play([4])
    accelerate(cast)
    compared, names = cast.rig.source.compared, data_names()
    assert len(compared) < 60 and compare_more(cast) > 1
    assert compared == set(range(1, 61)) and cast.rig.is_played and cast.scene.frame_current == 4
    assert data_names() == names
    cast.assert_same()
    cast.play()
    assert compare_more(cast) == 0
    turn(cast)
    cast.play([5])
    wait(cast)
    assert compare_more(cast) > 0 and cast.rig.is_played
    cast.play()


def misread_the_last_key(monkeypatch):
    """Has the last key of a bone's curve read as another one. Returns a function that ends it."""
    reading = addon_module("description.reading")
    read = reading.read

    def read_wrongly(*arguments, **settings):
        found = read(*arguments, **settings)
        curve = next(each for each in found.description["curves"] if each["path"] == 'pose.bones["bone1"].location')
        curve["keys"][-1][3] += 0.01
        return found

    monkeypatch.setattr(reading, "read", read_wrongly)
    return lambda: monkeypatch.setattr(reading, "read", read)


class InOrder:
    """No chance at all."""

    def randrange(self, first, _end):
        return first

    def sample(self, found, _count):
        return found


@pytest.mark.says_errors
def test_a_difference_that_is_found_while_nothing_is_done_has_it_live(cast, monkeypatch):
    comparing = addon_module("played.comparing")
    monkeypatch.setattr(comparing, "SECONDS", -1)  # one frame
    monkeypatch.setattr(comparing.random, "Random", InOrder)
    misread_the_last_key(monkeypatch)
    cast.scene.frame_end = 20
    for each in both(cast):
        for frame in (1, 6, 20):
            each[0].pose.bones["bone1"].keyframe_insert("location", frame=frame)
            each[0].pose.bones["bone1"].location.x += 0.1
    cast.play([1])
    accelerate(cast)
    cast.play([3])
    compare_more(cast)
    assert not cast.rig.is_idle and 'the bone "bone1" of Rig would have' in cast.rig.source.refusal
    cast.play([9, 15])
    wait(cast)
    assert not cast.rig.is_idle
    cast.play()


@pytest.mark.says_errors
def test_a_difference_is_seen_on_another_frame(cast, monkeypatch, tmp_path):
    """A key of a later frame that is read wrongly makes no difference on this one."""
    cast.play([1])
    stop_misreading = misread_the_last_key(monkeypatch)
    for each in both(cast):
        for frame in (1, 10):
            each[0].pose.bones["bone1"].keyframe_insert("location", frame=frame)
            each[0].pose.bones["bone1"].location.x += 0.1
    cast.play([1])
    wait(cast)
    assert (
        not cast.rig.is_idle
        and 'the bone "bone1" of Rig would have' in cast.rig.reason
        and "instead of" in cast.rig.reason
    )
    cast.play()
    text, reason = addon_module("ui.rig_cures").text_of(cast.rig.ob)
    assert text == "Rig: Blender's" and reason == cast.rig.reason
    path = tmp_path / "report.json"
    bpy.ops.object.sinew_report_rig(filepath=str(path), armature=cast.rig.ob.name)
    report = json.loads(path.read_text())
    program = addon_module("native").sinew_native.RigProgram(report["description"])
    computed = program.evaluate(np.array([report["frame"]], np.float32))[0]
    assert np.array_equal(computed, np.array(report["computed"], np.float32))
    assert not np.array_equal(computed, np.array(report["blender"], np.float32))
    stop_misreading()
    turn(cast)
    cast.play([1])
    wait(cast)
    assert cast.rig.is_played and cast.rig.trust.difference is None, cast.rig.reason
    with pytest.raises(RuntimeError, match="No difference from Blender was found in Rig"):
        bpy.ops.object.sinew_report_rig(filepath=str(path), armature=cast.rig.ob.name)
    cast.play()


@pytest.fixture
def misread(monkeypatch):
    """A function that has all bones read as if they were elsewhere, or again as they are."""
    reading = addon_module("description.reading")
    read = reading.read

    def moved(*arguments, **settings):
        found = read(*arguments, **settings)
        for bone in found.description["bones"]:
            bone["matrix_local"][0][3] += 0.01
        return found

    def switch(is_on):
        monkeypatch.setattr(reading, "read", moved if is_on else read)

    return switch


@pytest.mark.says_errors
def test_a_difference_on_the_first_frame_is_reported(cast, misread, tmp_path, caplog):
    misread(True)
    wait(cast)
    assert not cast.rig.is_idle and "on frame 1, " in cast.rig.reason and "would have" in cast.rig.reason
    assert [record.levelname for record in caplog.records] == ["WARNING"] and cast.rig.reason in caplog.text
    path = tmp_path / "report.json"
    bpy.ops.object.sinew_report_rig(filepath=str(path), armature=cast.rig.ob.name)
    assert json.loads(path.read_text())["frame"] == 1
    misread(False)
    turn(cast)
    cast.play([1])
    accelerate(cast)
    assert cast.rig.trust.difference is None


@pytest.mark.parametrize("off, counts", ((3e-7, True), (1e-4, False)))
@pytest.mark.says_errors
def test_on_other_systems_the_last_bits_may_differ(cast, monkeypatch, off, counts):
    monkeypatch.setattr(addon_module("played.differences"), "IS_EXACT", False)
    reading = addon_module("description.reading")
    read = reading.read

    def read_almost(*arguments, **settings):
        found = read(*arguments, **settings)
        for bone in found.description["bones"]:
            bone["matrix_local"][0][3] += off
        return found

    monkeypatch.setattr(reading, "read", read_almost)
    can_render(cast.scene)

    def assert_as_expected():
        assert cast.rig.is_played == counts, cast.rig.reason
        assert "would have" in cast.rig.reason or counts

    wait(cast)
    assert_as_expected()
    for frame in (2, 3, 7):
        cast.scene.frame_set(frame)
        assert np.allclose(evaluated(cast.played[1]), evaluated(cast.live[1]), rtol=0, atol=1e-5)
        assert_as_expected()
    bpy.ops.render.render()
    turn(cast)
    cast.scene.frame_set(4)
    states().take_over_again(cast.scene, layer())
    assert_as_expected()


@pytest.mark.says_errors
@pytest.mark.parametrize("is_ahead", (False, True))
def test_what_is_read_again_after_an_edit_is_compared_with_the_edit(cast, misread, is_ahead):
    cast.scene.frame_set(3)
    accelerate(cast)

    def edit():
        turn(cast)
        wait(cast) if is_ahead else cast.scene.frame_set(5)

    for _ in range(2):
        edit()
        assert cast.rig.is_idle and 3 in cast.rig.source.compared, cast.rig.reason
        cast.play([4, 5, 3])
        assert cast.rig.is_played
    for time in (1, 2):
        misread(True)
        cast.rig.motion.last = None  # so that all of it is read
        edit()
        layer().update()
        assert not cast.rig.is_idle and "on frame 3, " in cast.rig.trust.difference.sentence(cast.rig.ob)
        assert cast.rig.trust.difference.given and cast.rig.trust.is_distrusted == (time == 2)
        misread(False)
        turn(cast)
        cast.play([4, 5, 3])
        wait(cast)
        assert cast.rig.is_played == (time == 1), cast.rig.reason
    for armature, *_ in both(cast):
        armature.data.bones["bone2"].inherit_scale = "NONE"
    cast.play([4, 5, 3])
    wait(cast)
    assert cast.rig.is_played, "it is computed again when it has other settings"
    cast.play()


@pytest.fixture
def computed_now(monkeypatch):
    """The times that were computed when they were needed, not ahead."""
    native, found, begun = addon_module("native").sinew_native, [], {}

    class Player(native.RigPlayer):
        @staticmethod
        def begin(players, frame):
            begun.update(dict.fromkeys(map(id, players), frame))
            native.RigPlayer.begin(players, frame)

        @staticmethod
        def moments(asked, frame):
            found.extend(frame for player, _given in asked if begun.get(id(player)) != frame)
            return native.RigPlayer.moments(asked, frame)

    monkeypatch.setattr(addon_module("played.computing"), "sinew_native", Stand(native, RigPlayer=Player))
    return found


class Stand:
    def __init__(self, known, **others):
        self._known = known
        vars(self).update(others)

    def __getattr__(self, name):
        return getattr(self._known, name)


def test_the_next_frame_is_computed_ahead_in_step_with_the_playback(cast, computed_now):
    accelerate(cast)
    for frames, late in (
        ((2, 3, 4, 5, 6), [2, 3, 4]),
        ((9, 8, 7, 6), [9, 8]),  # 7 would have come after 6
        ((2, 4, 6, 8, 3), [2, 4, 6, 3]),
        ((5, 1, 7), [5, 1, 7]),
    ):
        computed_now.clear()
        cast.play(frames)
        assert computed_now == late
    computed_now.clear()
    for half in (6, 7, 8, 9):
        cast.scene.frame_set(half // 2, subframe=half % 2 / 2)
        cast.assert_same()
    assert computed_now == [3, 3.5, 4]
    assert cast.rig.is_played


@pytest.mark.parametrize("edit", EDITS)
def test_what_was_computed_ahead_is_not_shown_after_an_edit(cast, edit):
    accelerate(cast)
    cast.play([2, 3, 4])
    for armature, *_ in both(cast):
        edit(armature)
    cast.play([5, 6, 7])


@pytest.mark.parametrize("edit", EDITS)
def test_edits(cast, edit):
    accelerate(cast)
    cast.play([3, 5])
    for armature, *_ in both(cast):
        edit(armature)
    layer().update()
    cast.assert_same()
    cast.play([5, 3])
    wait(cast)
    cast.play()


def test_it_is_posed_and_read_again_before_the_next_frame(cast):
    accelerate(cast)
    select(cast.played[0])
    for _ in range(2):
        move(cast, 2)
        cast.assert_same()
        assert cast.rig.state is state("POSED") and cast.rig.source.program is None
        assert wait(cast) == 1 and cast.rig.state is state("POSED")
        program = cast.rig.source.program
        assert program is not None
        cast.assert_same()
        cast.play([5, 3])
        assert cast.rig.is_played and cast.rig.source.program is program


def scale(armature):
    armature.pose.bones["bone2"].scale = 1.3, 1, 0.8


def set_property(armature):
    armature["level"] = 0.9
    armature.update_tag()


def insert_key(armature):
    bone = armature.pose.bones["bone2"]
    bone.rotation_quaternion = 1, 0.2, 0.3, 0
    bone.keyframe_insert("rotation_quaternion", frame=5)


def move_target(armature):
    bpy.data.objects[armature["goal"]].location.x += 0.5


def set_influence(armature):
    armature.pose.bones["bone3"].constraints[0].influence = 0.9


def set_weight(armature):
    armature.pose.bones["bone3"].constraints[1].targets[0].weight = 0.2


def set_mode(armature):
    armature.pose.bones["bone1"].rotation_mode = "XYZ"


def mute_group(armature):
    action = armature.animation_data.action
    curve = next(each for each in addon_module("blender.animation").slot_curves(armature) if "bone1" in each.data_path)
    if curve.group is None:  # the official 4.2 makes none
        curve.group = action.groups.new("Group")
    curve.group.mute = True
    action.update_tag()  # which Blender does not do
    armature.update_tag(refresh={"TIME"})
    armature.pose.bones["bone2"].scale.x = 1.1


def set_rest(armature):
    armature.data.bones["bone2"].use_inherit_rotation = False


def follow_a_goal(cast):
    for armature, *_ in both(cast):
        goal = bpy.data.objects.new("Goal", None)
        goal.location = 1, 0, 2
        cast.scene.collection.objects.link(goal)
        armature["level"], armature["goal"] = 0.4, goal.name
        bones = armature.pose.bones
        copied = bones["bone3"].constraints.new("COPY_LOCATION")
        copied.target, copied.influence = goal, 0.3
        mixed = bones["bone3"].constraints.new("ARMATURE")
        for name, weight in (("bone1", 0.4), ("bone2", 0.6)):
            target = mixed.targets.new()
            target.target, target.subtarget, target.weight = armature, name, weight
        driver = bones["bone2"].driver_add("location", 0).driver
        driver.expression = "level"
        variable = driver.variables.new()
        variable.name = "level"
        variable.targets[0].id, variable.targets[0].data_path = armature, '["level"]'
    layer().update()


@pytest.mark.parametrize(
    "change, builds",
    [(scale, False), (set_property, False), (insert_key, False), (move_target, False)]
    + [(each, True) for each in (set_influence, set_weight, set_mode, set_rest)]
    + [(mute_group, bpy.app.version < (4, 4, 0))],  # later versions evaluate its curves
)
def test_posing_and_keys_do_not_have_a_rig_built_again(cast, monkeypatch, change, builds):
    follow_a_goal(cast)
    switch = "enabled" if change in (scale, set_property) else "mute"
    for armature, *_ in both(cast):  # which is written on each frame
        switched = armature.pose.bones["side"].constraints.new("COPY_ROTATION")
        switched.target, switched.subtarget = armature, "bone1"
        for frame, switched.influence, switched.mute in ((1, 0.1, False), (6, 0.8, True), (10, 0.4, False)):
            switched.keyframe_insert("influence", frame=frame)
            switched.keyframe_insert(switch, frame=frame)
        if change in (scale, insert_key):
            track = armature.animation_data.nla_tracks.new()
            track.strips.new("Other", 1, armature.animation_data.action)
            track.mute = True
    cast.scene.frame_set(1)
    accelerate(cast)
    cast.play([7, 3])
    computing, built = addon_module("played.computing"), []
    read = computing.read
    monkeypatch.setattr(computing, "read", lambda *arguments: built.append(read(*arguments)))
    for armature, *_ in both(cast):
        change(armature)
    layer().update()
    cast.assert_same()
    for _ in range(2):
        cast.play([5, 3, 8])
    assert cast.rig.is_played and bool(built) == builds


def move_armature(armature):
    armature.location.x += 0.5


@pytest.mark.parametrize("change", (move_target, move_armature))
def test_what_it_follows_is_edited_without_an_evaluation(cast, change):
    """On a frame on which that makes no difference."""
    follow_a_goal(cast)
    for armature, *_ in both(cast):
        constraint = armature.pose.bones["bone3"].constraints[0]
        for frame, constraint.influence in ((4, 0.6), (5, 0.0), (8, 0.8)):
            constraint.keyframe_insert("influence", frame=frame)
    cast.scene.frame_set(3)
    accelerate(cast)
    cast.play([3])
    for armature, *_ in both(cast):
        scale(armature)
        change(armature)
    cast.play([5, 8, 3])
    wait(cast)
    cast.play()


@pytest.mark.skipif(bpy.app.version < (4, 4, 0), reason="an action has no slots")
def test_keys_of_another_slot_are_not_its_own(cast):
    action = cast.played[0].animation_data.action
    bag = action.layers[0].strips[0].channelbag(action.slots.new("OBJECT", "Other"), ensure=True)
    curve = bag.fcurves.new('pose.bones["bone1"].rotation_quaternion', index=1)
    curve.keyframe_points.insert(1, 2)
    layer().update()
    accelerate(cast)
    cast.play([3])
    curve.keyframe_points[0].co.y = 5
    curve.update()
    move(cast, 2)
    cast.play([5, 3])
    cast.play()


@pytest.mark.parametrize(
    "change", [lambda cast: move(cast, 3, "bone2"), lambda cast: key(cast, 4)], ids=["pose", "keys"]
)
def test_what_is_edited_after_it_was_read_again_is_seen(cast, change):
    accelerate(cast)
    move(cast, 2)
    wait(cast)
    change(cast)
    cast.assert_same()
    cast.play([5, 4, 3])
    cast.play()


def test_what_is_edited_without_an_evaluation_is_seen(cast):
    accelerate(cast)
    move(cast, 2)
    wait(cast)
    for armature, *_ in both(cast):
        armature.pose.bones["bone2"].constraints.new("LIMIT_ROTATION").use_limit_x = True
        armature.pose.bones["bone1"].keyframe_insert("scale", frame=2)
    cast.play()


def test_undo(cast):
    accelerate(cast)
    undo_a_pose(cast)
    wait(cast)
    cast.play()
    assert cast.rig.is_played


def add_object(_cast):
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("New", None))


def hide_a_mesh(cast):
    for _armature, mesh, *_ in both(cast):
        mesh.hide_viewport = True


def add_a_constraint(cast):
    for armature, *_ in both(cast):
        armature.pose.bones["side"].constraints.new("COPY_LOCATION").target = armature


@pytest.mark.parametrize("is_playing", (False, True))
@pytest.mark.parametrize("change, is_read", ((add_object, False), (hide_a_mesh, False), (add_a_constraint, True)))
def test_when_blender_has_built_relations_it_is_computed_as_before(cast, monkeypatch, change, is_read, is_playing):
    accelerate(cast)
    cast.play([2, 3])
    computing, reads = addon_module("played.computing"), []
    read = computing.read
    monkeypatch.setattr(computing, "read", lambda *arguments: reads.append(read(*arguments)))
    before = set(cast.rig.source.compared)
    change(cast)
    layer().update()
    cast.play([4])
    states().take_over_again(cast.scene, layer(), is_playing)
    if not is_read:
        assert cast.rig.is_played and not reads and cast.rig.source.compared >= before, cast.rig.reason
    cast.play([5, 6])
    wait(cast)
    assert cast.rig.is_played, cast.rig.reason
    cast.play()


def test_keys_of_an_action_that_a_live_armature_plays_too(cast):
    """Blender copies it again, but not before the evaluation in which the edit shows."""
    other, data = make_armature(), cast.played[0].animation_data
    other.animation_data_create().action = data.action
    if hasattr(data, "action_slot"):
        other.animation_data.action_slot = data.action_slot
    select()
    cast.scene.frame_set(5)
    accelerate(cast)
    for armature, *_ in both(cast):
        for curve in addon_module("blender.animation").slot_curves(armature):
            for point in curve.keyframe_points:
                point.co.y += 0.2
            curve.update()
        armature.animation_data.action.update_tag()
    layer().update()
    assert cast.rig.is_idle
    cast.assert_same()
    cast.play()


@pytest.mark.parametrize("is_by_eye", (False, True))
def test_a_hidden_armature_whose_mesh_is_seen_is_accelerated(cast, is_by_eye):
    """Blender evaluates it for the mesh, but by itself it does not, so that other frames are not compared."""
    for armature, *_ in both(cast):
        armature.hide_set(is_by_eye)
        armature.hide_viewport = not is_by_eye
    cast.scene.frame_set(2)
    accelerate(cast)
    cast.play()


@pytest.mark.parametrize("is_accelerated", (False, True))
def test_bones_that_blender_leaves_as_they_were_are_not_compared(cast, caplog, is_accelerated):
    """Of an armature that is hidden with its meshes it evaluates only what a driver reads."""
    reader = bpy.data.objects.new("Reader", None)
    cast.scene.collection.objects.link(reader)
    variable = reader.driver_add("location", 0).driver.variables.new()
    variable.targets[0].id, variable.targets[0].data_path = cast.played[0], 'pose.bones["bone0"].location[0]'
    if is_accelerated:
        accelerate(cast)
        states().melt_all()
    for ob in cast.played:
        ob.hide_viewport = True
    for frame in (3, 5, 8):
        cast.scene.frame_set(frame)
        wait(cast)
        states().take_over([cast.rig], cast.scene, layer())
        assert caplog.records == [] and not cast.rig.trust.is_distrusted
    for ob in cast.played:
        ob.hide_viewport = False
    cast.play([2, 6])
    states().take_over([cast.rig], cast.scene, layer())
    assert cast.rig.is_played, cast.rig.reason
    cast.play()


@pytest.mark.parametrize("by", (lambda x: np.nextafter(np.float32(x), np.float32(9)), lambda x: x + 1.2e-7))
def test_rounding_is_no_edit(cast, caplog, by):
    """Auto-keying inserts no key where a drag has moved a channel so little, and Blender 5.2 rounds the quaternion that
    it keys, and shows the one that was set until the frame is changed."""
    bone = cast.played[0].pose.bones["bone1"]
    keyed, bone.location.x = bone.location.x, by(bone.location.x)
    assert bone.location.x != keyed
    layer().update()
    wait(cast)
    assert cast.rig.is_played and cast.rig.trust.difference is None and caplog.records == []
    assert bone.location.x == keyed
    cast.play()


def test_numbers_that_are_keys_up_to_rounding():
    is_near = addon_module("blender.animation").is_near
    assert is_near(4.5e-8, 0.0) and is_near(1e6, 1e6 + 0.1) and is_near(float("inf"), float("inf"))
    assert not is_near(1e-6, 0.0) and not is_near(4.5e-8, 0.0, 0) and not is_near(float("nan"), 0.0)


@pytest.mark.parametrize("name, is_drag", (("TRANSFORM_OT_translate", True), ("VIEW3D_OT_rotate", False)))
def test_nothing_is_looked_at_during_a_drag(cast, monkeypatch, name, is_drag):
    handlers, looked = addon_module("played.frame_handlers"), []
    window = SimpleNamespace(modal_operators=[SimpleNamespace(bl_idname=name)])
    context = SimpleNamespace(
        window=window, screen=SimpleNamespace(is_animation_playing=False), scene=cast.scene, view_layer=layer()
    )
    monkeypatch.setattr(handlers, "bpy", SimpleNamespace(context=context))
    monkeypatch.setattr(handlers, "_tried", (-1, False))
    monkeypatch.setattr(states(), "take_over_again", lambda *_: looked.append(1))
    handlers.take_over_again()
    assert bool(looked) != is_drag
    window.modal_operators = []
    handlers.take_over_again()
    assert looked == [1]


def test_a_pose_that_is_not_keyed_keeps_it_live(cast):
    move(cast, 2)
    wait(cast)
    assert not cast.rig.is_played and 'not keyed (bone "bone1")' in cast.rig.reason
    cast.assert_same()
    cast.scene.frame_set(2)
    accelerate(cast)
    cast.play()


def test_one_that_cannot_be_computed_stays_live_and_is_read_ever_less_often(cast, monkeypatch):
    for armature, *_ in both(cast):
        armature.pose.bones["side"].constraints.new("SHRINKWRAP").target = cast.played[3]
    layer().update()
    reads, read = [], addon_module("played.computing")._read
    monkeypatch.setattr(addon_module("played.computing"), "_read", lambda *each: reads.append(1) or read(*each))
    for step in range(20):
        move(cast, 0.1 * step)
        for _ in range(3):
            accelerating().step(cast.scene, layer(), evaluations())
        assert not cast.rig.is_idle and "Shrinkwrap is not covered" in cast.rig.reason
    assert 3 < len(reads) < 8
    wait(cast)
    known = len(reads)
    wait(cast)
    assert len(reads) == known, "nothing was evaluated since"
    cast.play()
    assert not len(cast.rig.motion.record), "it is not recorded either"


def test_small_rigs_are_left_alone(cast, monkeypatch):
    monkeypatch.setattr(accelerating(), "LEAST_WORK", 1000)
    assert wait(cast) == 0 and not cast.rig.is_wanted


def test_what_somebody_has_left_to_blender_stays_live(cast):
    accelerate(cast)
    select(cast.played[0])
    assert bpy.ops.object.sinew_leave_to_blender() == {"FINISHED"}
    wait(cast)
    assert not cast.rig.is_idle
    assert bpy.ops.object.sinew_record() == {"FINISHED"}
    assert cast.rig.is_played and not cast.rig.trial.needs_program
    cast.play()


def test_of_a_native_rig_nothing_is_recorded(cast):
    accelerate(cast)
    select(cast.played[0])
    played = cast.scene.frame_current
    assert bpy.ops.object.sinew_record() == {"FINISHED"}
    assert cast.rig.source.is_proven and cast.scene.frame_current == played and len(cast.rig.motion.record) == 0
    cast.play()


def test_onion_skins(cast):
    accelerate(cast)
    select(cast.played[0])
    bpy.ops.object.sinew_onion_skins()
    cast.play()
    assert len(cast.rig.motion.record) == 0 and not cast.rig.motion.skins.lacks(4, cast.rig.source.player)
    bpy.ops.object.sinew_onion_skins()


class Buttons:
    """A layout that notes which operators it was given."""

    alert = False

    def __init__(self):
        self.found = {}

    def column(self, **_):
        return self

    row = column

    def label(self, **_):
        pass

    def prop(self, *_, **__):
        pass

    def operator(self, name, text=""):
        self.found[name] = SimpleNamespace()
        return self.found[name]


def buttons(cast):
    layout = Buttons()
    addon_module("ui.rig_cures").draw_rig(layout, bpy.context, cast.played[0])
    return set(layout.found)


def test_the_bone_that_keeps_a_rig_from_being_native_can_be_selected(cast):
    armature = cast.played[0]
    armature.pose.bones["bone2"].constraints.new("SHRINKWRAP").target = cast.played[3]
    layer().update()
    wait(cast)
    assert 'bone "bone2"' in cast.rig.reason, cast.rig.reason
    assert buttons(cast) == {"object.sinew_select_bone", "object.sinew_record"}
    select(cast.played[1])
    assert bpy.ops.object.sinew_select_bone(armature=armature.name_full) == {"FINISHED"}
    assert bpy.context.mode == "POSE" and bpy.context.active_object == armature
    assert addon_module("blender.selection").selected_bones(armature) == ["bone2"]
    bpy.ops.object.mode_set(mode="OBJECT")
    armature.hide_set(True)
    with pytest.raises(RuntimeError, match="is hidden: show it first"):
        bpy.ops.object.sinew_select_bone(armature=armature.name_full)
    for operator in (bpy.ops.object.sinew_select_bone, bpy.ops.object.sinew_accelerate_again):
        with pytest.raises(RuntimeError, match="No rig Nobody of this view layer was accelerated"):
            operator(armature="Nobody")


def test_a_difference_can_be_reported_when_nothing_else_is_said(cast):
    accelerate(cast)
    assert buttons(cast) == set()
    cast.rig.trust.difference = "one"
    assert buttons(cast) == {"object.sinew_report_rig"}
    cast.scene.sinew_accelerates_rigs = False
    assert buttons(cast) == set()  # nothing is known any more
    cast.scene.sinew_accelerates_rigs = True


@pytest.mark.says_errors
def test_one_that_has_differed_twice_can_be_tried_again(cast, misread):
    cast.scene.frame_set(3)
    accelerate(cast)
    for _ in range(2):
        misread(True)
        cast.rig.motion.last = None  # so that all of it is read
        turn(cast)
        wait(cast)
        layer().update()
        misread(False)
        turn(cast)
        cast.play([4, 5, 3])
        wait(cast)
    assert cast.rig.trust.is_distrusted and "object.sinew_accelerate_again" in buttons(cast)
    assert bpy.ops.object.sinew_accelerate_again(armature=cast.played[0].name_full) == {"FINISHED"}
    assert "object.sinew_accelerate_again" not in buttons(cast)
    accelerate(cast)
    cast.play()


def test_what_the_panel_says(cast):
    text_of = addon_module("ui.rig_cures").text_of
    assert text_of(cast.played[0]) == ("", "")
    move(cast, 2)
    wait(cast)
    text, reason = text_of(cast.played[0])
    assert text == "Rig: Blender's" and "not keyed" in reason
    cast.scene.frame_set(2)
    accelerate(cast)
    cast.scene.frame_set(3)
    said = r"Rig: native(, \d+\.\d times faster)?\n\d+\.\d\d ms \(Blender \d+\.\d\d\)"
    assert re.fullmatch(said, text_of(cast.played[0])[0])
    cast.rig.source.milliseconds, cast.rig.source.blender_milliseconds = 0.164, 0.41
    assert text_of(cast.played[0])[0] == "Rig: native, 2.5 times faster\n0.16 ms (Blender 0.41)"
    cast.rig.source.milliseconds = 0.5
    assert text_of(cast.played[0])[0] == "Rig: native\n0.50 ms (Blender 0.41)"
    select(cast.played[0])
    bpy.ops.object.sinew_leave_to_blender()
    assert text_of(cast.played[0]) == ("Rig: Blender's", "")


def test_the_panel_says_medians_over_the_same_frames(cast, monkeypatch):
    comparing, counts = addon_module("played.comparing"), []

    def median(spent):
        counts.append(len(spent))
        return len(counts)

    monkeypatch.setattr(comparing, "median", median)
    accelerate(cast)
    assert counts[0] > 1 and counts[0] == counts[1]
    text = addon_module("ui.rig_cures").text_of(cast.played[0])[0]
    assert text == "Rig: native, 2.0 times faster\n1.00 ms (Blender 2.00)"


def test_measuring_compares_it_with_blender(cast):
    """Blender evaluates the rigs as long as their share is measured."""
    accelerate(cast)
    were_played = []

    class Progress:
        def step(self, *_):
            pass

    whole_frames = addon_module("main.whole_frames")

    def look(*_):
        were_played.append(cast.rig.is_played)

    bpy.app.handlers.frame_change_pre.append(look)
    try:
        measured = whole_frames.measure(cast.scene, Progress(), lambda: states().all_live(cast.scene, layer()))
    finally:
        bpy.app.handlers.frame_change_pre.remove(look)
    assert measured.sinew > 0 and 20 < sum(were_played) < len(were_played) - 20
    assert cast.rig.is_played and cast.rig.trial.needs_program
    cast.play()


def test_the_switch(cast):
    accelerate(cast)
    cast.scene.sinew_accelerates_rigs = False
    assert not cast.rig.is_wanted and not cast.rig.is_idle
    cast.play()
    assert not cast.rig.motion.record.runs() and cast.rig.motion.watch is None  # nobody has asked for a record
    cast.scene.sinew_accelerates_rigs = True
    keep_live(cast)
    accelerate(cast)
    cast.play()


def test_the_profile_is_that_of_rigs_that_blender_evaluates(cast):
    accelerate(cast)
    were_played = []

    def look(*_):
        were_played.append(cast.rig.is_played)

    bpy.app.handlers.frame_change_pre.append(look)
    try:
        profile = addon_module("profiling.measure").run(bpy.context, 2, 7)
    finally:
        bpy.app.handlers.frame_change_pre.remove(look)
    assert profile.objects and len(were_played) > 20 and sum(were_played) <= 2  # before and after
    assert cast.rig.is_played
    cast.play()


def test_each_rig_has_a_switch(cast):
    accelerate(cast)
    cast.played[0].sinew_accelerates_rig = False
    assert not cast.rig.is_wanted and not cast.rig.is_idle
    wait(cast)
    cast.play()
    assert not cast.rig.is_idle
    assert addon_module("ui.rig_cures").text_of(cast.played[0]) == ("Rig: Blender's", "")
    cast.played[0].sinew_accelerates_rig = True
    accelerate(cast)
    cast.play()


def test_what_is_undone_of_a_switch_is_done(cast):
    cast.played[0].sinew_accelerates_rig = False
    bpy.ops.ed.undo_push(message="off")
    cast.played[0].sinew_accelerates_rig = True
    bpy.ops.ed.undo_push(message="on")
    wait(cast)
    assert cast.rig.is_played
    for step, is_native in ((bpy.ops.ed.undo, False), (bpy.ops.ed.redo, True)):
        name = cast.played[0].name
        step()
        cast.scene, cast.played = bpy.context.scene, [bpy.data.objects[name]]
        wait(cast)
        assert cast.rig.is_played == is_native


def test_the_switch_is_that_of_one_scene(cast):
    """What was read of the rigs of others is kept, and they are native again as soon as somebody looks."""
    other = bpy.data.scenes.new("Other")
    accelerate(cast)
    source = cast.rig.source
    bpy.context.window.scene = other
    other.sinew_accelerates_rigs = False
    assert cast.rig.source is source and cast.rig.trial.needs_program and cast.rig.is_wanted
    other.sinew_accelerates_rigs = True
    bpy.context.window.scene = cast.scene
    layer().update()
    states().take_over_again(cast.scene, layer())
    assert cast.rig.is_played
    cast.play()


def test_a_renamed_rig_has_its_new_name_in_sentences(cast):
    accelerate(cast)
    cast.rig.ob.name = "Heroine"
    cast.scene.frame_set(3, subframe=0.5)
    sentence = addon_module("played.reasons").why_live(cast.rig, cast.scene, layer())
    assert sentence == "Heroine is Blender's between two frames: only whole frames are recorded"


def test_a_rig_whose_renaming_is_undone_is_found_again(cast):
    accelerate(cast)
    source, rig = cast.rig.source.program, cast.rig
    bpy.ops.ed.undo_push(message="before")
    cast.rig.ob.name = "Heroine"
    assert rig.name == "Heroine"
    bpy.ops.ed.undo_push(message="renamed")
    bpy.ops.ed.undo()
    assert source is not None and rig.ob == bpy.data.objects["Rig"] and recorded().get(rig.ob) is rig
    assert rig.name == "Rig"


class Fleeting:
    """A scene that no longer exists once its frame was read."""

    def __init__(self, scene):
        self.render, self._frames = scene.render, [1]

    @property
    def frame_current(self):
        if not self._frames:
            raise ReferenceError
        return self._frames.pop()


def test_handlers_are_given_back_if_an_evaluation_fails(cast):
    lists = bpy.app.handlers.depsgraph_update_pre, bpy.app.handlers.depsgraph_update_post
    before, names = [list(each) for each in lists], data_names()
    with pytest.raises(ReferenceError):
        with addon_module("played.elsewhere").on_frames([cast.rig.ob], Fleeting(cast.scene)):
            assert not any(map(len, lists))
    assert [list(each) for each in lists] == before and data_names() == names


def test_undo_of_a_key_and_of_a_pose_with_pauses(cast):
    cast.scene.frame_set(8)
    accelerate(cast)
    bpy.ops.ed.undo_push(message="before")
    turn(cast)
    bpy.ops.ed.undo_push(message="posed")
    wait(cast)
    for armature, *_ in both(cast):
        for path in ("location", "rotation_quaternion", "scale"):
            armature.pose.bones["bone1"].keyframe_insert(path)
    layer().update()
    bpy.ops.ed.undo_push(message="keyed")
    wait(cast)
    for frame in (12, 8):
        cast.scene.frame_set(frame)
        cast.assert_same()
    for _ in range(2):
        cast.undo()
        wait(cast)
        cast.assert_same()
    cast.play([*FRAMES, 8])
    wait(cast)
    assert cast.rig.is_played, cast.rig.reason


def turn(cast):
    for armature, *_ in both(cast):
        armature.pose.bones["bone1"].rotation_quaternion.rotate(Euler((0.3, 0.2, 0.1)))
    layer().update()


def test_a_bake_accelerates_rigs(cast):
    """The frames that it reads are those of live rigs."""
    evaluation, found, were_played = addon_module("bake.evaluation"), {}, []
    for way in (False, True):
        cast.scene.sinew_accelerates_rigs = way
        keep_live(cast)
        with evaluation.undisturbed(bpy.context):
            for frame in (3, 4.5, 7):
                cast.scene.frame_set(int(frame), subframe=frame % 1)
                cast.assert_same()
                were_played.append(cast.rig.is_played)
                found.setdefault(way, []).append(evaluation.read(cast.played[1], depsgraph())[0])
    assert were_played == [False] * 3 + [True] * 3
    assert np.array_equal(found[False], found[True])


def test_scripts_in_the_background(cast):
    """Frames that a script changes are computed after some, and again after an edit."""
    addon_module("played.frame_handlers")._frames = 0
    few, more = range(1, 11), [*range(1, 11)] * 4
    cast.play(few)
    assert not cast.rig.is_played
    cast.play(more)
    assert cast.rig.is_played and cast.rig.trial.needs_program, cast.rig.reason
    turn(cast)
    cast.play(more)
    assert cast.rig.is_played
    constraint = [each[0].pose.bones["side"].constraints.new("SHRINKWRAP") for each in both(cast)]
    for each in constraint:
        each.target = cast.played[3]
    cast.play(more)
    assert not cast.rig.is_played and "Shrinkwrap" in cast.rig.reason
    cast.scene.sinew_accelerates_rigs = False
    for each, (armature, *_) in zip(constraint, both(cast)):
        armature.pose.bones["side"].constraints.remove(each)
    cast.play(more)
    assert not cast.rig.is_played


@pytest.fixture
def readings(monkeypatch):
    """The names of the rigs whose programs were read, in order."""
    computing, found = addon_module("played.computing"), []

    def counted(function):
        def noted(rig, *others):
            found.append(rig.name)
            return function(rig, *others)

        return noted

    for name in ("read", "read_again"):
        monkeypatch.setattr(computing, name, counted(getattr(computing, name)))
    return found


def poses_and_keys(cast, frame):
    for armature, *_ in both(cast):
        bone = armature.pose.bones["bone1"]
        bone.rotation_quaternion.rotate(Euler((0.05 * frame, 0.02, 0.01)))
        bone.keyframe_insert("rotation_quaternion", frame=frame)


def poses_and_updates(cast, frame):
    for armature, *_ in both(cast):
        armature.pose.bones["side"].location.x = 0.01 * frame
    layer().update()


@pytest.mark.parametrize("edit", (poses_and_keys, poses_and_updates))
def test_a_script_that_edits_on_each_frame_has_it_read_a_few_times(cast, readings, edit):
    """It stays Blender's until it rests, and is right all the time."""
    accelerate(cast)
    readings.clear()
    for frame in range(1, 61):
        cast.scene.frame_set(frame)
        cast.assert_same()
        edit(cast, frame)
    assert len(readings) <= 4 and not cast.rig.is_idle and "is edited on each frame" in cast.rig.reason
    layer().update()
    cast.play([*range(1, 11)] * 5)
    assert cast.rig.is_played, cast.rig.reason


def test_a_script_that_has_edited_before_is_not_read_in_the_background(cast, readings):
    addon_module("played.frame_handlers")._frames = 0
    for frame in range(1, 80):
        cast.scene.frame_set(frame)
        poses_and_keys(cast, frame)
    cast.assert_same()
    assert readings == [] and not cast.rig.is_idle


def test_edits_now_and_then_leave_it_native(cast, readings):
    accelerate(cast)
    readings.clear()
    for frame in range(1, 101):
        cast.scene.frame_set(frame)
        if frame % 10 == 0:
            poses_and_updates(cast, frame)
        cast.assert_same()
        assert cast.rig.is_idle
    assert len(readings) >= 9


def test_the_longer_it_was_edited_the_longer_it_rests():
    rest = addon_module("played.resting").Rest()
    found = []
    for _ in range(3):
        while rest.may_read():
            pass
        found.append(rest.left)
        rest.note_live(False, True)
        assert rest.left == found[-1] - 1
        rest.note_live(True, True)
        assert rest.left == found[-1]
        rest.end()
        assert rest.left == 0
    assert found[1] == 2 * found[0] and found[2] == 2 * found[1]
    for _ in range(1000):
        rest.note_played()
    assert rest == addon_module("played.resting").Rest()


def test_while_the_user_does_nothing_it_has_rested(cast):
    accelerate(cast)
    for frame in range(1, 11):
        cast.scene.frame_set(frame)
        poses_and_keys(cast, frame)
    layer().update()
    wait(cast)
    assert not cast.rig.is_idle and cast.rig.trial.rest.left
    accelerating().end_rests()
    accelerate(cast)
    cast.play()


def test_handlers_of_others_see_every_update_in_the_background(cast):
    """Also on the frame after which rigs are accelerated."""
    addon_module("played.frame_handlers")._frames = 0
    seen = []

    def look(_scene, graph):
        seen.append((cast.rig.is_played, {update.id.name for update in graph.updates}))

    bpy.app.handlers.frame_change_post.append(look)
    try:
        cast.play([*range(1, 11)] * 3)
    finally:
        bpy.app.handlers.frame_change_post.remove(look)
    assert cast.rig.is_played and {is_played for is_played, _names in seen} == {False, True}
    assert all({each.name for each in (*cast.played[1:], *cast.live)} <= names for _is_played, names in seen)


@pytest.mark.parametrize("is_assigned", (False, True), ids=("frame_set", "frame_current"))
def test_handlers_of_others_see_the_last_frame_before_the_next(cast, is_assigned):
    """Such as those of bone physics, which remember where bones were."""
    accelerate(cast)
    seen = []

    def look(*_):
        for armature, *_ in both(cast):
            bone = armature.pose.bones["bone2"]
            copy = armature.evaluated_get(layer().depsgraph).pose.bones["bone2"]
            seen.append([*bone.matrix, *bone.rotation_quaternion, *bone.location, *copy.matrix])

    listed = bpy.app.handlers.depsgraph_update_pre if is_assigned else bpy.app.handlers.frame_change_pre
    listed.append(look)
    try:
        for frame in (5, 2, 8):
            if is_assigned:
                cast.scene.frame_current = frame
            else:
                cast.scene.frame_set(frame)
            cast.assert_same()
    finally:
        listed.remove(look)
    assert cast.rig.is_played and len(seen) >= 6
    assert seen[::2] == seen[1::2] and seen[0] != seen[2]


def test_a_later_bake_tries_again_what_was_edited_since(cast):
    undisturbed = addon_module("bake.evaluation").undisturbed
    constraints = [each[0].pose.bones["side"].constraints.new("SHRINKWRAP") for each in both(cast)]
    for constraint in constraints:
        constraint.target = cast.played[3]
    layer().update()
    with undisturbed(bpy.context):
        assert not cast.rig.is_played
    for constraint, (armature, *_) in zip(constraints, both(cast)):
        armature.pose.bones["side"].constraints.remove(constraint)
    layer().update()
    with undisturbed(bpy.context):
        assert cast.rig.is_played, cast.rig.reason
        cast.play()


def test_measuring_that_fails_leaves_it_computed(cast):
    accelerate(cast)
    with pytest.raises(KeyError), states().all_live(cast.scene, layer()):
        assert not cast.rig.is_played
        raise KeyError
    assert cast.rig.is_played and cast.rig.trial.needs_program


@pytest.mark.says_errors
def test_renders_compare_it_with_blender(cast):
    can_render(cast.scene)
    accelerate(cast)
    cast.rig.source.compared.clear()
    cast.scene.frame_set(3)
    bpy.ops.render.render()
    assert cast.rig.is_played and cast.rig.source.compared == {3}
    cast.play([3, 4])

    def disturb(_scene, graph):
        if graph.mode == "RENDER":
            cast.played[0].evaluated_get(graph).pose.bones["bone1"].location.x += 1

    bpy.app.handlers.frame_change_post.insert(0, disturb)
    try:
        for time in (1, 2):
            cast.scene.frame_set(4)
            bpy.ops.render.render()
            layer().update()
            assert not cast.rig.is_idle and "on frame 4, " in cast.rig.reason
            assert cast.rig.trust.difference is not None and cast.rig.trust.is_distrusted == (time == 2)
            cast.play()
            wait(cast)
            assert cast.rig.is_played == (time == 1)
    finally:
        bpy.app.handlers.frame_change_post.remove(disturb)


@pytest.mark.parametrize("is_override", (False, True))
def test_linked_characters_and_overrides(cast, tmp_path, is_override):
    """An override has the name of what it overrides, which is in the file, too."""
    names = in_a_collection(cast)

    def find():
        objects = {ob.name: ob for ob in bpy.data.objects if bool(ob.override_library) == is_override}
        cast.scene = bpy.context.scene
        cast.played, cast.live = ([objects[name] for name in each] for each in names)
        keep_live(cast)

    into_a_shot(tmp_path, is_override)
    cast.scene = bpy.context.scene
    cast.scene.frame_start, cast.scene.frame_end = 1, 10
    find()
    bpy.ops.ed.undo_push(message="before")
    accelerate(cast)
    cast.play()
    if is_override:
        turn(cast)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("New", None))
    layer().update()
    bpy.ops.ed.undo_push(message="edited")
    wait(cast)
    cast.play([3, 4])
    bpy.ops.ed.undo()
    find()
    layer().update()
    cast.assert_same()
    wait(cast)
    assert cast.rig.is_played, cast.rig.reason
    cast.play()


@pytest.mark.parametrize("is_known", (False, True))
def test_what_blender_has_yet_to_evaluate_is_no_difference(cast, is_known):
    """A timer runs between the last step of a drag, which is keyed, and the evaluation after it."""
    if is_known:
        accelerate(cast)
        add_object(cast)
        layer().update()
        assert not cast.rig.is_idle
    for moved in (0.3, 0.5):
        for armature, *_ in both(cast):
            bone = armature.pose.bones["bone2"]
            bone.location.x += moved
            bone.keyframe_insert("location")
        if is_known:
            states().take_over_again(cast.scene, layer())
        else:
            accelerating().step(cast.scene, layer(), evaluations())
        assert cast.rig.trust.difference is None and not cast.rig.trust.has_differed
    accelerate(cast)
    cast.play()


def test_an_override_on_another_frame_than_its_library(cast, tmp_path):
    """What it was made from still has the pose of the library's frame."""
    names = in_a_collection(cast)
    cast.scene.frame_set(5)
    into_a_shot(tmp_path, True)
    cast.scene = bpy.context.scene
    cast.scene.frame_start, cast.scene.frame_end = 1, 10
    objects = {ob.name: ob for ob in bpy.data.objects if ob.override_library}
    cast.played, cast.live = ([objects[name] for name in each] for each in names)
    keep_live(cast)
    cast.scene.frame_set(2)
    accelerate(cast)
    cast.play()


def make_an_object():
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Made", None))


@pytest.mark.parametrize("edit", (None, set_rest, set_mode, scale))
def test_a_scene_is_chosen_while_something_waits_to_be_removed(cast, edit):
    """Blender builds relations, with keyframes that it has not seen before, and then calls handlers: if these have it
    build them again, it crashes (4.3)."""
    removed = bpy.data.objects.new("Removed", None)
    cast.scene.collection.objects.link(removed)
    accelerate(cast)
    bpy.ops.scene.new(type="LINK_COPY")
    addon_module("run.mail").removals.append((bpy.data.objects.remove, (removed,)))
    addon_module("run.mail").post(make_an_object)
    for armature, *_ in both(cast) if edit else ():
        edit(armature)
    bpy.context.window.scene = cast.scene
    cast.assert_same()
    cast.play([3, 5])
    layer().update()
    assert "Removed" not in bpy.data.objects
    accelerate(cast)
    cast.play([6, 2])


@pytest.mark.parametrize("fewest", ({}, {"ATTRIBUTE": 3000}), ids=("large", "small"))
def test_rigs_are_native_however_small_their_meshes_are(fresh_scene, monkeypatch, fewest):
    """Whether they were bound one by one or all at once. What counts is the rig's work."""
    monkeypatch.setattr(addon_module("plan.ways"), "FEWEST_VERTICES", fewest)
    monkeypatch.setattr(accelerating(), "LEAST_WORK", 3)
    fresh_scene.frame_end = 10
    armatures, meshes = [], []
    for _ in range(3):
        armature = make_armature()
        meshes += [make_mesh(armature, False), make_mesh(armature, True)]
        for frame in (1, 10):
            pose(armature, frame, False)
        armatures.append(armature)
    select(*meshes)
    assert bpy.ops.object.sinew_bind() == {"FINISHED"}
    assert sum(ob.sinew.is_bound for ob in meshes) == (3 if fewest else 6)
    assert bpy.ops.object.sinew_bind() == {"FINISHED"}
    assert sum(ob.sinew.is_bound for ob in meshes) == (3 if fewest else 6), "one is enough"
    assert set(accelerating()._armatures(layer())) == set(armatures)
    monkeypatch.setattr(accelerating(), "LEAST_WORK", 1000)
    for ob in meshes:
        addon_module("install.bind").unbind(ob)
    assert bpy.ops.object.sinew_bind() == {"FINISHED"}
    assert sum(ob.sinew.is_bound for ob in meshes) == (0 if fewest else 6)


def test_it_is_native_again_at_once_after_relations_were_built(cast):
    """What was compared need not be compared again."""
    accelerate(cast)
    cast.scene.collection.objects.link(bpy.data.objects.new("Other", None))
    layer().update()
    assert not cast.rig.is_played
    states().take_over_again(cast.scene, layer())
    assert cast.rig.is_played, cast.rig.reason
    cast.play()


@pytest.mark.parametrize("kind", ("FULL_COPY", "LINK_COPY", "EMPTY"))
def test_a_new_scene_does_not_have_relations_built_again(cast, monkeypatch, kind):
    """Blender has built those of the new scene, calls the handlers, and evaluates. If relations were built once more in
    between, as for a rig that has to be live, Blender 4.3 would now and then follow addresses in copies that it has not
    made: a crash that random steps have found."""
    accelerate(cast)
    playing, relations, seen = addon_module("played.playing"), addon_module("host.relations"), []
    tag = relations.tag

    def note_scene(scene, *_):
        seen.append(scene.name)

    with monkeypatch.context() as patch:
        patch.setattr(playing, "_look", lambda *_: "it was edited" if seen else "")
        patch.setattr(relations, "tag", lambda: seen.append("tagged") or tag())
        bpy.app.handlers.frame_change_pre.insert(0, note_scene)
        try:
            bpy.ops.scene.new(type=kind)
        finally:
            bpy.app.handlers.frame_change_pre.remove(note_scene)
    assert seen == [bpy.context.scene.name] != [cast.scene.name]
    bpy.context.window.scene = cast.scene
    layer().update()
    cast.play()
    wait(cast)
    cast.play()


def test_a_hand_back_does_not_have_relations_built_again_that_were_just_built(cast, monkeypatch):
    """As after a scene was shown again, with all keyframes: the actions of the very rigs that are handed back tell.
    Blender 4.3 crashed when random steps removed a scene."""
    accelerate(cast)
    evaluations, relations, asked = addon_module("host.evaluations"), addon_module("host.relations"), []

    def are_new(blocks, _graph):
        asked.extend(blocks)
        return True

    with monkeypatch.context() as patch:
        patch.setattr(evaluations, "are_new", are_new)
        patch.setattr(relations, "tag", lambda: pytest.fail("relations are built again"))
        states().melt(layer().depsgraph, {})
    assert asked == [cast.played[0].animation_data.action]
    relations.tag()
    cast.play()
    wait(cast)
    cast.play()
