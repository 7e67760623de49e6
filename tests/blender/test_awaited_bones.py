"""A bound mesh waits for every bone by which it moves, whatever moves that bone: as Blender itself orders its work."""

from random import Random

import bpy
import numpy as np
import pytest
from mathutils import Vector

from characters import accelerate, make_armature, make_mesh, make_tube
from helpers import depsgraph, evaluated, is_deforming, select, twin_of
from relations_of_blender import Relations

DRIVER = 'DRIVER(modifiers["Armature"].use_apply_on_spline)'


@pytest.fixture
def character(fresh_scene):
    armature = make_armature()
    return make_mesh(armature, False), armature


def missed(ob, armature, path):
    """The bones with weight that may still be evaluated when Sinew reads them."""
    bpy.context.view_layer.update()
    relations = Relations(depsgraph(), path / "relations.dot")
    done = relations.before((f"OB{ob.name}", "[Parameters Component]", DRIVER))
    wanted = {ob.vertex_groups[each.group].name for vertex in ob.data.vertices for each in vertex.groups if each.weight}
    found = []
    for bone in armature.data.bones:
        last = "BONE_DONE()" if bone.bbone_segments == 1 else "BONE_SEGMENTS()"
        operation = f"OB{armature.name}", f"[Bone Component] '{bone.name}'", last
        assert operation in relations.operations
        if bone.name in wanted and bone.use_deform and operation not in done:
            found.append(bone.name)
    return found


def constrain(armature, bone, kind, count=0, **settings):
    constraint = armature.pose.bones[bone].constraints.new(kind)
    constraint.chain_count = count
    for name, value in settings.items():
        setattr(constraint, name, value)
    return constraint


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
def test_chains(character, tmp_path, kind, count):
    ob, armature = character
    constrain(armature, "bone4", kind, count, target=target_of(kind))
    accelerate(ob)
    assert missed(ob, armature, tmp_path) == []


@pytest.mark.parametrize("kind", ["IK", "SPLINE_IK"])
def test_a_chain_that_ends_above_a_foot(character, tmp_path, kind):
    """The foot waits for the shin, which does not wait for the thigh."""
    ob, armature = character
    constrain(armature, "bone3", kind, 2, target=target_of(kind))
    accelerate(ob)
    assert missed(ob, armature, tmp_path) == []


@pytest.mark.parametrize("kind", ["IK", "SPLINE_IK"])
def test_a_constraint_that_is_added_and_one_that_gets_longer(character, tmp_path, kind):
    ob, armature = character
    accelerate(ob)
    assert missed(ob, armature, tmp_path) == []
    constraint = constrain(armature, "bone4", kind, 2, target=target_of(kind))
    assert missed(ob, armature, tmp_path) == []
    constraint.chain_count = 4
    assert missed(ob, armature, tmp_path) == []
    armature.pose.bones["bone4"].constraints.remove(constraint)
    assert missed(ob, armature, tmp_path) == []
    assert is_deforming(ob)


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
        constrain(armature, bone.name, kind, random.randrange(5), target=target_of(kind))
        if kind == "IK":
            bone.constraints[0].use_tail = random.random() < 0.7
    return armature


@pytest.mark.parametrize("seed", range(20))
def test_any_rig(fresh_scene, tmp_path, seed):
    random = Random(seed)
    armature = random_rig(random)
    names = [bone.name for bone in armature.data.bones]
    ob = make_tube(names)
    ob.modifiers.new("Armature", "ARMATURE").object = armature
    for group in random.sample(list(ob.vertex_groups), len(names) // 2):
        group.add([random.randrange(1200)], 0.5, "REPLACE")
    twin = twin_of(ob)
    accelerate(ob)
    assert missed(ob, armature, tmp_path) == []
    assert np.abs(evaluated(ob) - evaluated(twin)).max() < 1e-4
