"""No file is wrong because a character was played: what is saved, exported and rendered meanwhile is as live, and a
Blender that dies leaves a whole file."""

import subprocess
from pathlib import Path

import bpy
import numpy as np
import pytest

from helpers import COMMAND, addon_module, evaluated, needs_memory, needs_program, select
from test_played import layer, opened_cast, script_that_compares, states

pytestmark = needs_memory

MANY = 500  # frames that are rendered


@pytest.fixture
def cast():
    return opened_cast(last=10)


def names_of(cast):
    return [(cast.played[i].name, cast.live[i].name) for i in (1, 2)]


def run_blender(script, *options):
    return subprocess.run(
        [*COMMAND, "-b", *options, "--python-exit-code", "1", "--python", str(script)],
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )


def assert_whole(path, names, tmp_path):
    """That file, in a Blender with Sinew and in one without: the actions are all there, and the shapes are equal."""
    script = tmp_path / "compare.py"
    script.write_text(
        script_that_compares(path, names)
        + "rigs = [ob for ob in bpy.data.objects if ob.type == 'ARMATURE']\n"
        + "assert len(rigs) == 2\n"
        + "for rig in rigs:\n"
        + "    assert rig.animation_data.action is not None and rig.animation_data.action.users == 1\n"
    )
    for options in ([], ["--factory-startup"]):
        result = run_blender(script, *options)
        assert result.returncode == 0, result.stdout + result.stderr


def test_a_file_saved_while_it_takes_over_is_as_live(cast, tmp_path):
    """Saved by another add-on's handler, in the evaluation in which Blender builds relations without the action."""
    path, saved = tmp_path / "meanwhile.blend", []

    def save(*_):
        saved.append(cast.played[0].animation_data.action is not None)
        bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)

    cast.record()
    cast.scene.frame_set(8)
    handlers = bpy.app.handlers.depsgraph_update_post
    handlers.insert(0, save)
    try:
        states().take_over([cast.rig], cast.scene, layer())
    finally:
        handlers.remove(save)
    assert saved
    assert all(saved)
    assert_whole(path, names_of(cast), tmp_path)


DYING = """
import os, sys
sys.path.insert(0, {folder!r})
import bpy
from helpers import addon_module, deform_small_meshes
import test_played
deform_small_meshes()
bpy.ops.wm.read_homefile(use_empty=True)
cast = test_played.Cast(bpy.context.scene)
print("names:", *(cast.played[i].name + "=" + cast.live[i].name for i in (1, 2)), flush=True)
cast.take_over()
cast.scene.frame_set(8)
bpy.ops.wm.save_as_mainfile(filepath={path!r})
if {is_building!r}:
    rebuilding = addon_module("host.relations").Rebuilding()
    rebuilding.__enter__()
    rebuilding.without_animation(cast.played[0])
    assert cast.played[0].animation_data.action is None
else:
    cast.scene.frame_set(3)
os._exit(7)
"""


@needs_program
@pytest.mark.parametrize("is_building", [False, True])
def test_a_blender_that_dies_leaves_a_whole_file(tmp_path, is_building):
    """Killed while a character is played, and in the moment in which the action is away."""
    path, script = tmp_path / "dying.blend", tmp_path / "die.py"
    folder = str(Path(__file__).parent)
    script.write_text(DYING.format(folder=folder, path=str(path), is_building=is_building))
    result = run_blender(script)
    assert result.returncode == 7, result.stdout + result.stderr
    words = next(line for line in result.stdout.splitlines() if line.startswith("names:")).split()[1:]
    assert_whole(path, [tuple(word.split("=")) for word in words], tmp_path)
    assert not list(tmp_path.glob("*.blend@"))


# --- exporters ------------------------------------------------------------------------------------


def obj_positions(path):
    """(V, 3): all vertices in an OBJ file, in order."""
    return np.array([line.split()[1:4] for line in path.read_text().splitlines() if line.startswith("v ")], float)


def test_objs_exported_while_played_are_as_live(cast, tmp_path):
    cast.take_over()
    for ob in cast.live[1], cast.played[1]:
        select_only_meshes(cast, ob)
        bpy.ops.wm.obj_export(
            filepath=str(tmp_path / f"{'live' if ob == cast.live[1] else 'played'}.obj"),
            export_animation=True,
            start_frame=2,
            end_frame=9,
            export_selected_objects=True,
        )
    files = {kind: sorted(tmp_path.glob(f"{kind}*.obj")) for kind in ("live", "played")}
    assert len(files["live"]) == len(files["played"]) == 8
    shapes = [[obj_positions(path) for path in each] for each in files.values()]
    assert np.array_equal(*shapes)
    assert np.ptp(shapes[0], axis=0).max() > 0.1
    cast.play()


