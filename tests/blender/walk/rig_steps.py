"""What animators and riggers edit of an armature: actions, tracks, curves, constraints, drivers, settings of bones."""

import contextlib

import bpy

from helpers import addon_module, select

from . import scene
from .kinds import kind
from .object_steps import MOST_PAIRS

ACTION = "Rig"  # how those of armatures begin
AHEAD = "IK", "COPY_LOCATION", "COPY_SCALE", "STRETCH_TO", "TRACK_TO", "LIMIT_ROTATION", "COPY_TRANSFORMS"


def on_rig(weight):
    """Declares function(random, armature), called in Object Mode for one with bones."""

    def declare(function):
        def step(random):
            scene.leave_modes()
            found = [each for each in scene.armatures() if len(each.pose.bones)]
            if not found:
                return None
            armature = random.choice(found)
            return f"{armature.name}: {function(random, armature)}"

        step.__name__ = function.__name__
        return kind(weight)(step)

    return declare


def actions():
    return [each for each in bpy.data.actions if each.name.startswith(ACTION)]


def _assign(data, action):
    with contextlib.suppress(RuntimeError):  # before 4.4 Blender refuses some
        data.action = action


@on_rig(2)
def change_action(random, armature):
    data = armature.animation_data_create()
    what = random.choice(
        ("copy", "other", "push down", "push down", "mute", "mute", "solo", "pull up", "pull up", "none")
    )
    if data.action is None and not data.nla_tracks:
        what = "give"
        _assign(data, random.choice(actions() or [None]))
    elif what == "copy" and data.action is not None:
        data.action = data.action.copy()
    elif what == "none":
        data.action = None
    elif what == "other":
        _assign(data, random.choice(actions() or [None]))
    elif what == "push down" and data.action is not None:
        track = data.nla_tracks.new()
        strip = track.strips.new("Strip", random.choice((1, 1, 4)), data.action)
        strip.influence, data.action = random.choice((1, 1, 0.5)), None
    elif what == "pull up" and data.nla_tracks:
        track = data.nla_tracks[0]
        data.action = track.strips[0].action if track.strips else None
        data.nla_tracks.remove(track)
    elif what in ("mute", "solo") and data.nla_tracks:
        track = random.choice(data.nla_tracks)
        name = {"mute": "mute", "solo": "is_solo"}[what]
        setattr(track, name, not getattr(track, name))
    return what


@on_rig(2)
def change_strip(random, armature):
    """Of the NLA."""
    data = armature.animation_data
    strips = [strip for track in data.nla_tracks for strip in track.strips] if data is not None else []
    if not strips:
        return None
    strip = random.choice(strips)
    name, values = random.choice(
        (
            ("blend_type", ("REPLACE", "COMBINE", "ADD", "SUBTRACT", "MULTIPLY")),
            ("extrapolation", ("HOLD", "HOLD_FORWARD", "NOTHING")),
            ("frame_start", (1, 3, 6)),
            ("scale", (0.5, 1, 1.6)),
            ("repeat", (1, 2)),
            ("use_reverse", (True, False)),
            ("mute", (True, False)),
            ("blend_in", (0, 4)),
            ("blend_out", (0, 3)),
            ("use_animated_influence", (True, False)),
            ("influence", (0.3, 0.8)),
        )
    )
    setattr(strip, name, random.choice(values))
    return f"{name} of {strip.name}"


@on_rig(2)
def change_curve(random, armature):
    return edit_curve(random, armature)


def edit_curve(random, armature):
    curves = addon_module("blender.animation").slot_curves(armature)
    if not curves:
        return None
    curve = random.choice(curves)
    what = random.choice(("mute", "modifier", "extrapolation", "interpolation", "group", "insert", "remove"))
    if what == "mute":
        curve.mute = not curve.mute
    elif what == "modifier" and curve.modifiers:
        curve.modifiers.remove(curve.modifiers[0])
    elif what == "modifier":
        curve.modifiers.new(random.choice(("CYCLES", "NOISE", "STEPPED", "GENERATOR", "LIMITS", "FNGENERATOR")))
    elif what == "extrapolation":
        curve.extrapolation = random.choice(("CONSTANT", "LINEAR"))
    elif what == "interpolation":
        for key in curve.keyframe_points:
            key.interpolation = random.choice(("CONSTANT", "LINEAR", "BEZIER", "BOUNCE"))
        curve.update()
    elif what == "group" and curve.group is not None:
        curve.group.mute = not curve.group.mute
    elif what == "insert":
        curve.keyframe_points.insert(random.randint(1, scene.LAST_FRAME), random.uniform(-0.5, 1))
    elif what == "remove":
        if len(curve.keyframe_points) > 1:
            curve.keyframe_points.remove(curve.keyframe_points[-1])
    curve.id_data.update_tag()  # Blender notices some of these at the next change of the frame only
    return f"{what} {curve.data_path}"


