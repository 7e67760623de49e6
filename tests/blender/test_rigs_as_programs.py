"""A rig's program computes each bone with the bits that Blender computes."""

import importlib
import importlib.util
import json
import re
import sys
from functools import partial
from pathlib import Path
from random import Random

import bpy
import numpy as np
import pytest
from mathutils import Vector

import edge_rigs
import random_modifiers
import random_rigs
import rigify_characters
from characters import make_armature
from helpers import addon_module, evaluated, needs_memory

ROOT = Path(__file__).parents[2]

FRAMES = (1, 4.25, 12, 20.5, 31, -7, 44)
METARIGS = [
    rigify_characters.HUMAN,
    *(f"armature_{name}_metarig_add" for name in "basic_human basic_quadruped bird cat horse shark wolf".split()),
]
SAMPLES = 27  # of Rigify
# Of the large ones and of the samples each version of Blender tries others.
PART, PARTS = (2 * bpy.app.version[0] + bpy.app.version[1]) % 3, 3
IS_WINDOWS = sys.platform == "win32"  # here with Wine, which is slow
TRIED = METARIGS[:1] if IS_WINDOWS else [*METARIGS[:1], *METARIGS[1 + PART :: PARTS]]
SEEDS = 40 if IS_WINDOWS else 200
PORTION = 20
MOST_UNSTEADY = 5  # of a portion
# Seeds that differ before Blender 5: a bone without any size that Stretch To turns has no numbers, in Blender zeros.
DIFFERENT = {135} if bpy.app.version < (5, 0, 0) else set()

pytestmark = pytest.mark.skipif(bpy.app.version < (4, 2, 0), reason="rigs are programs from Blender 4.2 on")


def reading():
    return addon_module("description.reading")


def checking():
    return addon_module("description.equality")


def differences(ob, times=FRAMES):
    read = reading().read(ob)
    program = checking().program_of(read)
    return checking().differences(program, checking().record_frames(ob, read, times))


def refusal(ob):
    with pytest.raises(ValueError) as error:
        checking().program_of(reading().read(ob))
    return str(error.value)


@pytest.fixture
def armature(fresh_scene):
    """Three bones in a row: a, b, c. c copies a's rotation."""
    data = bpy.data.armatures.new("Rig")
    ob = bpy.data.objects.new("Rig", data)
    fresh_scene.collection.objects.link(ob)
    bpy.context.view_layer.objects.active = ob
    bpy.ops.object.mode_set(mode="EDIT")
    parent = None
    for number, name in enumerate("abc"):
        bone = data.edit_bones.new(name)
        bone.head, bone.tail, bone.parent = (0, 0, number), (0, 0.1, number + 1), parent
        parent = bone
    bpy.ops.object.mode_set(mode="OBJECT")
    constraint = ob.pose.bones["c"].constraints.new("COPY_ROTATION")
    constraint.target, constraint.subtarget = ob, "a"
    for frame, angle in ((1, 0.2), (20, 1), (40, -0.5)):
        ob.pose.bones["a"].rotation_quaternion = (1, angle, 0.3, -angle)
        ob.pose.bones["a"].keyframe_insert("rotation_quaternion", frame=frame)
    return ob


@pytest.mark.sampled(2)
@pytest.mark.parametrize("first", range(1, SEEDS + 1, PORTION))
def test_random_rigs(first):
    outcomes = dict.fromkeys(("equal", "cycle", "unsteady", "different", "undefined driver"), 0)
    for seed in range(first, first + PORTION):
        features = random_rigs.features_of(seed)
        try:
            found = random_rigs.differences_of(seed, features)
        except random_rigs.HasCycle as reason:
            outcomes["unsteady" if isinstance(reason, random_rigs.IsUnsteady) else "cycle"] += 1
            continue
        except ValueError as error:
            # In 4.3 such a driver may have left a location that is not a number.
            assert re.search("Blender switches such a driver off|has -?nan as a value of", str(error))
            outcomes["undefined driver"] += 1
            continue
        if found and seed in DIFFERENT:
            outcomes["different"] += 1
            continue
        needed = random_rigs.shrunk(seed, features, partial(random_rigs.differs, seed)) if found else ()
        assert not found, f"seed {seed}: {found[0]}; it needs {needed}"
        outcomes["equal"] += 1
    assert outcomes["equal"] >= PORTION / 2 and outcomes["unsteady"] <= MOST_UNSTEADY, outcomes


@pytest.mark.parametrize("seed", (2, 3, 5))
def test_what_is_wrong_is_not_taken_for_unsteady(monkeypatch, seed):
    """What Blender does is compared before the rig is edited."""
    checking = addon_module("description.equality")
    program_of = checking.program_of

    def wrong(read):
        for constraint in read.description["constraints"]:
            if constraint["type"] == "MAINTAIN_VOLUME":
                constraint["settings"]["volume"] *= 1.05
        return program_of(read)

    monkeypatch.setattr(checking, "program_of", wrong)
    assert random_rigs.differences_of(seed, random_rigs.features_of(seed))


@pytest.mark.parametrize("seed, features", random_rigs.KEPT)
def test_rigs_that_once_differed(seed, features):
    assert random_rigs.differences_of(seed, features) == []


@pytest.fixture
def arm(fresh_scene):
    """bone1 to bone3, which follow the bone goal by IK, below bone0 and with the children bone4 and side. All move."""
    ob = make_armature()
    bpy.ops.object.mode_set(mode="EDIT")
    goal = ob.data.edit_bones.new("goal")
    goal.head, goal.tail = (0.8, 0.1, 3), (0.8, 0.1, 3.5)
    bpy.ops.object.mode_set(mode="OBJECT")
    constraint = ob.pose.bones["bone3"].constraints.new("IK")
    constraint.target, constraint.subtarget, constraint.chain_count = ob, "goal", 3
    source = Random(5)
    for bone in ob.pose.bones:
        for frame in (1, 20, 44):
            bone.location = [source.uniform(-0.3, 0.3) for _ in range(3)]
            bone.rotation_quaternion = (1, *(source.uniform(-0.4, 0.4) for _ in range(3)))
            bone.keyframe_insert("location", frame=frame)
            bone.keyframe_insert("rotation_quaternion", frame=frame)
    return ob


def assert_computed(ob):
    """A goal that moves with its own chain is where it would be without IK. Blender's threads read it before or after
    they have moved it there, so here Blender solves a chain whose goal is that of another armature, without IK."""
    free, twin = ob.copy(), ob.copy()
    for each in (free, twin):
        bpy.context.collection.objects.link(each)
    constraint = free.pose.bones["bone3"].constraints["IK"]
    goal = constraint.subtarget
    free.pose.bones["bone3"].constraints.remove(constraint)
    twin.pose.bones["bone3"].constraints["IK"].target = free
    for each in free.pose.bones[goal].constraints:
        each.target = free
    read = reading().read(ob)
    program = checking().program_of(read)
    chain = [program.names.index(name) for name in ("bone0", "bone1", "bone2", "bone3")]
    expected = checking().record_frames(twin, reading().read(twin), FRAMES)
    found = program.evaluate(np.array(FRAMES, np.float32), {})
    assert np.array_equal(found[:, chain], np.array(expected.poses)[:, chain])


WITHIN_CHAINS = [("bone3", "COPY_ROTATION", "bone1"), ("bone2", "COPY_SCALE", "goal"), ("bone1", "CHILD_OF", "goal")]
OF_GOALS = [("LIMIT_DISTANCE", "bone1"), ("LIMIT_DISTANCE", "bone3"), ("COPY_TRANSFORMS", "bone2")]


