"""Bake to Bones, The Rig's Bones, Exact: on each frame of each action the skeleton's bones are where the rig's are."""

import json
import math
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Euler

import rigify_characters
from characters import drive, make_armature, make_mesh
from exporting import enable_exporters, skip_without
from helpers import addon_module, data_counts, diagonal, evaluated, needs_rig_programs, select
from skinned_files import Y_UP_TO_Z_UP, SkinnedFile

EXACT = 1e-6  # of the size
SHAPE = 1e-5  # of the diagonal: assimp writes six digits
FBX = {
    "use_selection": True,
    "add_leaf_bones": False,
    "bake_anim_use_all_actions": True,
    "bake_anim_use_nla_strips": False,
    "bake_anim_simplify_factor": 0.0,
}
SIZE = 5.0  # of the rig


def module(name):
    return addon_module(f"to_bones.{name}")


@pytest.fixture
def rig(fresh_scene):
    """Bones that deform below ones that do not, one that follows a control, one that a property drives; two actions."""
    fresh_scene.frame_start, fresh_scene.frame_end = 1, 8
    rig = make_armature()
    bpy.ops.object.mode_set(mode="EDIT")
    edit = rig.data.edit_bones
    for name, child, parent in (("master", "bone0", None), ("between", "bone2", "bone1"), ("control", None, "master")):
        bone = edit.new(name)
        bone.head, bone.tail, bone.use_deform = (0.1, 0, 0.1), (0.1, 0.5, 0.4), False
        bone.parent = edit[parent] if parent else None
        if child:
            edit[child].parent = bone
    bpy.ops.object.mode_set(mode="OBJECT")
    rig["bend"] = 0.5
    constraint = rig.pose.bones["side"].constraints.new("COPY_ROTATION")
    constraint.target, constraint.subtarget = rig, "control"
    drive(rig, 'pose.bones["side"].constraints["Copy Rotation"].influence', kind="SINGLE_PROP", target=rig)
    variable = rig.animation_data.drivers[0].driver.variables[0]
    variable.targets[0].id, variable.targets[0].data_path = rig, '["bend"]'
    make_action(rig, "walk", (3, 12), seed=1)
    make_action(rig, "jump", (1, 6), seed=2, names=("bone1", "control"))
    fresh_scene.frame_set(4)
    return rig


def make_action(rig, name, ends, seed, names=None, scale=False):
    """An action that keys bones, and is then the one that the rig plays."""
    random = np.random.default_rng(seed)
    data = rig.animation_data or rig.animation_data_create()
    data.action = bpy.data.actions.new(name)
    data.action.use_fake_user = True
    for bone in rig.pose.bones:
        if names is not None and bone.name not in names:
            continue
        bone.rotation_mode = "QUATERNION"
        for frame in ends:
            bone.rotation_quaternion = Euler(random.uniform(-1.5, 1.5, 3)).to_quaternion()
            bone.location = random.uniform(-0.3, 0.3, 3)
            bone.scale = (random.uniform(0.5, 2),) * 3 if scale else (1, 1, 1)
            for path in ("rotation_quaternion", "location", "scale"):
                bone.keyframe_insert(path, frame=frame)
    return data.action


def bake(rig, **settings):
    """Bakes with the operator. Returns the skeleton."""
    select(rig)
    assert bpy.ops.object.sinew_bake_to_bones(source="EXACT", **settings) == {"FINISHED"}
    skeleton = bpy.context.active_object
    assert skeleton.type == "ARMATURE" and skeleton != rig
    return skeleton


def run(rig, **settings):
    """Bakes with the function. Returns the report."""
    exact, frame_range = module("exact"), addon_module("bake.frame_range")
    settings = {"frames": frame_range.FrameRange(1, 8), "actions": "*"} | settings
    meshes = addon_module("plan.bindable").meshes_of(bpy.context, rig)
    return exact.run(bpy.context, rig, meshes, exact.ExactSettings(**settings))


def play(ob, action):
    ob.animation_data.action = action
    if hasattr(action, "slots"):
        ob.animation_data.action_slot = action.slots[0]


def at_rest(rig):
    for bone in rig.pose.bones:
        bone.matrix_basis.identity()


def motions(ob, names, frames):
    """(F, J, 4, 4): what moves these bones from rest, in the armature's space."""
    found = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        bones = ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones
        found.append([bones[name].matrix @ ob.data.bones[name].matrix_local.inverted() for name in names])
    return np.array(found)


def off(rig, skeleton, frames, names=None):
    """The largest distance between the bones' heads, and points one unit from them, as a share of the size."""
    names = names or [bone.name for bone in skeleton.data.bones]
    found = motions(skeleton, names, frames) - motions(rig, names, frames)
    points = np.array([[*rig.data.bones[name].head_local, 1] for name in names])
    heads = np.einsum("fjab,jb->fja", found, points)[..., :3]
    return max(np.abs(heads).max() / SIZE, np.abs(found[..., :3, :3]).max() / SIZE)


