"""Rigs whose armature object has keyframes, as a character that walks or a car. The first character of the cast is
accelerated; the second one is Blender's. What hangs on both is everywhere as Blender has it, to the bit."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from characters import accelerate as accelerate_mesh
from characters import make_armature, make_mesh, pose
from helpers import addon_module, depsgraph, evaluated, needs_memory, needs_rig_programs, select
from test_accelerated_rigs import accelerating, keep_live, refused, wait
from test_played import FRAMES, Cast, layer
from test_played_who import both, can_render
from test_rigs_that_follow_objects import assert_blender_evaluates_no_bones

pytestmark = [needs_rig_programs, needs_memory]

CHANNELS = {
    "location": 3,
    "rotation_euler": 3,
    "rotation_quaternion": 4,
    "rotation_axis_angle": 4,
    "scale": 3,
    "delta_location": 3,
    "delta_rotation_euler": 3,
    "delta_rotation_quaternion": 4,
    "delta_scale": 3,
}


class Moving(Cast):
    """A cast whose armature objects move, with all that may hang on them."""

    def __init__(self, scene, mode="XYZ", channels=CHANNELS):
        super().__init__(scene)
        self.random = np.random.default_rng(2)
        self.hung = [self.hang(*each) for each in both(self)]
        for armature, *_ in both(self):
            armature.rotation_mode = mode
        for frame in (1, 4, 7, 10):
            for name in channels:
                self.move(name, frame)
        select()
        scene.frame_set(2)
        scene.frame_set(1)
        keep_live(self)

    def new(self, name, parent, data=None):
        ob = bpy.data.objects.new(name, data)
        self.scene.collection.objects.link(ob)
        ob.parent = parent
        ob.location = 0.3, -0.2, 0.1
        ob.rotation_euler.x = 0.4
        return ob

    def hang(self, armature, ob, other, prop):
        """On the armature both meshes hang, a hat with a feather, a camera that looks at it, and a lamp on the mesh."""
        for number, each in enumerate((ob, other)):
            each.parent, each.scale.z = armature, 1 + 0.5 * number
            each.matrix_parent_inverse = Matrix.Translation((0.1, 0.2, number))
        hat = self.new("Hat", armature, bpy.data.meshes.new("Hat"))
        feather = self.new("Feather", hat)
        lamp = self.new("Lamp", ob)
        behind = self.new("Behind", lamp)
        camera = self.new("Camera", None, bpy.data.cameras.new("Camera"))
        camera.constraints.new("TRACK_TO").target = armature
        follower = self.new("Follower", None)
        follower.constraints.new("COPY_TRANSFORMS").target = ob
        return [armature, ob, other, prop, hat, feather, lamp, behind, camera, follower]

    def move(self, name, frame=None):
        """Both, with keyframes on a frame, or by hand."""
        numbers = self.random.uniform(-1, 1, CHANNELS[name])
        for armature, *_ in both(self):
            setattr(armature, name, numbers)
            if frame is not None:
                armature.keyframe_insert(name, frame=frame)

    def accelerate(self):
        wait(self)
        assert self.rig.is_played and self.rig.trial.needs_program, self.rig.reason

    def undo(self):
        names = [[ob.name for ob in each] for each in self.hung]
        super().undo()
        self.hung = [[bpy.data.objects[name] for name in each] for each in names]

    def places(self, evaluates=True):
        """Returns what is known of where each object of both characters is, and of the armatures' channels."""
        return [
            [
                (
                    ob.name.partition(".")[0],
                    *map(tuple, ob.matrix_world),
                    ob.matrix_world.is_negative,
                    *(tuple(getattr(ob, name)) for name in CHANNELS),
                )
                for original in each
                for ob in (original, *([original.evaluated_get(depsgraph())] if evaluates else []))
            ]
            for each in self.hung
        ]

    def assert_same(self):
        super().assert_same()
        ours, theirs = self.places()
        for mine, other in zip(ours, theirs):
            assert mine[1:] == other[1:], mine[0]
        host = addon_module("host.places")
        for mine, other in zip(*self.hung):
            pairs = [(mine, other), (mine.evaluated_get(depsgraph()), other.evaluated_get(depsgraph()))]
            for pair in pairs:
                ours, theirs = (np.frombuffer(host.place_in(each), np.float32) for each in pair)
                assert np.array_equal(ours, theirs, equal_nan=True), (mine.name, ours, theirs)


