"""All ordered pairs of what people and scripts do in a day, beside a rig that is computed: after each of the two edits,
on the frames that follow, and when the rig is computed again, everything equals a twin with the same edits that Blender
evaluates, to the bit."""

import functools
import tempfile
from contextlib import contextmanager
from pathlib import Path

import bpy
import pytest

import test_edited_animation as animation
from helpers import addon_module, depsgraph, evaluated, needs_memory, needs_rig_programs, select
from test_accelerated_rigs import accelerate, keep_live, wait
from test_edited_animation import HAS_SLOTS, NOW, NUMBERS, OTHER, Animated
from test_played import layer, matrices_of
from test_played_who import both

pytestmark = [needs_rig_programs, needs_memory]
ROLE = "role"  # a custom property by which objects are found again, whatever their names and Blender's memory
PARTS = "armature", "bound", "twin", "prop"


class Day:
    """Two characters in a file: the first is computed, the second stays live. Each edit is made to both. moves: their
    armature objects have keyframes, their meshes hang on these, and with "with its parent" these on what moves, too."""

    def __init__(self, moves=False):
        self.moves = moves
        bpy.ops.wm.read_homefile(filepath=saved(moves))
        self.take()
        keep_live(self.cast)
        self.handlers, self.posed = [], 0
        self.is_unseen = False  # is there an edit that Blender shows when it copies the rig for another reason?
        for frame in (1, OTHER, NOW):
            self.cast.scene.frame_set(frame)
        accelerate(self.cast)
        bpy.ops.ed.undo_push(message="computed")

    def take(self):
        """Finds the objects, in a file that was opened or after an undo."""
        found = {ob[ROLE]: ob for ob in bpy.data.objects if ROLE in ob}
        self.cast = Animated.__new__(Animated)
        self.cast.scene = bpy.context.scene
        self.cast.played, self.cast.live = (tuple(found[f"{who} {part}"] for part in PARTS) for who in ("one", "other"))
        keep_live(self.cast)

    @property
    def scene(self):
        return self.cast.scene

    def characters(self):
        return both(self.cast)

    def armatures(self):
        return [each[0] for each in both(self.cast)]

    def pose(self):
        """Poses a bone with keyframes, and a channel without."""
        self.posed += 1
        for armature in self.armatures():
            bone_of(armature).location.x += self.posed
            armature.pose.bones["bone2"].scale.y += 0.1

    def update(self):
        layer().update()
        self.compare()

    def frame(self, number):
        self.scene.frame_set(number)
        self.compare()

    def compare(self):
        if not self.is_unseen:
            self.compare_all()
            return
        try:
            self.compare_all()
        except AssertionError:
            for armature in self.armatures():
                armature.update_tag()
            self.is_unseen = False
            layer().update()
            self.compare_all()

    def compare_all(self):
        for ours, theirs in zip(*both(self.cast)):
            assert ours.visible_get() == theirs.visible_get()
            if ours.visible_get():
                self.compare_objects(ours, theirs)
        ours, theirs = self.armatures()
        assert (matrices_of(ours) == matrices_of(theirs)).all(), "the evaluated bones differ"
        assert channels_of(ours) == channels_of(theirs), "the originals' channels differ"
        ours, theirs = ([bone.matrix for bone in armature.pose.bones] for armature in self.armatures())
        assert ours == theirs, "the originals' bones differ"
        ours, theirs = ([place_of(ob) for ob in each if ob.visible_get()] for each in both(self.cast))
        assert ours == theirs, "the originals are elsewhere"

    @staticmethod
    def compare_objects(ours, theirs):
        graph = depsgraph()
        ours, theirs = ours.evaluated_get(graph), theirs.evaluated_get(graph)
        assert ours.matrix_world == theirs.matrix_world, f"{ours[ROLE]} is elsewhere"
        if ours.type == "MESH":
            assert evaluated(ours).tobytes() == evaluated(theirs).tobytes(), f"{ours[ROLE]} has another shape"

    def end(self):
        for handler in self.handlers:
            for listed in (bpy.app.handlers.frame_change_post, bpy.app.handlers.frame_change_pre):
                if handler in listed:
                    listed.remove(handler)


