"""Whatever is edited of the animation of a rig that is computed, poses that follow are kept or lost as in Blender. The
second character of the cast, with the same edits, stays live. The edits are generated from what Blender's API says of
F-curves, keyframes, their modifiers, drivers and strips."""

import bpy
import numpy as np
import pytest

from helpers import addon_module, needs_memory, needs_rig_programs, select
from test_accelerated_rigs import accelerate, keep_live, wait
from test_played import Cast, layer
from test_played_who import both

pytestmark = [needs_rig_programs, needs_memory]
NOW, OTHER = 3, 8
HAS_SLOTS = bpy.app.version >= (4, 4, 0)
NOT_COVERED = "NOISE", "SMOOTH"  # by rig programs: modifiers of curves


class Animated(Cast):
    """Two characters with keyframes also of an influence and of a custom property, drivers that read that and another
    property, and in a muted track a clip that neither plays."""

    def make(self):
        found = super().make()
        armature = found[0]
        armature["level"] = 0.3
        for frame, value in ((1, 0.2), (6, 0.9), (10, 0.4)):
            armature["level"] = value
            armature.keyframe_insert('["level"]', frame=frame)
        copied = armature.pose.bones["side"].constraints.new("COPY_ROTATION")
        copied.target, copied.subtarget = armature, "bone2"
        for frame, copied.influence in ((1, 0.1), (10, 0.8)):
            copied.keyframe_insert("influence", frame=frame)
        armature["free"] = 0.2
        for name, bone in (("free", "bone0"), ("level", "bone4")):
            driver = armature.pose.bones[bone].driver_add("location", 0).driver
            driver.expression = f"{name} * 2"
            variable = driver.variables.new()
            variable.name, variable.targets[0].id, variable.targets[0].data_path = name, armature, f'["{name}"]'
        track = armature.animation_data.nla_tracks.new()
        track.mute = True
        add_strip(track, armature.animation_data.action.copy())
        return found


def add_strip(track, action):
    strip = track.strips.new("Strip", 1, action)
    if HAS_SLOTS:
        strip.action_slot = action.slots[0]
    return strip


@pytest.fixture
def make_native(fresh_scene, monkeypatch):
    """A function that makes both characters, prepares them, and has the first one computed."""
    monkeypatch.setattr(addon_module("played.accelerating"), "LEAST_WORK", 0)
    fresh_scene.frame_start, fresh_scene.frame_end = 1, 10

    def made(prepare):
        cast = Animated(fresh_scene)
        keep_live(cast)
        for armature, *_ in both(cast):
            prepare(armature)
        cast.play([1, OTHER, NOW])
        accelerate(cast)
        return cast

    return made


def curves_of(armature):
    return addon_module("blender.animation").slot_curves(armature)


def curve_of(armature):
    return next(each for each in curves_of(armature) if each.data_path == 'pose.bones["bone1"].location')


def driver_of(armature):
    return armature.animation_data.drivers[-1]


def strip_of(armature):
    return armature.animation_data.nla_tracks[-1].strips[0]


# --- the edits ------------------------------------------------------------------------------------


def others_of(struct, rna):
    """Returns other values of a property; none if it cannot be set, or is where Blender notes what it could not
    evaluate."""
    value = getattr(struct, rna.identifier)
    if rna.is_readonly or rna.identifier == "is_valid" or rna.type in ("POINTER", "COLLECTION"):
        return []
    if rna.type == "BOOLEAN":
        return [not value] if not rna.is_array else []
    if rna.type == "ENUM":
        return [] if rna.is_enum_flag else [item.identifier for item in rna.enum_items if item.identifier != value]
    if rna.type == "STRING":
        return {"data_path": ['pose.bones["bone3"].location'], "expression": ["level - 1", "1"]}.get(
            rna.identifier, [value + "x"]
        )
    step = 1 if rna.type == "INT" else 0.4
    return [tuple(each + step for each in value) if rna.is_array else value + step]


def set_to(find, name, value):
    def edit(armature):
        setattr(find(armature), name, value)

    return edit