def keys_of(action):
    """{(path, index): bytes of the keys}"""
    found = {}
    for curve in addon_module("blender.animation").action_curves(action):
        numbers = np.empty(2 * len(curve.keyframe_points), np.float32)
        curve.keyframe_points.foreach_get("co", numbers)
        found[curve.data_path, curve.array_index] = numbers.tobytes()
    return found


def tracks(skeleton):
    return {track.name: track.strips[0].action for track in skeleton.animation_data.nla_tracks}


def state(rig):
    data, scene = rig.animation_data, bpy.context.scene
    return {
        **data_counts(),
        "frame": scene.frame_current,
        "active": bpy.context.view_layer.objects.active.name,
        "selected": [ob.name for ob in bpy.context.selected_objects],
        "action": data.action.name,
        "slot": getattr(getattr(data, "action_slot", None), "identifier", None),
        "nla": (data.use_nla, data.action_blend_type, data.action_influence, data.action_extrapolation),
        "basis": [tuple(map(tuple, bone.matrix_basis)) for bone in rig.pose.bones],
        "bend": rig["bend"],
    }


# --- exact ----------------------------------------------------------------------------------------


def test_each_action_is_played_exactly(rig):
    skeleton = bake(rig)
    assert [bone.name for bone in skeleton.data.bones] == ["bone0", "bone1", "side", "bone2", "bone3", "bone4"]
    assert skeleton.data.bones["bone2"].parent.name == "bone1", "between does not deform"
    assert skeleton.data.bones["bone0"].parent is None
    for bone in skeleton.data.bones:
        assert np.allclose(bone.matrix_local, rig.data.bones[bone.name].matrix_local, atol=1e-6)
    assert sorted(tracks(skeleton)) == ["jump", "walk"]
    assert all(track.mute for track in skeleton.animation_data.nla_tracks), "they would cost time on each frame"
    for name, action in tracks(skeleton).items():
        source = bpy.data.actions[name]
        assert tuple(action.frame_range) == tuple(source.frame_range)
        play(rig, source)
        play(skeleton, action)
        if name == "jump":
            at_rest(rig)  # what it does not key
        first, last = map(int, source.frame_range)
        assert off(rig, skeleton, range(first, last + 1)) < EXACT


def test_what_an_action_does_not_key_does_not_depend_on_the_others(rig):
    before = keys_of(tracks(bake(rig))["jump"])
    play(rig, bpy.data.actions["walk"])
    bpy.context.scene.frame_set(7)
    assert keys_of(tracks(bake(rig))["jump"]) == before
    assert keys_of(tracks(bake(rig, actions="ju*"))["jump"]) == before


def test_the_scene_with_its_strips(rig):
    data = rig.animation_data
    data.action = None
    at_rest(rig)
    for name, blend in (("walk", "REPLACE"), ("jump", "COMBINE")):
        track = data.nla_tracks.new()
        strip = track.strips.new(name, 1, bpy.data.actions[name])
        strip.blend_type = blend
    skeleton = bake(rig, all_actions=False, frame_start=2, frame_end=9)
    assert tracks(skeleton) == {} and tuple(skeleton.animation_data.action.frame_range) == (2, 9)
    assert off(rig, skeleton, range(2, 10)) < EXACT


def test_scales_are_keyed_where_something_scales(rig):
    make_action(rig, "grow", (1, 5), seed=3, names=("bone3",), scale=True)
    skeleton = bake(rig)
    scaled = {path for path, _ in keys_of(tracks(skeleton)["walk"]) if path.endswith("scale")}
    assert scaled == {'pose.bones["bone3"].scale', 'pose.bones["bone4"].scale'} - {'pose.bones["bone4"].scale'}


def test_a_bone_that_shears_is_named_with_how_much(rig):
    play(rig, bpy.data.actions["walk"])
    for bone in rig.data.bones:
        bone.inherit_scale = "NONE"
    rig.pose.bones["bone1"].scale = (1, 2.5, 1)
    for frame in (3, 12):
        rig.pose.bones["bone1"].keyframe_insert("scale", frame=frame)
    report = run(rig, actions="walk")
    assert {"bone2", "side"} <= set(report.sheared) and "bone1" not in report.sheared
    skeleton = bpy.data.objects[report.armature]
    assert off(rig, skeleton, range(3, 13), ["bone0", "bone1"]) < EXACT
    names = list(report.sheared)
    found = motions(skeleton, names, range(3, 13)) - motions(rig, names, range(3, 13))
    worst = 0.0
    for j, name in enumerate(names):
        bone = rig.data.bones[name]
        corners = (
            np.array(bone.matrix_local) @ np.array([[0, 0, 0, 1], *(np.eye(4)[:3] * bone.length + [0, 0, 0, 1])]).T
        )
        worst = max(worst, np.linalg.norm((found[:, j] @ corners)[:, :3], axis=1).max())
    assert report.largest == pytest.approx(worst, rel=1e-3) and worst > 0.1
    assert (
        f"cannot be keyed exactly, off by {addon_module('to_bones.report').length(worst)} at most" in report.sentence()
    )
    flat = run(rig, actions="walk", is_flat=True)
    assert flat.sheared == {}, "each bone scales along its own axes"


