"""Weight Paint's brush, in a view: with Auto Normalize, it paints what it paints on a twin that Blender's own modifier
deforms. Run in a Blender with a window, on the installed add-on:

    hand.sh FOLDER blender --python tests/blender/in_weight_paint.py -- FOLDER
"""

import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from characters import accelerate, add_shape_keys, make_armature, make_mesh, pose
from helpers import addon_module, assert_same_shape, select, twin_of, way
from windowed import area, in_area, picture, region, run, window

DABS = (0.0, 0.05)  # how far from the middle of the view, as a share of its height


def steps():
    if bpy.app.version >= (4, 3, 0):
        print("window: no brush is tried, for Debian's 4.3 has none and 5.2's takes no stroke from a script")
        return
    for ob in list(bpy.data.objects):
        bpy.data.objects.remove(ob)
    bpy.context.preferences.view.smooth_view = 0
    armature = make_armature()
    for keys in (False, True):
        ob = make_mesh(armature, False)
        ob.parent = armature
        group = ob.vertex_groups.new(name="no bone")
        group.add(range(1200), 0.25, "REPLACE")
        if keys:
            add_shape_keys(ob)
        twin = twin_of(ob)
        pose(armature, 1, False)
        accelerate(ob)
        yield 0.5
        before, after = weights(ob), []
        meshes = ob, twin
        for each in meshes:
            for other in meshes:
                other.hide_set(other != each)
            yield from paint(each, f"painted-{len(after)}-{keys}")
            after.append(weights(each))
        for each in meshes:
            each.hide_set(False)
        yield 0.3
        check(ob, before, *after)
        assert_same_shape(ob, twin)
        assert way(ob) == ("KEYS" if keys else "ATTRIBUTE")
        assert addon_module("run.characters").character(ob).status.error == ""
        print(f"window: painted weights {'with' if keys else 'without'} shape keys as on the twin")
        for each in meshes:
            bpy.data.objects.remove(each)


def weights(ob):
    """(V, groups), 0 where a vertex is not in the group."""
    found = np.zeros((len(ob.data.vertices), len(ob.vertex_groups)))
    for vertex in ob.data.vertices:
        for entry in vertex.groups:
            found[vertex.index, entry.group] = entry.weight
    return found


def paint(ob, name):
    """Some dabs on the vertex group of one bone."""
    select(ob)
    ob.vertex_groups.active_index = ob.vertex_groups["bone2"].index
    with in_area("VIEW_3D"):
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_selected()  # in Weight Paint it would look at the last stroke
        bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
    settings = bpy.context.scene.tool_settings
    settings.use_auto_normalize = True
    paint_settings = settings.weight_paint
    unified = getattr(paint_settings, "unified_paint_settings", None) or settings.unified_paint_settings  # 5.0, before
    unified.use_unified_size = unified.use_unified_weight = unified.use_unified_strength = True
    unified.size, unified.weight, unified.strength = 60, 1.0, 1.0
    yield 1.0
    view = region(area("VIEW_3D"))
    for share in DABS:
        with in_area("VIEW_3D"):
            bpy.ops.paint.weight_paint(stroke=[dab(view, share, is_start) for is_start in (True, False)])
        yield 0.3
    yield from picture(name)
    with window():
        bpy.ops.object.mode_set(mode="OBJECT")


def dab(view, share, is_start):
    """A point of a stroke, as the mouse would give it, but the same one whatever the machine has to do meanwhile."""
    place = (view.width / 2, view.height * (0.5 + share))
    return {
        "name": "",
        "is_start": is_start,
        "location": (0, 0, 0),
        "mouse": place,
        "mouse_event": place,
        "pressure": 1.0,
        "size": 60.0,
        "time": 0.0,
        "pen_flip": False,
        "x_tilt": 0.0,
        "y_tilt": 0.0,
    }


def check(ob, before, ours, theirs):
    painted = np.abs(theirs - before).max(axis=1) > 1e-3
    assert painted.sum() > 20, "the brush has painted nothing"
    assert np.abs(ours - theirs).max() < 1e-4
    bones = [group.name != "no bone" for group in ob.vertex_groups]
    assert np.allclose(ours[painted][:, bones].sum(axis=1), 1, atol=1e-4), "Auto Normalize did not"
    assert np.array_equal(ours[:, -1], before[:, -1]), "a group that is no bone's was normalized"


run(steps())
