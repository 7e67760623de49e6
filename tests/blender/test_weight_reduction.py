"""Fewer bones per vertex: how far vertices then move is what Blender's own modifier shows."""

import math
import threading
import time

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from characters import make_armature, make_mesh, pose, twin_of
from helpers import addon_module, evaluated, select
from test_automatic_weights import BONES, dense, paint, places
from test_weight_tools import entries, no_selection, refusal, run, selected

FRAMES = range(1, 11)


def make_animated(place=None):
    """A tube with random weights of six bones at many vertices, and an armature that moves on the frames 1 to 10."""
    armature = make_armature()
    for frame in (1, 4, 7, 10):
        pose(armature, frame, scaled=True)
    ob = make_mesh(armature, False)
    random = np.random.default_rng(8)
    for number, weights in enumerate(random.dirichlet(np.full(6, 0.5), 1200).tolist()):
        if number % 2:
            for name, weight in zip(BONES, weights):
                ob.vertex_groups[name].add([number], weight, "REPLACE")
    ob.vertex_groups.new(name="Cloth").add(range(0, 1200, 7), 0.25, "REPLACE")
    if place is not None:
        ob.parent = armature
        armature.matrix_world = place
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = FRAMES[0], FRAMES[-1]
    scene.frame_set(3)
    return ob, armature


def shapes(ob):
    """(F, V, 3): what Blender shows, in world space, on all frames."""
    scene, found = bpy.context.scene, []
    before = scene.frame_current
    for frame in FRAMES:
        scene.frame_set(frame)
        matrix = np.array(ob.matrix_world)
        found.append(evaluated(ob) @ matrix[:3, :3].T + matrix[:3, 3])
    scene.frame_set(before)
    return np.array(found)


def counts(ob):
    return (dense(ob) > 0).sum(axis=1)


def reduction(ob, most, rings=0, tolerance=0.0):
    """A computed one that is not written, on all frames."""
    reducing, poses = addon_module("weights.reducing"), addon_module("weights.judging_poses")
    made = reducing.Reduction(
        ob,
        lambda armature, names: poses.on_frames(bpy.context, armature, names, FRAMES),
        reducing.ReduceSettings(most, rings, tolerance),
    )
    assert made.compute()
    return made


@pytest.mark.parametrize("name", (None, *places()))
@pytest.mark.parametrize("rings", (0, 2))
def test_the_moves_are_those_that_blender_shows(name, rings):
    ob, _ = make_animated(name and places()[name])
    before, cloth = shapes(ob), dense(ob, ["Cloth"])
    made = reduction(ob, 2, rings)
    report = made.write()
    moved = np.linalg.norm(shapes(ob) - before, axis=2)
    size = np.ptp(before[0], axis=0).max()
    assert counts(ob).max() == 2 and report.changed > 500
    assert np.abs(moved.max(axis=0) - made.largest).max() < 1e-5 * size
    assert np.abs(moved.mean(axis=0) - made.mean).max() < 1e-5 * size
    assert report.largest == pytest.approx(moved.max(), rel=1e-3)
    assert np.array_equal(dense(ob, ["Cloth"]), cloth)


def test_it_moves_less_than_the_smallest_weights_that_blender_drops():
    ob, _ = make_animated()
    before, twin = shapes(ob), twin_of(ob)
    run("reduce_influences", ob, max_influences=2, rings=0)
    twin.vertex_groups.remove(twin.vertex_groups["Cloth"])  # Blender counts it
    select(twin)
    bpy.ops.object.vertex_group_limit_total(limit=2)
    ours, blenders = (np.linalg.norm(shapes(each) - before, axis=2) for each in (ob, twin))
    assert counts(twin).max() == 2
    assert ours.max(axis=0).mean() < 0.8 * blenders.max(axis=0).mean()
    assert (ours.max(axis=0) <= blenders.max(axis=0) + 1e-4).all()


