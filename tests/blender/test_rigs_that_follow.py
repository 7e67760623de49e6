"""Rigs that follow bones of other rigs, as a rider follows a horse, are computed after those. The second character of
the cast, and what it follows, stay live."""

import bpy
import numpy as np
import pytest
from mathutils import Euler

from characters import constrain, make_armature, pose
from helpers import addon_module, needs_memory, needs_rig_programs, select
from test_accelerated_rigs import accelerate, keep_live, recorded, wait
from test_accelerated_rigs import accelerating as accelerating
from test_played import FRAMES, Cast, layer, matrices_of, states
from test_played_who import both

pytestmark = [needs_rig_programs, needs_memory]


def add(armature, kind, leader, bone="", on="bone4", **settings):
    constrain(armature, on, kind, target=leader, subtarget=bone, **settings)


def drive(armature, path, leader, **target):
    """By what the leader has: a number of it, or where a bone is."""
    driver = armature.pose.bones["side"].driver_add(*path).driver
    driver.type = "SUM"
    variable = driver.variables.new()
    variable.type = "SINGLE_PROP" if "data_path" in target else "TRANSFORMS"
    variable.targets[0].id = leader
    for name, value in target.items():
        setattr(variable.targets[0], name, value)
    return variable


def follow(armature, leader):
    """In all ways that there are, of bones that move, of numbers that are keyed and driven, and of the place."""
    add(armature, "CHILD_OF", leader, "bone2", "bone0", set_inverse_pending=False)
    add(armature, "COPY_ROTATION", leader, "bone4", mix_mode="ADD")
    add(armature, "TRACK_TO", leader, "", "bone3", influence=0.4)
    add(armature, "COPY_TRANSFORMS", leader, "side", "side", mix_mode="BEFORE")
    drive(armature, ("location", 0), leader, data_path='pose.bones["bone1"].location[2]')
    drive(armature, ("location", 1), leader, data_path='["sum"]')
    drive(armature, ("location", 2), leader, bone_target="bone3", transform_type="LOC_X")
    drive(armature, ("scale", 0), leader, bone_target="bone3", transform_type="ROT_Y")
    add(armature, "COPY_ROTATION", leader, "bone1", "bone2", target_space="LOCAL", owner_space="LOCAL", mix_mode="ADD")
    add(armature, "COPY_LOCATION", leader, "bone3", "side", target_space="POSE", influence=0.3)
    add(armature, "COPY_SCALE", leader, "side", "bone3", target_space="LOCAL_WITH_PARENT", influence=0.5)
    add(armature, "COPY_LOCATION", leader, "bone1", "bone4", head_tail=1, influence=0.2)
    add(armature, "COPY_TRANSFORMS", leader, "side", "bone0", head_tail=0.6, target_space="POSE", influence=0.3)
    drive(armature, ("scale", 2), leader, bone_target="side", transform_type="ROT_Z", transform_space="LOCAL_SPACE")
    far = drive(armature, ("scale", 1), leader, bone_target="bone2")
    far.type, far.targets[1].id, far.targets[1].bone_target = "LOC_DIFF", armature, "bone1"


def make_leader():
    leader = make_armature()
    leader.location, leader.rotation_euler = (1, -2, 0.5), (0.3, 0.2, 1)
    for frame in (1, 5, 10):
        pose(leader, frame + 3, False)
        for bone in leader.pose.bones:
            for path in ("rotation_quaternion", "location", "scale"):
                bone.keyframe_insert(path, frame=frame)
    for number, bone in enumerate(leader.data.bones):
        bone.bbone_segments = 1 + 2 * (number % 3)
    leader["sum"] = 0.0
    driver = leader.driver_add('["sum"]').driver
    driver.type = "SUM"
    variable = driver.variables.new()
    variable.targets[0].id, variable.targets[0].data_path = leader, 'pose.bones["bone0"].location[1]'
    return leader


class Led(Cast):
    """A cast whose characters follow a rig each, which has no mesh."""

    def __init__(self, scene, depth=1):
        super().__init__(scene)
        self.leaders = []
        for armature, *_ in both(self):
            chain = [armature]
            for _ in range(depth):
                chain.append(make_leader())
                follow(chain[-2], chain[-1])
            self.leaders.append(chain[1:])
        select()
        scene.frame_set(2)
        scene.frame_set(1)
        keep_live(self)
        for leader in self.leaders[1]:
            live = recorded().learn(leader)
            live.ob.sinew_accelerates_rig, live.trial.needs_program = False, True

    @property
    def led(self):
        """The rigs that the first character follows."""
        return [recorded().learn(leader) for leader in self.leaders[0]]

    def assert_same(self):
        super().assert_same()
        for ours, theirs in zip(*self.leaders):
            assert np.array_equal(matrices_of(ours), matrices_of(theirs))

    def are_played(self):
        return all(rig.is_played for rig in (self.rig, *self.led))


