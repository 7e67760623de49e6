"""Onion skins show the shapes that a character has on the frames around the current one, or nothing."""

import weakref

import bpy
import numpy as np
import pytest

from characters import add_shape_keys, smoothed
from helpers import addon_module, evaluated, needs_memory, needs_rig_programs, select
from test_accelerated_rigs import accelerating, keep_live, wait
from test_played import EDITS, FRAMES, layer, opened_cast, recorded, states
from test_played_who import both


@pytest.fixture
def cast():
    return opened_cast(last=10)


@pytest.fixture
def settings():
    """The preferences of onion skins, which are put back."""
    found = addon_module("main.addon_preferences").of_sinew().onion
    names = [name for name in found.bl_rna.properties.keys() if name not in {"rna_type", "name"}]
    before = {name: getattr(found, name) for name in names}
    before = {name: tuple(value) if hasattr(value, "__len__") else value for name, value in before.items()}
    yield found
    for name, value in before.items():
        setattr(found, name, value)


def ghosts():
    return addon_module("onion.ghosts")


def drawings():
    return addon_module("onion.ghost_drawing").drawings(bpy.context)


def toggle(cast):
    """Presses the button, and has what is played take over again."""
    select(cast.played[0])
    assert bpy.ops.object.sinew_onion_skins() == {"FINISHED"}
    select()
    layer().update()


def live_shapes(cast, frames=FRAMES):
    """{frame: ((V, 3) of the mesh that Sinew deforms, of that which Blender deforms)} of the live twin, world space."""
    frame, found = cast.scene.frame_current, {}
    for each in frames:
        cast.scene.frame_set(each)
        found[each] = [world(evaluated(ob), ob.matrix_world) for ob in cast.live[1:3]]
    cast.scene.frame_set(frame)
    return found


def world(positions, matrix):
    matrix = np.array(matrix, np.float32)
    return positions @ matrix[:3, :3].T + matrix[:3, 3]


def shown(cast, ob):
    """{frame: (V, 3)} of the ghosts of one mesh object that are drawn, world space."""
    key = addon_module("blender.values").key_of(ob)
    return {
        ghost.key[1]: world(ghost.shape.positions, ghost.shape.matrix)
        for ghost, _color in drawings()
        if ghost.key[0] == key
    }


def assert_ghosts(cast, frames):
    """On exactly these frames, for both meshes, and as the live twin."""
    found = [shown(cast, ob) for ob in cast.played[1:3]]
    assert [sorted(each) for each in found] == [sorted(frames)] * 2
    wanted = live_shapes(cast, frames)
    for frame in frames:
        for ours, theirs in zip(found, wanted[frame]):
            assert np.array_equal(ours[frame], theirs)


@needs_memory
@pytest.mark.parametrize("is_played", [False, True])
def test_ghosts_are_the_shapes_of_their_frames(cast, settings, is_played):
    settings.before, settings.after, settings.step = 2, 3, 1
    toggle(cast)
    cast.record()
    if is_played:
        cast.take_over()
        fill_native(cast, range(1, 11))
    cast.scene.frame_set(5)
    assert_ghosts(cast, [3, 4, 6, 7, 8])
    settings.step = 2
    assert_ghosts(cast, [1, 3, 7, 9])
    settings.before = 0
    assert_ghosts(cast, [7, 9])
    cast.scene.frame_set(9)
    assert_ghosts(cast, [])
    assert cast.rig.is_played == is_played


@pytest.fixture
def computed(cast, monkeypatch):
    """The cast, of which the first is accelerated as soon as nothing is done."""
    monkeypatch.setattr(accelerating(), "LEAST_WORK", 0)
    keep_live(cast)
    return cast


def fill(cast, frames):
    """What the timer does. Returns whether anything was evaluated."""
    wait(cast)
    return fill_native(cast, frames)


def fill_native(cast, frames):
    is_any = False
    while ghosts().fill(cast.scene, frames):
        is_any = True
        states().keep_played(cast.scene, layer())
    return is_any


@needs_memory
@needs_rig_programs
@pytest.mark.parametrize("is_accelerated_first", (True, False))
def test_ghosts_of_a_computed_rig_need_no_playing(computed, settings, is_accelerated_first):
    settings.before, settings.after, settings.step = 2, 3, 1
    computed.scene.frame_set(4)
    if is_accelerated_first:
        wait(computed)
    toggle(computed)
    assert fill(computed, [2, 3, 5, 6, 7]) and computed.rig.is_played
    computed.assert_same()
    assert not fill(computed, [2, 3, 5, 6, 7])
    assert_drawn_as_live(computed, [2, 3, 5, 6, 7])
    for armature, *_ in both(computed):
        armature.pose.bones["bone1"].location.x += 0.4
        armature.pose.bones["bone1"].keyframe_insert("location", frame=4)
    layer().update()
    computed.play([4])
    assert fill(computed, [2, 3, 5, 6, 7])
    assert_drawn_as_live(computed, [2, 3, 5, 6, 7])
    computed.play()
    assert computed.rig.is_played


