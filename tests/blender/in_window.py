"""What only a window does: drawing while it plays, and rendering with F12, which calls the handlers from
another thread while the interface goes on. Run in a Blender with a window, on the installed add-on:

    blender --python tests/blender/in_window.py -- FOLDER

Pictures go to FOLDER. The process ends with 1 if something was wrong.
"""

import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from characters import accelerate, add_shape_keys, make_armature, make_mesh, pose
from helpers import addon_module, assert_same_shape, depsgraph, select, twin_of
from test_readers import is_seen_alike
from windowed import FOLDER, camera, pixels, playing, run, when_allowed, window

FRAMES = range(1, 31)


def steps():
    """What happens, one step after the other."""
    scene = bpy.context.scene
    for ob in list(bpy.data.objects):
        bpy.data.objects.remove(ob)
    scene.frame_start, scene.frame_end = FRAMES[0], FRAMES[-1]
    armature = make_armature()
    ob = make_mesh(armature, False)
    add_shape_keys(ob)
    twin = twin_of(ob)
    for frame in (1, 10, 20, 30):
        pose(armature, frame, False)
    accelerate(ob)
    yield 0.5

    seen, waited = set(), 0
    while len(seen) < 20 and waited < 30:
        waited += 1
        seen.update((yield from playing(2.0))[1])
    assert len(seen) >= 20, f"only {len(seen)} frames were shown"
    assert_same_shape(ob, twin)
    print(f"window: played {len(seen)} different frames")

    for frame in (3, 17, 8):
        scene.frame_set(frame)
        yield 0.1  # from here on in a timer
        assert_same_shape(ob, twin)
        assert is_seen_alike((ob, twin), depsgraph())
    armature.pose.bones["bone1"].location.x = 0.4
    yield 0.3
    assert_same_shape(ob, twin)
    print("window: scrubbed, and followed a bone moved by hand")

    camera(scene)
    pictures = []
    for number, (shown, hidden) in enumerate(((ob, twin), (twin, ob))):
        shown.hide_render, hidden.hide_render = False, True
        scene.render.filepath = str(FOLDER / f"{number}-")
        done = []
        for handlers in (bpy.app.handlers.render_complete, bpy.app.handlers.render_cancel):
            handlers.append(lambda *_, done=done: done.append(True))
        with window():
            bpy.ops.screen.animation_play()  # Blender stops it, and starts nothing while it renders
            bpy.ops.render.render("INVOKE_DEFAULT", animation=True)
        yield from playing_with_the_interface(armature.pose.bones["bone1"], twin, done)
        pictures.append([pixels(FOLDER / f"{number}-{frame:04}.png") for frame in FRAMES])
    ours, theirs = map(np.array, pictures)
    assert np.abs(ours - theirs).mean() < 0.5 / 255, "F12 renders another shape than the modifier's"
    assert np.abs(ours[0] - ours[12]).mean() > 1 / 255
    assert addon_module("run.characters").character(ob).status.error == ""
    print(f"window: F12 rendered {len(FRAMES)} frames as the modifier does")
    yield from stencils_are_found(armature)


def stencils_are_found(armature):
    """While nobody does anything. Then they are played, and survive an undo."""
    ob = make_mesh(armature, False)
    ob.modifiers.new("Subdivision", "SUBSURF").levels = 2
    ob.modifiers.new("Warp", "UV_WARP")
    twin = twin_of(ob)
    names = ob.name, twin.name
    accelerate(ob)
    bpy.ops.ed.undo_push(message="Accelerate")
    tail = yield from tail_found(ob.name)
    assert tail == ("Subdivision",) and len(bpy.data.scenes) == 1
    yield from playing(1.0)
    assert_same_shape(ob, twin)
    assert addon_module("run.characters").character(ob).is_deforming
    ob.location.x = twin.location.x = 1.0
    bpy.ops.ed.undo_push(message="Move")
    yield 0.5
    with window():
        bpy.ops.ed.undo()
    ob, twin = (bpy.data.objects[name] for name in names)
    assert ob.location.x == 0.0 and (yield from tail_found(ob.name)) == ("Subdivision",)
    yield from playing(1.0)
    assert_same_shape(ob, twin)
    print("window: stencils were found and played")


def tail_found(name, seconds=30.0):
    """Waits until the tail of that object is computed natively, and returns its names."""
    characters, waited = addon_module("run.characters"), 0.0
    while waited < seconds:
        yield 0.2
        waited += 0.2
        entry = characters.character(bpy.data.objects[name])
        if entry.way.tail is not None and entry.is_wired:
            return entry.way.tail.names
    raise AssertionError(f"no stencils after {seconds} seconds: {entry.planning.sought} {entry.way}")


def playing_with_the_interface(bone, ob, done):
    """Until it is done, somebody selects this and that, moves the bone by hand and puts it back. It is keyed: what
    is rendered does not depend on that."""
    moved = 0
    before = bone.location.copy()

    def select_and_move():
        select(ob if moved % 2 else bone.id_data)
        bone.location = before
        bone.location.x += 0.5

    def put_back():
        bone.location = before

    while not done:
        yield from when_allowed(select_and_move)
        moved += 1
        yield 0.05
        yield from when_allowed(put_back)
        yield 0.05
    yield 0.5
    assert moved > 2, "the interface stood still while F12 rendered"
    print(f"window: a bone was moved {moved} times while F12 rendered")


run(steps())
