"""Handlers and the timer: others may clear Blender's lists, and what is damaged in one character stops no other."""

import threading

import bpy
import numpy as np
import pytest

from characters import accelerate, make_mesh
from helpers import addon_module, assert_same_shape, builtin_copy, evaluated, import_rig, needs_memory, select

LISTS = sorted(
    (
        "frame_change_pre",
        "frame_change_post",
        "depsgraph_update_pre",
        "depsgraph_update_post",
        "load_post",
        "save_pre",
        "undo_post",
        "redo_post",
        # before all others
        "frame_change_pre",
        "frame_change_post",
        "depsgraph_update_pre",
        "depsgraph_update_post",
        # of played characters
        "frame_change_pre",
        "frame_change_post",
        "frame_change_post",
        "depsgraph_update_pre",
        "depsgraph_update_post",
        "load_post",
        "undo_post",
        "redo_post",
        # of onion skins
        "frame_change_post",
        "depsgraph_update_post",
        "undo_post",
        "redo_post",
    )
)


def package():
    return bpy.types.VIEW3D_PT_sinew.__module__.rpartition(".ui.")[0]


def timer():
    return addon_module("main.handlers").look_into_the_mail


def lists_with_ours(name=None):
    """Names of the lists, one for each handler of Sinew's in it."""
    name = name or package()
    return sorted(
        listed
        for listed in dict.fromkeys(LISTS)
        for handler in getattr(bpy.app.handlers, listed)
        if handler.__module__.startswith(name)
    )


@pytest.fixture
def cleared():
    """As another add-on or a script leaves the lists. What others had in them is put back."""
    before = {name: list(getattr(bpy.app.handlers, name)) for name in LISTS}
    for name in LISTS:
        getattr(bpy.app.handlers, name).clear()
    yield
    for name, handlers in before.items():
        listed = getattr(bpy.app.handlers, name)
        listed.extend(each for each in handlers if not each.__module__.startswith(package()) and each not in listed)
    addon_module("main.callbacks").put_back()
    assert lists_with_ours() == LISTS


@pytest.mark.parametrize("has_timer", (True, False), ids=("cleared", "cleared, and no timer"))
def test_disabled_and_enabled_after_somebody_cleared_the_lists(cleared, has_timer):
    if not has_timer:
        bpy.app.timers.unregister(timer())
    name = package()
    assert bpy.ops.preferences.addon_disable(module=name) == {"FINISHED"}
    assert not hasattr(bpy.types.Object, "sinew") and lists_with_ours(name) == []
    assert bpy.ops.preferences.addon_enable(module=name) == {"FINISHED"}
    assert hasattr(bpy.types.Object, "sinew") and lists_with_ours() == LISTS
    assert bpy.app.timers.is_registered(timer())


def test_the_timer_puts_back_what_somebody_cleared(cleared):
    timer()()
    assert lists_with_ours() == LISTS


@needs_memory
def test_an_update_puts_back_what_somebody_cleared(fresh_scene, character):
    """Where no timers run. The output Mesh needs the handlers of frames."""
    ob, twin, _ = character
    ob.sinew.output = "MESH"
    bpy.app.handlers.frame_change_post.clear()
    bpy.app.timers.unregister(timer())
    ob.update_tag()
    bpy.context.view_layer.update()
    assert lists_with_ours() == LISTS and bpy.app.timers.is_registered(timer())
    fresh_scene.frame_set(8)
    assert_same_shape(ob.sinew.deformed, twin)


@needs_memory
def test_a_file_that_is_opened_meanwhile(character, cleared, tmp_path):
    """It is looked through as if it had just been opened."""
    ob, twin, armature = character
    ob.sinew.output = "MESH"
    names, path = (ob.name, twin.name), str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    timer()()
    ob, twin = (bpy.data.objects[name] for name in names)
    for frame in (5, 8):
        bpy.context.scene.frame_set(frame)
        assert_same_shape(ob, twin)
        assert_same_shape(ob.sinew.deformed, twin)


