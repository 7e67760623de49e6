"""What handlers do on a frame and on an update does not grow with the file. Counted, not timed: calls of Python
functions and of functions written in C, and looks into bpy.data, where asking for an object by its name, or for the
number of objects, is a walk along all of them."""

import sys

import bpy
import pytest

from characters import accelerate, make_armature, make_mesh, pose
from helpers import addon_module, assert_same_shape, import_rig, needs_memory, twin_of

OTHERS = 300  # objects, meshes, materials and images in no scene
MOST_CALLS_A_FRAME = 50  # of all handlers together


class Watched:
    """The module bpy, which notes that it was asked for `data`."""

    def __init__(self, looks):
        self._looks = looks

    def __getattr__(self, name):
        if name == "data":
            self._looks.append(sys._getframe(1).f_code.co_qualname if sys.version_info >= (3, 11) else name)
        return getattr(bpy, name)


@pytest.fixture
def counted(monkeypatch):
    """Counts what Sinew's handlers do: a function that calls another one and returns (calls, looks into bpy.data)."""
    package = bpy.types.VIEW3D_PT_sinew.__module__.rpartition(".ui.")[0]
    looks, calls, is_counting = [], [], []

    def note(_frame, event, what):
        if event in {"call", "c_call"} and what is not sys.setprofile:
            calls.append(event)

    def counting(handler):
        def counted_handler(*arguments):
            if not is_counting:
                return handler(*arguments)
            looked = len(looks)
            sys.setprofile(note)
            try:
                return handler(*arguments)
            finally:
                sys.setprofile(None)
                is_counting.append(len(looks) - looked)

        return counted_handler

    handlers, callbacks = addon_module("main.handlers"), addon_module("main.callbacks")
    ours = [each for each in handlers.HANDLERS if each[0].startswith(("frame_change", "depsgraph_update"))]
    counting_ones = [(name, counting(handler)) for name, handler in ours]
    callbacks.remove(ours)
    callbacks.add(counting_ones)
    for name, module in list(sys.modules.items()):
        if name.startswith(package) and getattr(module, "bpy", None) is bpy:
            monkeypatch.setattr(module, "bpy", Watched(looks))

    def count(function, *arguments):
        calls.clear()
        is_counting[:] = [0]
        try:
            function(*arguments)
            return len(calls), sum(is_counting)
        finally:
            is_counting.clear()

    yield count
    callbacks.remove(counting_ones)
    callbacks.add(ours)


def fill_the_file():
    for number in range(OTHERS):
        mesh = bpy.data.meshes.new(f"other {number}")
        mesh.materials.append(bpy.data.materials.new(f"other {number}"))
        bpy.data.objects.new(f"other {number}", mesh).use_fake_user = True
        bpy.data.images.new(f"other {number}", 1, 1).use_fake_user = True


def bound_meshes(count, armature=None):
    armature = armature or make_armature()
    meshes = [make_mesh(armature, False) for _ in range(count)]
    for ob in meshes:
        accelerate(ob)
    return armature, meshes


def settle(armature, frames=(1, 2, 3)):
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        move(armature, frame)


def move(armature, angle):
    armature.pose.bones[1].rotation_quaternion = (1, 0.1 * angle, 0, 0)
    bpy.context.view_layer.update()


def test_a_frame(fresh_scene, counted):
    """It costs nothing for each bound mesh, and nothing for others in the file."""
    armature, _ = bound_meshes(1)
    settle(armature)
    alone = counted(fresh_scene.frame_set, 5)
    assert 0 < alone[0] <= MOST_CALLS_A_FRAME and alone[1] == 0
    bound_meshes(9, armature)
    fill_the_file()
    settle(armature)
    assert counted(fresh_scene.frame_set, 6) == alone


def test_an_update(counted):
    """It costs something for what was edited alone."""
    armature, _ = bound_meshes(1)
    settle(armature)
    alone = counted(move, armature, 5)
    assert alone[0] > 0 and alone[1] == 0
    other, _ = bound_meshes(9)
    fill_the_file()
    settle(armature)
    assert counted(move, armature, 6) == alone
    ten = counted(lambda: (move(armature, 7), move(other, 7)))
    assert ten[1] == 0
    assert ten[0] <= 20 * alone[0]