def assert_drawn_as_live(cast, frames):
    frame, drawn, wanted = cast.scene.frame_current, drawings(), live_shapes(cast, frames)
    found = {}
    for each in drawn:
        found.setdefault(each.ghost.key[1], []).append(world(each.ghost.shape.positions, each.ghost.shape.matrix))
    assert sorted(found) == frames and cast.scene.frame_current == frame
    for each in frames:
        for shape in wanted[each]:
            assert any(np.allclose(shape, other, atol=1e-5) for other in found[each] if other.shape == shape.shape)


@needs_memory
@needs_rig_programs
def test_what_is_simulated_or_not_keyed_is_not_evaluated_on_other_frames(computed, settings):
    flag = bpy.data.objects.new("Flag", computed.played[2].data.copy())
    computed.scene.collection.objects.link(flag)
    flag.parent, cloth = computed.played[0], flag.modifiers.new("Cloth", "CLOTH")
    toggle(computed)
    assert not fill(computed, [2, 3]) and computed.rig.is_played
    flag.modifiers.remove(cloth)
    computed.played[1].data.vertices[0].co.x += 0.1  # no keyframe sets it
    assert fill(computed, [2])
    computed.played[0].pose.bones["bone1"].location.x += 0.4
    layer().update()
    assert not fill(computed, [3])


@needs_memory
def test_there_are_none_unless_somebody_asks(cast, settings):
    cast.record()
    assert drawings() == []
    before = recorded().used_memory()
    cast.play()
    assert recorded().used_memory() == before
    toggle(cast)
    cast.play()
    assert drawings()
    assert recorded().used_memory() > before
    toggle(cast)
    assert drawings() == []
    assert recorded().used_memory() == before


@needs_memory
def test_record_plays_what_ghosts_need(cast, settings):
    settings.before, settings.after, settings.step = 1, 1, 4
    cast.record()
    cast.scene.frame_set(5)
    toggle(cast)
    assert_ghosts(cast, [])
    select(cast.played[0])
    assert bpy.ops.object.sinew_record() == {"FINISHED"}
    assert_ghosts(cast, [1, 9])
    assert addon_module("played.recording").missing(cast.rig, cast.scene) == []


@needs_memory
def test_ghosts_of_a_played_character_are_recorded_while_it_plays_from_memory(cast, settings):
    settings.before, settings.after, settings.step = 1, 1, 2
    cast.take_over()
    select(cast.played[0])
    bpy.ops.object.sinew_onion_skins()
    select()
    states().take_over([cast.rig], cast.scene, layer())
    cast.play()
    assert cast.rig.is_played
    cast.scene.frame_set(5)
    assert_ghosts(cast, [3, 7])


@needs_memory
def test_colors_fade_with_the_distance(cast, settings):
    settings.before, settings.after, settings.step, settings.opacity = 3, 2, 1, 0.5
    settings.color_before, settings.color_after = (1, 0, 0), (0, 1, 0)
    toggle(cast)
    cast.record()
    cast.scene.frame_set(5)
    found = {ghost.key[1]: color for ghost, color in drawings()}
    assert found[4] == pytest.approx((1, 0, 0, 0.5))
    assert found[3] == pytest.approx((1, 0, 0, 0.35))
    assert found[2] == pytest.approx((1, 0, 0, 0.2))
    assert found[6] == pytest.approx((0, 1, 0, 0.5))
    assert found[7] == pytest.approx((0, 1, 0, 0.2))
    order = [abs(ghost.steps) for ghost, _ in drawings()]
    assert order == sorted(order, reverse=True)


@needs_memory
@pytest.mark.parametrize("edit", EDITS)
def test_no_ghost_is_older_than_an_edit_of_the_armature(cast, settings, edit):
    settings.before, settings.after, settings.step = 5, 5, 1
    toggle(cast)
    cast.record()
    cast.scene.frame_set(5)
    for armature, *_ in (cast.played, cast.live):
        edit(armature)
    layer().update()
    cast.scene.frame_set(6)
    assert_ghosts(cast, sorted(shown(cast, cast.played[1])))
    cast.play()
    cast.scene.frame_set(5)
    assert_ghosts(cast, [1, 2, 3, 4, 6, 7, 8, 9, 10])


