"""A character that can be a program needs no recording: frames that were never played are computed, and look like those
of a live one, to the bit."""

import bpy
import pytest

from helpers import addon_module, select
from test_frozen import EDITS, FRAMES, Cast, freezing, layer, recorded
from test_frozen_who import both, drive_keys

pytestmark = pytest.mark.skipif(bpy.app.version < (4, 2, 0), reason="rigs are programs from Blender 4.2 on")


def computing():
    return addon_module("frozen.computing")


@pytest.fixture
def cast(fresh_scene):
    fresh_scene.frame_start, fresh_scene.frame_end = 1, 10
    return Cast(fresh_scene)


def freeze_unplayed(cast):
    """Freezes it on one frame. Nothing is recorded before."""
    freezing().freeze([cast.rig], cast.scene, layer())
    assert cast.rig.is_frozen, cast.rig.reason
    assert len(cast.rig.record) == 1


def test_frames_that_were_never_played_are_computed(cast):
    freeze_unplayed(cast)
    cast.play([*FRAMES, 3, -7, 400])
    assert cast.rig.is_frozen
    assert cast.rig.record.runs() == [(-7, -7), (1, 10), (400, 400)]
    cast.thaw()
    cast.play()
    assert not cast.rig.is_distrusted


def test_shape_keys_that_it_drives_are_computed(cast):
    for armature, ob, *_ in both(cast):
        drive_keys(armature, ob)
    layer().update()
    freeze_unplayed(cast)
    cast.play([*FRAMES, 30])
    assert cast.rig.is_frozen
    assert len({cast.rig.record.at(frame).keys for frame in FRAMES}) > 5


def test_a_whole_range_is_computed_at_once(cast):
    played = []
    bpy.app.handlers.frame_change_pre.append(lambda scene, *_: played.append(scene.frame_current))
    try:
        select(cast.frozen[0])
        assert bpy.ops.object.sinew_record() == {"FINISHED"}
    finally:
        bpy.app.handlers.frame_change_pre.pop()
    assert played == []
    assert cast.rig.record.runs() == [(1, 10)]
    select()
    freezing().freeze([cast.rig], cast.scene, layer())
    cast.play()
    assert cast.rig.is_frozen


@pytest.mark.parametrize("edit", EDITS)
@pytest.mark.parametrize("is_updated", [False, True])
def test_an_edit_is_never_missed(cast, edit, is_updated):
    freeze_unplayed(cast)
    cast.scene.frame_set(5)
    for armature, *_ in both(cast):
        edit(armature)
    if is_updated:
        layer().update()
        cast.assert_same()
    cast.scene.frame_set(8)
    cast.assert_same()
    freezing().freeze([cast.rig], cast.scene, layer())
    cast.play()


def test_it_freezes_again_without_playing(cast):
    freeze_unplayed(cast)
    select(cast.frozen[0])
    layer().update()
    assert not cast.rig.is_frozen
    for armature, *_ in both(cast):
        armature.pose.bones["bone1"].location.x += 0.7
        armature.pose.bones["bone1"].keyframe_insert("location", frame=1)
    layer().update()
    select()
    layer().update()
    freezing().freeze_again(cast.scene, layer())
    assert cast.rig.is_frozen
    cast.play()
    assert cast.rig.is_frozen


def test_what_is_computed_otherwise_than_by_blender_is_recorded(cast):
    """On this frame or a later one: it is noticed as soon as Blender evaluates it."""
    freeze_unplayed(cast)
    moment = cast.rig.record.at(1)
    wrong = moment.pose.copy()
    wrong[-4:].view("float32")[:] += 1e-4
    cast.thaw()
    cast.rig.record.put(4, moment._replace(pose=wrong))
    cast.scene.frame_set(4)
    assert cast.rig.is_distrusted and not computing().can_be(cast.rig)
    cast.play()
    freezing().freeze([cast.rig], cast.scene, layer())
    cast.play()
    assert cast.rig.is_frozen
    cast.scene.frame_set(20)
    assert not cast.rig.is_frozen
    cast.assert_same()


def test_a_program_that_does_not_compute_this_frame_is_not_used(cast, monkeypatch):
    monkeypatch.setattr(computing().rigs, "shows", lambda *_: False)
    freezing().freeze([cast.rig], cast.scene, layer())
    monkeypatch.undo()
    assert not cast.rig.is_frozen and "is not recorded" in cast.rig.reason
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
    [(follow_a_moving_object, "follows Target"), (use_a_constraint_that_is_not_covered, "SHRINKWRAP is not covered")],
)
def test_what_cannot_be_a_program_is_recorded(cast, change, reason):
    for armature, *_ in both(cast):
        change(armature)
    layer().update()
    freezing().freeze([cast.rig], cast.scene, layer())
    assert not cast.rig.is_frozen
    assert reason in cast.rig.source.refusal
    cast.play()
    freezing().freeze([cast.rig], cast.scene, layer())
    cast.play()
    assert cast.rig.is_frozen


def test_an_unkeyed_pose_is_not_lost(cast):
    for armature, *_ in both(cast):
        armature.pose.bones["bone1"].location.x += 2
    layer().update()
    freezing().freeze([cast.rig], cast.scene, layer())
    assert not cast.rig.is_frozen and "not keyed" in cast.rig.reason
    cast.assert_same()
    cast.scene.frame_set(2)
    freezing().freeze([cast.rig], cast.scene, layer())
    cast.play()
    assert cast.rig.is_frozen


def test_frames_that_are_mapped_to_other_times_are_played(cast):
    cast.scene.render.frame_map_new = 50
    freezing().freeze([cast.rig], cast.scene, layer())
    assert not cast.rig.is_frozen and "maps its frames" in cast.rig.source.refusal
    cast.play()
    cast.scene.render.frame_map_new = 100
    cast.play()
    freezing().freeze([cast.rig], cast.scene, layer())
    cast.play()
    assert cast.rig.is_frozen


def test_undo_and_redo(cast):
    bpy.ops.ed.undo_push(message="before")
    freeze_unplayed(cast)
    for armature, *_ in both(cast):
        armature.pose.bones["bone1"].location.x += 2
        armature.pose.bones["bone1"].keyframe_insert("location", frame=5)
    layer().update()
    bpy.ops.ed.undo_push(message="edited")
    cast.undo()
    cast.play()
    freezing().freeze([cast.rig], cast.scene, layer())
    cast.play([2, 30, 5])
    assert cast.rig.is_frozen


def test_the_states_of_several(cast):
    rigs = [recorded().learn(armature) for armature, *_ in both(cast)]
    freezing().freeze(rigs, cast.scene, layer())
    assert all(rig.is_frozen for rig in rigs)
    computed = cast.play([3, 4])
    freezing().thaw(rigs, cast.scene, layer())
    assert (cast.play([3, 4]) == computed).all()
