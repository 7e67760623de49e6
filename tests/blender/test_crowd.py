"""A crowd: each agent shows its character's own shapes, walks as far as its feet do, and plays without Sinew."""

import json
import subprocess

import bpy
import numpy as np
import pytest

from characters import accelerate, make_armature, make_mesh
from helpers import (
    RIGS,
    addon_module,
    copied_rig,
    diagonal,
    evaluated,
    import_rig,
    needs_program,
    own_positions,
    select,
)

P = 8  # frames of a cycle, and shapes


def phases_of(crowd):
    """Its objects, in their order."""
    return sorted(get_input(crowd, "Phases").all_objects, key=lambda ob: ob.name)


def get_input(crowd, name):
    return addon_module("blender.graph").get_input(modifier_of(crowd), name)


def set_inputs(crowd, **values):
    addon_module("blender.graph").set_inputs(modifier_of(crowd), {k.replace("_", " "): v for k, v in values.items()})


def modifier_of(crowd):
    return addon_module("crowd.making").modifier_of(crowd)


def add(**options):
    options.setdefault("agents", 10)
    assert bpy.ops.object.sinew_crowd_add(**options) == {"FINISHED"}
    return bpy.context.active_object


def agents(crowd, frame, subframe=0.0):
    """[(name of the shape, matrix (4, 4))], an agent each."""
    bpy.context.scene.frame_set(frame, subframe=subframe)
    graph = bpy.context.evaluated_depsgraph_get()
    return [
        (each.object.original.name, np.array(each.matrix_world))
        for each in graph.object_instances
        if each.is_instance and each.parent.original == crowd
    ]


def numbers(crowd, frame, subframe=0.0):
    """The phase that each agent shows."""
    names = [ob.name for ob in phases_of(crowd)]
    return [names.index(name) for name, _ in agents(crowd, frame, subframe)]


def places(crowd, frame, subframe=0.0):
    """(N, 3)"""
    return np.array([matrix[:3, 3] for _, matrix in agents(crowd, frame, subframe)])


def swing(armature, last=P + 1):
    """A cycle that ends as it begins."""
    for frame in range(1, last + 1):
        bone = armature.pose.bones["bone2"]
        bone.rotation_mode = "XYZ"
        bone.rotation_euler.x = 0.5 * np.sin(2 * np.pi * (frame - 1) / (last - 1))
        bone.keyframe_insert("rotation_euler", frame=frame)
        bone.location.z = 0.3 * np.cos(2 * np.pi * (frame - 1) / (last - 1))
        bone.keyframe_insert("location", frame=frame)