@pytest.mark.parametrize("mute", (False, True))
@pytest.mark.parametrize("name, kind, target", WITHIN_CHAINS)
def test_constraints_within_a_chain(arm, name, kind, target, mute):
    constraint = arm.pose.bones[name].constraints.new(kind)
    constraint.target, constraint.subtarget, constraint.mute, constraint.influence = arm, target, mute, 0.5
    assert differences(arm) == []


@pytest.mark.parametrize("mute", (False, True))
@pytest.mark.parametrize("kind, target", OF_GOALS)
def test_goals_that_look_at_their_chain(arm, kind, target, mute):
    constraint = arm.pose.bones["goal"].constraints.new(kind)
    constraint.target, constraint.subtarget, constraint.mute, constraint.influence = arm, target, mute, 0.7
    if kind == "LIMIT_DISTANCE":
        constraint.distance = 0.6
    assert differences(arm) == [] if mute else assert_computed(arm) is None


@pytest.mark.parametrize("goal", ("side", "bone4"))
def test_goals_that_are_children_of_their_chain(arm, goal):
    arm.pose.bones["bone3"].constraints["IK"].subtarget = goal
    assert_computed(arm)


def test_chains_that_share_bones(arm):
    """The goal of the chain further down is moved by the one above it."""
    constraint = arm.pose.bones["bone4"].constraints.new("IK")
    constraint.target, constraint.subtarget, constraint.chain_count = arm, "side", 2
    assert differences(arm) == []


@pytest.mark.parametrize("has_pole", (False, True))
@pytest.mark.parametrize("target", ("none", "deleted", "own", "another"))
def test_chains_without_a_goal(arm, target, has_pole):
    """Blender passes them over, wherever they are among others that act; what looks at their bones waits for them."""
    gone, other = new_empty("Gone"), make_armature()
    targets = {"none": None, "deleted": gone, "own": arm, "another": other}
    for name, count in (("bone3", 2), ("bone4", 1), ("side", 1)):
        constraint = arm.pose.bones[name].constraints.new("IK")
        constraint.target, constraint.chain_count = targets[target], count
        constraint.influence = 0.5 if name == "bone4" else 1
        if has_pole:
            constraint.pole_target, constraint.pole_subtarget = arm, "goal"
    arm.pose.bones["bone3"].constraints.move(1, 0)
    follower = arm.pose.bones["side"].constraints.new("COPY_ROTATION")
    follower.target, follower.subtarget, follower.influence = arm, "bone2", 0.6
    bpy.context.view_layer.update()
    bpy.data.objects.remove(gone)
    bpy.context.view_layer.update()
    assert arm.pose.bones["bone4"].constraints[0].is_valid == (target in ("deleted", "another"))
    assert differences(arm) == []
    arm.pose.bones["bone4"].constraints[0].chain_count = 0
    if arm.pose.bones["bone4"].constraints[0].is_valid:
        assert "has no target and reaches into another chain" in refusal(arm)
    else:
        assert differences(arm) == []
    arm.pose.bones["bone3"].constraints.remove(arm.pose.bones["bone3"].constraints[1])  # with the goal
    assert differences(arm) == []


def test_goals_of_rotation(armature):
    """Within rounding, where the chain reaches them."""
    other = bpy.data.objects.new("Goal", None)
    bpy.context.collection.objects.link(other)
    for frame, angle in ((1, 0.1), (20, 0.5), (44, -0.4)):
        other.location, other.rotation_euler = (0.2, angle, 2.5), (angle, 0.2, 0.3 * angle)
        other.keyframe_insert("location", frame=frame)
        other.keyframe_insert("rotation_euler", frame=frame)
    constraints = armature.pose.bones["c"].constraints
    constraints.remove(constraints[0])
    constraint = constraints.new("IK")
    constraint.target, constraint.use_rotation = other, True
    for location in (True, False):
        constraint.use_location = location
        found = differences(armature)
        assert max((difference.largest for difference in found), default=0) < 1e-5


def test_a_difference_is_shrunk_to_what_makes_it():
    features = random_rigs.features_of(3)
    needed = [features[5], features[40]]
    assert random_rigs.shrunk(3, features, lambda fewer: set(needed) <= set(fewer)) == needed


@pytest.mark.sampled(2)
@pytest.mark.parametrize("metarig", TRIED)
def test_rigify(fresh_scene, metarig):
    check_rigify(rigify_characters.character(metarig))


@pytest.mark.parametrize("number", range(PART, SAMPLES, 3 * PARTS if IS_WINDOWS else PARTS))
def test_samples_of_rigify(fresh_scene, number):
    rigify_characters.enable_rigify()
    rigs = importlib.import_module("rigify.rig_lists").rigs
    names = sorted(name for name in rigs if name != "skin.glue")  # which is glued to others
    assert len(names) == SAMPLES
    data = bpy.data.armatures.new("Sample")
    ob = bpy.data.objects.new("Sample", data)
    bpy.context.collection.objects.link(ob)
    bpy.context.view_layer.objects.active = ob
    bpy.ops.object.mode_set(mode="EDIT")
    rigs[names[number]]["module"].create_sample(ob)
    collection = data.collections.new("Bones")
    for bone in data.edit_bones:
        collection.assign(bone)
    collection.rigify_ui_row = 1
    bpy.ops.object.mode_set(mode="OBJECT")
    check_rigify(rigify_characters.generate())


def check_rigify(ob):
    source = np.random.default_rng(1)
    for bone in ob.pose.bones:
        for frame in (1, 20, 40):
            bone.location = source.uniform(-0.1, 0.1, 3)
            bone.scale = source.uniform(0.8, 1.2, 3)
            rotation = "rotation_quaternion" if bone.rotation_mode == "QUATERNION" else "rotation_euler"
            setattr(bone, rotation, source.uniform(-1, 1, len(getattr(bone, rotation))))
            for name in ("location", "scale", rotation):
                bone.keyframe_insert(name, frame=frame)
    assert differences(ob) == []
    read = reading().read(ob)
    recorded = checking().record_random_poses(ob, read, 3)
    assert checking().differences(checking().program_of(read), recorded) == []


def test_a_key_that_changes_a_little_is_seen(armature):
    read = reading().read(armature)
    assert differences(armature) == []
    program = checking().program_of(read)
    curve = addon_module("blender.animation").keyed_curves(armature)[1]
    curve.keyframe_points[1].co.y += 1e-4
    curve.update()
    found = checking().differences(program, checking().record_frames(armature, read, FRAMES))
    assert {difference.time for difference in found} >= {4.25, 12, 20.5, 31}
    assert set(found[0].bones) == {"a", "b", "c"}
    assert "frame 4.25: a, b, c differ by up to" in str(found[0])


def test_a_time_that_changes_a_little_is_seen(armature):
    read = reading().read(armature)
    recorded = checking().record_frames(armature, read, (4.25, 12))
    recorded.times = [time + 0.001 for time in recorded.times]
    assert len(checking().differences(checking().program_of(read), recorded)) == 2


def test_edits_without_keys_are_followed(armature):
    armature.pose.bones["b"].location = (0.1, 0.2, 0.3)
    armature.pose.bones["c"].constraints[0].influence = 0.25
    assert differences(armature) == []


