"""What drivers and keyframes set in what Sinew replaces: settings, switches and muted keys. And modifiers that are on
in the viewport alone or in renders alone. Blender's own modifiers on a twin are the judge."""

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, animate, drive, hook, make_armature, make_mesh, pose, smoothed
from helpers import (
    addon_module,
    assert_plays_without_the_addon,
    assert_same_on_all_frames,
    assert_same_shape,
    diagonal,
    end,
    evaluated,
    needs_memory,
    select,
    stages,
    twin_of,
    way,
)

BEFORE_4_1 = bpy.app.version < (4, 1, 0)
# The data-block of an evaluated object leads to its graph since Blender 4.0.
TELLS_RENDERS = bpy.app.version >= (4, 0, 0)
FRAMES = (3, 9, 4, 12, 1, 15, 8, 9, 10, 11, 12, 13, 14, 15, 16, 2, 2, 20)  # with some in a row, for the fast path


def nothing(ob):
    pass


@pytest.fixture(params=(nothing, add_shape_keys), ids=("attribute", "keys"))
def make(request, fresh_scene):
    """Function that makes (bound mesh, twin) with that done to them before binding."""

    def make(*parts, bind=True):
        armature = make_armature()
        for frame in (1, 7, 14, 20):
            pose(armature, frame, scaled=True)
        armature["amount"] = 0.0
        for frame, amount in ((1, 0.1), (10, 0.9), (20, 0.2)):
            armature["amount"] = amount
            armature.keyframe_insert('["amount"]', frame=frame)
        ob = make_mesh(armature, False)
        for part in (request.param, *parts):
            part(ob)
        twin = twin_of(ob)
        if ob.data.shape_keys:
            animation = ob.data.shape_keys.animation_data
            twin.data.shape_keys.animation_data.action = animation.action
            if hasattr(animation, "action_slot"):
                twin.data.shape_keys.animation_data.action_slot = animation.action_slot
        if bind:
            accelerate(ob)
        return ob, twin

    return make


def of(name, setting):
    return f'modifiers["{name}"].{setting}'


def by_a_bone(ob):
    smoothed(ob)
    drive(ob, of("Corrective", "factor"), "0.5 + 0.3 * sin(var)")


def by_a_bone_that_moves_no_vertex(ob):
    """The hook does not wait for it otherwise."""
    armature = bpy.data.objects["Rig"]
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    for i in range(40):  # evaluated late
        bone = armature.data.edit_bones.new(f"control{i}")
        bone.head, bone.tail = (3, 0, i), (3, 0, i + 1)
        bone.parent = armature.data.edit_bones.get(f"control{i - 1}")
    bpy.ops.object.mode_set(mode="OBJECT")
    for frame, turn in ((1, 0.0), (10, 0.4), (20, -0.3)):
        for i in range(40):
            bone = armature.pose.bones[f"control{i}"]
            bone.rotation_mode = "XYZ"
            bone.rotation_euler.x = turn / 4
            bone.keyframe_insert("rotation_euler", frame=frame)
    smoothed(ob, iterations=3)
    drive(ob, of("Corrective", "factor"), "0.5 + var / 10", bone="control39", channel="LOC_Y").variables[0].targets[
        0
    ].transform_space = "WORLD_SPACE"


def of_each_type(ob):
    smoothed(ob)
    drive(ob, of("Corrective", "iterations"), "2 + 5 * abs(var)")
    drive(ob, of("Corrective", "use_only_smooth"), "var > 0")
    drive(ob, of("Corrective", "smooth_type"), "var < 0.3")
    drive(ob, of("Corrective", "scale"), "clamp(var, -2, 1.5)")
    smoothed(ob, "Smooth", "SMOOTH", factor=0.4)
    drive(ob, of("Smooth", "factor"), "9 if var > 0.4 else -var / 8")
    drive(ob, of("Smooth", "use_y"), "var * var < 0.1")


