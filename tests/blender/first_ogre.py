"""The manual's first ogre, by mouse and keyboard: import, sidebar, play, pose a bone, scrub, undo, render;
and the pictures that the manual shows. Run in a Blender with a window, on the installed add-on:

    hand.sh FOLDER blender --python tests/blender/first_ogre.py -- FOLDER
"""

import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler

sys.path.insert(0, str(Path(__file__).parent))
from helpers import RIGS, addon_module, assert_same_shape, builtin_copy, evaluated, select
from windowed import (
    FOLDER,
    area,
    areas,
    choose_a_bone,
    close_other_windows,
    in_area,
    middle_of,
    note_drawing,
    open_sidebar,
    outside,
    picture,
    playing,
    region,
    run,
    screen,
    window,
    windows,
)

FRAMES = 100  # that are played
SECONDS = 8.0  # of playing to compare


def steps():
    scene = bpy.context.scene
    for ob in list(bpy.data.objects):
        bpy.data.objects.remove(ob)
    scene.render.fps = 240  # as fast as it goes
    bpy.context.preferences.view.filebrowser_display_type = "SCREEN"  # no window manager places windows here
    yield 0.5
    yield from import_by_file_browser()
    ob = windows()[0].view_layer.objects.active
    assert ob.sinew.is_bound and ob.name == "ogre", ob
    print("window: imported the ogre")
    yield from open_sidebar()
    yield from look_from_the_front_left()
    scene.frame_set(9)
    yield from picture("window")
    yield from play(ob)
    yield from show_weights(ob)
    yield from pose_a_bone(ob)
    yield from scrub()
    yield from render()
    yield from pictures_of_properties_and_preferences()
    yield from an_error()


def import_by_file_browser():
    """Opens it, looks, and has the file chosen."""
    with in_area("VIEW_3D"):
        bpy.ops.import_scene.sinew_rig("INVOKE_DEFAULT", filepath=str(RIGS["ogre"]), pose="walk.dmat")
    yield 1.5
    browser = next(window for window in windows() for each in window.screen.areas if each.type == "FILE_BROWSER")
    yield from picture("import")
    addon_module("feedback.progress").SHOWN_AFTER = 0  # in the status bar, however quick this machine is
    with bpy.context.temp_override(window=browser, area=browser.screen.areas[0]):
        space = browser.screen.areas[0].spaces.active
        assert space.params.filename == "skeleton.bf"
        bpy.ops.file.execute()
    for _ in range(20):
        yield 0.5
        if "ogre" in bpy.data.objects:
            break


def look_from_the_front_left():
    view = area("VIEW_3D")
    view.spaces.active.region_3d.view_rotation = Euler((np.radians(80), 0, np.radians(-32))).to_quaternion()
    view.spaces.active.overlay.show_floor = True
    view.spaces.active.clip_end = 10000
    with in_area("VIEW_3D"):
        bpy.ops.view3d.view_selected()
    yield 1.0
    view.spaces.active.region_3d.view_distance *= 0.8
    yield 0.5


def play(ob):
    """With Sinew, and with Blender's own modifier on keyframes of the same motion: who is faster, in a
    window that is drawn by the processor."""
    rate, seen = yield from playing(120, FRAMES)
    assert len(seen) >= FRAMES and set(seen) >= set(range(5, 30)), seen
    assert addon_module("run.characters").character(ob).status.error == ""
    armature = ob.sinew.armature
    with window():
        select(ob)
        bpy.ops.object.sinew_clip_to_keyframes()
    assert ob.sinew.source == "ARMATURE"
    rates = {"Sinew, poses of the rig": rate}
    rates["Sinew, keyframes"] = (yield from playing(SECONDS))[0]
    binding = addon_module("install.bind")
    binding.unbind(ob)
    yield 0.3
    rates["Armature modifier"] = (yield from playing(SECONDS))[0]
    binding.bind(ob, armature)
    armature.sinew_clip.mode = "PLAYBACK"
    for name, rate in rates.items():
        print(f"window: {rate:.1f} frames a second, {name}")


def show_weights(ob):
    shading = area("VIEW_3D").spaces.active.shading
    before = shading.color_type
    with in_area("VIEW_3D"):
        bpy.ops.object.sinew_show_weights()
    assert "Sinew Weights" in ob.data.attributes and shading.color_type == "VERTEX"
    bpy.context.scene.frame_set(3)
    bpy.context.scene.frame_set(9)
    yield from picture("weights")
    with in_area("VIEW_3D"):
        bpy.ops.object.sinew_show_skeleton()
    assert not ob.sinew.armature.visible_get()
    yield 0.2
    with in_area("VIEW_3D"):
        bpy.ops.object.sinew_show_skeleton()
        bpy.ops.object.sinew_show_weights()
    assert ob.sinew.armature.visible_get()
    assert "Sinew Weights" not in ob.data.attributes and shading.color_type == before


