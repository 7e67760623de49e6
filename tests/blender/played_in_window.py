"""Somebody works on one of two characters in a window: picks it with the mouse, poses, keys, undoes, plays and renders,
while the other one is played and plays from memory; then picks that one, and works with two windows open. Marks in the
timeline, onion skins (docs/onion-skins.jpg), and the file of Blender's autosave. At the end both are computed
(docs/rig.jpg), and the one that is picked stays so. Run as first_ogre.py is.
"""

import subprocess
import sys
import time
from pathlib import Path

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).parent))
from helpers import COMMAND, addon_module, evaluated, import_rig, select
from windowed import (
    FOLDER,
    area,
    camera,
    choose_a_bone,
    close_other_windows,
    in_area,
    middle_of,
    open_sidebar,
    outside,
    picture,
    pixels,
    playing,
    region,
    run,
    screen,
    until,
    window,
    windows,
)

FRAMES = range(1, 21)
SECONDS = 90  # until Blender has saved by itself; it does so each minute
# In another process: each mesh on each frame against the shapes that it had while all was live.
COMPARE = """
import bpy, numpy as np
bpy.ops.wm.open_mainfile(filepath={path!r})
shapes = np.load({shapes!r})
for name in shapes.files:
    ob = bpy.data.objects[name]
    assert ob.parent.animation_data.action.users == 1
    for frame, wanted in zip({frames!r}, shapes[name]):
        bpy.context.scene.frame_set(frame)
        mesh = ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        found = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", found)
        assert np.array_equal(found, wanted.reshape(-1)), (name, frame)
"""


def states():
    return addon_module("played.states")


def recorded():
    return addon_module("played.rigs")


def let_be_computed(armatures, may):
    """Whether these may be computed when they take over. Otherwise they are recorded."""
    for name in armatures:
        recorded().learn(bpy.data.objects[name]).trust.is_distrusted = not may


def want(armatures):
    """Has these take over as soon as they are not selected and their frame is recorded."""
    for name in armatures:
        states().want(recorded().learn(bpy.data.objects[name]))


def scene():
    """The scene; undo replaces it."""
    return bpy.context.scene


def is_played(armature):
    return recorded().get(bpy.data.objects[armature]).is_played


def shape(name):
    return evaluated(bpy.data.objects[name]).copy()


def steps():
    """Meshes and armatures are known by name, since undo replaces them."""
    bpy.context.preferences.view.smooth_view = 0
    for each in list(bpy.data.objects):
        bpy.data.objects.remove(each)
    scene().frame_start, scene().frame_end = FRAMES[0], FRAMES[-1]
    scene().sinew_accelerates_rigs = False
    panel_open()
    yield 0.5
    with in_area("VIEW_3D"):
        meshes, armatures = zip(*map(character, (-1, 1)))
    reference = {name: shapes_of(name) for name in meshes}
    look_at_them()
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "two.blend"))
    yield from open_sidebar()

    let_be_computed(armatures, may=False)
    want(armatures)
    yield from pick(meshes[0])
    yield from play_all()
    yield from until_played(armatures[1], "what is not selected does not take over")
    assert not is_played(armatures[0])
    assert_as(reference, meshes)
    print("window: what is not selected takes over by itself")

    yield from pose_key_and_undo(meshes, armatures, reference)

    yield from pick(meshes[1])
    assert not is_played(armatures[1])
    assert_as(reference, meshes)
    yield from until_played(armatures[0], "what was left does not take over")
    assert not is_played(armatures[1])
    assert_as(reference, meshes)
    print("window: picking the other one makes it live and takes over the first")

    yield from in_two_windows(meshes, armatures, reference)
    yield from render(meshes, armatures, reference)
    yield from onion_skins(meshes, armatures)
    yield from autosaved(armatures, reference)
    if bpy.app.version >= (4, 2, 0):
        yield from computed(meshes, armatures, reference)
        yield from accelerated(meshes, armatures, reference)


