"""What the panels say in each situation, drawn into a layout that only takes notes."""

from importlib.machinery import EXTENSION_SUFFIXES
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, make_tube, pose, smoothed
from helpers import addon_module, depsgraph, evaluated, import_rig, into_a_shot, make_fail, needs_memory, select, way
from test_chain import NO_TAIL

LAYOUT = bpy.types.UILayout.bl_rna


class Notes:
    """A layout that draws nothing: it notes the texts and names it is given, goes on, and refuses what Blender's own
    layout would refuse."""

    def __init__(self):
        vars(self)["said"] = []

    def __setattr__(self, name, value):
        check(LAYOUT.properties[name], value)

    def __getattr__(self, name):
        known = {each.identifier: each for each in LAYOUT.functions[name].parameters if not each.is_output}

        def call(*arguments, **options):
            positional = [each for each in known.values() if each.is_required]
            given = dict(zip((each.identifier for each in positional), arguments))
            assert len(arguments) <= len(positional) and set(given) | set(options) <= set(known), (name, options)
            assert {each.identifier for each in positional} <= set(given) | set(options), name
            for option, value in options.items():
                check(known[option], value)
            self.note(name, {**given, **options})
            return properties_of(given["operator"]) if name == "operator" else self

        return call

    def note(self, name, given):
        text = given.get("text")
        if name in {"prop", "prop_search"}:
            name = name_of_property(given["data"], given["property"])
            text = name if text is None else text
        if name == "prop_search":
            assert given["search_data"].bl_rna.properties[given["search_property"]].type == "COLLECTION"
        if name == "operator":
            assert operator_type(given["operator"])
            text = given["operator"] if text is None else text
        if text is not None:
            self.said.append(text)


def name_of_property(data, name):
    """Of a custom property too, which stands in brackets. KeyError: there is none."""
    if name.startswith('["'):
        assert data[name[2:-2]] is not None
        return name
    return data.bl_rna.properties[name].name


def properties_of(operator):
    """What a layout gives back of an operator: its properties may be set, and nothing else."""
    return type("Properties", (), {"__slots__": tuple(operator_type(operator).properties.keys())})()


def operator_type(name):
    category, _, operator = name.partition(".")
    return getattr(getattr(bpy.ops, category), operator).get_rna_type()  # KeyError: there is none


def check(rna, value):
    """Whether a property or a parameter takes a value."""
    kinds = {"STRING": str, "BOOLEAN": bool, "INT": int, "FLOAT": (int, float), "ENUM": str}
    assert isinstance(value, kinds.get(rna.type, object)), (rna.identifier, value)
    if rna.type == "ENUM":
        assert value in rna.enum_items, (rna.identifier, value)


@pytest.mark.parametrize(
    "wrong",
    (
        lambda layout: layout.lable(text="a"),
        lambda layout: layout.label(txt="a"),
        lambda layout: layout.label(text=1),
        lambda layout: layout.label(text="a", icon="NO_ICON_OF_BLENDER"),
        lambda layout: layout.prop(bpy.context.scene),
        lambda layout: layout.prop(bpy.context.scene, "frame_currant"),
        lambda layout: layout.operator("object.sinew_nothing"),
        lambda layout: setattr(layout.operator("object.sinew_bind"), "out", "MESH"),
        lambda layout: setattr(layout, "alignement", "RIGHT"),
        lambda layout: setattr(layout, "alignment", "ASIDE"),
    ),
)
def test_the_notes_refuse_what_blender_refuses(wrong):
    with pytest.raises((AssertionError, AttributeError, KeyError)):
        wrong(Notes())


def draw(place="Sidebar", but=("SidebarBakeAndCrowd", "SidebarWeights")):
    """What all panels of the Sidebar, or of the Modifiers or the Armature's data, say; except some."""
    said = []
    for cls in addon_module("ui.panels").CLASSES:
        if (
            cls.__name__.startswith(place)
            and cls.__name__ not in but
            and (not hasattr(cls, "poll") or cls.poll(bpy.context))
        ):
            notes = Notes()
            cls.draw(SimpleNamespace(layout=notes), bpy.context)
            said += notes.said
    return said


