"""Who can be played, and with whom: what follows a played character moves as ever, and what could not is refused with a
reason. The operators, and taking over what is not selected."""

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, pose, smoothed
from helpers import addon_module, depsgraph, evaluated, import_rig, needs_memory, needs_rig_programs, select
from test_played import FRAMES, layer, opened_cast, recorded, states

pytestmark = needs_memory


@pytest.fixture
def cast():
    return opened_cast(last=10)


def both(cast):
    return cast.played, cast.live


# --- what follows ---------------------------------------------------------------------------------


def drive_keys(armature, ob):
    add_shape_keys(ob)
    keys = ob.data.shape_keys
    keys.animation_data_clear()
    for name, bone, kind in (("Wide", "bone2", "ROT_X"), ("Bumpy", "side", "LOC_Y")):
        keys.key_blocks[name].slider_min = -5
        driver = keys.key_blocks[name].driver_add("value").driver
        driver.type = "SUM"
        variable = driver.variables.new()
        variable.type = "TRANSFORMS"
        target = variable.targets[0]
        target.id, target.bone_target, target.transform_type, target.transform_space = (
            armature,
            bone,
            kind,
            "LOCAL_SPACE",
        )


def test_shape_keys_that_bones_drive(cast):
    for armature, ob, other, _ in both(cast):
        drive_keys(armature, ob)
        drive_keys(armature, other)
    cast.take_over()
    shapes = cast.play([*FRAMES, 4])
    assert cast.rig.is_played
    assert np.ptp(shapes, axis=0).max() > 0.1
    for number in (1, 2):
        values = [each[number].data.shape_keys.key_blocks["Wide"].value for each in both(cast)]
        assert values[0] == values[1] != 0


def test_editing_a_driven_key_shows(cast):
    for armature, ob, *_ in both(cast):
        drive_keys(armature, ob)
    cast.take_over()
    cast.scene.frame_set(5)
    for _, ob, *_ in both(cast):
        ob.data.shape_keys.animation_data.drivers[0].driver.variables[0].targets[0].bone_target = "bone4"
    layer().update()
    cast.assert_same()
    cast.play()


def test_smoothing_and_modifiers_behind_it(cast):
    for _, ob, other, _ in both(cast):
        for each in (ob, other):
            smoothed(each, iterations=3)
            each.modifiers.new("Subdivision", "SUBSURF").levels = 1
    layer().update()
    cast.take_over()
    cast.play()
    assert cast.rig.is_played


def test_objects_that_are_constrained_to_bones(cast):
    for armature, _, _, prop in both(cast):
        prop.parent = None
        constraint = prop.constraints.new("COPY_TRANSFORMS")
        constraint.target, constraint.subtarget = armature, "bone3"
    cast.take_over()
    cast.play()
    assert cast.rig.is_played


def test_another_armature_may_name_it(cast):
    """As Rigify's metarig names the rig that was made of it."""
    for armature, *_ in both(cast):
        make_armature().data["rig"] = armature
    cast.scene.frame_set(1)
    cast.take_over()
    cast.play()


def test_children_of_what_hangs_on_a_bone(cast):
    rings = []
    for *_, prop in both(cast):
        ring = bpy.data.objects.new("Ring", None)
        cast.scene.collection.objects.link(ring)
        ring.parent = prop
        ring.location.x = 1
        rings.append(ring)
    cast.take_over()
    for frame in FRAMES:
        cast.scene.frame_set(frame)
        ours, theirs = (ring.evaluated_get(depsgraph()).matrix_world for ring in rings)
        assert ours == theirs
    assert cast.rig.is_played


def test_an_animated_prop_keeps_its_own_animation(cast):
    for *_, prop in both(cast):
        for frame in (1, 10):
            prop.location.y = frame
            prop.keyframe_insert("location", frame=frame)
    cast.take_over()
    cast.play()
    assert cast.rig.is_played


# --- several --------------------------------------------------------------------------------------


def follow(armature, leader):
    constraint = armature.pose.bones["bone4"].constraints.new("COPY_ROTATION")
    constraint.target, constraint.subtarget = leader, "bone2"


def test_one_that_follows_another_is_played_with_it(cast):
    leaders = []
    for armature, *_ in both(cast):
        leader = make_armature()
        for frame in (1, 5, 10):
            pose(leader, frame + 3, False)
            pose(leader, frame, False)
        follow(armature, leader)
        leaders.append(leader)
    select()
    cast.scene.frame_set(1)
    leader = recorded().learn(leaders[0])
    cast.record()
    states().take_over([cast.rig], cast.scene, layer())
    assert not cast.rig.is_played
    assert "follows bones of" in cast.rig.reason
    states().take_over([cast.rig, leader], cast.scene, layer())
    assert cast.rig.is_played
    assert leader.is_played
    cast.play()
    for each in leaders:
        curves = addon_module("blender.animation").action_curves(each.animation_data.action)
        for curve in curves:
            curve.keyframe_points[-1].co.y += 0.3
            curve.update()
    layer().update()
    cast.play([10, 9, 1])
    cast.play()


