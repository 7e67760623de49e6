"""The skinning methods that are Sinew's own, and its smoothing, in Blender."""

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, pose, smoothed
from helpers import (
    addon_module,
    assert_plays_without_the_addon,
    assert_same_on_all_frames,
    depsgraph,
    diagonal,
    evaluated,
    needs_memory,
    select,
    twin_of,
    way,
)

BLENDED, CENTERS, MUSH = "BLENDED", "ROTATION_CENTERS", "DIRECT_DELTA_MUSH"


@pytest.fixture
def character(character):
    """(a bound mesh, its unbound twin)."""
    return character[:2]


def shapes(ob, frames=(5, 9)):
    found = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        found.append(evaluated(ob))
    return np.array(found)


# --- blended --------------------------------------------------------------------------------------


@pytest.mark.parametrize("share, preserve", ((0.0, False), (1.0, True)))
def test_a_share_of_0_or_1_is_one_of_the_two(character, share, preserve):
    ob, twin = character
    ob.sinew.method, ob.sinew.skinning.share = BLENDED, share
    twin.modifiers["Armature"].use_deform_preserve_volume = preserve
    assert_same_on_all_frames(bpy.context.scene, ob, twin, (1, 5, 9))


@needs_memory
@pytest.mark.parametrize("invert", (False, True))
def test_the_share_of_a_painted_group(character, invert):
    ob, _twin = character
    by_modifier = {}
    for method in ("LINEAR", "DUAL_QUATERNION"):
        ob.sinew.method = method
        by_modifier[method] = shapes(ob)
    ob.sinew.method = BLENDED
    select(ob)
    assert bpy.ops.object.sinew_paint_map(map="share_group") == {"FINISHED"}
    assert ob.mode == "WEIGHT_PAINT" and ob.vertex_groups.active.name == ob.sinew.skinning.share_group
    bpy.ops.object.mode_set(mode="OBJECT")
    share = np.linspace(0, 1, len(ob.data.vertices), dtype=np.float32)
    for vertex, weight in enumerate(share.tolist()):
        ob.vertex_groups.active.add((vertex,), weight, "REPLACE")
    ob.sinew.skinning.share_invert = invert
    share = (1 - share if invert else share)[:, None]
    linear, dual = by_modifier["LINEAR"], by_modifier["DUAL_QUATERNION"]
    assert np.abs(linear - dual).max() > 1e-3 * diagonal(linear[0])
    assert np.abs(shapes(ob) - (linear + share * (dual - linear))).max() < 1e-5 * diagonal(linear[0])


@pytest.mark.parametrize("share", (0.2, 0.8))
def test_without_sinew_the_nearer_of_the_two(character, share):
    ob, _twin = character
    ob.sinew.method = BLENDED
    ob.sinew.skinning.share = share
    own = shapes(ob)
    ob.sinew.method = "DUAL_QUATERNION" if share < 0.5 else "LINEAR"
    other = shapes(ob)
    ob.sinew.method = BLENDED
    addon_module("install.bind").unbind(ob)
    assert np.square(shapes(ob) - own).sum() < np.square(other - own).sum()


# --- what is computed once ------------------------------------------------------------------------


def native():
    return addon_module("native").sinew_native


def lacks(ob):
    return addon_module("install.precomputing").lacks(ob)


def expected(ob, method):
    """The shape on this frame by the native method itself, from what the file says."""
    layer = addon_module("run.characters").character(ob).layers[0]
    mesh, armature = ob.data, ob.modifiers["Armature"].object.evaluated_get(depsgraph())
    offsets = np.append([polygon.loop_start for polygon in mesh.polygons], len(mesh.loops))
    faces = offsets, np.array([loop.vertex_index for loop in mesh.loops])
    space = np.array(ob.matrix_world.inverted() @ armature.matrix_world)
    motions = space @ layer.read_pose(armature) @ np.linalg.inv(space)
    motions = np.ascontiguousarray(motions, np.float32)
    if method == CENTERS:
        return native().skin_rotation_centers(layer.skin, native().RotationCenters.compute(layer.skin, *faces), motions)
    return native().skin_direct_delta_mush(native().DirectDeltaMush.compute(layer.skin, *faces), motions)