def test_sums_stay_unless_a_group_would_have_to_hold_more_than_1():
    ob, _ = make_animated()
    before = dense(ob).sum(axis=1)
    assert run("reduce_influences", ob, max_influences=2) == {"FINISHED"}
    after = dense(ob)
    is_full = after.max(axis=1) == 1
    assert np.abs(after.sum(axis=1) - before)[~is_full].max() < 1e-5 and counts(ob).max() == 2
    assert (after.sum(axis=1) <= before + 1e-5).all() and 0 < is_full.sum() < 600


def test_measuring_changes_nothing_and_selects_what_moves_too_far():
    ob, _ = make_animated()
    before, made = entries(ob), reduction(ob, 2)
    tolerance = float(np.median(made.largest[made.largest > 0]))
    expected = made.largest > tolerance
    assert run("reduce_influences", ob, max_influences=2, rings=0, tolerance=tolerance, measure=True) == {"FINISHED"}
    assert bpy.context.mode == "EDIT_MESH" and bpy.context.scene.frame_current == 3
    bpy.ops.object.mode_set(mode="OBJECT")
    assert entries(ob) == before
    assert abs(int(selected(ob).sum()) - int(expected.sum())) <= 1 and 0 < expected.sum() < 1200
    run("reduce_influences", ob, max_influences=2, rings=0, tolerance=tolerance)
    assert bpy.context.mode == "OBJECT" and entries(ob) != before
    assert abs(int(selected(ob).sum()) - int(expected.sum())) <= 1


def test_what_is_over_the_tolerance_becomes_the_mask():
    ob, armature = make_animated()
    paint(ob, armature)
    bpy.ops.object.sinew_reduce_influences(max_influences=2, tolerance=0.05, measure=True)
    assert ob.data.use_paint_mask_vertex and 0 < selected(ob).sum() < 1200 and bpy.context.mode == "PAINT_WEIGHT"


def test_only_the_selected_vertices_are_reduced():
    ob, armature = make_animated()
    free = np.arange(1200) >= 700
    before = dense(ob)
    paint(ob, armature)
    ob.data.use_paint_mask_vertex = True
    addon_module("blender.meshes").select_vertices(ob.data, free)
    assert bpy.ops.object.sinew_reduce_influences(max_influences=1) == {"FINISHED"}
    assert counts(ob)[free].max() == 1
    assert np.array_equal(dense(ob)[~free], before[~free])


def test_locked_groups_stay_and_count():
    ob, armature = make_animated()
    for name in ("bone1", "side"):
        ob.vertex_groups[name].lock_weight = True
    before, was = shapes(ob), dense(ob)
    made = reduction(ob, 3)
    report = made.write()
    after, locked = dense(ob), [1, 5]
    assert np.array_equal(after[:, locked], was[:, locked])
    assert counts(ob).max() == 3 and report.kept == ("bone1", "side")
    assert np.abs(after.sum(axis=1) - was.sum(axis=1)).max() < 1e-5
    moved = np.linalg.norm(shapes(ob) - before, axis=2).max(axis=0)
    assert np.abs(moved - made.largest).max() < 1e-4


def test_test_poses_turn_each_bone_and_what_hangs_on_it():
    _ob, armature = make_animated()
    armature.matrix_world = places()["uneven"]
    bpy.context.view_layer.update()
    names = ["bone1", "side", "bone3"]
    found = addon_module("weights.judging_poses").in_test_poses(armature, names)
    assert found.shape == (12, 3, 4, 4)
    place = np.array(armature.matrix_world)
    for bone in armature.pose.bones:
        bone.matrix_basis.identity()
    armature.animation_data_clear()
    for pose_number, (axis, sign) in enumerate((axis, sign) for axis in "XZ" for sign in (1, -1)):
        bone = armature.pose.bones["bone1"]
        bone.rotation_quaternion = Matrix.Rotation(sign * math.pi / 2, 3, axis).to_quaternion()
        bpy.context.view_layer.update()
        expected = [place @ np.array(armature.pose.bones[name].matrix_channel) @ np.linalg.inv(place) for name in names]
        assert np.abs(found[pose_number] - expected).max() < 1e-5


