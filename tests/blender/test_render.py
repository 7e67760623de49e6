"""Each rendered frame shows the pose of its own frame."""

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, animate, make_armature, make_mesh, make_tube, pose, smoothed
from helpers import (
    addon_module,
    assert_same_on_all_frames,
    assert_same_shape,
    builtin_copy,
    diagonal,
    import_rig,
    is_deforming,
    needs_memory,
    own_positions,
    select,
    traces,
    twin_of,
    way,
)

FRAMES = (1, 6, 11)
SOAK_ROUNDS, SOAK_FRAMES = 50, 10


def render_frames(scene, folder, animation):
    """(frames, pixels): what Cycles makes of FRAMES."""
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 2
    scene.cycles.use_denoising = False
    scene.render.resolution_x = scene.render.resolution_y = 64
    scene.frame_start, scene.frame_end = FRAMES[0], FRAMES[-1]
    scene.frame_step = FRAMES[1] - FRAMES[0]
    scene.render.filepath = str(folder / "frame")
    scene.render.image_settings.file_format, scene.render.image_settings.color_mode = "BMP", "RGB"
    if animation:
        bpy.ops.render.render(animation=True)
    else:
        for frame in FRAMES:
            scene.frame_set(frame)
            scene.render.filepath = str(folder / f"frame{frame:04}.bmp")
            bpy.ops.render.render(write_still=True)
    return np.array([pixels_of(folder / f"frame{frame:04}.bmp") for frame in FRAMES])


def pixels_of(path):
    """Not read by Blender: Wine 8 maps no files for Blender 5.2."""
    data = np.fromfile(path, np.uint8)
    assert bytes(data[:2]) == b"BM"
    return data[int(data[10:14].view("<u4")[0]) :] / 255


def add_camera(scene):
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.location, camera.rotation_euler = (0, -8, 1), (np.pi / 2, 0, 0)
    scene.collection.objects.link(camera)
    light = bpy.data.objects.new("light", bpy.data.lights.new("light", "SUN"))
    light.rotation_euler = (0.7, 0.3, 0)
    scene.collection.objects.link(light)
    scene.camera = camera


def pictures_of_both(scene, tmp_path, ob, reference, animation=True):
    """What is rendered of the bound mesh, and of the reference alone."""
    pictures = []
    for number, (shown, hidden) in enumerate(((ob, reference), (reference, ob))):
        shown.hide_render, hidden.hide_render = False, True
        folder = tmp_path / str(number)
        folder.mkdir()
        pictures.append(render_frames(scene, folder, animation))
    return pictures


def assert_same_pictures(ours, theirs):
    """Frames differ from each other, and none between the two."""
    assert np.abs(ours - theirs).mean(axis=1).max() < 0.5 / 255
    for a, b in ((0, 1), (1, 2), (0, 2)):
        between_frames = np.abs(ours[a] - ours[b]).mean()
        assert between_frames > 10 * np.abs(ours[a] - theirs[a]).mean()
        assert between_frames > 1 / 255


@pytest.mark.parametrize("animation", (True, False), ids=("animation", "stills"))
@pytest.mark.parametrize("output", ("MODIFIER", "MESH"))
def test_rendered_frames_equal_the_modifiers(fresh_scene, tmp_path, output, animation):
    ob, _ = import_rig("capsule", output=output)
    add_camera(fresh_scene)
    assert_same_pictures(*pictures_of_both(fresh_scene, tmp_path, ob, builtin_copy(ob), animation))


def test_an_ogre_is_imported_baked_rendered_and_unbound(fresh_scene, tmp_path):
    ob, _ = import_rig("ogre")
    assert ob.sinew.is_bound
    reference = builtin_copy(ob)
    add_camera(fresh_scene)
    fresh_scene.camera.data.type, fresh_scene.camera.data.ortho_scale = "ORTHO", diagonal(own_positions(ob))
    assert_same_pictures(*pictures_of_both(fresh_scene, tmp_path, ob, reference))
    assert is_deforming(ob)
    select(ob)
    first, last = FRAMES[0], FRAMES[-1]
    assert bpy.ops.object.sinew_bake(
        directory=str(tmp_path), frame_start=first, frame_end=last, file_format="pc2", play=True
    ) == {"FINISHED"}
    assert_same_on_all_frames(fresh_scene, ob, reference, FRAMES)  # from the file
    assert bpy.ops.object.sinew_take_off_cache() == {"FINISHED"}
    assert_same_on_all_frames(fresh_scene, ob, reference, FRAMES)
    assert bpy.ops.object.sinew_unbind() == {"FINISHED"}
    assert not ob.sinew.is_bound and not traces()
    assert_same_on_all_frames(fresh_scene, ob, reference, FRAMES)