def select_only_meshes(cast, ob):
    """Selects a mesh without handing it back: exporters of what is selected are called by scripts, too."""
    select(ob)
    rig = cast.rig
    layer().update()
    rig.noticed.is_selected = True  # it was, before it was played
    states().take_over([rig], cast.scene, layer())
    assert rig.is_played


def export_alembic(path):
    bpy.ops.wm.alembic_export(filepath=path, start=2, end=9, as_background_job=False)


def export_usd(path):
    bpy.ops.wm.usd_export(filepath=path, export_animation=True)


KINDS = {"alembic": (export_alembic, "abc", "alembic_import"), "usd": (export_usd, "usdc", "usd_import")}


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_exported_while_played_is_as_live(cast, tmp_path, kind):
    if not getattr(bpy.app.build_options, kind):
        pytest.skip(f"this Blender was built without {kind}")
    export, suffix, importer = KINDS[kind]
    cast.take_over()
    path = str(tmp_path / f"shot.{suffix}")
    export(path)
    cast.play()
    names = [name for pair in names_of(cast) for name in pair]
    bpy.ops.wm.read_homefile(use_empty=True)
    getattr(bpy.ops.wm, importer)(filepath=path)
    objects = {ob.name: ob for ob in bpy.data.objects if ob.type == "MESH"}
    found = [next(ob for name, ob in objects.items() if name.replace("_", ".") == each) for each in names]
    shapes = []
    for frame in range(2, 10):
        bpy.context.scene.frame_set(frame)
        shapes.append([evaluated(ob).copy() for ob in found])
        assert np.array_equal(shapes[-1][0], shapes[-1][1])
        assert np.array_equal(shapes[-1][2], shapes[-1][3])
    assert np.ptp([each[0] for each in shapes], axis=0).max() > 0.1


# --- renders --------------------------------------------------------------------------------------


def small_render(scene):
    """Tiny pictures in which the characters fill the middle."""
    scene.render.engine, scene.render.image_settings.file_format = "CYCLES", "BMP"
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    scene.render.resolution_x, scene.render.resolution_y = 12, 12
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0, -12, 2.5), (np.pi / 2, 0, 0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs[0].default_value = (1, 1, 1, 1)


def test_many_frames_rendered_while_played_are_as_live(cast, tmp_path):
    """Each evaluation of the render, bone and vertex, against the live twin; and the files, against those that are
    rendered with nothing played."""
    scene, seen = cast.scene, []
    scene.frame_start, scene.frame_end = 1, MANY
    for armature, *_ in (cast.played, cast.live):  # over all these frames
        for curve in addon_module("blender.animation").action_curves(armature.animation_data.action):
            for point in curve.keyframe_points:
                point.co.x *= MANY / 10
            curve.update()
    cast.rig  # noqa: B018  # known from now on
    for frame in range(1, MANY + 1):
        scene.frame_set(frame)
    states().take_over([cast.rig], scene, layer())
    small_render(scene)
    layer().update()
    states().take_over_again(scene, layer())
    assert cast.rig.is_played
    viewport = layer().depsgraph

    def look(scene, graph):
        if graph != viewport:
            ours, theirs = (evaluated(each[1], graph) for each in (cast.played, cast.live))
            bones = [
                each[0].evaluated_get(graph).pose.bones["bone3"].matrix.copy() for each in (cast.played, cast.live)
            ]
            seen.append((scene.frame_current, np.array_equal(ours, theirs) and bones[0] == bones[1], ours[-1].copy()))

    bpy.app.handlers.frame_change_post.append(look)
    pictures = []
    try:
        for kind in ("played", "live"):
            scene.render.filepath = str(tmp_path / f"{kind}-")
            bpy.ops.render.render(animation=True)
            pictures.append([path.read_bytes() for path in sorted(tmp_path.glob(f"{kind}-*.bmp"))])
            if kind == "played":
                assert cast.rig.is_played
                cast.assert_same()
                cast.hand_back()
    finally:
        bpy.app.handlers.frame_change_post.remove(look)
    assert len(pictures[0]) == MANY
    assert pictures[0] == pictures[1]
    assert len(set(pictures[0])) > MANY / 4
    assert {frame for frame, *_ in seen} == set(range(1, MANY + 1))
    assert all(is_same for _, is_same, _ in seen)
    assert np.ptp([place for *_, place in seen], axis=0).max() > 0.1