def channels_of(armature):
    """What the originals have."""
    bones = armature.pose.bones
    found = [number for bone in bones for name in NUMBERS for number in getattr(bone, name)]
    found += [constraint.influence for bone in bones for constraint in bone.constraints]
    return found + [armature[name] for name in ("free", "level")]


def place_of(ob):
    names = ("location", "rotation_euler", "rotation_quaternion", "scale", "delta_location", "matrix_world")
    return [
        tuple(map(tuple, value)) if name == "matrix_world" else tuple(value)
        for name in names
        for value in [getattr(ob, name)]
    ]


@functools.cache
def saved(moves=False):
    """Returns the path of a file with both characters."""
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 10
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    scene.render.resolution_x = scene.render.resolution_y = 4
    cast = Animated(scene)
    for who, character in zip(("one", "other"), both(cast)):
        goal = bpy.data.objects.new("Goal", None)
        scene.collection.objects.link(goal)
        goal.location = 1, 2, 3
        followed = character[0].pose.bones["bone3"].constraints.new("COPY_LOCATION")
        followed.target, followed.influence = goal, 0.3
        for part, ob in zip(PARTS, character):
            ob[ROLE] = f"{who} {part}"
        if moves:
            parent = bpy.data.objects.new("Horse", None)
            scene.collection.objects.link(parent)
            for frame in (1, 9):
                parent.location.x = 0.2 * frame
                parent.keyframe_insert("location", frame=frame)
            character[0].parent = parent if moves == "with its parent" else None
            for ob in character[1:3]:
                ob.parent = character[0]
            for number, frame in enumerate((1, 4, 10)):
                character[0].location = number, -frame, 0.3
                character[0].rotation_euler.z = 0.1 * frame
                for name in ("location", "rotation_euler"):
                    character[0].keyframe_insert(name, frame=frame)
    path = str(Path(tempfile.mkdtemp()) / "day.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    return path


@pytest.fixture
def day(monkeypatch, request):
    monkeypatch.setattr(addon_module("played.accelerating"), "LEAST_WORK", 0)
    monkeypatch.setattr(addon_module("played.followers"), "BONES_FOR_A_TAG", 0)
    made = Day(moves=getattr(request, "param", False))
    yield made
    made.end()


def bone_of(armature, name="bone1"):
    bones = armature.pose.bones
    return bones[name] if name in bones else bones["renamed"]


# --- the edits ------------------------------------------------------------------------------------


def to_each(edit):
    """An edit of an armature object, made to both."""

    @functools.wraps(edit)
    def edit_both(day):
        for armature in day.armatures():
            edit(armature)

    return edit_both


def set_a_property_without_a_tag(day):
    to_each(animation.set_a_property_without_a_tag)(day)
    day.is_unseen = True


@to_each
def pose_a_bone(armature):
    bone_of(armature).location.x += 0.3


@to_each
def pose_what_has_no_keys(armature):
    armature.pose.bones["bone2"].bone.bbone_curveinx += 0.2
    armature.pose.bones["bone4"].scale.z += 0.2


@to_each
def clear_the_pose(armature):
    for bone in armature.pose.bones:
        bone.matrix_basis.identity()


@to_each
def delete_a_key(armature):
    if armature.animation_data and armature.animation_data.action:
        bone_of(armature).keyframe_delete("location", frame=4)


@to_each
def turn_to_quaternions(armature):
    mode = bone_of(armature).rotation_mode
    bone_of(armature).rotation_mode = "XYZ" if mode == "QUATERNION" else "QUATERNION"


@to_each
def mute_a_curve(armature):
    curve = animation.curve_of(armature)
    curve.mute = not curve.mute


@to_each
def change_a_handle(armature):
    animation.point_of(armature).handle_right_type = "VECTOR"
    animation.curve_of(armature).update()


@to_each
def change_interpolation(armature):
    point = animation.point_of(armature)
    point.interpolation = "CONSTANT" if point.interpolation != "CONSTANT" else "LINEAR"


@to_each
def move_a_key_in_time(armature):
    animation.point_of(armature).co.x += 0.5
    animation.curve_of(armature).update()


@to_each
def add_cycles(armature):
    animation.curve_of(armature).modifiers.new("CYCLES")
    armature.animation_data.action.update_tag()  # which Blender does not do


@to_each
def mute_a_driver(armature):
    driver = animation.driver_of(armature)
    driver.mute = not driver.mute


@to_each
def change_an_expression(armature):
    animation.driver_of(armature).driver.expression += " + 0.1"


@to_each
def weaken_a_constraint(armature):
    armature.pose.bones["bone3"].constraints[0].influence *= 0.5


@to_each
def mute_a_constraint(armature):
    constraint = armature.pose.bones["bone3"].constraints[0]
    constraint.mute = not constraint.mute


@to_each
def add_a_constraint(armature):
    constraint = armature.pose.bones["bone4"].constraints.new("COPY_ROTATION")
    constraint.target, constraint.subtarget = armature, armature.pose.bones[0].name


@to_each
def remove_a_constraint(armature):
    constraints = armature.pose.bones["bone3"].constraints
    constraints.remove(constraints[-1])


@to_each
def change_a_target(armature):
    constraint = armature.pose.bones["bone3"].constraints[0]
    constraint.target, constraint.subtarget = armature, "side"


@to_each
def move_the_goal(armature):
    armature.pose.bones["bone3"].constraints[0].target.location.x += 0.5


@to_each
def key_the_goal(armature):
    goal = armature.pose.bones["bone3"].constraints[0].target
    for frame in (2, 9):
        goal.location.y += frame
        goal.keyframe_insert("location", frame=frame)


@to_each
def remove_the_goal(armature):
    goal = armature.pose.bones["bone3"].constraints[0].target
    if goal is not armature:
        bpy.data.objects.remove(goal)


@to_each
def another_action(armature):
    action = bpy.data.actions.new("Another")
    data = armature.animation_data
    data.action = action
    if HAS_SLOTS:
        data.action_slot = action.slots.new("OBJECT", "Slot")
    armature.pose.bones["bone0"].keyframe_insert("location", frame=1)


@to_each
def move_the_armature(armature):
    armature.location.x += 1


@to_each
def key_the_armature(armature):
    for frame in (1, 9):
        armature.location.z = frame
        armature.keyframe_insert("location", frame=frame)


@to_each
def key_the_armature_here(armature):
    armature.location.y += 0.5
    armature.keyframe_insert("location")


@to_each
def turn_the_armature(armature):
    armature.rotation_euler = 0.3, 0.2, 0.1


@to_each
def mirror_the_armature(armature):
    armature.scale.x *= -1


@to_each
def shift_the_armature(armature):
    armature.delta_location.z += 0.5


@to_each
def change_the_mode_of_rotation(armature):
    armature.rotation_quaternion = 0.5, 0.5, 0.5, 0.5
    armature.rotation_mode = "QUATERNION"


@to_each
def mute_the_armatures_curves(armature):
    for curve in animation.curves_of(armature):
        curve.mute = curve.data_path == "location"


@to_each
def unkey_the_armature(armature):
    armature.keyframe_delete("location", frame=4)


@to_each
def constrain_the_armature(armature):
    armature.constraints.new("LIMIT_LOCATION").use_max_z = True


def move_the_meshes(day):
    for character in day.characters():
        for ob in character[1:3]:
            ob.location.x += 0.7


def key_the_meshes(day):
    for character in day.characters():
        for ob in character[1:3]:
            ob.location.y -= 0.7
            ob.keyframe_insert("location")


def hang_something_on_the_mesh(day):
    for character in day.characters():
        hung = bpy.data.objects.new("Hung", None)
        day.scene.collection.objects.link(hung)
        hung.parent = character[1]
        character[3].constraints.new("COPY_LOCATION").target = hung


def free_the_meshes(day):
    for character in day.characters():
        for ob in character[1:3]:
            ob.parent = None


@to_each
def rest_position(armature):
    armature.data.pose_position = "REST" if armature.data.pose_position == "POSE" else "POSE"


@to_each
def move_a_bone_in_edit_mode(armature):
    with in_edit_mode(armature):
        armature.data.edit_bones["bone2"].tail.x += 0.3


@to_each
def add_a_bone(armature):
    with in_edit_mode(armature):
        bone = armature.data.edit_bones.new("extra")
        bone.tail, bone.parent = (0, 0, 1), armature.data.edit_bones["bone4"]


@to_each
def remove_a_bone(armature):
    with in_edit_mode(armature):
        armature.data.edit_bones.remove(armature.data.edit_bones["side"])


@to_each
def parent_a_bone_elsewhere(armature):
    with in_edit_mode(armature):
        bones = armature.data.edit_bones
        bones["bone4"].use_connect, bones["bone4"].parent = False, bones["bone0"]


@to_each
def inherit_no_scale(armature):
    armature.data.bones["bone2"].inherit_scale = "NONE"


@to_each
def bend_a_bone(armature):
    bone = bone_of(armature)
    bone.bone.bbone_segments = 5
    bone.bbone_rollout += 0.4


@to_each
def change_a_custom_handle(armature):
    bone, handle = bone_of(armature).bone, armature.data.bones["side"]
    bone.bbone_segments = 4
    bone.bbone_handle_type_start = bone.bbone_handle_type_end = "ABSOLUTE"
    bone.bbone_custom_handle_end = handle


@to_each
def hide_a_bone(armature):
    armature.data.bones["bone3"].hide = True


@to_each
def own_armature_data(armature):
    armature.data = armature.data.copy()


@to_each
def rename_the_rig(armature):
    armature.name = "Renamed"


@contextmanager
def in_edit_mode(armature):
    is_hidden = armature.hide_get()
    armature.hide_set(False)
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        yield
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")
        armature.hide_set(is_hidden)
        select()


def duplicate_the_rig(day):
    for armature in day.armatures():
        copy = armature.copy()
        del copy[ROLE]
        day.scene.collection.objects.link(copy)


def duplicate_as_a_user(day):
    for character in day.characters():
        hidden = [ob.hide_get() for ob in character]
        select(*(ob for ob in character if ob.visible_get()))
        bpy.ops.object.duplicate()
        for ob in bpy.context.selected_objects:
            del ob[ROLE]
        assert [ob.hide_get() for ob in character] == hidden
    select()


def parent_the_rig(day):
    for armature in day.armatures():
        parent = bpy.data.objects.new("Parent", None)
        day.scene.collection.objects.link(parent)
        parent.location.y = 2
        armature.parent = parent


def parent_the_rig_to_what_moves(day):
    for armature in day.armatures():
        parent = bpy.data.objects.new("Mover", None)
        day.scene.collection.objects.link(parent)
        for frame in (2, 8):
            parent.location.y = frame
            parent.keyframe_insert("location", frame=frame)
        armature.parent = parent


def move_the_parent(day):
    for armature in filter(lambda each: each.parent is not None, day.armatures()):
        armature.parent.location.x += 0.5


def key_the_parent(day):
    for armature in filter(lambda each: each.parent is not None, day.armatures()):
        armature.parent.location.z += 0.5
        armature.parent.keyframe_insert("location")


def hide_the_rig(day):
    for armature in day.armatures():
        armature.hide_set(not armature.hide_get())


def hide_the_meshes(day):
    for character in day.characters():
        for ob in character[1:3]:
            ob.hide_viewport = not ob.hide_viewport


def mute_the_modifiers(day):
    for character in day.characters():
        for ob in character[1:3]:
            for modifier in ob.modifiers:
                modifier.show_viewport = not modifier.show_viewport


def change_weights(day):
    for character in day.characters():
        for ob in character[1:3]:
            ob.vertex_groups[0].add(list(range(300)), 0.7, "REPLACE")
            ob.data.update()


def unbind(day):
    for character in day.characters():
        if character[1].visible_get():
            select(character[1])
            if bpy.ops.object.sinew_unbind.poll():
                bpy.ops.object.sinew_unbind()
    select()


def render(day):
    if day.scene.camera is None:
        day.scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        day.scene.collection.objects.link(day.scene.camera)
    bpy.ops.render.render()


def play(day):
    for frame in (1, 5, 10, 6):
        day.scene.frame_set(frame)


def link_something(day):
    day.scene.collection.objects.link(bpy.data.objects.new("New", None))


def change_the_range(day):
    day.scene.frame_end += 5


def change_the_tempo(day):
    """Blender shows that when it next evaluates anything for another reason."""
    day.scene.render.frame_map_new = 200 if day.scene.render.frame_map_new == 100 else 100
    day.scene.frame_set(day.scene.frame_current)


def handler_that_poses(day):
    def handler(scene, _graph=None):
        for armature in day.armatures():
            bone_of(armature).location.y = scene.frame_current / 7

    day.handlers.append(handler)
    bpy.app.handlers.frame_change_post.append(handler)


def handler_before_frames(day):
    def handler(_scene, _graph=None):
        for armature in day.armatures():
            armature.pose.bones["bone4"].location.y = bone_of(armature).matrix[0][3]  # of the last frame

    day.handlers.append(handler)
    bpy.app.handlers.frame_change_pre.append(handler)


def no_handlers(day):
    day.end()


def undo_a_pose(day):
    bpy.ops.ed.undo_push(message="before")
    day.pose()
    layer().update()
    bpy.ops.ed.undo_push(message="posed")
    bpy.ops.ed.undo()
    day.take()
    layer().update()


def undo_and_redo(day):
    undo_a_pose(day)
    bpy.ops.ed.redo()
    day.take()
    layer().update()


def undo_the_last(day):
    """Everything that was done."""
    bpy.ops.ed.undo_push(message="done")
    bpy.ops.ed.undo()
    day.take()
    layer().update()


def save_and_open(day):
    path = str(Path(saved(day.moves)).with_name("again.blend"))
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    bpy.ops.ed.undo_push(message="opened")  # which Blender does where there is a window
    day.take()
    layer().update()


def save(day):
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(saved(day.moves)).with_name("again.blend")), copy=True)