def in_a_hand(other, armature):
    other.parent, other.parent_type, other.parent_bone = armature, "BONE", "bone3"


def constrained_to_a_bone(other, armature):
    constraint = other.constraints.new("CHILD_OF")
    constraint.target, constraint.subtarget = armature, "bone3"


@pytest.mark.parametrize("is_bound", (False, True))
@pytest.mark.parametrize("has_keys", (False, True))
@pytest.mark.parametrize("prepare", (in_a_hand, constrained_to_a_bone, follow))
def test_another_armature_that_follows_it_stays_live(cast, prepare, has_keys, is_bound):
    """As that of a bow, or of clothes."""
    meshes, others = [], []
    for armature, *_ in both(cast):
        other = make_armature()
        others.append(other)
        for frame in (1, 5, 10) if has_keys else ():
            pose(other, frame + 3, False)
            pose(other, frame, False)
        prepare(other, armature)
        meshes.append(make_mesh(other, False))
        if is_bound:
            accelerate(meshes[-1])
    select()
    layer().update()
    cast.take_over()
    seen = []

    def compare():
        cast.assert_same()
        assert np.array_equal(evaluated(meshes[0]), evaluated(meshes[1]))
        ours, theirs = (each.evaluated_get(depsgraph()).matrix_world for each in others)
        assert ours == theirs
        seen.append((tuple(evaluated(meshes[0])[-1]), tuple(ours.translation)))

    for frame in [*FRAMES, 4]:
        cast.scene.frame_set(frame)
        compare()
    assert len(set(seen)) > 5 and cast.rig.is_played, cast.rig.reason
    for armature, *_ in both(cast):
        armature.pose.bones["bone1"].location.x += 0.3
    layer().update()
    compare()
    states().take_over([cast.rig], cast.scene, layer())
    for frame in (7, 2):
        cast.scene.frame_set(frame)
        compare()


def test_of_two_one_is_handed_back(cast):
    rigs = [recorded().learn(each[0]) for each in both(cast)]
    cast.play()
    states().take_over(rigs, cast.scene, layer())
    assert [rig.is_played for rig in rigs] == [True, True]
    cast.scene.frame_set(7)
    states().hand_back(rigs[1:], cast.scene, layer())
    assert [rig.is_played for rig in rigs] == [True, False]
    cast.assert_same()
    cast.play()
    states().take_over(rigs[1:], cast.scene, layer())
    assert [rig.is_played for rig in rigs] == [True, True]
    cast.play()


# --- who cannot -----------------------------------------------------------------------------------


def key_a_way(ob):
    for frame in (1, 10):
        ob.location.x += 0.5
        ob.keyframe_insert("location", frame=frame)


def with_moving_object(cast, armature, _ob, _prop):
    key_a_way(armature)
    armature.driver_add("scale", 0)
    return "itself is animated (Location"


def with_moving_parent(cast, armature, _ob, _prop):
    parent = bpy.data.objects.new("Horse", None)
    cast.scene.collection.objects.link(parent)
    parent.keyframe_insert("location", frame=1)
    armature.parent = parent
    return "is a child of Horse"


def with_constraint(cast, armature, _ob, _prop):
    armature.constraints.new("LIMIT_LOCATION")
    return "itself has constraints"


def with_timed_driver(cast, armature, _ob, _prop):
    driver = armature.pose.bones["bone1"].driver_add("bbone_curveinx").driver
    driver.type, driver.expression = "SCRIPTED", "frame / 10 + len([])"
    return 'the driver of B-Bone Curve In X of the bone "bone1" of Rig depends on more than its variables (frame / 10'


def with_driver_that_reads_anything(_cast, armature, ob, _prop):
    driver = armature.pose.bones["bone1"].driver_add("bbone_curveinx").driver
    driver.type, driver.expression = "SCRIPTED", f'bpy.data.objects["{ob.name}"].location.x'
    return "depends on more than its variables (bpy.data"


def with_fluid(cast, _armature, ob, _prop):
    ob.modifiers.new("Fluid", "FLUID")
    return "needs its armature between frames"


def with_moving_target(cast, armature, _ob, _prop):
    target = bpy.data.objects.new("Ball", None)
    cast.scene.collection.objects.link(target)
    target.keyframe_insert("location", frame=1)
    constraint = armature.pose.bones["bone4"].constraints.new("COPY_LOCATION")
    constraint.target = target
    return "follow Ball"


