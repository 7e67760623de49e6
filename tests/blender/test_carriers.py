"""Which deforming bone carries which: turning what moves a bone moves what it carries, and nothing else."""

import math

import bpy
import numpy as np
import pytest

from helpers import addon_module
from rigify_characters import HUMAN, character

CONTROLS = {  # of Rigify's human, by the deforming bone that each turns
    "DEF-spine.002": "chest",
    "DEF-spine.003": "spine_fk.003",
    "DEF-spine.004": "neck",
    "DEF-spine.006": "head",
    "DEF-shoulder.L": "shoulder.L",
    "DEF-upper_arm.L": "upper_arm_fk.L",
    "DEF-forearm.R": "forearm_fk.R",
    "DEF-hand.L": "hand_fk.L",
    "DEF-f_index.01.L": "f_index.01.L",
    "DEF-thumb.02.R": "thumb.02.R",
    "DEF-thigh.R": "thigh_fk.R",
    "DEF-shin.R": "shin_fk.R",
    "DEF-foot.L": "foot_fk.L",
}


def carried(ob):
    return {name: set(own) for name, own in addon_module("weights.carriers").carried(ob).items()}


def places(ob):
    """{deforming bone: what it does to the rest shape}, as Blender evaluates it."""
    evaluated = ob.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return {bone.name: np.array(bone.matrix_channel) for bone in evaluated.pose.bones if bone.bone.use_deform}


def moved_by(ob, control):
    """The deforming bones that move when a control is turned by 90 degrees."""
    rest, bone = places(ob), ob.pose.bones[control]
    bone.rotation_mode, bone.rotation_euler = "XYZ", (math.pi / 2, 0, 0)
    bpy.context.view_layer.update()
    now = places(ob)
    bone.rotation_euler = (0, 0, 0)
    bpy.context.view_layer.update()
    return {name for name in rest if np.abs(now[name] - rest[name]).max() > 1e-3}


def test_rigifys_bones_carry_what_their_controls_move(fresh_scene):
    ob = character(HUMAN)
    for bone in ob.pose.bones:
        if "IK_FK" in bone:
            bone["IK_FK"] = 1.0
    ob.update_tag()
    bpy.context.view_layer.update()
    own = carried(ob)
    assert len(own) == len(own["DEF-spine"]) == 160
    stretched = {"DEF-hand.L": {"DEF-forearm.L.001"}}  # towards what turns
    for name, control in CONTROLS.items():
        assert moved_by(ob, control) - stretched.get(name, set()) == own[name], name


def make(bones, deforming):
    """An armature. bones: {name: (parent, head, tail)}."""
    data = bpy.data.armatures.new("Rig")
    ob = bpy.data.objects.new("Rig", data)
    bpy.context.collection.objects.link(ob)
    bpy.context.view_layer.objects.active = ob
    bpy.ops.object.mode_set(mode="EDIT")
    for name, (parent, head, tail) in bones.items():
        bone = data.edit_bones.new(name)
        bone.head, bone.tail, bone.use_deform = head, tail, name in deforming
        bone.parent = data.edit_bones.get(parent)
    bpy.ops.object.mode_set(mode="OBJECT")
    return ob


def follow(ob, name, target, kind="COPY_TRANSFORMS", **settings):
    constraint = ob.pose.bones[name].constraints.new(kind)
    if kind == "ARMATURE":
        constraint = constraint.targets.new()
    constraint.target, constraint.subtarget = ob, target
    for setting, value in settings.items():
        setattr(constraint, setting, value)
    return constraint


UPPER, LOWER, TIP = (0, 0, 0), (0, 0, 1), (0, 0, 2)
ARM = {"upper": ("", UPPER, LOWER), "lower": ("upper", LOWER, TIP)}


@pytest.mark.parametrize("kind", ("COPY_TRANSFORMS", "COPY_ROTATION", "ARMATURE", "CHILD_OF"))
def test_through_constraints_to_the_bone_that_lies_in_the_control(kind):
    """Under a root that deforms too, which carries all."""
    bones = {"root": ("", (0, -1, 0), (0, 0, 0)), **ARM}
    bones |= {f"DEF-{name}": ("root", head, tail) for name, (_parent, head, tail) in ARM.items()}
    ob = make(bones, {"root", "DEF-upper", "DEF-lower"})
    for name in ARM:
        follow(ob, f"DEF-{name}", name, kind)
    assert carried(ob) == {
        "root": {"root", "DEF-upper", "DEF-lower"},
        "DEF-upper": {"DEF-upper", "DEF-lower"},
        "DEF-lower": {"DEF-lower"},
    }


@pytest.mark.parametrize("setting", ({"mute": True}, {"influence": 0.3}))
def test_constraints_without_effect_do_not_count(setting):
    bones = {**ARM, "DEF-upper": ("", UPPER, LOWER), "DEF-lower": ("", LOWER, TIP)}
    ob = make(bones, {"DEF-upper", "DEF-lower"})
    constraint = follow(ob, "DEF-lower", "lower")
    assert carried(ob)["DEF-upper"] == {"DEF-upper", "DEF-lower"}
    for name, value in setting.items():
        setattr(constraint, name, value)
    assert carried(ob)["DEF-upper"] == {"DEF-upper"}


def test_bones_that_follow_each_other_carry_each_other_once():
    ob = make({"a": ("", UPPER, LOWER), "b": ("", LOWER, TIP), "c": ("b", TIP, (0, 0, 3))}, {"a", "b", "c"})
    follow(ob, "a", "b")
    follow(ob, "b", "a")
    own = carried(ob)
    assert own["c"] == {"c"} and own["b"] >= {"b", "c"} and not ("a" in own["b"] and "b" in own["a"])
