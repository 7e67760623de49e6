"""Baking in a window: it goes on while Blender draws, Esc stops it, it goes on there, and the cache plays. Run as
first_ogre.py is.
"""

import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from characters import accelerate, make_armature, make_mesh, pose, smoothed
from helpers import addon_module, evaluated, select
from windowed import FOLDER, area, in_area, middle_of, outside, region, run, screen

FRAMES = range(1, 1501)
PATH = FOLDER / "bake" / "Tube.pc2"


def steps():
    scene = bpy.context.scene
    for each in list(bpy.data.objects):
        bpy.data.objects.remove(each)
    armature = make_armature()
    ob = make_mesh(armature, False)
    for frame in (1, 700, 1500):
        pose(armature, frame, False)
    smoothed(ob, "Slow", iterations=300)  # so that there is time for Esc
    accelerate(ob)
    select(ob)
    scene.frame_start, scene.frame_end = FRAMES[0], FRAMES[-1]
    scene.frame_set(9, subframe=0.5)
    yield 0.5

    start()
    yield 1.0
    yield from outside(f"xdotool mousemove {screen(*middle_of(region(area('VIEW_3D'))))}")
    yield from outside("xdotool key Escape")
    yield 1.0
    assert (scene.frame_current, scene.frame_subframe) == (9, 0.5) and not PATH.exists()
    _, marks = addon_module("bake.part_files").read_marks(str(PATH))
    assert 0 < marks.sum() < len(FRAMES), marks.sum()
    print(f"window: Esc stopped a bake after {marks.sum()} frames, and the frame is the same")

    start(play=True)
    for _ in range(600):
        if PATH.exists():
            break
        yield 0.2
    yield 1.0
    assert addon_module("bake.verify").problems(str(PATH)) == []
    assert (scene.frame_current, scene.frame_subframe) == (9, 0.5)
    assert ob.modifiers[-1].type == "MESH_CACHE" and not ob.modifiers["Armature"].show_viewport
    layout = addon_module("bake.subject").of_cache(str(PATH)).layout
    for frame in (1, 600, 1500):
        scene.frame_set(frame)
        baked = addon_module("bake.point_cache").read_frame(PATH, layout, frame - 1)
        assert np.abs(evaluated(ob) - baked).max() < 1e-5
    print("window: it went on there, and the cache plays")


def start(**options):
    with in_area("VIEW_3D"):
        bpy.ops.object.sinew_bake("EXEC_DEFAULT", directory=str(FOLDER / "bake"), **options)


run(steps())
