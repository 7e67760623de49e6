"""A second and a third Armature modifier, each of which skins the shape before it: a face's rig behind the body's."""

import bpy
import numpy as np
import pytest

from characters import (
    accelerate,
    add_shape_keys,
    animate,
    face_of,
    hook,
    make_armature,
    make_body,
    place,
    pose,
    smoothed,
    with_bendy_bones,
    with_twin,
)
from helpers import (
    addon_module,
    assert_same_on_all_frames,
    assert_same_shape,
    diagonal,
    end,
    evaluated,
    is_deforming,
    needs_memory,
    select,
    stages,
    twin_of,
    way,
)


def plain(ob):
    face_of(ob)


def volume(ob):
    face_of(ob, use_deform_preserve_volume=True)


def masked(ob):
    face_of(ob, vertex_group="bone3", use_deform_preserve_volume=True)


def masked_inverted(ob):
    face_of(ob, vertex_group="bone4", invert_vertex_group=True)


def no_such_mask(ob):
    face_of(ob, vertex_group="gone", invert_vertex_group=True)


def moved(ob):
    place(face_of(ob).object)


def moved_volume(ob):
    place(face_of(ob, use_deform_preserve_volume=True).object)


def moving(ob):
    """Against the mesh, from frame to frame."""
    armature = face_of(ob).object
    for frame, where in ((1, (0, 0, 0)), (15, (0.3, -0.2, 0.1))):
        armature.location = armature.rotation_euler = where
        armature.keyframe_insert("location", frame=frame)
        armature.keyframe_insert("rotation_euler", frame=frame)


def bendy(ob):
    for bone, segments in zip(face_of(ob).object.data.bones, (6, 1, 3)):
        bone.bbone_segments = segments


def bendy_volume(ob):
    bendy(ob)
    ob.modifiers["Face"].use_deform_preserve_volume = True
    place(ob.modifiers["Face"].object)


def the_same_rig(ob):
    smoothed(ob, "Again", "ARMATURE", object=ob.modifiers["Armature"].object, vertex_group="bone2")


def the_same_groups(ob):
    """Another armature with bones of the same names."""
    other = make_armature()
    other.name = "Other"
    for frame in (1, 10, 20):
        pose(other, frame + 1, scaled=False)
    smoothed(ob, "Other", "ARMATURE", object=other)


def three(ob):
    face_of(ob)
    face_of(ob, "Tongue", (0.3, 0.1, 0.2), use_deform_preserve_volume=True)


def others_between(ob):
    smoothed(ob, vertex_group="bone2")
    face_of(ob)
    hook(ob, strength=0.7).vertex_indices_set(range(0, 400, 3))
    smoothed(ob, "Smooth", "SMOOTH", iterations=3)
    face_of(ob, "Tongue", (0.3, 0.1, 0.2))
    smoothed(ob, "Last")


def mixed(ob):
    """A pair of Multi Modifier, behind one that is not of it."""
    smoothed(ob, "Smooth", "SMOOTH", iterations=3)
    face_of(ob)
    face_of(ob, "Tongue", (0.3, 0.1, 0.2), use_multi_modifier=True, vertex_group="bone3")
    smoothed(ob)


def mixed_at_once(ob):
    """Right behind the first, with one between that is switched off, and a third one that mixes with nothing."""
    face_of(ob)
    face_of(ob, "Off", use_multi_modifier=True, show_viewport=False, show_render=False)
    face_of(ob, "Tongue", (0.3, 0.1, 0.2), use_multi_modifier=True)
    smoothed(ob, "Off too", show_viewport=False, show_render=False)
    face_of(ob, "Ears", (0.3, 0.1, 0.2), use_multi_modifier=True)


def animated(ob):
    animate(
        face_of(ob, vertex_group="bone3"), use_deform_preserve_volume=(True, False), invert_vertex_group=(True, False)
    )


def without_weights(ob):
    """The mesh has none of its groups."""
    face_of(ob)
    for name in ("Face neck", "Face jaw", "Face brow"):
        ob.vertex_groups.remove(ob.vertex_groups[name])


LATER = (
    plain,
    volume,
    masked,
    masked_inverted,
    no_such_mask,
    moved,
    moved_volume,
    moving,
    bendy,
    bendy_volume,
    the_same_rig,
    the_same_groups,
    three,
    others_between,
    mixed,
    mixed_at_once,
    animated,
    without_weights,
)


