"""Whoever reads evaluated copies sees what there would be without Sinew, but for the node group of its own modifier:
handlers of other add-ons, scripts, render engines, drivers."""

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, make_tube, pose, smoothed
from helpers import addon_module, assert_same_shape, depsgraph, is_deforming, twin_of, way

KINDS = ("attribute", "keys", "keys without an armature", "two armatures")


def make_pair(kind):
    """(bound mesh, twin), animated."""
    armature = make_armature()
    ob = make_tube() if kind == "keys without an armature" else make_mesh(armature, False)
    if "keys" in kind:
        add_shape_keys(ob)
        muted = ob.shape_key_add(name="Muted")
        muted.data[0].co.x += 1
        muted.value, muted.mute = 1, True
        smoothed(ob, iterations=2)
    if kind == "two armatures":
        smoothed(ob, "Second", "ARMATURE", object=armature)
        ob.modifiers["Second"].show_render = False
    for frame in (1, 4, 7):
        pose(armature, frame, False)
    twin = twin_of(ob)
    twin.name = "Twin"
    if "keys" in kind:
        twin.data.shape_keys.animation_data.action = ob.data.shape_keys.animation_data.action
    accelerate(ob)
    bpy.context.scene.frame_set(1)
    return ob, twin


def seen(ob, graph):
    """What can be read of an object's evaluated copy."""
    evaluated = ob.evaluated_get(graph)
    found = {}
    for modifier in evaluated.modifiers:
        if modifier.name.startswith("Sinew"):
            found_own = modifier.show_viewport, modifier.show_render
            assert found_own == (False, False)
            continue
        for name in ("show_viewport", "show_render", "use_vertex_groups", "use_bone_envelopes", "use_multi_modifier"):
            found[modifier.name, name] = getattr(modifier, name, None)
    for mode in ("PREVIEW", "RENDER"):
        found[mode] = evaluated.is_deform_modified(graph.scene, mode)
    keys = evaluated.data.shape_keys
    for key in keys.key_blocks if keys is not None else ():
        points = np.empty(3 * len(key.data), np.float32)
        key.data.foreach_get("co", points)
        found[key.name] = key.mute, key.value, key.relative_key and key.relative_key.name, points.tobytes()
    return found


def is_seen_alike(pair, graph):
    ours, theirs = (seen(ob, graph) for ob in pair)
    assert ours == theirs, [name for name in theirs if ours.get(name) != theirs[name]]
    return True


@pytest.fixture
def listen():
    """Adds handlers for a test."""
    added = []

    def add(name, handler, place):
        listed = getattr(bpy.app.handlers, name)
        listed.insert(place, handler)
        added.append((listed, handler))

    yield add
    for listed, handler in added:
        listed.remove(handler)


@pytest.mark.parametrize("kind", KINDS)
def test_handlers_and_scripts_see_what_blender_leaves(fresh_scene, listen, kind):
    pair = make_pair(kind)
    heard = set()

    def hear(name):
        def handler(_scene, graph=None):
            heard.add(name)
            problems.extend([] if is_alike(graph or bpy.context.view_layer.depsgraph) else [name])

        return handler

    problems = []

    def is_alike(graph):
        try:
            return is_seen_alike(pair, graph)
        except AssertionError as error:
            problems.append(str(error))
            return False

    for name in ("frame_change_pre", "frame_change_post", "depsgraph_update_pre", "depsgraph_update_post"):
        for place in (1, 1000):  # right behind Sinew's first one, and last
            listen(name, hear((name, place)), place)
    for frame in range(1, 9):
        fresh_scene.frame_set(frame)
        assert is_deforming(pair[0])
        assert_same_shape(*pair)
        assert is_seen_alike(pair, depsgraph())
        pair[0].location.x = pair[1].location.x = frame
        bpy.context.view_layer.update()
        assert is_seen_alike(pair, depsgraph())
    assert len(heard) == 8
    assert not problems, problems


class Engine(bpy.types.RenderEngine):
    bl_idname = "SINEW_TEST_READER"
    bl_label = "Reads"
    asked = []

    def render(self, graph):
        for ask in self.asked:
            ask(graph)