@needs_memory
def test_whole_numbers_are_rounded_only_where_they_are_keyed(armature):
    """Blender rounds what keying has made, but neither drivers nor curves that scripts have made."""
    bone = armature.pose.bones["b"]
    for name in ("keyed", "made", "driven"):
        bone[name] = 0
    for name in ("yes", "made_yes"):
        bone[name] = False
    for frame, value in ((1, 0), (40, 7)):
        for name in ("keyed", "yes"):
            bone[name] = type(bone[name])(value)
            bone.keyframe_insert(f'["{name}"]', frame=frame)
    action = armature.animation_data.action
    curves = action.fcurves if hasattr(action, "fcurves") else action.layers[0].strips[0].channelbags[0].fcurves
    for name in ("made", "made_yes"):
        curve = curves.new(f'pose.bones["b"]["{name}"]')
        for frame, value in ((1, 0), (40, 7)):
            curve.keyframe_points.insert(frame, value)
    driver = bone.driver_add('["driven"]').driver
    driver.expression, variable = "x * 10", driver.variables.new()
    variable.name, variable.targets[0].id = "x", armature
    variable.targets[0].data_path = 'pose.bones["a"].location[0]'
    paths = [f'pose.bones["b"]["{name}"]' for name in ("keyed", "made", "driven", "yes", "made_yes")]
    scene = bpy.context.scene
    program = checking().program_of(reading().read(armature))
    seen = set()
    for frame in range(1, 41, 3):
        scene.frame_set(frame)
        evaluated = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        wanted = tuple(float(evaluated.path_resolve(path)) for path in paths)
        assert tuple(program.values(np.array([frame], np.float32), paths)[0].tolist()) == wanted, frame
        seen.add(wanted)
    assert len(seen) > 8


@pytest.mark.parametrize("first", range(0, 60, PORTION))
def test_modifiers_of_curves(armature, first):
    bone, seen = armature.pose.bones["b"], set()
    for seed in range(first, first + PORTION):
        random = Random(seed)
        armature.animation_data.action = None
        for frame in random.sample(range(-5, 40), 4):
            bone.location = [random.uniform(-2, 2) for _ in range(3)]
            bone.keyframe_insert("location", frame=frame)
        for curve in addon_module("blender.animation").slot_curves(armature):
            random_modifiers.modify(curve, random)
            seen |= {modifier.type for modifier in curve.modifiers}
        times = [*(random.uniform(-20, 70) for _ in range(8)), *(random.randint(-20, 70) for _ in range(8))]
        assert differences(armature, times) == [], f"seed {seed}"
    assert seen == set(random_modifiers.TYPES)


@pytest.mark.parametrize(
    "kind, change, clause",
    [
        ("NOISE", {}, "the modifier Noise of the curve of .* is not covered"),
        ("CYCLES", {"use_influence": True}, "the modifier Cycles of the curve of .* has a frame range or an influence"),
        (
            "STEPPED",
            {"use_restricted_range": True},
            "the modifier Stepped Interpolation of the curve of .* has a frame range",
        ),
    ],
)
def test_modifiers_that_are_refused(armature, kind, change, clause):
    modifier = addon_module("blender.animation").slot_curves(armature)[0].modifiers.new(kind)
    for name, value in change.items():
        setattr(modifier, name, value)
    assert re.search(clause, refusal(armature))
    modifier.mute = True
    assert differences(armature) == []


def test_curves_of_what_is_not_there_are_passed_over(armature):
    armature.pose.bones["b"].keyframe_insert("location", frame=1)
    armature.pose.bones["b"].name = "d"  # renames paths too, so:
    for curve in addon_module("blender.animation").keyed_curves(armature):
        curve.data_path = curve.data_path.replace('"d"', '"b"')
    assert differences(armature) == []


def new_empty(name, parent=None):
    ob = bpy.data.objects.new(name, None)
    bpy.context.collection.objects.link(ob)
    ob.parent = parent
    return ob


def driven_by(read):
    return [variable for row in read.description["drivers"] for variable in row["variables"]]


def test_what_other_objects_do_is_given(armature):
    """Their places are computed if nothing but keyframes moves them."""
    other, turned = new_empty("Other"), new_empty("Turned")
    other.location = (1, 2, 3)
    other.keyframe_insert("location", frame=1)
    other.location = (-3, 0, 1)
    other.keyframe_insert("location", frame=30)
    turned.constraints.new("COPY_ROTATION").target = other
    for name, target in (("b", other), ("c", turned)):
        armature.pose.bones[name].constraints.new("COPY_LOCATION").target = target
    driver = armature.pose.bones["c"].driver_add("location", 1).driver
    driver.type = "SUM"
    variable = driver.variables.new()
    variable.targets[0].id, variable.targets[0].data_path = other, "location.x"
    read = reading().read(armature)
    assert [row["name"] for row in read.description["objects"]] == ["Other"]
    assert [row["name"] for row in read.description["matrices"]] == ["Turned"]
    assert read.description["values"] == [] and [row["path"] for row in driven_by(read)] == [
        'objects["Other"].location.x'
    ]
    assert differences(armature) == []


@pytest.mark.parametrize("mode", ["XYZ", "YZX", "ZYX", "QUATERNION", "AXIS_ANGLE"])
def test_places_of_objects_are_computed(armature, mode):
    """Of a keyed child of a keyed child of what stays, in all ways in which an object has a place."""
    random = Random(mode)

    def some(count, size=1.0):
        return [random.uniform(-size, size) for _ in range(count)]

    lineage = [new_empty('Se"t')]
    for name in ("Cart", "Ai'm"):
        lineage.append(new_empty(name, lineage[-1]))
    for ob in lineage:
        ob.location, ob.rotation_euler, ob.scale = some(3), some(3, 3), some(3)
        ob.rotation_mode = mode
        ob.rotation_quaternion, ob.rotation_axis_angle = some(4), some(4)
        ob.delta_location, ob.delta_rotation_euler, ob.delta_scale = some(3), some(3, 3), some(3)
        ob.delta_rotation_quaternion = some(4)
        ob.matrix_parent_inverse = [some(4) for _ in range(3)] + [(0, 0, 0, 1)]
    for frame in (1, 9, 30):
        for ob in lineage[1:]:
            for name in ("location", "rotation_euler", "rotation_quaternion", "rotation_axis_angle", "scale"):
                setattr(ob, name, some(len(getattr(ob, name)), 3))
                ob.keyframe_insert(name, frame=frame)
            ob.delta_location = some(3)
            ob.keyframe_insert("delta_location", frame=frame)
    addon_module("blender.animation").keyed_curves(lineage[1])[0].mute = True
    for name, kind in (("b", "COPY_TRANSFORMS"), ("c", "DAMPED_TRACK")):
        armature.pose.bones[name].constraints.new(kind).target = lineage[-1]
    read = reading().read(armature)
    assert [row["name"] for row in read.description["objects"]] == [ob.name for ob in lineage]
    assert read.description["matrices"] == [] and differences(armature) == []
    text = json.loads(json.dumps(read.description, default=reading().as_list))
    frames = np.arange(1, 30, 0.5)
    rig_program = addon_module("native").sinew_native.RigProgram
    poses = [rig_program(each).evaluate(frames) for each in (read.description, text)]
    assert np.array_equal(*poses) and np.ptp(poses[0], axis=0).max() > 0.1


