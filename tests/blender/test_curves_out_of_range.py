"""An F-curve whose index the property does not have, as importers leave some, sets nothing in Blender, and so it keeps
no rig of the scene from being computed. The second character of the cast stays live."""

import logging

import bpy
import pytest

from helpers import addon_module, needs_memory, needs_rig_programs
from test_accelerated_rigs import accelerate, cast_of_small_rigs, wait
from test_played import layer, states
from test_played_who import both

pytestmark = [needs_rig_programs, needs_memory]


@pytest.fixture
def cast(monkeypatch):
    return cast_of_small_rigs(monkeypatch)


def add_curve(block, path, index):
    """A curve that changes on each frame."""
    if block.animation_data is None or block.animation_data.action is None:
        block.keyframe_insert("hide_render")
    action = block.animation_data.action
    curves = action.fcurves if not hasattr(action, "layers") else action.layers[0].strips[0].channelbags[0].fcurves
    curve = curves.new(path, index=index)
    for frame in (1, 10):
        curve.keyframe_points.insert(frame, 0.3 * frame)


def of_a_place(armature):
    for path, index in (("location", 5), ("rotation_euler", 3), ("scale", 17), ("rotation_quaternion", 4)):
        add_curve(armature, path, index)


def of_bones(armature):
    for path, index in (("location", 3), ("rotation_quaternion", 4), ("scale", 99), ("bbone_scalein", 3)):
        add_curve(armature, f'pose.bones["bone2"].{path}', index)


def of_custom_properties(armature):
    armature["pair"] = [0.25, 0.5]
    armature.pose.bones["bone1"]["pair"] = [0.25, 0.5]
    add_curve(armature, '["pair"]', 2)
    add_curve(armature, 'pose.bones["bone1"]["pair"]', 7)


def of_what_is_followed(armature):
    """And moves."""
    marker = bpy.data.objects.get("Marker")
    if marker is None:
        marker = bpy.data.objects.new("Marker", None)
        bpy.context.scene.collection.objects.link(marker)
        for frame in (1, 10):
            marker.location.x = frame
            marker.keyframe_insert("location", frame=frame)
        add_curve(marker, "location", 5)
        add_curve(marker, "delta_scale", 3)
    armature.pose.bones["bone3"].constraints.new("COPY_LOCATION").target = marker


def of_strips(armature):
    of_bones(armature)
    of_a_place(armature)
    data = armature.animation_data
    slot = getattr(data, "action_slot", None)
    strip = data.nla_tracks.new().strips.new("Walk", 1, data.action)
    if slot is not None:
        strip.action_slot = slot
    data.action = None


def of_drivers(armature):
    for path, index in (('pose.bones["bone2"].location', 3), ("location", 4)):
        curve = armature.driver_add(path, 0)
        curve.driver.type = "SUM"
        variable = curve.driver.variables.new()
        variable.targets[0].id, variable.targets[0].data_path = armature, 'pose.bones["bone0"].location[0]'
        curve.array_index = index


KINDS = (of_a_place, of_bones, of_custom_properties, of_what_is_followed, of_strips, of_drivers)


@pytest.mark.parametrize("kind", KINDS)
def test_it_sets_nothing_and_nobody_suffers(cast, caplog, kind):
    for armature, *_ in both(cast):
        kind(armature)
    cast.scene.frame_set(2)
    cast.scene.frame_set(1)
    with caplog.at_level(logging.WARNING):
        accelerate(cast)
        cast.play()
        states().take_over_again(cast.scene, layer())
        wait(cast)
        cast.play([3, 8])
    assert cast.rig.is_played and len(cast.rig.source.compared) > 1
    assert not caplog.records, [each.getMessage() for each in caplog.records]


@pytest.mark.parametrize("kind", (of_a_place, of_bones, of_custom_properties, of_strips, of_drivers))
def test_a_rig_that_has_one_is_recorded_if_it_is_not_computed(cast, caplog, monkeypatch, kind):
    monkeypatch.setattr(addon_module("description.reading"), "CAN_READ", False)
    for armature, *_ in both(cast):
        kind(armature)
    with caplog.at_level(logging.WARNING):
        cast.take_over()
        cast.play()
    assert cast.rig.is_played and not caplog.records