def panel_open():
    for name, panel in (("ui.played_rigs", "SidebarRigs"), ("ui.onion_skins", "SidebarOnionSkins")):
        cls = getattr(addon_module(name), panel)
        cls.bl_options = set()
        bpy.utils.unregister_class(cls)
        bpy.utils.register_class(cls)


def character(side):
    """An ogre by keyframes, on one side (-1, 1). Returns the names of its mesh object and its armature."""
    ob, armature = import_rig("ogre")
    bpy.ops.object.sinew_clip_to_keyframes()
    armature.location.x = 0.6 * side * ob.dimensions.x
    bpy.context.view_layer.update()
    return ob.name, armature.name


def shapes_of(name):
    found = []
    for frame in FRAMES:
        scene().frame_set(frame)
        found.append(shape(name))
    return np.array(found)


def assert_as(reference, meshes):
    for name in meshes:
        assert np.array_equal(shape(name), reference[name][scene().frame_current - FRAMES[0]]), name


def look_at_them():
    area("VIEW_3D").spaces.active.clip_end = 10000
    select(*[ob for ob in bpy.data.objects if ob.type == "MESH"])
    with in_area("VIEW_3D"):
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_selected()
    select()


def pick(name):
    """A click on a mesh, or on the bones in front of it."""
    ob, view = bpy.data.objects[name], area("VIEW_3D")
    whole = region(view)
    middle = ob.matrix_world @ (sum(map(Vector, ob.bound_box), Vector()) / 8)
    x, y = location_3d_to_region_2d(whole, view.spaces.active.region_3d, middle)
    yield from outside(f"xdotool mousemove {screen(whole.x + x, whole.y + y)} click 1")
    for _ in range(20):
        yield 0.25
        if bpy.context.view_layer.objects.active in (ob, ob.parent) and bpy.context.active_object.select_get():
            return
    yield from picture("not-picked")
    raise AssertionError(f"the click has not selected {name}")


def play_all():
    for frame in (*FRAMES, 8):
        scene().frame_set(frame)
        yield 0.05


def until_played(armature, what):
    try:
        yield from until(lambda: is_played(armature), 15)
    except TimeoutError:
        rigs = [
            (rig.name, rig.state.name, rig.reason, rig.motion.record.runs(), scene().frame_current)
            for rig in recorded().known()
        ]
        raise AssertionError(f"{what}: {rigs}") from None


def pose_key_and_undo(meshes, armatures, reference):
    """R and the mouse in Pose Mode, I, Ctrl-Z twice. The second one is played."""
    choose_a_bone(bpy.data.objects[armatures[0]])
    before = shape(meshes[0])
    assert_as(reference, meshes)
    yield 0.5
    x, y = middle_of(region(area("VIEW_3D")))
    yield from outside(f"xdotool mousemove {screen(x + 150, y)}")
    yield from outside("xdotool key r")
    yield from outside(f"xdotool mousemove {screen(x + 80, y + 120)}")
    yield 0.3
    yield from outside("xdotool click 1")
    yield 0.5
    posed = shape(meshes[0])
    assert np.abs(posed - before).max() > 0.05, "the mouse has not moved the mesh"
    assert is_played(armatures[1])
    with in_area("VIEW_3D"):
        bpy.ops.anim.keyframe_insert_by_name(type="WholeCharacterSelected")
        bpy.ops.ed.undo_push(message="keyed")
    yield 0.5
    for frame in (12, 8):
        scene().frame_set(frame)
        yield 0.2
        assert_as(reference, meshes[1:])
    assert np.allclose(shape(meshes[0]), posed, atol=1e-4), "the key does not hold the pose"
    assert np.abs(posed - before).max() > 0.05
    yield from picture("posing-beside-played")
    for _ in range(3):  # the key, the rotation; a Blender that keys by itself has one step more
        yield from outside("xdotool key ctrl+z")
        yield 1.0
        if np.array_equal(shape(meshes[0]), before):
            break
    assert np.array_equal(shape(meshes[0]), before), "undo does not bring the shape back"
    with in_area("VIEW_3D"):
        bpy.ops.object.mode_set(mode="OBJECT")
    assert_as(reference, meshes)
    yield from play_all()
    assert_as(reference, meshes)
    yield from until_played(armatures[1], "what is not selected does not take over after undo")
    print("window: turned a bone, keyed and undid it beside a played character")