def folded(ob):
    for number, kind in enumerate(("SUM", "AVERAGE", "MIN", "MAX")):
        modifier = smoothed(ob, kind, "SMOOTH", iterations=1 + number)
        driver = drive(ob, of(kind, "factor"), type=kind)
        other = driver.variables.new()
        other.name, other.type = "other", "TRANSFORMS"
        other.targets[0].id, other.targets[0].bone_target = bpy.data.objects["Rig"], "side"
        other.targets[0].transform_type = "SCALE_X"
        assert modifier.factor is not None


def between_two(ob):
    smoothed(ob)
    drive(ob, of("Corrective", "factor"), "0.2 + var / 20", kind="LOC_DIFF").variables[0].targets[
        1
    ].bone_target = "side"


def with_keyframes_of_its_own(ob):
    smoothed(ob)
    drive(ob, of("Corrective", "factor"), "var")
    curve = ob.animation_data.drivers.find(of("Corrective", "factor"))
    while curve.modifiers:
        curve.modifiers.remove(curve.modifiers[0])
    while curve.keyframe_points:
        curve.keyframe_points.remove(curve.keyframe_points[0])
    for x, y in ((-1, 0.1), (0, 0.9), (1, 0.3)):
        curve.keyframe_points.insert(x, y)


def of_a_hook(ob):
    hook(ob, vertex_group="bone3")
    drive(ob, of("Hook", "strength"), "0.5 + var / 4")


def of_the_armature(ob):
    ob.modifiers["Armature"].vertex_group = "bone2"
    drive(ob, of("Armature", "use_deform_preserve_volume"), "var > 0")
    drive(ob, of("Armature", "invert_vertex_group"), "var < 0.2")


def by_a_property(ob):
    smoothed(ob)
    drive(ob, of("Corrective", "factor"), kind="SINGLE_PROP")


def by_another_driver(ob):
    """Custom properties are evaluated in order."""
    ob["own"] = 0.0
    drive(ob, '["own"]', "0.1 + 0.6 * var", kind="SINGLE_PROP")
    smoothed(ob)
    drive(ob, of("Corrective", "factor"), "1 - var", kind="SINGLE_PROP", target=ob, prop='["own"]')


BY_PROPERTIES = (by_a_property, by_another_driver)
SETTINGS = (
    *(by_a_bone, by_a_bone_that_moves_no_vertex, of_each_type, folded, between_two, with_keyframes_of_its_own),
    *(of_a_hook, of_the_armature, *BY_PROPERTIES),
)


def assert_sinew_follows(ob, *names):
    entry = addon_module("run.characters").character(ob)
    assert way(ob) != "BLENDER" and stages(ob) == list(names) and end(ob) == ("", ""), (entry.way, end(ob))
    assert entry.plan.hook_of(ob).driver.is_valid


@pytest.mark.parametrize("part", SETTINGS, ids=lambda part: part.__name__)
def test_driven_settings_are_followed(fresh_scene, make, part):
    ob, twin = make(part)
    assert_same_on_all_frames(fresh_scene, ob, twin, FRAMES)
    names = [modifier.name for modifier in twin.modifiers if modifier.type != "ARMATURE"]
    if BEFORE_4_1 and part in BY_PROPERTIES:
        assert end(ob)[0] == "Corrective" and "if the custom property was removed" in end(ob)[1]
        return
    assert_sinew_follows(ob, *names)
    assert addon_module("run.characters").character(ob).is_deforming


def in_python(ob):
    smoothed(ob)
    drive(ob, of("Corrective", "factor"), "round(var, 3) ** 2")


def by_the_frame(ob):
    smoothed(ob)
    drive(ob, of("Corrective", "factor"), "frame / 20")


def noisy(ob):
    smoothed(ob)
    drive(ob, of("Corrective", "factor"))
    ob.animation_data.drivers.find(of("Corrective", "factor")).modifiers.new("NOISE")


