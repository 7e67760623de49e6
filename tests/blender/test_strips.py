"""Rigs that NLA strips animate are computed: alone with the bits of Blender, and accelerated beside live ones."""

from random import Random

import bpy
import numpy as np
import pytest

import random_strips
from helpers import addon_module, needs_memory, needs_rig_programs, select
from test_accelerated_rigs import accelerate, cast, wait
from test_played import layer
from test_played_computed import move, undo_a_pose
from test_played_scenes import into_strips
from test_played_who import both
from test_rigs_as_programs import armature, differences, refusal

assert cast and armature  # fixtures

pytestmark = needs_rig_programs
PORTION = 15


# --- alone ----------------------------------------------------------------------------------------


def furnish(ob):
    """Gives it what strips may set besides bones, and something that follows from that."""
    ob["part"], ob["whole"], ob.pose.bones["b"]["switch"] = 0.5, 1, True
    ob.id_properties_ui("part").update(min=-2, max=2, default=0.25)
    ob.pose.bones["c"].rotation_mode = "XZY"
    driver = ob.pose.bones["a"].driver_add("scale", 0).driver
    variable = driver.variables.new()
    variable.name, variable.targets[0].id, variable.targets[0].data_path = "part", ob, '["part"]'
    driver.expression = "1 + 0.3 * part"


@pytest.mark.parametrize("first", range(0, 60, PORTION))
def test_random_strips(armature, first):
    furnish(armature)
    kinds = set()
    for seed in range(first, first + PORTION):
        armature.animation_data.action = None
        for track in list(armature.animation_data.nla_tracks):
            armature.animation_data.nla_tracks.remove(track)
        random = Random(seed)
        random_strips.animate(armature, random)
        strips = random_strips.strips_of(armature)
        kinds |= {strip.type for strip in strips}
        ends = [frame for strip in strips for frame in (strip.frame_start, strip.frame_end)]
        times = [*ends[:6], *(random.uniform(-20, 80) for _ in range(8)), *(random.randint(-20, 80) for _ in range(8))]
        assert not differences(armature, times), f"seed {seed}"
    assert kinds == {"CLIP", "TRANSITION", "META"}


def push_down(ob, start=1):
    data = ob.animation_data
    action, slot = data.action, getattr(data, "action_slot", None)
    data.action = None
    strip = data.nla_tracks.new().strips.new("Strip", start, action)
    if slot is not None:
        strip.action_slot = slot
    return strip


def key_place(ob):
    ob.location.x = 1
    ob.keyframe_insert("location", frame=1)
    push_down(ob).blend_in = 5
    return "Rig itself moves (its Location is animated)"


def add_modifier(ob):
    push_down(ob).select = True
    with random_strips.in_nla_editor(ob):
        bpy.ops.nla.fmodifier_add(type="STEPPED", only_active=False)
    return "has modifiers: remove them"


def tweak(ob):
    push_down(ob).select = True
    ob.animation_data.nla_tracks[0].select = True
    ob.animation_data.use_tweak_mode = True
    return "an NLA strip of Rig is being edited" if ob.animation_data.use_tweak_mode else None


def end_below(ob):
    data = ob.animation_data
    action, slot = data.action, getattr(data, "action_slot", None)
    push_down(ob)
    data.action = action
    if slot is not None:
        data.action_slot = slot
    data.action_extrapolation = "NOTHING"
    addon_module("blender.animation").slot_curves(ob)[0].modifiers.new("CYCLES")
    return "which ends below other strips, have modifiers"


def strips_of_data(ob):
    bone = ob.data.bones["a"]
    bone.keyframe_insert("bbone_curveinx", frame=1)
    push_down(ob.data)
    return "Rig is animated by NLA strips"


@pytest.mark.parametrize("prepare", (key_place, add_modifier, tweak, end_below, strips_of_data))
def test_what_is_refused(armature, prepare):
    clause = prepare(armature)
    if clause is None:
        pytest.skip("Blender does not edit a strip here")
    assert clause in refusal(armature)


def test_a_place_that_is_keyed_where_it_is(armature):
    for name in ("location", "rotation_quaternion", "rotation_euler", "scale"):
        armature.keyframe_insert(name, frame=1)
    strip = push_down(armature)
    assert not differences(armature)
    strip.blend_in = 3  # rounding may scale it
    assert "itself moves" in refusal(armature)


def test_tracks_that_do_not_count(armature):
    push_down(armature).mute = True
    assert not differences(armature)
    armature.animation_data.nla_tracks[0].mute = True
    assert not differences(armature)
    armature.animation_data.use_nla = False
    assert not differences(armature)


# --- accelerated ----------------------------------------------------------------------------------