def nothing(ob):
    pass


@pytest.mark.parametrize("before", (nothing, add_shape_keys, with_bendy_bones), ids=lambda part: part.__name__)
@pytest.mark.parametrize("later", LATER, ids=lambda part: part.__name__)
@pytest.mark.parametrize("is_volume", (False, True), ids=("linear", "volume"))
def test_on_twenty_frames(fresh_scene, before, later, is_volume):
    ob = make_body(is_volume)
    before(ob)
    later(ob)
    ob, twin = with_twin(ob)
    assert_same_on_all_frames(fresh_scene, ob, twin)
    assert way(ob) == ("KEYS" if before == add_shape_keys else "ATTRIBUTE")
    shown = [m.name for m in ob.modifiers if m.show_viewport and m.type != "NODES"]
    assert stages(ob) == shown[1:] and end(ob) == ("", "")
    assert is_deforming(ob)
    names = addon_module("run.characters").character(ob).stage_names(ob)
    assert len(addon_module("run.characters").character(ob).status.timings.last.stages) == len(names)
    if later != without_weights:  # it is the later ones that were compared
        with_all = evaluated(ob)
        for modifier in ob.modifiers:
            if modifier.type == "ARMATURE" and modifier.name in stages(ob):
                modifier.show_viewport = modifier.show_render = False
        bpy.context.view_layer.update()
        assert np.abs(evaluated(ob) - with_all).max() > 1e-4 * diagonal(with_all)


def test_behind_a_mix(fresh_scene):
    """The first two are mixed, the third one gets their result."""
    ob = make_body()
    the_same_groups(ob)
    ob.modifiers["Other"].use_multi_modifier, ob.modifiers["Other"].vertex_group = True, "bone1"
    plain(ob)
    ob, twin = with_twin(ob)
    assert_same_on_all_frames(fresh_scene, ob, twin)
    assert stages(ob) == ["Face"] and is_deforming(ob)


@pytest.mark.parametrize("before", (nothing, add_shape_keys), ids=lambda part: part.__name__)
@pytest.mark.parametrize("is_mixed", (False, True), ids=("plain", "Multi Modifier"))
def test_something_between_that_sinew_steps_over(fresh_scene, before, is_mixed):
    """Multi Modifier mixes with an Armature modifier right before it alone."""
    ob = make_body()
    before(ob)
    ob.data.uv_layers.new()
    ob.modifiers.new("Between", "UV_WARP").offset = 0.25, 0.5
    face_of(ob, use_multi_modifier=is_mixed)
    ob, twin = with_twin(ob)
    assert_same_on_all_frames(fresh_scene, ob, twin, range(1, 9))
    assert stages(ob) == ["Face"] and is_deforming(ob)


@pytest.mark.parametrize("before", (nothing, add_shape_keys), ids=lambda part: part.__name__)
@pytest.mark.parametrize("later", (nothing, volume), ids=lambda part: part.__name__)
def test_one_without_an_object_comes_first(fresh_scene, before, later):
    """Importers leave such, and Blender ignores them, until somebody chooses an object."""
    ob = make_body()
    before(ob)
    later(ob)
    ob.modifiers.new("Empty", "ARMATURE")
    ob.modifiers.move(len(ob.modifiers) - 1, 0)
    ob, twin = with_twin(ob)
    assert is_deforming(ob), addon_module("run.characters").character(ob).way.reason
    assert_same_on_all_frames(fresh_scene, ob, twin, range(1, 9))
    for chosen in (ob.modifiers["Armature"].object, None):
        for each in (ob, twin):
            each.modifiers["Empty"].object = chosen
        assert_same_on_all_frames(fresh_scene, ob, twin, range(1, 9))
        assert is_deforming(ob) == (chosen is None)


