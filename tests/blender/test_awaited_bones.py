"""A bound mesh waits for every bone by which it moves, whatever moves that bone: as Blender itself orders its work."""

from random import Random

import bpy
import numpy as np
import pytest
from mathutils import Vector

from characters import accelerate, constrain, make_armature, make_mesh, make_tube
from helpers import addon_module, depsgraph, evaluated, into_a_shot, is_deforming, needs_memory, select, twin_of
from relations_of_blender import bones_not_awaited


@pytest.fixture
def character(fresh_scene):
    armature = make_armature()
    return make_mesh(armature, False), armature


def missed():
    """After an evaluation. Whoever edits gets one in which Blender's handlers run, and another."""
    bpy.context.view_layer.update()
    bpy.context.view_layer.update()
    return bones_not_awaited(depsgraph())


def target_of(kind):
    data = bpy.data.curves.new("Rail", "CURVE") if kind == "SPLINE_IK" else None
    target = bpy.data.objects.new("Target", data)
    bpy.context.collection.objects.link(target)
    if data is not None:
        data.dimensions = "3D"
        data.splines.new("POLY").points.add(3)
        for number, point in enumerate(data.splines[0].points):
            point.co = (0, 0.2 * number, 2 * number, 1)
    return target


@pytest.mark.parametrize("kind", ["IK", "SPLINE_IK"])
@pytest.mark.parametrize("count", [0, 2, 3])
def test_chains(character, kind, count):
    ob, armature = character
    constrain(armature, "bone4", kind, chain_count=count, target=target_of(kind))
    accelerate(ob)
    assert missed() == []


@pytest.mark.parametrize("kind", ["IK", "SPLINE_IK"])
def test_a_chain_that_ends_above_a_foot(character, kind):
    """The foot waits for the shin, which does not wait for the thigh."""
    ob, armature = character
    constrain(armature, "bone3", kind, chain_count=2, target=target_of(kind))
    accelerate(ob)
    assert missed() == []


@pytest.mark.parametrize("kind", ["IK", "SPLINE_IK"])
def test_a_constraint_that_is_added_and_one_that_gets_longer(character, kind):
    ob, armature = character
    accelerate(ob)
    assert missed() == []
    constraint = constrain(armature, "bone4", kind, chain_count=2, target=target_of(kind))
    assert missed() == []
    constraint.chain_count = 4
    assert missed() == []
    armature.pose.bones["bone4"].constraints.remove(constraint)
    assert missed() == []
    assert is_deforming(ob)


@needs_memory
def test_what_is_missed_would_be_noticed(character, monkeypatch):
    ob, armature = character
    constrain(armature, "bone4", "IK", chain_count=3, target=target_of("IK"))
    monkeypatch.setattr(addon_module("plan.wiring"), "SOLVERS", set())
    accelerate(ob)
    assert missed() == [(ob.name, "bone2"), (ob.name, "bone3")]


@pytest.mark.parametrize("overridden", (False, True))
def test_a_library_that_was_saved_when_bones_were_missed(character, tmp_path, monkeypatch, overridden):
    ob, armature = character
    constrain(armature, "bone4", "IK", chain_count=3, target=target_of("IK"))
    collection = bpy.data.collections.new("Character")
    bpy.context.scene.collection.children.link(collection)
    for each in ob, armature, twin_of(ob):
        collection.objects.link(each)
    with monkeypatch.context() as before:
        before.setattr(addon_module("plan.wiring"), "SOLVERS", set())
        accelerate(ob)
        scene = into_a_shot(tmp_path, overridden)
    scene.frame_set(2)
    ob, twin = (next(each for each in scene.objects if each.name == name) for name in ("Tube", "Tube.001"))
    assert np.abs(evaluated(ob) - evaluated(twin)).max() < 1e-5
    assert missed() == [] and is_deforming(ob) == overridden
    if not overridden:
        assert "open the library once, and save it" in addon_module("run.characters").character(ob).way.reason
    updates = []
    bpy.app.handlers.depsgraph_update_post.append(lambda *_: updates.append(1))
    for _ in range(2):
        updates.clear()
        addon_module("main.handlers").look_into_the_mail()
        bpy.context.view_layer.update()
    assert not updates  # nothing is tried again and again


def random_rig(random):
    """A tree of bones, some of which deform, some bend, and some are moved by solvers."""
    armature = make_armature()
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    bones = list(armature.data.edit_bones)
    for number in range(random.randrange(20)):
        bone = armature.data.edit_bones.new(f"more{number}")
        parent = random.choice(bones)
        bone.head, bone.parent = parent.tail, random.choice((parent, parent, None))
        bone.tail = bone.head + Vector((random.uniform(-1, 1), random.uniform(-1, 1), 0.5))
        bones.append(bone)
    bpy.ops.object.mode_set(mode="OBJECT")
    for bone in armature.data.bones:
        bone.use_deform = random.random() < 0.8
        bone.bbone_segments = random.choice((1, 1, 1, 4))
    for bone in random.sample(list(armature.pose.bones), 4):
        kind = random.choice(("IK", "IK", "SPLINE_IK"))
        constrain(armature, bone.name, kind, chain_count=random.randrange(5), target=target_of(kind))
        if kind == "IK":
            bone.constraints[0].use_tail = random.random() < 0.7
    return armature


@pytest.mark.parametrize("seed", range(20))
def test_any_rig(fresh_scene, seed):
    random = Random(seed)
    armature = random_rig(random)
    names = [bone.name for bone in armature.data.bones]
    ob = make_tube(names)
    ob.modifiers.new("Armature", "ARMATURE").object = armature
    for group in random.sample(list(ob.vertex_groups), len(names) // 2):
        group.add([random.randrange(1200)], 0.5, "REPLACE")
    twin = twin_of(ob)
    accelerate(ob)
    assert missed() == []
    assert np.abs(evaluated(ob) - evaluated(twin)).max() < 1e-4