def in_two_windows(meshes, armatures, reference):
    with window():
        bpy.ops.wm.window_new()
    yield 1.0
    assert len(windows()) == 2
    _rate, seen = yield from playing(15.0, 40)
    assert len(set(seen)) >= 5, f"only {len(set(seen))} frames were shown"
    yield from until_played(armatures[0], "what is not selected does not take over after playing")
    scene().frame_set(8)  # playing may have stopped behind the last frame
    assert_as(reference, meshes)
    for ours, theirs in ((0, 1), (1, 0)):
        select(bpy.data.objects[meshes[ours]])
        scene().frame_set(5 + ours)
        yield 0.3
        assert not is_played(armatures[ours])
        yield from until_played(armatures[theirs], "nothing takes over with two windows")
        assert_as(reference, meshes)
    yield from picture("two-windows")
    close_other_windows()
    yield 0.5
    print(f"window: played {len(set(seen))} different frames, and picked each, with two windows open")


def render(meshes, armatures, reference):
    """F12 while the first one is played, and when all is live."""
    camera(scene())
    scene().cycles.samples = 1
    scene().frame_start, scene().frame_end = 4, 9
    yield from until_played(armatures[0], "nothing takes over beside the camera")
    pictures = []
    for kind in ("played", "live"):
        done = []
        for handlers in (bpy.app.handlers.render_complete, bpy.app.handlers.render_cancel):
            handlers.append(lambda *_, done=done: done.append(True))
        scene().render.filepath = str(FOLDER / f"{kind}-")
        with window():
            bpy.ops.render.render("INVOKE_DEFAULT", animation=True)
        while not done:
            yield 0.2
        yield 0.5
        if kind == "played":
            assert_as(reference, meshes)
            states().hand_back(recorded().known(), scene(), bpy.context.view_layer)
        pictures.append([pixels(FOLDER / f"{kind}-{frame:04}.png") for frame in range(4, 10)])
    assert np.array_equal(*pictures), "F12 renders something else while a character is played"
    assert np.abs(pictures[0][0] - pictures[0][-1]).mean() > 1 / 1000
    scene().frame_start, scene().frame_end = FRAMES[0], FRAMES[-1]
    want(armatures)
    close_other_windows()
    yield 0.5
    print("window: F12 renders the same with a played character")


def onion_skins(meshes, armatures):
    settings = addon_module("main.addon_preferences").of_sinew().onion
    settings.before, settings.after, settings.step = 3, 3, 3
    yield from pick(meshes[1])
    with in_area("VIEW_3D"):
        assert bpy.ops.object.sinew_onion_skins() == {"FINISHED"}
    yield from play_all()
    scene().frame_set(10)
    yield from until_played(armatures[0], "nothing takes over beside ghosts")
    scene().frame_set(11)
    yield 0.2
    scene().frame_set(10)
    ghosts = yield from seen("onion-skins")
    with in_area("VIEW_3D"):
        bpy.ops.object.sinew_onion_skins()
    none = yield from seen("without-ghosts")
    assert (ghosts != none).mean() > 0.01, "there are no ghosts"
    print("window: onion skins are drawn, and hidden again")


def seen(name):
    """Takes a picture. Returns its pixels."""
    yield from picture(name)
    return pixels(FOLDER / f"{name}.png")