def with_motion_blur(scene):
    scene.render.use_motion_blur = True
    scene.render.motion_blur_shutter = 1.0


def with_view_layers(scene):
    for name in ("second", "third"):
        scene.view_layers.new(name)


def with_persistent_data(scene):
    scene.render.use_persistent_data = True


def with_all_of_it(scene):
    with_motion_blur(scene)
    with_view_layers(scene)
    with_persistent_data(scene)


@needs_memory
@pytest.mark.parametrize("keys", (False, True), ids=("smoothing", "keys"))
def test_rendered_frames_without_an_armature(fresh_scene, tmp_path, keys):
    """Rendered alone, so that what the viewport is switched to does not matter."""
    ob = make_tube()
    smoothed(ob, "Smooth", "SMOOTH", iterations=20)
    if keys:
        add_shape_keys(ob)
        ob.data.shape_keys.key_blocks["Wide"].slider_max = 10
        ob.data.shape_keys.key_blocks["Wide"].driver_add("value")
    add_camera(fresh_scene)
    animate(ob.modifiers["Smooth"], factor=(0, 1))
    twin = twin_of(ob)
    accelerate(ob)
    assert_same_pictures(*pictures_of_both(fresh_scene, tmp_path, ob, twin))
    assert addon_module("run.characters").character(ob).is_deforming


@pytest.mark.parametrize("way", (with_motion_blur, with_view_layers, with_persistent_data, with_all_of_it))
@pytest.mark.parametrize("hidden_rig", (False, True), ids=("rig shown", "rig not rendered"))
def test_rendered_in_every_way(fresh_scene, tmp_path, way, hidden_rig):
    armature = make_armature()
    ob = make_mesh(armature, False)
    add_shape_keys(ob)
    reference = twin_of(ob)
    for frame in (1, 4, 7, 11):
        pose(armature, frame, True)
    accelerate(ob)
    armature.hide_render = hidden_rig
    add_camera(fresh_scene)
    fresh_scene.camera.location = (0, -12, 2.5)
    way(fresh_scene)
    ours, theirs = pictures_of_both(fresh_scene, tmp_path, ob, reference)
    assert_same_pictures(ours, theirs)
    if fresh_scene.render.use_motion_blur:
        fresh_scene.render.use_motion_blur = False
        (tmp_path / "sharp").mkdir()
        sharp = render_frames(fresh_scene, tmp_path / "sharp", True)
        assert np.abs(sharp - theirs).mean() > 1 / 255