def test_a_target_that_was_deleted(armature):
    """Child Of stays valid, and its matrix goes back to the world all the same."""
    armature.location, armature.rotation_euler = (3, 1, 2), (0.3, 0.2, 0.1)
    gone, constraint = new_empty("Gone"), armature.pose.bones["b"].constraints.new("CHILD_OF")
    constraint.target = gone
    bpy.context.view_layer.update()
    bpy.data.objects.remove(gone)
    bpy.context.view_layer.update()
    assert constraint.is_valid and constraint.owner_space == "POSE"
    assert differences(armature) == []


KINDS = ("CHILD_OF", "COPY_LOCATION", "COPY_ROTATION", "COPY_SCALE", "COPY_TRANSFORMS", "DAMPED_TRACK", "LOCKED_TRACK")
KINDS += ("TRACK_TO", "STRETCH_TO", "TRANSFORM", "IK", "LIMIT_DISTANCE", "PIVOT", "ARMATURE")


@pytest.mark.parametrize("is_own", (False, True))
@pytest.mark.parametrize("kind", KINDS)
def test_a_bone_that_is_not_there(armature, kind, is_own):
    """Of its own armature, Blender finds the constraint invalid; of another one, it does not know what to evaluate
    first."""
    constraint = armature.pose.bones["b"].constraints.new(kind)
    target = constraint.targets.new() if kind == "ARMATURE" else constraint
    target.target, target.subtarget = armature if is_own else make_armature(), "gone"
    bpy.context.scene.frame_set(2)
    if is_own or kind == "ARMATURE":
        assert differences(armature) == []
    else:
        assert "has no bone gone: choose another one" in refusal(armature)


@pytest.mark.parametrize("is_own", (False, True))
def test_drivers_of_bones_that_are_not_there_are_refused(armature, is_own):
    driver = armature.pose.bones["b"].driver_add("location", 0).driver
    driver.type = "SUM"
    variable = driver.variables.new()
    variable.type = "LOC_DIFF"
    for target in variable.targets:
        target.id, target.bone_target = armature if is_own else make_armature(), "gone"
    bpy.context.scene.frame_set(2)
    assert "has no bone gone: choose another one" in refusal(armature)


def test_invalid_drivers_of_what_is_keyed_are_refused(armature):
    """After a file was opened, their values are there on the first frame, and then those of the keyframes."""
    bone = armature.pose.bones["b"]
    driver = bone.driver_add("location", 0).driver
    driver.type, driver.variables.new().targets[0].data_path = "SUM", "location.y"
    bpy.context.scene.frame_set(2)
    assert not driver.is_valid and differences(armature) == []
    bone.keyframe_insert("location", frame=1, index=1)
    assert differences(armature) == []
    bone.keyframe_insert("location", frame=1, index=0)
    assert 'the driver of Location of the bone "b": it is invalid, and keyframes set the same' in refusal(armature)


def test_the_place_of_the_armature_in_local_space_is_refused(armature):
    driver = armature.pose.bones["b"].driver_add("location", 0).driver
    driver.type = "SUM"
    variable = driver.variables.new()
    variable.type, variable.targets[0].id = "TRANSFORMS", armature
    assert differences(armature) == []
    variable.targets[0].transform_space = "LOCAL_SPACE"
    assert "it reads Rig itself in local space, which is not covered" in refusal(armature)


def test_what_is_not_covered_is_refused_by_name(armature):
    armature.pose.bones["b"].constraints.new("SHRINKWRAP").name = "Onto"
    assert 'the constraint "Onto" of the bone "b": the type Shrinkwrap is not covered' in refusal(armature)
    armature.pose.bones["b"].constraints[0].mute = True
    assert differences(armature) == []


def test_python_in_drivers_is_refused(armature):
    driver = armature.pose.bones["b"].driver_add("location", 0).driver
    driver.expression = "2 ** 3"
    bpy.context.view_layer.update()
    if not driver.is_valid:
        pytest.skip("this Blender has switched the driver off, since it runs no Python for it")
    assert 'the driver of Location of the bone "b": "2 ** 3" is not one of' in refusal(armature)


@pytest.mark.parametrize("switch", ("enabled", "mute"))
@pytest.mark.parametrize("kind", ("COPY_TRANSFORMS", "IK", "CHILD_OF", "LIMIT_LOCATION"))
def test_constraints_are_switched(arm, kind, switch):
    """By keys of either name, whatever it is now; by a driver of the contrary; and by a curve between off and on."""
    made = []
    for name in ("bone4", "side"):
        constraint = arm.pose.bones[name].constraints.new(kind)
        made.append(constraint)
        if kind == "LIMIT_LOCATION":
            constraint.use_max_x = constraint.use_max_z = True
        else:
            constraint.target, constraint.subtarget = arm, "goal"
        if kind == "IK":
            constraint.chain_count = 1
    for frame, is_muted in ((1, False), (12, True), (20, False), (31, True)):
        made[0].mute = is_muted
        made[0].keyframe_insert(switch, frame=frame)
    driver = made[1].driver_add(switch).driver
    driver.type, variable = "SUM", driver.variables.new()
    variable.targets[0].id, variable.targets[0].data_path = arm, made[0].path_from_id(switch)
    for frame in (1, 12):
        bpy.context.scene.frame_set(frame)
        read = reading().read(arm)
        program = checking().program_of(read)
        assert checking().differences(program, checking().record_frames(arm, read, FRAMES)) == []
    values = program.values(np.array(FRAMES, np.float32), [each.path_from_id(switch) for each in made])
    assert {*values[:, 0].tolist()} == {0, 1} and np.array_equal(values[:, 0], values[:, 1])
    curve = next(
        each for each in addon_module("blender.animation").keyed_curves(arm) if each.data_path.endswith(switch)
    )
    for key in curve.keyframe_points:
        key.interpolation = "LINEAR"
    curve.update()
    assert differences(arm, [*FRAMES, 13, 15.5, 16, 17]) == []


@pytest.mark.parametrize("is_driven", (False, True))
def test_of_a_constraints_switches_one_alone_may_change(armature, is_driven):
    constraint = armature.pose.bones["c"].constraints[0]
    constraint.keyframe_insert("enabled", frame=1)
    driver = armature.pose.bones["b"].driver_add("location", 0).driver
    driver.type, variable = "SUM", driver.variables.new()
    variable.targets[0].id, variable.targets[0].data_path = armature, constraint.path_from_id("enabled")
    assert differences(armature) == []
    variable.targets[0].data_path = constraint.path_from_id("mute")
    bpy.context.view_layer.update()
    assert "of which the contrary is animated" in refusal(armature)
    armature.pose.bones["b"].driver_remove("location", 0)
    if is_driven:
        constraint.driver_add("mute").driver.type = "SUM"
    else:
        constraint.keyframe_insert("mute", frame=1)
    bpy.context.view_layer.update()
    assert "both Enabled and Mute are animated: keep one of the two" in refusal(armature)


@pytest.mark.parametrize("kind, name", [("LIMIT_DISTANCE", "distance"), ("STRETCH_TO", "rest_length")])
def test_lengths_of_0_are_those_of_when_it_first_acts(armature, kind, name):
    """Blender stores them in the original too, which is what is read."""
    goal, constraint = new_empty("Goal"), armature.pose.bones["b"].constraints.new(kind)
    constraint.target, constraint.influence = goal, 0
    for frame, goal.location.x in ((1, 1), (20, 5), (40, 2)):
        goal.keyframe_insert("location", frame=frame)
    setattr(constraint, name, 0)
    assert differences(armature) == [] and getattr(constraint, name) == 0
    constraint.influence = 0.8
    bpy.context.scene.frame_set(9)
    assert (first := getattr(constraint, name)) > 0
    assert differences(armature) == [] and getattr(constraint, name) == first
    for frame, constraint.influence in ((1, 0), (10, 0), (11, 1)):
        constraint.keyframe_insert("influence", frame=frame)
    setattr(constraint, name, 0)
    bpy.context.scene.frame_set(1)
    assert "which Blender replaces when it first acts; show a frame on which it does" in refusal(armature)
    bpy.context.scene.frame_set(15)
    assert getattr(constraint, name) not in (0, first) and differences(armature) == []
    bpy.data.objects.remove(goal)
    setattr(constraint, name, 0)
    bpy.context.scene.frame_set(16)
    assert getattr(constraint, name) == 0 and differences(armature) == []