def settings_of(name, find, sample):
    """Yields (name, edit) for each other value of all settings of a struct. find: a function that returns it; sample:
    one such struct."""
    for rna in sample.bl_rna.properties:
        for value in others_of(sample, rna):
            if can_be(sample, rna.identifier, value):
                yield f"{name}.{rna.identifier}={value}", set_to(find, rna.identifier, value)


def can_be(struct, name, value):
    before = getattr(struct, name)
    try:
        setattr(struct, name, value)
    except (TypeError, ValueError, AttributeError):
        return False
    is_set = getattr(struct, name) != before
    setattr(struct, name, before)
    return is_set


def point_of(armature):
    return curve_of(armature).keyframe_points[1]


def modifier_of(armature):
    return curve_of(armature).modifiers[0]


def nothing(_armature):
    pass


def with_modifier(kind):
    def edit(armature):
        curve_of(armature).modifiers.new(kind)
        armature.animation_data.action.update_tag()  # which Blender 4.3 does not do

    return edit


def with_strips(armature):
    data = armature.animation_data
    action, data.action = data.action, None
    add_strip(data.nla_tracks.new(), action)


def samples():
    """Returns (a curve with a keyframe, a driver, {kind: an F-curve's modifier}, a strip, its track, animation data),
    as Blender makes them."""
    action = bpy.data.actions.new("Action")
    ob = bpy.data.objects.new("Object", None)
    ob.keyframe_insert("location", index=0, frame=1)
    curve = addon_module("blender.animation").slot_curves(ob)[0]
    kinds = {item.identifier for item in bpy.types.FModifier.bl_rna.properties["type"].enum_items} - {"NULL"}
    modifiers = {kind: curve.modifiers.new(kind) for kind in sorted(kinds)}  # Cycles has to be the first
    driver = ob.driver_add("location", 1)
    driver.driver.variables.new()
    track = ob.animation_data.nla_tracks.new()
    return curve, driver, modifiers, track.strips.new("Strip", 1, action), track, ob.animation_data


def generated():
    """Yields (name, preparation of a character before it is computed, edit)."""
    curve, driver, modifiers, strip, track, data = samples()
    for name, edit in (
        *settings_of("curve", curve_of, curve),
        *settings_of("key", point_of, curve.keyframe_points[0]),
        *settings_of("driver's curve", driver_of, driver),
        *settings_of("driver", lambda armature: driver_of(armature).driver, driver.driver),
        *settings_of("variable", lambda armature: driver_of(armature).driver.variables[0], driver.driver.variables[0]),
        *settings_of("data", lambda armature: armature.animation_data, data),
        *settings_of("muted track", lambda armature: armature.animation_data.nla_tracks[0], track),
        *settings_of("muted strip", strip_of, strip),
    ):
        yield name, nothing, edit
    for kind, modifier in modifiers.items():
        yield f"new {kind}", nothing, with_modifier(kind)
        for name, edit in settings_of(kind, modifier_of, modifier) if kind not in NOT_COVERED else ():
            yield name, with_modifier(kind), edit
    for name, edit in (
        *settings_of("strip", strip_of, strip),
        *settings_of("track", lambda armature: armature.animation_data.nla_tracks[-1], track),
    ):
        yield name, with_strips, edit


def move_a_key(armature):
    point_of(armature).co.y += 0.5
    curve_of(armature).update()


def move_all_keys(armature):
    curve = curve_of(armature)
    points = np.empty(2 * len(curve.keyframe_points), np.float32)
    curve.keyframe_points.foreach_get("co", points)
    curve.keyframe_points.foreach_set("co", points * np.float32(1.1))


def insert_a_key(armature):
    curve_of(armature).keyframe_points.insert(NOW, 2)


def add_a_key(armature):
    curve_of(armature).keyframe_points.add(1)


def remove_a_key(armature):
    curve = curve_of(armature)
    curve.keyframe_points.remove(curve.keyframe_points[1])


def clear_keys(armature):
    curve_of(armature).keyframe_points.clear()


