"""Weights made in a window: Blender draws meanwhile, Esc stops it and changes nothing, one Ctrl Z takes everything
back, and the panel shows the report. Run as first_ogre.py is.
"""

import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from characters import make_armature, make_tube
from helpers import addon_module, select
from windowed import area, in_area, middle_of, open_sidebar, outside, picture, region, run, screen, until

NAME = "Tube"


def steps():
    for each in list(bpy.data.objects):
        bpy.data.objects.remove(each)
    armature = make_armature()
    ob = make_tube()
    ob.vertex_groups.clear()
    subdivision = ob.modifiers.new("Fine", "SUBSURF")
    subdivision.levels = 4  # so that there is time for Esc
    select(ob)
    with in_area("VIEW_3D"):
        bpy.ops.object.modifier_apply(modifier="Fine")
        bpy.ops.view3d.view_selected()
    select(armature, ob)
    with in_area("VIEW_3D"):
        bpy.ops.ed.undo_push(message="before")
    yield from outside(f"xdotool mousemove {screen(*middle_of(region(area('VIEW_3D'))))}")

    bind()
    assert groups() == 0
    yield from outside("xdotool key Escape")
    yield 1.0
    assert groups() == 0 and bpy.data.objects[NAME].parent is None
    print("window: Esc stopped it, and nothing has changed")

    bind()
    yield from until(lambda: groups() > 0)
    ob = bpy.data.objects[NAME]
    assert ob.parent is not None and len(ob.modifiers) == 1 and weightless(ob) == 0
    report = addon_module("weights.reports").last([NAME])
    print(f"window: {report.sentence()}")
    yield from open_sidebar()
    with in_area("VIEW_3D"):
        bpy.ops.object.sinew_show_bone_lines(ends="CHILD")
    yield from picture("weights")
    with in_area("VIEW_3D"):
        bpy.ops.object.sinew_show_bone_lines(ends="CHILD")

    yield from outside(f"xdotool mousemove {screen(*middle_of(region(area('VIEW_3D'))))}")
    check()
    yield from outside("xdotool key Escape")
    yield 1.0
    assert addon_module("weights.reports").last([NAME]) == report
    check()
    yield from until(lambda: addon_module("weights.reports").last([NAME]) != report)
    print(f"window: Esc stopped a check; another said {addon_module('weights.reports').last([NAME]).sentence()}")

    yield from outside(f"xdotool mousemove {screen(*middle_of(region(area('VIEW_3D'))))} key ctrl+z")
    yield 1.0
    ob = bpy.data.objects[NAME]
    assert (groups(), ob.parent, len(ob.modifiers)) == (0, None, 0)
    print("window: one Ctrl Z took everything back")

    yield from in_weight_paint()


def in_weight_paint():
    armature = bpy.data.objects["Rig"]
    bpy.data.objects.remove(bpy.data.objects[NAME])
    ob = make_tube()
    ob.name = NAME
    ob.vertex_groups.clear()
    ob.modifiers.new("Armature", "ARMATURE").object = armature
    select(armature)
    with in_area("VIEW_3D"):
        bpy.ops.object.mode_set(mode="POSE")
        addon_module("blender.selection").select_bones(armature, ("bone1", "bone2"))
    select(ob, armature)
    with in_area("VIEW_3D"):
        bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
        bpy.ops.ed.undo_push(message="before")
        assert bpy.ops.object.sinew_assign_from_bones("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    yield from until(lambda: groups() > 0)
    yield 0.5
    ob = bpy.data.objects[NAME]
    assert [group.name for group in ob.vertex_groups] == ["bone1", "bone2"]
    assert 0 < weightless(ob) < len(ob.data.vertices)  # what is nearer to the other bones is left to them
    yield from picture("weights-painted")
    yield from outside(f"xdotool mousemove {screen(*middle_of(region(area('VIEW_3D'))))} key ctrl+z")
    yield 1.0
    assert (groups(), bpy.context.mode) == (0, "PAINT_WEIGHT")
    print("window: bones assigned in Weight Paint, and taken back")


def bind():
    with in_area("VIEW_3D"):
        assert bpy.ops.object.sinew_parent_with_weights("INVOKE_DEFAULT") == {"RUNNING_MODAL"}


def check():
    with in_area("VIEW_3D"):
        assert bpy.ops.object.sinew_check_weights("INVOKE_DEFAULT") == {"RUNNING_MODAL"}


def groups():
    return len(bpy.data.objects[NAME].vertex_groups)


def weightless(ob):
    offsets, _groups, _weights = addon_module("blender.meshes").read_weights(ob.data)
    return np.count_nonzero(np.diff(offsets) == 0)


run(steps())
