"""A second Armature modifier while people edit: each edit shows at once, also behind the fast path."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from characters import add_shape_keys, face_of, make_body, place, remove_group, smoothed, with_twin
from helpers import (
    addon_module,
    assert_plays_without_the_addon,
    assert_same_on_all_frames,
    assert_same_shape,
    depsgraph,
    diagonal,
    evaluated,
    into_a_shot,
    is_deforming,
    select,
    shortcut_of,
    stages,
    traces_of,
    way,
)
from test_render import add_camera, assert_same_pictures, pictures_of_both, with_all_of_it


@pytest.fixture(params=("attribute", "keys", "others"))
def in_use(request, fresh_scene):
    """scene, bound mesh that takes the fast path (unless it has a hook), twin, the later armature."""
    ob = make_body()
    if request.param == "keys":
        add_shape_keys(ob)
    if request.param == "others":
        smoothed(ob, iterations=3)
    face = face_of(ob).object
    face.data.bones["Face neck"].bbone_segments = 4
    if request.param == "others":
        smoothed(ob, "Smooth", "SMOOTH")
    ob, twin = with_twin(ob)
    for frame in range(1, 4):
        fresh_scene.frame_set(frame)
    assert goes_the_fast_path(ob)
    return fresh_scene, ob, twin, face


def goes_the_fast_path(ob):
    shortcut = shortcut_of(ob)
    return shortcut is not None and shortcut.holds()


def test_the_fast_path(in_use):
    scene, ob, twin, _ = in_use
    for frame in (4, 9.5, 17):
        scene.frame_set(int(frame), subframe=frame % 1)
        assert goes_the_fast_path(ob)
        assert_same_shape(ob, twin)


def edit_bones(armature, edit):
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    edit(armature.data.edit_bones)
    bpy.ops.object.mode_set(mode="OBJECT")


def paint(ob, _):
    ob.vertex_groups["Face jaw"].add(range(600, 1200, 3), 0.8, "REPLACE")


def remove_a_group(ob, _):
    remove_group(ob, "Face jaw")


def move_vertices(ob, _):
    blocks = ob.data.shape_keys.key_blocks if ob.data.shape_keys else ()
    for points in (ob.data.vertices, *(key.data for key in blocks)):
        for point in points:
            point.co.x *= 1.5
    ob.data.update()


def other_method(ob, _):
    ob.modifiers["Face"].use_deform_preserve_volume = True


def a_mask(ob, _):
    ob.modifiers["Face"].vertex_group = "bone3"
    ob.modifiers["Face"].invert_vertex_group = True


def no_groups(ob, _):
    ob.modifiers["Face"].use_vertex_groups = False


def by_envelopes(ob, _):
    ob.modifiers["Face"].use_bone_envelopes = True


def switched_off(ob, _):
    ob.modifiers["Face"].show_viewport = False


def not_in_renders(ob, _):
    ob.modifiers["Face"].show_render = False


def mixed_with_the_first(ob, _):
    ob.modifiers["Face"].use_multi_modifier = True


def the_other_armature(ob, _):
    ob.modifiers["Face"].object = ob.modifiers["Armature"].object


def no_armature(ob, _):
    ob.modifiers["Face"].object = None


def removed(ob, _):
    ob.modifiers.remove(ob.modifiers["Face"])


def renamed(ob, _):
    ob.modifiers["Face"].name = 'The "face"'


def moved_to_the_front(ob, _):
    select(ob)
    bpy.ops.object.modifier_move_to_index(modifier="Face", index=0)


def moved_to_the_end(ob, _):
    select(ob)
    bpy.ops.object.modifier_move_to_index(modifier="Face", index=len(ob.modifiers) - 1)


def one_more(ob, _):
    face_of(ob, "Tongue", (0.3, 0.1, 0.2))


def rest_position(_, armature):
    armature.data.pose_position = "REST"


def bent_in_the_rest_position(_, armature):
    for bone in armature.pose.bones:
        bone.bone.bbone_segments, bone.bbone_scalein, bone.bbone_curveoutx = 3, (0.2, 0.7, -0.8), 0.5
    rest_position(_, armature)


def a_bone_that_does_not_deform(_, armature):
    armature.data.bones["Face jaw"].use_deform = False


def more_segments(_, armature):
    armature.data.bones["Face jaw"].bbone_segments = 12


def multiplying_envelopes(_, armature):
    armature.data.bones["Face jaw"].use_envelope_multiply = True


def a_bone_renamed(_, armature):
    armature.data.bones["Face jaw"].name = "Chin"


def another_bone(_, armature):
    edit_bones(armature, lambda bones: setattr(bones.new("extra"), "tail", (0, 0, 1)))


def a_bone_less(_, armature):
    edit_bones(armature, lambda bones: bones.remove(bones["Face jaw"]))


def a_bone_moved(_, armature):
    edit_bones(armature, lambda bones: setattr(bones["Face jaw"], "roll", 1.0))


def armature_moved(_, armature):
    place(armature)


def armature_flat(_, armature):
    armature.scale = 1, 0, 1


def posed_by_hand(_, armature):
    armature.animation_data_clear()
    armature.pose.bones["Face jaw"].location = 0.5, 0.2, 0.1


def mesh_moved(ob, _):
    ob.matrix_world = Matrix.Translation((0.5, 0, 1)) @ Matrix.Rotation(0.4, 4, "X")


def armature_deleted(_, armature):
    bpy.data.objects.remove(armature)


def in_edit_mode(_, armature):
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")


EDITS = (
    paint,
    remove_a_group,
    move_vertices,
    other_method,
    a_mask,
    no_groups,
    by_envelopes,
    switched_off,
    not_in_renders,
    mixed_with_the_first,
    the_other_armature,
    no_armature,
    removed,
    renamed,
    moved_to_the_front,
    moved_to_the_end,
    one_more,
    rest_position,
    bent_in_the_rest_position,
    a_bone_that_does_not_deform,
    more_segments,
    multiplying_envelopes,
    a_bone_renamed,
    another_bone,
    a_bone_less,
    a_bone_moved,
    armature_moved,
    armature_flat,
    posed_by_hand,
    mesh_moved,
    armature_deleted,
    in_edit_mode,
)


@pytest.mark.parametrize("edit", EDITS, ids=lambda edit: edit.__name__)
def test_an_edit_shows_at_once(in_use, edit):
    scene, ob, twin, face = in_use
    # The rig is the twin's too: what is done to it is done once.
    for each in (ob,) if edit in OF_THE_RIG else (ob, twin):
        edit(each, face)
    bpy.context.view_layer.update()
    assert_same_shape(ob, twin)
    for frame in (4, 5, 6, 7, 12):
        scene.frame_set(frame)
        assert_same_shape(ob, twin)


OF_THE_RIG = {
    rest_position,
    bent_in_the_rest_position,
    a_bone_that_does_not_deform,
    more_segments,
    multiplying_envelopes,
    a_bone_renamed,
    another_bone,
    a_bone_less,
    a_bone_moved,
    armature_moved,
    armature_flat,
    posed_by_hand,
    armature_deleted,
    in_edit_mode,
}


def test_another_armature_comes_to_be_the_first(in_use):
    """Sinew begins with it once the mesh is accelerated again."""
    scene, ob, twin, _ = in_use
    for each in (ob, twin):
        moved_to_the_front(each, None)
    assert_same_on_all_frames(scene, ob, twin, (4, 5))
    assert way(ob) == "BLENDER" and "Face (Armature) comes before Armature" in character(ob).way.reason
    select(ob)
    assert bpy.ops.object.sinew_unbind() == {"FINISHED"} and bpy.ops.object.sinew_bind() == {"FINISHED"}
    assert_same_on_all_frames(scene, ob, twin, (6, 7, 8, 9, 10))
    assert ob.sinew.modifier.name == "Face" and "Armature" in stages(ob) and is_deforming(ob)


def character(ob):
    return addon_module("run.characters").character(ob)


def test_the_run_goes_on_when_envelopes_no_longer_multiply(in_use):
    scene, ob, twin, face = in_use
    before = stages(ob)
    for does in (True, False, True, False):
        face.data.bones["Face jaw"].use_envelope_multiply = does
        bpy.context.view_layer.update()
        assert_same_on_all_frames(scene, ob, twin, (4, 5, 6))
        assert is_deforming(ob) and ("Face" in stages(ob)) != does
    assert stages(ob) == before


def test_undo(in_use):
    scene, ob, twin, _ = in_use
    names = ob.name, twin.name

    def both():
        return [bpy.data.objects[name] for name in names]

    bpy.ops.ed.undo_push(message="before")
    for each in both():
        a_mask(each, None)
    bpy.ops.ed.undo_push(message="masked")
    assert_same_shape(*both())
    bpy.ops.ed.undo()
    assert both()[0].modifiers["Face"].vertex_group == ""
    for frame in (5, 6, 7, 8):
        scene = bpy.context.scene
        scene.frame_set(frame)
        assert_same_shape(*both())
    assert "Face" in stages(both()[0]) and is_deforming(both()[0])


def test_removed_and_added_again(in_use):
    """The run follows the stack."""
    scene, ob, twin, face = in_use
    for each in (ob, twin):
        each.modifiers.remove(each.modifiers["Face"])
    assert_same_on_all_frames(scene, ob, twin, (4, 5, 6, 7))
    assert goes_the_fast_path(ob)
    for each in (ob, twin):
        smoothed(each, "Face", "ARMATURE", object=face)
    assert_same_on_all_frames(scene, ob, twin, (8, 9, 10, 11, 12))
    assert "Face" in stages(ob) and goes_the_fast_path(ob)


# --- files, shots and renders ---------------------------------------------------------------------


def reload(path):
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path))


def in_the_file(*objects):
    """Functions of nothing that find them again when they were read anew."""
    return [lambda name=ob.name: bpy.data.objects[name] for ob in objects]


def test_saved_and_opened(in_use, tmp_path):
    _, *objects = in_use
    ob, twin, face = in_the_file(*objects)
    reload(tmp_path / "saved.blend")
    assert_same_on_all_frames(bpy.context.scene, ob(), twin(), (4, 5, 6, 7))
    assert "Face" in stages(ob()) and is_deforming(ob())
    a_mask(ob(), face())
    a_mask(twin(), face())
    assert_same_on_all_frames(bpy.context.scene, ob(), twin(), (8, 9))


def test_it_plays_without_the_addon(in_use, tmp_path):
    _, ob, twin, _ = in_use
    assert_plays_without_the_addon(tmp_path, ob, twin)


@pytest.mark.parametrize("overridden", (False, True), ids=("linked", "overridden"))
def test_in_a_shot(in_use, tmp_path, overridden):
    scene, ob, twin, face = in_use
    names = ob.name, twin.name
    collection = bpy.data.collections.new("Character")
    scene.collection.children.link(collection)
    for each in (ob, twin, face, ob.modifiers["Armature"].object):
        collection.objects.link(each)
    scene = into_a_shot(tmp_path, overridden)
    ob, twin = (next(o for o in scene.objects if o.name == name) for name in names)
    assert_same_on_all_frames(scene, ob, twin, (4, 5, 6, 7))
    assert "Face" in stages(ob) and is_deforming(ob)


def test_duplicated_with_its_armatures(in_use):
    scene, ob, twin, face = in_use
    select(ob, twin, face, ob.modifiers["Armature"].object)
    bpy.ops.object.duplicate()
    copy, copied_twin = (
        next(o for o in bpy.context.selected_objects if o.type == "MESH" and o.sinew.is_bound == is_bound)
        for is_bound in (True, False)
    )
    copied_face = copy.modifiers["Face"].object
    assert copied_face not in (None, face)
    copied_face.animation_data_clear()
    copied_face.pose.bones["Face jaw"].location = 0.4, 0.1, 0
    for frame in (4, 5, 6, 7):
        scene.frame_set(frame)
        assert_same_shape(ob, twin)
        assert_same_shape(copy, copied_twin)
    assert is_deforming(copy) and is_deforming(ob)


@pytest.mark.parametrize("mode", ("EDIT", "WEIGHT_PAINT", "SCULPT"))
def test_through_a_mode_and_back(in_use, mode):
    scene, ob, twin, _ = in_use
    select(ob)
    bpy.ops.object.mode_set(mode=mode)
    scene.frame_set(6)
    if mode == "WEIGHT_PAINT":
        assert_same_shape(ob, twin)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert_same_shape(ob, twin)
    assert_same_on_all_frames(scene, ob, twin, (7, 8, 9, 10))
    assert is_deforming(ob)


def test_unbound(in_use):
    scene, ob, twin, _ = in_use
    select(ob)
    assert bpy.ops.object.sinew_unbind() == {"FINISHED"}
    assert traces_of(ob) == [] and [m.name for m in ob.modifiers] == [m.name for m in twin.modifiers]
    assert_same_on_all_frames(scene, ob, twin, (4, 5))


def test_the_shape_is_applied(in_use):
    """Convert > Mesh, and the modifier Sinew, leave no second deformation."""
    scene, ob, twin, _ = in_use
    shape = evaluated(twin)
    graph_mesh = bpy.data.meshes.new_from_object(ob.evaluated_get(depsgraph()))
    assert np.abs(own_positions_of(graph_mesh) - shape).max() < 1e-5 * diagonal(shape)
    if nodes_of(ob) and not ob.data.shape_keys:
        select(ob)
        assert bpy.ops.object.modifier_apply(modifier=nodes_of(ob)[0].name) == {"FINISHED"}
        bpy.context.view_layer.update()
        assert not ob.sinew.is_bound
        assert np.abs(evaluated(ob) - shape).max() < 1e-5 * diagonal(shape)


def nodes_of(ob):
    return [modifier for modifier in ob.modifiers if modifier.type == "NODES"]


def own_positions_of(mesh):
    return np.array([vertex.co for vertex in mesh.vertices], np.float32)


@pytest.mark.parametrize("keys", (False, True), ids=("plain", "keys"))
def test_rendered_with_motion_blur(fresh_scene, tmp_path, keys):
    ob = make_body()
    if keys:
        add_shape_keys(ob)
    face_of(ob).object.hide_render = True
    smoothed(ob)
    ob, twin = with_twin(ob)
    add_camera(fresh_scene)
    fresh_scene.camera.location = (0, -12, 2.5)
    with_all_of_it(fresh_scene)
    assert_same_pictures(*pictures_of_both(fresh_scene, tmp_path, ob, twin))
    assert stages(ob) == ["Face", "Corrective"] and is_deforming(ob)
