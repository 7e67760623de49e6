"""Rigs whose bones follow other objects that have keyframes, as a hand follows a steering wheel, or a puppet the
empties of a motion capture. The first character of the cast is accelerated; the second one is live and follows the
same."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from characters import constrain, make_armature
from helpers import addon_module, depsgraph, needs_memory, needs_rig_programs, select
from test_accelerated_rigs import accelerating as accelerating
from test_accelerated_rigs import keep_live, recorded, wait
from test_played import FRAMES, Cast, layer, matrices_of, states
from test_played_who import both

pytestmark = [needs_rig_programs, needs_memory]
KEYED = {"location": 3, "rotation_euler": 3, "scale": 3}


def add(armature, kind, on, target, **settings):
    return constrain(armature, on, kind, target=target, **settings)


class Driven(Cast):
    """A cast whose characters hold a wheel on a cart, look at a ball and reach for it."""

    def __init__(self, scene, has_keys):
        super().__init__(scene)
        self.has_keys = has_keys
        self.random = np.random.default_rng(1)
        self.cart, self.wheel, self.ball = (self.new(name) for name in ("Cart", "Wheel", "Ball"))
        self.wheel.parent, self.wheel.matrix_parent_inverse = self.cart, Matrix.Translation((0.5, 0, 1))
        self.ball.rotation_mode = "QUATERNION"
        for frame in (1, 5, 10):
            for ob in self.cart, self.wheel, self.ball:
                self.move(ob, frame)
        for armature, *_ in both(self):
            add(armature, "CHILD_OF", "bone1", self.wheel, inverse_matrix=Matrix.Translation((0, 0, 1)))
            add(armature, "DAMPED_TRACK", "bone2", self.ball, influence=0.5)
            ik = add(armature, "IK", "bone4", self.ball, chain_count=2)
            ik.pole_target, ik.pole_angle = self.wheel, 0.3
            turned = add(armature, "COPY_ROTATION", "side", self.wheel, owner_space="CUSTOM", target_space="CUSTOM")
            turned.space_object = self.cart
            if not has_keys:
                armature.animation_data_clear()
        select()
        scene.frame_set(2)
        scene.frame_set(1)
        keep_live(self)

    def new(self, name):
        ob = bpy.data.objects.new(name, bpy.data.meshes.new(name) if name == "Ball" else None)
        self.scene.collection.objects.link(ob)
        return ob

    def move(self, ob, frame=None):
        """With keyframes on a frame, or by hand."""
        for name, count in KEYED.items():
            setattr(ob, name, self.random.uniform(0.4, 1.6, count))
            if frame is not None:
                ob.keyframe_insert(name, frame=frame)
        ob.rotation_quaternion = self.random.uniform(-1, 1, 4)
        if frame is not None and ob.rotation_mode == "QUATERNION":
            ob.keyframe_insert("rotation_quaternion", frame=frame)

    def accelerate(self):
        wait(self)
        assert self.rig.is_played and self.rig.trial.needs_program, self.rig.reason


@pytest.fixture(params=(True, False), ids=("with keyframes", "without"))
def cast(fresh_scene, monkeypatch, request):
    monkeypatch.setattr(accelerating(), "LEAST_WORK", 0)
    fresh_scene.frame_start, fresh_scene.frame_end = 1, 10
    return Driven(fresh_scene, request.param)


def followed(armature):
    return [
        (each.target, getattr(each, "pole_target", None), each.space_object)
        for bone in armature.pose.bones
        for each in bone.constraints
    ]


def test_it_is_computed(cast):
    before = followed(cast.played[0])
    places = [tuple(ob.location) for ob in (cast.cart, cast.wheel, cast.ball)]
    cast.accelerate()
    assert len(cast.rig.source.compared) > 1
    assert [tuple(ob.location) for ob in (cast.cart, cast.wheel, cast.ball)] == places
    shapes = cast.play([*FRAMES, 3, -7, 400, 5])
    cast.scene.frame_set(4, subframe=0.5)
    cast.assert_same()
    assert cast.rig.is_played and np.ptp(shapes, axis=0).max() > 0.1
    assert followed(cast.played[0]) == before == followed(cast.live[0])


def assert_blender_evaluates_no_bones(cast, monkeypatch):
    """While Sinew writes none."""
    cast.accelerate()
    cast.scene.frame_set(4)
    copy = cast.played[0].evaluated_get(depsgraph())
    monkeypatch.setattr(addon_module("played.playing"), "_has_work", lambda: False)
    before = np.array([bone.matrix for bone in copy.pose.bones])
    cast.scene.frame_set(9)
    assert np.array_equal([bone.matrix for bone in copy.pose.bones], before)


def test_blender_does_not_evaluate_its_bones_again(cast, monkeypatch):
    """What it follows moves on each frame: bones that Blender evaluated because of that would be others."""
    assert_blender_evaluates_no_bones(cast, monkeypatch)


def test_a_copy_that_blender_makes_meanwhile_follows_it_all_the_same(cast, monkeypatch):
    """Blender copies the armature while relations are built without what it follows, and evaluates that copy when it
    builds them again."""
    relations = addon_module("host.relations")
    tag = relations.tag

    def tag_both():
        cast.played[0].update_tag()
        return tag()

    drive_by(cast, "TRANSFORMS", cast.wheel, transform_type="LOC_Y")
    monkeypatch.setattr(relations, "tag", tag_both)
    cast.accelerate()
    monkeypatch.setattr(relations, "tag", tag)
    cast.scene.frame_set(3)
    bpy.ops.scene.new(type="LINK_COPY")
    bpy.context.window.scene = cast.scene
    layer().update()
    cast.assert_same()
    cast.play([3, 5])


@pytest.mark.parametrize("has_keys", [True, False])
def test_a_child_of_what_follows_it_is_live(cast, has_keys):
    """Blender evaluates its bones whenever it evaluates the parent."""
    for armature, *_ in both(cast):
        parent = make_armature()
        if has_keys:
            parent.pose.bones["side"].keyframe_insert("location", frame=1)
        add(parent, "COPY_ROTATION", "bone3", armature, subtarget="bone2")
        armature.parent = parent
    select()
    cast.scene.frame_set(1)
    wait(cast)
    assert (
        not cast.rig.is_played and "is a child of" in cast.rig.reason and "which follows its bones" in cast.rig.reason
    )
    cast.play(FRAMES)


def drive_by(cast, kind, *blocks, bone="", **settings):
    """A driver of both armatures with a variable that reads these objects. bone: of the armature, in place of the last
    one."""
    for armature, *_ in both(cast):
        driver = armature.pose.bones["bone3"].driver_add("location", 0).driver
        driver.type, variable = "SUM", driver.variables.new()
        variable.type = kind
        for target, block in zip(variable.targets, (*blocks, armature) if bone else blocks):
            target.id = block
            for name, value in settings.items():
                setattr(target, name, value)
        if bone:
            variable.targets[len(blocks)].bone_target = bone
    for frame in (2, 1):
        cast.scene.frame_set(frame)


def with_property(ob, name, numbers, **settings):
    """Gives an object a custom property that keyframes set."""
    for frame, number in zip((1, 4, 9), numbers):
        ob[name] = number
        ob.keyframe_insert(f'["{name}"]', frame=frame)
    ob.id_properties_ui(name).update(**settings)


READ = {
    "where it is": lambda cast: drive_by(cast, "TRANSFORMS", cast.ball, transform_type="LOC_Y"),
    "how it is turned": lambda cast: drive_by(cast, "TRANSFORMS", cast.wheel, transform_type="ROT_Z"),
    "how it is scaled": lambda cast: drive_by(cast, "TRANSFORMS", cast.ball, transform_type="SCALE_AVG"),
    "a quaternion": lambda cast: drive_by(
        cast, "TRANSFORMS", cast.ball, transform_type="ROT_X", rotation_mode="QUATERNION"
    ),
    **{
        f"{name} in {space}": lambda cast, name=name, channel=channel, space=space: drive_by(
            cast, "TRANSFORMS", getattr(cast, name), transform_type=channel, transform_space=space
        )
        for space in ("LOCAL_SPACE", "TRANSFORM_SPACE")
        for name, channel in (("ball", "LOC_X"), ("ball", "ROT_Y"), ("wheel", "LOC_Z"), ("wheel", "ROT_X"))
    },
    "how far it is from another in local space": lambda cast: drive_by(
        cast, "LOC_DIFF", cast.ball, cast.wheel, transform_space="LOCAL_SPACE"
    ),
    "how far it is from another": lambda cast: drive_by(cast, "LOC_DIFF", cast.ball, cast.wheel),
    "the angle to another": lambda cast: drive_by(cast, "ROTATION_DIFF", cast.cart, cast.wheel),
    "a channel": lambda cast: drive_by(cast, "SINGLE_PROP", cast.wheel, data_path="location[1]"),
    "a channel by its letter": lambda cast: drive_by(cast, "SINGLE_PROP", cast.cart, data_path="rotation_euler.z"),
    "a channel of a child": lambda cast: drive_by(cast, "SINGLE_PROP", cast.wheel, data_path="scale.y"),
}
PROPERTIES = {
    "a number": ("size", (0.2, 1.7, 0.4), {}),
    "a number with limits": ("size", (0.2, 1.0, 0.4), {"min": 0.3, "max": 0.8}),
    "a whole number": ("size", (1, 5, 2), {"max": 4}),
    "a switch": ("size", (True, False, True), {}),
    "three numbers": ("sizes", ((0.1, 0.2, 0.3), (0.5, 0.9, 0.2), (0.3, 0.3, 0.3)), {}),
}


def move_and_play_on(cast):
    """What it follows is moved by hand."""
    move(cast)
    layer().update()
    cast.assert_same()
    cast.play([4, 8])
    wait(cast)
    assert cast.rig.is_played, cast.rig.reason


@pytest.mark.parametrize("read", READ)
def test_drivers_read_what_moves(cast, read):
    READ[read](cast)
    cast.accelerate()
    assert np.ptp(cast.play([*FRAMES, 3, -7, 5]), axis=0).max() > 0.1
    for frame in (2, 7):
        cast.scene.frame_set(frame, subframe=0.5)
        cast.assert_same()
    move_and_play_on(cast)
    pose(cast)
    layer().update()
    cast.assert_same()
    cast.play([4, 8])


@pytest.mark.parametrize("kind", PROPERTIES)
def test_drivers_read_properties_that_are_keyed(cast, kind):
    """Of an object that stands still otherwise."""
    panel, (name, numbers, settings) = cast.new("Panel"), PROPERTIES[kind]
    with_property(panel, name, numbers, **settings)
    drive_by(cast, "SINGLE_PROP", panel, data_path=f'["{name}"]' + "[1]" * (kind == "three numbers"))
    cast.accelerate()
    cast.play([*FRAMES, 3, -7, 5])
    cast.scene.frame_set(2, subframe=0.5)
    cast.assert_same()
    curve = addon_module("blender.animation").slot_curves(panel)[-1]
    curve.keyframe_points[1].co.y *= 0.5
    curve.update()
    panel.animation_data.action.update_tag()
    layer().update()
    cast.assert_same()
    cast.play([4, 8, 3])
    wait(cast)
    assert cast.rig.is_played, cast.rig.reason
    panel[name] = numbers[1]
    panel.update_tag()
    layer().update()
    cast.assert_same()
    cast.play([5, 4])


@pytest.mark.parametrize("path", ('["size"]', "location[1]"))
def test_what_drivers_read_gets_keyframes_and_loses_them(cast, path):
    panel = cast.new("Panel")
    panel["size"] = 0.4
    drive_by(cast, "SINGLE_PROP", panel, data_path=path)
    cast.accelerate()
    cast.play([2, 3])
    for frame in (1, 9):
        panel["size"], panel.location.y = frame / 5, frame / 7
        panel.keyframe_insert(path.removesuffix("[1]"), frame=frame)
    layer().update()
    cast.play([4, 5, 9])
    wait(cast)
    assert cast.rig.is_played, cast.rig.reason
    cast.play([3, 8])
    panel.animation_data_clear()
    layer().update()
    cast.play([4, 5])
    wait(cast)
    assert cast.rig.is_played, cast.rig.reason
    cast.play([3, 8])


def key(cast):
    cast.move(cast.wheel, 7)


def edit_a_key(cast):
    curve = addon_module("blender.animation").keyed_curves(cast.cart)[0]
    curve.keyframe_points[1].co.y += 0.4
    curve.update()
    cast.cart.animation_data.action.update_tag()


def move(cast):
    cast.move(cast.ball)


def move_the_parent(cast):
    cast.move(cast.cart)


def let_go(cast):
    cast.wheel.parent = None


def hold(cast):
    """What it follows is constrained from now on."""
    cast.ball.constraints.new("LIMIT_LOCATION").use_max_z = True


def drive(cast):
    cast.wheel.driver_add("scale", 1).driver.expression = "frame / 7"


def remove(cast):
    bpy.data.objects.remove(cast.ball)


def stop(cast):
    cast.wheel.animation_data_clear()


def hide(cast):
    for ob in cast.ball, cast.wheel:
        ob.hide_set(True)


def pose(cast):
    for armature, *_ in both(cast):
        armature.pose.bones["bone1"].location.x += 0.3
        armature.pose.bones["side"].rotation_quaternion = (1, 0.4, 0.2, 0)


def pose_and_move(cast):
    pose(cast)
    move(cast)


def key_a_bone(cast):
    for armature, *_ in both(cast):
        armature.pose.bones["bone1"].location.x += 0.3
        armature.pose.bones["bone1"].keyframe_insert("location", frame=4)


def set_influence(cast):
    for armature, *_ in both(cast):
        armature.pose.bones["bone2"].constraints[0].influence = 0.9


def look_elsewhere(cast):
    for armature, *_ in both(cast):
        armature.pose.bones["bone2"].constraints[0].target = cast.cart


def add_another(cast):
    """Blender builds relations again, with what bones follow."""
    cast.new("Another")


EDITS = (
    add_another,
    *(key, edit_a_key, move, move_the_parent, let_go, hold, drive, remove, stop, hide),
    *(pose, pose_and_move, key_a_bone, set_influence, look_elsewhere),
)
STAYS_LIVE = (hold, drive)


@pytest.mark.parametrize("is_seen", (True, False), ids=("with an update", "without"))
@pytest.mark.parametrize("edit", EDITS)
def test_edits(cast, edit, is_seen):
    cast.accelerate()
    cast.play([3, 4])
    edit(cast)
    if is_seen:
        layer().update()
        cast.assert_same()
    cast.play([5, 4, 9])
    wait(cast)
    assert cast.rig.is_played == (edit not in STAYS_LIVE), cast.rig.reason
    cast.play()
    edit(cast) if edit in (key, move, pose, pose_and_move, key_a_bone) else None
    layer().update()
    cast.assert_same()
    cast.play([2, 8])


def test_posing_by_hand_keeps_it_computed(cast, monkeypatch):
    cast.accelerate()
    cast.play([3, 4])
    built = []
    build = states()._build
    monkeypatch.setattr(states(), "_build", lambda *arguments: built.append(arguments) or build(*arguments))
    for frame in (5, 6, 8):
        pose(cast)
        layer().update()
        cast.assert_same()
        cast.play([frame])
        assert cast.rig.is_played
    assert built == []


@pytest.mark.parametrize("edit", (move, edit_a_key, move_the_parent))
def test_what_it_follows_is_edited_after_it_was_posed(cast, edit):
    """On the same frame, while Blender does not see that bones follow it."""
    cast.accelerate()
    cast.play([3, 4])
    pose(cast)
    layer().update()
    cast.assert_same()
    edit(cast)
    layer().update()
    cast.assert_same()
    cast.play([5, 4])


def test_after_what_it_follows_was_hidden_it_is_not_posed_without_it(cast):
    """Blender may not evaluate what is hidden."""
    cast.accelerate()
    cast.play([3, 4])
    hide(cast)
    cast.play([5, 8])
    pose(cast)
    layer().update()
    cast.assert_same()
    assert not cast.rig.is_idle


def test_undo(cast):
    bpy.ops.ed.undo_push(message="before")
    cast.accelerate()
    cast.play([3, 4])
    bpy.ops.ed.undo_push(message="frame")
    cast.move(cast.wheel)
    layer().update()
    cast.assert_same()
    bpy.ops.ed.undo_push(message="move")
    cast.undo()
    cast.assert_same()
    cast.play([5, 4])


def test_what_was_moved_by_hand_is_not_evaluated_elsewhere_first(cast):
    cast.move(cast.ball)
    layer().update()
    place = tuple(cast.ball.location)
    wait(cast)
    assert not cast.rig.is_played and tuple(cast.ball.location) == place
    assert "Ball, which Rig follows, has changes that are not keyed" in cast.rig.reason
    cast.assert_same()
    cast.play([2, 5])
    cast.accelerate()


def with_constraint(cast):
    cast.wheel.constraints.new("LIMIT_LOCATION")
    return "Wheel has constraints"


def with_driver(cast):
    cast.ball.driver_add("location", 0).driver.expression = "frame / 10"
    return "Location of Ball has a driver"


def in_a_hand(cast):
    cast.ball.parent, cast.ball.parent_type, cast.ball.parent_bone = make_armature(), "BONE", "bone3"
    return "Ball is a child of a part of"


def with_strips(cast):
    data = cast.ball.animation_data
    data.nla_tracks.new().strips.new("strip", 1, data.action)
    data.action = None
    return "Ball is animated by NLA strips"


def with_mode(cast):
    cast.ball.keyframe_insert("rotation_mode", frame=1)
    return "Rotation Mode of Ball is keyed"


def hidden(cast):
    cast.ball.hide_set(True)
    return "Ball is hidden"


def read_in_another_way(cast):
    drive_by(cast, "SINGLE_PROP", cast.ball, data_path="dimensions[0]")
    return "Rig follows Ball, which may move"


def read_beside_a_bone(cast):
    drive_by(cast, "LOC_DIFF", cast.ball, bone="bone0")
    return "reads it together with something else"


REASONS = (
    read_beside_a_bone,
    *(with_constraint, with_driver, in_a_hand, with_strips, with_mode, hidden),
    read_in_another_way,
)


@pytest.mark.parametrize("kind", ("COPY_LOCATION", "COPY_ROTATION", "COPY_SCALE", "COPY_TRANSFORMS", "TRANSFORM"))
def test_constraints_in_local_space(cast, kind):
    for armature, *_ in both(cast):
        for target in cast.ball, cast.wheel:
            constraint = add(armature, kind, "bone3", target, target_space="LOCAL", influence=0.5)
        if kind == "TRANSFORM":
            constraint.from_max_x, constraint.to_max_x, constraint.to_max_y = 1.5, 2, 3
    cast.scene.frame_set(2)
    cast.accelerate()
    cast.play([*FRAMES, 3])
    move_and_play_on(cast)


@pytest.mark.parametrize("prepare", REASONS)
def test_what_moves_otherwise_keeps_it_live(cast, prepare):
    clause = prepare(cast)
    wait(cast)
    assert not cast.rig.is_played and clause in cast.rig.reason
    cast.play()


def test_a_muted_constraint_keeps_nothing_live(cast):
    """Until it is switched on, or animation may do that."""
    limit = cast.wheel.constraints.new("LIMIT_LOCATION")
    limit.use_max_x, limit.max_x, limit.mute = True, -2, True
    cast.accelerate()
    cast.play([3, 4])
    limit.mute = False
    layer().update()
    cast.assert_same()
    cast.play([5, 4])
    wait(cast)
    assert not cast.rig.is_played and "Wheel has constraints" in cast.rig.reason
    limit.mute = True
    layer().update()
    cast.assert_same()
    cast.accelerate()
    cast.play([5, 4])
    limit.keyframe_insert("enabled", frame=1)
    layer().update()
    wait(cast)
    assert not cast.rig.is_played and "Wheel has constraints" in cast.rig.reason
    cast.play([5, 4])


@pytest.mark.parametrize("kind", ("LIMIT_LOCATION", "COPY_LOCATION"))
def test_a_muted_constraint_of_the_armature_says_nothing(cast, kind):
    armature = cast.played[0]
    constraint = armature.constraints.new(kind)
    constraint.mute = True
    layer().update()
    reading = addon_module("description.reading")
    assert reading.read(armature).description["refused"] == []
    constraint.keyframe_insert("mute", frame=1)
    assert "itself has constraints" in str(reading.read(armature).description["refused"])


def test_what_stays_may_have_modifiers(cast):
    """They change its shape, not its place."""
    cast.ball.animation_data_clear()
    cast.ball.modifiers.new("Bevel", "BEVEL")
    cast.accelerate()
    cast.play()
    cast.move(cast.ball)
    layer().update()
    cast.assert_same()


def test_a_live_rig_that_follows_it_is_posed_after_it(cast):
    """While relations are built it is without what it follows."""
    armature = make_armature()
    armature.keyframe_insert('pose.bones["bone0"].location', frame=1)
    add(armature, "CHILD_OF", "bone0", cast.played[0], subtarget="bone2", set_inverse_pending=False)
    cast.scene.frame_set(2)
    before = matrices_of(armature)
    cast.accelerate()
    assert recorded().get(armature) is None
    assert np.array_equal(matrices_of(armature), before)
    cast.play()
    if cast.has_keys:
        curve = addon_module("blender.animation").slot_curves(cast.played[0])[0]
        for key in curve.keyframe_points:
            key.co.y += 0.4
        curve.update()
    else:
        cast.played[0].pose.bones["bone0"].rotation_quaternion = (1, 0.4, 0.2, 0)
    layer().update()
    assert cast.rig.is_idle
    shown = matrices_of(armature)
    states().hand_back([cast.rig], cast.scene, layer())
    cast.scene.frame_set(cast.scene.frame_current)
    assert np.array_equal(matrices_of(armature), shown) and not np.array_equal(before, shown)


def test_it_can_be_played(cast):
    states().take_over([recorded().learn(cast.played[0])], cast.scene, layer())
    assert cast.rig.is_played, cast.rig.reason
    cast.play([*FRAMES, 3])
    cast.move(cast.wheel, 6)
    layer().update()
    cast.play([*FRAMES, 3])
