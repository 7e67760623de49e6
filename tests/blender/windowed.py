"""What the tests in a real window share: steps that let Blender draw in between, and a hand outside of
Blender that moves the mouse, types and takes pictures of the screen (hand.sh)."""

import faulthandler
import os
import sys
import time
import traceback
from pathlib import Path

import bpy
import numpy as np

from helpers import addon_module, deform_small_meshes, select

FOLDER = Path(sys.argv[sys.argv.index("--") + 1])
SECONDS = 400  # at most, for a whole file of steps
TRIES = 10  # to write while something renders


def run(steps):
    """Runs the generator: each `yield` lets Blender draw and go on until the next step is due, after so
    many seconds. The process ends with 0, or with 1 if something was wrong."""

    deform_small_meshes()

    def go_on():
        try:
            return next(steps)
        except StopIteration:
            leave(0)
        except BaseException:
            traceback.print_exc()
            leave(1)

    faulthandler.dump_traceback_later(SECONDS, exit=True)
    bpy.context.preferences.view.show_splash = False
    bpy.app.timers.register(go_on, first_interval=2.0, persistent=True)  # a step may open a file


def when_allowed(write):
    """Calls write(), while something renders: where a render's thread ends a property's `get` just after Sinew has
    looked, Blender refuses it once in a while."""
    for _ in range(TRIES):
        try:
            return write()
        except (AttributeError, RuntimeError) as error:
            if "not allowed" not in str(error) and "drawing/rendering" not in str(error):
                raise
            yield 0.05
    raise TimeoutError(f"Blender refused to write {TRIES} times one after the other")


def leave(code):
    print("window:", "all is well" if code == 0 else "FAILED")
    sys.stdout.flush()
    os._exit(code)  # a Blender with unsaved changes would ask


def windows():
    """The main one first."""
    return bpy.context.window_manager.windows


def window():
    """Operators called from a timer have no window of their own."""
    return bpy.context.temp_override(window=windows()[0])


def close_other_windows():
    for extra in windows()[1:]:
        with bpy.context.temp_override(window=extra):
            bpy.ops.wm.window_close()


def areas():
    return windows()[0].screen.areas


def area(kind):
    return next(area for area in areas() if area.type == kind)


def region(area, kind="WINDOW"):
    return next(region for region in area.regions if region.type == kind)


def in_area(kind):
    """As if the mouse were over it."""
    found = area(kind)
    return bpy.context.temp_override(window=windows()[0], area=found, region=region(found))


def choose_a_bone(armature):
    """Selects a bone in Pose Mode that moves much of the character. Returns it."""
    with in_area("VIEW_3D"):
        select(armature)
        bpy.ops.object.mode_set(mode="POSE")
        bpy.ops.pose.select_all(action="DESELECT")
        bone = max(
            armature.pose.bones,
            key=lambda bone: len(bone.children_recursive) * bool(bone.parent and bone.parent.parent),
        )
        (bone if hasattr(bone, "select") else bone.bone).select = True
        armature.data.bones.active = bone.bone
        bpy.ops.ed.undo_push(message="chosen a bone")
    return bone


def until(is_done, seconds=120):
    """Yields until is_done() holds."""
    for _ in range(5 * seconds):
        if is_done():
            return
        yield 0.2
    raise TimeoutError(f"it took longer than {seconds} seconds")


# --- the hand -------------------------------------------------------------------------------------


def outside(command):
    """Let the hand run a shell command. A generator: `yield from outside("xdotool key r")`."""
    (FOLDER / "todo.new").write_text(command + "\n")
    os.replace(FOLDER / "todo.new", FOLDER / "todo")
    for _ in range(100):
        yield 0.1
        if not (FOLDER / "todo").exists():
            return
    raise RuntimeError(f"nobody did: {command}")


def screen(x, y):
    """Window coordinates as the mouse has them: from the top."""
    return f"{int(x)} {windows()[0].height - int(y)}"


def middle_of(region):
    return region.x + region.width / 2, region.y + region.height / 2


def open_sidebar():
    """N, and a click on the tab."""
    view = area("VIEW_3D")
    yield from outside(f"xdotool mousemove {screen(*middle_of(region(view)))}")
    yield from outside("xdotool key n")
    yield 0.8
    side = region(view, "UI")
    assert side.width > 10, "N opens no sidebar"
    drawn = note_drawing(addon_module("ui.panels").SidebarMain)
    for down in range(100, 500, 25):  # a tab's place differs with the version's texts
        if drawn:
            break
        x, y = side.x + side.width - 8, side.y + side.height - down
        yield from outside(f"xdotool mousemove {screen(x, y)} click 1")
        yield 0.4
    assert drawn, "there is no tab of Sinew's"


def note_drawing(panel):
    """A list that grows whenever the panel is drawn."""
    drawn, draw = [], panel.draw

    def noting(self, context):
        drawn.append(True)
        draw(self, context)

    panel.draw = noting
    return drawn


def picture(name):
    """The whole screen, into the folder."""
    for window in windows():
        for each in window.screen.areas:
            each.tag_redraw()
    yield 1.0
    yield from outside(f"import -window root {FOLDER / name}.png")


def playing(seconds, frames=None):
    """Plays the animation for so long and at least four frames, or until so many frames were shown, if that is sooner.
    Yields until done; returns (frames shown a second, numbers of the frames)."""
    shown = []

    def look(scene, _graph):
        shown.append((time.perf_counter(), scene.frame_current))

    bpy.app.handlers.frame_change_post.append(look)
    with window():
        if bpy.context.screen.is_animation_playing:  # then the operator would stop it
            bpy.ops.screen.animation_cancel(restore_frame=False)
        bpy.ops.screen.animation_play()
    end = time.perf_counter() + seconds
    while time.perf_counter() < (end if len(shown) > 3 else end + 30) and (frames is None or len(shown) < frames):
        yield 0.25
    with window():
        bpy.ops.screen.animation_cancel(restore_frame=False)
    bpy.app.handlers.frame_change_post.remove(look)
    times = np.array([moment for moment, _ in shown])
    assert len(times) > 3, f"of {seconds + 30:.0f} seconds of playing {len(times)} frames were shown"
    return float(1 / np.median(np.diff(times))), [frame for _, frame in shown]


def camera(scene):
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 64, False
    scene.render.resolution_x = scene.render.resolution_y = 48
    scene.render.use_lock_interface = False
    ob = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    ob.location, ob.rotation_euler = (0, -12, 2.5), (np.pi / 2, 0, 0)
    light = bpy.data.objects.new("light", bpy.data.lights.new("light", "SUN"))
    light.rotation_euler = (0.7, 0.3, 0)
    for each in (ob, light):
        scene.collection.objects.link(each)
    scene.camera = ob


def pixels(path):
    image = bpy.data.images.load(str(path))
    numbers = np.array(image.pixels[:])
    bpy.data.images.remove(image)
    return numbers