@pytest.fixture
def scene(fresh_scene, monkeypatch):
    monkeypatch.setattr(accelerating(), "LEAST_WORK", 0)
    monkeypatch.setattr(addon_module("played.followers"), "BONES_FOR_A_TAG", 0)
    fresh_scene.frame_start, fresh_scene.frame_end = 1, 10
    return fresh_scene


@pytest.fixture
def cast(scene):
    return Moving(scene, channels=("location", "rotation_euler"))


@pytest.mark.parametrize("mode", ["XYZ", "ZXY", "QUATERNION", "AXIS_ANGLE"])
def test_it_is_everywhere_where_blender_has_it(scene, mode):
    cast = Moving(scene, mode)
    cast.accelerate()
    assert len(cast.rig.source.compared) > 1
    shapes = cast.play([*FRAMES, 3, -7, 400, 5])
    cast.scene.frame_set(4, subframe=0.5)
    cast.assert_same()
    assert cast.rig.is_played and np.ptp(shapes, axis=0).max() > 0.1
    assert cast.rig.followers.carried == [cast.played[1]]


def test_blender_does_not_evaluate_its_bones(cast, monkeypatch):
    cast.accelerate()
    cast.scene.frame_set(4)
    copy = cast.played[0].evaluated_get(depsgraph())
    monkeypatch.setattr(addon_module("played.playing"), "_has_work", lambda: False)
    before = np.array([bone.matrix for bone in copy.pose.bones]), copy.matrix_world.copy()
    cast.scene.frame_set(9)
    assert np.array_equal([bone.matrix for bone in copy.pose.bones], before[0]) and copy.matrix_world == before[1]


def test_a_move_by_hand_shows_and_is_lost_as_in_blender(cast):
    cast.accelerate()
    cast.scene.frame_set(5)
    cast.move("location")
    layer().update()
    cast.assert_same()
    cast.scene.frame_set(6)
    cast.assert_same()
    wait(cast)
    assert cast.rig.is_played, cast.rig.reason
    cast.play()


def test_a_turn_that_is_not_keyed_stays(scene):
    cast = Moving(scene, channels=("location",))
    cast.accelerate()
    cast.scene.frame_set(5)
    for name in ("rotation_euler", "scale"):
        cast.move(name)
    layer().update()
    cast.play([6, 3])
    cast.accelerate()
    cast.play()


def test_a_new_key_is_followed(cast):
    cast.accelerate()
    cast.scene.frame_set(5)
    cast.move("location", 5)
    layer().update()
    cast.assert_same()
    cast.play([6, 5, 4])
    cast.accelerate()
    cast.play()


def test_a_pose_by_hand_leaves_it_where_it_is(cast):
    cast.accelerate()
    cast.scene.frame_set(5)
    for armature, *_ in both(cast):
        armature.pose.bones["bone2"].rotation_quaternion = 0.5, 0.5, 0.5, 0.5
    layer().update()
    cast.assert_same()
    cast.play([6, 5])
    cast.accelerate()


def test_what_is_taken_over_elsewhere_stays_native(cast):
    cast.accelerate()
    cast.scene.frame_set(5)
    addon_module("played.states").hand_back([cast.rig], cast.scene, layer())
    cast.play([8])
    cast.accelerate()
    cast.play([9, 10])
    assert cast.rig.is_played, cast.rig.reason


@pytest.mark.parametrize("edit", ["location", "parent inverse", "scale", "rotation mode"])
def test_what_it_carries_can_be_moved(cast, edit):
    cast.accelerate()
    cast.scene.frame_set(5)
    for _, ob, *_ in both(cast):
        if edit == "parent inverse":
            ob.matrix_parent_inverse = Matrix.Rotation(0.3, 4, "X")
        elif edit == "rotation mode":
            ob.rotation_quaternion = 0.5, 0.5, 0.5, 0.5
            ob.rotation_mode = "QUATERNION"
        else:
            setattr(ob, edit, (0.5, -0.5, 0.7))
    layer().update()
    cast.assert_same()
    cast.play([6, 5, 4])
    wait(cast)
    cast.play()


def assert_undone(cast, move):
    cast.accelerate()
    cast.scene.frame_set(5)
    bpy.ops.ed.undo_push(message="before")
    move()
    bpy.ops.ed.undo_push(message="moved")
    cast.undo()
    cast.assert_same()
    cast.play([6, 5])
    wait(cast)
    cast.play()


def test_it_is_undone(cast):
    assert_undone(cast, lambda: cast.move("location"))