def sample_keys(armature):
    curve_of(armature).convert_to_samples(1, 10)


def key_a_bone(armature):
    armature.pose.bones["bone1"].keyframe_insert("location", frame=NOW)


def key_a_pose(armature):
    armature.pose.bones["bone1"].location.y += 0.5
    armature.pose.bones["bone1"].keyframe_insert("location", frame=NOW)


def key_another_frame(armature):
    armature.pose.bones["bone1"].location.y += 0.5
    armature.pose.bones["bone1"].keyframe_insert("location", frame=OTHER)


def key_another_channel(armature):
    armature.pose.bones["bone1"].keyframe_insert("scale", frame=OTHER)


def delete_a_key(armature):
    armature.pose.bones["bone1"].keyframe_delete("location", frame=4)


def delete_all_keys(armature):
    for frame in (1, 4, 7, 10):
        armature.pose.bones["bone1"].keyframe_delete("location", frame=frame)


def collection_of(armature):
    action = armature.animation_data.action
    return action.layers[0].strips[0].channelbags[0].fcurves if HAS_SLOTS else action.fcurves


def remove_a_curve(armature):
    collection_of(armature).remove(curve_of(armature))


def add_a_curve(armature):
    collection_of(armature).new('pose.bones["bone3"].rotation_euler', index=1).keyframe_points.insert(5, 2)


def clear_animation(armature):
    armature.animation_data_clear()


def unassign_action(armature):
    armature.animation_data.action = None


def remove_action(armature):
    bpy.data.actions.remove(armature.animation_data.action or strip_of(armature).action)


def copy_action(armature):
    data = armature.animation_data
    data.action = data.action.copy()
    if HAS_SLOTS:
        data.action_slot = data.action.slots[0]


def unassign_slot(armature):
    if HAS_SLOTS:
        armature.animation_data.action_slot = None


def tag_action(armature):
    armature.animation_data.action.update_tag()


def rename_a_bone(armature):
    armature.pose.bones["bone1"].name = "renamed"


def rename_a_bone_and_back(armature):
    armature.data.bones["bone1"].name = "renamed"
    armature.data.bones["renamed"].name = "bone1"


def remove_a_driver(armature):
    armature.driver_remove('pose.bones["bone4"].location', 0)


def remove_a_driver_quietly(armature):
    armature.animation_data.drivers.remove(driver_of(armature))


def add_a_driver(armature):
    armature.pose.bones["bone3"].driver_add("location", 1).driver.expression = "0.7"


def add_a_variable(armature):
    driver_of(armature).driver.variables.new()


def key_a_driver(armature):
    driver_of(armature).keyframe_points.insert(0, 0)
    driver_of(armature).keyframe_points.insert(1, 4)


def move_a_key_of_the_clip(armature):
    action = armature.animation_data.nla_tracks[0].strips[0].action
    curve = addon_module("blender.animation").action_curves(action)[0]
    curve.keyframe_points[0].co.y += 1
    curve.update()


def play_the_clip(armature):
    armature.animation_data.nla_tracks[0].mute = False


def remove_the_track(armature):
    armature.animation_data.nla_tracks.remove(armature.animation_data.nla_tracks[0])


def remove_the_strip(armature):
    track = armature.animation_data.nla_tracks[0]
    track.strips.remove(track.strips[0])


def add_a_track(armature):
    add_strip(armature.animation_data.nla_tracks.new(), armature.animation_data.action.copy())


def push_down(armature):
    with_strips(armature)


def set_a_property_without_a_tag(armature):
    armature["free"] += 0.3


def set_a_property(armature):
    armature["free"] += 0.3
    armature.update_tag()


OWN = [
    *(move_a_key, move_all_keys, insert_a_key, add_a_key, remove_a_key, clear_keys, sample_keys),
    *(key_a_bone, key_a_pose, key_another_frame, key_another_channel, delete_a_key, delete_all_keys),
    *(remove_a_curve, add_a_curve, clear_animation, unassign_action, remove_action, copy_action, unassign_slot),
    *(tag_action, rename_a_bone, rename_a_bone_and_back, remove_a_driver, remove_a_driver_quietly, add_a_driver),
    *(add_a_variable, key_a_driver, move_a_key_of_the_clip, play_the_clip, remove_the_track, remove_the_strip),
    *(add_a_track, push_down, set_a_property_without_a_tag, set_a_property),
]