OF_ANIMATION = [
    *(animation.move_a_key, animation.move_all_keys, animation.insert_a_key, animation.remove_a_key),
    *(animation.key_a_bone, animation.key_a_pose, animation.key_another_frame, animation.key_another_channel),
    *(animation.remove_a_curve, animation.add_a_curve, animation.clear_animation),
    *(animation.unassign_action, animation.copy_action, animation.tag_action, animation.rename_a_bone),
    *(animation.remove_a_driver, animation.add_a_driver, animation.move_a_key_of_the_clip, animation.play_the_clip),
    *(animation.push_down, animation.set_a_property),
]
EDITS = [
    *map(to_each, OF_ANIMATION),
    *(
        set_a_property_without_a_tag,
        delete_a_key,
        pose_a_bone,
        pose_what_has_no_keys,
        clear_the_pose,
        turn_to_quaternions,
        mute_a_curve,
        change_a_handle,
    ),
    *(change_interpolation, move_a_key_in_time, add_cycles, mute_a_driver, change_an_expression),
    *(weaken_a_constraint, mute_a_constraint, add_a_constraint, remove_a_constraint, change_a_target, move_the_goal),
    *(key_the_goal, remove_the_goal, another_action, move_the_armature, key_the_armature, rest_position),
    *(move_a_bone_in_edit_mode, add_a_bone, remove_a_bone, parent_a_bone_elsewhere, inherit_no_scale, bend_a_bone),
    *(
        change_a_custom_handle,
        hide_a_bone,
        own_armature_data,
        rename_the_rig,
        duplicate_the_rig,
        duplicate_as_a_user,
        parent_the_rig,
    ),
    *(hide_the_rig, hide_the_meshes, mute_the_modifiers, change_weights, unbind, render, play, link_something),
    *(change_the_range, change_the_tempo, handler_that_poses, handler_before_frames, no_handlers, undo_a_pose),
    *(undo_and_redo, undo_the_last, save_and_open, save),
]
# Of armature objects that move, and what hangs on them.
OF_PLACES = [
    *(move_the_armature, key_the_armature, key_the_armature_here, turn_the_armature, mirror_the_armature),
    *(shift_the_armature, change_the_mode_of_rotation, mute_the_armatures_curves, unkey_the_armature),
    *(constrain_the_armature, move_the_meshes, key_the_meshes, hang_something_on_the_mesh, free_the_meshes),
    *(parent_the_rig, parent_the_rig_to_what_moves, move_the_parent, key_the_parent),
]
ANY = list(dict.fromkeys([*EDITS, *OF_PLACES]))
# Where the first edit has removed what the second one wants, or has made what it would make.
GONE = AttributeError, IndexError, KeyError, RuntimeError, StopIteration, TypeError


