"""Each rendered frame shows the pose of its own frame."""

import bpy
import numpy as np
import pytest

from helpers import builtin_copy, import_rig

FRAMES = (1, 6, 11)


def render_frames(scene, folder, animation):
    """(frames, pixels): what Cycles makes of FRAMES."""
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 2
    scene.cycles.use_denoising = False
    scene.render.resolution_x = scene.render.resolution_y = 64
    scene.frame_start, scene.frame_end = FRAMES[0], FRAMES[-1]
    scene.frame_step = FRAMES[1] - FRAMES[0]
    scene.render.filepath = str(folder / "frame")
    if animation:
        bpy.ops.render.render(animation=True)
    else:
        for frame in FRAMES:
            scene.frame_set(frame)
            scene.render.filepath = str(folder / f"frame{frame:04}.png")
            bpy.ops.render.render(write_still=True)
    pictures = []
    for frame in FRAMES:
        image = bpy.data.images.load(str(folder / f"frame{frame:04}.png"))
        pictures.append(np.array(image.pixels[:]))
        bpy.data.images.remove(image)
    return np.array(pictures)


def add_camera(scene):
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.location, camera.rotation_euler = (0, -8, 1), (np.pi / 2, 0, 0)
    scene.collection.objects.link(camera)
    light = bpy.data.objects.new("light", bpy.data.lights.new("light", "SUN"))
    light.rotation_euler = (0.7, 0.3, 0)
    scene.collection.objects.link(light)
    scene.camera = camera


@pytest.mark.parametrize("animation", (True, False), ids=("animation", "stills"))
@pytest.mark.parametrize("output", ("MODIFIER", "MESH"))
def test_rendered_frames_equal_the_modifiers(fresh_scene, tmp_path, output, animation):
    ob, _ = import_rig("capsule", output=output)
    add_camera(fresh_scene)
    reference = builtin_copy(ob)
    pictures = {}
    for shown, hidden in ((ob, reference), (reference, ob)):
        shown.hide_render, hidden.hide_render = False, True
        folder = tmp_path / shown.name
        folder.mkdir()
        pictures[shown.name] = render_frames(fresh_scene, folder, animation)
    ours, theirs = pictures[ob.name], pictures[reference.name]
    assert np.abs(ours - theirs).mean() < 0.5 / 255
    for a, b in ((0, 1), (1, 2), (0, 2)):
        between_frames = np.abs(ours[a] - ours[b]).mean()
        assert between_frames > 10 * np.abs(ours[a] - theirs[a]).mean()
        assert between_frames > 1 / 255