@pytest.mark.parametrize("kind", KINDS)
def test_render_engines_see_what_blender_leaves(fresh_scene, kind):
    pair = make_pair(kind)
    found = []
    bpy.utils.register_class(Engine)
    try:
        Engine.asked = [lambda graph: found.append((seen(pair[0], graph), seen(pair[1], graph)))]
        fresh_scene.render.engine = Engine.bl_idname
        fresh_scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        for frame in (3, 4, 5):
            fresh_scene.frame_set(frame)
            bpy.ops.render.render()
    finally:
        bpy.utils.unregister_class(Engine)
    assert len(found) == 3 and all(ours == theirs for ours, theirs in found)


def test_a_driver_reads_the_keys_as_they_are(fresh_scene):
    ob, _twin = make_pair("keys")
    keys = ob.data.shape_keys
    reader = bpy.data.objects.new("Reader", None)
    bpy.context.collection.objects.link(reader)
    for axis, path in enumerate(('key_blocks["Wide"].mute', 'key_blocks["Muted"].mute', 'key_blocks["Wide"].value')):
        driver = reader.driver_add("location", axis).driver
        driver.type = "SUM"
        target = driver.variables.new().targets[0]
        target.id_type, target.id, target.data_path = "KEY", keys, path
    for frame in range(1, 8):
        fresh_scene.frame_set(frame)
        assert is_deforming(ob)
        place = reader.evaluated_get(depsgraph()).location
        assert np.allclose(place, (0, 1, keys.key_blocks["Wide"].value))


def test_a_driver_that_is_given_the_key_itself_leaves_the_mesh_to_blender(fresh_scene):
    """As those of MMD's characters (SDEF), which write the points of a key on each frame."""
    ob, twin = make_pair("keys")

    def write(key, number):
        if key.mute:
            return 0.0
        points = np.zeros(3 * len(key.data), np.float32) + np.float32(number)
        key.data.foreach_set("co", points)
        return 0.5

    bpy.app.driver_namespace["write_points"] = write
    for each in (ob, twin):
        driver = each.data.shape_keys.driver_add('key_blocks["Wide"].value').driver
        driver.type, driver.use_self, driver.expression = "SCRIPTED", True, "write_points(self, frame)"
    for frame in range(1, 6):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)
        assert not is_deforming(ob)
        assert is_seen_alike((ob, twin), depsgraph())
    assert way(ob) == "BLENDER"
    reason = addon_module("run.characters").character(ob).way.reason
    assert reason == (
        'The driver of key_blocks["Wide"].value of the shape keys Key runs Python with the data itself (self), through '
        "which it may change what Sinew has read: write it without"
    )


@pytest.mark.says_errors
def test_a_lasting_error_is_not_run_into_on_each_frame(fresh_scene, monkeypatch):
    ob, twin = make_pair("keys")
    in_pass = addon_module("run.in_pass")
    prepare, tries = in_pass._prepare, []

    def fail(*arguments):
        tries.append(prepare(*arguments))
        raise ValueError("it cannot be done")

    monkeypatch.setattr(in_pass, "_prepare", fail)
    ob.update_tag()
    for frame in range(1, 41):
        fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)
    assert addon_module("run.characters").character(ob).status.error == "it cannot be done"
    assert 3 < len(tries) < 9
    before = len(tries)
    ob.update_tag()
    bpy.context.view_layer.update()
    assert len(tries) == before + 1  # an edit may have helped
    monkeypatch.undo()
    ob.update_tag()
    fresh_scene.frame_set(3)
    assert is_deforming(ob) and addon_module("run.characters").character(ob).status.error == ""


def test_a_driven_choice_that_does_not_exist_is_blenders(fresh_scene):
    ob, twin = make_pair("keys")
    for each in (ob, twin):
        driver = each.driver_add('modifiers["Corrective"].smooth_type').driver
        driver.type = "SUM"
        variable = driver.variables.new()
        variable.type = "TRANSFORMS"
        variable.targets[0].id = bpy.data.objects["Rig"]
        variable.targets[0].transform_type = "LOC_X"
    for place in (0, 1, 7, 1):
        bpy.data.objects["Rig"].location.x = place
        for frame in (2, 3):
            fresh_scene.frame_set(frame)
        assert_same_shape(ob, twin)
        assert is_deforming(ob) == (place != 7)
        assert addon_module("run.characters").character(ob).status.error == ""