@pytest.mark.parametrize("rounding", (0.0, 3e-5))
def test_where_nothing_moves_test_poses_are_the_default(rounding):
    """Rigs with many constraints are at rest to the accuracy of float32."""
    ob, armature = make_animated()
    armature.animation_data_clear()
    for bone in armature.pose.bones:
        bone.matrix_basis.identity()
        bone.location.x = rounding
    assert refusal("reduce_influences", ob, poses="FRAMES") == (
        "Rig is at rest on the frames 1 to 10: choose frames on which it moves, or use test poses"
    )
    twin = twin_of(ob)
    assert run("reduce_influences", twin, poses="TEST") == {"FINISHED"}
    assert run("reduce_influences", ob) == {"FINISHED"} and counts(ob).max() == 4
    assert entries(ob) == entries(twin)


def test_what_moves_little_is_not_at_rest():
    ob, armature = make_animated()
    armature.animation_data_clear()
    for bone in armature.pose.bones:
        bone.matrix_basis.identity()
    armature.pose.bones["bone1"].rotation_quaternion = (1, 0.001, 0, 0)
    assert run("reduce_influences", ob, poses="FRAMES") == {"FINISHED"}


def test_the_frames_are_spread_over_the_range():
    spread = addon_module("weights.judging_poses").spread
    assert spread(3, 6) == [3, 4, 5, 6] and spread(5, 5) == [5]
    assert len(spread(1, 1000)) == 50 and spread(1, 1000)[::49] == [1, 1000]
    with pytest.raises(ValueError, match=r"the last frame \(2\) comes before the first \(7\): swap them"):
        spread(7, 2)


def test_the_report_is_in_the_unit_of_the_scene():
    ob, _ = make_animated()
    units, scene = addon_module("blender.units"), bpy.context.scene
    report = reduction(ob, 2, tolerance=0.1).report()
    scene.unit_settings.system, scene.unit_settings.scale_length = "METRIC", 0.01
    text = report.sentence(lambda distance: units.length(scene, distance))
    assert text.startswith(f"{report.changed:,} of 1,200 vertices would be reduced to 2 bones: they would move by at ")
    assert f"{report.over:,} by more than 1 mm" in text and "in 10 poses" in text
    scene.unit_settings.system = "NONE"
    assert units.length(scene, 0.01234) == "0.0123"
    scene.unit_settings.system, scene.unit_settings.scale_length = "IMPERIAL", 1.0
    assert units.length(scene, 0.3048) == "1'"


def test_nothing_to_reduce():
    ob, _ = make_animated()
    made = reduction(ob, 6)
    before = entries(ob)
    report = made.write()
    assert report.sentence(str) == "none of 1,200 vertices has more than 6 bones" and entries(ob) == before
    assert report.largest == 0 and report.document()["changed"] == 0


def test_undo_gives_back_every_bit():
    ob, _ = make_animated()
    name, before = ob.name, entries(ob)
    select(ob)
    bpy.ops.ed.undo_push(message="before")
    assert bpy.ops.object.sinew_reduce_influences("EXEC_DEFAULT", True) == {"FINISHED"}
    assert entries(bpy.data.objects[name]) != before
    bpy.ops.ed.undo()
    assert entries(bpy.data.objects[name]) == before


def out_of_sight(ob, armature):
    ob.modifiers["Armature"].object = armature
    bpy.context.collection.objects.unlink(armature)


def flat(ob, armature):
    armature.scale.x = 0
    bpy.context.view_layer.update()


def bone_nowhere(ob, armature):
    armature.animation_data_clear()
    armature.pose.bones["bone2"].location.x = math.nan


