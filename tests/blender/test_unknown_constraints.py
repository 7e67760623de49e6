"""Constraints of types that this Blender does not know, as files of newer and older versions have: it evaluates none,
and its API shows nothing of them."""

import ctypes

import bpy
import pytest

from helpers import address_of, needs_memory, needs_rig_programs
from test_accelerated_rigs import accelerating, keep_live, wait
from test_played import Cast, layer, states
from test_played_who import both

TYPE = 200


def become_unknown(constraint):
    ctypes.c_int16.from_address(address_of(constraint, "bConstraint", "type")).value = TYPE


def of_a_bone(armature):
    return armature.pose.bones["bone3"].constraints.new("COPY_ROTATION")


def of_the_object(armature):
    return armature.constraints.new("COPY_ROTATION")


@pytest.fixture(params=(of_a_bone, of_the_object), ids=lambda add: add.__name__)
def cast(fresh_scene, monkeypatch, request):
    monkeypatch.setattr(accelerating(), "LEAST_WORK", 0)
    fresh_scene.frame_end = 10
    made = Cast(fresh_scene)
    keep_live(made)
    for armature, *_ in both(made):
        become_unknown(request.param(armature))
        armature.update_tag()
    bpy.context.view_layer.update()
    return made


@needs_memory
@needs_rig_programs
def test_it_plays_and_is_accelerated(cast):
    cast.play()
    wait(cast)
    cast.play()
    assert cast.rig.is_played, cast.rig.reason


def test_it_can_be_played(cast):
    states().take_over([cast.rig], cast.scene, layer())
    cast.play()


def test_a_rig_is_exported(cast, tmp_path, sinew):
    path = str(tmp_path / "file.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    code, out, err = sinew("rig", path, "--object", cast.played[0].name, "-o", tmp_path / "rig.json")
    assert code == 0, out + err