def test_what_is_switched_off_may_be_of_any_kind(armature):
    constraint = armature.pose.bones["b"].constraints.new("SHRINKWRAP")
    constraint.enabled = False
    assert differences(armature) == []
    constraint.keyframe_insert("influence", frame=3)
    constraint.driver_add("distance").driver.type = "SUM"
    bpy.context.view_layer.update()
    assert differences(armature) == []
    data = armature.animation_data
    data.nla_tracks.new().strips.new("Pushed", 1, data.action)
    data.action = None
    bpy.context.view_layer.update()
    assert differences(armature) == []
    constraint.keyframe_insert("enabled", frame=1)
    assert "the type Shrinkwrap is not covered" in refusal(armature)


def test_use_self_counts_for_python_alone(armature):
    """Blender computes a simple expression as any other one."""
    driver = armature.pose.bones["b"].driver_add("location", 0).driver
    driver.expression, driver.use_self = "frame / 20 + x", True
    variable = driver.variables.new()
    variable.name, variable.targets[0].id = "x", armature
    variable.targets[0].data_path = 'pose.bones["a"].rotation_quaternion[1]'
    bpy.context.view_layer.update()
    assert driver.is_simple_expression and differences(armature) == []
    driver.expression = "self.location.x"
    bpy.context.view_layer.update()
    if not driver.is_valid:
        pytest.skip("this Blender has switched the driver off, since it runs no Python for it")
    assert '"self.location.x" is not one of Blender\'s simple expressions' in refusal(armature)


def test_curves_that_are_not_covered_are_refused(armature):
    addon_module("blender.animation").keyed_curves(armature)[0].modifiers.new("NOISE")
    assert "the modifier Noise of the curve of" in refusal(armature)


@pytest.mark.parametrize(("table", "name"), [("ROTATION_MODES", "rotation_mode"), ("INHERIT_SCALES", "inherit_scale")])
def test_a_choice_of_a_newer_blender_is_refused(armature, monkeypatch, table, name):
    bones = addon_module("description.bone_rows")
    armature.pose.bones["b"].rotation_mode, armature.data.bones["b"].inherit_scale = "ZYX", "NONE"
    known = {number: each for number, each in getattr(bones, table).items() if each not in ("ZYX", "NONE")}
    monkeypatch.setattr(bones, table, known)
    assert f'the {name} of the bone "b" is of a newer Blender, and not covered' == refusal(armature)


@pytest.fixture
def other(fresh_scene):
    """Another armature, which is posed by hand, not where the first one is. Its bones inherit in different ways."""
    other = make_armature()
    other.name, other.location, other.rotation_euler, other.scale = "Other", (1, -2, 0.5), (0.3, 0.2, 1), (1, 1.2, 0.9)
    for number, (bone, inherits) in enumerate(zip(other.pose.bones, (*INHERITED, "FULL"), strict=True)):
        bone.rotation_mode = ("XYZ", "QUATERNION", "ZYX")[number % 3]
        bone.rotation_euler, bone.rotation_quaternion = (0.3, 0.5, -0.2 * number), (1, 0.2, -0.3, 0.1 * number)
        bone.location, bone.scale = (0.1, 0.2 * number, -0.1), (1.1, 0.9, 1.2)
        bone.bone.inherit_scale, bone.bone.use_local_location = inherits, number != 3
    return other


INHERITED = ("FULL", "FIX_SHEAR", "ALIGNED", "AVERAGE", "NONE")
SPACES = ("WORLD", "POSE", "LOCAL_WITH_PARENT", "LOCAL", "CUSTOM")
SEEN = ("COPY_LOCATION", "COPY_ROTATION", "COPY_SCALE", "COPY_TRANSFORMS", "TRANSFORM", "ACTION", "LIMIT_DISTANCE")


@pytest.mark.parametrize("space", SPACES)
@pytest.mark.parametrize("kind", SEEN)
def test_bones_of_other_armatures_in_all_spaces(armature, other, kind, space):
    """Of each of them, in a mode of rotation of its own."""
    armature.location, armature.rotation_euler = (1, 2, 3), (0.3, -0.2, 0.1)
    for bone in other.pose.bones:
        constraint = armature.pose.bones["b"].constraints.new(kind)
        constraint.target, constraint.subtarget, constraint.influence = other, bone.name, 0.4
        constraint.target_space = space
        if space == "CUSTOM":
            constraint.space_object, constraint.space_subtarget = armature, "a"
        if kind == "TRANSFORM":
            constraint.map_from, constraint.map_to = "ROTATION", "LOCATION"
            constraint.from_max_x_rot, constraint.to_max_x, constraint.to_max_y = 1, 2, 3
            constraint.from_max_y_rot = constraint.from_max_z_rot = 1.2
        if kind == "ACTION":
            constraint.action, constraint.transform_channel = armature.animation_data.action, "ROTATION_Y"
            constraint.min, constraint.max, constraint.frame_end = -1, 1, 40
    bpy.context.view_layer.update()
    assert differences(armature) == []


@pytest.mark.parametrize("space", SPACES)
@pytest.mark.parametrize("kind", ("COPY_LOCATION", "COPY_TRANSFORMS", "DAMPED_TRACK", "STRETCH_TO", "LIMIT_DISTANCE"))
def test_places_along_bones_of_other_armatures(armature, other, kind, space):
    armature.location, armature.rotation_euler = (1, 2, 3), (0.3, -0.2, 0.1)
    for bone, along in zip(other.pose.bones, (0.3, 1, 0.77, 1e-7, 0, 0.5), strict=True):
        constraint = armature.pose.bones["b"].constraints.new(kind)
        constraint.target, constraint.subtarget, constraint.influence = other, bone.name, 0.4
        constraint.target_space, constraint.head_tail = space if kind.startswith("COPY") else "WORLD", along
        if constraint.target_space == "CUSTOM":
            constraint.space_object, constraint.space_subtarget = armature, "a"
    bpy.context.view_layer.update()
    assert differences(armature) == []


def test_places_along_bones_of_other_armatures_that_are_refused(armature, other):
    constraint = armature.pose.bones["b"].constraints.new("COPY_LOCATION")
    constraint.target, constraint.subtarget = other, "bone1"
    constraint.head_tail, constraint.use_bbone_shape = 0.5, True
    assert "a place along a B-bone of another armature is not covered" in refusal(armature)
    constraint.use_bbone_shape, other.data.bones["bone1"].bbone_segments = False, 4
    assert differences(armature) == []
    constraint.head_tail = 0
    constraint.keyframe_insert("head_tail", frame=1)
    assert "an animated place along a bone of another armature is not covered" in refusal(armature)