def test_nothing_selected():
    assert draw() == ["Select a mesh or its armature", "import_scene.sinew_rig"]
    assert draw("Modifiers") == draw("Armature") == []


def test_a_crowd():
    select(make_mesh(make_armature(), False))
    assert bpy.ops.object.sinew_crowd_add(agents=3, shapes=2) == {"FINISHED"}
    said = draw()
    assert (said[0], said[-1]) == ("A crowd", "object.sinew_crowd_renew")
    assert {"Agents", "Lanes", "Speed", "Seed"} < set(said)
    assert draw("Modifiers") == said


@needs_memory
@pytest.mark.parametrize("mesh_panel, armature_panel", (("Sidebar", "Sidebar"), ("Modifiers", "Armature")))
def test_mesh_and_armature_before_and_after(fresh_scene, mesh_panel, armature_panel):
    armature = make_armature()
    ob = make_mesh(armature, False)
    pose(armature, 1, False)
    display = ["object.sinew_show_weights", "object.sinew_show_skeleton"]
    select(ob)
    assert draw(mesh_panel) == ["Armature deforms it", "object.sinew_bind", *display]
    select(armature)
    assert draw(armature_panel) == ["0 of 1 meshes bound", "object.sinew_bind", display[1]]
    accelerate(ob)
    fresh_scene.frame_set(2)
    said = draw(mesh_panel)
    for text in (
        "Method",
        "Output",
        "Vertices",
        "1,200",
        "Bones",
        "6",
        "Influences",
        "Sinew's Part",
        "Measure",
        "Threads",
        "Attribute",
        "Instructions",
        addon_module("native").sinew_native.instruction_set(),
        "object.sinew_unbind",
        "Mask",
        "Bone Envelopes",
        *display,
    ):
        assert text in said
    select(armature)
    rig = ["Accelerate Rig"] if bpy.app.version >= (4, 2, 0) else []
    assert draw(armature_panel) == ["1 of 1 meshes bound", ob.name, *rig, "object.sinew_unbind", "Measure", display[1]]


def test_weights(fresh_scene):
    armature = make_armature()
    ob = make_mesh(armature, False)
    select(ob)
    buttons = ["Parent with Sinew Weights", "object.sinew_check_weights"]
    tools = ["Transfer", "Smooth", "Mirror", "Reduce"]
    assert draw("SidebarWeights", ()) == [*buttons, *tools, "object.sinew_show_bone_lines"]
    bpy.ops.object.sinew_check_weights(most_influences=2)
    select(armature)
    said = draw("SidebarWeights", ())
    assert said[:2] == buttons and said[3].endswith(" not summing to 1") and said[3][0].isdigit()
    select(armature, ob)
    bpy.ops.object.sinew_parent_with_weights()
    assert draw("SidebarWeights", ())[2].startswith("1,200 vertices in 1 part, none without weights")
    select(ob)
    bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
    assert draw("SidebarWeights", ())[:2] == ["object.sinew_assign_from_bones", buttons[1]]
    bpy.ops.object.mode_set(mode="OBJECT")
    select()
    assert draw("SidebarWeights", ()) == []


@needs_memory
def test_mesh_without_an_armature(fresh_scene):
    ob = make_tube()
    select(ob)
    assert draw() == ["Not bound", "object.sinew_bind", "object.sinew_show_weights"]
    smoothed(ob, "Smooth", "SMOOTH")
    assert draw() == ["Deformed without an armature", "object.sinew_bind", "object.sinew_show_weights"]
    accelerate(ob)
    fresh_scene.frame_set(2)
    said = draw()
    for text in ("Output", "Vertices", "1,200", "Sinew's Part", "object.sinew_unbind"):
        assert text in said
    assert not {"Method", "Pose", "Armature", "Show", "Bones", "Mask"}.intersection(said[: said.index("Sinew's Part")])
    copy = ob.copy()
    bpy.context.collection.objects.link(copy)
    ob.modifiers.remove(ob.modifiers["Smooth"])
    bpy.context.view_layer.update()
    said = draw()
    assert (
        "Blender's own modifier deforms it: it has no armature, shape keys or smoothing that Sinew could take "
        "over: add one of them"
    ) in said
    assert "2 objects share this mesh" in said
    assert bpy.ops.object.sinew_make_single_user.poll() and not bpy.ops.object.sinew_fill_weights.poll()