def pose_a_bone(ob):
    """R and the mouse, in Pose Mode, then Ctrl-Z."""
    armature = ob.sinew.armature
    armature.animation_data.action = None
    twin = builtin_copy(ob)
    bone = choose_a_bone(armature)
    name, twin_name, bone_name = ob.name, twin.name, bone.name
    before = evaluated(ob)
    yield 0.5
    x, y = middle_of(region(area("VIEW_3D")))
    yield from outside(f"xdotool mousemove {screen(x + 150, y)}")
    yield from outside("xdotool key r")
    yield from outside(f"xdotool mousemove {screen(x + 120, y + 60)}")
    yield from outside(f"xdotool mousemove {screen(x + 80, y + 120)}")
    yield 0.3
    during = evaluated(ob)
    assert np.abs(during - before).max() > 0.05, "the mesh does not follow while the mouse moves"
    yield from picture("posing")
    yield from outside("xdotool click 1")
    yield 0.5
    after = evaluated(ob)
    assert np.abs(after - before).max() > 0.05, f"{bone_name} has not moved the mesh"
    assert_same_shape(ob, twin)
    yield from outside("xdotool key ctrl+z")
    yield 1.0
    ob, twin = bpy.data.objects[name], bpy.data.objects[twin_name]
    assert np.allclose(evaluated(ob), before, atol=1e-5), "undo does not bring the shape back"
    assert_same_shape(ob, twin)
    print(f"window: turned {bone_name} with the mouse, undid it")
    bpy.data.objects.remove(twin)
    with in_area("VIEW_3D"):
        bpy.ops.object.mode_set(mode="OBJECT")
        select(ob)
    ob.sinew.source = "CLIP"
    yield 0.3


def scrub():
    """Drags the mouse along the timeline."""
    ob, scene = bpy.data.objects["ogre"], bpy.context.scene
    timeline = region(next(each for each in areas() if each.type in {"DOPESHEET_EDITOR", "TIMELINE"}))
    y = timeline.y + timeline.height - 10
    places = [timeline.x + timeline.width * share for share in (0.3, 0.35, 0.42, 0.5, 0.55)]
    seen = [(scene.frame_current, evaluated(ob))]
    yield from outside(f"xdotool mousemove {screen(places[0], y)} mousedown 1")
    for x in places[1:]:
        yield from outside(f"xdotool mousemove {screen(x, y)}")
        yield 0.2
        seen.append((scene.frame_current, evaluated(ob)))
    yield from outside("xdotool mouseup 1")
    yield 0.3
    assert len({frame for frame, _ in seen}) >= 3, [frame for frame, _ in seen]
    assert np.abs(seen[-1][1] - seen[1][1]).max() > 1e-3
    print("window: scrubbed over frames", sorted({frame for frame, _ in seen}))


def render():
    """F12."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 4, False
    scene.render.resolution_x, scene.render.resolution_y = 480, 320
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    light = bpy.data.objects.new("light", bpy.data.lights.new("light", "SUN"))
    light.rotation_euler = (0.7, 0.3, 0)
    light.data.energy = 4
    for each in (camera, light):
        scene.collection.objects.link(each)
    scene.camera, camera.data.clip_end = camera, 10000
    with in_area("VIEW_3D"):
        bpy.ops.view3d.camera_to_view()
    done = []
    bpy.app.handlers.render_complete.append(lambda *_: done.append(True))
    yield from outside(f"xdotool mousemove {screen(*middle_of(region(area('VIEW_3D'))))}")
    yield from outside("xdotool key F12")
    for _ in range(300):
        if done:
            break
        yield 0.2
    assert done, "F12 renders nothing"
    yield 1.0
    with window():
        bpy.data.images["Render Result"].save_render(str(FOLDER / "render.png"))
    image = bpy.data.images.load(str(FOLDER / "render.png"))
    pixels = np.array(image.pixels[:]).reshape(-1, 4)[:, :3]
    assert pixels.std() > 0.02, "the picture is empty"
    yield from picture("rendered")
    print("window: rendered with F12")
    close_other_windows()
    yield 0.5


def pictures_of_properties_and_preferences():
    ob = bpy.data.objects["ogre"]
    bpy.context.scene.frame_set(9)
    view = area("VIEW_3D").spaces.active.region_3d
    if view.view_perspective == "CAMERA":
        view.view_perspective = "PERSP"
    for name in ("camera", "light"):
        bpy.data.objects.remove(bpy.data.objects[name])
    with in_area("VIEW_3D"):
        select(ob)
    properties = area("PROPERTIES")
    properties.spaces.active.context = "MODIFIER"
    yield 1.0
    main, drawn = region(properties), note_drawing(addon_module("ui.panels").ModifiersMain)
    for down in (93, 60, 76, 110):  # its header: Blender remembers that it is closed
        if not drawn:
            yield from outside(f"xdotool mousemove {screen(main.x + 60, main.y + main.height - down)} click 1")
            yield 0.5
        if not drawn:
            yield from outside("xdotool key Escape")
    assert drawn, "there is no section among the modifiers"
    yield from outside(f"xdotool mousemove {screen(main.x + 60, main.y + 30)}")
    yield from picture("properties")
    addon_module("install.bind").unbind(ob)
    yield from picture("accelerate")
    addon_module("install.bind").bind(ob, ob.modifiers["Armature"].object)
    with window():
        bpy.ops.preferences.addon_show(module=addon_module("run.characters").__package__)
    yield 1.0
    yield from outside("xdotool search --name Preferences windowmove 220 60")
    yield from picture("preferences")


def an_error():
    """A sentence pops up, once, and Blender's own modifier goes on deforming."""
    ob, notice = bpy.data.objects["ogre"], addon_module("feedback.notice")
    close_other_windows()
    yield 0.5
    shown, show = [], notice._show_now
    notice._show_now = lambda sentence: shown.append(sentence) or show(sentence)
    chain = addon_module("chain.chain").Chain
    poses, chain.poses = chain.poses, lambda *_: (_ for _ in ()).throw(MemoryError("There is no memory left"))
    for frame in (3, 4, 5):
        bpy.context.scene.frame_set(frame)
        yield 0.5
    assert len(shown) == 1 and "Sinew cannot deform ogre" in shown[0], shown
    assert_same_shape(ob, builtin_copy(ob))
    yield from picture("error")
    chain.poses = poses
    print("window: told what is wrong")


run(steps())
