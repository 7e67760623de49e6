"""Taking over and handing back at random. As long as any armature is played, all is compared after each step with what
Blender shows as soon as it evaluates everything again."""

from collections import Counter

import bpy
import numpy as np

from helpers import addon_module, depsgraph, evaluated

from . import compare, scene
from .kinds import kind

looked_at: Counter[str] = Counter()  # rigs, while nothing was done
began: Counter[str] = Counter()  # steps


def states():
    return addon_module("played.states")


def recorded():
    return addon_module("played.rigs")


@kind(3)
def take_over(random):
    scene.leave_modes()
    chosen = [each for each in scene.armatures() if random.random() < 0.7]
    rigs = [recorded().learn(each) for each in chosen if each.animation_data]
    first = random.randint(1, scene.LAST_FRAME - 5)
    for frame in range(first, random.randint(first, scene.LAST_FRAME) + 1):
        bpy.context.scene.frame_set(frame)
    states().take_over(rigs, bpy.context.scene, bpy.context.view_layer)
    return [(rig.name, rig.is_played, rig.reason) for rig in rigs]


@kind(2)
def hand_back(random):
    rigs = [rig for rig in recorded().known() if random.random() < 0.6]
    states().hand_back(rigs, bpy.context.scene, bpy.context.view_layer)


@kind(2)
def take_over_again(_random):
    states().take_over_again(bpy.context.scene, bpy.context.view_layer)


@kind(2)
def do_nothing(_random):
    return wait()


@kind(1)
def compare_more(_random):
    addon_module("played.accelerating").compare_more(bpy.context.scene, bpy.context.view_layer)


def count_step():
    began["all"] += 1
    began["with an accelerated rig"] += any(rig.is_idle and rig.trial.needs_program for rig in recorded().known())


def wait():
    """As long as it takes until rigs are accelerated."""
    accelerating = addon_module("played.accelerating")
    accelerating.LEAST_WORK, accelerating.MOST_TO_SKIP = 0, 1
    states().take_over_again(bpy.context.scene, bpy.context.view_layer)
    number = addon_module("played.playing").evaluation_count()
    while accelerating.step(bpy.context.scene, bpy.context.view_layer, number):
        pass
    own = [rig for rig in recorded().known() if rig.trial.needs_program]
    looked_at.update("accelerated" if rig.is_played else "left to Blender" for rig in own)
    looked_at["following another"] += sum(rig.is_played and len(rig.source.leaders) > 0 for rig in own)
    looked_at["following an object"] += sum(rig.is_played and len(rig.source.moving) > 0 for rig in own)
    return [(rig.name, rig.state.name, rig.reason) for rig in own]


@kind(2)
def move_a_key(random):
    armature = random.choice(scene.armatures() or [None])
    data = armature.animation_data if armature else None
    if data is None or data.action is None:
        return None
    curves = addon_module("blender.animation").action_curves(data.action)
    curve = random.choice(curves) if curves else None
    if curve is None or not len(curve.keyframe_points):
        return None
    curve.keyframe_points[random.randrange(len(curve.keyframe_points))].co.y += random.uniform(-0.5, 0.5)
    curve.update()
    return armature.name


def shown():
    """All shapes that modifiers make, and where the bones of all armatures are. Other shapes have keys alone, of which
    Blender shows what another scene's evaluation has left as soon as they are tagged."""
    objects = [ob for ob in bpy.context.view_layer.objects if ob.visible_get()]
    shapes = {ob.name: evaluated(ob).copy() for ob in objects if ob.type == "MESH" and ob.modifiers}
    for ob in objects:
        if ob.type == "ARMATURE":
            bones = ob.evaluated_get(depsgraph()).pose.bones
            shapes[ob.name] = np.array([matrix for bone in bones for matrix in bone.matrix])
    return shapes


def assert_played_as_live():
    """Has Blender evaluate everything again, and compares."""
    rigs = recorded().played()
    if not rigs:
        return
    before = shown()
    states().hand_back(rigs, bpy.context.scene, bpy.context.view_layer)
    for ob in bpy.context.view_layer.objects:
        ob.update_tag()
    after = shown()
    assert before.keys() == after.keys()
    for name, shape in before.items():
        ob, said = bpy.data.objects[name], f"{name} is not as live while {[rig.name for rig in rigs]} are played"
        assert shape.shape == after[name].shape, f"{said}: {len(shape)} in place of {len(after[name])}"
        if np.isfinite((shape, after[name])).all():  # Blender's own modifiers may have deformed one of the two
            compare.assert_close(shape, after[name], said, compare.looseness(ob))
        else:
            assert np.allclose(shape, after[name], rtol=1e-5, atol=1e-5, equal_nan=True), said
    states().take_over(rigs, bpy.context.scene, bpy.context.view_layer)