@needs_memory
def test_whole_frames_with_and_without(fresh_scene, monkeypatch):
    """Blender's own modifiers deform the frames that Sinew is compared with; then everything is as before."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    for frame in (1, 10):
        pose(armature, frame, False)
    accelerate(ob)
    fresh_scene.frame_start, fresh_scene.frame_end = 1, 10
    fresh_scene.frame_set(4, subframe=0.5)
    characters, calls, before = addon_module("run.characters"), [], evaluated(ob)
    fast_path = addon_module("run.fast_path").FastPath
    run = fast_path.run

    def note_run(own, evaluated_object):
        has_run = run(own, evaluated_object)
        calls.extend([True] * has_run)
        return has_run

    monkeypatch.setattr(fast_path, "run", note_run)
    may_work = characters.Character.may_work

    def note(entry, plan, evaluated_object):
        calls.append(may_work(entry, plan, evaluated_object))
        return calls[-1]

    monkeypatch.setattr(characters.Character, "may_work", note)
    assert "Whole Frame" not in draw()
    assert bpy.ops.object.sinew_measure() == {"FINISHED"}
    assert calls.count(False) > 9 and abs(calls.count(True) - calls.count(False)) <= 5
    said = draw()
    for name in "Whole Frame", "Without Sinew":
        assert float(said[said.index(name) + 1].removesuffix(" ms")) > 0
    assert (fresh_scene.frame_current, fresh_scene.frame_subframe) == (4, 0.5)
    entry, evaluated_object = characters.of(ob), ob.evaluated_get(depsgraph())
    assert np.array_equal(evaluated(ob), before)
    assert may_work(entry, entry.copy_of(evaluated_object).plan, evaluated_object)
    other = bpy.data.scenes.new("other")
    assert addon_module("main.whole_frames").last(other) is None
    ob.sinew.output = "MESH"
    assert not bpy.ops.object.sinew_measure.poll()


def test_mixed_modifiers_are_shown(fresh_scene):
    armature = make_armature()
    ob = make_mesh(armature, False)
    second = ob.modifiers.new("Second", "ARMATURE")
    second.object, second.use_multi_modifier = armature, True
    accelerate(ob)
    assert draw().count("Armature") == 2 and "Mixed with" in draw()


@needs_memory
@pytest.mark.says_errors
def test_an_error_stands_on_top(fresh_scene, monkeypatch):
    armature = make_armature()
    ob = make_mesh(armature, False)
    pose(armature, 1, False)
    accelerate(ob)
    make_fail(monkeypatch, ob.name)
    fresh_scene.frame_set(2)
    assert "It was told to fail" in draw()[0]
    monkeypatch.undo()
    ob.data.update()
    bpy.context.view_layer.update()
    assert not any("fail" in text for text in draw())


@needs_memory
def test_which_way_a_mesh_goes_and_why(fresh_scene):
    ob = make_mesh(make_armature(), False)
    accelerate(ob)
    ob.modifiers.new("Cast", "CAST")
    for _ in range(2):
        bpy.ops.object.modifier_move_up(modifier="Cast")
    bpy.context.view_layer.update()
    said = draw()
    assert any(text.startswith("Blender's own modifier deforms it: Cast comes before") for text in said)
    assert "Move Down" in said
    assert bpy.ops.object.sinew_move_down() == {"FINISHED"}
    bpy.context.view_layer.update()
    assert [each.type for each in ob.modifiers][-1] == "CAST" and "Move Down" not in draw()
    with pytest.raises(RuntimeError, match="No modifier of .* is in Sinew's way"):
        bpy.ops.object.sinew_move_down()


@needs_memory
def test_the_modifier_that_is_in_the_way_is_moved_and_no_other(fresh_scene):
    """Whose name another one's begins with."""
    ob = make_mesh(make_armature(), False)
    accelerate(ob)
    for name, kind in (("Cast", "UV_WARP"), ("Cast.001", "CAST")):
        ob.modifiers.new(name, kind)
        bpy.ops.object.modifier_move_to_index(modifier=name, index=len(ob.modifiers) - 3)
    bpy.context.view_layer.update()
    select(ob)
    assert bpy.ops.object.sinew_move_down() == {"FINISHED"}
    names = [each.name for each in ob.modifiers]
    assert names.index("Cast") < names.index("Armature") < names.index("Cast.001")