def without_a_target(ob):
    smoothed(ob)
    drive(ob, of("Corrective", "factor")).variables[0].targets[0].id = None


@pytest.mark.says_errors
@pytest.mark.parametrize(
    "part, reason",
    [
        (in_python, "its factor is driven, and Blender runs Python for its expression"),
        (by_the_frame, "its factor is driven, and it depends on the frame: use keyframes instead"),
        (noisy, "its factor is driven, and the driver's curve has modifiers"),
        (without_a_target, "its factor is driven, and the driver is invalid"),
    ],
    ids=lambda part: getattr(part, "__name__", ""),
)
def test_other_drivers_end_the_run(fresh_scene, make, part, reason):
    ob, twin = make(part)
    assert_same_on_all_frames(fresh_scene, ob, twin, (3, 9, 4))
    assert end(ob)[0] == "Corrective" and reason in end(ob)[1] and stages(ob) == []


# --- edits of drivers -----------------------------------------------------------------------------


def another_expression(ob):
    ob.animation_data.drivers.find(of("Corrective", "factor")).driver.expression = "0.9 - var / 4"


def another_bone(ob):
    variable = ob.animation_data.drivers.find(of("Corrective", "factor")).driver.variables[0]
    variable.targets[0].bone_target = "bone4"


def another_type(ob):
    ob.animation_data.drivers.find(of("Corrective", "factor")).driver.type = "SUM"


def muted(ob):
    ob.animation_data.drivers.find(of("Corrective", "factor")).mute = True
    ob.modifiers["Corrective"].factor = 0.2


def removed(ob):
    ob.driver_remove(of("Corrective", "factor"))
    ob.modifiers["Corrective"].factor = 0.2


def one_more(ob):
    drive(ob, of("Corrective", "scale"), "1 + var / 3")


@pytest.mark.parametrize(
    "edit", (another_expression, another_bone, another_type, muted, removed, one_more), ids=lambda edit: edit.__name__
)
def test_a_driver_is_edited(fresh_scene, make, edit):
    ob, twin = make(by_a_bone)
    assert_same_on_all_frames(fresh_scene, ob, twin, (3, 4, 5))
    for each in (ob, twin):
        edit(each)
    bpy.context.view_layer.update()
    assert_same_shape(ob, twin)
    assert_same_on_all_frames(fresh_scene, ob, twin, (6, 9, 4, 5, 6, 7))
    assert_sinew_follows(ob, "Corrective")


@pytest.mark.says_errors
def test_what_a_driver_reads_is_removed(fresh_scene, make):
    ob, twin = make(by_a_property if not BEFORE_4_1 else by_a_bone)
    armature = ob.modifiers["Armature"].object
    assert_same_on_all_frames(fresh_scene, ob, twin, (3, 4, 5))
    del armature["amount"]
    armature.update_tag()
    assert_same_on_all_frames(fresh_scene, ob, twin, (6, 9, 4, 5))
    armature["amount"] = 0.7
    for each in (ob, twin):
        for curve in each.animation_data.drivers:
            curve.driver.is_valid = True
        each.update_tag()
    assert_same_on_all_frames(fresh_scene, ob, twin, (6, 9, 4, 5))


@pytest.mark.says_errors
def test_the_object_that_a_driver_reads_is_deleted(fresh_scene, make):
    def by_an_object(ob):
        smoothed(ob)
        target = bpy.data.objects.get("Control") or bpy.data.objects.new("Control", None)
        if not target.users_collection:
            bpy.context.collection.objects.link(target)
            animate_place(target)
        drive(ob, of("Corrective", "factor"), "var", channel="LOC_X", target=target, bone="")

    ob, twin = make(by_an_object)
    assert_same_on_all_frames(fresh_scene, ob, twin, (3, 4, 5))
    assert_sinew_follows(ob, "Corrective")
    bpy.data.objects.remove(bpy.data.objects["Control"])
    assert_same_on_all_frames(fresh_scene, ob, twin, (6, 9, 4, 5))
    assert way(ob) != "BLENDER" and addon_module("run.characters").character(ob).is_deforming


