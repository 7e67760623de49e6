"""Bake to Bones: the armature and the meshes that it makes play what the originals do, and nothing else changes."""

import json

import bpy
import numpy as np
import pytest

from characters import accelerate, make_armature, make_mesh, make_tube, pose, smoothed
from helpers import addon_module, data_counts, diagonal, evaluated, import_rig, select, traces_of

FRAMES = range(1, 11)


def module(name):
    return addon_module(f"to_bones.{name}")


@pytest.fixture
def figure(fresh_scene):
    """(mesh, armature), animated on frames 1 to 10, which are the scene's."""
    fresh_scene.frame_start, fresh_scene.frame_end = FRAMES[0], FRAMES[-1]
    armature = make_armature()
    ob = make_mesh(armature, False)
    for frame in (1, 4, 7, 10):
        pose(armature, frame, False)
    return ob, armature


def bake(*objects, **settings):
    """Bakes with the operator. Returns (armature, meshes)."""
    select(*objects)
    assert bpy.ops.object.sinew_bake_to_bones(**settings) == {"FINISHED"}
    armature = bpy.context.active_object
    assert armature.type == "ARMATURE"
    return armature, [ob for ob in bpy.context.selected_objects if ob.type == "MESH"]


def world(ob):
    """(V, 3): positions as Blender shows them, in world space."""
    matrix = np.array(ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world, float)
    return evaluated(ob) @ matrix[:3, :3].T + matrix[:3, 3]


def played(*objects, frames=FRAMES):
    """(F, V, 3): all frames, several objects one after the other."""
    shapes = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        shapes.append(np.concatenate([world(ob) for ob in objects]))
    return np.array(shapes)


def move(ob, frames=(1, 5, 10)):
    """Keys the object's own place."""
    random = np.random.default_rng(4)
    for frame in frames:
        ob.location, ob.rotation_euler = random.uniform(-2, 2, 3), random.uniform(-2, 2, 3)
        ob.keyframe_insert("location", frame=frame)
        ob.keyframe_insert("rotation_euler", frame=frame)


def error_of(mesh):
    """(V,): the attribute."""
    values = np.empty(len(mesh.vertices), np.float32)
    mesh.attributes["bone_error"].data.foreach_get("value", values)
    return values


# --- laws -----------------------------------------------------------------------------------------


def test_a_rigid_motion_needs_one_bone_and_leaves_no_error(fresh_scene):
    fresh_scene.frame_end = FRAMES[-1]
    ob = make_tube()
    ob.scale = (1.5, 1.5, 1.5)
    move(ob)
    before = played(ob)
    armature, (made,) = bake(ob, bones=6)
    assert len(armature.data.bones) == 1
    assert np.abs(played(made) - before).max() < 2e-6 * diagonal(before[0])


def test_what_linear_bones_deform_is_recovered(figure):
    ob, _ = figure
    before = played(ob)
    _, (made,) = bake(ob, bones=6, max_influences=6, iterations=200, tolerance=0)
    off = np.linalg.norm(played(made) - before, axis=2)
    moved = np.linalg.norm(before - before[0], axis=2)
    assert np.sqrt((off**2).mean()) < 0.02 * np.sqrt((moved**2).mean())


def test_weights_for_the_rigs_own_bones_are_exact_where_linear_skinning_is(figure):
    ob, rig = figure
    rig.scale = (0.5, 0.5, 0.5)
    rig.location = (3, -2, 1)
    move(rig)
    ob.parent = rig
    before = played(ob)
    armature, (made,) = bake(ob, source="RIG", max_influences=8)
    assert [bone.name for bone in armature.data.bones] == [bone.name for bone in rig.data.bones]
    assert armature.data.bones["side"].parent.name == "bone1"
    assert np.abs(played(made) - before).max() < 2e-3 * diagonal(before[0])


