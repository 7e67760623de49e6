"""G in Object Mode on a native rig whose armature object has keyframes: with and without auto-keying, undone, and
compared with what Blender alone shows. Run as first_ogre.py is."""

import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from characters import make_armature, make_mesh, pose
from helpers import addon_module, select
from windowed import area, in_area, middle_of, outside, picture, playing, region, run, screen, until, window

FRAMES = (3, 10, 33)


def one(kind):
    """Undo replaces objects."""
    return next(each for each in bpy.data.objects if each.type == kind)


def known():
    return addon_module("played.rigs").get(one("ARMATURE"))


def is_native():
    return known() is not None and known().is_played


def places():
    graph = bpy.context.evaluated_depsgraph_get()
    own = [one("ARMATURE"), one("MESH")]
    every = [each for ob in own for each in (ob, ob.evaluated_get(graph))]
    return [tuple(row) for each in every for row in each.matrix_world]


def make_character():
    armature = make_armature()
    for frame in (1, 20, 40):
        pose(armature, frame, scaled=True)
    ob = make_mesh(armature, False)
    ob.parent = armature
    for frame, x in ((1, 0.0), (20, 2.0), (40, 4.0)):
        armature.location, armature.rotation_euler = (x, 0, x / 2), (0, x / 3, 0)
        for path in ("location", "rotation_euler"):
            armature.keyframe_insert(path, frame=frame)
    return ob


def drag():
    """G, and the mouse in steps. Yields; the mesh goes along at each."""
    x, y = middle_of(region(area("VIEW_3D")))
    yield from outside(f"xdotool mousemove {screen(x, y)}")
    yield from outside("xdotool key g")
    seen = set()
    for step in range(1, 6):
        yield from outside(f"xdotool mousemove {screen(x + 20 * step, y + 10 * step)}")
        found = places()
        seen.add(str(found))
        assert found[:4] == found[4:8] and found[8:12] == found[12:], "originals are not where the copies are"
        assert (one("MESH").matrix_world.translation - one("ARMATURE").matrix_world.translation).length < 1e-5
    assert len(seen) >= 4, "G moves nothing"
    yield from outside("xdotool click 1")
    yield 0.5


def steps():
    for each in list(bpy.data.objects):
        bpy.data.objects.remove(each)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 40
    addon_module("played.accelerating").LEAST_WORK = 0
    ob = make_character()
    scene.frame_set(5)
    with in_area("VIEW_3D"):
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_all()
        select(ob)
        assert bpy.ops.object.sinew_bind() == {"FINISHED"}
    if not addon_module("description.reading").CAN_READ:
        return print("window: rigs are Blender's before 4.2")
    yield from until(is_native)
    yield from playing(1)
    assert is_native(), known().reason
    scene.frame_set(10)
    before = places()
    with in_area("VIEW_3D"):
        select(one("ARMATURE"))
        bpy.ops.ed.undo_push(message="selected")
    yield 0.5
    yield from drag()
    assert places() != before and known().is_idle, known().reason
    yield from picture("moved")
    for frame in (11, 10):
        scene.frame_set(frame)
        yield 0.3
    assert places() == before and is_native(), "without a key it is where its keyframes are"

    scene.tool_settings.use_keyframe_insert_auto = True
    yield from drag()
    keyed = places()
    for frame in (12, 10):
        scene.frame_set(frame)
        yield 0.3
    assert np.allclose(places(), keyed, atol=1e-6) and places() != before, "the key is not played"
    yield from until(is_native)
    yield from compare()
    with window():
        bpy.ops.ed.undo()
    yield 1.0
    yield from compare()


def compare():
    """With Blender alone."""
    scene = bpy.context.scene
    for frame in FRAMES:
        scene.frame_set(frame)
        yield 0.2
        ours = places()
        scene.sinew_accelerates_rigs = False
        yield 0.3
        scene.frame_set(frame + 1)
        scene.frame_set(frame)
        assert not is_native() and places() == ours, frame
        scene.sinew_accelerates_rigs = True
        yield from until(is_native)


run(steps())