def test_a_long_sentence_in_a_narrow_sidebar():
    sentence = "A sentence that nobody could read if its middle were left out"
    context = SimpleNamespace(
        region=SimpleNamespace(width=440), preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=2.0))
    )
    notes = Notes()
    addon_module("feedback.notice").draw_sentence(notes, context, sentence, True)
    assert " ".join(notes.said) == sentence and 2 < len(notes.said) < 7


def test_poses_of_an_imported_rig():
    import_rig("capsule")
    assert {"Mode", "Start Frame", "Speed", "object.sinew_clip_to_keyframes"} <= set(draw())


@pytest.mark.parametrize("output", ("MODIFIER", "MESH"))
def test_switches_of_what_is_shown(output):
    ob = make_mesh(make_armature(), False)
    accelerate(ob, output)
    shown = bpy.types.Modifier.bl_rna.properties["show_viewport"]
    assert hasattr(ob.sinew, "show_shape") and shown
    notes = Notes()
    addon_module("ui.sections").draw_switches(notes, ob)
    assert notes.said == [
        "Show",
        "",
        "",
        *{"MODIFIER": [], "MESH": ["Copy", "Tube.deformed", "Show Copy", "", "", "Deform"]}[output],
    ]


def test_preferences_without_a_module():
    """The sentence that stands in the preferences where no module fits."""
    problem = addon_module("native").problem_of_import
    files = ["sinew_native.cpython-36-x86_64-linux-gnu.so", "sinew_native.cp37-win_amd64.pyd"]
    assert "no native library for Python" in problem(ImportError("nothing"), files)
    assert problem(ImportError("nothing"), files).endswith(
        "this package has those for Python 3.7 (win_amd64), Python 3.6 (x86_64-linux-gnu)"
    )
    wheels = ["sinew_native-0.2.0-cp36-cp36-win_amd64.whl", "sinew_native-0.2.0-cp37-cp37-manylinux_2_34_x86_64.whl"]
    assert problem(ImportError("nothing"), wheels).endswith(
        "this package has those for Python 3.6 (win_amd64), Python 3.7 (manylinux_2_34_x86_64)"
    )
    assert problem(ImportError("nothing"), []).endswith("this package has none")
    here = f"sinew_native{EXTENSION_SUFFIXES[0]}"
    assert problem(ImportError("GLIBC_9 not found"), [*files, here]).endswith("does not load: GLIBC_9 not found")


@needs_memory
def test_the_chain_stage_by_stage(fresh_scene):
    """What Sinew stands in for, and where and why Blender goes on."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    for name, kind in (("Soft", "CORRECTIVE_SMOOTH"), ("Even", "SMOOTH"), ("Finer", "SUBSURF"), ("Late", "SMOOTH")):
        ob.modifiers.new(name, kind)
    pose(armature, 1, False)
    accelerate(ob)
    fresh_scene.frame_set(2)
    fresh_scene.frame_set(3)
    said = draw()
    chain = said[said.index("Pose", said.index("Method")) : said.index("Vertices")]
    assert [text for text in chain if not text.endswith(" ms")][:6] == [
        "Pose",
        "Armature",
        "Soft",
        "Even",
        "Finer",
        "in Blender",
    ]
    assert sum(text.endswith(" ms") for text in chain) == 4 and "Late" not in chain
    sentence = f"Blender takes over at Finer: {NO_TAIL}"
    assert sentence in " ".join(chain[8:])
    assert "object.sinew_bind_smoothing" not in chain
    ob.modifiers["Soft"].rest_source = "BIND"
    ob.shape_key_add(name="Basis")
    fresh_scene.frame_set(3)
    fresh_scene.frame_set(4)
    said = draw()
    assert "Shape Keys + Armature" in said and "object.sinew_bind_smoothing" in said


# --- what is at work ------------------------------------------------------------------------------

PARTS = "Sinew's Part", "Pose", "Shape Keys + Armature"


def figure():
    """A bound mesh with shape keys and its armature, animated."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    add_shape_keys(ob)
    for frame in (1, 10):
        pose(armature, frame, False)
    accelerate(ob)
    return ob, armature