@pytest.mark.parametrize("method", (CENTERS, MUSH))
@pytest.mark.parametrize("keys", (False, True))
def test_the_native_method_is_what_is_shown(fresh_scene, method, keys):
    armature = make_armature()
    ob = make_mesh(armature, False)
    if keys:
        ob.shape_key_add(name="Basis")
    for frame in (1, 7, 14, 20):
        pose(armature, frame, False)
    accelerate(ob)
    linear = shapes(ob)
    ob.sinew.method = method
    assert lacks(ob) == "" and way(ob) == ("KEYS" if keys else "ATTRIBUTE")
    for frame, other in zip((5, 9), linear):
        fresh_scene.frame_set(frame)
        shape = evaluated(ob)
        assert np.abs(shape - expected(ob, method)).max() < 1e-5 * diagonal(shape)
        assert np.abs(shape - other).max() > 1e-3 * diagonal(shape)


@needs_memory
@pytest.mark.parametrize("method", (BLENDED, CENTERS, MUSH))
def test_saved_and_opened(character, tmp_path, method):
    ob, _twin = character
    ob.sinew.method = method
    before, name, path = shapes(ob), ob.name, tmp_path / "saved.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path))
    ob = bpy.data.objects[name]
    assert ob.sinew.method == method and np.array_equal(shapes(ob), before)
    assert lacks(ob) == ""


@pytest.mark.parametrize("method", (BLENDED, CENTERS, MUSH))
def test_without_sinew_the_file_plays_by_the_modifier(character, tmp_path, method):
    ob, twin = character
    ob.sinew.method = method
    twin.modifiers["Armature"].use_deform_preserve_volume = method != MUSH
    shapes(ob)
    assert_plays_without_the_addon(tmp_path, ob, twin)


@pytest.mark.parametrize("method", (CENTERS, MUSH))
def test_undo_and_redo(character, method):
    ob, _twin = character
    name = ob.name
    linear = shapes(ob)
    bpy.ops.ed.undo_push(message="before")
    ob.sinew.method = method
    own = shapes(ob)
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    assert np.array_equal(shapes(bpy.data.objects[name]), linear)
    bpy.ops.ed.redo()
    ob = bpy.data.objects[name]
    assert np.array_equal(shapes(ob), own) and lacks(ob) == ""


def move_a_vertex(ob):
    ob.data.vertices[3].co.x += 0.1
    ob.data.update()


def paint(ob):
    ob.vertex_groups["bone1"].add(range(20), 0.4, "REPLACE")


def set_it(ob):
    ob.sinew.skinning.sigma = 0.3
    ob.sinew.skinning.iterations = 5


def cut(ob):
    select(ob)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.quads_convert_to_tris()
    bpy.ops.object.mode_set(mode="OBJECT")


@needs_memory
@pytest.mark.parametrize("method", (CENTERS, MUSH))
@pytest.mark.parametrize("edit", (move_a_vertex, paint, set_it, cut), ids=lambda edit: edit.__name__)
def test_an_edit_makes_it_out_of_date(character, method, edit):
    ob, _twin = character
    ob.sinew.method = method
    shapes(ob)
    edit(ob)
    shapes(ob)
    assert lacks(ob) == "STALE" and not addon_module("run.characters").character(ob).status.error
    select(ob)
    assert bpy.ops.object.sinew_prepare_method() == {"FINISHED"}
    shapes(ob)
    assert lacks(ob) == ""


@needs_memory
@pytest.mark.parametrize("method", (CENTERS, MUSH))
def test_painting_does_not_read_again_what_is_kept(character, monkeypatch, method):
    ob, _twin = character
    ob.sinew.method = method
    shapes(ob)
    kept_arrays, reads = addon_module("blender.kept_arrays"), []
    read = kept_arrays.read
    monkeypatch.setattr(kept_arrays, "read", lambda text: reads.append(text) or read(text))
    for weight in (0.1, 0.2, 0.3):
        ob.vertex_groups["bone1"].add(range(20), weight, "REPLACE")
        shapes(ob)
    assert lacks(ob) == "STALE" and not reads
    select(ob)
    bpy.ops.object.sinew_prepare_method()
    shapes(ob)
    assert lacks(ob) == "" and len(reads) == 1