def with_parent_deform(cast, armature, _ob, prop):
    prop.parent_type = "ARMATURE"
    return "is deformed by its parent"


def with_solver(cast, armature, _ob, _prop):
    armature.pose.ik_solver = "ITASC"
    return "iTaSC"


def without_keyframes(cast, armature, _ob, _prop):
    armature.animation_data_clear()
    return "has no keyframes"


def in_pose_mode(cast, armature, _ob, _prop):
    select(armature)
    bpy.ops.object.mode_set(mode="POSE")
    return "is being edited"


REASONS = [value for name, value in list(globals().items()) if name.startswith(("with_", "without_", "in_pose"))]


@pytest.mark.usefixtures("no_program")
@pytest.mark.parametrize("prepare", REASONS)
def test_who_cannot_be_played_says_why(cast, prepare):
    clause = prepare(cast, cast.played[0], cast.played[1], cast.played[3])
    rig = cast.rig
    for frame in (3, 2, 1):
        cast.scene.frame_set(frame)
    states().take_over([rig], cast.scene, layer())
    assert not rig.is_played
    assert clause in rig.reason


def test_an_imported_rig_can_be_played_once_it_has_keyframes(fresh_scene):
    """It keeps its poses, which do not move its bones any more."""
    ob, armature = import_rig()
    bpy.ops.object.sinew_clip_to_keyframes()
    rig = recorded().learn(armature)
    for frame in (1, 2, 3):
        fresh_scene.frame_set(frame)
    select()
    states().take_over([rig], fresh_scene, layer())
    assert rig.is_played
    fresh_scene.frame_set(2)
    wanted = evaluated(ob).copy()
    ob.sinew.source = "CLIP"
    states().hand_back([rig], fresh_scene, layer())
    states().take_over([rig], fresh_scene, layer())
    assert not rig.is_played
    assert "plays the poses of an imported rig" in rig.reason
    assert np.allclose(evaluated(ob), wanted, atol=1e-4)


def test_a_target_that_stands_still_is_followed_when_it_is_moved(cast):
    target = bpy.data.objects.new("Ball", None)
    cast.scene.collection.objects.link(target)
    for armature, *_ in both(cast):
        constraint = armature.pose.bones["bone4"].constraints.new("COPY_LOCATION")
        constraint.target = target
    cast.take_over()
    cast.play()
    assert cast.rig.is_played
    target.location.z = 3
    layer().update()
    cast.assert_same()
    assert not cast.rig.is_played
    cast.play()
    states().take_over([cast.rig], cast.scene, layer())
    cast.play()


# --- operators and the automatic mode -------------------------------------------------------------


@pytest.mark.usefixtures("no_program")
def test_the_operators(cast):
    select(cast.played[1])
    assert bpy.ops.object.sinew_record() == {"FINISHED"}
    assert cast.rig.motion.record.runs() == [(1, 10)]
    assert cast.rig.is_played
    cast.play()
    assert bpy.ops.object.sinew_leave_to_blender() == {"FINISHED"}
    assert not cast.rig.is_played
    cast.play()


@pytest.mark.usefixtures("no_program")
def test_taking_over_records_what_is_not_recorded(cast):
    select(cast.live[0])
    cast.scene.frame_set(4)
    assert bpy.ops.object.sinew_record_others() == {"FINISHED"}
    assert cast.scene.frame_current == 4
    assert [recorded().get(each[0]) is not None and recorded().get(each[0]).is_played for each in both(cast)] == [
        True,
        False,
    ]
    assert cast.rig.motion.record.runs() == [(1, 10)]
    cast.play()


@pytest.mark.usefixtures("no_program")
def test_the_operator_says_why_not(cast):
    key_a_way(cast.played[0])
    select(cast.played[0])
    with pytest.raises(RuntimeError, match="itself is animated"):
        bpy.ops.object.sinew_record()
    select()
    layer().objects.active = None
    with pytest.raises(RuntimeError, match="Select an armature"):
        bpy.ops.object.sinew_record()


@pytest.mark.usefixtures("no_program")
def test_a_frame_that_is_not_recorded_hands_back_and_the_record_stays(cast):
    cast.record()
    states().take_over([cast.rig], cast.scene, layer())
    assert cast.rig.is_played
    recorded_ones = cast.rig.motion.record.runs()
    cast.scene.frame_set(25)
    assert not cast.rig.is_played and cast.rig.motion.record.runs()[: len(recorded_ones)] == recorded_ones
    cast.assert_same()
    cast.scene.frame_set(3)
    states().take_over_again(cast.scene, layer())
    assert cast.rig.is_played
    cast.play()


