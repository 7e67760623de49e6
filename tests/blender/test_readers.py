"""Whoever reads evaluated copies sees what there would be without Sinew, but for the node group of its own modifier:
handlers of other add-ons, scripts, render engines, drivers."""

import contextlib
import itertools
import re
from collections import Counter

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, make_tube, pose, smoothed
from helpers import (
    addon_module,
    assert_same_shape,
    depsgraph,
    diagonal,
    evaluated,
    is_deforming,
    needs_memory,
    twin_of,
    way,
)

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
    ours, theirs = (evaluated(ob, graph) for ob in pair)
    assert np.abs(ours - theirs).max() < 1e-5 * diagonal(theirs), "another shape"
    return True


# --- at each callback that Blender has ----------------------------------------------------------------

# They take a window, a headset, or the end of the file or of Blender, before which nothing is left to be read.
NOT_HERE = re.compile("_|annotation_|composite_|object_bake_|load_factory_|exit_pre|xr_")
HANDLERS = bpy.app.handlers
CALLBACKS = [name for name in dir(HANDLERS) if isinstance(getattr(HANDLERS, name), list) and not NOT_HERE.match(name)]
PLACES = 1, 1000  # right behind Sinew's first handler, and last


@pytest.fixture
def listen():
    """Adds a handler at these places for a test."""
    added = []

    def add(name, make, places=PLACES):
        listed = getattr(HANDLERS, name)
        for place in places:
            added.append((listed, HANDLERS.persistent(make(name, place))))
            listed.insert(place, added[-1][1])

    yield add
    for listed, handler in added:
        listed.remove(handler)


@pytest.mark.parametrize("kind", KINDS)
def test_handlers_and_scripts_see_what_blender_leaves(fresh_scene, listen, kind, tmp_path):
    names = [ob.name for ob in make_pair(kind)]
    heard, problems = Counter(), []

    def reader(name, place):
        def read(*given):
            heard[name, place] += 1
            graph = next((each for each in given if isinstance(each, bpy.types.Depsgraph)), None)
            if graph is None:  # to evaluate here would call the handler again
                graph = bpy.context.view_layer.depsgraph if name == "depsgraph_update_pre" else depsgraph()
            try:
                is_seen_alike([bpy.data.objects[each] for each in names], graph)
            except (AssertionError, KeyError) as error:
                problems.append((name, place, repr(error)))

        return read

    for name in CALLBACKS:
        listen(name, reader)
    cause_all(names, tmp_path)
    print("\nheard:", {name: heard[name, PLACES[0]] for name in CALLBACKS})
    assert not problems, problems
    assert [where for where in itertools.product(CALLBACKS, PLACES) if not heard[where]] == []


def cause_all(names, folder):
    """Has Blender call each of CALLBACKS, with frames and edits in between."""
    path, nowhere, ops = str(folder / "readers.blend"), str(folder / "no.blend" / "nowhere"), bpy.ops
    numbers = itertools.count(1)

    def play(frames=1):
        for _ in range(frames):
            pair, frame = [bpy.data.objects[name] for name in names], next(numbers)
            bpy.context.scene.frame_set(frame)
            assert is_deforming(pair[0]) and is_seen_alike(pair, depsgraph())
            for each in pair:
                each.location.x = frame
            bpy.context.view_layer.update()
            assert is_seen_alike(pair, depsgraph())

    def fail(operator, *arguments, **settings):
        with pytest.raises(RuntimeError):
            operator(*arguments, **settings)
        play()

    (folder / "no.blend").write_text("nothing")
    play(8)
    with rendering():
        bpy.context.scene.render.filepath = str(folder / "picture")
        ops.render.render(write_still=True)
        play()
        bpy.context.scene.frame_end, bpy.context.scene.render.filepath = 2, nowhere
        fail(ops.render.render, animation=True)
    for number in range(2):
        play()
        ops.ed.undo_push(message=str(number))
    for operator in (ops.ed.undo, ops.ed.redo):
        operator()
        play()
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        ops.screen.animation_play()
        ops.screen.animation_cancel()
    bpy.data.libraries.write(path + "s", {bpy.data.objects.new("Stranger", None)})
    with bpy.data.libraries.load(path + "s") as (_, to):
        to.objects = ["Stranger"]
    play()
    bpy.context.preferences.view.language = bpy.context.preferences.view.language
    ops.wm.save_as_mainfile(filepath=path)
    play()
    fail(ops.wm.save_as_mainfile, filepath=nowhere)
    ops.wm.open_mainfile(filepath=path)
    play()
    fail(ops.wm.open_mainfile, filepath=str(folder / "no.blend"))


class Engine(bpy.types.RenderEngine):
    bl_idname = "SINEW_TEST_READER"
    bl_label = "Reads"
    asked = []

    def render(self, graph):
        self.update_stats("Reads", "")
        for ask in self.asked:
            ask(graph)


@contextlib.contextmanager
def rendering(*asked):
    """The scene renders with an Engine that calls these with its graph."""
    scene = bpy.context.scene
    bpy.utils.register_class(Engine)
    try:
        Engine.asked, scene.render.engine = asked, Engine.bl_idname
        scene.render.resolution_x = scene.render.resolution_y = 4
        scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        scene.collection.objects.link(scene.camera)
        yield
    finally:
        bpy.utils.unregister_class(Engine)


@pytest.mark.parametrize("kind", KINDS)
def test_render_engines_see_what_blender_leaves(fresh_scene, kind):
    pair, found = make_pair(kind), []
    with rendering(lambda graph: found.append(is_seen_alike(pair, graph))):
        for frame in (3, 4, 5):
            fresh_scene.frame_set(frame)
            bpy.ops.render.render()
    assert found == [True] * 3


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
        'The driver of Value of the shape key "Wide" of the shape keys Key runs Python with the data itself (self), '
        "through which it may change what Sinew has read: write it without"
    )


@needs_memory
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


def test_a_driven_choice_that_does_not_exist_is_blenders(fresh_scene, monkeypatch):
    ob, twin = make_pair("keys")
    reading, read = addon_module("run.mesh_reading").Reading, []
    read_mesh = reading.read_mesh
    monkeypatch.setattr(reading, "read_mesh", lambda *given: read.append(read_mesh(*given)))
    for each in (ob, twin):
        driver = each.driver_add('modifiers["Corrective"].smooth_type').driver
        driver.type = "SUM"
        variable = driver.variables.new()
        variable.type = "TRANSFORMS"
        variable.targets[0].id = bpy.data.objects["Rig"]
        variable.targets[0].transform_type = "LOC_X"
    for place in (0, 1, 7, 1):
        bpy.data.objects["Rig"].location.x = place
        read.clear()
        for frame in range(2, 12):
            fresh_scene.frame_set(frame)
            assert_same_shape(ob, twin)
        assert len(read) < 3
        assert is_deforming(ob) == (place != 7)
        assert addon_module("run.characters").character(ob).status.error == ""