def test_what_was_switched_off_is_not_put_back():
    handlers = addon_module("main.handlers")
    handlers.unregister_frame_handlers()
    try:
        timer()()
        bpy.context.view_layer.update()
        assert handlers.before_frame not in bpy.app.handlers.frame_change_pre and "undo_post" in lists_with_ours()
    finally:
        handlers.register_frame_handlers()
    assert lists_with_ours() == LISTS


@pytest.mark.says_errors
def test_the_timer_never_raises(monkeypatch, caplog):
    """Blender would drop it. The rest is done, and the error is said once."""
    mail, done = addon_module("run.mail"), []

    def fail():
        raise RuntimeError("It was told to fail")

    monkeypatch.setattr(addon_module("main.callbacks"), "put_back", fail)
    mail.post(done.append, "delivered")
    for _ in range(3):
        assert timer()() > 0
    assert done == ["delivered"]
    assert len([record for record in caplog.records if record.exc_info]) == 1


# --- renders, in a thread of their own ----------------------------------------------------------------


@pytest.fixture
def writers(monkeypatch):
    """The threads that have posed bones."""
    found, armatures = [], addon_module("blender.armatures")
    write_pose = armatures.write_pose

    def note(*arguments):
        found.append(threading.current_thread())
        write_pose(*arguments)

    monkeypatch.setattr(armatures, "write_pose", note)
    monkeypatch.setattr(addon_module("main.handlers"), "HAS_EVENT_LOOP", True)
    return found


def in_a_thread(function, *arguments, main=lambda: None):
    """Calls it as a render does, while the main thread goes on."""
    thread = threading.Thread(target=function, args=arguments)
    thread.start()
    while thread.is_alive():
        main()
    return thread


def test_the_main_thread_poses_for_a_render(fresh_scene, writers):
    """Somebody may edit the armature meanwhile. The pose is there before the render evaluates."""
    ob, armature = import_rig("capsule")
    fresh_scene.frame_set(9)
    at_nine = evaluated(ob)
    fresh_scene.frame_set(4)
    assert np.abs(evaluated(ob) - at_nine).max() > 1e-3
    writers.clear()
    fresh_scene.frame_current = 9
    handlers = addon_module("main.handlers")
    in_a_thread(handlers.before_frame, fresh_scene, main=timer())
    bpy.context.view_layer.update()
    assert set(writers) == {threading.main_thread()}
    assert np.allclose(evaluated(ob), at_nine, atol=1e-6)
    writers.clear()
    armature.sinew_clip["speed"] = 3.0  # as a driver would, unseen
    armature.update_tag()
    graph = bpy.context.evaluated_depsgraph_get()
    writers.clear()
    in_a_thread(handlers.after_frame, fresh_scene, graph, main=timer())
    assert set(writers) == {threading.main_thread()}


def test_originals_are_not_changed_while_another_thread_evaluates(fresh_scene):
    """It reads them: what was asked of the main thread is done afterwards."""
    handlers, mail, said = addon_module("main.handlers"), addon_module("run.mail"), []
    has_begun, may_end = threading.Event(), threading.Event()

    def evaluate():
        handlers.before_evaluation(fresh_scene)
        has_begun.set()
        may_end.wait(60)
        handlers.after_evaluation(fresh_scene, graph)

    graph = bpy.context.evaluated_depsgraph_get()
    timer()()
    mail.post(said.append, 1)
    thread = threading.Thread(target=evaluate)
    thread.start()
    has_begun.wait(60)
    timer()()
    assert said == []
    may_end.set()
    thread.join()
    timer()()
    assert said == [1]


def test_another_thread_does_not_evaluate_while_originals_are_changed(fresh_scene):
    handlers, mail, said = addon_module("main.handlers"), addon_module("run.mail"), []
    thread = threading.Thread(target=lambda: (handlers.before_evaluation(fresh_scene), said.append("evaluated")))

    def change():
        thread.start()
        thread.join(0.2)
        said.append("changed")

    mail.post(change)
    timer()()
    thread.join()
    assert said == ["changed", "evaluated"]
    addon_module("host.evaluations").forget()