@needs_memory
def test_moving_a_key_drops_ghosts(cast, settings):
    settings.before, settings.after, settings.step = 8, 8, 1
    toggle(cast)
    cast.record()
    cast.scene.frame_set(2)
    for armature, *_ in (cast.played, cast.live):
        curve = addon_module("blender.animation").action_curves(armature.animation_data.action)[0]
        curve.keyframe_points[3].co.y += 1
        curve.update()
    layer().update()
    assert_ghosts(cast, [])


def edit_mesh(ob):
    ob.data.vertices[5].co.x += 1
    ob.data.update()


def edit_weights(ob):
    ob.vertex_groups["bone1"].add(range(200), 0.7, "REPLACE")
    ob.data.update()


def edit_modifier(ob):
    ob.modifiers["Armature"].use_deform_preserve_volume = True


def edit_smoothing(ob):
    smoothed(ob, iterations=3)


def edit_keys(ob):
    add_shape_keys(ob)


def edit_place(ob):
    ob.location.x += 1


def edit_faces(ob):
    ob.modifiers.new("Triangulate", "TRIANGULATE")


@needs_memory
@pytest.mark.parametrize(
    "edit", [edit_mesh, edit_weights, edit_modifier, edit_smoothing, edit_keys, edit_place, edit_faces]
)
def test_no_ghost_is_older_than_an_edit_of_the_mesh(cast, settings, edit):
    settings.before, settings.after, settings.step = 5, 5, 1
    toggle(cast)
    cast.record()
    cast.take_over()
    cast.scene.frame_set(5)
    for _, *meshes, _prop in (cast.played, cast.live):
        for ob in meshes:
            edit(ob)
    layer().update()
    assert_ghosts(cast, sorted(shown(cast, cast.played[1])))
    cast.play()
    cast.scene.frame_set(5)
    assert_ghosts(cast, [1, 2, 3, 4, 6, 7, 8, 9, 10])


@needs_memory
def test_triangles_are_read_once_and_again_when_they_change(cast, settings):
    toggle(cast)
    cast.record()
    cast.scene.frame_set(5)
    topologies = {id(ghost.shape.topology) for ghost, _ in drawings()}
    assert len(topologies) == 2  # one for each mesh
    ghost = drawings()[0].ghost
    assert ghost.shape.topology.triangles.dtype == np.int32
    assert ghost.shape.topology.triangles.max() == len(ghost.shape.positions) - 1
    cast.played[1].modifiers.new("Subdivision", "SUBSURF").levels = 1
    for frame in (3, 5):
        cast.scene.frame_set(frame)
    key = addon_module("blender.values").key_of(cast.played[1])
    shape = next(ghost.shape for ghost, _ in drawings() if ghost.key[0] == key)
    assert len(shape.positions) > len(cast.played[1].data.vertices)
    assert shape.topology.triangles.max() == len(shape.positions) - 1


@needs_memory
def test_a_prop_on_a_bone_has_ghosts(cast, settings):
    settings.before, settings.after, settings.step = 1, 1, 1
    cast.played[3].data.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    toggle(cast)
    cast.record()
    cast.take_over()
    fill_native(cast, range(1, 11))
    cast.scene.frame_set(4)
    found = shown(cast, cast.played[3])
    assert sorted(found) == [3, 5]
    for frame, positions in found.items():
        cast.scene.frame_set(frame)
        assert np.array_equal(positions[0], np.array(cast.live[3].matrix_world.translation, np.float32))


@needs_memory
def test_hidden_and_removed_objects_have_no_ghosts(cast, settings):
    toggle(cast)
    cast.record()
    cast.scene.frame_set(5)
    cast.played[1].hide_set(True)
    assert shown(cast, cast.played[1]) == {}
    assert shown(cast, cast.played[2])
    bpy.data.objects.remove(cast.played[2])
    cast.scene.frame_set(4)
    layer().update()
    assert drawings() == []
    bpy.data.objects.remove(cast.played[0])
    cast.scene.frame_set(5)
    assert drawings() == []


@needs_memory
def test_undo_keeps_what_is_shown_and_no_old_shape(cast, settings):
    bpy.ops.ed.undo_push(message="before")
    toggle(cast)
    cast.record()
    cast.scene.frame_set(5)
    cast.played[3].location.x = 1
    bpy.ops.ed.undo_push(message="moved")
    cast.undo()
    assert drawings() == []
    cast.play()
    cast.scene.frame_set(5)
    assert_ghosts(cast, sorted({1, 3, 7, 9} & set(shown(cast, cast.played[1]))))
    assert drawings()