@needs_rig_programs
def test_what_is_computed_and_what_blender_evaluates_has_the_same_keys(rig, monkeypatch):
    native = run(rig)
    assert native.evaluated == "" and "exact" in native.sentence()
    computed = {name: keys_of(action) for name, action in tracks(bpy.data.objects[native.armature]).items()}

    def refuse(_self):
        raise ValueError("it is slow")

    monkeypatch.setattr(module("rig_poses").Poses, "_read", refuse)
    slow = run(rig)
    assert "Blender evaluated the rig, which is slower: it is slow" in slow.sentence()
    assert {n: keys_of(a) for n, a in tracks(bpy.data.objects[slow.armature]).items()} == computed


@needs_rig_programs
@pytest.mark.parametrize("name", ("jump", "walk"))
def test_an_action_that_cannot_be_computed_slows_no_other(rig, monkeypatch, name):
    curve = addon_module("blender.animation").action_curves(bpy.data.actions[name])[0]
    curve.modifiers.new("NOISE")
    bpy.data.actions[name].update_tag()
    poses, evaluated_texts = module("rig_poses").Poses, []
    evaluate = poses._evaluated

    def evaluated_of(self, frames, text):
        evaluated_texts.append(text)
        return evaluate(self, frames, text)

    monkeypatch.setattr(poses, "_evaluated", evaluated_of)
    report = run(rig)
    assert evaluated_texts == [f"computing {name}"] and "Noise" in report.evaluated
    skeleton = bpy.data.objects[report.armature]
    for each, action in tracks(skeleton).items():
        play(rig, bpy.data.actions[each])
        at_rest(rig)
        play(skeleton, action)
        assert off(rig, skeleton, wanted_frames(each)) < EXACT


def test_the_progress_goes_on_to_the_end(rig):
    exact, frame_range = module("exact"), addon_module("bake.frame_range")
    settings = exact.ExactSettings(frames=frame_range.FrameRange(1, 8), actions="*")
    shares = [share for share, _text in exact.steps(bpy.context, rig, [], settings)]
    assert shares == sorted(shares) and shares[0] == 0 and 0.8 < shares[-1] < 1
    assert max(after - before for before, after in zip(shares, shares[1:])) < 0.6


def test_a_rig_that_cannot_be_computed_is_evaluated(rig):
    rig.pose.bones["bone3"].constraints.new("SHRINKWRAP").target = bpy.data.objects.new(
        "Wall", bpy.data.meshes.new("W")
    )
    report = run(rig)
    assert report.evaluated != ""
    skeleton = bpy.data.objects[report.armature]
    play(rig, bpy.data.actions["walk"])
    play(skeleton, tracks(skeleton)["walk"])
    assert off(rig, skeleton, range(3, 13)) < EXACT


def test_quaternions_do_not_flip(rig):
    bone = rig.pose.bones["bone0"]
    bone.rotation_mode = "XYZ"
    action = make_action(rig, "spin", (1, 2), seed=3, names=())
    for frame, angle in ((1, 0.0), (41, 4 * math.pi)):
        bone.rotation_euler = (0, 0, angle)
        bone.keyframe_insert("rotation_euler", frame=frame)
    skeleton = bake(rig, actions="spin")
    found = keys_of(tracks(skeleton)["spin"])
    path = 'pose.bones["bone0"].rotation_quaternion'
    values = np.array([np.frombuffer(found[path, i], np.float32)[1::2] for i in range(4)]).T
    assert len(values) == 41 and np.einsum("fi,fi->f", values[1:], values[:-1]).min() > 0.9
    play(rig, action)
    play(skeleton, tracks(skeleton)["spin"])
    at_rest(rig)
    assert off(rig, skeleton, range(1, 42)) < EXACT


def test_where_the_rig_is_and_what_it_hangs_on_is_copied(rig):
    parent = bpy.data.objects.new("Cart", None)
    bpy.context.collection.objects.link(parent)
    parent.location, parent.scale, parent.rotation_euler = (1, 2, 3), (1, 2, 1), (0.3, 0.2, 0.1)
    rig.parent = parent
    rig.location, rig.rotation_euler, rig.scale = (0.5, 0, 1), (0.1, 0.5, 0.2), (2, 2, 2)
    skeleton = bake(rig)
    bpy.context.view_layer.update()
    assert np.allclose(skeleton.matrix_world, rig.matrix_world, atol=1e-6)
    play(skeleton, tracks(skeleton)["jump"])
    at_rest(rig)
    names = [bone.name for bone in skeleton.data.bones if bone.name != "side"]  # which shears in the world
    assert off(rig, skeleton, range(1, 7), names) < EXACT