@pytest.mark.parametrize("source", ("NEW", "RIG"))
def test_the_armature_plays_what_was_found(figure, source, monkeypatch):
    """In numpy, and in Blender: the same shape on each frame."""
    ob, _ = figure
    baking, found = module("conversion"), []
    decompose = baking.sinew_native.decompose

    def noted(rest, *arguments, **options):
        found.append((rest, decompose(rest, *arguments, **options)))
        return found[0][1]

    monkeypatch.setattr(baking, "sinew_native", type("Native", (), {"decompose": staticmethod(noted)}))
    armature, (made,) = bake(ob, source=source, bones=5)
    ((rest, result),) = found
    vertex = np.repeat(np.arange(len(rest)), np.diff(result.offsets))
    homogeneous = np.column_stack((rest, np.ones(len(rest)))).astype(float)
    expected = np.zeros((len(FRAMES), len(rest), 3))
    for f in range(len(FRAMES)):
        moved = np.einsum("nrc,nc->nr", result.poses[f, result.joints, :3], homogeneous[vertex])
        np.add.at(expected[f], vertex, result.weights[:, None] * moved)
    assert np.abs(played(made) - np.array(armature.location) - expected).max() < 1e-5 * diagonal(rest)


def test_the_report_and_the_attribute_are_what_blender_shows(figure):
    ob, _ = figure
    before = played(ob)
    select(ob)
    baking, frame_range = module("conversion"), addon_module("bake.frame_range")
    report = baking.run(bpy.context, [ob], baking.Settings(frames=frame_range.FrameRange(1, 10), bones=3))
    made = bpy.data.objects[report.objects[0]]
    off = np.linalg.norm(played(made) - before, axis=2)
    assert report.largest == pytest.approx(off.max(), rel=1e-3) and report.mean == pytest.approx(off.mean(), rel=1e-3)
    assert report.rms == pytest.approx(np.sqrt((off**2).mean()), rel=1e-3)
    assert error_of(made.data) == pytest.approx(off.max(axis=0), rel=1e-2, abs=1e-5)
    assert off.max() > 0.05
    assert report.sentence().startswith("Tube: 1,200 vertices, 3 bones, 10 frames; off by ")


@pytest.mark.parametrize(
    "system, scale, distance, said",
    (
        ("METRIC", 1.0, 0.0012, "1.2 mm"),
        ("METRIC", 0.01, 250.0, "2.5 m"),
        ("METRIC", 1.0, 0.0, "0 µm"),
        ("IMPERIAL", 1.0, 0.0254, "1 in"),
        ("NONE", 5.0, 0.25, "0.25"),
    ),
)
def test_errors_are_in_the_scenes_unit(fresh_scene, system, scale, distance, said):
    fresh_scene.unit_settings.system, fresh_scene.unit_settings.scale_length = system, scale
    assert module("report").length(distance) == said


# --- what is baked --------------------------------------------------------------------------------


@pytest.mark.parametrize("is_bound", (False, True))
def test_smoothing_is_baked_to_the_rigs_bones(figure, is_bound):
    """Authored with the best deformation, shipped with linear skinning: better than the rig's own weights."""
    ob, rig = figure
    linear = played(ob)
    smoothed(ob, iterations=10)
    if is_bound:
        accelerate(ob)
    before = played(ob)
    _, (made,) = bake(ob, source="RIG")
    assert traces_of(made) == []
    off, plain = (np.linalg.norm(each - before, axis=2) for each in (played(made), linear))
    assert off.mean() < 0.8 * plain.mean()


def test_several_meshes_get_one_armature(figure):
    ob, rig = figure
    other = make_tube()
    other.name = "Coat"
    other.location, other.scale = (0.1, 0, 0), (1.2, 1.2, 1)
    other.modifiers.new("Armature", "ARMATURE").object = rig
    before = {each.name: played(each) for each in (ob, other)}
    armature, made = bake(ob, other, bones=12, max_influences=8)
    assert sorted(each.name for each in made) == ["Coat_baked", "Tube_baked"]
    for each in made:
        assert each.parent == armature and each.modifiers["Armature"].object == armature
        own = before[each.name.removesuffix("_baked")]
        assert np.linalg.norm(played(each) - own, axis=2).mean() < 0.1 * diagonal(own[0])
        offsets, _groups, weights = addon_module("blender.meshes").read_weights(each.data)
        assert np.add.reduceat(weights, offsets[:-1]) == pytest.approx(1, abs=1e-6)
        assert np.diff(offsets).max() <= 8


