"""Where the time goes, in a window: the ogre with shape keys and smoothing is measured while Blender draws, Esc stops
it, and the button of its row accelerates it; and the manual's picture. Run as first_ogre.py is.
"""

import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from helpers import addon_module, import_rig, select
from windowed import FOLDER, area, in_area, middle_of, open_sidebar, outside, picture, region, run, screen

KEYS = 20
FRAMES = range(1, 21)


def steps():
    scene = bpy.context.scene
    for each in list(bpy.data.objects):
        bpy.data.objects.remove(each)
    ui, costs = addon_module("ui.profile"), addon_module("profiling.costs")
    ui.SidebarProfile.bl_options = set()  # open
    bpy.utils.unregister_class(ui.SidebarProfile)
    bpy.utils.register_class(ui.SidebarProfile)
    yield 0.5
    with in_area("VIEW_3D"):
        ob = ogre()
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "ogre.blend"), copy=True)
    view = area("VIEW_3D")
    view.spaces.active.clip_end = 10000
    with in_area("VIEW_3D"):
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_selected()
    yield from open_sidebar()
    scene.frame_set(9, subframe=0.5)

    start()
    yield 1.0
    yield from outside(f"xdotool mousemove {screen(*middle_of(region(view)))}")
    yield from outside("xdotool key Escape")
    yield 1.0
    assert not costs.last and (scene.frame_current, scene.frame_subframe) == (9, 0.5)
    print("window: Esc stops measuring, and the frame is the same")

    start()
    for _ in range(300):
        if costs.last:
            break
        yield 0.5
    (profile,) = costs.last
    assert profile.frames == list(FRAMES) and profile.objects[0].name == ("ogre", None)
    assert (scene.frame_current, scene.frame_subframe) == (9, 0.5) and not ob.sinew.is_bound
    assert profile.rest[0] in {costs.EVERYTHING_ELSE, costs.AT_THE_SAME_TIME}
    assert [part.name for part in profile.shared] == ["Keyframes"] and len(bpy.data.scenes) == 1
    yield from outside(f"xdotool mousemove {screen(*middle_of(region(view, 'UI')))} click --repeat 6 5")  # to the end
    yield from picture("profile")
    with in_area("VIEW_3D"):
        bpy.ops.object.sinew_accelerate_one(name=ob.name)
    assert ob.sinew.is_bound
    yield from picture("accelerated")
    print("window: measured", [(cost.name[0], round(cost.ms, 2)) for cost in profile.objects])


def ogre():
    """By keyframes and Blender's own modifiers, with shape keys before them and smoothing after."""
    ob, armature = import_rig("ogre")
    bpy.ops.object.sinew_clip_to_keyframes()
    bpy.ops.object.sinew_unbind()
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = FRAMES[0], FRAMES[-1]
    random = np.random.default_rng(1)
    ob.shape_key_add(name="Basis")
    rest = np.empty(3 * len(ob.data.vertices), np.float32)
    ob.data.vertices.foreach_get("co", rest)
    size = float(np.ptp(rest.reshape(-1, 3), axis=0).max())
    for number in range(KEYS):
        key = ob.shape_key_add(name=f"key {number}")
        place = rest.reshape(-1, 3).copy()
        centre = place[random.integers(len(place))]
        near = np.linalg.norm(place - centre, axis=1) < 0.1 * size
        place[near] += 0.01 * size * random.standard_normal(3)
        key.data.foreach_set("co", place.reshape(-1).astype(np.float32))
        for frame, value in zip((FRAMES[0], FRAMES[-1]), random.uniform(0, 1, 2)):
            key.value = value
            key.keyframe_insert("value", frame=frame)
    ob.modifiers.new("Corrective Smooth", "CORRECTIVE_SMOOTH").iterations = 5
    subdivision = ob.modifiers.new("Subdivision", "SUBSURF")
    subdivision.levels = 1
    ob.modifiers.new("Smooth", "SMOOTH")
    hat = bpy.data.objects.new("hat", bpy.data.meshes.new("hat"))
    hat.data.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    hat.modifiers.new("Solidify", "SOLIDIFY")
    bpy.context.collection.objects.link(hat)
    select(ob)
    return ob


def start():
    with in_area("VIEW_3D"):
        assert bpy.ops.scene.sinew_profile("INVOKE_DEFAULT") == {"RUNNING_MODAL"}


run(steps())