@pytest.mark.skipif(bpy.app.version < (4, 4, 0), reason="actions have no slots")
def test_of_an_action_of_several_objects_the_rigs_slot_is_baked(rig):
    action = bpy.data.actions["walk"]
    before = keys_of(tracks(bake(rig, actions="walk"))["walk"])
    other = make_armature()
    other.name = "Other"
    slot = action.slots.new("OBJECT", other.name)
    data = other.animation_data_create()
    data.action, data.action_slot = action, slot
    other.pose.bones["bone0"].location = (5, 6, 7)
    for frame in (3, 30):
        other.pose.bones["bone0"].keyframe_insert("location", frame=frame)
    play(rig, bpy.data.actions["jump"])
    skeleton = bake(rig, actions="walk")
    made = tracks(skeleton)["walk"]
    assert keys_of(made).keys() == before.keys() and len(made.slots) == 1
    strip = skeleton.animation_data.nla_tracks["walk"].strips[0]
    assert strip.action_slot == made.slots[0] and made.slots[0].target_id_type == "OBJECT"
    assert data.action == action and data.action_slot == slot
    rig.animation_data.action, rig.animation_data.action_slot = action, action.slots[0]
    play(skeleton, made)
    assert off(rig, skeleton, range(3, 13)) < EXACT


# --- options --------------------------------------------------------------------------------------


def test_a_step_keeps_the_last_frame(rig):
    skeleton = bake(rig, frame_step=4)
    curve = addon_module("blender.animation").action_curves(tracks(skeleton)["walk"])[0]
    assert [point.co.x for point in curve.keyframe_points] == [3, 7, 11, 12]


def test_the_range_and_whether_it_is_cyclic_are_kept(rig):
    source = bpy.data.actions["walk"]
    source.use_frame_range, source.frame_start, source.frame_end, source.use_cyclic = True, 4, 10, True
    made = tracks(bake(rig))["walk"]
    assert (made.use_frame_range, made.frame_start, made.frame_end, made.use_cyclic) == (True, 4, 10, True)
    assert len(addon_module("blender.animation").action_curves(made)[0].keyframe_points) == 7


def test_a_root_that_is_chosen_is_above_all(rig):
    skeleton = bake(rig, root="control")
    assert skeleton.data.bones["bone0"].parent.name == "control"
    play(rig, bpy.data.actions["walk"])
    play(skeleton, tracks(skeleton)["walk"])
    assert off(rig, skeleton, range(3, 13)) < EXACT


@pytest.mark.parametrize("motion", ("ROOT", "IN_PLACE"))
def test_motion_along_the_ground_goes_to_the_root_or_away(rig, motion):
    skeleton = bake(rig, root_motion=motion)
    assert [bone.name for bone in skeleton.data.bones if bone.parent is None] == ["root"]
    play(rig, bpy.data.actions["walk"])
    play(skeleton, tracks(skeleton)["walk"])
    frames, names = range(3, 13), ["bone0", "bone4"]
    wanted, found = motions(rig, names, frames), motions(skeleton, names, frames)
    moved = motions(skeleton, ["root"], frames)[:, 0]
    head = np.array([*rig.data.bones["bone0"].head_local, 1])
    along = (wanted[:, 0] @ head - head)[:, :2]
    assert np.ptp(along, axis=0).min() > 0.04 and np.abs(moved[:, 2, 3]).max() < 1e-6
    if motion == "ROOT":
        assert np.abs(moved[:, :2, 3] - along).max() < 1e-5
        assert np.abs(found - wanted).max() < 1e-5, "the pose stays"
    else:
        assert np.abs(moved - np.eye(4)).max() < 1e-6
        wanted[..., :2, 3] -= along[:, None]
        assert np.abs(found - wanted).max() < 1e-5


@pytest.mark.parametrize("error", (0.1, 0.01))
def test_keys_are_left_out_within_an_error(rig, error):
    make_action(rig, "long", (1, 23, 30, 61), seed=5, scale=True)
    play(rig, bpy.data.actions["long"])
    whole, report = bake(rig, actions="long"), run(rig, actions="long", key_error=error)
    few = bpy.data.objects[report.armature]
    every, left = (
        sum(len(numbers) for (_, index), numbers in keys_of(tracks(each)["long"]).items() if index == 0)
        for each in (whole, few)
    )
    assert report.kept == pytest.approx(left / every) and report.kept < 0.9
    assert tuple(tracks(few)["long"].frame_range) == (1, 61)
    for each in (whole, few):
        play(each, tracks(each)["long"])
    places = [corners(each, range(1, 62)) for each in (whole, few)]
    worst = np.linalg.norm(places[1] - places[0], axis=-1).max()
    assert 0.2 * error < worst <= error + 1e-5
    assert report.largest == pytest.approx(worst, abs=1e-4) and report.sheared == {}
    assert f"{report.kept:.0%} of the keyframes, off by" in report.sentence()
    before = keys_of(tracks(few)["long"])
    run(rig, actions="long", key_error=error, target=few.name)
    assert keys_of(tracks(few)["long"]) == before


