"""Played characters in scenes that are more than one action and one view layer: each graph has its own state."""

import bpy
import numpy as np
import pytest

from helpers import addon_module, evaluated, needs_memory, select
from test_played import layer, matrices_of, opened_cast, recorded, states

pytestmark = needs_memory


@pytest.fixture
def cast():
    return opened_cast(last=10)


def assert_same_in(graph, cast):
    assert np.array_equal(evaluated(cast.played[1], graph), evaluated(cast.live[1], graph))
    assert np.array_equal(evaluated(cast.played[2], graph), evaluated(cast.live[2], graph))
    ours, theirs = (each[3].evaluated_get(graph).matrix_world for each in (cast.played, cast.live))
    assert ours == theirs


def has_action(cast, graph):
    """Whether a graph evaluates the character's keyframes."""
    return cast.played[0].evaluated_get(graph).animation_data.action is not None


# --- several view layers --------------------------------------------------------------------------


def test_several_view_layers_are_live_beside_the_one_where_it_is_played(cast):
    others = [cast.scene.view_layers.new(name) for name in ("Second", "Third")]
    cast.take_over()
    for frame in (3, 8, 5):
        cast.scene.frame_set(frame)
        cast.assert_same()
        assert cast.rig.is_played
        assert not has_action(cast, layer().depsgraph)
        for each in others:
            assert has_action(cast, each.depsgraph)
            assert_same_in(each.depsgraph, cast)


def test_an_edit_shows_in_all_view_layers(cast):
    other = cast.scene.view_layers.new("Second")
    cast.take_over()
    cast.scene.frame_set(6)
    for armature, *_ in (cast.played, cast.live):
        armature.pose.bones["bone1"].constraints.new("LIMIT_SCALE").use_max_x = True
    for each in (layer(), other):
        each.update()
        assert_same_in(each.depsgraph, cast)
    assert not cast.rig.is_played


def test_removing_the_view_layer_in_which_it_is_played(cast):
    other = cast.scene.view_layers.new("Second")
    first = layer()
    if bpy.context.window is None:
        pytest.skip("no window whose view layer could be changed")
    bpy.context.window.view_layer = other
    recorded().learn(cast.played[0])
    for frame in (1, 2, 3):
        cast.scene.frame_set(frame)
    states().take_over([cast.rig], cast.scene, other)
    assert cast.rig.is_played
    bpy.context.window.view_layer = first
    cast.scene.view_layers.remove(other)
    for frame in (2, 3, 1):
        cast.scene.frame_set(frame)
        assert_same_in(first.depsgraph, cast)
    states().take_over([cast.rig], cast.scene, first)
    assert cast.rig.is_played
    cast.play([2, 3, 1])


# --- several scenes -------------------------------------------------------------------------------


def second_scene(cast):
    """Another scene with the same objects, which plays them 4 frames later."""
    other = bpy.data.scenes.new("Other")
    for each in (*cast.played, *cast.live):
        other.collection.objects.link(each)
    return other


def test_another_scene_with_the_same_character_is_live(cast):
    other = second_scene(cast)
    cast.take_over()
    for frame in (3, 8):
        cast.scene.frame_set(frame)
        other.frame_set(frame + 1)
        graph = other.view_layers[0].depsgraph
        assert has_action(cast, graph)
        assert_same_in(graph, cast)
        cast.assert_same()
    cast.scene.frame_set(5)
    cast.assert_same()


def test_a_record_is_not_another_scenes(cast):
    """Each scene may map its frames to other times."""
    other = second_scene(cast)
    other.render.frame_map_old, other.render.frame_map_new = 100, 50
    cast.take_over()
    other.frame_set(6)
    graph = other.view_layers[0].depsgraph
    assert_same_in(graph, cast)
    cast.scene.frame_set(6)
    cast.assert_same()
    cast.play()
    other.frame_set(4)
    assert_same_in(graph, cast)


# --- NLA, slots -----------------------------------------------------------------------------------