def move_a_key_of_the_strip(armature):
    curve = addon_module("blender.animation").action_curves(strip_of(armature).action)[4]
    curve.keyframe_points[1].co.y += 0.5
    curve.update()


def key_the_strip(armature):
    action = strip_of(armature).action
    curve = addon_module("blender.animation").action_curves(action)[4]
    curve.keyframe_points.insert(NOW, 2)


OF_STRIPS = [move_a_key_of_the_strip, key_the_strip, clear_animation, remove_action, remove_the_track]
EDITS = [(edit.__name__, nothing, edit) for edit in OWN]
EDITS += [(f"{edit.__name__}, strips", with_strips, edit) for edit in OF_STRIPS]


# --- what follows ---------------------------------------------------------------------------------

NUMBERS = "location", "rotation_quaternion", "rotation_euler", "scale"


def channels_of(armature):
    """What the originals have."""
    found = [getattr(bone, name) for bone in armature.pose.bones for name in NUMBERS]
    influence = armature.pose.bones["side"].constraints[0].influence
    return [*(number for each in found for number in each), armature["level"], influence]


class Played:
    """A cast after an edit of both."""

    def __init__(self, cast):
        self.cast, self.moved = cast, 0

    def pose(self):
        """Poses a bone with keyframes, and a channel without."""
        self.moved += 1
        for armature, *_ in both(self.cast):
            bone = next(each for each in armature.pose.bones if each.name in ("bone1", "renamed"))
            bone.location.x += self.moved
            armature.pose.bones["bone2"].scale.y += 0.1

    def update(self):
        layer().update()
        self.compare()

    def frame(self, number):
        self.cast.scene.frame_set(number)
        self.compare()

    def compare(self):
        self.cast.assert_same()
        ours, theirs = (channels_of(each[0]) for each in both(self.cast))
        assert ours == theirs


def same_update(played):
    played.pose()
    played.update()
    played.pose()
    played.update()


def next_update(played):
    played.update()
    for _ in range(3):
        played.pose()
        played.update()


def next_frame(played):
    played.frame(NOW + 1)
    played.pose()
    played.update()
    played.frame(NOW + 2)


def another_frame(played):
    played.update()
    played.pose()
    played.update()
    played.frame(OTHER)
    played.pose()
    played.update()
    played.pose()
    played.update()


def later(played):
    """Relations are built anew."""
    played.update()
    played.pose()
    played.update()
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("New", None))
    played.update()
    played.pose()
    played.update()


THEN = [same_update, next_update, next_frame, another_frame, later]


def cases(edits):
    edits = list(edits)
    return pytest.mark.parametrize("prepare, edit", [each[1:] for each in edits], ids=[each[0] for each in edits])


@pytest.mark.sampled(3)
@pytest.mark.parametrize("then", THEN)
@cases(EDITS)
def test_a_pose_after_an_edit(make_native, prepare, edit, then):
    assert_like_blender(make_native(prepare), edit, then)


@cases(EDITS)
def test_an_edit_after_a_pose(make_native, prepare, edit):
    cast = make_native(prepare)
    played = Played(cast)
    played.pose()
    played.update()
    edit_both(cast, edit)
    next_update(played)
    played.frame(OTHER)
    wait(cast)
    played.frame(5)


@pytest.mark.sampled(3)
@pytest.mark.parametrize("then", (same_update, another_frame))
@cases(generated())
def test_a_pose_after_any_setting(make_native, prepare, edit, then):
    assert_like_blender(make_native(prepare), edit, then)


def edit_both(cast, edit):
    for armature, *_ in both(cast):
        edit(armature)


def assert_like_blender(cast, edit, then):
    played = Played(cast)
    assert cast.rig.is_played
    edit_both(cast, edit)
    then(played)
    played.frame(2)
    played.frame(OTHER)
    wait(cast)
    played.frame(5)
    played.pose()
    played.update()


