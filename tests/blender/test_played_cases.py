"""Played characters in less usual scenes, and between taking over and handing back: edits, undo, other handlers and
errors. A live twin shows what is right."""

import bpy
import pytest

from characters import make_armature
from helpers import addon_module, depsgraph, evaluated, needs_memory, select
from test_played import FRAMES, layer, opened_cast, recorded, states
from test_played_who import both, drive_keys

pytestmark = needs_memory


@pytest.fixture
def cast():
    return opened_cast(last=10)


def fcurves(armature):
    return addon_module("blender.animation").action_curves(armature.animation_data.action)


def state(name):
    return recorded().State[name]


# --- unusual scenes -------------------------------------------------------------------------------


@pytest.mark.usefixtures("no_program")
@pytest.mark.parametrize("what", ["layer", "scene", "armature", "bone"])
def test_renaming(cast, what):
    cast.take_over()
    cast.scene.frame_set(5)
    if what == "layer":
        layer().name = "Other"
    elif what == "scene":
        cast.scene.name = "Other"
    elif what == "armature":
        cast.played[0].name = "Other"
    else:
        for armature, *_ in both(cast):
            armature.pose.bones["bone2"].name = "Other"
    layer().update()
    cast.assert_same()
    assert cast.rig.is_played == (what in {"layer", "scene"})
    cast.play()
    states().take_over([cast.rig], cast.scene, layer())
    assert cast.rig.is_played, cast.rig.reason
    cast.play()


def test_objects_that_are_only_instanced(cast):
    """Nothing of the character is in the scene itself."""
    hidden = bpy.data.collections.new("Hidden")
    for ob in (*cast.played, *cast.live):
        hidden.objects.link(ob)
        cast.scene.collection.objects.unlink(ob)
    empty = bpy.data.objects.new("Instances", None)
    cast.scene.collection.objects.link(empty)
    empty.instance_type, empty.instance_collection = "COLLECTION", hidden
    layer().update()
    cast.take_over()
    shapes = cast.play([*FRAMES, 3])
    assert cast.rig.is_played and shapes.std(axis=0).max() > 0.01
    select(empty)
    assert bpy.ops.object.sinew_record() == {"FINISHED"}