def positions_in_actions(rig):
    found = {}
    for name in ("jump", "walk"):
        play(rig, bpy.data.actions[name])
        at_rest(rig)
        found[name] = positions(rig, wanted_frames(name))
    return found


def corners(ob, frames):
    """(F, J, 4, 3): the heads of bones, and points one length along their axes, in the armature's space."""
    lengths = np.array([bone.length for bone in ob.data.bones])
    found = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        bones = ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones
        found.append([bone.matrix.copy() for bone in bones])
    matrices = np.array(found)
    points = np.concatenate((np.zeros((1, 3)), np.eye(3)))[None] * lengths[:, None, None]
    return np.einsum("fjab,jpb->fjpa", matrices[..., :3, :3], points) + matrices[..., None, :3, 3]


def test_where_only_roots_move_the_others_rotate(rig):
    report = run(rig, roots_alone_move=True)
    skeleton = bpy.data.objects[report.armature]
    paths = {path for path, _ in keys_of(tracks(skeleton)["walk"]) if path.endswith("location")}
    assert paths == {'pose.bones["bone0"].location'}
    assert report.largest > 0.1, "the rig's bones do move, and the report says so"


def test_b_bones_become_a_bone_for_each_end_of_a_segment(rig):
    for bone in rig.data.bones:
        bone.bbone_segments = 4 if bone.name in ("bone1", "bone3") else 1
    body = make_mesh(rig, False)
    names = ("bone1", "bone1_1", "bone1_2", "bone1_3", "bone1_4")
    skeleton = bake(rig, has_segments=True)
    assert set(names) <= set(skeleton.data.bones.keys()) and len(skeleton.data.bones) == 6 + 8
    copy = bpy.data.objects["Tube_baked"]
    play(rig, bpy.data.actions["walk"])
    play(skeleton, tracks(skeleton)["walk"])
    for frame in (3, 8, 12):
        bpy.context.scene.frame_set(frame)
        shape = evaluated(body)
        assert np.abs(evaluated(copy) - shape).max() < 2e-5 * diagonal(shape)


def test_meshes_are_copied_onto_the_skeleton(rig):
    body = make_mesh(rig, False)
    body.parent = rig
    skeleton = bake(rig)
    copy = bpy.data.objects["Tube_baked"]
    assert copy.parent == skeleton and copy.modifiers[0].object == skeleton and body.modifiers[0].object == rig
    play(rig, bpy.data.actions["walk"])
    play(skeleton, tracks(skeleton)["walk"])
    bpy.context.scene.frame_set(8)
    assert np.abs(evaluated(copy) - evaluated(body)).max() < 1e-5 * diagonal(evaluated(body))
    assert bpy.data.objects.get("Tube_baked.001") is None
    bake(rig, copies_meshes=False)
    assert bpy.data.objects.get("Tube_baked.001") is None


# --- a skeleton that is there ---------------------------------------------------------------------


def test_baked_again_it_has_the_same_bytes_and_no_more_data(rig):
    skeleton = bake(rig)
    counts, before = data_counts(), {name: keys_of(action) for name, action in tracks(skeleton).items()}
    names = sorted(action.name for action in bpy.data.actions)
    assert bake(rig, skeleton=skeleton.name) == skeleton
    assert data_counts() == counts and sorted(action.name for action in bpy.data.actions) == names
    assert {name: keys_of(action) for name, action in tracks(skeleton).items()} == before


def test_a_skeleton_with_other_axes_and_more_bones_is_moved_alike(rig):
    target = make_armature()
    target.name = "Engine"
    bpy.ops.object.mode_set(mode="EDIT")
    for bone in target.data.edit_bones:
        bone.roll += 1
    extra = target.data.edit_bones.new("extra")
    extra.head, extra.tail, extra.parent = (0, 0, 2), (0, 0, 2.5), target.data.edit_bones["bone1"]
    target.data.edit_bones["bone2"].parent = extra
    bpy.ops.object.mode_set(mode="OBJECT")
    assert bake(rig, skeleton="Engine") == target
    play(rig, bpy.data.actions["walk"])
    play(target, tracks(target)["walk"])
    names = [bone.name for bone in target.data.bones if bone.name != "extra"]
    assert off(rig, target, range(3, 13), names) < EXACT
    assert not any("extra" in path for path, _ in keys_of(tracks(target)["walk"]))


