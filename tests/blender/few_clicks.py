"""From the installed add-on to a faster Rigify character by hand, as the manual's first page counts it: a click on the
character, N, a click on the tab, a click on Accelerate. The rig becomes native by itself. Run as first_ogre.py is.
"""

import sys
from pathlib import Path

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).parent))
import rigify_characters
from helpers import ROOT, addon_module, select
from windowed import area, in_area, middle_of, open_sidebar, outside, picture, region, run, screen, until

MOST_ACTS = 5


def steps():
    if not addon_module("description.reading").CAN_READ:
        return print("window: rigs are Blender's before 4.2")
    for each in list(bpy.data.objects):
        bpy.data.objects.remove(each)
    body, rig = character()
    view = area("VIEW_3D")
    view.spaces.active.region_3d.view_distance = 4.0
    with in_area("VIEW_3D"):
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_all()
    select()
    bpy.context.view_layer.objects.active = None
    yield 1.0
    acts = 0
    place = location_3d_to_region_2d(region(view), view.spaces.active.region_3d, Vector((0, 0, 1)))
    yield from outside(f"xdotool mousemove {screen(region(view).x + place.x, region(view).y + place.y)} click 1")
    yield 0.5
    acts += 1
    assert bpy.context.view_layer.objects.active in (body, rig), bpy.context.view_layer.objects.active
    yield from open_sidebar()  # by N and a click on the tab, wherever that is
    acts += 2
    side = region(view, "UI")
    for down in range(40, 100, 6):  # below the panel's header and a line of text
        if not body.sinew.is_bound:
            x, y = side.x + side.width / 2, side.y + side.height - down
            yield from outside(f"xdotool mousemove {screen(x, y)} click 1")
            yield 0.3
    acts += 1
    assert body.sinew.is_bound, "a click on Accelerate has no effect"
    known = addon_module("played.rigs")
    yield from until(lambda: known.get(rig) is not None and known.get(rig).is_played)
    yield from until(lambda: known.get(rig).source.milliseconds > 0)
    yield from outside(f"xdotool mousemove {screen(*middle_of(region(view)))}")
    yield from picture("few-clicks")
    text = addon_module("ui.rig_cures").text_of(rig)[0]
    assert text.startswith("Rig: native, ") and "times faster" in text, text
    assert acts <= MOST_ACTS
    words = "one two three four five".split()[acts - 1]
    assert f"in {words} steps" in " ".join((ROOT / "docs" / "README.md").read_text(encoding="utf-8").split())
    print(f"window: a Rigify character is faster after {acts} steps: {text.splitlines()[0]}")


def character():
    """Returns a body of 8,000 vertices and Rigify's human, by keyframes, that moves it."""
    rig = rigify_characters.character(rigify_characters.HUMAN)
    for frame in (1, 20):
        torso = rig.pose.bones["torso"]
        torso.location.z = 0.01 * frame
        torso.keyframe_insert("location", frame=frame)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=100, ring_count=80, radius=1, location=(0, 0, 1))
    body = bpy.context.active_object
    body.name, body.scale = "Body", (0.35, 0.25, 0.9)
    bpy.ops.object.transform_apply(location=True)
    deforming = [bone for bone in rig.data.bones if bone.use_deform]
    middles = np.array([(bone.head_local + bone.tail_local) / 2 for bone in deforming])
    groups = [body.vertex_groups.new(name=bone.name) for bone in deforming]
    for vertex in body.data.vertices:
        groups[int(np.linalg.norm(middles - np.array(vertex.co), axis=1).argmin())].add((vertex.index,), 1.0, "ADD")
    body.modifiers.new("Armature", "ARMATURE").object = rig
    bpy.context.scene.frame_end = 20
    return body, rig


run(steps())
