"""What the panels say in each situation, drawn into a layout that only takes notes."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from characters import accelerate, make_armature, make_mesh, make_tube, pose, smoothed
from helpers import addon_module, depsgraph, evaluated, import_rig, make_fail, select

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


def draw(place="Sidebar"):
    """What all panels of the Sidebar, or of the Modifiers or the Armature's data, say."""
    said = []
    for cls in addon_module("ui.panels").CLASSES:
        if cls.__name__.startswith(place) and (not hasattr(cls, "poll") or cls.poll(bpy.context)):
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


@pytest.mark.parametrize("mesh_panel, armature_panel", (("Sidebar", "Sidebar"), ("Modifiers", "Armature")))
def test_mesh_and_armature_before_and_after(fresh_scene, mesh_panel, armature_panel):
    armature = make_armature()
    ob = make_mesh(armature, False)
    pose(armature, 1, False)
    display = ["object.sinew_show_weights", "object.sinew_show_skeleton"]
    select(ob)
    assert draw(mesh_panel) == ["Armature deforms it", "Accelerate", *display]
    select(armature)
    assert draw(armature_panel) == ["0 of 1 meshes bound", "Accelerate", display[1]]
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
        "object.sinew_measure",
        "Threads",
        "an attribute",
        "Instructions",
        addon_module("native").sinew_native.instruction_set(),
        "object.sinew_unbind",
        "Mask",
        "Bone Envelopes",
        *display,
    ):
        assert text in said
    select(armature)
    assert draw(armature_panel) == ["1 of 1 meshes bound", ob.name, "object.sinew_unbind", display[1]]


def test_mesh_without_an_armature(fresh_scene):
    ob = make_tube()
    select(ob)
    assert draw() == ["Not bound", "object.sinew_bind", "object.sinew_show_weights"]
    smoothed(ob, "Smooth", "SMOOTH")
    assert draw() == ["Deformed without an armature", "Accelerate", "object.sinew_show_weights"]
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


def test_whole_frames_with_and_without(fresh_scene, monkeypatch):
    """Blender's own modifiers deform the frames that Sinew is compared with; then everything is as before."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    for frame in (1, 10):
        pose(armature, frame, False)
    accelerate(ob)
    fresh_scene.frame_start, fresh_scene.frame_end = 1, 10
    fresh_scene.frame_set(4, subframe=0.5)
    characters, calls, before = addon_module("session.characters"), [], evaluated(ob)
    shortcuts = addon_module("session.shortcuts")
    take = shortcuts.take

    def note_taken(evaluated_object):
        taken = take(evaluated_object)
        calls.extend([True] * taken)
        return taken

    monkeypatch.setattr(shortcuts, "take", note_taken)
    is_at_work = characters.Character.is_at_work

    def note(entry, copy, evaluated_object):
        calls.append(is_at_work(entry, copy, evaluated_object))
        return calls[-1]

    monkeypatch.setattr(characters.Character, "is_at_work", note)
    assert "Whole Frame" not in draw()
    assert bpy.ops.object.sinew_measure() == {"FINISHED"}
    assert calls.count(False) > 9 and abs(calls.count(True) - calls.count(False)) <= 5
    said = draw()
    for name in "Whole Frame", "Without Sinew":
        assert float(said[said.index(name) + 1].removesuffix(" ms")) > 0
    assert (fresh_scene.frame_current, fresh_scene.frame_subframe) == (4, 0.5)
    entry, evaluated_object = characters.of(ob), ob.evaluated_get(depsgraph())
    assert np.array_equal(evaluated(ob), before)
    assert is_at_work(entry, entry.copy_of(evaluated_object), evaluated_object)
    other = bpy.data.scenes.new("other")
    assert addon_module("session.whole_frames").last(other) is None
    ob.sinew.output = "MESH"
    assert not bpy.ops.object.sinew_measure.poll()


def test_mixed_modifiers_are_shown(fresh_scene):
    armature = make_armature()
    ob = make_mesh(armature, False)
    second = ob.modifiers.new("Second", "ARMATURE")
    second.object, second.use_multi_modifier = armature, True
    accelerate(ob)
    assert draw().count("Armature") == 2 and "Mixed with" in draw()


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


def test_which_way_a_mesh_goes_and_why(fresh_scene):
    ob = make_mesh(make_armature(), False)
    accelerate(ob)
    ob.modifiers.new("Cast", "CAST")
    for _ in range(2):
        bpy.ops.object.modifier_move_up(modifier="Cast")
    bpy.context.view_layer.update()
    assert any(text.startswith("Blender's own modifier deforms it: Cast comes before") for text in draw())


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
    assert problem(ImportError("nothing"), []).endswith("this package has none")
    import sys

    here = f"sinew_native.cpython-{sys.version_info.major}{sys.version_info.minor}-x86_64-linux-gnu.so"
    assert problem(ImportError("GLIBC_9 not found"), [*files, here]).endswith("does not load: GLIBC_9 not found")


def test_the_chain_stage_by_stage(fresh_scene):
    """What Sinew stands in for, and where and why Blender goes on."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    for name, kind in (("Soft", "CORRECTIVE_SMOOTH"), ("Even", "SMOOTH"), ("Finer", "SUBSURF"), ("Late", "SMOOTH")):
        ob.modifiers.new(name, kind)
    pose(armature, 1, False)
    accelerate(ob)
    fresh_scene.frame_set(2)
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
    assert "Blender takes over at Finer: Sinew cannot evaluate it" in " ".join(chain[8:])
    assert "object.sinew_bind_smoothing" not in chain
    ob.modifiers["Soft"].rest_source = "BIND"
    ob.shape_key_add(name="Basis")
    fresh_scene.frame_set(3)
    fresh_scene.frame_set(4)
    said = draw()
    assert "Shape Keys + Armature" in said and "object.sinew_bind_smoothing" in said
