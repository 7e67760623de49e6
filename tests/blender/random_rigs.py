"""Random armatures for comparing rigs' programs with Blender: all types of constraints, spaces, influences, modes of
rotation and inheritance, drivers, B-bones and IK. A rig is a list of features, each with a seed of its own, so that any
of them can be left out and the others stay: shrunk() finds the few that matter.

As a script, in a Blender with the add-on:

    blender -b --python tests/blender/random_rigs.py -- FIRST_SEED COUNT
"""

import functools
import random
import sys
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector

sys.path.append(str(Path(__file__).parent))
from helpers import addon_module

BONES = 30
TIMES = (1, 4.25, 12, 20.5, 31, 44, 60.75, -7, -30.5, 91)
TYPES = (
    "COPY_LOCATION COPY_ROTATION COPY_SCALE COPY_TRANSFORMS LIMIT_LOCATION LIMIT_ROTATION LIMIT_SCALE LIMIT_DISTANCE "
    "MAINTAIN_VOLUME TRANSFORM DAMPED_TRACK LOCKED_TRACK STRETCH_TO TRACK_TO ARMATURE CHILD_OF FLOOR PIVOT "
    "ACTION ACTION"
).split()
SPACES = ("WORLD", "POSE", "LOCAL_WITH_PARENT", "LOCAL", "CUSTOM")
MODES = ("QUATERNION", "AXIS_ANGLE", "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
INHERIT = ("FULL", "FULL", "FULL", "FIX_SHEAR", "ALIGNED", "AVERAGE", "NONE", "NONE_LEGACY")
HANDLES = ("AUTO", "ABSOLUTE", "RELATIVE", "TANGENT")
EXPRESSIONS = (
    "a*0.3+b",
    "min(a, b)",
    "1-a if b > 0.2 else a",
    "clamp(a)",
    "sin(a)*0.5 + frame/100",
    "a == b",
    "lerp(a, b, 0.3)",
    "smoothstep(-1, 2, a) and not b",
)
INTERPOLATIONS = ("BEZIER", "BEZIER", "LINEAR", "CONSTANT", "SINE", "BACK", "BOUNCE", "ELASTIC", "EXPO", "QUINT")
NOT_RANDOM = {
    *("type", "name", "active", "mute", "show_expanded", "influence", "owner_space", "target_space"),
    *("is_override_data", "enabled", "set_inverse_pending", "use_bone_object_action", "use_envelope"),
    *("use_bone_envelopes", "chain_count", "iterations", "action_slot_handle", "ik_type", "use_envelopes"),
}


@dataclass(frozen=True)
class Feature:
    kind: str  # one of FEATURES
    bone: int
    seed: int


def features_of(seed):
    """The features of a random rig."""
    source = random.Random(seed)
    found = []
    for bone in range(BONES):
        counts = {
            "mode": 1,
            "inheritance": source.random() < 0.5,
            "bend": source.random() < 0.25,
            "constraint": source.choice((0, 1, 1, 2, 3)) if bone else 0,
            "ik": source.random() < 0.12 if bone > 5 else 0,
            "driver": source.random() < 0.4 if bone else 0,
            "keys": 1,
        }
        for kind, count in counts.items():
            found += [Feature(kind, bone, source.getrandbits(32)) for _ in range(int(count))]
    return found


def name_of(bone):
    return f"b{bone:02}"


def make(seed, features):
    """Makes the rig in an empty file. The bones' rest and the object depend on the seed alone."""
    bpy.ops.wm.read_homefile(use_empty=True)
    source = random.Random(seed)
    data = bpy.data.armatures.new("rig")
    ob = bpy.data.objects.new("rig", data)
    bpy.context.collection.objects.link(ob)
    bpy.context.view_layer.objects.active = ob
    bpy.ops.object.mode_set(mode="EDIT")
    for number in range(BONES):
        bone = data.edit_bones.new(name_of(number))
        parent = data.edit_bones[source.randrange(number)] if number and source.random() < 0.95 else None
        is_connected = parent is not None and source.random() < 0.4
        bone.head = parent.tail if parent else (0, 0, 0)
        if not is_connected:
            bone.head += vector(source, 1)
        bone.tail = bone.head + vector(source, 0.5)
        bone.roll = source.uniform(-3, 3)
        bone.parent, bone.use_connect = parent, is_connected
    bpy.ops.object.mode_set(mode="OBJECT")
    if seed % 2:
        ob.location, ob.rotation_euler = (1, -2, 0.5), (0.3, 0.9, -1.2)
        ob.scale = (1.2, 1.2, 1.2) if seed % 4 == 1 else (1.1, 0.8, 1.3)
    make_action(ob, source)
    for bone in ob.pose.bones:
        bone["real"], bone["whole"] = 0.5, 2
    for kind in FEATURES:  # modes before keys
        for feature in features:
            if feature.kind == kind:
                FEATURES[kind](ob, feature.bone, random.Random(feature.seed))
    return ob


def vector(source, size):
    return Vector([source.uniform(-size, size) for _ in range(3)])


def make_action(ob, source):
    """The action of Action constraints. Not every bone has every channel, nor that of its mode of rotation."""
    for bone in ob.pose.bones:
        wanted = [name for name in ("location", *ROTATIONS.values(), "scale") if source.random() < 0.6]
        for frame in (0, 20, 50):
            set_channels(bone, source, wild=True)
            for name in wanted:
                bone.keyframe_insert(name, frame=frame)
    ob.animation_data_create()
    ob["action"] = ob.animation_data.action
    ob.animation_data.action = None
    for bone in ob.pose.bones:
        bone.matrix_basis = Matrix()


ROTATIONS = {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle", "XYZ": "rotation_euler"}


def set_channels(bone, source, wild=False):
    bone.location = vector(source, 0.3)
    bone.rotation_quaternion = [source.uniform(-1, 1) for _ in range(4)]
    bone.rotation_axis_angle = [source.uniform(-1, 1) for _ in range(4)]
    bone.rotation_euler = vector(source, 3)
    bone.scale = [source.uniform(0.6, 1.4) * (source.choice((1, 1, 1, -1)) if wild else 1) for _ in range(3)]


# --- features ---------------------------------------------------------------------------------------------------------


def add_mode(ob, number, source):
    ob.pose.bones[name_of(number)].rotation_mode = source.choice(MODES)


def add_inheritance(ob, number, source):
    bone = ob.pose.bones[name_of(number)].bone
    bone.use_inherit_rotation = source.random() < 0.7
    bone.inherit_scale = source.choice(INHERIT)
    bone.use_local_location = source.random() < 0.7


def add_bend(ob, number, source):
    bone = ob.pose.bones[name_of(number)].bone
    bone.bbone_segments = source.randint(2, 9)
    if bpy.app.version >= (4, 0, 0):
        bone.bbone_mapping_mode = source.choice(("STRAIGHT", "CURVED"))
    for end in ("start", "end"):
        setattr(bone, f"bbone_handle_type_{end}", source.choice(HANDLES))
        if number:
            setattr(bone, f"bbone_custom_handle_{end}", ob.data.bones[name_of(source.randrange(number))])
        setattr(bone, f"bbone_handle_use_scale_{end}", [source.random() < 0.3 for _ in range(3)])
        setattr(bone, f"bbone_handle_use_ease_{end}", source.random() < 0.3)
    bone.bbone_curveinx, bone.bbone_rollin = source.uniform(-0.2, 0.2), source.uniform(-1, 1)
    bone.bbone_easein, bone.bbone_scaleout = source.uniform(0.2, 1.5), [source.uniform(0.7, 1.3) for _ in range(3)]
    bone.use_endroll_as_inroll, bone.use_scale_easing = source.random() < 0.3, source.random() < 0.3
    posed = ob.pose.bones[name_of(number)]
    for frame in (1, 30, 60):
        posed.bbone_rollout, posed.bbone_curveoutz = source.uniform(-1, 1), source.uniform(-0.3, 0.3)
        posed.keyframe_insert("bbone_rollout", frame=frame)
        posed.keyframe_insert("bbone_curveoutz", frame=frame)


def add_constraint(ob, number, source):
    bone = ob.pose.bones[name_of(number)]
    if makes_cycle(bone, source):
        return
    kind = source.choice(TYPES)
    constraint = bone.constraints.new(kind)

    def earlier():
        return name_of(source.randrange(number))

    if kind == "ARMATURE":
        for _ in range(source.randint(1, 3)):
            target = constraint.targets.new()
            target.target, target.subtarget, target.weight = ob, earlier(), source.random()
    elif hasattr(constraint, "target"):
        constraint.target, constraint.subtarget = ob, earlier()
    set_settings(constraint, source)
    special = SPECIAL.get(kind)
    if special:
        special(ob, constraint, source)
    if kind not in ("ARMATURE", "PIVOT"):
        for name, choices in (("owner_space", SPACES), ("target_space", (*SPACES, "LOCAL_OWNER_ORIENT"))):
            allowed = {item.identifier for item in constraint.bl_rna.properties[name].enum_items}
            try:
                setattr(constraint, name, source.choice([choice for choice in choices if choice in allowed]))
            except TypeError:
                continue  # the type allows fewer than it lists
        constraint.space_object, constraint.space_subtarget = ob, earlier()
    constraint.influence = source.choice((1, 1, source.random()))
    constraint.mute = source.random() < 0.05


def makes_cycle(bone, source):
    """Whether it is better left out: what a bone of an IK chain looks at often follows from the chain."""
    return "in_chain" in bone and source.random() < 0.95


def set_settings(constraint, source):
    for prop in constraint.bl_rna.properties:
        name = prop.identifier
        if name in NOT_RANDOM or prop.is_readonly or getattr(prop, "is_array", False):
            continue
        if prop.type == "FLOAT" and "min" in name:
            setattr(constraint, name, source.uniform(-0.6, 0.2))
        elif prop.type == "FLOAT":
            setattr(constraint, name, source.uniform(max(prop.soft_min, -1), min(prop.soft_max, 1.5)))
        elif prop.type == "BOOLEAN":
            setattr(constraint, name, source.random() < 0.5)
        elif prop.type == "ENUM" and not prop.is_enum_flag:
            setattr(constraint, name, source.choice([item.identifier for item in prop.enum_items]))


def add_ik(ob, number, source):
    """A chain of a few bones, whose targets come before all of them: less often a cycle."""
    bone = ob.pose.bones[name_of(number)]
    has_tail = source.random() < 0.7 or bone.parent is None
    chain = [bone, *bone.parent_recursive][0 if has_tail else 1 :][: source.randint(1, 4)]
    first = min(int(each.name[1:]) for each in chain)
    # Chains may branch, but not begin within each other.
    root = chain[-1].name
    if first == 0 or any(each.get("in_chain", root) != root for each in chain):
        return
    # A goal or pole where the chain begins has no direction, so a rounding would decide.
    above = chain[-1].parent
    apart = [each for each in map(name_of, range(first)) if not ob.data.bones[each].use_connect]
    apart = [each for each in apart if above is None or each != above.name]
    if not apart:
        return
    target, pole = source.choice(apart), source.choice(apart)
    constraint = bone.constraints.new("IK")
    constraint.target, constraint.subtarget = ob, target
    if source.random() < 0.3 and pole != target:
        constraint.pole_target, constraint.pole_subtarget = ob, pole
    set_settings(constraint, source)
    # Blender's last bit is not known for some chains that shall be somewhere and be turned in some way: docs/rigs.md.
    constraint.use_location, constraint.use_rotation, constraint.use_tail = True, False, has_tail
    constraint.chain_count, constraint.iterations = len(chain), source.choice((5, 50, 500))
    constraint.influence = source.choice((1, 1, source.random()))
    for each in chain:
        each["in_chain"] = root
        set_ik(each, source)
    bone["in_chain"] = root


def set_ik(bone, source):
    bone.ik_stretch = source.choice((0, 0, 0.1, source.random()))
    for axis in "xyz":
        setattr(bone, f"lock_ik_{axis}", source.random() < 0.2)
        setattr(bone, f"use_ik_limit_{axis}", source.random() < 0.2)
        setattr(bone, f"ik_min_{axis}", source.uniform(-2, 0))
        setattr(bone, f"ik_max_{axis}", source.uniform(0, 2))
        setattr(bone, f"ik_stiffness_{axis}", source.choice((0, 0, source.uniform(0, 0.9))))


def set_stretch(ob, constraint, source):
    constraint.rest_length = source.choice((0.3, 0.7))


def set_distance(ob, constraint, source):
    constraint.distance = source.uniform(0.1, 1)


def set_power(ob, constraint, source):
    constraint.power = source.uniform(0.5, 1.5)


def set_parent(ob, constraint, source):
    angles = Euler((source.random(), source.random(), 0))
    constraint.inverse_matrix = Matrix.LocRotScale(vector(source, 1), angles, (1, source.uniform(0.8, 1.2), 1))


def set_pivot(ob, constraint, source):
    constraint.offset = vector(source, 0.5)


def set_action(ob, constraint, source):
    constraint.action = ob["action"]
    if hasattr(constraint, "action_slot") and constraint.action_suitable_slots:
        constraint.action_slot = constraint.action_suitable_slots[0]
    constraint.frame_start, constraint.frame_end = source.choice((0, 0, 10, 40)), source.choice((50, 50, 30, 10))
    channel = source.choice(("LOCATION", "ROTATION", "SCALE"))
    constraint.transform_channel = f"{channel}_{source.choice('XYZ')}"
    low, high = {"LOCATION": (-1, 1), "ROTATION": (-180, 180), "SCALE": (0.2, 1.6)}[channel]
    middle = (low + high) / 2
    constraint.min, constraint.max = source.uniform(low, middle), source.uniform(middle, high)


SPECIAL = {
    "STRETCH_TO": set_stretch,
    "LIMIT_DISTANCE": set_distance,
    "COPY_SCALE": set_power,
    "CHILD_OF": set_parent,
    "PIVOT": set_pivot,
    "ACTION": set_action,
}


def add_driver(ob, number, source):
    bone = ob.pose.bones[name_of(number)]
    if makes_cycle(bone, source):
        return
    if len(bone.constraints) and source.random() < 0.5:
        curve = bone.constraints[0].driver_add("influence")
    else:
        curve = bone.driver_add("location", source.randrange(3))
    driver = curve.driver
    driver.type = source.choice(("AVERAGE", "SUM", "SCRIPTED", "MIN", "MAX"))
    driver.expression = source.choice(EXPRESSIONS)
    for name in "ab":
        variable = driver.variables.new()
        variable.name = name
        variable.type = source.choice(("SINGLE_PROP", "TRANSFORMS", "LOC_DIFF", "ROTATION_DIFF"))
        for target in variable.targets:
            target.id = ob
            read = name_of(source.randrange(number))
            if variable.type == "SINGLE_PROP":
                last = source.choice(('["real"]', '["whole"]', ".scale[1]", ".location.x"))
                target.data_path = f'pose.bones["{read}"]{last}'
                continue
            target.bone_target = read
            target.transform_type = source.choice(
                ("LOC_X", "LOC_Z", "ROT_X", "ROT_Y", "ROT_Z", "ROT_W", "SCALE_X", "SCALE_AVG")
            )
            target.transform_space = source.choice(("WORLD_SPACE", "TRANSFORM_SPACE", "LOCAL_SPACE"))
            target.rotation_mode = source.choice(
                ("AUTO", "XYZ", "ZYX", "QUATERNION", "SWING_TWIST_X", "SWING_TWIST_Y", "SWING_TWIST_Z")
            )


def add_keys(ob, number, source):
    bone = ob.pose.bones[name_of(number)]
    names = ("location", "scale", ROTATIONS.get(bone.rotation_mode, "rotation_euler"), '["real"]', '["whole"]')
    for frame in (1, 30, 60, 91):
        set_channels(bone, source)
        bone["real"], bone["whole"] = source.uniform(-0.5, 1.5), source.randint(-3, 3)
        for name in names:
            bone.keyframe_insert(name, frame=frame)
    start = f'pose.bones["{bone.name}"]'
    for curve in addon_module("blender.animation").keyed_curves(ob):
        if not curve.data_path.startswith(start):
            continue
        if source.random() < 0.2:
            curve.extrapolation = "LINEAR"
        if source.random() < 0.2:
            curve.modifiers.new("CYCLES").mode_after = source.choice(("REPEAT", "REPEAT_OFFSET", "MIRROR"))
        for key in curve.keyframe_points:
            key.interpolation = source.choice(INTERPOLATIONS)


FEATURES = {
    "mode": add_mode,
    "inheritance": add_inheritance,
    "bend": add_bend,
    "ik": add_ik,
    "constraint": add_constraint,
    "driver": add_driver,
    "keys": add_keys,
}


# --- comparing --------------------------------------------------------------------------------------------------------


class HasCycle(Exception):
    """The rig depends on itself. What Blender does with it is its own."""


def differences_of(seed, features, times=TIMES):
    """The differences between program and Blender in the rig. Raises HasCycle."""
    ob = make(seed, features)
    reading, checking = addon_module("rig_programs.reading"), addon_module("rig_programs.checking")
    read = reading.read(ob)
    try:
        program = checking.program_of(read)
    except ValueError as error:
        if "cycle" in str(error) or "depend" in str(error):
            raise HasCycle from error
        raise
    found = checking.differences(program, recorded := checking.record_frames(ob, read, times))
    # Out of what is not a number anything may come; no rig that people use has it.
    broken = broken_times(recorded)
    if found:
        for constraint in [each for bone in ob.pose.bones for each in bone.constraints if each.type == "IK"]:
            constraint.influence = 1  # less would hide what the chain has made of it
        broken |= broken_times(checking.record_frames(ob, read, times))
    return [difference for difference in found if difference.time not in broken]


def broken_times(recorded):
    return {time for time, poses in zip(recorded.times, recorded.poses, strict=True) if not np.isfinite(poses).all()}


def shrunk(seed, features, differs):
    """Leaves out features, in ever smaller portions, as long as differs(features) is true."""
    portion = len(features) // 2
    while portion:
        begin = 0
        while begin < len(features):
            fewer = features[:begin] + features[begin + portion :]
            if differs(fewer):
                features = fewer
            else:
                begin += portion
        portion //= 2
    return features


def differs(seed, features):
    try:
        return bool(differences_of(seed, features))
    except (HasCycle, ValueError):
        return False


def main(first, count):
    cycles = 0
    for seed in range(first, first + count):
        features = features_of(seed)
        try:
            found = differences_of(seed, features)
        except HasCycle as cycle:
            cycles += 1
            print("seed", seed, "has a cycle:", cycle.__cause__)
            continue
        if found:
            print("seed", seed, "differs:", *found[:3], sep="\n  ")
            for feature in shrunk(seed, features, functools.partial(differs, seed)):
                print("  needs", feature)
    print(f"{count} rigs, {cycles} with cycles")


if __name__ == "__main__" and "--" in sys.argv:
    main(*map(int, sys.argv[sys.argv.index("--") + 1 :]))