def without_keyframes(led):
    """As the rig of a game, which follows the rig that is animated, and is its child."""
    for (leader,), (armature, *_) in zip(led.leaders, both(led)):
        armature.animation_data.action = None
        armature.parent = leader
    led.scene.frame_set(2)
    led.scene.frame_set(1)


@pytest.fixture(params=(False, True), ids=("keyed", "not keyed"))
def led(request, fresh_scene, monkeypatch):
    monkeypatch.setattr(accelerating(), "LEAST_WORK", 0)
    fresh_scene.frame_start, fresh_scene.frame_end = 1, 10
    led = Led(fresh_scene)
    if request.param:
        without_keyframes(led)
    return led


def test_it_is_computed_after_what_it_follows(led):
    accelerate(led)
    assert led.are_played()
    shapes = led.play([*FRAMES, 3, -7, 400, 5])
    led.scene.frame_set(4, subframe=0.5)
    led.assert_same()
    assert led.are_played() and np.ptp(shapes, axis=0).max() > 0.1
    assert len(led.rig.source.compared) > 1


def test_chains(fresh_scene, monkeypatch):
    monkeypatch.setattr(accelerating(), "LEAST_WORK", 0)
    fresh_scene.frame_start, fresh_scene.frame_end = 1, 10
    led = Led(fresh_scene, depth=3)
    accelerate(led)
    led.play()
    assert led.are_played()
    led.leaders[0][-1].pose.bones["bone2"].rotation_quaternion = (1, 0, 0.5, 0)
    led.leaders[1][-1].pose.bones["bone2"].rotation_quaternion = (1, 0, 0.5, 0)
    layer().update()
    led.assert_same()
    led.play([2, 1, 6])
    assert led.are_played()


def by_hand(leader):
    for bone in leader.pose.bones:
        bone.rotation_quaternion = Euler((0.2, 0.4, -0.3)).to_quaternion()
        bone.location.x += 0.3


def a_key(leader):
    action = leader.animation_data.action
    for curve in addon_module("blender.animation").action_curves(action) if action is not None else ():
        curve.keyframe_points[0].co.y += 0.2
        curve.keyframe_points[-1].co.y += 0.3
        curve.update()


def a_constraint(leader):
    constraint = leader.pose.bones["bone2"].constraints.new("LIMIT_ROTATION")
    constraint.use_limit_x, constraint.max_x = True, 0.1


def a_place(leader):
    leader.location.z += 1


def a_bone(leader):
    select(leader)
    bpy.ops.object.mode_set(mode="EDIT")
    for number in range(3):
        leader.data.edit_bones.new(f"a{number}").tail = (0, 0, 1)
    leader.data.edit_bones["bone3"].tail.x += 0.4
    bpy.ops.object.mode_set(mode="OBJECT")
    select()


def mute(leader):
    leader.pose.bones["bone3"].constraints.new("COPY_LOCATION").mute = True


EDITS = (by_hand, a_key, a_constraint, a_place, a_bone, mute)


def edit_and_play(led, armatures, edit, is_updated=True):
    """armatures: one of the first character or what it follows, and that of the second."""
    accelerate(led)
    led.play([3, 4])
    for armature in armatures:
        edit(armature)
    if is_updated:
        layer().update()
        led.assert_same()
    led.play([5, 4, 9, 1])
    wait(led)
    led.play()
    assert led.are_played(), led.rig.reason


@pytest.mark.parametrize("is_updated", (True, False))
@pytest.mark.parametrize("edit", EDITS)
def test_edits_of_what_it_follows(led, edit, is_updated):
    edit_and_play(led, [leader for (leader,) in led.leaders], edit, is_updated)


@pytest.mark.parametrize("edit", EDITS)
def test_edits_of_one_that_follows(led, edit):
    edit_and_play(led, [armature for armature, *_ in both(led)], edit)


def test_a_bone_that_it_follows_is_removed(led):
    """Blender does not know any more what to evaluate first."""
    accelerate(led)
    led.play([3, 4])
    for (leader,) in led.leaders:
        select(leader)
        bpy.ops.object.mode_set(mode="EDIT")
        leader.data.edit_bones.remove(leader.data.edit_bones["bone4"])
        bpy.ops.object.mode_set(mode="OBJECT")
    select()
    led.play([5, 4, 9])
    wait(led)
    assert not led.rig.is_played and "has no bone bone4: choose another one" in led.rig.reason
    led.play()


def test_posing_one_and_the_other_is_not_handed_back(led):
    accelerate(led)
    led.scene.frame_set(4)
    for chosen in (led.leaders, [[armature] for armature, *_ in both(led)], led.leaders):
        for number, (leader,) in enumerate(chosen):
            leader.pose.bones["bone1"].location.z += 0.25
            if number == 0:
                layer().update()
                assert all(rig.is_idle for rig in (led.rig, *led.led))
        layer().update()
        led.assert_same()
        led.play([5, 4])
        assert led.are_played()