@pytest.mark.parametrize("source", ("NEW", "RIG"))
def test_modifiers_that_make_vertices(figure, source):
    ob, _ = figure
    ob.modifiers.new("Both", "MIRROR").use_axis = (False, True, False)
    select(ob)
    bpy.ops.object.modifier_move_to_index(modifier="Both", index=0)
    before = played(ob)
    _, (made,) = bake(ob, source=source, bones=10, max_influences=8)
    after = played(made)
    assert after.shape == before.shape and after.shape[1] > len(ob.data.vertices)
    assert np.linalg.norm(after - before, axis=2).mean() < (0.1 if source == "NEW" else 0.002) * diagonal(before[0])


def test_materials_maps_and_sides_of_faces_are_kept(figure):
    ob, _ = figure
    ob.data.materials.append(bpy.data.materials.new("Skin"))
    ob.data.uv_layers.new(name="Map")
    ob.scale = (-1, 1, 1)
    bpy.context.view_layer.update()
    _, (made,) = bake(ob, bones=3)
    assert [material.name for material in made.data.materials] == ["Skin"]
    assert "Map" in made.data.uv_layers

    def outside(each):
        matrix = each.matrix_world.to_3x3()
        turned = matrix.inverted().transposed() * (1 if matrix.determinant() > 0 else -1)
        return np.array([turned @ face.normal for face in each.data.polygons])

    # Blender flips the normals of mirrored objects where it draws them.
    ours = np.array([face.normal for face in made.data.polygons])
    assert np.einsum("ij,ij->i", ours, -outside(ob) if ob.matrix_world.determinant() > 0 else outside(ob)).min() < -0.9


def test_every_third_frame(figure):
    ob, _ = figure
    before = played(ob, frames=(2, 5, 8))
    armature, (made,) = bake(ob, bones=8, frame_start=2, frame_end=9, frame_step=3)
    curves = addon_module("blender.animation").keyed_curves(armature)
    assert {tuple(point.co.x for point in curve.keyframe_points) for curve in curves} == {(2, 5, 8)}
    assert {point.interpolation for curve in curves for point in curve.keyframe_points} == {"LINEAR"}
    assert np.linalg.norm(played(made, frames=(2, 5, 8)) - before, axis=2).mean() < 0.05 * diagonal(before[0])


def test_scaled_bones_are_keyed_and_what_shears_is_the_nearest(figure):
    ob, rig = figure
    for frame in FRAMES:
        pose(rig, frame, True)
    baking, frame_range = module("conversion"), addon_module("bake.frame_range")
    before = played(ob)
    report = baking.run(bpy.context, [ob], baking.Settings(frames=frame_range.FrameRange(1, 10), bones=0))
    made = bpy.data.objects[report.objects[0]]
    curves = addon_module("blender.animation").keyed_curves(bpy.data.objects[report.armature])
    assert any(curve.data_path.endswith(".scale") for curve in curves)
    off = np.linalg.norm(played(made) - before, axis=2)
    assert report.largest == pytest.approx(off.max(), rel=1e-2), "what is said is what Blender plays"


def test_the_elephants_clip(fresh_scene):
    """All 457 frames of a rig that other people made, by fewer bones than it has."""
    ob, rig = import_rig("shared elephant", source="CLIP")
    report = _run(ob, bones=12, iterations=5)
    size = diagonal(evaluated(ob))
    assert report.frame_count == 457 and report.vertices == 6034
    assert report.rms < 0.02 * size