@needs_memory
@pytest.mark.parametrize("method", (CENTERS, MUSH))
def test_with_other_vertices_it_is_deformed_as_without_sinew(character, method):
    ob, twin = character
    ob.sinew.method = method
    twin.modifiers["Armature"].use_deform_preserve_volume = method == CENTERS
    for each in (ob, twin):
        select(each)
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.mesh.subdivide()
        bpy.ops.object.mode_set(mode="OBJECT")
    assert_same_on_all_frames(bpy.context.scene, ob, twin, (1, 5, 9))
    assert lacks(ob) == "UNFIT"


@needs_memory
def test_unbinding_leaves_nothing(character):
    ob, twin = character
    before = len(bpy.data.texts)
    ob.sinew.method = MUSH
    assert len(bpy.data.texts) == before + 1
    select(ob)
    bpy.ops.object.sinew_unbind()
    assert len(bpy.data.texts) == before
    assert_same_on_all_frames(bpy.context.scene, ob, twin, (5, 9))
    bpy.ops.object.sinew_bind()
    assert ob.sinew.method == MUSH and lacks(ob) == ""


def test_a_duplicate_keeps_what_the_other_loses(character):
    ob, _twin = character
    ob.sinew.method = MUSH
    select(ob)
    bpy.ops.object.duplicate()
    copy = bpy.context.object
    shape = shapes(copy)
    select(ob)
    bpy.ops.object.sinew_unbind()
    assert lacks(copy) == "" and np.array_equal(shapes(copy), shape)


@needs_memory
@pytest.mark.parametrize("method", (CENTERS, MUSH))
def test_what_is_computed_for_a_duplicate_is_its_own(character, method):
    """Both have the same arrays until then."""
    ob, _twin = character
    ob.sinew.method = method
    before = shapes(ob)
    select(ob)
    bpy.ops.object.duplicate()
    other = bpy.context.object
    other.sinew.skinning.sigma, other.sinew.skinning.iterations = 0.5, 1
    select(other)
    assert bpy.ops.object.sinew_prepare_method() == {"FINISHED"}
    assert lacks(other) == ""
    assert ob.sinew.skinning.data != other.sinew.skinning.data
    np.testing.assert_array_equal(shapes(ob), before)
    assert np.abs(shapes(other) - before).max() > 1e-4
    assert lacks(ob) == ""
    kept = {each.sinew.skinning.data for each in (ob, other)}
    assert bpy.ops.object.sinew_prepare_method() == {"FINISHED"}  # once more, now in its own
    assert {each.sinew.skinning.data for each in (ob, other)} == kept == set(bpy.data.texts)


def test_nothing_to_compute_for_is_said(character):
    ob, _twin = character
    select(ob)
    with pytest.raises(RuntimeError, match="Nothing can be computed"):
        bpy.ops.object.sinew_prepare_method()


# --- smoothing ------------------------------------------------------------------------------------


@needs_memory
@pytest.mark.parametrize("keys", (False, True))
@pytest.mark.parametrize("group", ("", "bone2"))
def test_smoothing_is_a_corrective_smooth_without_the_modifier(fresh_scene, keys, group):
    armature = make_armature()
    ob = make_mesh(armature, True)
    if keys:
        add_shape_keys(ob)
    twin = twin_of(ob)
    smoothed(twin, iterations=7, factor=0.6, vertex_group=group)
    for each in (ob, twin):
        smoothed(each, "Then", kind="SMOOTH", iterations=2)
    for frame in (1, 7, 14, 20):
        pose(armature, frame, False)
    accelerate(ob)
    skinning = ob.sinew.skinning
    skinning.smooth_iterations, skinning.smooth_factor, skinning.smooth_group = 7, 0.6, group
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 2, 3, 5, 9))
    skinning.smooth_invert = twin.modifiers["Corrective"].invert_vertex_group = True
    assert_same_on_all_frames(fresh_scene, ob, twin, (5, 9))
    skinning.smooth_iterations = 0
    twin.modifiers.remove(twin.modifiers["Corrective"])
    assert_same_on_all_frames(fresh_scene, ob, twin, (5, 6, 7, 9))