def by_nodes(armature, kind, path):
    """A mesh object that a node with an armature as its input makes."""
    tree = bpy.data.node_groups.new("Reader", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    node = tree.nodes.new(kind)
    node.inputs[0].default_value = armature
    if path:
        node.inputs[1].default_value = path
    if hasattr(node, "transform_space"):
        node.transform_space = "RELATIVE"
    mesh = tree.nodes.new("GeometryNodeMeshCube")
    place = tree.nodes.new("GeometryNodeTransform")
    matrix = next(each for each in node.outputs if each.type == "MATRIX")
    next(each for each in place.inputs if each.name == "Mode").default_value = "Matrix"
    tree.links.new(mesh.outputs[0], place.inputs[0])
    tree.links.new(matrix, next(each for each in place.inputs if each.type == "MATRIX"))
    tree.links.new(place.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    ob = bpy.data.objects.new("Reader", bpy.data.meshes.new("Reader"))
    bpy.context.scene.collection.objects.link(ob)
    ob.modifiers.new("Reader", "NODES").node_group = tree
    return ob


@pytest.mark.skipif(not hasattr(bpy.types, "GeometryNodeBoneInfo"), reason="this Blender has no such node")
def test_nodes_that_read_bones(cast):
    readers = [by_nodes(armature, "GeometryNodeBoneInfo", "bone3") for armature, *_ in both(cast)]
    layer().update()
    cast.take_over()
    seen = set()
    for frame in (1, 4, 8, 2):
        cast.scene.frame_set(frame)
        ours, theirs = (evaluated(each) for each in readers)
        assert (ours == theirs).all()
        seen.add(float(ours[0, 0]))
    assert len(seen) == 4
    assert cast.rig.is_played


@pytest.mark.parametrize("tempo", [(100, 50), (100, 200)])
def test_a_scene_that_plays_at_another_speed(cast, tempo):
    cast.scene.render.frame_map_old, cast.scene.render.frame_map_new = tempo
    cast.take_over()
    shapes = cast.play()
    assert cast.rig.is_played and shapes.std(axis=0).max() > 0.01
    cast.scene.render.frame_map_new = 100
    cast.play()
    assert not cast.rig.is_played
    cast.take_over()


def test_an_armature_that_follows_animated_objects_is_computed(cast):
    for armature, *_ in both(cast):
        armature.animation_data_clear()
    cast.follow_keyed_object("bone2")
    cast.play([1, 5])
    states().take_over([cast.rig], cast.scene, layer())
    if addon_module("description.reading").CAN_READ:
        assert cast.rig.is_played
    else:
        assert "bones of Rig follow Marker, outside of it" in cast.rig.reason
    cast.play([2, 9])


def aimed(bones, aim):
    bones["side"].constraints.new("DAMPED_TRACK").target = aim


def poled(bones, aim):
    constraint = bones["bone4"].constraints.new("IK")
    constraint.target, constraint.pole_target, constraint.chain_count = aim.parent, aim, 2


def guided(bones, aim):
    bones["side"].constraints.new("SHRINKWRAP").target = aim


def led(bones, aim):
    target = bones["side"].constraints.new("ARMATURE").targets.new()
    target.target, target.subtarget = aim, "bone1"


def empty():
    return bpy.data.objects.new("Empty", None)


def guide():
    mesh = bpy.data.meshes.new("Guide")
    mesh.from_pydata([(-2, -2, 0.5), (2, -2, 0), (0, 2, 0.2)], [], [(0, 1, 2)])
    return bpy.data.objects.new("Guide", mesh)


def modified_guide():
    ob = guide()
    ob.modifiers.new("Cast", "CAST")
    return ob


def leader():
    armature = make_armature()
    armature.name = "Leader"
    bpy.context.scene.collection.objects.unlink(armature)
    armature.pose.bones["bone1"].location.x = 0.3
    return armature


def hang(cast, follow, make, bone):
    """Has a bone of each character follow a new object, which hangs on one of its bones. Returns the objects."""
    aims = []
    for armature, *_ in both(cast):
        aim, holder = make(), bpy.data.objects.new("Holder", None)
        for each in (aim, holder):
            cast.scene.collection.objects.link(each)
        holder.parent, holder.parent_type, holder.parent_bone = armature, "BONE", bone
        aim.parent, aim.location.x = holder, 1.0
        follow(armature.pose.bones, aim)
        aims.append(aim)
    select()
    layer().update()
    return aims


@pytest.mark.parametrize(
    "follow, make, reason",
    [
        (guided, modified_guide, "bones of Rig follow Guide, outside of it, which may move"),
        (led, leader, "Rig follows bones of Leader"),
    ],
)
def test_bones_that_follow_what_may_move_on_the_same_armature(cast, follow, make, reason):
    hang(cast, follow, make, "bone4")
    cast.record()
    states().take_over([cast.rig], cast.scene, layer())
    assert cast.rig.reason.startswith(reason) and not cast.rig.is_played
    cast.play()


@pytest.mark.parametrize(
    "follow, make, bone", [(aimed, empty, "bone4"), (poled, empty, "bone0"), (guided, guide, "bone4")]
)
def test_bones_that_follow_what_hangs_on_the_same_armature(cast, follow, make, bone):
    aims = hang(cast, follow, make, bone)
    cast.take_over()
    for _ in range(2):
        for frame in FRAMES:
            cast.scene.frame_set(frame)
            cast.assert_same()
            assert cast.rig.is_played
            ours, theirs = (aim.evaluated_get(depsgraph()).matrix_world for aim in aims)
            assert ours == theirs
    for aim in aims:
        aim.location.x = 3.0
    layer().update()
    cast.assert_same()
    cast.play()
    for aim in aims:
        aim.location.y = 1.0
    cast.play()


def test_an_armature_that_knows_its_scene(cast):
    """As add-ons have it. Selecting edits the scene."""
    cast.played[0]["scene"] = cast.scene
    cast.take_over()
    select(cast.live[0])
    layer().update()
    cast.play()
    assert cast.rig.is_played


# --- between taking over and handing back -----------------------------------------------------------------


def test_a_bone_that_a_script_sets_and_keys_on_another_frame(cast):
    cast.take_over()
    cast.scene.frame_set(3)
    for armature, *_ in both(cast):
        bone = armature.pose.bones["bone1"]
        bone.location.z += 0.7
        bone.keyframe_insert("location", frame=8)
    layer().update()
    cast.assert_same()
    cast.play([8, 7, 3])
    cast.play()


def test_a_driven_key_that_is_removed(cast):
    for armature, ob, *_ in both(cast):
        drive_keys(armature, ob)
    layer().update()
    cast.take_over()
    cast.scene.frame_set(5)
    for _, ob, *_ in both(cast):
        wide = ob.data.shape_keys.key_blocks["Wide"]
        wide.driver_remove("value")  # or else Blender 5.2 evaluates it although it is gone
        ob.shape_key_remove(wide)
    layer().update()
    cast.assert_same()
    cast.play()
    for _, ob, *_ in both(cast):
        ob.shape_key_clear()
    cast.play()
    states().take_over([cast.rig], cast.scene, layer())
    cast.play()


def test_weights_can_be_edited_while_bones_drive_keys(cast):
    for armature, ob, *_ in both(cast):
        drive_keys(armature, ob)
    layer().update()
    cast.take_over()
    for _, ob, *_ in both(cast):
        ob.vertex_groups["bone1"].add(range(200), 0.7, "REPLACE")
        ob.data.update()
    layer().update()
    cast.assert_same()
    assert cast.rig.is_played
    cast.play()
    assert cast.rig.is_played


@pytest.mark.usefixtures("no_program")
def test_a_handler_that_sets_a_frame_that_is_not_recorded_while_it_takes_over(cast):
    def jump(scene, *_):
        if scene.frame_current != 40:
            scene.frame_set(40)

    cast.record()
    bpy.app.handlers.depsgraph_update_post.append(jump)
    try:
        states().take_over([cast.rig], cast.scene, layer())
    finally:
        bpy.app.handlers.depsgraph_update_post.remove(jump)
    layer().update()
    cast.assert_same()
    assert not cast.rig.is_played and cast.rig.reason
    cast.play()


@pytest.mark.usefixtures("no_program")
def test_take_over_right_after_an_edit_plays_what_is_missing(cast):
    cast.record()
    cast.scene.frame_set(4)
    for armature, *_ in both(cast):
        armature.pose.bones["bone2"].constraints.new("LIMIT_SCALE").use_max_x = True
    select(cast.played[0])
    assert bpy.ops.object.sinew_record() == {"FINISHED"}
    assert cast.rig.is_played and cast.rig.motion.record.runs() == [(1, 10)] and cast.scene.frame_current == 4
    select()
    cast.play()


def test_take_over_plays_the_current_frame_outside_the_range(cast):
    cast.scene.frame_set(30)
    select(cast.played[0])
    assert bpy.ops.object.sinew_record() == {"FINISHED"}
    assert cast.rig.is_played and cast.scene.frame_current == 30


def test_take_over_does_not_lose_a_pose_that_is_not_keyed(cast):
    cast.record()
    for armature, *_ in both(cast):
        armature.pose.bones["bone1"].location.x += 2
    select(cast.played[0])
    with pytest.raises(RuntimeError, match=r'changes that are not keyed \(bone "bone1"\)'):
        bpy.ops.object.sinew_record()
    cast.assert_same()


def test_after_undo_nobody_is_told_of_changes_that_are_not_keyed(cast):
    cast.record()
    bpy.ops.ed.undo_push(message="before")
    cast.take_over()
    cast.scene.frame_set(6)
    bpy.ops.ed.undo_push(message="a frame")
    cast.played[3].location.x = 1
    bpy.ops.ed.undo_push(message="moved")
    cast.undo()
    cast.assert_same()
    select(cast.played[0])
    assert bpy.ops.object.sinew_record() == {"FINISHED"}
    assert cast.rig.is_played, cast.rig.reason
    select()
    cast.play()


def test_the_record_outlives_undo_of_something_else(cast):
    light = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    cast.scene.collection.objects.link(light)
    cast.record()
    for _ in range(2):  # Blender reads what was edited since the step before again
        bpy.ops.ed.undo_push(message="before")
    light.location.x = 3
    bpy.ops.ed.undo_push(message="moved")
    cast.undo()
    cast.play([5])
    assert cast.rig.motion.record.runs() == [(1, 10)]
    cast.play()


def test_undo_of_an_edit_of_the_armature_drops_its_record(cast):
    bpy.ops.ed.undo_push(message="before")
    for armature, *_ in both(cast):
        armature.pose.bones["bone3"].constraints.new("LIMIT_LOCATION").use_max_x = True
        armature.pose.bones["bone3"].constraints[0].owner_space = "LOCAL"
    layer().update()
    bpy.ops.ed.undo_push(message="constrained")
    cast.take_over()
    cast.undo()
    cast.play()
    cast.take_over()
    cast.play()


@pytest.mark.usefixtures("no_program")
def test_taking_over_again_and_again_parses_one_expression(cast, monkeypatch):
    relations, found = addon_module("host.relations"), []
    parsed = relations._parsed
    monkeypatch.setattr(relations, "_parsed", lambda *given: found.append(parsed(*given)) or found[-1])
    for _ in range(4):
        cast.take_over()
        cast.hand_back()
    assert len(found) > 2 and len(set(found)) == 1


# --- an edit of one costs the others nothing ------------------------------------------------------


@pytest.fixture
def reads(monkeypatch):
    """Counts how many actions are read."""
    module, found = addon_module("host.keyframes"), []
    read = module.read
    monkeypatch.setattr(module, "read", lambda curves: found.append(len(curves)) or read(curves))
    return found


@pytest.mark.usefixtures("no_program")
def test_another_action_is_no_reason_to_compare(cast, reads):
    cast.take_over()
    cast.play([4])
    reads.clear()
    curve = fcurves(cast.live[0])[0]
    for _ in range(3):
        curve.keyframe_points[1].co.y += 0.1
        curve.update()
        layer().update()
    assert cast.rig.is_played and reads == []
    curve = fcurves(cast.played[0])[0]
    curve.keyframe_points[1].co.y += 0.3
    curve.update()
    layer().update()
    assert len(reads) == 1


@pytest.mark.usefixtures("no_program")
def test_a_handler_that_has_blender_evaluate_after_each_frame(cast, reads):
    def update(scene, *_):
        scene.view_layers[0].update()

    recorded().learn(cast.live[0])  # stays live
    cast.take_over()
    reads.clear()
    for place in (0, len(bpy.app.handlers.frame_change_post) + 1):
        bpy.app.handlers.frame_change_post.insert(place, update)
        try:
            cast.play()
        finally:
            bpy.app.handlers.frame_change_post.remove(update)
        assert cast.rig.is_played and cast.rig.motion.record.runs() == [(1, 10)]
        assert recorded().get(cast.live[0]).motion.record.runs() == [(1, 10)]
    assert reads == []


def test_posing_another_hands_back_nobody(cast):
    cast.take_over()
    for frame in FRAMES:
        cast.live[0].pose.bones["bone1"].location.x = frame
        cast.scene.frame_set(frame)
        assert cast.rig.is_played


@pytest.mark.usefixtures("no_program")
def test_one_that_is_edited_on_each_frame_is_not_recorded(cast):
    """What it depends on would be found again on each frame."""
    count = 0

    def edit(scene, *_):
        for armature, *_ in both(cast):
            armature.pose.bones["side"].rotation_mode = "XYZ" if scene.frame_current % 2 else "QUATERNION"

    dependencies = addon_module("blender.dependencies")
    used = dependencies.used

    def counted(*arguments):
        nonlocal count
        count += 1
        return used(*arguments)

    cast.rig  # noqa: B018
    bpy.app.handlers.frame_change_pre.append(edit)
    dependencies.used = counted
    try:
        for _ in range(4):
            cast.play()
        assert count < 20
        states().take_over([cast.rig], cast.scene, layer())
        assert "is edited on each frame: switch off" in cast.rig.reason
        cast.play()
    finally:
        dependencies.used = used
        bpy.app.handlers.frame_change_pre.remove(edit)
    select(cast.played[0])
    assert bpy.ops.object.sinew_record() == {"FINISHED"}
    select()
    cast.play()


@pytest.mark.usefixtures("no_program")
def test_an_edit_after_blender_has_built_relations_on_a_new_frame(cast):
    """It evaluates twice then, and calls handlers only after the first time."""
    cast.take_over()
    cast.scene.frame_set(1)
    cast.scene.collection.objects.link(bpy.data.objects.new("New", None))
    cast.scene.frame_set(5)
    assert not cast.rig.is_played
    assert cast.rig.motion.record.runs() == [(1, 10)]
    for armature, *_ in both(cast):
        armature.pose.bones["side"].lock_location[0] = True  # which makes no difference, but Blender copies it again
    layer().update()
    assert len(cast.rig.motion.record) <= 1
    states().take_over([cast.rig], cast.scene, layer())
    cast.play()


# --- states ---------------------------------------------------------------------------------------


@pytest.mark.usefixtures("no_program")
def test_the_states(cast):
    rig = cast.rig
    assert rig.state is state("LIVE")
    states().take_over([rig], cast.scene, layer())
    assert rig.state is state("WANTED") and "is not recorded" in rig.reason
    cast.play()
    states().take_over_again(cast.scene, layer())
    assert rig.state is state("PLAYED")
    select(cast.played[0])
    layer().update()
    assert rig.state is state("SUSPECT")
    cast.assert_same()
    layer().update()
    cast.scene.frame_set(3)
    assert rig.state is state("WANTED")
    select()
    layer().update()
    states().take_over_again(cast.scene, layer())
    assert rig.state is state("PLAYED")
    cast.hand_back()
    assert rig.state is state("LIVE")
    cast.play()


@pytest.mark.says_errors
@pytest.mark.parametrize("place", ["without_animation", "on_each_frame", "build", "type_again", "show"])
def test_an_error_half_way_leaves_a_state(cast, place, monkeypatch):
    relations = addon_module("host.relations")
    cast.record()
    cast.scene.frame_set(6)

    def fail(*_):
        raise ZeroDivisionError

    owner = relations if place == "type_again" else recorded() if place == "show" else relations.Rebuilding
    if place == "show":  # so that a pose has to be written
        monkeypatch.setattr(recorded(), "shows", lambda *_: False)
        for name in ("why_live", "_drop_what_is_wrong"):
            monkeypatch.setattr(addon_module("played.reasons"), name, lambda *_: "")
    monkeypatch.setattr(owner, place, fail)
    with pytest.raises(ZeroDivisionError):
        states().take_over([cast.rig], cast.scene, layer())
    monkeypatch.undo()
    assert cast.rig.state is state("PLAYED" if place == "show" else "SUSPECT")
    cast.play()
    states().take_over([cast.rig], cast.scene, layer())
    assert cast.rig.is_played, cast.rig.reason
    cast.play()


@pytest.mark.usefixtures("no_program")
def test_while_the_scene_plays_those_take_over_again_that_were_handed_back_with_another(cast):
    rigs = [recorded().learn(each[0]) for each in both(cast)]
    cast.play()
    states().take_over(rigs, cast.scene, layer())
    select(cast.live[0])
    layer().update()
    cast.scene.frame_set(4)
    assert [rig.state for rig in rigs] == [state("WANTED")] * 2
    states().take_over_again(cast.scene, layer(), is_playing=True)
    assert [rig.is_played for rig in rigs] == [True, False]
    cast.play()
    cast.scene.frame_set(20)
    cast.scene.frame_set(2)
    states().take_over_again(cast.scene, layer(), is_playing=True)
    assert not rigs[0].is_played and "frame 20" in rigs[0].reason