# --- settings of bones that are other data-blocks or bones ----------------------------------------


def pointers():
    """Returns (collection of bones, name, what it is) of the settings of bones that are no numbers."""
    kinds = ("pose", bpy.types.PoseBone), ("data", bpy.types.Bone)
    return [
        (where, rna.identifier, rna.fixed_type.identifier)
        for where, kind in kinds
        for rna in kind.bl_rna.properties
        if rna.type == "POINTER" and not rna.is_readonly
    ]


def with_a_custom_handle(armature):
    bones = armature.data.bones
    bones["bone1"].bbone_handle_type_start = bones["bone1"].bbone_handle_type_end = "ABSOLUTE"
    bones["bone1"].bbone_custom_handle_start, bones["bone1"].bbone_custom_handle_end = bones["bone0"], bones["bone2"]


@pytest.mark.parametrize("then", THEN)
@pytest.mark.parametrize("where, name, kind", pointers())
def test_a_pose_after_an_edit_of_what_a_bone_uses(make_native, where, name, kind, then):
    shape = bpy.data.objects.new("Shape", None)

    def edit(armature):
        bones = getattr(armature, where).bones
        value = {"Object": shape, "PoseBone": bones["side"], "Bone": bones["side"]}[kind]
        setattr(bones["bone1"], name, value)

    assert_like_blender(make_native(with_a_custom_handle), edit, then)


# --- constraints whose bone has gone --------------------------------------------------------------


def follow_a_goal(kind):
    """Returns a function that adds a bone, and a constraint that follows it."""

    def prepare(armature):
        select(armature)
        bpy.ops.object.mode_set(mode="EDIT")
        goal = armature.data.edit_bones.new("goal")
        goal.head, goal.tail = (1, 2, 3), (1, 3, 3)
        bpy.ops.object.mode_set(mode="OBJECT")
        select()
        constraint = armature.pose.bones["bone4"].constraints.new("IK" if kind == "POLE" else kind)
        constraint.target, constraint.subtarget = armature, "goal"
        if constraint.type == "IK":
            constraint.chain_count = 2
        if kind == "POLE":
            constraint.subtarget, constraint.pole_target, constraint.pole_subtarget = "side", armature, "goal"

    return prepare


def remove_the_goal(armature):
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    armature.data.edit_bones.remove(armature.data.edit_bones["goal"])
    bpy.ops.object.mode_set(mode="OBJECT")
    select()


FOLLOWING = [
    *("COPY_LOCATION", "COPY_ROTATION", "COPY_SCALE", "COPY_TRANSFORMS", "TRANSFORM", "CHILD_OF", "PIVOT", "FLOOR"),
    *("DAMPED_TRACK", "LOCKED_TRACK", "TRACK_TO", "STRETCH_TO", "LIMIT_DISTANCE", "POLE"),
]


@pytest.mark.parametrize(
    "kind, space", [*((kind, "WORLD") for kind in FOLLOWING), *((kind, "LOCAL") for kind in FOLLOWING[:-1])]
)
def test_a_bone_that_a_constraint_follows_is_removed(make_native, kind, space):
    """Blender follows the armature object instead."""

    def prepare(armature):
        follow_a_goal(kind)(armature)
        armature.pose.bones["bone4"].constraints[0].target_space = space

    cast = make_native(prepare)
    played = Played(cast)
    edit_both(cast, remove_the_goal)
    next_update(played)
    played.frame(OTHER)
    accelerate(cast)
    played.frame(5)
    next_update(played)
    played.frame(OTHER)


def test_ik_whose_bone_was_removed_is_refused_by_name(make_native):
    cast = make_native(follow_a_goal("IK"))
    edit_both(cast, remove_the_goal)
    next_update(Played(cast))
    Played(cast).frame(OTHER)
    wait(cast)
    assert not cast.rig.is_idle and "the bone goal that it follows is not there" in cast.rig.reason
    cast.play()