def animate_place(ob):
    for frame, x in ((1, 0.1), (10, 0.9), (20, 0.3)):
        ob.location.x = x
        ob.keyframe_insert("location", frame=frame)


def test_a_driver_of_another_setting_of_the_same_object_makes_no_cycle(fresh_scene, make, capfd):
    def by_its_own(ob):
        smoothed(ob)
        smoothed(ob, "Other", "SMOOTH")
        animate(ob.modifiers["Other"], factor=(0.1, 0.9))
        drive(ob, of("Corrective", "factor"), kind="SINGLE_PROP", target=ob, prop=of("Other", "factor"))

    ob, twin = make(by_its_own)
    assert_same_on_all_frames(fresh_scene, ob, twin, FRAMES)
    out, err = capfd.readouterr()
    assert "cycle" not in (out + err).lower()


# --- switches -------------------------------------------------------------------------------------


def keyed(ob, name, **at):
    """Switches of that modifier by keyframes: at={"show_viewport": {frame: value}}."""
    for setting, values in at.items():
        for frame, value in values.items():
            setattr(ob.modifiers[name], setting, value)
            ob.keyframe_insert(of(name, setting), frame=frame)


BLINKS = {1: True, 5: False, 8: True, 11: False, 14: True}


def armature_by_keyframes(ob):
    smoothed(ob)
    keyed(ob, "Armature", show_viewport=BLINKS, show_render=BLINKS)


def armature_by_a_driver(ob):
    for setting in ("show_viewport", "show_render"):
        drive(ob, of("Armature", setting), "var > 0.4", kind="SINGLE_PROP")


def stage_by_keyframes(ob):
    smoothed(ob)
    smoothed(ob, "Smooth", "SMOOTH", iterations=3)
    keyed(ob, "Corrective", show_viewport=BLINKS, show_render=BLINKS)


def stage_by_a_bone(ob):
    smoothed(ob)
    smoothed(ob, "Smooth", "SMOOTH", iterations=3)
    for setting in ("show_viewport", "show_render"):
        drive(ob, of("Corrective", setting), "var > 0")


def all_at_once(ob):
    smoothed(ob)
    for name in ("Armature", "Corrective"):
        keyed(ob, name, show_viewport=BLINKS, show_render=BLINKS)


def each_by_its_own(ob):
    smoothed(ob)
    keyed(ob, "Armature", show_viewport=BLINKS, show_render=BLINKS)
    for setting in ("show_viewport", "show_render"):
        drive(ob, of("Corrective", setting), "var < 0")


SWITCHES = (
    armature_by_keyframes,
    armature_by_a_driver,
    stage_by_keyframes,
    stage_by_a_bone,
    all_at_once,
    each_by_its_own,
)


@pytest.mark.parametrize("part", SWITCHES, ids=lambda part: part.__name__)
def test_switches_are_followed(fresh_scene, make, part):
    ob, twin = make(part)
    assert_same_on_all_frames(fresh_scene, ob, twin, FRAMES)
    assert_sinew_follows(ob, *[each.name for each in twin.modifiers if each.type != "ARMATURE"])


@pytest.mark.parametrize("part", SWITCHES, ids=lambda part: part.__name__)
def test_switches_and_edits(fresh_scene, make, part):
    """A bone that is posed by hand has the hook called without the keyframes: what they last set still holds."""
    ob, twin = make(part)
    armature = ob.modifiers["Armature"].object
    for frame in (3, 6, 12, 15, 9):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)
        for turn in (0.1, -0.2, 0.3):
            armature.pose.bones["bone3"].rotation_quaternion.x += turn
            bpy.context.view_layer.update()
            assert_same_shape(ob, twin)
        for each in (ob, twin):
            each.vertex_groups["bone2"].add(range(frame, 1200, 7), 0.4, "REPLACE")
            each.data.update()
        bpy.context.view_layer.update()
        assert_same_shape(ob, twin)