def said_of(name):
    """What stands beside a name, in the first section that has it after the settings."""
    said = draw()
    return said[said.index(name, said.index("Method")) + 1]


@needs_memory
def test_times_are_those_of_ordinary_frames(fresh_scene):
    ob, _ = figure()
    fresh_scene.frame_set(2)
    entry = addon_module("run.characters").character(ob)
    for edit in (lambda: None, ob.data.update, lambda: setattr(ob.data.shape_keys.key_blocks["Wide"], "mute", True)):
        fresh_scene.frame_set(3)
        edit()
        ob.data.update_tag()
        bpy.context.view_layer.update()  # Sinew reads the mesh anew: such a frame is dearer than others
        assert entry.status.timings.recent() is None
        assert {said_of(name) for name in PARTS} == {"not played yet"}
        fresh_scene.frame_set(4)
        assert all(said_of(name).endswith(" ms") for name in PARTS)


def test_times_shown_are_medians_of_the_last_frames():
    timings = addon_module("run.character").Timings()
    assert timings.recent() is None and timings.last.total == 0
    for each in (1.0, 3.0, 2.0):
        timings.add(np.array([each, each, 0.5]))
    recent = timings.recent()
    assert (recent.pose, recent.skin, recent.stages, recent.total) == (2.0, 2.0, (0.5,), 4.5)
    numbers = np.array([5.0, 1.0, 1.0])
    for _ in range(20):
        timings.add(numbers)
    numbers[:] = 0.0  # the next frame's
    assert timings.recent().pose == timings.last.pose == 5.0
    timings.add(np.array([7.0, 1.0]))  # a modifier less
    assert timings.recent() == timings.last == (7.0, 1.0, ())
    timings.forget()
    assert timings.recent() is None


@needs_memory
@pytest.mark.parametrize("way_out", ("absolute", "edit mode"))
def test_no_times_while_blender_deforms(fresh_scene, way_out):
    ob, _ = figure()
    for frame in (2, 3, 4):
        fresh_scene.frame_set(frame)
    assert said_of("Sinew's Part").endswith(" ms") and said_of("Path") == "Shape Keys"
    if way_out == "absolute":
        ob.data.shape_keys.use_relative = False
    else:
        bpy.ops.object.mode_set(mode="EDIT")
    fresh_scene.frame_set(5)
    said = draw()
    assert not any(text.endswith(" ms") for text in said) and not {"Sinew's Part", "Pose + Armature"} & set(said)
    assert said_of("Path") == "Blender's Modifier"


def test_a_gain_at_a_glance(fresh_scene):
    ob, armature = figure()
    whole_frames = addon_module("main.whole_frames")

    def beside_unbind():
        said = draw()
        return said[said.index("object.sinew_unbind") + 1]

    assert beside_unbind() == "Measure"
    assert bpy.ops.object.sinew_measure() == {"FINISHED"}
    whole_frames._last = whole_frames.Measured(fresh_scene.name, 26.3, 76.3, whole_frames._last.bound)
    assert beside_unbind() == "2.9x, 38 fps"
    select(armature)
    assert beside_unbind() == "2.9x, 38 fps"
    accelerate(make_mesh(armature, False))
    assert beside_unbind() == "Measure", "another mesh is bound now"