@pytest.fixture
def strips(cast):
    for ob, *_ in both(cast):
        into_strips(ob)
    layer().update()
    return cast


def strip_of(armature, number=1):
    return armature.animation_data.nla_tracks[number].strips[0]


@needs_memory
def test_it_plays_as_a_live_one(strips):
    accelerate(strips)
    shapes = strips.play([*range(1, 11), 4, 8, -5, 30])
    strips.scene.frame_set(4, subframe=0.25)
    strips.assert_same()
    assert strips.rig.is_played and len(strips.rig.source.compared) > 3
    assert np.ptp(shapes, axis=0).max() > 0.1


def move_strip(armature):
    strip_of(armature).frame_start = 4


def blend(armature):
    strip_of(armature).blend_type = "ADD"


def mute_strip(armature):
    strip_of(armature).mute = True


def mute_track(armature):
    armature.animation_data.nla_tracks[1].mute = True


def play_alone(armature):
    armature.animation_data.nla_tracks[1].is_solo = True


def add_strip(armature):
    below = strip_of(armature, 0)
    strip = armature.animation_data.nla_tracks.new().strips.new("Third", 6, below.action)
    if hasattr(below, "action_slot"):
        strip.action_slot = below.action_slot
    strip.extrapolation = "NOTHING"


def remove_track(armature):
    armature.animation_data.nla_tracks.remove(armature.animation_data.nla_tracks[1])


def edit_key(armature):
    for curve in addon_module("blender.animation").action_curves(strip_of(armature).action)[:5]:
        curve.keyframe_points[1].co.y += 0.4
        curve.update()


def edit_influence(armature):
    curve = strip_of(armature).fcurves[0]
    curve.keyframe_points[1].co.y = 0.3
    curve.update()


def without_nla(armature):
    armature.animation_data.use_nla = False


def with_action(armature):
    below, data = strip_of(armature, 0), armature.animation_data
    data.action = below.action.copy()
    if hasattr(below, "action_slot"):
        data.action_slot = data.action.slots[0]
    data.action_blend_type, data.action_influence = "ADD", 0.5


EDITS = (
    *(move_strip, blend, mute_strip, mute_track, play_alone, add_strip, remove_track),
    *(edit_key, edit_influence, without_nla, with_action),
)


@needs_memory
@pytest.mark.parametrize("is_updated", (True, False))
@pytest.mark.parametrize("edit", EDITS)
def test_an_edit_is_seen(strips, edit, is_updated):
    accelerate(strips)
    strips.play([6, 7])
    for ob, *_ in both(strips):
        edit(ob)
    if is_updated:
        layer().update()
        strips.assert_same()
    strips.play([7, 3, 9])
    accelerate(strips)
    strips.play([2, 8, 5])
    assert strips.rig.is_played


@needs_memory
def test_it_is_posed_and_not_built_again(strips, monkeypatch):
    accelerate(strips)
    strips.scene.frame_set(4)
    select(strips.played[0])
    computing, built = addon_module("played.computing"), []
    read = computing.read
    monkeypatch.setattr(computing, "read", lambda *arguments: built.append(read(*arguments)))
    for distance in (0.5, 0.2, -1.7):
        move(strips, distance)
        strips.assert_same()
        assert strips.rig.is_idle
    strips.play([5, 4, 9])
    assert strips.rig.is_played and not built


@needs_memory
@pytest.mark.parametrize("follows", (False, True))
def test_what_is_not_keyed_is_kept(strips, follows):
    """While it is read and compared, and it is not taken for a wrong program. follows: an object with keyframes."""
    if follows:
        strips.follow_keyed_object("bone3")
    strips.scene.frame_set(4)
    move(strips, 0.5)
    before = strips.rig.ob.pose.bones["bone1"].location.copy()
    wait(strips)
    assert strips.rig.ob.pose.bones["bone1"].location == before
    assert strips.rig.trust.difference is None and not strips.rig.is_played
    assert 'changes that are not keyed (bone "bone1")' in strips.rig.reason
    strips.play([5, 6])
    accelerate(strips)
    strips.play([3, 4])


@needs_memory
def test_undo(strips):
    accelerate(strips)
    strips.play([3, 4])
    undo_a_pose(strips)
    strips.play([5, 4])
    wait(strips)
    strips.play([7, 2])


@needs_memory
def test_the_file_has_all_strips(strips, tmp_path):
    accelerate(strips)
    strips.play([3])
    path = str(tmp_path / "strips.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    name = strips.rig.ob.name
    with bpy.data.libraries.load(path) as (_source, target):
        target.objects = [name]
    data = target.objects[0].animation_data
    assert [len(track.strips) for track in data.nla_tracks] == [1, 1] and data.nla_tracks[1].strips[0].action