@pytest.fixture
def figure():
    """A tube that stands and sways, eight frames a cycle, selected."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    swing(armature)
    select(ob)
    return ob


def straight_path(*lengths):
    """Lines along X, side by side, as the selected curve."""
    curve = bpy.data.curves.new("Line", "CURVE")
    curve.dimensions = "3D"
    for row, length in enumerate(lengths):
        spline = curve.splines.new("POLY")
        spline.points.add(1)
        for point, x in zip(spline.points, (0, length)):
            point.co = (x, 10 * row, 0, 1)
    path = bpy.data.objects.new("Line", curve)
    bpy.context.collection.objects.link(path)
    path.select_set(True)
    return path


# --- shapes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("bound", (False, True))
def test_the_shapes_are_the_characters_own(figure, bound):
    figure.parent = None
    figure.location, figure.rotation_euler.z, figure.scale.x = (3, 4, 5), 0.7, 1.5
    if bound:
        accelerate(figure)
    crowd = add()
    found = np.array([own_positions(ob) for ob in phases_of(crowd)])
    assert found.shape == (P, 1200, 3)
    for shape, frame in zip(found, range(1, P + 1)):
        bpy.context.scene.frame_set(frame)
        world = np.array(figure.matrix_world)
        expected = evaluated(figure) @ world[:3, :3].T
        assert np.ptp(shape - expected, axis=0).max() < 1e-5 * diagonal(expected)  # but for where it stands
    assert found[..., 2].min() == 0 and np.ptp(found, axis=0).max() > 0.1


def test_a_cycle_that_closes_ends_before_its_last_frame(figure):
    assert get_input(add(frame_start=1, frame_end=P + 1), "Frames a Cycle") == P
    select(figure)
    assert get_input(add(frame_start=1, frame_end=P), "Frames a Cycle") == P
    select(figure)
    assert get_input(add(frame_start=1, frame_end=P - 1), "Frames a Cycle") == P - 1


def test_shapes_between_frames(figure):
    crowd = add(shapes=2 * P)
    shapes = phases_of(crowd)
    assert len(shapes) == get_input(crowd, "Phase Count") == 2 * P
    bpy.context.scene.frame_set(2, subframe=0.5)
    difference = own_positions(shapes[3]) - evaluated(figure)
    assert np.ptp(difference, axis=0).max() < 1e-5


def test_a_character_of_several_meshes(figure):
    hat = bpy.data.objects.new("Hat", bpy.data.meshes.new("Hat"))
    hat.data.from_pydata([(0, 0, 6), (1, 0, 6), (0, 1, 6)], [], [(0, 1, 2)])
    bpy.context.collection.objects.link(hat)
    hat.parent, hat.parent_type, hat.parent_bone = figure.modifiers["Armature"].object, "BONE", "bone4"
    select(figure)
    crowd = add()
    names = [name for name, _ in agents(crowd, 1)]
    assert len(names) == 20
    assert sorted(ob.data.name.split(".")[0] for ob in phases_of(crowd)) == ["Hat"] * P + ["Tube"] * P


def test_hidden_meshes_are_left_out(figure):
    other = make_mesh(figure.modifiers["Armature"].object, False)
    other.hide_set(True)
    assert len(phases_of(add())) == P


def test_a_mesh_whose_faces_change(figure):
    decimate = figure.modifiers.new("Build", "BUILD")
    decimate.frame_start, decimate.frame_duration = 1, 20
    crowd = add(frame_start=5, frame_end=10)
    counts = [len(ob.data.polygons) for ob in phases_of(crowd)]
    assert counts == sorted(counts) and len(set(counts)) > 3


def test_materials_and_layers_come_along(figure):
    material = bpy.data.materials.new("Skin")
    figure.data.materials.append(material)
    figure.data.uv_layers.new(name="Map")
    for ob in phases_of(add()):
        assert ob.data.materials[0] == material and "Map" in ob.data.uv_layers


def test_velocities_are_those_of_the_clip(figure):
    scene = bpy.context.scene
    scene.render.fps = 12
    shapes = phases_of(add())
    before, at, after = (shapes[i].data for i in (0, 1, 2))
    velocity = addon_module("blender.meshes").read_attribute(at.attributes["velocity"])
    read = addon_module("blender.meshes").read_positions
    assert np.allclose(velocity, (read(after) - read(before)) * 12 / 2, atol=1e-4)
    assert np.abs(velocity).max() > 0.5


# --- agents ---------------------------------------------------------------------------------------


def test_each_agent_plays_the_clip_from_a_moment_of_its_own(figure):
    crowd = add(agents=50)
    first = numbers(crowd, 1)
    assert len(first) == 50 and len(set(first)) == P
    for frame in range(2, 2 * P + 2):
        assert numbers(crowd, frame) == [(phase + frame - 1) % P for phase in first]


def test_a_seed_makes_a_crowd_again(figure):
    crowd = add(agents=50, seed=3)
    found = numbers(crowd, 1), places(crowd, 1)
    set_inputs(crowd, Seed=4)
    assert numbers(crowd, 1) != found[0] and not np.allclose(places(crowd, 1), found[1])
    set_inputs(crowd, Seed=3)
    assert numbers(crowd, 1) == found[0] and np.array_equal(places(crowd, 1), found[1])


def test_around_a_frame_agents_move_and_keep_their_shape(figure):
    """As motion blur asks for it."""
    crowd = add(agents=50)
    set_inputs(crowd, Stride=2.0)
    assert numbers(crowd, 4, 0.75) == numbers(crowd, 5) == numbers(crowd, 5, 0.25) == numbers(crowd, 5, 0.5)
    assert np.linalg.norm(places(crowd, 5, 0.25) - places(crowd, 5), axis=1).min() > 0.01


@pytest.mark.parametrize("speed", (1.0, 2.0, -1.0))
def test_agents_walk_a_stride_a_cycle(figure, speed):
    straight_path(1000.0)
    crowd = add(agents=20, lanes=1)
    set_inputs(crowd, Stride=3.0, Speed=speed)
    moved = places(crowd, 1 + P) - places(crowd, 1)
    assert np.allclose(moved % 1000, (3.0 * speed % 1000, 0, 0), atol=1e-3)


def test_frame_offset_halts_a_crowd(figure):
    crowd = add()
    set_inputs(crowd, Stride=3.0)
    before = places(crowd, 3), numbers(crowd, 3)
    set_inputs(crowd, Frame_Offset=-2.0)
    assert np.allclose(places(crowd, 5), before[0]) and numbers(crowd, 5) == before[1]


def test_a_larger_agent_makes_fewer_steps_and_comes_as_far(figure):
    straight_path(1000.0)
    crowd = add(agents=200, lanes=1, shapes=8)
    set_inputs(crowd, Stride=3.0, Size_Variation=0.5)
    cycles = 100
    moved = places(crowd, 1 + 10 * P) - places(crowd, 1)
    assert np.allclose(moved % 1000, (30, 0, 0), atol=1e-2)
    sizes = np.array([np.linalg.norm(matrix[:3, 0]) for _, matrix in agents(crowd, 1)])
    assert sizes.min() < 0.6 and sizes.max() > 1.4
    steps = np.zeros(len(sizes))
    last = np.array(numbers(crowd, 1))
    for frame in range(2, cycles):
        now = np.array(numbers(crowd, frame))
        steps += (now - last) % P
        last = now
    assert np.abs(steps * sizes - (cycles - 2)).max() < 3.1


def test_lanes_lie_side_by_side(figure):
    straight_path(60.0)
    crowd = add(agents=60, lanes=3)
    set_inputs(crowd, Lane_Distance=2.0, Jitter=0.0)
    found = places(crowd, 1)
    assert sorted(set(np.round(found[:, 1], 3))) == [-2, 0, 2]
    for y in (-2, 0, 2):
        lane = np.sort(found[np.isclose(found[:, 1], y), 0])
        assert len(lane) == 20 and np.allclose(np.diff(lane), 3.0, atol=1e-3)


def test_agents_spread_over_all_splines_by_their_length(figure):
    straight_path(30.0, 10.0, 20.0)
    crowd = add(agents=60, lanes=1)
    rows = np.round(places(crowd, 1)[:, 1] / 10).astype(int)
    assert np.abs(np.bincount(rows, minlength=3) - (30, 10, 20)).max() <= 1
    set_inputs(crowd, Stride=3.0)
    for frame in (5, 50, 500):  # each stays on its own
        found = places(crowd, frame)
        assert np.array_equal(np.round(found[:, 1] / 10).astype(int), rows)
        assert (found[:, 0] >= -1e-3).all() and (found[:, 0] <= np.array((30, 10, 20))[rows] + 1e-3).all()


def test_agents_look_where_they_walk(figure):
    crowd = add(agents=30)
    set_inputs(crowd, Stride=0.5, Heading=0.4)
    ahead = places(crowd, 2) - places(crowd, 1)
    for moved, (_, matrix) in zip(ahead, agents(crowd, 1)):
        looks = matrix[:3, :3] @ (np.cos(0.4), np.sin(0.4), 0)
        assert looks @ moved > 0.996 * np.linalg.norm(moved)


def test_without_a_path_there_is_nobody(figure):
    crowd = add()
    bpy.data.objects.remove(get_input(crowd, "Path"))
    assert agents(crowd, 1) == []


def test_the_path_may_have_one_point(figure):
    path = straight_path(1.0)
    crowd = add()
    path.data.splines.clear()
    path.data.splines.new("POLY")
    assert np.isfinite(places(crowd, 3)).all()


# --- walking --------------------------------------------------------------------------------------


def test_feet_do_not_slide():
    ob, _ = import_rig("ogre")
    straight_path(500.0)
    crowd = add(agents=1, lanes=1, frame_start=1, frame_end=32)
    set_inputs(crowd, Jitter=0.0)
    step = get_input(crowd, "Stride") / get_input(crowd, "Phase Count")
    slid = []
    for frame in range(1, 33):
        worlds = []
        for each in (frame, frame + 1):
            ((name, matrix),) = agents(crowd, each)
            worlds.append(own_positions(bpy.data.objects[name]) @ matrix[:3, :3].T + matrix[:3, 3])
        low = np.argsort(np.maximum(worlds[0][:, 2], worlds[1][:, 2]))[:100]
        slid.append(np.linalg.norm(np.median(worlds[1][low] - worlds[0][low], axis=0)[:2]))
    assert step > 0.02 and np.median(slid) < 0.3 * step, (np.median(slid), step)


@pytest.mark.parametrize("is_closed", (True, False))
def test_a_clip_that_carries_the_character_away_is_played_in_place(figure, is_closed):
    armature = figure.modifiers["Armature"].object
    figure.parent = armature
    for frame, x in ((1, 2.0), (P + 1, 10.0)):
        armature.location.x = x
        armature.keyframe_insert("location", frame=frame)
    for curve in addon_module("blender.animation").action_curves(armature.animation_data.action):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    crowd = add(frame_start=1, frame_end=P + is_closed)
    assert get_input(crowd, "Frames a Cycle") == P
    assert get_input(crowd, "Stride") == pytest.approx(8.0, rel=0.1)
    assert get_input(crowd, "Heading") == pytest.approx(0.0, abs=0.1)
    middles = np.array([own_positions(ob).mean(axis=0) for ob in phases_of(crowd)])
    assert np.ptp(middles[:, 0]) < 0.5


# --- rig folders ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ("capsule", "ogre"))
def test_a_rig_folder_makes_the_crowd_that_its_import_makes(name):
    ob, armature = import_rig(name)
    select(ob)
    imported = phases_of(add())
    select()
    direct = phases_of(add(filepath=str(RIGS[name]), pose="walk.dmat"))
    assert len(direct) >= len(imported) > 1
    for ours, theirs in zip(direct, imported):
        a, b = own_positions(ours), own_positions(theirs)
        assert np.ptp(a - b, axis=0).max() < 2e-6 * diagonal(b)
        assert len(ours.data.materials) == len(theirs.data.materials)


# --- files, undo, renewing ------------------------------------------------------------------------


@needs_program
def test_a_crowd_plays_without_sinew(figure, tmp_path):
    crowd = add(agents=30)
    set_inputs(crowd, Stride=2.0)
    expected = [(numbers(crowd, frame), places(crowd, frame).tolist()) for frame in (1, 7)]
    names = [ob.name for ob in phases_of(crowd)]
    path, script = tmp_path / "crowd.blend", tmp_path / "look.py"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    script.write_text(
        "import bpy, json, sys\n"
        "assert not hasattr(bpy.context.object, 'sinew')\n"
        "for frame in (1, 7):\n"
        "    bpy.context.scene.frame_set(frame)\n"
        "    graph = bpy.context.evaluated_depsgraph_get()\n"
        "    found = [(i.object.original.name, list(i.matrix_world.translation)) for i in graph.object_instances"
        " if i.is_instance]\n"
        "    print('agents', json.dumps(found))\n"
    )
    command = [bpy.app.binary_path, "-b", "--factory-startup", str(path), "--python-exit-code", "1", "--python"]
    done = subprocess.run([*command, str(script)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    lines = [json.loads(line.split(maxsplit=1)[1]) for line in done.stdout.splitlines() if line.startswith("agents ")]
    for (phases, where), line in zip(expected, lines, strict=True):
        assert [names.index(name) for name, _ in line] == phases
        assert np.allclose([place for _, place in line], where, atol=1e-5)


def test_undo_takes_a_crowd_away(figure):
    bpy.ops.ed.undo_push(message="before")
    objects = len(bpy.data.objects)
    add()
    bpy.ops.ed.undo_push(message="crowd")
    bpy.ops.ed.undo()
    assert len(bpy.data.objects) == objects and not bpy.data.collections


def test_renewing_follows_the_character(figure):
    crowd = add(agents=20)
    before = [own_positions(ob) for ob in phases_of(crowd)]
    counts = len(bpy.data.meshes), len(bpy.data.objects), len(bpy.data.collections)
    where = places(crowd, 1)
    figure.data.vertices[0].co.x += 1
    assert bpy.ops.object.sinew_crowd_renew() == {"FINISHED"}
    after = [own_positions(ob) for ob in phases_of(crowd)]
    assert len(after) == P and all(np.abs(a - b).max() > 0.3 for a, b in zip(after, before))
    assert (len(bpy.data.meshes), len(bpy.data.objects), len(bpy.data.collections)) == counts
    assert np.allclose(places(crowd, 1), where) and len(set(numbers(crowd, 1))) > 3


def test_the_frame_stays(figure):
    bpy.context.scene.frame_set(4, subframe=0.5)
    add()
    assert (bpy.context.scene.frame_current, bpy.context.scene.frame_subframe) == (4, 0.5)


# --- what cannot be -------------------------------------------------------------------------------


def blocks():
    return {
        kind: len(getattr(bpy.data, kind)) for kind in ("meshes", "objects", "collections", "curves", "node_groups")
    }


def fails(words, operator="sinew_crowd_add", **options):
    before = blocks()
    with pytest.raises(RuntimeError, match=words):
        getattr(bpy.ops.object, operator)(**options)
    assert blocks() == before


def test_nothing_is_selected():
    select()
    fails("select a character first")


def test_the_character_is_hidden(figure):
    figure.hide_set(True)
    bpy.context.view_layer.objects.active = figure.modifiers["Armature"].object
    fails("has no visible mesh")


def test_the_last_frame_comes_first(figure):
    fails(r"the last frame \(3\) comes before the first \(7\)", frame_start=7, frame_end=3)


def test_a_mesh_without_vertices(figure):
    figure.data.clear_geometry()
    fails("has no vertices")


def test_a_rig_without_poses(tmp_path):
    folder = copied_rig(tmp_path)
    for file in ("pose.dmat", "walk.dmat", "anim.dmat"):
        (folder / file).unlink(missing_ok=True)
    fails("has no poses", filepath=str(folder / "skeleton.bf"))


def test_a_rig_that_is_not_there(tmp_path):
    fails("there is no file", filepath=str(tmp_path / "skeleton.bf"))


def test_renewing_without_its_character(figure):
    crowd = add()
    bpy.data.objects.remove(figure)
    select(crowd)
    fails("there is no object Tube", "sinew_crowd_renew")
    assert len(agents(crowd, 1)) == 10