def test_objects_that_share_a_mesh(fresh_scene):
    """Each has a face of its own."""
    first = make_body()
    others_between(first)
    second = first.copy()
    fresh_scene.collection.objects.link(second)
    second.location.x = 0.4
    second.modifiers["Tongue"].object = second.modifiers["Face"].object
    twins = [twin_of(ob) for ob in (first, second)]
    for ob in (first, second):
        accelerate(ob)
    for frame in range(1, 11):
        fresh_scene.frame_set(frame)
        for ob, twin in zip((first, second), twins):
            assert_same_shape(ob, twin)
    assert way(first) == way(second) == "CANVAS" and is_deforming(first) and is_deforming(second)
    assert stages(first) == stages(second) and end(first) == ("", "")


@pytest.mark.skipif(bpy.app.version < (4, 1, 0), reason="left to Blender in this version")
@pytest.mark.parametrize("kind", ("MIRROR", "SUBSURF", "MASK", "TRIANGULATE"))
@pytest.mark.parametrize("later", (masked, bendy_volume, three, mixed_at_once), ids=lambda part: part.__name__)
def test_behind_modifiers_that_make_vertices(fresh_scene, kind, later):
    """All skin the vertices that those have made."""
    ob = make_body()
    modifier = ob.modifiers.new("Before", kind)
    if kind == "MASK":
        modifier.vertex_group = "bone3"
    ob.modifiers.move(1, 0)
    later(ob)
    ob, twin = with_twin(ob)
    assert_same_on_all_frames(fresh_scene, ob, twin, range(1, 9))
    assert way(ob) == "CANVAS" and "Face" in stages(ob) and end(ob) == ("", "") and is_deforming(ob)
    for each in (ob, twin):  # seen at once
        each.vertex_groups["Face jaw"].add(range(600, 1200, 3), 0.8, "REPLACE")
        each.data.vertices[900].co.x += 0.3
    bpy.context.view_layer.update()
    assert_same_shape(ob, twin)
    assert_same_on_all_frames(fresh_scene, ob, twin, range(9, 14))
    assert is_deforming(ob)


@needs_memory
def test_the_deformed_copy(fresh_scene):
    ob = make_body()
    others_between(ob)
    twin = twin_of(ob)
    accelerate(ob, output="MESH")
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 5, 9))
    copy = ob.sinew.deformed
    for frame in (3, 12):
        fresh_scene.frame_set(frame)
        assert np.abs(evaluated(copy) - evaluated(twin)).max() < 1e-5 * diagonal(evaluated(twin))


def test_a_rig_that_nothing_else_evaluates(fresh_scene):
    """Hidden, in no scene: the hook waits for it all the same."""
    ob = make_body()
    face = face_of(ob).object
    ob, twin = with_twin(ob)
    fresh_scene.frame_set(2)
    face.hide_viewport = True
    assert_same_on_all_frames(fresh_scene, ob, twin, (3, 8))
    fresh_scene.collection.objects.unlink(face)
    assert_same_on_all_frames(fresh_scene, ob, twin, (4, 9))
    assert is_deforming(ob)


@pytest.mark.parametrize("with_mesh", (True, False), ids=("mesh and rig", "rig alone"))
def test_bound_with_the_later_armature_selected(fresh_scene, with_mesh):
    """It begins with the first one all the same."""
    ob = make_body()
    face = face_of(ob).object
    twin = twin_of(ob)
    select(*((face, ob) if with_mesh else (face,)))
    bpy.context.view_layer.objects.active = face
    assert bpy.ops.object.sinew_bind() == {"FINISHED"}
    if not with_mesh:
        bpy.data.objects.remove(twin)
        twin = twin_of(ob)
        addon_module("install.bind").unbind(twin)
    assert ob.sinew.armature == ob.modifiers["Armature"].object
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 5, 9))
    assert stages(ob) == ["Face"] and is_deforming(ob)


# --- switches and drivers -------------------------------------------------------------------------

BLINKS = {1: True, 5: False, 8: True, 11: False, 14: True}
LATER_BLINKS = {1: False, 3: True, 9: False, 13: True}


def keyed(ob, name, values):
    """Switches a modifier for viewport and renders by keyframes. values: {frame: value}."""
    for frame, value in values.items():
        for setting in ("show_viewport", "show_render"):
            setattr(ob.modifiers[name], setting, value)
            ob.modifiers[name].keyframe_insert(setting, frame=frame)


def face_switched(ob):
    face_of(ob)
    keyed(ob, "Face", BLINKS)


def first_of_a_mix_switched(ob):
    mixed(ob)
    keyed(ob, "Face", BLINKS)