@on_rig(2)
def change_curve_then_pose(random, armature):
    what = edit_curve(random, armature)
    bpy.context.view_layer.update()
    return f"{what}, then {pose_that_stays(random, armature)}"


@on_rig(1)
def script_on_each_frame(random, armature):
    """Poses, and at times sets a key, as scripts do that write a motion down."""
    said, sets_keys = [], random.random() < 0.5
    first = random.randint(1, scene.LAST_FRAME - 5)
    for frame in range(first, first + random.randint(2, 5)):
        bpy.context.scene.frame_set(frame)
        name = pose_that_stays(random, armature)
        if name and sets_keys:
            armature.pose.bones[name].keyframe_insert("location")
        said.append(name)
    return f"{said} {sets_keys}"


def pose_that_stays(random, armature):
    """Moves a bone by hand: keyframes set it on the next frame, not before. Returns its name."""
    drivers = armature.animation_data.drivers if armature.animation_data else ()
    driven = {driver.data_path for driver in drivers}
    free = [bone for bone in armature.pose.bones if f'pose.bones["{bone.name}"].location' not in driven]
    if not free or armature.library or armature.override_library:
        return None
    bone = random.choice(free)
    bone.location = [random.uniform(-0.3, 0.3) for _ in range(3)]
    wanted = bone.location.copy()
    bpy.context.view_layer.update()
    assert bone.location == wanted, f"the pose of {bone.name} of {armature.name} was lost"
    return bone.name


@on_rig(2.5)
def change_constraint(random, armature):
    """Of any bone; a new one on the side, which no other bone follows."""
    found = [(bone, each) for bone in armature.pose.bones for each in bone.constraints]
    side = armature.pose.bones.get("side")
    if side is not None and (not found or random.random() < 0.3):
        new = side.constraints.new(random.choice(AHEAD))
        if new.type == "IK":
            new.chain_count = 1
        if hasattr(new, "target"):
            new.target = armature
            new.subtarget = random.choice(
                [bone.name for bone in armature.pose.bones if side not in scene.followed_by(bone)] or [""]
            )
        return f"new {new.type}"
    if not found:
        return None
    bone, each = random.choice(found)
    what = random.choice(("influence", "mute", "key", "space", "move", "remove"))
    if what == "influence":
        each.influence = random.random()
    elif what == "mute":
        each.mute = not each.mute
    elif what == "key":
        for frame in (1, 12):
            each.influence = random.random()
            each.keyframe_insert("influence", frame=frame)
    elif what == "space" and each.type.startswith("COPY"):
        chosen = {name: random.choice(("WORLD", "POSE", "LOCAL")) for name in ("owner_space", "target_space")}
        for name, value in chosen.items():
            with contextlib.suppress(TypeError):  # of what is no bone, there is no POSE
                setattr(each, name, value)
    elif what == "move":
        bone.constraints.move(len(bone.constraints) - 1, 0)
    elif what == "remove":
        bone.constraints.remove(each)
    return f"{what} of {bone.name}"


@on_rig(2)
def drive_bone(random, armature):
    """By a channel of its root, by a property, which is keyed, or by a moving object; or no longer."""
    bones = armature.pose.bones
    bone, root = bones[-1], bones[0]
    if random.random() < 0.3:
        return bone.driver_remove("location")
    driver = bone.driver_add("location", random.randrange(3)).driver
    driver.type, variable = random.choice(("SUM", "MAX", "SCRIPTED")), driver.variables.new()
    driver.expression, path = f"2 * {variable.name} + 0.1", root.path_from_id("location") + "[1]"
    if random.random() < 0.6:
        armature["number"], path = random.random(), '["number"]'
        for frame in (1, 12):
            armature["number"] = random.random()
            armature.keyframe_insert(path, frame=frame)
    block, target = armature, bpy.data.objects.get(random.choice(("Target 1", "Target 2")))
    if target is not None and random.random() < 0.5:
        block, path = target, random.choice(("location.y", "rotation_euler[2]", '["number"]', ""))
        if path == '["number"]':
            for frame in (1, 12):
                target["number"] = random.random()
                target.keyframe_insert(path, frame=frame)
        elif not path:
            variable.type = "TRANSFORMS"
            variable.targets[0].transform_type = random.choice(("LOC_X", "ROT_Y", "SCALE_AVG"))
    variable.targets[0].id, variable.targets[0].data_path = block, path
    return f"{bone.name} by {path or variable.targets[0].transform_type} of {block.name}"