def _run(*objects, **settings):
    scene, baking = bpy.context.scene, module("conversion")
    frames = addon_module("bake.frame_range").FrameRange(scene.frame_start, scene.frame_end)
    return baking.run(bpy.context, objects, baking.Settings(frames=frames, **settings))


# --- nothing else changes -------------------------------------------------------------------------


def state():
    scene = bpy.context.scene
    return {
        **data_counts(),
        "frame": scene.frame_current,
        "active": bpy.context.view_layer.objects.active.name,
        "selected": [ob.name for ob in bpy.context.selected_objects],
        "mode": bpy.context.mode,
        "rest": [armature.pose_position for armature in bpy.data.armatures],
    }


def test_the_frame_and_the_original_stay(figure):
    ob, _ = figure
    bpy.context.scene.frame_set(3)
    before, groups = played(ob), [group.name for group in ob.vertex_groups]
    bpy.context.scene.frame_set(3)
    bake(ob, bones=3)
    assert bpy.context.scene.frame_current == 3
    assert [group.name for group in ob.vertex_groups] == groups
    assert np.array_equal(played(ob), before)


@pytest.mark.parametrize("share", (0.0, 0.3, 0.5))
def test_what_is_stopped_leaves_nothing(figure, share):
    """As Esc does: in the first frame, while sampling, while computing."""
    ob, _ = figure
    bpy.context.scene.frame_set(4)
    select(ob)
    before, baking = state(), module("conversion")
    frames = addon_module("bake.frame_range").FrameRange(1, 10)
    steps = baking.steps(bpy.context, [ob], baking.Settings(frames=frames, bones=3))
    for done, text in steps:
        if done >= share and (share < 0.5 or text == baking.FOUND):
            break
    steps.close()
    assert state() == before


def test_the_steps_give_the_same_as_one_call(figure):
    ob, _ = figure
    select(ob)
    baking, shares = module("conversion"), []
    frames = addon_module("bake.frame_range").FrameRange(1, 10)
    steps = baking.steps(bpy.context, [ob], baking.Settings(frames=frames, bones=3))
    try:
        while True:
            shares.append(next(steps)[0])
    except StopIteration as end:
        report = end.value
    assert shares == sorted(shares) and shares[0] == 0 and shares[-1] <= 1
    other = _run(ob, bones=3)
    assert (report.mean, report.largest) == (other.mean, other.largest)


def test_one_undo_step(figure):
    ob, _ = figure
    bpy.context.preferences.edit.use_global_undo = True
    select(ob)
    bpy.ops.ed.undo_push(message="before")
    before = state()
    bpy.ops.object.sinew_bake_to_bones_steps("EXEC_DEFAULT", True, bones=3)
    assert "Tube_baked" in bpy.data.objects
    bpy.ops.ed.undo()
    assert state() == before and "Tube_baked" not in bpy.data.objects


def test_an_error_while_writing_leaves_nothing(figure, monkeypatch):
    ob, _ = figure
    select(ob)
    before = state()

    def fail(*_):
        raise ValueError("the disk is on fire")

    monkeypatch.setattr(addon_module("blender.weight_writing"), "replace", fail)
    with pytest.raises(RuntimeError, match="the disk is on fire"):
        bpy.ops.object.sinew_bake_to_bones(bones=3)
    assert state() == before


# --- errors ---------------------------------------------------------------------------------------


def refused(said, *objects, **settings):
    select(*objects)
    before = state()
    with pytest.raises(RuntimeError) as error:
        bpy.ops.object.sinew_bake_to_bones(**settings)
    assert said in str(error.value)
    assert state() == before


def test_vertices_that_come_in_the_middle(figure):
    ob, _ = figure
    modifier = ob.modifiers.new("More", "MIRROR")
    modifier.use_mirror_merge = False
    for frame, value in ((1, False), (6, True)):
        modifier.show_viewport = value
        modifier.keyframe_insert("show_viewport", frame=frame)
    bpy.context.scene.frame_set(1)
    refused("Tube has 2,400 vertices on frame 6, but 1,200 before", ob, bones=3)