def test_a_main_thread_that_waits_for_the_render_holds_nothing_up(fresh_scene, writers, monkeypatch):
    """As when the file is closed. The pose is there all the same."""
    import_rig("capsule")
    handlers = addon_module("main.handlers")
    monkeypatch.setattr(handlers, "SECONDS_TO_WAIT", 0.01)
    fresh_scene.frame_current = 9
    writers.clear()
    thread = in_a_thread(handlers.before_frame, fresh_scene)
    assert set(writers) == {thread}


def test_a_render_of_a_file_without_clips_waits_for_nobody(fresh_scene, character, monkeypatch):
    ob, twin, _ = character
    bpy.context.view_layer.update()
    handlers, mail = addon_module("main.handlers"), addon_module("run.mail")
    monkeypatch.setattr(handlers, "HAS_EVENT_LOOP", True)
    monkeypatch.setattr(mail, "ask", None)
    graph = bpy.context.evaluated_depsgraph_get()
    in_a_thread(lambda: (handlers.before_frame(fresh_scene), handlers.after_frame(fresh_scene, graph)))
    assert_same_shape(ob, twin)


def test_a_thread_that_comes_while_the_file_is_walked_through(character, monkeypatch):
    """Blender evaluates meshes while the main thread looks which there are: it finds what is known of one, and what it
    enters of another stays."""
    ob, _, armature = character
    other, late = make_mesh(armature, False), make_mesh(armature, False)
    accelerate(other)
    characters, found = addon_module("run.characters"), []
    known, key_of = characters.of(other), characters.values.key_of

    def meanwhile(block):
        if block == ob and not found:  # while the walk is at this one
            found.append(None)
            in_a_thread(lambda: found.extend((characters.of(other), characters.of(late))))
        return key_of(block)

    monkeypatch.setattr(characters.values, "key_of", meanwhile)
    characters.gather_again()
    characters.bound_objects()
    assert found[1] is known is characters.of(other)
    assert found[2] is characters.of(late)


# --- a damaged clip -------------------------------------------------------------------------------


def joined_with_another_rig(armature):
    """The bones of both have joints, and the clip is that of one."""
    other, rig = import_rig("ogre")
    select(armature, rig)
    assert bpy.ops.object.join() == {"FINISHED"}


def bones_of_other_joints(armature):
    for bone, joint in zip(armature.data.bones, ("a word", 99, -7, 0.5)):
        bone["sinew_joint"] = joint


def replaced(**entries):
    def spoil(armature):
        clip = armature.data["sinew_clip"].to_dict()
        for name, change in entries.items():
            value = change(list(clip[name])) if callable(change) else change
            if value is None:
                del clip[name]
            else:
                clip[name] = value
        armature.data["sinew_clip"] = clip

    return spoil


def instead(value):
    def spoil(armature):
        armature.data["sinew_clip"] = value

    return spoil


def first(value):
    return lambda numbers: [value, *numbers[1:]]


DAMAGED = {
    "a number": instead(5),
    "a word": instead("poses"),
    "a list": instead([1.0, 2.0]),
    "empty": instead({}),
    "no rotations": replaced(rotations=None),
    "no parents": replaced(parents=None),
    "parents are a number": replaced(parents=7),
    "parents are words": replaced(parents="0123"),
    "rotations are a number": replaced(rotations=3.5),
    "rotations are words": replaced(rotations="quaternions"),
    "rotations are groups": replaced(rotations=[{"w": 1.0}, {"w": 2.0}]),
    "a rotation too few": replaced(rotations=lambda numbers: numbers[:-4]),
    "a number too many": replaced(rotations=lambda numbers: [*numbers, 1.0]),
    "heads are too few": replaced(heads=lambda numbers: numbers[:3]),
    "a joint too few": replaced(parents=lambda numbers: numbers[:-1]),
    "a negative parent": replaced(parents=lambda numbers: [*numbers[:-1], -5]),
    "a parent behind": replaced(parents=lambda numbers: [50, *numbers[1:]]),
    "no joint": replaced(parents=[]),
    "not a number": replaced(rotations=first(float("nan"))),
    "a place not a number": replaced(heads=first(float("inf"))),
    "a rotation of 0": replaced(rotations=lambda numbers: [0.0] * 4 + numbers[4:]),
    "convention is a number": replaced(convention=3),
    "convention is a word": replaced(convention="neither"),
    "flat matrices": replaced(rotations=[], matrices=lambda _: [0.0] * 12 * 2 * 4),
}
AS_GOOD_AS_IT_GETS = {"joined": joined_with_another_rig, "bones of other joints": bones_of_other_joints}