def whole_mix_switched(ob):
    """At times, both, one or none of them are on."""
    mixed(ob)
    keyed(ob, "Face", BLINKS)
    keyed(ob, "Tongue", LATER_BLINKS)


def body_and_face_switched(ob):
    face_of(ob)
    keyed(ob, "Armature", LATER_BLINKS)
    keyed(ob, "Face", BLINKS)


def mask_driven(ob):
    face_of(ob, vertex_group="bone3")
    driver = ob.driver_add('modifiers["Face"].invert_vertex_group').driver
    driver.expression = "var > 0"
    variable = driver.variables.new()
    variable.name, variable.type = "var", "TRANSFORMS"
    variable.targets[0].id, variable.targets[0].bone_target = ob.modifiers["Armature"].object, "bone2"
    variable.targets[0].transform_type, variable.targets[0].transform_space = "ROT_X", "LOCAL_SPACE"


@pytest.mark.parametrize("before", (nothing, add_shape_keys), ids=lambda part: part.__name__)
@pytest.mark.parametrize(
    "later",
    (face_switched, first_of_a_mix_switched, whole_mix_switched, body_and_face_switched, mask_driven),
    ids=lambda part: part.__name__,
)
def test_animated_switches_and_driven_settings(fresh_scene, before, later):
    ob = make_body()
    before(ob)
    later(ob)
    ob, twin = with_twin(ob)
    assert_same_on_all_frames(fresh_scene, ob, twin, (*range(1, 18), 6, 2, 12, 9, 10, 10, 15, 16, 17, 18, 19, 20))
    behind = [modifier.name for modifier in twin.modifiers][1:]
    assert stages(ob) == behind and end(ob) == ("", "") and is_deforming(ob)
    fresh_scene.frame_set(6)
    with_all = evaluated(twin)
    for each in (ob, twin):  # an edit, while some are off
        each.vertex_groups["bone2"].add(range(0, 1200, 5), 1, "REPLACE")
    bpy.context.view_layer.update()
    assert np.abs(evaluated(twin) - with_all).max() > 1e-3 * diagonal(with_all)
    assert_same_shape(ob, twin)
    assert_same_on_all_frames(fresh_scene, ob, twin, (7, 8, 9, 4, 5, 14))
    assert is_deforming(ob)


# --- what is left to Blender ----------------------------------------------------------------------


def with_envelopes(ob):
    face_of(ob, use_bone_envelopes=True)


def with_multiplying_envelopes(ob):
    for bone in face_of(ob).object.data.bones:
        bone.use_envelope_multiply = True


def with_one_of_a_mix(ob):
    face_of(ob)
    face_of(ob, "Tongue", (0.3, 0.1, 0.2), use_multi_modifier=True, use_bone_envelopes=True)


@pytest.mark.parametrize("before", (nothing, add_shape_keys), ids=lambda part: part.__name__)
@pytest.mark.parametrize(
    "later, reason",
    [
        (with_envelopes, "depend on the shape before it"),
        (with_multiplying_envelopes, "depend on the shape before it"),
        (with_one_of_a_mix, "it is mixed with Tongue"),
    ],
    ids=lambda part: getattr(part, "__name__", ""),
)
def test_where_the_run_ends(fresh_scene, before, later, reason):
    ob = make_body()
    before(ob)
    smoothed(ob)
    later(ob)
    smoothed(ob, "Last")
    ob, twin = with_twin(ob)
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 5, 9))
    assert stages(ob) == ["Corrective"] and is_deforming(ob)
    assert end(ob)[0] == "Face" and reason in end(ob)[1]


@pytest.mark.parametrize("before", (nothing, add_shape_keys), ids=lambda part: part.__name__)
def test_bound_without_an_armature(fresh_scene, before):
    """As ever: Armature modifiers that are added later are Blender's."""
    ob = make_body()
    before(ob)
    armature = ob.modifiers["Armature"].object
    ob.modifiers.remove(ob.modifiers["Armature"])
    smoothed(ob)
    ob, twin = with_twin(ob)
    for each in (ob, twin):
        smoothed(each, "Armature", "ARMATURE", object=armature)
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 5))
    assert stages(ob) == ["Corrective"] and "bound without it" in end(ob)[1]