REFUSED = {
    no_selection: "no vertex is selected: select those whose weights to change, or turn the mask off",
    out_of_sight: "Rig is not in the view layer ",
    flat: "Rig has a scale of 0 along an axis; set another scale",
    bone_nowhere: "Bone bone2 of Rig is not at a finite place (NaN or infinite) on frame 1",
}


@pytest.mark.parametrize("spoil", REFUSED, ids=lambda spoil: spoil.__name__)
def test_what_is_refused(spoil):
    ob, armature = make_animated()
    spoil(ob, armature)
    before = entries(ob)
    if bpy.context.mode == "OBJECT":
        select(ob)
    with pytest.raises(RuntimeError) as raised:
        bpy.ops.object.sinew_reduce_influences()
    assert str(raised.value).strip().removeprefix("Error: ").startswith(REFUSED[spoil])
    assert entries(ob) == before and bpy.context.scene.frame_current == 3


# --- the dialog -----------------------------------------------------------------------------------


def test_the_newest_settings_win_and_nobody_waits_for_older_ones():
    background = addon_module("weights.background")
    latest, begun = background.Latest(), []
    release = threading.Event()

    def slow(progress):
        begun.append(progress)
        release.wait(10)
        return "old"

    latest.begin(slow)
    assert latest.fraction == 0 and not latest.wait(0.01)
    latest.begin(lambda progress: "new")
    assert latest.wait(10) and latest.result == "new"
    assert begun[0].is_cancelled
    release.set()
    time.sleep(0.05)
    assert latest.result == "new" and latest.fraction is None
    latest.begin(lambda progress: 1 / 0)
    assert latest.wait(10) and isinstance(latest.result, ZeroDivisionError)


def test_the_dialog_tells_what_the_newest_settings_do():
    ob, _ = make_animated()
    settings, reads = addon_module("weights.reducing").ReduceSettings, []
    measuring = addon_module("ui.weight_tools").Measuring(lambda report: report.sentence(str))

    def read():
        reads.append(reduction(ob, 1))
        return reads[-1]

    def begin(source, *numbers):
        measuring.begin(settings(*numbers), source, read)
        while measuring.fraction is not None:
            time.sleep(0.01)
        return measuring.made

    for most in (1, 2, 3):
        made = begin("frames", most, 0)
    expected = reduction(ob, 3)
    assert measuring.sentence() == expected.report().sentence(str)
    assert begin("frames", 3, 0) is made
    loose = begin("frames", 3, 0, 0.01)
    assert loose.made is made.made and "by more than 0.01" in measuring.sentence()
    assert len(reads) == 1 and begin("test poses", 1, 0) is reads[1]
    measuring.close()


def test_what_a_dialog_computes_can_be_waited_for_in_steps_and_stopped():
    latest, release = addon_module("weights.background").Latest(), threading.Event()

    def work(progress):
        while not (release.is_set() or progress.is_cancelled):
            time.sleep(0.01)
        return "done"

    latest.begin(work)
    steps = latest.steps("reducing")
    assert next(steps) == (0.0, "reducing")
    release.set()
    with pytest.raises(StopIteration) as ended:
        while True:
            next(steps)
    assert ended.value.value == "done"
    release.clear()
    latest.begin(work)
    steps = latest.steps("reducing")
    next(steps)
    steps.close()
    assert latest.wait(0) and latest._task.is_done


def test_an_operator_ends_at_once_for_scripts(monkeypatch):
    """Also where there is a window; Adjust Last Operation gives up whatever does not end with FINISHED."""
    ob, _ = make_animated()
    seen, compute = [], addon_module("weights.reducing").Reduction.compute

    def noting(self, progress):
        seen.append(threading.current_thread())
        return compute(self, progress)

    monkeypatch.setattr(addon_module("weights.reducing").Reduction, "compute", noting)
    assert run("reduce_influences", ob, max_influences=2) == {"FINISHED"} and counts(ob).max() == 2
    assert len(seen) == 1 and seen[0] is not threading.main_thread()