def test_bake_and_crowd_are_in_the_tab(fresh_scene):
    ob, armature = figure()
    panel = addon_module("ui.panels").SidebarBakeAndCrowd

    def offered(*selected):
        select(*selected)
        notes = Notes()
        if panel.poll(bpy.context):
            panel.draw(SimpleNamespace(layout=notes), bpy.context)
        return notes.said

    everything = ["object.sinew_bake", "object.sinew_play_cache", "object.sinew_bake_to_bones", "Add Crowd"]
    assert offered(ob) == offered(armature) == everything and offered() == []
    ob.sinew.cache_kept = "anything"
    everything[1] = "object.sinew_take_off_cache"
    assert offered(ob) == everything


@needs_memory
@pytest.mark.parametrize("is_bound", (True, False))
def test_while_a_cache_plays(fresh_scene, tmp_path, is_bound):
    ob, _ = figure()
    if not is_bound:
        bpy.ops.object.sinew_unbind()
    assert bpy.ops.object.sinew_bake_frames(directory=str(tmp_path), frame_start=1, frame_end=3, play=True) == {
        "FINISHED"
    }
    fresh_scene.frame_set(2)
    for place in ("Sidebar", "Modifiers"):
        said = draw(place)
        assert said[0] == (
            "Sinew Cache plays a cache in place of the modifiers that were baked, which are switched off"
        )
        assert said[1] == "object.sinew_take_off_cache" and not any("switch it on" in text for text in said)
    if is_bound:
        reason = addon_module("run.characters").character(ob).way.reason
        assert reason == "Sinew Cache plays a cache in place of Armature, which is switched off"
    ob.modifiers.remove(ob.modifiers["Sinew Cache"])
    assert draw()[0] == "The cache is gone, and what it replaced is switched off"
    assert bpy.ops.object.sinew_take_off_cache() == {"FINISHED"}
    fresh_scene.frame_set(3)
    assert "object.sinew_take_off_cache" not in draw() and (not is_bound or way(ob) == "KEYS")


@needs_memory
def test_a_modifier_that_is_off_without_a_cache(fresh_scene):
    ob, _ = figure()
    ob.modifiers["Armature"].show_viewport = ob.modifiers["Armature"].show_render = False
    fresh_scene.frame_set(2)
    assert "Blender's own modifier deforms it: Armature is switched off: switch it on" in draw()


@needs_memory
def test_what_comes_before_is_called_what_people_see(fresh_scene):
    ob, _ = figure()
    ob.modifiers.new("Subsurf", "SUBSURF")
    addon_module("blender.nodes").move_modifier(ob, ob.modifiers["Subsurf"], 0)
    fresh_scene.frame_set(2)
    assert (
        "Blender's own modifier deforms it: Subsurf (Subdivision Surface) comes before Armature, with which Sinew has "
        "to begin: move Subsurf behind Armature if the shape may be made in that order"
    ) in " ".join(draw())
    ob.modifiers["Subsurf"].name = "Subdivision Surface.001"
    bpy.context.view_layer.update()
    assert ": Subdivision Surface.001 comes before Armature" in " ".join(draw())


@needs_memory
def test_single_user_is_advised_where_it_can_be_done(fresh_scene, tmp_path):
    ob, armature = figure()
    if ob.data.shape_keys is None:
        ob.shape_key_add(name="Basis")
    twin = ob.copy()
    collection = bpy.data.collections.new("Character")
    for each in (ob, twin, armature):
        for other in each.users_collection:
            other.objects.unlink(each)
        collection.objects.link(each)
    fresh_scene.collection.children.link(collection)
    fresh_scene.frame_set(2)
    advice = "2 objects share this mesh, and Blender blends its shape keys for all of them"
    assert f"{advice}: make it single-user" in " ".join(draw()) and "Make Single User" in draw()
    scene = into_a_shot(tmp_path, overridden=True)
    scene.frame_set(3)
    select(next(each for each in scene.objects if each.type == "MESH"))
    said = " ".join(draw())
    assert advice[2:] in said and "ingle" not in said


def test_other_users_of_a_mesh_than_objects_do_not_share_it(fresh_scene):
    ob, _ = figure()
    fresh_scene["a note"] = ob.data
    assert ob.data.users > 1
    fresh_scene.frame_set(2)
    assert way(ob) == "KEYS" and not any("share this mesh" in text for text in draw())