def test_the_file_has_what_blender_alone_would_save(cast, tmp_path):
    cast.accelerate()
    cast.scene.frame_set(6)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "moving.blend"), copy=True)
    names = [[ob.name for ob in each] for each in cast.hung]
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "moving.blend"))
    cast.hung = [[bpy.data.objects[name] for name in each] for each in names]
    ours, theirs = cast.places(evaluates=False)
    assert [each[1:] for each in ours] == [each[1:] for each in theirs]


@pytest.mark.parametrize("parent", ["still", "moved"])
def test_its_parent_stays(scene, parent):
    cast = Moving(scene, channels=("location", "scale"))
    for armature, *_ in both(cast):
        armature.parent = empty = cast.new("Empty", None)
        empty.scale = 1.5, -0.5, 1
        armature.matrix_parent_inverse = Matrix.Rotation(0.3, 4, "X")
    layer().update()
    cast.accelerate()
    cast.play()
    if parent == "moved":
        for armature, *_ in both(cast):
            armature.parent.location.y = 2
        layer().update()
        cast.assert_same()
        cast.play()
        cast.accelerate()
        cast.play()


class Carried(Moving):
    """Its armature objects hang on carts that move, on a plane that does, too; they may move by themselves besides."""

    def __init__(self, scene, channels):
        super().__init__(scene, channels=channels)
        self.parents = []
        for each, (armature, *_) in zip(self.hung, both(self)):
            ship, cart = self.new("Ship", None), self.new("Cart", None, bpy.data.meshes.new("Cart"))
            cart.parent, armature.parent = ship, cart
            cart.matrix_parent_inverse = Matrix.Rotation(0.3, 4, "X")
            armature.matrix_parent_inverse = Matrix.Translation((0, 0.5, 0))
            cart.rotation_mode = "QUATERNION"
            self.parents.append((ship, cart))
            each += [ship, cart, self.new("Wheel", cart)]
        for frame in (1, 5, 10):
            for number, name in ((0, "location"), (0, "scale"), (1, "rotation_quaternion"), (1, "delta_location")):
                self.move_parents(number, name, frame)
        scene.frame_set(2)
        scene.frame_set(1)

    def move_parents(self, number, name, frame=None):
        numbers = self.random.uniform(0.3, 1, CHANNELS[name])
        for parents in self.parents:
            setattr(parents[number], name, numbers)
            if frame is not None:
                parents[number].keyframe_insert(name, frame=frame)


@pytest.fixture(params=[(), ("location", "rotation_euler")], ids=["carried", "carried and moving"])
def carried(scene, request):
    return Carried(scene, request.param)


def test_its_parents_move(carried):
    carried.accelerate()
    carried.assert_same()
    assert carried.rig.source.hangs and len(carried.rig.source.compared) > 1
    carried.play([*FRAMES, 3, -7, 400, 5])
    carried.scene.frame_set(4, subframe=0.5)
    carried.assert_same()
    assert carried.rig.is_played


def test_blender_does_not_evaluate_bones_because_of_its_parents(carried, monkeypatch):
    assert_blender_evaluates_no_bones(carried, monkeypatch)


def pose_it(cast):
    for armature, *_ in both(cast):
        armature.pose.bones["bone2"].rotation_quaternion = 0.5, 0.5, 0.5, 0.5


def move_it(cast):
    cast.move("location")


def key_it(cast):
    cast.move("location", 5)


def move_its_parent(cast):
    cast.move_parents(0, "location")


def turn_its_parent_without_a_key(cast):
    cast.move_parents(0, "rotation_euler")


def key_its_parent(cast):
    cast.move_parents(0, "location", 5)


def mute_its_parents_curve(cast):
    for ship, _cart in cast.parents:
        addon_module("blender.animation").slot_curves(ship)[0].mute = True
        ship.animation_data.action.update_tag()


def hide_its_parent(cast):
    for ship, _cart in cast.parents:
        ship.hide_set(True)


def free_it(cast):
    for armature, *_ in both(cast):
        armature.parent = None


def tag_it(cast):
    for armature, *_ in both(cast):
        armature.update_tag(refresh={"OBJECT"})


def move_the_mesh(cast):
    for _, ob, *_ in both(cast):
        ob.location.y += 0.4


def add_something(cast):
    cast.new("New", None)


EDITS = [
    *(pose_it, move_it, key_it, move_its_parent, turn_its_parent_without_a_key, key_its_parent),
    *(mute_its_parents_curve, hide_its_parent, free_it, tag_it, move_the_mesh, add_something),
]