@needs_memory
def test_memory_is_limited_together_with_poses(cast, settings):
    limit = recorded().store.limit
    toggle(cast)
    try:
        recorded().set_limit(1)
        for frame in range(1, 60):
            cast.scene.frame_set(frame)
        assert recorded().used_memory() <= 2**20
        cast.scene.frame_set(58)
        assert drawings()
    finally:
        recorded().store.set_limit(limit)


@needs_memory
def test_record_plays_once_what_ghosts_lack(cast):
    cast.record()
    toggle(cast)
    played = []

    def look(scene, *_):
        played.append(scene.frame_current)

    bpy.app.handlers.frame_change_pre.append(look)
    select(cast.played[0])
    try:
        assert bpy.ops.object.sinew_record() == {"FINISHED"}
        assert len(played) > 2 and not any(cast.rig.motion.skins.lacks(each, cast.rig.origin(each)) for each in played)
        played.clear()
        assert bpy.ops.object.sinew_record() == {"FINISHED"}
    finally:
        bpy.app.handlers.frame_change_pre.remove(look)
    assert played == []


@needs_memory
def test_ghosts_keep_no_pose_that_the_store_has_dropped(cast, settings):
    toggle(cast)
    cast.record()
    pose = weakref.ref(cast.rig.motion.record.at(4).pose)
    assert pose() is not None and not cast.rig.motion.skins.lacks(4, pose())
    cast.rig.motion.record.drop_frame(4)
    assert pose() is None


@needs_memory
def test_with_its_poses_a_rig_drops_its_shapes(cast, settings):
    toggle(cast)
    cast.record()
    skins = cast.rig.motion.skins
    assert len(skins.shapes) == 2 and skins.seen
    cast.rig.clear()
    assert not skins.shapes and not skins.seen


@needs_memory
def test_what_cannot_be_drawn_any_more_leaves_the_graphics_card(cast, settings, monkeypatch):
    settings.before, settings.after, settings.step = 2, 2, 1
    drawing = addon_module("onion.ghost_drawing")
    toggle(cast)
    cast.record()
    cast.scene.frame_set(5)
    drawn = drawings()
    assert len(drawn) == 8
    monkeypatch.setattr(drawing, "_batches", {each.ghost.key: (each.ghost.shape, None) for each in drawn})
    monkeypatch.setattr(drawing, "_triangles", {each.ghost.key[0]: (each.ghost.shape.topology, None) for each in drawn})
    drawing.forget_all_but([])  # they are spare
    assert len(drawing._batches) == 8 and len(drawing._triangles) == 2
    for key in cast.rig.motion.skins.shapes:
        cast.rig.motion.skins.shapes[key].drop_frame(4)
    drawing.forget_all_but([])
    assert len(drawing._batches) == 6
    toggle(cast)
    drawing.forget_all_but([])
    assert not drawing._batches and not drawing._triangles


@needs_memory
def test_another_file_has_no_ghosts(cast, settings):
    toggle(cast)
    cast.record()
    bpy.ops.wm.read_homefile(use_empty=True)
    assert drawings() == []
    assert recorded().used_memory() == 0


@needs_memory
def test_nothing_of_it_is_in_the_file(cast, settings):
    def state():
        blocks = [block for each in bpy.data.user_map() for block in [each]]
        return [(block.name_full, len(block.keys()) if hasattr(block, "keys") else 0) for block in blocks]

    before = state()
    toggle(cast)
    cast.record()
    assert drawings()
    assert state() == before


def test_the_button_says_what_lacks(cast, settings):
    cast.played[0].animation_data_clear()
    select(cast.played[0])
    with pytest.raises(RuntimeError, match="have no keyframes"):
        bpy.ops.object.sinew_onion_skins()
    select()
    assert not bpy.ops.object.sinew_onion_skins.poll()


@needs_memory
@pytest.mark.usefixtures("no_program")
def test_the_timeline_marks_recorded_frames(cast):
    strips = addon_module("ui.played_rigs")
    assert strips.marked(bpy.context) == []
    cast.record()
    assert strips.marked(bpy.context) == []
    select(cast.played[0])
    assert strips.marked(bpy.context) == [cast.rig]
    select()
    cast.take_over()
    for frame in (4, 5):
        cast.rig.motion.record.drop_frame(frame)
    assert strips.marked(bpy.context) == [cast.rig]
    bars = strips.bars([cast.rig, cast.rig], lambda frame: 10 * frame, 200, 2)
    assert [bar[:4] for bar in bars] == [(5, 148, 35, 154), (55, 148, 105, 154), (5, 140, 35, 146), (55, 140, 105, 146)]
    assert {bar.color for bar in bars} == {strips.PLAYED}
    cast.hand_back()
    assert {bar.color for bar in strips.bars([cast.rig], float, 200, 1)} == {strips.LIVE}