def into_strips(armature):
    """Puts an armature's action into two NLA strips that blend, one of them with an animated influence."""
    data = armature.animation_data
    action, slot = data.action, getattr(data, "action_slot", None)
    data.action = None
    for name, start, how in (("Base", 1, "REPLACE"), ("Above", 3, "COMBINE")):
        strip = data.nla_tracks.new().strips.new(name, start, action)
        if slot is not None:
            strip.action_slot = slot
        strip.blend_type = how
    strip.scale = 0.5
    strip.use_animated_influence = True
    for frame, value in ((3, 0.0), (9, 1.0)):
        strip.influence = value
        strip.keyframe_insert("influence", frame=frame)


def test_nla_strips(cast):
    for armature, *_ in (cast.played, cast.live):
        into_strips(armature)
    layer().update()
    cast.take_over()
    shapes = cast.play([*range(1, 11), 4, 8])
    assert cast.rig.is_played
    assert np.ptp(shapes, axis=0).max() > 0.1
    for armature, *_ in (cast.played, cast.live):
        armature.animation_data.nla_tracks[1].strips[0].frame_start = 4
    layer().update()
    cast.play()
    cast.take_over()
    for armature, *_ in (cast.played, cast.live):
        armature.animation_data.nla_tracks[1].mute = True
    cast.play()


def test_an_edit_of_a_strips_keyframes(cast):
    for armature, *_ in (cast.played, cast.live):
        into_strips(armature)
    layer().update()
    cast.take_over()
    for armature, *_ in (cast.played, cast.live):
        action = armature.animation_data.nla_tracks[0].strips[0].action
        curves = addon_module("blender.animation").action_curves(action)
        for curve in curves[:5]:
            curve.keyframe_points[1].co.y += 0.4
            curve.update()
    layer().update()
    cast.play()


@pytest.mark.skipif(bpy.app.version < (4, 4, 0), reason="actions have slots since Blender 4.4")
def test_two_slots_of_one_action(cast):
    """Both characters play the same action, each by its slot; one of them is played, and slots are exchanged."""
    action = cast.played[0].animation_data.action
    other = action.slots.new(id_type="OBJECT", name="Other")
    strip = action.layers[0].strips[0]
    bag = strip.channelbag(other, ensure=True)
    for curve in strip.channelbag(cast.played[0].animation_data.action_slot).fcurves:
        copy = bag.fcurves.new(curve.data_path, index=curve.array_index)
        for point in curve.keyframe_points:
            copy.keyframe_points.insert(point.co.x, 0.5 * point.co.y)
    cast.take_over()
    cast.play()
    for armature, *_ in (cast.played, cast.live):
        armature.animation_data.action = action
        armature.animation_data.action_slot = other
    layer().update()
    cast.assert_same()
    cast.play()
    cast.take_over()
    shapes = cast.play()
    assert cast.rig.is_played
    assert np.ptp(shapes, axis=0).max() > 0.1
    bag.fcurves[0].keyframe_points[1].co.y += 0.3
    bag.fcurves[0].update()
    layer().update()
    cast.play()


# --- B-bones --------------------------------------------------------------------------------------


def test_the_segments_of_bendy_bones(cast):
    """Their ends are animated, and a mesh follows the segments."""
    for armature, *_ in (cast.played, cast.live):
        for name in ("bone1", "bone3"):
            bone = armature.pose.bones[name]
            for frame, value in ((1, -0.4), (6, 0.7), (10, 0.1)):
                bone.bbone_curveinx, bone.bbone_easeout, bone.bbone_rollout = value, 1 + value, value
                for path in ("bbone_curveinx", "bbone_easeout", "bbone_rollout"):
                    bone.keyframe_insert(path, frame=frame)
    select()
    layer().update()
    cast.take_over()
    cast.play([*range(1, 11), 2, 9])
    assert cast.rig.is_played
    bones = [each[0].evaluated_get(layer().depsgraph).pose.bones["bone1"] for each in (cast.played, cast.live)]
    for number in range(bones[0].bone.bbone_segments + 1):
        ours, theirs = (bone.bbone_segment_matrix(number) for bone in bones)
        assert ours == theirs
    assert np.array_equal(*(matrices_of(each[0]) for each in (cast.played, cast.live)))
