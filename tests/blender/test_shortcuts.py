"""On a frame in which nothing but the pose has changed Sinew takes the fast path. Whatever people do, it must not be
gone once too often: each edit is made while it is in use, and the shape is compared with the twin's."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from characters import (
    accelerate,
    add_shape_keys,
    by_keys,
    drive,
    hook,
    in_a_cage,
    make_armature,
    make_cage,
    make_mesh,
    make_tube,
    pose,
    remove_group,
    smoothed,
    with_bendy_bones,
)
from helpers import (
    addon_module,
    assert_same_on_all_frames,
    assert_same_shape,
    evaluated,
    select,
    shortcut_of,
    twin_of,
    way,
)


def smoothed_by_a_driver(ob):
    smoothed(ob, iterations=3)
    drive(ob, 'modifiers["Corrective"].factor', "0.3 + 0.4 * var")


def hooked(ob):
    hook(ob, strength=0.7).vertex_indices_set(range(0, 400, 3))


def caged(ob):
    by_keys(make_cage())
    in_a_cage(ob)


# What is behind the armature, for those that have something there.
BEHIND = {
    "smoothed": lambda ob: smoothed(ob, iterations=3),
    "driven": smoothed_by_a_driver,
    "hooked": hooked,
    "caged": caged,
}


@pytest.fixture(params=["linear", "volume", "keys", *BEHIND])
def in_use(request, fresh_scene):
    """scene, bound mesh that takes the fast path, twin, armature."""
    armature = make_armature()
    ob = make_mesh(armature, request.param == "volume")
    with_bendy_bones(ob)
    if request.param in {"keys", "smoothed"}:
        add_shape_keys(ob)
    if request.param in BEHIND:
        BEHIND[request.param](ob)
    for frame in range(1, 21, 4):
        pose(armature, frame, scaled=True)
    twin = twin_of(ob)
    accelerate(ob)
    play(fresh_scene, 1)
    assert goes_it(ob)
    return fresh_scene, ob, twin, armature


def play(scene, first):
    for frame in range(first, first + 3):
        scene.frame_set(frame)


def goes_it(ob):
    """Whether the next frame takes the fast path."""
    shortcut = shortcut_of(ob)
    return shortcut is not None and shortcut.holds()


def test_it_is_the_modifiers_shape(in_use):
    scene, ob, twin, _ = in_use
    for frame in (4, 9.5, 17):
        scene.frame_set(int(frame), subframe=frame % 1)
        assert goes_it(ob)
        assert_same_shape(ob, twin)


def paint(ob, _):
    ob.vertex_groups["bone3"].add(range(0, 1200, 2), 0.7, "REPLACE")


def remove_a_group(ob, _):
    remove_group(ob, "bone1")


def move_vertices(ob, _):
    """Of all shape keys as well."""
    blocks = ob.data.shape_keys.key_blocks if ob.data.shape_keys else ()
    for points in (ob.data.vertices, *(key.data for key in blocks)):
        for point in points:
            point.co.x *= 1.5
    ob.data.update()


def change_a_key(ob, _):
    for key in ob.data.shape_keys.key_blocks[1:] if ob.data.shape_keys else ():
        key.data[7].co.z += 0.5
        key.vertex_group = "bone1"


def mute_a_key(ob, _):
    if ob.data.shape_keys:
        ob.data.shape_keys.key_blocks["Wide"].mute = True


def other_method(ob, _):
    modifier = ob.modifiers["Armature"]
    modifier.use_deform_preserve_volume = not modifier.use_deform_preserve_volume


def a_mask(ob, _):
    ob.modifiers["Armature"].vertex_group = "bone2"
    ob.modifiers["Armature"].invert_vertex_group = True


def no_groups(ob, _):
    ob.modifiers["Armature"].use_vertex_groups = False


def switched_off(ob, _):
    ob.modifiers["Armature"].show_viewport = False


def rest_position(_, armature):
    armature.data.pose_position = "REST"


def a_bone_that_does_not_deform(_, armature):
    armature.data.bones["bone2"].use_deform = False


def more_segments(_, armature):
    armature.data.bones["bone1"].bbone_segments = 12


def edit_bones(armature, edit):
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    edit(armature.data.edit_bones)
    bpy.ops.object.mode_set(mode="OBJECT")


def another_bone(_, armature):
    edit_bones(armature, lambda bones: setattr(bones.new("extra"), "tail", (0, 0, 1)))


def a_bone_less(_, armature):
    edit_bones(armature, lambda bones: bones.remove(bones["side"]))


def a_bone_moved(_, armature):
    edit_bones(armature, lambda bones: setattr(bones["side"], "roll", 1.0))


def mesh_moved(ob, _):
    ob.matrix_world = Matrix.Translation((0.5, 0, 1)) @ Matrix.Rotation(0.4, 4, "X")


def armature_moved(_, armature):
    armature.location = 1, 2, 3
    armature.scale = 1, 2, 0.5


def posed_by_hand(_, armature):
    armature.animation_data_clear()
    armature.pose.bones["bone1"].rotation_quaternion = 0.6, 0.8, 0, 0


EDITS_OF_A_MESH = (
    paint,
    remove_a_group,
    move_vertices,
    change_a_key,
    mute_a_key,
    other_method,
    a_mask,
    no_groups,
    switched_off,
    mesh_moved,
)
EDITS_OF_BONES = (
    rest_position,
    a_bone_that_does_not_deform,
    more_segments,
    another_bone,
    a_bone_less,
    a_bone_moved,
    armature_moved,
    posed_by_hand,
)


@pytest.mark.sampled(3)
@pytest.mark.parametrize("edit", EDITS_OF_A_MESH + EDITS_OF_BONES, ids=lambda edit: edit.__name__)
def test_an_edit_is_seen_at_once(in_use, edit):
    scene, ob, twin, armature = in_use
    edit(ob, armature)
    if edit in EDITS_OF_A_MESH:
        edit(twin, armature)
    bpy.context.view_layer.update()
    assert_same_shape(ob, twin)
    for frame in (4, 7, 11):
        scene.frame_set(frame)
        assert_same_shape(ob, twin)


def behind_another(ob):
    ob.modifiers.new("Cast", "CAST").factor = 0.3
    select(ob)
    assert bpy.ops.object.modifier_move_to_index(modifier="Cast", index=0) == {"FINISHED"}
    return lambda: way(ob) == "BLENDER"


def test_an_edit_after_which_there_is_no_fast_path(in_use):
    """The old one looks at modifiers that are gone. It must not be taken up again, whatever lies in their place."""
    scene, ob, twin, _ = in_use
    behind_another(twin)
    took_effect = behind_another(ob)
    assert_same_on_all_frames(scene, ob, twin, range(4, 9))
    assert took_effect()
    assert shortcut_of(ob) is None


def other_expression(ob):
    curve = ob.animation_data.drivers.find('modifiers["Corrective"].factor')
    curve.driver.expression = "0.9 - 0.5 * var"


def without_its_driver(ob):
    ob.driver_remove('modifiers["Corrective"].factor')
    ob.modifiers["Corrective"].factor = 0.2


def moved_target(_):
    target = bpy.data.objects["Target"]
    target.animation_data_clear()
    target.location = 1, 2, 3


def weaker(ob):
    ob.modifiers[-1].strength = 0.3


def other_vertices(ob):
    ob.modifiers["Hook"].vertex_indices_set(range(800, 1200))
    ob.update_tag()


def with_a_group(ob):
    ob.modifiers[-1].vertex_group = "bone2"


def moved_points(_):
    cage = bpy.data.objects["Cage"]
    for key in cage.data.shape_keys.key_blocks:
        key.data[5].co.x += 0.4


def moved_cage(_):
    bpy.data.objects["Cage"].location = 0.3, 0.2, 2


def more_points(_):
    cage = bpy.data.objects["Cage"]
    cage.shape_key_clear()
    cage.data.points_u = 4


def without_its_object(ob):
    ob.modifiers[-1].object = None


@pytest.mark.parametrize(
    ("in_use", "edit"),
    [
        ("driven", other_expression),
        ("driven", without_its_driver),
        ("hooked", moved_target),
        ("hooked", weaker),
        ("hooked", other_vertices),
        ("hooked", with_a_group),
        ("hooked", without_its_object),
        ("caged", moved_points),
        ("caged", moved_cage),
        ("caged", more_points),
        ("caged", weaker),
        ("caged", with_a_group),
        ("caged", without_its_object),
    ],
    ids=lambda each: getattr(each, "__name__", each),
    indirect=["in_use"],
)
def test_an_edit_of_what_a_stage_follows(in_use, edit):
    scene, ob, twin, _ = in_use
    before = evaluated(ob)
    for each in (ob, twin):
        edit(each)
    bpy.context.view_layer.update()
    assert_same_shape(ob, twin)
    assert np.abs(evaluated(ob) - before).max() > 1e-3
    assert_same_on_all_frames(scene, ob, twin, range(4, 12))


def add_keys(ob):
    ob.shape_key_add(name="Basis")
    ob.shape_key_add(name="Up", from_mix=False).data[0].co.z += 1
    ob.data.shape_keys.key_blocks["Up"].value = 0.8
    return "KEYS"


def take_keys_away(ob):
    ob.shape_key_clear()
    return "ATTRIBUTE"


def test_shape_keys_that_come_or_go(in_use):
    scene, ob, twin, _ = in_use
    before = shortcut_of(ob)
    edit = take_keys_away if ob.data.shape_keys else add_keys
    edit(twin)
    wanted = edit(ob)
    assert_same_on_all_frames(scene, ob, twin, range(4, 9))
    assert way(ob) == wanted and goes_it(ob) and shortcut_of(ob) is not before


def test_keys_and_smoothing_without_an_armature(fresh_scene):
    ob = make_tube()
    add_shape_keys(ob)
    smoothed(ob, iterations=2, kind="SMOOTH")
    twin = twin_of(ob)
    accelerate(ob)
    play(fresh_scene, 1)
    assert goes_it(ob)
    assert_same_on_all_frames(fresh_scene, ob, twin, range(2, 9))


def test_settings_with_keyframes(in_use):
    scene, ob, twin, _ = in_use
    for each in (ob, twin):
        for frame, value in ((4, True), (6, False), (8, True)):
            each.modifiers["Armature"].use_deform_preserve_volume = value
            each.modifiers["Armature"].keyframe_insert("use_deform_preserve_volume", frame=frame)
    for frame in (4, 5, 6, 7, 8, 9):
        scene.frame_set(frame)
        assert_same_shape(ob, twin)


def test_mesh_and_armature_that_move_apart(in_use):
    scene, ob, twin, armature = in_use
    for each in (ob, twin, armature):
        for frame in (4, 12):
            each.location = np.random.default_rng(frame + (each == armature)).uniform(-1, 1, 3)
            each.rotation_euler.x = frame
            each.keyframe_insert("location", frame=frame)
            each.keyframe_insert("rotation_euler", frame=frame)
    play(scene, 4)
    assert way(ob) != "BLENDER" and goes_it(ob)
    for frame in (8, 10):
        scene.frame_set(frame)
        assert_same_shape(ob, twin)


def test_edit_mode_and_back(in_use):
    scene, ob, twin, armature = in_use
    select(ob)
    bpy.ops.object.mode_set(mode="EDIT")
    play(scene, 4)
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.resize(value=(1.2, 1, 1))
    bpy.ops.object.mode_set(mode="OBJECT")
    keys = [each.data.shape_keys.key_blocks if each.data.shape_keys else () for each in (twin, ob)]
    for theirs, ours in zip(
        (twin.data.vertices, *(k.data for k in keys[0])), (ob.data.vertices, *(k.data for k in keys[1]))
    ):
        for a, b in zip(theirs, ours):
            a.co = b.co
    twin.data.update()
    for frame in (7, 8, 9, 10):
        scene.frame_set(frame)
        assert_same_shape(ob, twin)


@pytest.mark.says_errors
def test_another_pose_than_was_thought(in_use):
    """Blender's own modifier deforms in the same pass."""
    scene, ob, twin, _ = in_use
    entry = addon_module("run.characters").character(ob)
    shortcut = shortcut_of(ob)

    class Wrong:
        def holds(self):
            return True

        has_bones = holds

        def set_stage(self, _number, _stage):
            pass

        def deform(self, _):
            raise ValueError("the pose has other bones than the skin was made for; make the skin again")

    shortcut._native = Wrong()
    scene.frame_set(5)
    assert_same_shape(ob, twin)
    assert "other bones" in entry.status.error
    play(scene, 6)
    assert entry.status.error == "" and goes_it(ob)
    assert_same_shape(ob, twin)


def test_what_is_used_in_vain_is_made_ever_less_often(monkeypatch):
    """A shortcut that the next frame cannot use has to wait for twice as many frames that are alike, up to 16."""
    module = addon_module("run.fast_path")
    frame = SimpleNamespace(chain=SimpleNamespace(deformer=object()), plan=object())
    useless = SimpleNamespace(run=lambda _ob: False)
    monkeypatch.setattr(module, "_is_plain", lambda *_: True)
    monkeypatch.setattr(module, "Shortcut", lambda *_: useless)
    path, counts = module.FastPath(frame), []
    for _ in range(6):
        counts.append(0)
        while path.shortcut is None:
            path.learn(None)
            counts[-1] += 1
        assert not path.run(None) and path.shortcut is None
    assert counts == [2, 4, 8, 16, 16, 16]
    frame.plan = object()
    path.learn(None)
    path.learn(None)
    assert path.shortcut is not None  # after an edit it begins anew