@pytest.mark.usefixtures("no_program")
def test_a_limit_of_memory_drops_the_oldest_frames(cast):
    limit = recorded().store.limit
    cast.record()
    size = cast.rig.motion.record.nbytes // 10
    assert recorded().used_memory() == cast.rig.motion.record.nbytes
    try:
        recorded().store.set_limit(4 * size)
        assert cast.rig.motion.record.runs() == [(7, 10)]
        states().take_over([cast.rig], cast.scene, layer())
        cast.play()
        assert len(cast.rig.motion.record) == 4
    finally:
        recorded().store.set_limit(limit)


@needs_rig_programs
def test_the_panel_lists_who_is_native(cast):
    ui = addon_module("ui.played_rigs")
    cast.take_over()
    assert ui.frames_text(cast.rig) == "native"
    cast.hand_back()
    assert ui.frames_text(cast.rig) == "Blender's"


@pytest.mark.usefixtures("no_program")
def test_the_panel_lists_what_is_recorded(cast):
    ui = addon_module("ui.played_rigs")
    cast.take_over()
    assert ui.frames_text(cast.rig) == "1 to 10"
    for frame in (2, 3, 6):
        cast.rig.motion.record.drop_frame(frame)
    assert ui.frames_text(cast.rig) == "1, 4 to 5, 7 to 10"
    select(cast.live[0])
    assert ui.SidebarRigs.poll(bpy.context)


def in_a_collection(cast):
    """Moves both characters into a collection that can be linked. Returns their objects' names."""
    character = bpy.data.collections.new("Character")
    cast.scene.collection.children.link(character)
    for each in both(cast):
        for ob in each:
            character.objects.link(ob)
            cast.scene.collection.objects.unlink(ob)
    return [[ob.name for ob in each] for each in both(cast)]


def test_a_linked_character_and_an_override(cast, tmp_path):
    from helpers import into_a_shot

    names = in_a_collection(cast)
    for overridden in (False, True):
        scene = into_a_shot(tmp_path, overridden)
        if overridden:
            objects = {ob.name: ob for ob in bpy.data.objects if ob.override_library}
        else:
            objects = {ob.name: ob for ob in bpy.data.objects}
        cast.scene = scene
        cast.played, cast.live = ([objects[name] for name in each] for each in names)
        cast.record()
        cast.take_over()
        shapes = cast.play()
        assert cast.rig.is_played
        assert np.ptp(shapes, axis=0).max() > 0.1
        cast.hand_back()
        cast.play([3, 8])
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "library.blend"))


def can_render(scene):
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.render.resolution_x, scene.render.resolution_y = 1, 8, 8
    scene.cycles.use_denoising = False
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    layer().update()


def test_motion_in_a_render_is_live(cast):
    cast.take_over()
    cast.scene.frame_set(3)
    scene = cast.scene
    seen = {}

    def look(scene, graph):
        if graph.mode == "RENDER":
            seen[scene.frame_current] = [evaluated(each[1], graph).copy() for each in both(cast)]

    can_render(scene)
    states().take_over_again(scene, layer())
    assert cast.rig.is_played
    bpy.app.handlers.frame_change_post.append(look)
    try:
        for frame in (3, 6):
            scene.frame_set(frame)
            bpy.ops.render.render()
            cast.assert_same()
    finally:
        bpy.app.handlers.frame_change_post.remove(look)
    cast.play()
    assert all(np.array_equal(*shapes) for shapes in seen.values())


def key_place(cast):
    """As importers do."""
    for armature, *_ in both(cast):
        armature.location, armature.rotation_euler, armature.scale = (1, 2, 3), (0.1, 0.2, 0.3), (2, 2, 2)
        for name in ("location", "rotation_euler", "scale"):
            armature.keyframe_insert(name, frame=1)
            armature.keyframe_insert(name, frame=10)
    layer().update()


def test_an_object_whose_keyframes_do_not_move_it_is_played(cast):
    key_place(cast)
    cast.take_over()
    cast.play([*FRAMES, 3])
    assert cast.rig.is_played


def move_by_hand(cast):
    for armature, *_ in both(cast):
        armature.location.x = 5


def move_a_key_of_its_place(cast):
    for armature, *_ in both(cast):
        curve = next(
            each
            for each in addon_module("blender.animation").keyed_curves(armature)
            if each.data_path == "location" and each.array_index == 2
        )
        curve.keyframe_points[1].co.y = -7
        curve.update()
        armature.animation_data.action.update_tag()


@pytest.mark.parametrize("is_seen", (True, False))
@pytest.mark.parametrize("edit", (move_by_hand, move_a_key_of_its_place))
def test_it_is_live_when_they_do(cast, edit, is_seen):
    key_place(cast)
    cast.take_over()
    cast.play([4])
    edit(cast)
    if is_seen:
        layer().update()
        cast.assert_same()
    cast.play([5, 8, 1])
    assert cast.played[0].location.x == 1