def test_a_wrong_leader_is_noticed(led):
    accelerate(led)
    leader = led.led[0]
    led.scene.frame_set(4)
    moment = leader.at(4)
    bones = addon_module("host.poses").matrices_in(moment.pose)
    assert np.array_equal(bones, matrices_of(leader.ob)[:, :4])
    bones[2, 0, 3] += 0.1
    leader.motion.computed = 4, moment
    found = addon_module("played.leading").inputs(led.rig, [4])
    right = addon_module("played.leading").inputs(led.rig, [4.25])
    assert found.keys() == right.keys() and any(abs(found[name] - right[name]).max() > 0.09 for name in found)


def leave_unkeyed(led):
    for (leader,) in led.leaders:
        leader.pose.bones["bone1"].location.z += 0.2


def edit_a_key_meanwhile(led):
    """Those that lead are not looked at, only the one that follows."""
    accelerate(led)
    states().hand_back([led.rig, *led.led], led.scene, layer())
    for (leader,) in led.leaders:
        curve = addon_module("blender.animation").slot_curves(leader)[0]
        for key in curve.keyframe_points:
            key.co.y += 0.4
        curve.update()
    led.led[0].trial.tries_to_skip = 9
    led.rig.motion.last = None
    addon_module("played.changes").drop_all(led.rig)


@pytest.mark.parametrize("edit", (leave_unkeyed, edit_a_key_meanwhile))
def test_what_is_not_known_of_a_leader_is_no_fault_of_the_one_that_follows(led, caplog, edit):
    edit(led)
    layer().update()
    wait(led)
    assert not led.rig.is_played and caplog.records == []
    led.assert_same()
    led.play([2, 3])
    led.led[0].trial.tries_to_skip = 0
    accelerate(led)
    led.play()


def test_paths_of_bones(led):
    accelerate(led)
    ((points, now),) = addon_module("onion.motion_paths").around([(led.rig.ob, "bone4")], 4, 3)
    for frame, point in zip(range(1, 8), points):
        led.scene.frame_set(frame)
        bone = led.live[0].evaluated_get(layer().depsgraph).pose.bones["bone4"]
        np.testing.assert_allclose(point, led.live[0].matrix_world @ bone.head, atol=1e-5)
    assert now == 3


def test_undo(led):
    select()
    bpy.ops.ed.undo_push(message="Before")
    accelerate(led)
    led.play([3, 4])
    names = [[each.name for each in chain] for chain in led.leaders]
    for (leader,) in led.leaders:
        by_hand(leader)
    layer().update()
    bpy.ops.ed.undo_push(message="Posed")
    led.scene.frame_set(5)
    led.undo()
    led.leaders = [[bpy.data.objects[name] for name in each] for each in names]
    led.assert_same()
    led.play()
    wait(led)
    led.play()


def test_those_that_follow_each_other_stay_live(led):
    for (leader,), (armature, *_) in zip(led.leaders, both(led)):
        leader.pose.bones["side"].constraints.new("COPY_LOCATION")
        constraint = leader.pose.bones["side"].constraints[-1]
        constraint.target, constraint.subtarget = armature, "bone1"
    layer().update()
    wait(led)
    assert not led.rig.is_played and "follow each other" in led.rig.reason, led.rig.reason
    led.play()


def test_what_it_follows_cannot_be_computed(led):
    for (leader,) in led.leaders:
        leader.pose.ik_solver = "ITASC"
    wait(led)
    assert not led.rig.is_played and "follows bones of Rig.002, which is not native" in led.rig.reason
    led.play()


def test_an_armature_that_stands_still_may_be_followed(fresh_scene, monkeypatch):
    monkeypatch.setattr(accelerating(), "LEAST_WORK", 0)
    cast = Cast(fresh_scene)
    keep_live(cast)
    stands = []
    for armature, *_ in both(cast):
        stand = make_armature()
        pose_by_hand(stand, 0.5)
        add(armature, "COPY_ROTATION", stand, "bone3", mix_mode="ADD")
        stands.append(stand)
    select()
    layer().update()
    accelerate(cast)
    cast.play()
    for stand in stands:
        pose_by_hand(stand, -0.7)
    layer().update()
    cast.assert_same()
    cast.play()
    assert cast.rig.is_played


def pose_by_hand(armature, angle):
    armature.pose.bones["bone2"].rotation_mode = "XYZ"
    armature.pose.bones["bone2"].rotation_euler = (angle, 0.1, angle / 2)


def test_taking_over_both_records_nothing(led):
    select()
    states().take_over([led.rig, *led.led], led.scene, layer())
    assert led.are_played(), led.rig.reason
    led.play()
    assert led.are_played() and len(led.rig.motion.record) == 0