@needs_memory
def test_soak(fresh_scene, tmp_path):
    """Hundreds of frames rendered, with edits, undo and redo in between."""
    armature = make_armature()
    objects = [make_mesh(armature, preserve) for preserve in (False, True, False)]
    add_shape_keys(objects[2])
    for frame in (1, 4, 7, 10):
        pose(armature, frame, True)
    twins = [twin_of(ob) for ob in objects]
    names = [[each.name for each in group] for group in (objects, twins)]
    for ob in objects:
        accelerate(ob)
    objects[1].sinew.output = "MESH"
    add_camera(fresh_scene)
    scene = fresh_scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    scene.render.resolution_x = scene.render.resolution_y = 4
    scene.render.filepath = str(tmp_path / "frame")
    bpy.ops.ed.undo_push(message="start")
    random = np.random.default_rng(1)

    def objects_now():
        return [[bpy.data.objects[name] for name in group] for group in names]

    def paint(ob):
        group = ob.vertex_groups[int(random.integers(4))]
        group.add(range(int(random.integers(900)), 1200), 0.5, "REPLACE")
        ob.data.update()

    def edit(round_number):
        ob, twin = (group[int(random.integers(3))] for group in objects_now())
        select(ob)
        kind = round_number % 5
        if kind == 0:
            paint(ob)
        elif kind == 1:
            bpy.ops.object.mode_set(mode="EDIT")
            bpy.ops.mesh.select_all(action="SELECT")
            bpy.ops.transform.translate(value=(0, 0, 0.01))
            bpy.ops.object.mode_set(mode="OBJECT")
        elif kind == 2:
            bpy.ops.object.sinew_unbind()
            bpy.ops.object.sinew_bind()
        elif kind == 3:
            ob.sinew.method = "LINEAR" if ob.sinew.method != "LINEAR" else "DUAL_QUATERNION"
        else:
            armature_now = ob.sinew.armature
            armature_now.pose.bones["bone1"].scale.x = random.uniform(0.8, 1.2)

    rendered = 0
    for round_number in range(SOAK_ROUNDS):
        scene = bpy.context.scene
        scene.frame_start, scene.frame_end = 1, SOAK_FRAMES
        bpy.ops.render.render(animation=True)
        rendered += SOAK_FRAMES
        edit(round_number)
        bpy.ops.ed.undo_push(message=f"edit {round_number}")
        scene.frame_set(1 + round_number % 10)
        bpy.ops.ed.undo()
        if round_number % 3 == 0:
            bpy.ops.ed.redo()
            bpy.ops.ed.undo()
        bpy.context.scene.frame_set(2 + round_number % 9)
        for ob, twin in zip(*objects_now()):
            assert_same_shape(ob, twin)
            assert addon_module("run.characters").character(ob).status.error == ""
    assert rendered == 500


def with_noise(ob):
    """Shines with a noise on Generated coordinates."""
    material = bpy.data.materials.new("noise")
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    noise, shine, out = (tree.nodes.new(f"ShaderNode{name}") for name in ("TexNoise", "Emission", "OutputMaterial"))
    noise.inputs["Scale"].default_value = 20
    tree.links.new(noise.outputs["Color"], shine.inputs["Color"])
    tree.links.new(shine.outputs[0], out.inputs["Surface"])
    ob.data.materials.append(material)


def test_generated_coordinates_stay_put(fresh_scene, tmp_path):
    """The panel says beforehand that they would not, and has a cure."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    with_noise(ob)
    reference = twin_of(ob)
    for frame in (1, 4, 7, 11):
        pose(armature, frame, False)
    advice = addon_module("ui.advice")

    def said(about):
        return [warning for warning in about if "noise uses Generated" in warning.text]

    assert said(advice.about_generated(ob))
    accelerate(ob)
    (warning,) = said(advice.warnings(ob))
    assert warning.cures[0][0] == "object.sinew_keep_generated"
    assert bpy.ops.object.sinew_keep_generated() == {"FINISHED"}
    fresh_scene.frame_set(2)
    assert way(ob) == "KEYS" and not said(advice.warnings(ob))
    assert_same_shape(ob, reference)
    add_camera(fresh_scene)
    fresh_scene.camera.location = (0, -12, 2.5)
    assert_same_pictures(*pictures_of_both(fresh_scene, tmp_path, ob, reference))


@pytest.mark.parametrize("kind", ("MULTIRES", "SOFT_BODY"))
def test_modifiers_that_want_deforming_ones_before_them(fresh_scene, kind):
    armature = make_armature()
    ob = make_mesh(armature, False)
    ob.modifiers.new("Behind", kind)
    reference = twin_of(ob)
    pose(armature, 1, False)
    pose(armature, 10, False)
    accelerate(ob)
    fresh_scene.frame_set(2)
    assert way(ob) == "BLENDER"
    (warning,) = [warning for warning in addon_module("ui.advice").warnings(ob) if "only deforming" in warning.text]
    assert warning.cures == (("object.sinew_keep_generated", "Add a Basis"),)
    bpy.ops.object.sinew_keep_generated()
    fresh_scene.frame_set(3)
    assert way(ob) == "KEYS"
    assert_same_shape(ob, reference, 1e-4 if kind == "SOFT_BODY" else 1e-5)