@pytest.mark.parametrize("space", ("WORLD_SPACE", "LOCAL_SPACE", "TRANSFORM_SPACE"))
@pytest.mark.parametrize("channel", ("LOC_X", "LOC_Z", "ROT_X", "ROT_Y", "ROT_W", "SCALE_Y", "SCALE_AVG", "far"))
def test_drivers_of_bones_of_other_armatures(armature, other, channel, space):
    armature.location, armature.rotation_euler = (1, 2, 3), (0.3, -0.2, 0.1)
    driver = armature.pose.bones["b"].driver_add("location", 0).driver
    driver.type = "SUM"
    for number, bone in enumerate(other.pose.bones):
        variable = driver.variables.new()
        variable.type = "LOC_DIFF" if channel == "far" else "TRANSFORMS"
        target = variable.targets[0]
        target.id, target.bone_target, target.transform_space = other, bone.name, space
        if channel == "far":
            variable.targets[1].id, variable.targets[1].bone_target = armature, "a"
        else:
            target.transform_type = channel
            target.rotation_mode = ("AUTO", "AUTO", "QUATERNION", "XYZ", "SWING_TWIST_Y", "AUTO")[number]
    bpy.context.view_layer.update()
    assert differences(armature) == []


@pytest.mark.parametrize("has_parent", (False, True))
@pytest.mark.parametrize("space", ("WORLD_SPACE", "LOCAL_SPACE", "TRANSFORM_SPACE"))
@pytest.mark.parametrize("channel", ("LOC_X", "ROT_Y", "ROT_W", "SCALE_AVG", "far"))
def test_objects_in_all_spaces(armature, channel, space, has_parent):
    armature.location, armature.rotation_euler = (1, 2, 3), (0.3, -0.2, 0.1)
    parent, driver = new_empty("Parent"), armature.pose.bones["b"].driver_add("location", 0).driver
    parent.rotation_euler, parent.location = (0.4, 0.1, 0.2), (0.3, -2, 1)
    read = new_empty("Read", parent if has_parent else None)
    read.location, read.rotation_euler, read.scale = (1, 2, 3), (0.5, -0.3, 0.2), (1.1, 0.8, 1.3)
    read.delta_rotation_euler, read.delta_scale = (0.1, 0.2, 0.3), (1, 1.2, 1)
    constraint = armature.pose.bones["c"].constraints.new("COPY_TRANSFORMS")
    constraint.target, constraint.target_space, constraint.influence = read, "LOCAL", 0.5
    driver.type, variable = "SUM", driver.variables.new()
    variable.type = "LOC_DIFF" if channel == "far" else "TRANSFORMS"
    target = variable.targets[0]
    target.id, target.transform_space = read, space
    if channel == "far":
        variable.targets[1].id, variable.targets[1].bone_target = armature, "a"
    else:
        target.transform_type, target.rotation_mode = channel, "QUATERNION" if channel == "ROT_W" else "AUTO"
    bpy.context.view_layer.update()
    assert differences(armature) == []
    read.delta_location = (1, 2, 3)
    bpy.context.view_layer.update()
    if channel == "far" and space == "TRANSFORM_SPACE":
        assert "it reads Read, which has a delta, in transform space, which is not covered" in refusal(armature)
    else:
        assert differences(armature) == []


def test_what_is_not_covered_of_other_armatures(armature, other):
    bone = armature.pose.bones["b"]
    constraint = bone.constraints.new("COPY_LOCATION")
    constraint.target, constraint.subtarget = other, "bone1"
    constraint.target_space = "LOCAL_OWNER_ORIENT"
    assert "the owner's orientation is not covered for another armature's bone: choose another space" in refusal(
        armature
    )
    bone.constraints.remove(constraint)
    constraint = bone.constraints.new("ARMATURE").targets.new()
    constraint.target, constraint.subtarget = other, "bone1"
    assert "bones of another armature are not covered here" in refusal(armature)
    bone.constraints.remove(bone.constraints[0])
    variable = bone.driver_add("location", 0).driver.variables.new()
    variable.type = "ROTATION_DIFF"
    for target in variable.targets:
        target.id, target.bone_target = other, "bone1"
    assert "it reads how a bone of Other is turned, which is not covered" in refusal(armature)


@pytest.mark.parametrize("mode", ["XYZ", "ZYX", "QUATERNION"])
def test_angles_of_another_object_are_those_nearest_to_its_own(armature, mode):
    other = bpy.data.objects.new("Other", None)
    bpy.context.collection.objects.link(other)
    other.rotation_mode = mode
    for frame, angles in ((1, (0.1, 0.2, 0.3)), (20, (2, 3, 4)), (44, (7, -8, 9))):
        other.rotation_euler, other.rotation_quaternion = angles, (1, *angles)
        other.keyframe_insert("rotation_euler", frame=frame)
        other.keyframe_insert("rotation_quaternion", frame=frame)
    for index, channel in enumerate(("ROT_X", "ROT_Y", "ROT_Z")):
        driver = armature.pose.bones["b"].driver_add("location", index).driver
        driver.type, variable = "SUM", driver.variables.new()
        variable.type, variable.targets[0].id = "TRANSFORMS", other
        variable.targets[0].transform_type = channel
    assert differences(armature) == []


def test_the_manual_knows_blenders_numbers_of_choices(armature):
    spec = importlib.util.spec_from_file_location("make_rig_tables", ROOT / "docs" / "make_rig_tables.py")
    tables = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tables)
    key = bpy.types.Keyframe.bl_rna.properties
    found = [("key", name, key[name]) for name in ("interpolation", "easing")]
    for kind, settings in addon_module("native").sinew_native.rig_constraint_settings().items():
        properties = armature.pose.bones["b"].constraints.new(kind).bl_rna.properties
        found += [(kind, name, properties[name]) for name, (_, type_, *_) in settings.items() if type_ == "ENUM"]
    for kind, name, setting in found:
        known = tables.choices_of(kind, name)
        assert {item.value: item.identifier for item in setting.enum_items}.items() <= known.items(), (kind, name)


def test_settings_of_constraints_have_blenders_types_and_limits(armature):
    """By which what curves and drivers set is stored."""
    for kind, settings in addon_module("native").sinew_native.rig_constraint_settings().items():
        properties = armature.pose.bones["b"].constraints.new(kind).bl_rna.properties
        for name, (count, type_, _default, low, high) in settings.items():
            setting = properties.get(name)
            if setting is None:
                assert name in ("head_tail", "use_bbone_shape"), (kind, name)  # all have them here
                continue
            assert (setting.type, count) == (type_, max(1, getattr(setting, "array_length", 0))), (kind, name)
            if type_ in ("FLOAT", "INT"):
                limits = np.clip((setting.hard_min, setting.hard_max), -3.4e38, 3.4e38)
                assert tuple(limits.astype(np.float32)) == (low, high), (kind, name)


def test_a_moving_object_is_refused(armature):
    armature.keyframe_insert("location", frame=1)
    assert differences(armature) == []
    armature.location.z += 1
    armature.keyframe_insert("location", frame=9)
    assert "Rig itself moves (its Location is animated): move a bone instead" in refusal(armature)


def test_a_cycle_is_refused(armature):
    constraint = armature.pose.bones["a"].constraints.new("COPY_LOCATION")
    constraint.target, constraint.subtarget = armature, "c"
    assert "the rig has a cycle: " in refusal(armature)


def test_only_armatures_are_rigs():
    ob = bpy.data.objects.new("Lamp", None)
    with pytest.raises(ValueError, match="Lamp is no armature: choose one"):
        reading().read(ob)


# --- the command line -------------------------------------------------------------------------------------------------