# --- nothing else changes -------------------------------------------------------------------------


def test_the_rig_stays_as_it_was(rig):
    bpy.context.scene.frame_set(5)
    rig.pose.bones["bone3"].location = (7, 8, 9)  # not keyed
    rig["bend"] = 0.25
    select(rig)
    before = state(rig)
    counts = data_counts()
    bake(rig)
    select(rig)
    after = state(rig)
    assert {name: after[name] for name in before if name not in counts} == {
        name: before[name] for name in before if name not in counts
    }


@pytest.mark.parametrize("at", range(4))
@pytest.mark.parametrize("is_update", (False, True))
def test_what_is_stopped_leaves_nothing(rig, at, is_update):
    """As Esc does: while the first or the second action is computed or written."""
    exact, frame_range = module("exact"), addon_module("bake.frame_range")
    target = bake(rig).name if is_update else ""
    select(rig)
    before = (
        state(rig),
        {name: keys_of(action) for name, action in tracks(bpy.data.objects[target]).items()} if target else 0,
    )
    settings = exact.ExactSettings(frame_range.FrameRange(1, 8), actions="*", target=target)
    steps = exact.steps(bpy.context, rig, [], settings)
    for number, _ in enumerate(steps):
        if number == at:
            break
    steps.close()
    tracks_now = {name: keys_of(action) for name, action in tracks(bpy.data.objects[target]).items()} if target else 0
    assert (state(rig), tracks_now) == before


def test_one_undo_step(rig):
    bpy.context.preferences.edit.use_global_undo = True
    select(rig)
    bpy.ops.ed.undo_push(message="before")
    before = state(rig)
    bpy.ops.object.sinew_bake_to_bones_steps("EXEC_DEFAULT", True, source="EXACT")
    assert "Rig_bones" in bpy.data.objects
    bpy.ops.ed.undo()
    assert state(bpy.data.objects["Rig"]) == before


# --- errors ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "settings, said",
    (
        ({"actions": "swim*"}, "no action named swim* moves bones of Rig; those that it plays: jump"),
        ({"root": "hips"}, "Rig has no bone hips, which was chosen as the root"),
        ({"skeleton": "Rig"}, "Rig is no other armature, so it cannot be updated"),
        ({"skeleton": "Nobody"}, "Nobody is no other armature, so it cannot be updated"),
    ),
)
def test_what_is_refused_changes_nothing(rig, settings, said):
    select(rig)
    before = state(rig)
    with pytest.raises(RuntimeError) as error:
        bpy.ops.object.sinew_bake_to_bones(source="EXACT", **settings)
    assert said in str(error.value) and state(rig) == before


def test_a_rig_without_deforming_bones(rig):
    for bone in rig.data.bones:
        bone.use_deform = False
    select(rig)
    with pytest.raises(RuntimeError, match="Rig has no deforming bone"):
        bpy.ops.object.sinew_bake_to_bones(source="EXACT")


def test_a_hidden_rig(rig, monkeypatch):
    rig.hide_viewport = True
    exact, frame_range = module("exact"), addon_module("bake.frame_range")
    counts = data_counts()
    with pytest.raises(ValueError, match="Rig is hidden in the viewport"):
        exact.run(bpy.context, rig, [], exact.ExactSettings(frame_range.FrameRange(1, 8), actions="*"))
    assert data_counts() == counts


# --- names, the command and glTF ------------------------------------------------------------------


def test_names_of_an_engine(rig, tmp_path):
    body = make_mesh(rig, False)
    names = tmp_path / "names.txt"
    names.write_text("# ours = theirs\nbone0 = pelvis\n\nbone1 = spine 01  # the first\n")
    skeleton = bake(rig, names=str(names))
    assert [bone.name for bone in skeleton.data.bones][:2] == ["pelvis", "spine 01"]
    assert {"pelvis", "spine 01", "bone4"} <= set(bpy.data.objects["Tube_baked"].vertex_groups.keys())
    assert "bone0" in body.vertex_groups
    play(rig, bpy.data.actions["walk"])
    play(skeleton, tracks(skeleton)["walk"])
    bpy.context.scene.frame_set(8)
    assert np.abs(evaluated(bpy.data.objects["Tube_baked"]) - evaluated(body)).max() < 1e-5 * SIZE


NAMES = Path(__file__).resolve().parents[2] / "docs" / "bone-names"
# Without which Unity makes no avatar.
REQUIRED = {"Hips", "Spine", "Head"} | {
    f"{side}{name}"
    for side in ("Left", "Right")
    for name in ("UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot")
}