def autosaved(armatures, reference):
    """Blender's own autosave, while one is played."""
    paths = bpy.context.preferences.filepaths
    paths.temporary_directory = str(FOLDER)
    for each in FOLDER.glob("*autosave*.blend"):
        each.unlink()
    paths.use_auto_save_temporary_files, paths.auto_save_time = True, 1
    end = time.time() + SECONDS
    while not list(FOLDER.glob("*autosave*.blend")) and time.time() < end:
        assert is_played(armatures[0]) or time.time() < end - SECONDS + 20
        yield 1.0
    found = list(FOLDER.glob("*autosave*.blend"))
    assert found, "Blender has not saved by itself"
    assert is_played(armatures[0])
    np.savez(FOLDER / "reference.npz", **reference)
    script = FOLDER / "compare.py"
    script.write_text(COMPARE.format(path=str(found[0]), shapes=str(FOLDER / "reference.npz"), frames=list(FRAMES)))
    result = subprocess.run(
        [*COMMAND, "-b", "--python-exit-code", "1", "--python", str(script)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    print("window: Blender's autosave has both characters as they are live")


def computed(meshes, armatures, reference):
    """What has been played stays so when it is picked, posed and keyed."""
    select()
    states().hand_back(recorded().known(), scene(), bpy.context.view_layer)
    let_be_computed(armatures, may=True)
    want(armatures)
    scene().frame_set(7)
    for name in armatures:
        yield from until_played(name, "what can be computed does not take over")
        assert recorded().get(bpy.data.objects[name]).source.is_proven
    yield from pick(meshes[0])
    assert is_played(armatures[0])
    yield from play_all()
    yield from pose_key_and_undo(meshes, armatures, reference)
    for name in armatures:
        yield from until_played(name, "what was posed is not computed again")
    scene().frame_set(13)
    assert_as(reference, meshes)
    print("window: posed, keyed and undid a computed character")


def accelerated(meshes, armatures, reference):
    """Nobody has played anything: the rigs are computed as soon as nothing happens, and after an edit again."""
    addon_module("played.accelerating").LEAST_WORK = 0
    states().hand_back(recorded().known(), scene(), bpy.context.view_layer)
    for rig in recorded().known():
        rig.clear()
    scene().sinew_accelerates_rigs = True
    scene().frame_set(8)
    for name in armatures:
        yield from until_played(name, "no rig is accelerated")
    _rate, seen = yield from playing(15.0, 40)
    assert len(set(seen)) >= 5, f"only {len(set(seen))} frames were shown"
    assert all(map(is_played, armatures))
    assert not any(len(rig.motion.record) > 1 for rig in recorded().known())  # the one on which they were still live
    scene().frame_set(8)
    assert_as(reference, meshes)
    yield from pick(meshes[0])
    yield from picture("accelerated-rig")
    yield from pose_key_and_undo(meshes, armatures, reference)
    for name in armatures:
        yield from until_played(name, "what was posed is not accelerated again")
    scene().frame_set(13)
    assert_as(reference, meshes)
    print(f"window: two rigs were accelerated, {len(set(seen))} different frames, and one was posed and undone")
    yield from motion_paths(armatures)


def motion_paths(armatures):
    settings = addon_module("main.addon_preferences").of_sinew().onion
    select(bpy.data.objects[armatures[1]])
    with in_area("VIEW_3D"):
        bpy.ops.object.mode_set(mode="POSE")
        bpy.ops.pose.select_all(action="SELECT")
    settings.shows_paths, settings.path_frames = True, 6
    for step in range(40):  # the rig is read again, or accelerated again
        yield 0.5
        with in_area("VIEW_3D"):
            found = addon_module("onion.motion_paths").shown(bpy.context)
        if step > 4 and found:
            break
    paths = yield from seen("motion-paths")
    with in_area("VIEW_3D"):
        bpy.ops.pose.select_all(action="DESELECT")
    none = yield from seen("without-paths")
    assert (paths != none).mean() > 0.005, "there are no paths"
    settings.property_unset("shows_paths")
    settings.property_unset("path_frames")
    with in_area("VIEW_3D"):
        bpy.ops.object.mode_set(mode="OBJECT")
    print("window: motion paths are drawn")


run(steps())