@pytest.fixture
def rig_blend(armature, tmp_path):
    path = tmp_path / "rig.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def test_the_command_writes_a_description(sinew, rig_blend, tmp_path):
    output = tmp_path / "rig.json"
    code, out, err = sinew("rig", rig_blend, "-o", output)
    assert (code, err) == (0, "")
    assert out.startswith(f"Rig: 3 bones\nwritten to {output}")
    native = addon_module("native").sinew_native
    description = json.loads(output.read_text())
    assert description["format"] == 1
    written = native.RigProgram(description)
    read = reading().read(bpy.data.objects["Rig"])
    times = np.array(FRAMES, np.float32)
    assert (written.evaluate(times) == checking().program_of(read).evaluate(times)).all()


def test_the_command_checks(sinew, rig_blend):
    code, out, err = sinew("rig", rig_blend, "--check", "--frames", "4", "--random-poses", "2")
    assert (code, err) == (0, "")
    assert "frames: 6 of 6 equal\nrandom poses: 2 of 2 equal" in out
    code, out, _ = sinew("rig", rig_blend, "--check", "--frames", "4", "--json")
    found = json.loads(out.splitlines()[-1])
    assert code == 0 and found["frames"] == {"compared": 6, "different": 0} and found["differences"] == []


def test_the_command_says_why_a_rig_is_refused(sinew, armature, tmp_path):
    armature.pose.bones["b"].constraints.new("SHRINKWRAP").name = "Onto"
    path = tmp_path / "rig.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    code, out, _ = sinew("rig", path)
    assert code == 1
    assert 'cannot be a program: the constraint "Onto" of the bone "b": the type Shrinkwrap is not covered' in out


@pytest.mark.parametrize("how", ("eye", "monitor", "collection", "no scene"))
def test_the_command_checks_a_hidden_rig(sinew, armature, tmp_path, how):
    if how == "eye":
        armature.hide_set(True)
    elif how == "monitor":
        armature.hide_viewport = True
    else:
        other = bpy.data.collections.new("Other")
        other.objects.link(armature)
        bpy.context.collection.objects.unlink(armature)
        if how == "collection":
            bpy.context.scene.collection.children.link(other)
            bpy.context.view_layer.layer_collection.children["Other"].exclude = True
    path = tmp_path / "rig.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    code, out, err = sinew("rig", path, "--check", "--frames", "4", "--random-poses", "2")
    assert (code, err) == (0, ""), out
    assert "frames: 6 of 6 equal\nrandom poses: 2 of 2 equal" in out


@pytest.mark.parametrize("what", ("object", "parent", "both"))
def test_the_command_checks_a_rig_that_moves_as_a_whole(sinew, armature, tmp_path, what):
    """By keyframes of its own and of its parents: the program computes where it is."""
    aim, carriage = new_empty("Aim"), new_empty("Carriage")
    aim.location = 4, 1, 2
    armature.pose.bones["b"].constraints.new("DAMPED_TRACK").target = aim
    armature.parent = carriage
    for frame in (1, 9, 30):
        for each in {"object": (armature,), "parent": (carriage,), "both": (armature, carriage)}[what]:
            each.location, each.rotation_euler = (0.3 * frame, 1, -0.1 * frame), (0.1 * frame, 0.2, 0.3)
            each.keyframe_insert("location", frame=frame)
            each.keyframe_insert("rotation_euler", frame=frame)
    path, output = tmp_path / "rig.blend", tmp_path / "rig.json"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    code, out, err = sinew("rig", path, "-o", output, "--check", "--frames", "12", "--random-poses", "2")
    assert (code, err) == (0, ""), out
    assert "frames: 14 of 14 equal\nrandom poses: 2 of 2 equal" in out
    description = json.loads(output.read_text())
    assert description["world"] == "Rig" and [row["name"] for row in description["objects"]] == ["Carriage", "Rig"]
    assert what == "parent" or "Rig itself moves" in refusal(bpy.data.objects["Rig"])  # as what is played


def moved(ob):
    """Keys that move an object."""
    for frame, ob.location.x, ob.rotation_euler.z in ((1, 0, 0.1), (20, 3, 1), (40, -2, 2)):
        ob.keyframe_insert("location", frame=frame)
        ob.keyframe_insert("rotation_euler", frame=frame)


def differences_of_moving(ob):
    read = reading().read(ob, may_move=True)
    return checking().differences(checking().program_of(read), checking().record_frames(ob, read, FRAMES))


@pytest.mark.parametrize("kind", ("COPY_LOCATION", "ARMATURE", "CHILD_OF", "IK", "TRACK_TO"))
def test_what_bones_follow_while_the_object_moves(arm, kind):
    """An object that stays, a child of the armature, the armature itself, and a custom space."""
    stays, child = new_empty("Stays"), new_empty("Child", arm)
    stays.location, child.location = (1, 2, 3), (0.5, -0.2, 1.5)
    moved(arm)
    for name, target, bone in (("bone4", stays, ""), ("side", child, ""), ("bone2", arm, "goal"), ("goal", arm, "")):
        if (kind, name) == (
            "IK",
            "bone2",
        ):  # of two chains, one within the other, Blender does not say which comes first
            continue
        constraint = arm.pose.bones[name].constraints.new(kind)
        if kind == "ARMATURE":
            arm.data.bones["goal"].bbone_segments = 3
            each = constraint.targets.new()
            each.target, each.subtarget = arm, "bone0" if name == "goal" else "goal"
            constraint.use_current_location = name == "side"
            continue
        constraint.target, constraint.subtarget, constraint.influence = target, bone, 0.6
        if kind == "COPY_LOCATION":
            constraint.owner_space, constraint.space_object = "CUSTOM", stays
        if kind == "IK":
            constraint.chain_count = 1
    bpy.context.view_layer.update()
    assert differences_of_moving(arm) == []


def test_drivers_that_read_where_the_moving_object_is(armature):
    moved(armature)
    other = new_empty("Other")
    for index, kind in enumerate(("SINGLE_PROP", "TRANSFORMS", "LOC_DIFF")):
        driver = armature.pose.bones["b"].driver_add("location", index).driver
        driver.type, variable = "SUM", driver.variables.new()
        variable.type = kind
        for target, read in zip(variable.targets, (armature, other)):
            target.id = read
            if kind == "SINGLE_PROP":
                target.data_path = "location.x"
    bpy.context.view_layer.update()
    assert differences_of_moving(armature) == []
    target = armature.animation_data.drivers[1].driver.variables[0].targets[0]
    for name, value in (("transform_type", "ROT_Z"), ("transform_space", "TRANSFORM_SPACE")):
        setattr(target, name, value)
        bpy.context.view_layer.update()
        with pytest.raises(ValueError, match="it reads how Rig itself|it reads Rig itself in local space"):
            differences_of_moving(armature)


@pytest.mark.parametrize("moves", (True, False), ids=("moves", "stays"))
def test_the_command_refuses_a_rig_whose_parent_moves_otherwise(sinew, armature, tmp_path, moves):
    carriage = bpy.data.objects.new("Carriage", None)
    bpy.context.collection.objects.link(carriage)
    carriage.location.x = 3
    armature.parent = carriage
    if moves:
        carriage.driver_add("location", 0).driver.expression = "frame"
    path = tmp_path / "rig.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    code, out, _ = sinew("rig", path, "-o", tmp_path / "rig.json", "--check", "--frames", "4")
    assert code == int(moves), out
    assert ("Rig is a child of Carriage, which moves or may move" in out) == moves
    assert bool(json.loads((tmp_path / "rig.json").read_text())["refused"]) == moves


