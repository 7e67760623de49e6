"""The skinning methods that are Sinew's own, and its smoothing, in Blender."""

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, pose, smoothed
from helpers import assert_same_on_all_frames, diagonal, evaluated, select, twin_of

BLENDED, CENTERS, MUSH = "BLENDED", "ROTATION_CENTERS", "DIRECT_DELTA_MUSH"


@pytest.fixture
def character(fresh_scene):
    """(a bound mesh, its unbound twin)."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    twin = twin_of(ob)
    for frame in (1, 7, 14, 20):
        pose(armature, frame, False)
    accelerate(ob)
    return ob, twin


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


# --- smoothing ------------------------------------------------------------------------------------


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
