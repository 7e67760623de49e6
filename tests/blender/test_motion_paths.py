"""Motion paths of rigs that are computed: nothing is played for them, and they are where Blender puts the bones."""

import bpy
import numpy as np
import pytest

from helpers import addon_module, needs_memory, needs_rig_programs, select
from test_accelerated_rigs import accelerate, cast, wait  # noqa: F401
from test_played import EDITS, edit_rest, layer, recorded
from test_played_who import both

pytestmark = [needs_rig_programs, needs_memory]
NAMES = ("bone0", "bone2")


def paths(armature, frame, count=3):
    return addon_module("onion.motion_paths").around([(armature, name) for name in NAMES], frame, count)


def heads(armature, frames):
    """Where Blender puts them."""
    found = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        posed = armature.evaluated_get(layer().depsgraph)
        found.append([posed.matrix_world @ posed.pose.bones[name].head for name in NAMES])
    return np.swapaxes(np.array(found), 0, 1)


@pytest.fixture
def settings():
    found = addon_module("main.addon_preferences").of_sinew().onion
    yield found
    for name in ("shows_paths", "path_frames"):
        found.property_unset(name)


@pytest.mark.parametrize("edit", [None, *EDITS])
def test_they_are_where_the_bones_go(cast, edit):  # noqa: F811
    cast.played[0].location, cast.live[0].location = (1, 2, 3), (1, 2, 3)
    accelerate(cast)
    assert len(paths(cast.played[0], 4)) == 2
    if edit is not None:
        for armature, *_ in both(cast):
            edit(armature)
        layer().update()
        wait(cast)
    found = paths(cast.played[0], 4)
    is_live = cast.rig.source.program is None or not cast.rig.is_idle
    assert is_live == (edit is edit_rest)  # which keeps it so
    if is_live:
        assert found == []
        return
    wanted = heads(cast.live[0], range(1, 8))
    assert [path.now for path in found] == [3, 3]
    np.testing.assert_allclose([path.points for path in found], wanted, atol=1e-5)
    assert np.ptp(wanted, axis=1).max() > 0.1
    cast.assert_same()


def test_each_frame_is_computed_once(cast, monkeypatch):  # noqa: F811
    accelerate(cast)
    module, known = addon_module("onion.motion_paths"), cast.rig.source.heads
    paths(cast.played[0], 4)
    assert sorted(known) == list(range(1, 8))
    before = known[4]
    paths(cast.played[0], 5)
    assert sorted(known) == list(range(1, 9)) and known[4] is before
    monkeypatch.setattr(module, "MOST_KEPT", 10)
    paths(cast.played[0], 40)
    assert sorted(known) == list(range(37, 44))


def test_rigs_that_are_not_computed_have_none(cast):  # noqa: F811
    assert paths(cast.played[0], 4) == [] == paths(cast.live[0], 4)
    accelerate(cast)
    assert paths(cast.live[0], 4) == []
    assert addon_module("onion.motion_paths").around([(cast.played[0], "no bone")], 4, 3) == []
    bpy.ops.object.select_all(action="DESELECT")
    select(cast.played[0])
    assert bpy.ops.object.sinew_leave_to_blender() == {"FINISHED"}
    assert paths(cast.played[0], 4) == [] and recorded().get(cast.played[0]) is cast.rig


def test_what_a_view_shows(cast, settings):  # noqa: F811
    accelerate(cast)
    shown = addon_module("onion.motion_paths").shown
    select(cast.played[0])
    settings.path_frames = 5
    assert shown(bpy.context) == []
    settings.shows_paths = True
    assert shown(bpy.context) == []
    bpy.ops.object.mode_set(mode="POSE")
    bpy.ops.pose.select_all(action="SELECT")
    wait(cast)
    found = shown(bpy.context)
    assert len(found) == len(cast.played[0].pose.bones) and len(found[0].points) == 11
    bpy.ops.object.mode_set(mode="OBJECT")
    assert shown(bpy.context) == []