def test_names_for_rigifys_human(fresh_scene):
    human = rigify_characters.character(rigify_characters.HUMAN)
    bpy.ops.object.mode_set(mode="OBJECT")
    parents = {}
    for engine in ("unreal", "unity"):
        path = NAMES / f"rigify-to-{engine}.txt"
        names = addon_module("to_bones.bone_names").read_names(str(path))
        assert names.keys() <= {bone.name for bone in human.data.bones if bone.use_deform}
        skeleton = bake(human, names=str(path), all_actions=False, frame_start=1, frame_end=1, root="root")
        parents[engine] = {bone.name: bone.parent and bone.parent.name for bone in skeleton.data.bones}
        assert set(names.values()) <= parents[engine].keys()
    assert parents["unity"].keys() >= REQUIRED
    unity = [parents["unity"][each] for each in ("Hips", "Chest", "LeftHand", "RightIndexDistal")]
    assert unity == ["root", "Spine", "DEF-forearm.L.001", "RightIndexIntermediate"]
    unreal = [parents["unreal"][each] for each in ("pelvis", "spine_01", "calf_l", "ball_r", "index_02_l")]
    assert unreal == ["root", "pelvis", "thigh_twist_01_l", "foot_r", "index_01_l"]


@pytest.mark.parametrize(
    "text, said",
    (
        ("bone0 pelvis", "line 1 of .* is not NAME = NEW NAME: bone0 pelvis"),
        ("bone0 = a\nbone1 = a", "line 2 of .* has a name that a line before has: bone1 = a"),
        ("bone0 = bone1", "two bones would have the name bone1"),
        (None, "cannot be read as names of bones"),
    ),
)
def test_names_that_are_wrong(rig, tmp_path, text, said):
    names = tmp_path / "names.txt"
    if text is not None:
        names.write_text(text)
    select(rig)
    with pytest.raises(RuntimeError, match=said):
        bpy.ops.object.sinew_bake_to_bones(source="EXACT", names=str(names))
    assert "Rig_bones" not in bpy.data.objects


@pytest.fixture
def blend(rig, tmp_path):
    make_mesh(rig, False)
    path = tmp_path / "shot.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def test_the_command(sinew, blend):
    words = ("bake-to-bones", blend, "--exact", "--all-actions", "--json", "--save")
    code, out, err = sinew(*words)
    assert code == 0, err
    document = json.loads(out.splitlines()[-1])
    assert document["saved"] and document["bones"] == 6 and document["objects"] == ["Tube_baked"]
    assert [(each["name"], each["first"], each["last"]) for each in document["actions"]] == [
        ("jump", 1, 6),
        ("walk", 3, 12),
    ]
    assert document["sheared"] == {} and document["largest"] < EXACT * SIZE
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    assert sorted(tracks(bpy.data.objects["Rig_bones"])) == ["jump", "walk"]
    code, out, err = sinew(*words, "--armature", "Rig", "--skeleton", "Rig_bones", "--actions", "w*")
    assert code == 0, err
    assert [each["name"] for each in json.loads(out.splitlines()[-1])["actions"]] == ["walk"]


def test_the_command_bakes_the_scene_without_actions(sinew, blend):
    code, out, err = sinew("bake-to-bones", blend, "--exact", "--frames", "2-8:2", "--no-meshes", "--root", "master")
    assert code == 0, err
    assert bpy.data.objects["Rig_bones"].data.bones["bone0"].parent.name == "master"
    assert "Rig: 7 bones, 1 action, 4 frames; exact" in out and "Tube_baked" not in bpy.data.objects


def test_the_command_leaves_out_keys(sinew, blend):
    words = ("bake-to-bones", blend, "--exact", "--all-actions", "--json", "--key-error", "0.02")
    code, out, err = sinew(*words)
    document = json.loads(out.splitlines()[-1])
    assert code == 0 and document["kept"] < 0.9 and 1e-3 < document["largest"] <= 0.02 + 1e-5, err


def test_the_command_has_root_motion(sinew, blend):
    code, _out, err = sinew("bake-to-bones", blend, "--exact", "--all-actions", "--root-motion", "in-place", "--flat")
    assert code == 0, err
    skeleton = bpy.data.objects["Rig_bones"]
    assert {bone.parent and bone.parent.name for bone in skeleton.data.bones} == {None, "root"}
    play(skeleton, tracks(skeleton)["walk"])
    assert np.abs(motions(skeleton, ["root"], range(3, 13)) - np.eye(4)).max() < 1e-6


@pytest.mark.parametrize(
    "words, code, said",
    (
        (["--all-actions"], 1, "these options are for bakes with --exact"),
        (["--exact", "--bones", "3"], 2, "argument --bones: not allowed with argument --exact"),
        (["--exact", "--actions", "swim"], 1, "no action named swim moves bones of Rig"),
        (["--exact", "--objects", "Nobody"], 1, "there is no object Nobody"),
        (["--exact", "--armature", "Nobody"], 1, "there is no armature Nobody"),
        (["--exact", "--only-roots-move", "--all-actions", "--max-error", "1e-3"], 1, "that is more than 0.001"),
        (["--exact", "--key-error", "0"], 2, "0 is not a number above 0"),
        (["--exact", "--gltf", "x.obj"], 1, "does not end in .glb or .gltf"),
        (["--exact", "--names", "nowhere.txt"], 2, "cannot be read as names of bones"),
    ),
)
def test_what_the_command_cannot_do(sinew, blend, words, code, said):
    found, _out, err = sinew("bake-to-bones", blend, *words)
    assert (found, said in err) == (code, True), err