@pytest.mark.parametrize("second", EDITS, ids=lambda edit: edit.__name__)
@pytest.mark.parametrize("first", EDITS, ids=lambda edit: edit.__name__)
def test_two_edits_of_a_rig_whose_parents_move(carried, first, second):
    carried.accelerate()
    carried.scene.frame_set(5)
    first(carried)
    layer().update()
    carried.assert_same()
    second(carried)
    carried.scene.frame_set(6)
    carried.assert_same()
    second(carried)
    layer().update()
    carried.assert_same()
    carried.play([7, 5])
    wait(carried)
    carried.play([7, 5])


def test_what_its_parent_hangs_on_is_undone(carried):
    assert_undone(carried, lambda: carried.move_parents(0, "location"))


def test_a_size_of_nothing(scene):
    cast = Moving(scene, channels=("location",))
    for frame, size in ((1, (1, 1, 1)), (5, (0, 1, 1)), (10, (0, 0, 0))):
        for armature, *_ in both(cast):
            armature.scale = size
            armature.keyframe_insert("scale", frame=frame)
    cast.scene.frame_set(2)
    cast.accelerate()
    cast.play()


def test_a_render_of_some_frames(cast, tmp_path):
    """Blender evaluates all of it in a graph of its own, between frames, too."""
    seen = []

    def look(_scene, graph):
        ours, theirs = ([ob.evaluated_get(graph).matrix_world.copy() for ob in each] for each in cast.hung)
        seen.append((graph.mode, ours == theirs, ours))

    can_render(cast.scene)
    cast.accelerate()
    cast.scene.render.filepath = str(tmp_path / "frame")
    cast.scene.frame_start, cast.scene.frame_end = 3, 4
    cast.scene.render.use_motion_blur = True
    bpy.app.handlers.frame_change_post.append(look)
    try:
        bpy.ops.render.render(animation=True)
    finally:
        bpy.app.handlers.frame_change_post.remove(look)
    rendered = [each for each in seen if each[0] == "RENDER"]
    assert len(rendered) > 2 and rendered[0][2] != rendered[-1][2] and all(each[1] for each in seen)
    assert cast.rig.trust.difference is None
    cast.play()
    wait(cast)
    assert cast.rig.is_played, cast.rig.reason
    cast.play()


# --- what is Blender's ----------------------------------------------------------------------------


def test_a_child_that_moves_by_itself(cast):
    for _, ob, *_ in both(cast):
        ob.keyframe_insert("location", frame=1)
    refused(cast, "its child, moves by itself")


def test_a_driver_that_reads_what_it_carries(cast):
    for (_, ob, *_), (*_, follower) in zip(both(cast), cast.hung):
        driver = follower.driver_add("hide_render").driver
        driver.variables.new().targets[0].id = ob
        driver.variables[0].targets[0].data_path = "location.x"
    refused(cast, "drivers of Follower")


def test_bones_that_follow_it(cast):
    other = cast.played[0].copy()
    cast.scene.collection.objects.link(other)
    other.data = other.data.copy()
    other.pose.bones["side"].constraints.new("COPY_LOCATION").target = cast.played[0]
    wait(cast)
    assert f"bones of {other.name} follow it" in cast.rig.reason


def test_a_force(cast):
    for _, ob, *_ in both(cast):
        select(ob)
        bpy.ops.object.forcefield_toggle()
    refused(cast, "is a force")


def test_more_objects_than_its_bones_are_worth(cast, monkeypatch):
    monkeypatch.setattr(addon_module("played.followers"), "BONES_FOR_A_TAG", 4)
    refused(cast, "objects hang on it")


def test_a_rig_that_hangs_on_it(cast):
    """Blender evaluates that one, behind the place of the first."""
    for each, (armature, *_) in zip(cast.hung, both(cast)):
        rider = make_armature()
        ob = make_mesh(rider, False)
        rider.parent = armature
        rider.location.z = 1
        for frame in (1, 10):
            pose(rider, frame, True)
        accelerate_mesh(ob)
        each += [rider, ob]
    keep_live(cast)
    cast.accelerate()
    cast.play()
    rider = addon_module("played.rigs").get(cast.hung[0][-2])
    assert rider is not None and "itself is animated" in rider.reason
    assert np.array_equal(*(evaluated(each[-1]) for each in cast.hung))


@pytest.mark.parametrize("kind", ["driver", "strip", "constraint"])
def test_what_else_moves_it(cast, kind):
    for armature, *_ in both(cast):
        if kind == "driver":
            armature.driver_add("scale", 0).driver.expression = "frame"
        elif kind == "strip":
            data = armature.animation_data
            data.nla_tracks.new().strips.new("Strip", 1, data.action)
            data.action = None
        else:
            armature.constraints.new("LIMIT_LOCATION")
    refused(cast, "itself")