@pytest.mark.parametrize("later", (armature_by_keyframes, armature_by_a_driver, stage_by_a_bone))
def test_switches_that_are_animated_later(fresh_scene, make, later):
    ob, twin = make()
    assert_same_on_all_frames(fresh_scene, ob, twin, (2, 3, 4, 5))
    for each in (ob, twin):
        later(each)
    assert_same_on_all_frames(fresh_scene, ob, twin, FRAMES)
    assert way(ob) != "BLENDER"


def test_a_mix_whose_parts_are_switched(fresh_scene, make):
    def two(ob):
        second = smoothed(ob, "Second", "ARMATURE", object=bpy.data.objects["Rig"], use_multi_modifier=True)
        second.vertex_group, second.use_deform_preserve_volume = "bone2", True
        keyed(ob, "Armature", show_viewport={1: True, 6: False, 10: True}, show_render={1: True, 6: False, 10: True})
        keyed(ob, "Second", show_viewport={1: True, 3: False, 5: True}, show_render={1: True, 3: False, 5: True})

    ob, twin = make(two)
    for name in ("Armature", "Second"):
        assert ob.modifiers.find(name) >= 0
    assert_same_on_all_frames(fresh_scene, ob, twin, FRAMES)
    assert_sinew_follows(ob)


# --- muted keys -----------------------------------------------------------------------------------


def muted_by_keyframes(ob):
    for frame, is_muted in ((1, False), (4, True), (9, False), (13, True)):
        block = ob.data.shape_keys.key_blocks["Bumpy"]
        block.mute = is_muted
        block.keyframe_insert("mute", frame=frame)


def muted_by_a_driver(ob):
    drive(ob.data.shape_keys, 'key_blocks["Bumpy"].mute', "var > 0")


def muted_by_the_user(ob):
    ob.data.shape_keys.key_blocks["Bumpy"].mute = True


@pytest.mark.parametrize(
    "part", (muted_by_keyframes, muted_by_a_driver, muted_by_the_user), ids=lambda part: part.__name__
)
@pytest.mark.parametrize("behind", (nothing, smoothed), ids=("", "smoothed"))
def test_muted_keys_are_followed(fresh_scene, make, part, behind):
    def with_keys(ob):
        if not ob.data.shape_keys:
            add_shape_keys(ob)
        part(ob)

    ob, twin = make(with_keys, behind)
    assert_same_on_all_frames(fresh_scene, ob, twin, FRAMES)
    armature = ob.modifiers["Armature"].object
    for frame in (3, 6, 10):
        fresh_scene.frame_set(frame)
        for turn in (0.1, -0.2):
            armature.pose.bones["bone3"].rotation_quaternion.x += turn
            bpy.context.view_layer.update()
            assert_same_shape(ob, twin)
    assert way(ob) == "KEYS"
    keys = ob.data.shape_keys.key_blocks
    assert [key.relative_key.name for key in keys] == ["Basis", "Basis", "Wide"]
    select(ob)
    assert bpy.ops.object.sinew_unbind() == {"FINISHED"}
    assert_same_on_all_frames(fresh_scene, ob, twin, (3, 10))


def muted_by_curves_alone(ob):
    """Without an edit of the key or the object."""
    keys = ob.data.shape_keys
    keys.key_blocks["Bumpy"].keyframe_insert("mute", frame=1)
    curve = addon_module("blender.animation").find_curve(keys, 'key_blocks["Bumpy"].mute')
    for frame, is_muted in ((4, True), (9, False), (13, True)):
        curve.keyframe_points.insert(frame, is_muted)