def test_gltf_has_each_action_under_its_name_with_the_poses_of_the_rig(sinew, blend, tmp_path):
    enable_exporters()
    skip_without("export_scene.gltf", "import_scene.gltf")
    path = tmp_path / "game.glb"
    code, _out, err = sinew("bake-to-bones", blend, "--exact", "--all-actions", "--gltf", path)
    assert code == 0, err
    with open(path, "rb") as file:
        document = json.loads(file.read()[20 : 20 + int.from_bytes(path.read_bytes()[12:16], "little")])
    assert sorted(each["name"] for each in document["animations"]) == ["jump", "walk"]
    for each in document["animations"]:
        assert {document["accessors"][sampler["input"]]["count"] for sampler in each["samplers"]} == {
            len(wanted_frames(each["name"]))
        }, "as many keyframes as frames"
    wanted = positions_in_actions(bpy.data.objects["Rig"])
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(path))
    skeleton = next(ob for ob in bpy.data.objects if ob.type == "ARMATURE")
    for name, places in wanted.items():
        action = next(each for each in bpy.data.actions if each.name.startswith(name))
        play(skeleton, action)
        found = positions(skeleton, wanted_frames(name), list(wanted_names(skeleton)))
        assert np.abs(found - places).max() < 1e-5 * SIZE, name


def test_gltf_read_by_assimp_has_the_shape_of_the_rig_in_each_action(rig, tmp_path):
    """The meshes by the file's own joints, weights and clips."""
    enable_exporters()
    skip_without("export_scene.gltf")
    body, path = make_mesh(rig, False), tmp_path / "game.glb"
    bake(rig, gltf=str(path))
    assert sorted(SkinnedFile(path, "walk").clips) == ["jump", "walk"]
    for name in ("jump", "walk"):
        file, frames = SkinnedFile(path, name), wanted_frames(name)
        rate = bpy.context.scene.render.fps
        assert file.seconds[1] - file.seconds[0] == pytest.approx((len(frames) - 1) / rate, rel=1e-4)
        places = file.rest @ Y_UP_TO_Z_UP.T
        own = addon_module("blender.meshes").read_positions(body.data)
        nearest = np.array([np.linalg.norm(own - place, axis=1).argmin() for place in places])
        play(rig, bpy.data.actions[name])
        at_rest(rig)
        for number, frame in enumerate(frames):
            bpy.context.scene.frame_set(frame)
            shown = evaluated(body)[nearest]
            off_by = np.abs(file.posed(file.seconds[0] + number / rate) - shown).max()
            assert off_by < SHAPE * diagonal(shown), (name, frame)


def test_fbx_has_each_action_with_the_poses_of_the_rig(rig, tmp_path):
    enable_exporters()
    skip_without("export_scene.fbx", "import_scene.fbx")
    path = tmp_path / "game.fbx"
    skeleton = bake(rig)
    select(skeleton)
    bpy.ops.export_scene.fbx(filepath=str(path), **FBX)
    wanted = positions_in_actions(rig)
    bpy.ops.wm.read_homefile(use_empty=True)
    enable_exporters()
    bpy.ops.import_scene.fbx(filepath=str(path), anim_offset=0.0)
    skeleton = next(ob for ob in bpy.data.objects if ob.type == "ARMATURE")
    for name, places in wanted.items():
        action = next(each for each in bpy.data.actions if each.name.endswith(f"{name}_bones"))
        frames = wanted_frames(name)
        assert action.frame_range[1] - action.frame_range[0] == pytest.approx(len(frames) - 1, abs=1e-3)
        play(skeleton, action)
        first = round(action.frame_range[0])
        found = positions(skeleton, range(first, first + len(frames)))
        assert np.abs(found - places).max() < 1e-5 * SIZE, name


def wanted_frames(name):
    return {"jump": range(1, 7), "walk": range(3, 13)}[name]


def wanted_names(ob):
    return [name for name in ("bone0", "bone1", "bone2", "bone3", "bone4", "side") if name in ob.data.bones]


def positions(ob, frames, names=None):
    """(F, J, 3): the bones' heads in world space."""
    found = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        posed = ob.evaluated_get(bpy.context.evaluated_depsgraph_get())
        found.append([posed.matrix_world @ posed.pose.bones[name].head for name in names or wanted_names(ob)])
    return np.array(found)