def test_frames_that_are_none(figure):
    ob, _ = figure
    refused("the last frame (3) comes before the first (7): swap them", ob, frame_start=7, frame_end=3)


def test_a_mesh_without_vertices(figure):
    _, rig = figure
    empty = bpy.data.objects.new("Empty", bpy.data.meshes.new("Empty"))
    bpy.context.collection.objects.link(empty)
    refused("Empty has no vertices", empty)


def test_places_that_are_not_finite(figure):
    ob, _ = figure
    ob.data.vertices[7].co = (np.nan, 0, 0)
    refused("Vertex 7 of Tube is not at a finite position (NaN or infinite) on frame 1", ob)


def test_bones_that_are_not_there(figure):
    ob, rig = figure
    for bone in rig.data.bones:
        bone.use_deform = False
    refused("Rig has no deforming bone", ob, source="RIG")
    ob.modifiers.clear()
    refused("Tube has no armature whose bones could be used: choose new bones", ob, source="RIG")


def test_a_rig_below_a_sheared_parent(figure):
    ob, rig = figure
    cart = bpy.data.objects.new("Cart", None)
    bpy.context.collection.objects.link(cart)
    cart.scale, rig.parent, rig.rotation_euler = (1, 3, 1), cart, (0.5, 0, 0)
    bpy.context.view_layer.update()
    refused("Rig is below an object that is scaled unevenly and turned", ob, source="RIG")


def test_meshes_of_different_rigs(figure):
    ob, _ = figure
    other_rig = make_armature()
    other = make_mesh(other_rig, False)
    refused("the meshes have different armatures (Rig, Rig.001)", ob, other, source="RIG")


def test_a_bone_without_a_size(figure):
    ob, rig = figure
    rig.pose.bones["bone1"].scale = (1, 0, 1)
    for frame in (4, 5):
        rig.pose.bones["bone1"].keyframe_insert("scale", frame=frame)
    refused("bone1 has a scale of 0 along an axis on frame", ob, source="RIG")


# --- the command ----------------------------------------------------------------------------------


@pytest.fixture
def sinew(capsys):
    """Runs a command. Returns (exit code, stdout, stderr)."""

    def run(*words):
        code = addon_module("cli.command_line").run([str(word) for word in words])
        out, err = capsys.readouterr()
        return code, out, err

    return run


@pytest.fixture
def blend(figure, tmp_path):
    path = tmp_path / "shot.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def test_the_command_bakes_and_saves(sinew, blend):
    code, out, err = sinew("bake-to-bones", blend, "--objects", "Tube", "--bones", "4", "--json", "--save")
    assert code == 0, err
    document = json.loads(out.splitlines()[-1])
    assert document["saved"] and document["bones"] == 4 and document["objects"] == ["Tube_baked"]
    assert document["frames"] == "1-10" and 0 < document["mean"] < document["largest"]
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    assert len(bpy.data.objects["Tube_bones"].data.bones) == 4


def test_the_command_with_the_rigs_bones(sinew, blend):
    code, out, err = sinew("bake-to-bones", blend, "--rig-bones", "--frames", "1-9:2", "--max-influences", "2")
    assert code == 0, err
    assert "Tube: 1,200 vertices, 6 bones, 5 frames; off by" in out
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    assert "Tube_baked" not in bpy.data.objects, "without --save nothing is saved"


@pytest.mark.parametrize(
    "words, code, said",
    (
        (["--objects", "Nobody"], 1, "there is no object Nobody"),
        (["--rig-bones", "--bones", "3"], 2, "argument --bones: not allowed with argument --rig-bones"),
        (["--bones", "0"], 2, "0 is not a whole number above 0"),
        (["--max-error", "1e-9"], 1, "which is more than 1e-09"),
    ),
)
def test_what_the_command_cannot_do(sinew, blend, words, code, said):
    found, _out, err = sinew("bake-to-bones", blend, *words)
    assert (found, said in err) == (code, True), err