@pytest.mark.parametrize(
    "part", (muted_by_keyframes, muted_by_curves_alone, muted_by_a_driver), ids=lambda part: part.__name__
)
def test_keys_that_are_muted_later(fresh_scene, make, part):
    """And no longer at the end."""
    ob, twin = make()
    if ob.data.shape_keys is None:
        pytest.skip("it has no shape keys")
    twin.data.shape_keys.animation_data.action = ob.data.shape_keys.animation_data.action.copy()
    assert_same_on_all_frames(fresh_scene, ob, twin, (2, 3, 4, 5))
    for each in (ob, twin):
        part(each)
    bpy.context.view_layer.update()
    assert_same_on_all_frames(fresh_scene, ob, twin, FRAMES)
    for each in (ob, twin):
        each.data.shape_keys.animation_data_clear()
        each.data.shape_keys.key_blocks["Bumpy"].mute = False
    assert_same_on_all_frames(fresh_scene, ob, twin, (3, 4, 5, 6))
    ob.data.shape_keys.key_blocks["Bumpy"].mute = twin.data.shape_keys.key_blocks["Bumpy"].mute = True
    assert_same_on_all_frames(fresh_scene, ob, twin, (3, 4))
    assert way(ob) == "KEYS"


# --- viewport and renders ---------------------------------------------------------------------------


class Look(bpy.types.RenderEngine):
    """Renders nothing, but keeps the shapes of objects."""

    bl_idname, bl_label = "SINEW_LOOK", "Look"
    names, shapes = (), {}

    def render(self, depsgraph):
        for name in self.names:
            ob = depsgraph.scene.objects[name].evaluated_get(depsgraph)
            positions = np.empty(3 * len(ob.data.vertices), np.float32)
            ob.data.vertices.foreach_get("co", positions)
            self.shapes[name] = positions.reshape(-1, 3)


@pytest.fixture
def rendered(fresh_scene):
    """Function that returns the shapes of two objects in a render of the current frame."""
    bpy.utils.register_class(Look)

    def rendered(*objects):
        fresh_scene.render.engine = Look.bl_idname
        fresh_scene.render.resolution_x = fresh_scene.render.resolution_y = 8
        if fresh_scene.camera is None:
            fresh_scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
            fresh_scene.collection.objects.link(fresh_scene.camera)
        Look.names, Look.shapes = [ob.name for ob in objects], {}
        bpy.ops.render.render()
        return [Look.shapes[ob.name] for ob in objects]

    yield rendered
    bpy.utils.unregister_class(Look)


def render_smoothing(ob):
    smoothed(ob)
    smoothed(ob, "Render", show_viewport=False, iterations=9)
    smoothed(ob, "Smooth", "SMOOTH", iterations=2)


def viewport_smoothing(ob):
    smoothed(ob, "View", "SMOOTH", show_render=False, iterations=4)
    smoothed(ob)


def viewport_armature(ob):
    ob.modifiers["Armature"].show_render = False
    smoothed(ob)


def render_armature(ob):
    ob.modifiers["Armature"].show_viewport = False


def driven_in_renders(ob):
    smoothed(ob)
    drive(ob, of("Corrective", "show_render"), "var > 0")
    keyed(ob, "Armature", show_render={1: True, 5: False, 9: True})


@pytest.mark.parametrize(
    "part",
    (render_smoothing, viewport_smoothing, viewport_armature, render_armature, driven_in_renders),
    ids=lambda part: part.__name__,
)
def test_what_is_on_in_only_one_of_viewport_and_renders(fresh_scene, make, rendered, part):
    ob, twin = make(part)
    assert_same_on_all_frames(fresh_scene, ob, twin, (1, 4, 5))
    for frame in (3, 6, 12):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)
        ours, theirs = rendered(ob, twin)
        assert np.abs(ours - theirs).max() < 1e-5 * diagonal(theirs)
        assert_same_shape(ob, twin)
        assert_same_on_all_frames(fresh_scene, ob, twin, (frame + 1, frame + 2))
    if TELLS_RENDERS:
        assert_sinew_follows(ob, *[each.name for each in twin.modifiers if each.type != "ARMATURE"])


