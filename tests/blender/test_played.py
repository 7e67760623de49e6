"""Played characters look like live ones on each frame, to the bit, and Blender does not evaluate their bones. Whatever
is edited, nobody sees an old shape."""

import dataclasses
import functools
import re
import subprocess
import tempfile
from pathlib import Path

import bpy
import numpy as np
import pytest

from characters import accelerate, make_armature, make_mesh, pose, with_bendy_bones
from helpers import (
    COMMAND,
    addon_module,
    depsgraph,
    evaluated,
    is_deforming,
    needs_memory,
    needs_program,
    select,
    twin_of,
)

pytestmark = needs_memory

FRAMES = range(1, 11)


def states():
    return addon_module("played.states")


def recorded():
    return addon_module("played.rigs")


def layer():
    return bpy.context.view_layer


class Cast:
    """Two characters: a bound mesh, a mesh that Blender deforms, and a prop in the hand. Only the first is played; the
    second has the same pose, and is live."""

    def __init__(self, scene):
        self.scene = scene
        self.played, self.live = self.make(), self.make()
        scene.frame_set(1)
        select()

    def make(self):
        armature = make_armature()
        ob = make_mesh(armature, False)
        other = twin_of(ob)
        with_bendy_bones(ob)
        for frame in (1, 4, 7, 10):
            pose(armature, frame, True)
        accelerate(ob)
        prop = bpy.data.objects.new("Prop", bpy.data.meshes.new("Prop"))
        self.scene.collection.objects.link(prop)
        prop.parent, prop.parent_type, prop.parent_bone = armature, "BONE", "bone3"
        return armature, ob, other, prop

    @property
    def rig(self):
        return recorded().learn(self.played[0])

    def play(self, frames=FRAMES):
        """Compares both on these frames. Returns the shapes of the first."""
        found = []
        for frame in frames:
            self.scene.frame_set(frame)
            self.assert_same()
            found.append(evaluated(self.played[1]).copy())
        return np.array(found)

    def follow_keyed_object(self, bone):
        """Both characters do, with a bone."""
        target = bpy.data.objects.new("Marker", None)
        self.scene.collection.objects.link(target)
        for frame in (1, 10):
            target.location.x = frame
            target.keyframe_insert("location", frame=frame)
        for armature in (self.played[0], self.live[0]):
            armature.pose.bones[bone].constraints.new("COPY_LOCATION").target = target

    def record(self):
        self.rig  # noqa: B018  # known from now on
        self.play()
        assert self.rig.motion.record.runs() == [(1, 10)]

    def take_over(self):
        if not len(self.rig.motion.record):
            self.record()
        states().take_over([self.rig], self.scene, layer())
        assert self.rig.reason == ""
        assert self.rig.is_played

    def hand_back(self):
        states().hand_back([self.rig], self.scene, layer())
        assert not self.rig.is_played

    def undo(self):
        names = [[ob.name for ob in each] for each in (self.played, self.live)]
        bpy.ops.ed.undo()
        self.played, self.live = ([bpy.data.objects[name] for name in each] for each in names)
        self.scene = bpy.context.scene
        layer().update()

    def assert_same(self):
        assert np.array_equal(evaluated(self.played[1]), evaluated(self.live[1]))
        assert np.array_equal(evaluated(self.played[2]), evaluated(self.live[2]))
        ours, theirs = (each[3].evaluated_get(depsgraph()).matrix_world for each in (self.played, self.live))
        assert ours == theirs
        ours, theirs = (matrices_of(each[0]) for each in (self.played, self.live))
        assert np.array_equal(ours, theirs)


def matrices_of(armature):
    bones = armature.evaluated_get(depsgraph()).pose.bones
    return np.array([[*bone.matrix, *bone.matrix_channel, *bone.matrix] for bone in bones])