@pytest.fixture
def two_rigs(fresh_scene):
    """(mesh, armature) that is to be damaged, the same that stays, and its twin that its bones deform."""
    healthy, twins_armature = import_rig("capsule", output="MESH")
    twin = builtin_copy(healthy)
    return import_rig("capsule"), (healthy, twins_armature), twin


def assert_plays(scene, healthy, twin, frames=(4, 9)):
    shapes = []
    for frame in frames:
        scene.frame_set(frame)
        assert_same_shape(healthy, twin)
        assert_same_shape(healthy.sinew.deformed, twin)
        shapes.append(evaluated(healthy))
    assert np.abs(shapes[1] - shapes[0]).max() > 1e-3


@needs_memory
@pytest.mark.says_errors
@pytest.mark.parametrize("spoil", DAMAGED.values(), ids=DAMAGED.keys())
def test_a_damaged_clip(fresh_scene, two_rigs, spoil, caplog, capsys):
    """It is said once, and the others play. The mesh follows the bones as they are."""
    (ob, armature), (healthy, _), twin = two_rigs
    own_twin = builtin_copy(ob)
    spoil(armature)
    addon_module("main.handlers").forget()
    assert_plays(fresh_scene, healthy, twin)
    bpy.context.view_layer.update()
    assert_same_shape(ob, own_twin)
    said = [record.getMessage() for record in caplog.records]
    assert len(said) <= 1 and all(f"The imported poses of {armature.data.name} are damaged" in each for each in said)
    store = addon_module("clips.clip_store")
    assert said or not store.has_poses(armature.data)
    # What panels ask for.
    assert store.pose_count(armature.data) >= 0 and store.bones_are_where_they_were(armature) in {True, False}
    select(ob)
    with pytest.raises(RuntimeError, match="are damaged|poll"):
        bpy.ops.object.sinew_clip_to_keyframes()
    for operator in (bpy.ops.object.sinew_unbind, bpy.ops.object.sinew_bind):
        assert operator() == {"FINISHED"}
    assert_plays(fresh_scene, healthy, twin, (5, 7))
    assert "Traceback" not in capsys.readouterr().err


@needs_memory
@pytest.mark.parametrize("spoil", AS_GOOD_AS_IT_GETS.values(), ids=AS_GOOD_AS_IT_GETS.keys())
def test_bones_that_the_clip_does_not_know(fresh_scene, two_rigs, spoil, capsys):
    """The clip moves those of its own."""
    (ob, armature), (healthy, _), twin = two_rigs
    own_twin = builtin_copy(ob)
    spoil(armature)
    assert_plays(fresh_scene, healthy, twin)
    assert_same_shape(ob, own_twin)
    assert "Traceback" not in capsys.readouterr().err


@needs_memory
@pytest.mark.says_errors
def test_a_mended_clip_plays_again(fresh_scene, two_rigs):
    (ob, armature), (healthy, _), _ = two_rigs
    kept = armature.data["sinew_clip"].to_dict()
    armature.data["sinew_clip"] = 5
    addon_module("main.handlers").forget()
    fresh_scene.frame_set(4)
    armature.data["sinew_clip"] = kept
    armature.data.update_tag()
    bpy.context.view_layer.update()
    fresh_scene.frame_set(9)
    assert np.allclose(evaluated(ob), evaluated(healthy), atol=1e-6)
