"""Meshes of frozen characters take their recorded shapes: those that would be computed, to the bit, or none."""

import numpy as np
import pytest

from characters import add_shape_keys, smoothed
from helpers import addon_module, depsgraph, evaluated
from test_frozen import (
    FRAMES,
    edit_keys,
    edit_mesh,
    edit_modifier,
    edit_weights,
    freezing,
    layer,
    opened_cast,
    recorded,
)


@pytest.fixture
def cast():
    return opened_cast()


def mesh_of(cast):
    (found,) = cast.rig.shapes
    return found


def takes_its_shape(cast):
    """Whether the last evaluation has taken a recorded shape."""
    keeper = mesh_of(cast).keeper
    return keeper.known is not None and keeper.found is keeper.known


def assert_shapes_are_those_of(cast, shapes):
    """shapes: as `cast.play` returns them."""
    found = [recorded().shapes(cast.frozen[0], frame) for frame in FRAMES]
    assert [[ob for ob, *_ in each] for each in found] == [[cast.frozen[1]]] * len(FRAMES)
    for ((_ob, positions, place),), wanted in zip(found, shapes):
        assert np.array_equal(positions, wanted)
        assert not positions.flags.writeable
        assert np.array_equal(place, np.array(cast.frozen[1].matrix_world, np.float32))


def test_all_recorded_frames_have_a_shape(cast):
    shapes = _recorded(cast)
    assert_shapes_are_those_of(cast, shapes)
    assert recorded().shapes(cast.frozen[0], 11) is None
    assert recorded().shapes(cast.live[0], 1) is None


def _recorded(cast):
    cast.rig  # noqa: B018  # known from now on
    return cast.play()


@pytest.mark.parametrize("kind", ["plain", "keys", "smoothed"])
def test_a_frozen_mesh_takes_its_recorded_shape(cast, kind):
    for _, ob, other, _ in (cast.frozen, cast.live):
        if kind == "keys":
            add_shape_keys(ob)
        elif kind == "smoothed":
            for each in (ob, other):
                smoothed(each, iterations=3)
    layer().update()
    cast.freeze()
    cast.play()
    for frame in (3, 9, 1, 2):
        cast.scene.frame_set(frame)
        cast.assert_same()
        assert takes_its_shape(cast)
    assert cast.rig.is_frozen


def test_what_has_no_recorded_shape_is_computed_and_recorded(cast):
    cast.freeze()
    mesh_of(cast).record.clear()
    cast.play()
    assert mesh_of(cast).record.runs() == [(1, 10)]
    cast.play([4])
    assert takes_its_shape(cast)


def test_a_shape_of_another_pose_is_not_taken(cast):
    cast.freeze()
    record = mesh_of(cast).record
    record.put(7, record.at(2))
    cast.scene.frame_set(7)
    cast.assert_same()
    assert not takes_its_shape(cast)
    assert record.runs() == [(7, 7)]


def edit_iterations(ob):
    ob.modifiers["Smooth"].iterations = 5


def edit_key_value(ob):
    ob.data.shape_keys.animation_data_clear()
    ob.data.shape_keys.key_blocks[1].value = 0.8


def edit_place_of_mesh(ob):
    ob.parent = None
    ob.location.x += 1


def edit_method(ob):
    ob.sinew.skinning.smooth_iterations = 2


EDITS = [edit_mesh, edit_weights, edit_modifier, edit_keys, edit_iterations, edit_key_value, edit_place_of_mesh]


@pytest.mark.parametrize("edit", [*EDITS, edit_method])
@pytest.mark.parametrize("is_frozen", [True, False])
def test_an_edit_of_a_mesh_drops_its_shapes(cast, edit, is_frozen):
    for _, ob, *_ in (cast.frozen, cast.live):
        if edit is edit_iterations:
            smoothed(ob, iterations=3)
            ob.modifiers[-1].name = "Smooth"
        if edit is edit_key_value:
            add_shape_keys(ob)
    layer().update()
    cast.record()
    cast.play()
    if is_frozen:
        cast.freeze()
    cast.scene.frame_set(5)
    cast.assert_same()
    for _, ob, *_ in (cast.frozen, cast.live):
        edit(ob)
    layer().update()
    assert np.array_equal(evaluated(cast.frozen[1]), evaluated(cast.live[1]))
    cast.scene.frame_set(6)
    assert np.array_equal(evaluated(cast.frozen[1]), evaluated(cast.live[1]))
    assert {frame for run in mesh_of(cast).record.runs() for frame in range(run[0], run[1] + 1)} <= {5, 6}
    shapes = []
    for frame in FRAMES:
        cast.scene.frame_set(frame)
        shapes.append(evaluated(cast.frozen[1]).copy())
        assert np.array_equal(shapes[-1], evaluated(cast.live[1]))
    if cast.frozen[1].data.shape_keys is None or edit is not edit_keys:
        for frame, shape in zip(FRAMES, shapes):
            for _ob, positions, _place in recorded().shapes(cast.frozen[0], frame) or ():
                assert np.array_equal(positions, shape)


@pytest.mark.usefixtures("no_program")
def test_moving_a_key_drops_the_shapes_of_the_frames_that_it_changes(cast):
    cast.freeze()
    cast.scene.frame_set(2)
    for armature, *_ in (cast.frozen, cast.live):
        for curve in addon_module("blender.animation").action_curves(armature.animation_data.action):
            curve.keyframe_points[3].co.y += 1
            curve.update()
    layer().update()
    assert mesh_of(cast).record.runs() == cast.rig.record.runs()
    assert (10, 10) not in mesh_of(cast).record.runs()
    cast.play()


def test_a_mesh_that_is_gone_is_forgotten(cast):
    cast.freeze()
    used = recorded().used_memory()
    __import__("bpy").data.objects.remove(cast.frozen[1])
    cast.scene.frame_set(5)
    cast.scene.frame_set(6)
    assert list(cast.rig.shapes) == []
    assert recorded().used_memory() < used
    assert depsgraph() is not None


def test_another_view_layer_computes_its_own_shapes(cast):
    other = cast.scene.view_layers.new("Other")
    cast.freeze()
    cast.scene.frame_set(8)
    known = addon_module("run.graph_copies")
    assert known.at(cast.frozen[1].evaluated_get(depsgraph()).as_pointer()).keeper is not None
    there = known.at(cast.frozen[1].evaluated_get(other.depsgraph).as_pointer())
    assert there is None or there.keeper is None
    freezing().thaw([cast.rig], cast.scene, layer())
    cast.play()