# --- when the second one is made ------------------------------------------------------------------


def in_the_same_update(_day):
    pass


def after_an_update(day):
    day.update()


def on_the_next_frame(day):
    day.frame(NOW + 1)


def on_another_frame(day):
    day.update()
    day.frame(OTHER)


MOMENTS = [in_the_same_update, after_an_update, on_the_next_frame, on_another_frame]


IN_WORDS = {"ids": lambda edit: getattr(edit, "__name__", None)}


@pytest.mark.parametrize(
    ("day", "edit"),
    [(False, each) for each in EDITS] + [(how, each) for how in ("alone", "with its parent") for each in ANY],
    indirect=["day"],
    **IN_WORDS,
)
def test_each_edit_can_be_made(day, edit):
    assert day.cast.rig.is_played, day.cast.rig.reason
    edit(day)
    day.update()
    for frame in (OTHER, OTHER + 1):
        day.frame(frame)


@pytest.mark.sampled(80)
@pytest.mark.parametrize("moment", MOMENTS, **IN_WORDS)
@pytest.mark.parametrize("second", EDITS, **IN_WORDS)
@pytest.mark.parametrize("first", EDITS, **IN_WORDS)
def test_two_edits(day, first, second, moment):
    make_two(day, first, second, moment)


PAIRS = [(first, second) for first in ANY for second in ANY if first in OF_PLACES or second in OF_PLACES]


@pytest.mark.sampled(80)
@pytest.mark.parametrize("moment", MOMENTS, **IN_WORDS)
@pytest.mark.parametrize(("first", "second"), PAIRS, **IN_WORDS)
@pytest.mark.parametrize("day", ["alone", "with its parent"], indirect=True)
def test_two_edits_of_a_rig_that_moves(day, first, second, moment):
    make_two(day, first, second, moment)


def make_two(day, first, second, moment):
    assert day.cast.rig.is_played, day.cast.rig.reason
    first(day)
    moment(day)
    try:
        second(day)
    except GONE as error:  # of both characters, or the twins differ
        assert "Traceback" not in str(error), "an operator has failed"
    day.update()
    day.pose()
    day.update()
    for frame in (2, OTHER, OTHER + 1):
        day.frame(frame)
    wait(day.cast)
    is_native = day.cast.rig.is_played
    day.frame(5)
    assert day.cast.rig.is_played == is_native or day.handlers, day.cast.rig.reason
    day.pose()
    day.update()