@needs_memory
def test_graphs_tell_what_they_are_for(fresh_scene, make, rendered):
    evaluations = addon_module("host.evaluations")
    ob, twin = make()
    fresh_scene.frame_set(3)
    assert evaluations.is_mode_known() == TELLS_RENDERS
    graph = bpy.context.evaluated_depsgraph_get()
    assert evaluations.is_render(ob.evaluated_get(graph)) is (False if TELLS_RENDERS else None)
    told = []

    def tell(scene, depsgraph):
        told.append((depsgraph.mode, evaluations.is_render(ob.evaluated_get(depsgraph))))

    bpy.app.handlers.frame_change_post.append(tell)
    try:
        rendered(ob, twin)
    finally:
        bpy.app.handlers.frame_change_post.remove(tell)
    assert told and {mode for mode, _ in told} >= {"RENDER"}
    if TELLS_RENDERS:
        assert all((mode == "RENDER") is is_render for mode, is_render in told)


# --- files, undo, outputs -------------------------------------------------------------------------


def all_of_it(ob):
    smoothed(ob)
    drive(ob, of("Corrective", "factor"), "0.5 + 0.3 * sin(var)")
    drive(ob, of("Corrective", "show_viewport"), "var < 0.3")
    keyed(ob, "Armature", show_viewport={1: True, 5: False, 7: True})


def test_saved_and_opened(fresh_scene, make, tmp_path):
    ob, twin = make(all_of_it)
    names, path = (ob.name, twin.name), tmp_path / "saved.blend"
    fresh_scene.frame_set(6)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path))
    ob, twin = (bpy.data.objects[name] for name in names)
    bpy.context.view_layer.update()
    assert_same_shape(ob, twin)
    assert_same_on_all_frames(bpy.context.scene, ob, twin, FRAMES)
    assert_sinew_follows(ob, "Corrective")


def test_it_plays_without_the_addon(fresh_scene, make, tmp_path):
    ob, twin = make(all_of_it)
    fresh_scene.frame_set(6)
    assert_plays_without_the_addon(tmp_path, ob, twin)


def test_undone(fresh_scene, make):
    ob, twin = make(all_of_it)
    names = ob.name, twin.name
    fresh_scene.frame_set(3)
    bpy.ops.ed.undo_push(message="before")
    for each in (ob, twin):
        another_expression(each)
    bpy.ops.ed.undo_push(message="after")
    fresh_scene.frame_set(4)
    for step in (bpy.ops.ed.undo, bpy.ops.ed.redo, bpy.ops.ed.undo):
        step()
        ob, twin = (bpy.data.objects[name] for name in names)
        bpy.context.view_layer.update()
        assert_same_on_all_frames(bpy.context.scene, ob, twin, (3, 6, 9, 10, 11, 12))


@needs_memory
def test_the_other_output(fresh_scene, make):
    ob, twin = make(all_of_it)
    ob.sinew.output = "MESH"
    fresh_scene.frame_set(2)
    copy = ob.sinew.deformed
    for frame in FRAMES:
        fresh_scene.frame_set(frame)
        shape, theirs = addon_module("blender.meshes").read_positions(copy.data), evaluated(twin)
        is_off = not twin.evaluated_get(bpy.context.evaluated_depsgraph_get()).modifiers["Armature"].show_viewport
        assert np.abs(shape - theirs).max() < 1e-5 * diagonal(theirs) or is_off and ob.data.shape_keys, frame


def test_unbound_and_bound_again(fresh_scene, make):
    ob, twin = make(all_of_it)
    fresh_scene.frame_set(3)
    select(ob)
    assert bpy.ops.object.sinew_unbind() == {"FINISHED"}
    assert_same_on_all_frames(fresh_scene, ob, twin, (6, 9, 4))
    accelerate(ob)
    assert_same_on_all_frames(fresh_scene, ob, twin, FRAMES)
    assert_sinew_follows(ob, "Corrective")
