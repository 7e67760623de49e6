"""Every skinning method in a window, five characters side by side: computed while Blender draws, scrubbed, rendered
with F12, undone, saved and opened again. Run as in_window.py is.
"""

import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from characters import accelerate, make_armature, make_mesh, pose
from helpers import addon_module, depsgraph, diagonal, evaluated
from windowed import FOLDER, camera, pixels, run, window

METHODS = ("LINEAR", "DUAL_QUATERNION", "BLENDED", "ROTATION_CENTERS", "DIRECT_DELTA_MUSH")
FRAMES = (3, 17, 8)
RENDERED = 17


def steps():
    """What happens, one step after the other."""
    scene = bpy.context.scene
    for ob in list(bpy.data.objects):
        bpy.data.objects.remove(ob)
    for place, method in enumerate(METHODS):
        armature = make_armature()
        ob = make_mesh(armature, False)
        ob.name = method
        ob.location.x = armature.location.x = 3 * place
        for frame in (1, 10, 20):
            pose(armature, frame, False)
        accelerate(ob)
        ob.sinew.method = method
    yield from computed()

    shown = yield from scrubbed(scene)
    assert same(shown, (yield from scrubbed(scene))), "a frame is not the same when it is shown again"
    for number, shapes in enumerate(shown):
        for other in shown[:number]:
            assert np.abs(shapes - other).max() > 1e-3 * diagonal(shapes[0]), "two methods are one"
    print(f"window: scrubbed {len(METHODS)} methods")

    yield from rendered(scene)
    print("window: F12 renders what each method shows")

    with window():
        bpy.ops.ed.undo_push(message="as it was")
        for ob in characters():
            ob.sinew.method = "LINEAR" if ob.name != "LINEAR" else "DUAL_QUATERNION"
        bpy.ops.ed.undo_push(message="other methods")
    assert not same(shown, (yield from scrubbed(scene)))
    with window():
        bpy.ops.ed.undo()
    yield 0.5
    assert same(shown, (yield from scrubbed(bpy.context.scene))), "undo does not bring the methods back"
    print("window: undone")

    path = str(FOLDER / "each_method.blend")
    with window():
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.open_mainfile(filepath=path, load_ui=False)
    yield 0.5
    assert tuple(ob.sinew.method for ob in characters()) == METHODS
    assert same(shown, (yield from scrubbed(bpy.context.scene))), "the file opens with other shapes"
    assert not any(map(lacks, characters())) and not any(map(job_of, characters()))
    print("window: saved and opened")


def characters():
    return [bpy.data.objects[method] for method in METHODS]


def lacks(ob):
    return addon_module("install.precomputing").lacks(ob)


def job_of(ob):
    return addon_module("install.precomputing").job_of(ob)


def computed():
    """Waits for what the methods need."""
    for _ in range(100):
        yield 0.1
        depsgraph()
        if not any(map(job_of, characters())):
            break
    assert not any(map(lacks, characters())), [lacks(ob) for ob in characters()]


def scrubbed(scene):
    """(methods, frames, V, 3)"""
    found = []
    for frame in FRAMES:
        scene.frame_set(frame)
        yield 0.1
        found.append([evaluated(ob) for ob in characters()])
    return np.array(found).swapaxes(0, 1)


def same(shapes, others):
    return np.array_equal(shapes, others)


def rendered(scene):
    """F12 on another frame than the one before; then the same of meshes that are as they were shown."""
    scene.frame_set(RENDERED)
    still = []
    for ob in characters():
        mesh = bpy.data.meshes.new_from_object(ob.evaluated_get(depsgraph()))
        still.append(bpy.data.objects.new("still", mesh))
        still[-1].location = ob.location
        scene.collection.objects.link(still[-1])
    camera(scene)
    scene.camera.location.x, scene.camera.location.y = 6, -30
    scene.render.resolution_x = 3 * scene.render.resolution_y
    pictures = []
    for number, (shown, hidden) in enumerate(((characters(), still), (still, characters()))):
        for ob in (*shown, *hidden):
            ob.hide_render = ob in hidden
        scene.frame_set(RENDERED)
        done = []
        bpy.app.handlers.render_complete.append(lambda *_, done=done: done.append(True))
        with window():
            bpy.ops.render.render("INVOKE_DEFAULT")
        for _ in range(300):
            yield 0.1
            if done:
                break
        assert done, "F12 renders nothing"
        yield 0.5
        path = FOLDER / f"each_method_{number}.png"
        bpy.data.images["Render Result"].save_render(str(path))
        pictures.append(pixels(path))
    ours, theirs = pictures
    assert np.abs(ours - theirs).mean() < 0.5 / 255, "F12 renders other shapes than it shows"
    assert np.ptp(ours) > 0.2
    for ob in still:
        bpy.data.objects.remove(ob)


run(steps())