@on_rig(2)
def change_bone(random, armature):
    bone = random.choice(armature.pose.bones)
    what = random.choice(("mode", "inherit", "turn", "local", "shape", "handles", "keyed mode", "hide"))
    if what == "mode":
        bone.rotation_mode = random.choice(("QUATERNION", "XYZ", "ZYX", "AXIS_ANGLE"))
    elif what == "inherit":
        bone.bone.inherit_scale = random.choice(("FULL", "NONE", "ALIGNED", "AVERAGE", "FIX_SHEAR", "NONE_LEGACY"))
    elif what == "turn":
        bone.bone.use_inherit_rotation = not bone.bone.use_inherit_rotation
    elif what == "local":
        bone.bone.use_local_location = not bone.bone.use_local_location
    elif what == "shape":
        bone.custom_shape = None if bone.custom_shape else bpy.data.objects.get("Target 1")
    elif what == "handles":
        bone.bone.bbone_segments, bone.bone.bbone_handle_type_start = 3, random.choice(("AUTO", "ABSOLUTE"))
        bone.bbone_curveinx, bone.bbone_scalein = random.random(), scene.some(random, 1)
    elif what == "keyed mode":
        bone.keyframe_insert("rotation_mode", frame=random.randint(1, scene.LAST_FRAME))
    elif what == "hide":
        bone.bone.hide = not bone.bone.hide
    return f"{what} of {bone.name}"


@on_rig(1)
def follow_other_rig(random, armature):
    """As a rider follows a horse."""
    others = [each for each in scene.armatures() if each != armature and len(each.pose.bones)]
    chain = addon_module("blender.dependencies").chain
    others = [each for each in others if armature not in chain(each)]
    if others and len(chain(armature)) < 3:
        constraint = armature.pose.bones[0].constraints.new(
            random.choice(("CHILD_OF", "COPY_LOCATION", "DAMPED_TRACK"))
        )
        constraint.target = random.choice(others)
        constraint.subtarget = random.choice(constraint.target.pose.bones).name
    return chain(armature)


@on_rig(1)
def parent_armature(random, armature):
    others = [
        each for each in scene.armatures() if armature not in addon_module("blender.dependencies").with_parents([each])
    ]
    armature.parent = random.choice([None, bpy.data.objects.get("Target 2"), *others])
    return armature.parent and armature.parent.name


@on_rig(1.5)
def move_armature(random, armature):
    """As a whole, with keyframes or by hand."""
    what = random.choice(("key", "key", "key here", "by hand", "unkey", "shift"))
    if what == "key":
        for frame in (1, 8, 15):
            armature.location, armature.rotation_euler = scene.some(random, 1), scene.some(random, 1)
            if random.random() < 0.3:
                armature.scale = [random.choice((-1, 1)) * random.uniform(0.5, 2) for _ in range(3)]
            for name in ("location", "rotation_euler", "scale"):
                armature.keyframe_insert(name, frame=frame)
    elif what == "unkey":
        with contextlib.suppress(RuntimeError):  # it has no such keyframe
            armature.keyframe_delete("location", frame=8)
    elif what == "shift":
        armature.delta_location = scene.some(random, 0.5)
    else:
        armature.location = scene.some(random, 2)
        if what == "key here":
            armature.keyframe_insert("location")
    scene.take_keyframes()
    return what


@on_rig(1)
def duplicate_armature(_random, armature):
    """Alone, to be given to a mesh later."""
    if len(scene.armatures()) < 3 and armature.visible_get():
        select(armature)
        bpy.ops.object.duplicate()
        bpy.context.object.name = scene.next_name("Rig ")
        return bpy.context.object.name
    return None


@kind(2)
def change_selection(random):
    scene.leave_modes()
    objects = [each for each in bpy.context.view_layer.objects if each.visible_get() and random.random() < 0.3]
    scene.make_active(*objects)


@kind(1)
def change_tempo(random):
    settings = bpy.context.scene.render
    what = random.choice(("fps", "range", "map", "map back", "map back"))
    if what == "fps":
        settings.fps = random.choice((24, 30))
    elif what == "range":
        bpy.context.scene.frame_end = random.choice((scene.LAST_FRAME, 8, 250))
    else:
        settings.frame_map_new = 200 if what == "map" else settings.frame_map_old
        bpy.context.scene.frame_set(bpy.context.scene.frame_current)
    return what


@kind(1.5)
def play_between_frames(random):
    for _ in range(random.choice((1, 2, 3))):
        bpy.context.scene.frame_set(random.randint(1, scene.LAST_FRAME), subframe=random.choice((0, 0.5, 0.25)))


@kind(0.5)
def append_characters(random):
    """Copies of one, its twin and their armatures, from another file."""
    scene.leave_modes()
    found = scene.pairs()
    if not found or len(found) >= MOST_PAIRS or len(scene.armatures()) > 3:
        return None
    name, pair = scene.next_name(scene.OURS), random.choice(found)
    path = bpy.app.tempdir + f"library {random.randrange(10**6)}.blend"
    bpy.data.libraries.write(path, set(pair))
    before = set(bpy.data.objects)
    with bpy.data.libraries.load(path) as (_, to):
        to.objects = [ob.name for ob in pair]
    for ob, new in zip(to.objects, (name, scene.twin_name(name))):
        bpy.context.scene.collection.objects.link(ob)
        ob.name = new
    for ob in [ob for ob in bpy.data.objects if ob not in before and ob.type == "ARMATURE"]:
        ob.name = scene.next_name("Rig ")
        bpy.context.scene.collection.objects.link(ob)
    return name