@functools.cache
def saved_cast():
    """Returns the path of a file with a cast, and the names of each character's objects."""
    cast = Cast(bpy.context.scene)
    path = str(Path(tempfile.mkdtemp()) / "cast.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    return path, [[ob.name for ob in each] for each in (cast.played, cast.live)]


def opened_cast(last=None):
    """Returns a cast in a new file, in a third of the time that it takes to make one. last: of the scene's frames."""
    path, names = saved_cast()
    bpy.ops.wm.read_homefile(filepath=path)
    cast = Cast.__new__(Cast)
    cast.scene = bpy.context.scene
    cast.played, cast.live = ([bpy.data.objects[name] for name in each] for each in names)
    if last is not None:
        cast.scene.frame_end = last
    cast.scene.frame_set(1)
    return cast


@pytest.fixture
def cast():
    return opened_cast()


def test_a_played_character_plays_as_a_live_one(cast):
    cast.take_over()
    shapes = cast.play([*FRAMES, 3, 9, 1])
    assert cast.rig.is_played
    assert np.ptp(shapes, axis=0).max() > 0.1


def test_a_bound_mesh_that_is_left_to_blender_plays_too(fresh_scene, monkeypatch):
    """Blender does not call its hook any more."""
    monkeypatch.setattr(addon_module("plan.ways"), "FEWEST_VERTICES", {"ATTRIBUTE": 10_000, "KEYS": 10_000})
    cast = Cast(fresh_scene)
    cast.take_over()
    shapes = cast.play()
    assert cast.rig.is_played and not is_deforming(cast.played[1]) and len(np.unique(shapes[:, 0], axis=0)) > 5
    cast.hand_back()
    assert np.array_equal(cast.play(), shapes)


@pytest.mark.usefixtures("no_program")
def test_its_bones_are_not_evaluated(cast):
    """What the record holds is what everybody sees."""
    cast.take_over()
    cast.rig.motion.record.put(7, cast.rig.motion.record.at(2))
    cast.scene.frame_set(2)
    wanted = evaluated(cast.played[1]).copy()
    cast.scene.frame_set(7)
    assert np.array_equal(evaluated(cast.played[1]), wanted)
    assert not np.array_equal(evaluated(cast.live[1]), wanted)


def test_taking_over_changes_no_shape_and_handing_back_neither(cast):
    cast.record()
    cast.scene.frame_set(6)
    cast.assert_same()
    cast.take_over()
    cast.assert_same()
    cast.hand_back()
    cast.assert_same()
    cast.play()


def test_handing_back_on_another_frame_restores_the_channels(cast):
    cast.take_over()
    cast.scene.frame_set(8)
    cast.hand_back()
    cast.assert_same()
    for ours, theirs in zip(cast.played[0].pose.bones, cast.live[0].pose.bones):
        assert ours.location == theirs.location
        assert ours.rotation_quaternion == theirs.rotation_quaternion


@pytest.mark.usefixtures("no_program")
def test_frames_that_are_not_recorded_are_live(cast):
    cast.take_over()
    cast.scene.frame_set(12)
    assert not cast.rig.is_played
    assert "frame 12 of" in cast.rig.reason
    cast.assert_same()


@pytest.mark.usefixtures("no_program")
def test_between_two_frames_one_that_is_recorded_is_live(cast):
    cast.take_over()
    cast.scene.frame_set(4, subframe=0.5)
    assert not cast.rig.is_played
    cast.assert_same()
    cast.play()
    cast.take_over()


def test_a_frame_that_is_set_without_a_frame_change_is_right(cast):
    cast.take_over()
    cast.scene.frame_current = 6
    layer().update()
    assert cast.rig.is_played
    cast.assert_same()


def test_adding_an_object_hands_back_it(cast):
    cast.take_over()
    cast.scene.frame_set(7)
    ob = bpy.data.objects.new("Other", None)
    cast.scene.collection.objects.link(ob)
    layer().update()
    cast.assert_same()
    assert not cast.rig.is_played
    cast.play()
    states().take_over_again(cast.scene, layer())
    assert cast.rig.is_played
    cast.play()


@pytest.mark.usefixtures("no_program")
def test_moving_a_key_drops_the_record(cast):
    cast.take_over()
    cast.scene.frame_set(5)
    for armature, *_ in (cast.played, cast.live):
        curves = addon_module("blender.animation").action_curves(armature.animation_data.action)
        curve = next(each for each in curves if "bone1" in each.data_path and "location" in each.data_path)
        curve.keyframe_points[3].co.y += 1
        curve.keyframe_points[3].handle_left.y += 1
        curve.keyframe_points[3].handle_right.y += 1
        curve.update()
    layer().update()
    assert len(cast.rig.motion.record) == 0 and not cast.rig.is_played
    cast.assert_same()
    cast.play()
    assert cast.rig.motion.record.runs() == [(1, 10)]


def edit_key(armature):
    curves = addon_module("blender.animation").action_curves(armature.animation_data.action)
    curves[0].keyframe_points[1].co.y += 0.5
    curves[0].update()


def edit_channel(armature):
    armature.pose.bones["bone2"].rotation_mode = "XYZ"


def edit_constraint(armature):
    armature.pose.bones["bone1"].constraints.new("LIMIT_SCALE").use_max_x = True


def edit_rest(armature):
    armature.data.pose_position = "REST"


def edit_place(armature):
    armature.location.y += 1


def edit_mute(armature):
    curve = addon_module("blender.animation").action_curves(armature.animation_data.action)[0]
    curve.mute = True


def edit_segments(armature):
    armature.data.bones["bone1"].bbone_segments += 2


def edit_action(armature):
    armature.animation_data.action = armature.animation_data.action.copy()
    edit_key(armature)


def edit_by_nla(armature):
    data = armature.animation_data
    action, slot = data.action, getattr(data, "action_slot", None)
    data.action = None
    strip = data.nla_tracks.new().strips.new("Strip", 3, action)
    if slot is not None:
        strip.action_slot = slot


def edit_driver(armature):
    curve = armature.pose.bones["bone0"].driver_add("bbone_curveinx")
    curve.driver.type, curve.driver.expression = "SCRIPTED", "0.3"


EDITS = [value for name, value in list(globals().items()) if name.startswith("edit_")]


@pytest.mark.parametrize("edit", EDITS)
@pytest.mark.parametrize("then", ["update", "frame"])
def test_an_edit_by_a_script_is_never_missed(cast, edit, then):
    cast.take_over()
    cast.scene.frame_set(5)
    for armature, *_ in (cast.played, cast.live):
        edit(armature)
    if then == "update":
        layer().update()
        cast.assert_same()
    cast.play([2, 5, 8])
    cast.play()
    states().take_over([cast.rig], cast.scene, layer())
    cast.play()


@pytest.mark.parametrize("edit", EDITS)
def test_an_edit_of_a_recorded_character_is_never_missed(cast, edit):
    """It is live and has a record, and is played after the edit."""
    cast.record()
    cast.scene.frame_set(5)
    for armature, *_ in (cast.played, cast.live):
        edit(armature)
    cast.scene.frame_set(4)
    states().take_over([cast.rig], cast.scene, layer())
    cast.play()


def edit_mesh(ob):
    ob.data.vertices[5].co.x += 1
    ob.data.update()


def edit_weights(ob):
    ob.vertex_groups["bone1"].add(range(200), 0.7, "REPLACE")


def edit_modifier(ob):
    ob.modifiers["Armature"].use_deform_preserve_volume = True


def edit_keys(ob):
    ob.shape_key_add(name="Basis")
    key = ob.shape_key_add(name="Wide")
    for point in key.data:
        point.co.x *= 1.5
    for frame, value in ((1, 0.0), (10, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)


@pytest.mark.parametrize("edit", [edit_mesh, edit_weights, edit_modifier, edit_keys])
def test_an_edit_of_a_mesh_shows_while_its_armature_is_played(cast, edit):
    cast.take_over()
    cast.scene.frame_set(5)
    for _, ob, *_ in (cast.played, cast.live):
        edit(ob)
    layer().update()
    cast.assert_same()
    cast.play()
    states().take_over([cast.rig], cast.scene, layer())
    cast.play()
    assert cast.rig.is_played


@pytest.mark.usefixtures("no_program")
def test_selecting_it_hands_back_it(cast):
    cast.take_over()
    cast.scene.frame_set(6)
    select(cast.played[1])
    layer().update()
    assert not cast.rig.is_played
    cast.assert_same()
    states().take_over_again(cast.scene, layer())
    assert not cast.rig.is_played
    select()
    layer().update()
    states().take_over_again(cast.scene, layer())
    assert cast.rig.is_played
    cast.play()


def test_an_unkeyed_pose_stays_live(cast):
    cast.record()
    for armature, *_ in (cast.played, cast.live):
        armature.pose.bones["bone1"].location.x += 2
    layer().update()
    states().take_over([cast.rig], cast.scene, layer())
    assert not cast.rig.is_played
    assert "not keyed" in cast.rig.reason
    cast.assert_same()


def test_a_handler_that_moves_bones_after_each_frame_is_noticed(cast):
    def move(scene, *_):
        for armature, *_ in (cast.played, cast.live):
            armature.pose.bones["side"].location.x = scene.frame_current

    for armature, *_ in (cast.played, cast.live):
        addon_module("blender.animation")
        curves = addon_module("blender.animation").action_curves(armature.animation_data.action)
        assert any("side" in curve.data_path for curve in curves)
    cast.rig  # noqa: B018
    bpy.app.handlers.frame_change_post.insert(0, move)
    try:
        cast.play()
        states().take_over([cast.rig], cast.scene, layer())
        cast.play()
    finally:
        bpy.app.handlers.frame_change_post.remove(move)


def test_a_second_view_layer_is_live(cast):
    other = cast.scene.view_layers.new("Other")
    cast.record()
    cast.take_over()
    for frame in (3, 8):
        cast.scene.frame_set(frame)
        cast.assert_same()
        graph = other.depsgraph
        assert np.array_equal(evaluated(cast.played[1], graph), evaluated(cast.live[1], graph))
        assert cast.played[0].evaluated_get(graph).animation_data.action is not None


def test_undo_finds_everything_live_and_right(cast):
    bpy.ops.ed.undo_push(message="before")
    cast.take_over()
    cast.scene.frame_set(8)
    cast.played[3].location.x = 1
    bpy.ops.ed.undo_push(message="moved")
    cast.undo()
    for rig in recorded().known():
        assert not rig.is_played
    cast.assert_same()
    cast.play()
    cast.take_over()
    cast.play()


def script_that_compares(path, names):
    return (
        "import bpy, numpy as np\n"
        f"bpy.ops.wm.open_mainfile(filepath={str(path)!r})\n"
        "def shape(name):\n"
        "    ob = bpy.data.objects[name].evaluated_get(bpy.context.evaluated_depsgraph_get())\n"
        "    co = np.empty(3 * len(ob.data.vertices), np.float32)\n"
        "    ob.data.vertices.foreach_get('co', co)\n"
        "    return co\n"
        f"for frame in (None, 2, 5, 9):\n"
        "    if frame:\n"
        "        bpy.context.scene.frame_set(frame)\n"
        f"    for ours, theirs in {names!r}:\n"
        "        assert np.array_equal(shape(ours), shape(theirs)), (frame, ours)\n"
    )


def test_a_file_saved_while_played_is_as_live(cast, tmp_path):
    cast.take_over()
    cast.scene.frame_set(8)
    path = tmp_path / "played.blend"
    assert cast.rig.is_played
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    script = tmp_path / "compare.py"
    script.write_text(script_that_compares(path, [(cast.played[i].name, cast.live[i].name) for i in (1, 2)]))
    for options in ([], ["--factory-startup"]):
        result = subprocess.run(
            [*COMMAND, "-b", *options, "--python-exit-code", "1", "--python", str(script)],
            capture_output=True,
            text=True,
            check=False,
        )
        assert result.returncode == 0, result.stdout + result.stderr
    bpy.ops.wm.open_mainfile(filepath=str(path))
    assert recorded().known() == []


def test_taking_over_leaves_nothing_in_the_file(cast):
    def state():
        data = cast.played[0].animation_data
        ob = cast.played[1]
        hooks = [(curve.data_path, curve.driver.type, curve.driver.expression) for curve in ob.animation_data.drivers]
        return data.action.as_pointer(), data.action.users, hooks, [repr(each) for each in bpy.data.user_map()]

    cast.record()
    before = state()
    cast.take_over()
    assert state() == before
    cast.play([4])
    assert state() == before
    cast.hand_back()
    assert state() == before


def test_handlers_of_others_see_the_action_while_it_takes_over(cast):
    seen = []

    def look(*_):
        seen.append(cast.played[0].animation_data.action)

    cast.record()
    lists = (bpy.app.handlers.depsgraph_update_pre, bpy.app.handlers.depsgraph_update_post)
    for each in lists:
        each.insert(0, look)
    try:
        cast.take_over()
    finally:
        for each in lists:
            each.remove(look)
    assert seen
    assert None not in seen


def test_the_action_is_back_after_an_error(cast):
    relations = addon_module("host.relations")
    action = cast.played[0].animation_data.action
    handlers = list(bpy.app.handlers.depsgraph_update_pre), list(bpy.app.handlers.depsgraph_update_post)
    with pytest.raises(ZeroDivisionError), relations.Rebuilding() as rebuilding:
        rebuilding.without_animation(cast.played[0])
        assert cast.played[0].animation_data.action is None
        raise ZeroDivisionError
    assert cast.played[0].animation_data.action == action
    assert handlers == (list(bpy.app.handlers.depsgraph_update_pre), list(bpy.app.handlers.depsgraph_update_post))


# --- a Blender that is not known ---------------------------------------------------------------


def test_an_unknown_layout_is_refused_in_a_sentence_and_all_else_works(cast, monkeypatch):
    contract, layout = addon_module("host.contract"), addon_module("host.layout")
    structs = layout.structs()
    data = structs["AnimData"]
    members = {name: place for name, place in data.members.items() if name != "nla_tracks"}
    cast.record()
    monkeypatch.setattr(layout, "structs", lambda: {**structs, "AnimData": dataclasses.replace(data, members=members)})
    contract.forget()
    try:
        states().take_over([cast.rig], cast.scene, layer())
        assert not cast.rig.is_played
        assert "(AnimData has no nla_tracks), so no rig is native or recorded" in cast.rig.reason
        assert contract.trouble() == ""
        assert is_deforming(cast.played[1])
        cast.play()
    finally:
        monkeypatch.undo()
        contract.forget()


def test_an_action_elsewhere_in_memory_is_refused(cast, monkeypatch):
    contract, relations = addon_module("host.contract"), addon_module("host.relations")
    cast.record()
    region = contract.region

    def elsewhere(struct, kind, member):
        address, size = region(struct, kind, member)
        return (address + 8, size) if member == "*action" else (address, size)

    monkeypatch.setattr(contract, "region", elsewhere)
    try:
        with pytest.raises(contract.Broken, match="actions are not where they were"), relations.Rebuilding() as each:
            each.without_animation(cast.played[0])
    finally:
        monkeypatch.undo()
        contract.forget()
    cast.play()
    cast.take_over()


# --- what Blender evaluates -----------------------------------------------------------------------

COUNTING = """
import sys
sys.path.insert(0, {folder!r})
import bpy
from helpers import addon_module, deform_small_meshes, select
import test_played
deform_small_meshes()
bpy.ops.wm.read_homefile(use_empty=True)
cast = test_played.Cast(bpy.context.scene)
cast.take_over()
sys.stdout.flush()
print("== played", flush=True)
bpy.context.scene.frame_set(5)
print("== end", flush=True)
cast.hand_back()
print("== live", flush=True)
bpy.context.scene.frame_set(6)
print("== end", flush=True)
"""


@needs_program
def test_blender_evaluates_no_bone_of_a_played_armature(tmp_path):
    script = tmp_path / "count.py"
    folder = str(__import__("pathlib").Path(__file__).parent)
    script.write_text(COUNTING.format(folder=folder))
    result = subprocess.run(
        [*COMMAND, "-b", "--debug-depsgraph-eval", "--python-exit-code", "1", "--python", str(script)],
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    assert result.returncode == 0, result.stdout[-3000:] + result.stderr
    evaluated_on = {}
    for what in ("played", "live"):
        part = result.stdout.partition(f"== {what}")[2].partition("== end")[0]
        # what is evaluated of the armature Rig, which is played at first, and of Rig.001, which never is
        lines = re.findall(r"BKE_(pose_eval_\w+|pose_\w+_done|animsys_eval_\w+) on OB(Rig\S*) ", part)
        evaluated_on[what] = {name: [line for line, ob in lines if ob == name] for name in ("Rig", "Rig.001")}
    assert evaluated_on["played"]["Rig"] == []
    assert evaluated_on["live"]["Rig"].count("pose_eval_bone") == 6
    assert sorted(evaluated_on["live"]["Rig"]) == sorted(evaluated_on["played"]["Rig.001"])