@needs_memory
def test_a_frame_of_clips_and_copies(fresh_scene, counted):
    ob, armature = import_rig("capsule", output="MESH")
    settle(armature)
    alone = counted(fresh_scene.frame_set, 5)
    assert alone[1] == 0
    fill_the_file()
    settle(armature)
    assert counted(fresh_scene.frame_set, 5) == alone
    assert ob.sinew.deformed is not None


def test_meshes_left_to_blender(counted):
    """Which way they go is decided again, by what was edited alone."""
    armature, (ob,) = bound_meshes(1)
    ob.shape_key_add(name="Basis")
    other = ob.copy()
    bpy.context.collection.objects.link(other)
    settle(armature)
    assert addon_module("run.characters").character(ob).way.kind == "BLENDER"
    alone = counted(move, armature, 5)
    assert alone[1] == 0
    fill_the_file()
    settle(armature)
    assert counted(move, armature, 6) == alone


# --- what came and went is known all the same -----------------------------------------------------


@needs_memory
def test_deleted_by_a_script_between_frames(fresh_scene):
    """No update comes in between."""
    clip, _ = import_rig("capsule", output="MESH")
    copied = make_mesh(make_armature(), False)
    accelerate(copied, "MESH")
    plain, twin = make_mesh(make_armature(), False), None
    pose(plain.modifiers[0].object, 1, False)
    pose(plain.modifiers[0].object, 10, False)
    twin = twin_of(plain)
    accelerate(plain, "MESH")
    fresh_scene.frame_set(2)
    for ob in clip, copied:
        bpy.data.objects.remove(ob)
        fresh_scene.frame_set(fresh_scene.frame_current + 2)
        assert_same_shape(plain, twin)
        assert_same_shape(plain.sinew.deformed, plain)
    assert addon_module("run.characters").bound_objects() == [plain]


@needs_memory
def test_a_copy_that_a_script_makes_plays_at_once(fresh_scene):
    """With output Mesh and a clip of its own, and no update in between."""
    ob, armature = import_rig("capsule", output="MESH")
    fresh_scene.frame_set(3)
    other, rig = ob.copy(), armature.copy()
    other.data, rig.data = ob.data.copy(), armature.data.copy()
    for each in other, rig:
        fresh_scene.collection.objects.link(each)
    other.modifiers["Armature"].object = rig
    for each in (modifier.object for modifier in other.modifiers if modifier.type == "ARMATURE"):
        assert each == rig
    fresh_scene.frame_set(8)
    fresh_scene.frame_set(9)
    assert_same_shape(other, ob)
    assert_same_shape(other.sinew.deformed, ob)


def test_renamed_it_is_still_known(fresh_scene, character):
    ob, twin, _ = character
    ob.name = "Another name"
    bpy.context.view_layer.update()
    fresh_scene.frame_set(5)
    characters = addon_module("run.characters")
    assert characters.bound_objects() == [ob]
    assert characters.character(ob).name == ("Another name", None)
    assert_same_shape(ob, twin)


@needs_memory
def test_a_mesh_is_shared_and_single_again_while_others_are_there(fresh_scene, character):
    """Whoever has the mesh as well is noticed by the number of its users."""
    ob, twin, _ = character
    fill_the_file()
    other = bpy.data.objects.new("Other", bpy.data.meshes.new("Other"))
    fresh_scene.collection.objects.link(other)
    bpy.context.view_layer.update()
    entry = addon_module("run.characters").character(ob)
    assert entry.way.kind == "ATTRIBUTE"
    other.data = ob.data
    bpy.context.view_layer.update()
    assert entry.way.kind == "CANVAS" and entry.planning.surroundings.sharer_count == 2
    bpy.data.objects.remove(other)
    bpy.context.view_layer.update()
    assert entry.way.kind == "ATTRIBUTE" and entry.planning.surroundings.sharer_count == 1
    fresh_scene.frame_set(6)
    assert_same_shape(ob, twin)