def test_the_command_fails_if_the_rig_is_computed_differently(sinew, rig_blend, monkeypatch):
    build = checking().program_of

    def changed(read):
        read.description["bones"][1]["length"] *= 1.5  # of a connected bone's parent
        return build(read)

    monkeypatch.setattr(checking(), "program_of", changed)
    code, out, _ = sinew("rig", rig_blend, "--check", "--frames", "4", "--random-poses", "1")
    assert code == 1
    assert "frames: 0 of 6 equal\n" in out and "  frame 1: c differ by up to" in out


def test_the_command_wants_an_armature(sinew, rig_blend):
    assert "there is no armature Rag; those in the file: Rig" in sinew("rig", rig_blend, "--object", "Rag")[2]


def test_keys_are_read_from_memory_as_by_the_api(fresh_scene, monkeypatch):
    curves, contract = addon_module("description.curves"), addon_module("host.contract")
    ob = bpy.data.objects.new("Moved", None)
    fresh_scene.collection.objects.link(ob)
    frame = 0
    for interpolation in bpy.types.Keyframe.bl_rna.properties["interpolation"].enum_items.keys():
        for easing in bpy.types.Keyframe.bl_rna.properties["easing"].enum_items.keys():
            frame += 1
            ob.location.x = 0.1 * frame * frame
            ob.keyframe_insert("location", index=0, frame=frame)
            key = addon_module("blender.animation").keyed_curves(ob)[0].keyframe_points[-1]
            key.interpolation, key.easing = interpolation, easing
            key.amplitude, key.period, key.back = 0.1 * frame, 0.2 * frame, 0.3 * frame
    (curve,) = addon_module("blender.animation").keyed_curves(ob)
    found = curves.rows_of([curve])[0]["keys"]
    assert found.shape == (frame, curves.KEY_NUMBERS)
    monkeypatch.setattr(contract, "has", lambda _feature: False)
    assert np.array_equal(found, curves.rows_of([curve])[0]["keys"])


@needs_memory
def test_variables_are_read_from_memory_as_by_the_api(monkeypatch):
    reading, contract = addon_module("description.reading"), addon_module("host.contract")
    for seed in range(1, PORTION):
        ob = random_rigs.make(seed, random_rigs.features_of(seed))
        assert contract.has(addon_module("host.features").VARIABLES)
        found = [each["variables"] for each in reading.read(ob).description["drivers"]]
        assert found
        with monkeypatch.context() as context:
            context.setattr(contract, "has", lambda _feature: False)
            assert found == [each["variables"] for each in reading.read(ob).description["drivers"]]


@needs_memory
def test_bones_are_read_from_memory_as_by_the_api(armature, monkeypatch):
    reading, contract = addon_module("description.reading"), addon_module("host.contract")

    def described():
        found = reading.read(armature).description
        return [json.dumps(found[part], default=reading.as_list) for part in ("bones", "properties")]

    numbers = iter(range(1, 1000))
    for bone in armature.pose.bones:
        for holder in (bone, bone.bone):
            for name, count, is_of_rest in addon_module("description.tables").bone_settings():
                if is_of_rest != (holder is bone) and not name.startswith(("lock_ik", "use_ik_limit")):
                    value = [0.001 * next(numbers) for _ in range(count)]
                    setattr(holder, name, value if count > 1 else value[0])
    armature.pose.bones["b"]["own"], armature.data.bones["c"]["own"] = 0.5, 2
    found = described()
    assert '"pose.bones[\\"b\\"][\\"own\\"]"' in found[1] and '"data.bones[\\"c\\"][\\"own\\"]"' in found[1]
    assert addon_module("host.bone_memory").read_numbers(armature) is not None
    monkeypatch.setattr(contract, "has", lambda _feature: False)
    assert addon_module("host.bone_memory").read_numbers(armature) is None
    assert found == described()


@pytest.mark.skipif(IS_WINDOWS, reason="nothing in it differs from system to system")
def test_the_readmes_example_runs(sinew, fresh_scene, tmp_path, monkeypatch):
    """A Rigify human's clip is deformed without Blender as Blender deforms it, B-bones included."""
    ob, body = human_with_body()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "human.blend"))
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    (words,) = re.findall(r"`blender -b --command sinew (rig human\.blend [^`]+)`", page)
    assert sinew(*words.split())[0] == 0
    monkeypatch.setitem(sys.modules, "sinew_native", addon_module("native").sinew_native)
    (example,) = [block for block in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "human.json" in block]
    names = {}
    exec(compile(example, "README.md", "exec"), names)
    ob, body = bpy.data.objects["rig"], bpy.data.objects["Body"]
    to_armature = np.array(ob.matrix_world.inverted() @ body.matrix_world)
    for frame in (1, 17, 40):
        bpy.context.scene.frame_set(frame)
        shape = evaluated(body) @ to_armature[:3, :3].T + to_armature[:3, 3]
        np.testing.assert_allclose(names["shapes"][frame - 1], shape, atol=2e-5)
        hand = ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones["DEF-hand.L"]
        assert names["hand"][frame - 1].tolist() == list(hand.matrix.translation)
    assert np.ptp(names["shapes"], axis=0).max() > 0.1


def human_with_body():
    """A Rigify human that moves, and a mesh with weights of two bones for each vertex."""
    ob = rigify_characters.character(rigify_characters.HUMAN)
    ob.name = "rig"
    metarig = next(each for each in bpy.data.objects if each.type == "ARMATURE" and each != ob)
    bpy.data.objects.remove(metarig)
    for frame, angle in ((1, 0), (20, 0.8), (40, -0.5)):
        for name in ("torso", "upper_arm_fk.L", "forearm_fk.L", "hand_ik.R", "foot_ik.L", "head"):
            bone = ob.pose.bones[name]
            bone.location, bone.rotation_mode = (0.1 * angle, 0, 0.2 * angle), "XYZ"
            bone.rotation_euler = (angle, 0.3 * angle, 0)
            bone.keyframe_insert("location", frame=frame)
            bone.keyframe_insert("rotation_euler", frame=frame)
    bones = [bone for bone in ob.data.bones if bone.use_deform]
    assert any(bone.bbone_segments > 1 for bone in bones)
    source = np.random.default_rng(1)
    points = [
        bone.head_local + (bone.tail_local - bone.head_local) * share for bone in bones for share in (0.1, 0.6, 0.9)
    ]
    mesh = bpy.data.meshes.new("Body")
    mesh.from_pydata([tuple(point + Vector(source.uniform(-0.02, 0.02, 3))) for point in points], [], [])
    body = bpy.data.objects.new("Body", mesh)
    bpy.context.collection.objects.link(body)
    for number, bone in enumerate(bones):
        own = range(3 * number, 3 * number + 3)
        body.vertex_groups.new(name=bone.name).add(own, 0.7, "REPLACE")
        other = body.vertex_groups.get(bones[number - 1].name) or body.vertex_groups.new(name=bones[number - 1].name)
        other.add(own, 0.3, "REPLACE")
    body.location = (0.5, 0, 0)
    body.modifiers.new("Armature", "ARMATURE").object = ob
    return ob, body


@pytest.mark.parametrize("edge", edge_rigs.EDGES, ids=lambda edge: edge.__name__)
def test_edges(edge):
    assert differences(edge_rigs.made(edge), edge_rigs.TIMES) == []
