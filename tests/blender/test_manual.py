"""The manual's page of options names all that the interface has, with the names that scripts use; and what the manual
shows of Python in Blender runs."""

import re

import bpy
import pytest

from helpers import ROOT, addon_module, needs_memory

PAGE = ROOT / "docs" / "options.md"
ROWS = re.findall(r"^\| *([^|]+?) *\| *`([\w.]+)` *\|(.*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)


def visible(properties, base):
    """Those of a class's own that people see."""
    return [found for found in properties if not found.is_hidden and found.identifier not in base]


def properties_of(group):
    """Of a class that Blender knows: an operator, a property group or the preferences."""
    if issubclass(group, bpy.types.Operator):
        category, _, name = group.bl_idname.partition(".")
        return visible(getattr(getattr(bpy.ops, category), name).get_rna_type().properties, {"rna_type"})
    base = bpy.types.AddonPreferences if issubclass(group, bpy.types.AddonPreferences) else bpy.types.PropertyGroup
    return visible(group.bl_rna.properties, set(base.bl_rna.properties.keys()))


def classes():
    rig_files, properties = addon_module("ui.rig_files"), addon_module("main.properties")
    return (
        rig_files.ImportRig,
        rig_files.ExportRig,
        addon_module("ui.operators").Bind,
        properties.SinewObjectSettings,
        properties.SinewSkinningSettings,
        properties.SinewClipSettings,
        addon_module("ui.weights").ParentWithWeights,
        addon_module("ui.weights").CheckWeights,
        *addon_module("ui.weight_tools").CLASSES,
        addon_module("ui.display").ToggleBoneLines,
        addon_module("ui.weights").SelectWeightProblem,
        addon_module("ui.weights").SelectReportedBones,
        addon_module("ui.profile").MeasureProfile,
        addon_module("ui.bake").Bake,
        addon_module("ui.bake").PlayCache,
        addon_module("ui.to_bones").BakeToBones,
        addon_module("ui.crowd").AddCrowd,
        addon_module("onion.onion_settings").SinewOnionSettings,
        addon_module("ui.preferences").SinewPreferences,
    )


def all_operators():
    return [
        cls
        for name in (
            "rig_files",
            "rig_cures",
            "operators",
            "bake",
            "to_bones",
            "crowd",
            "cures",
            "method_settings",
            "weights",
            "weight_tools",
            "display",
            "preferences",
            "profile",
            "played_rigs",
            "onion_skins",
        )
        for cls in addon_module(f"ui.{name}").CLASSES
        if issubclass(cls, bpy.types.Operator)
    ]


def rows(name, identifier):
    return [rest for row_name, row_identifier, rest in ROWS if (row_name, row_identifier) == (name, identifier)]


@pytest.mark.parametrize("number", range(22))
def test_each_property_stands_there(number):
    group = classes()[number]
    found = properties_of(group)
    assert found
    missing = [
        (each.name, each.identifier)
        for each in found
        if each.type != "COLLECTION" and not rows(each.name, each.identifier)
    ]
    assert not missing, f"{group.__name__}: docs/options.md has no row for {missing}"


@pytest.mark.parametrize("number", range(21))
def test_each_choice_stands_there(number):
    """Not those of the preferences: which instruction sets there are is up to the processor."""
    for each in properties_of(classes()[number]):
        for choice in each.enum_items if each.type == "ENUM" else ():
            assert any(
                choice.name in rest and f"`{choice.identifier}`" in rest for rest in rows(each.name, each.identifier)
            ), f"{each.name}: {choice.name}"


def test_each_operator_stands_there():
    operators = all_operators()
    missing = [(cls.bl_label, cls.bl_idname) for cls in operators if not rows(cls.bl_label, cls.bl_idname)]
    assert len(operators) >= 12 and not missing


def test_nothing_else_stands_there():
    """A row of something that is gone."""
    known = {(each.name, each.identifier) for group in classes() for each in properties_of(group)}
    known |= {(cls.bl_label, cls.bl_idname) for cls in all_operators()}
    assert {(name, identifier) for name, identifier, _ in ROWS} - known == set()


def test_each_command_and_its_options_stand_there():
    """With their help, however wide the terminal is in which it was printed."""

    def words(text):
        return " ".join(text.split())

    page = words(PAGE.read_text(encoding="utf-8"))
    parser = addon_module("cli.command_options").make_parser()
    commands = next(action.choices for action in parser._actions if action.dest == "command")
    for name, command in commands.items():
        assert f"### sinew {name} " in page and words(command.description) in page
        for action in command._actions:
            choices = f"{{{','.join(action.choices)}}}" if action.choices else ""
            for text in (*action.option_strings, words(action.help or ""), choices):
                assert text in section(page, name), f"{name}: {text}"


def section(page, command):
    return page.partition(f"### sinew {command} ")[2].partition("### ")[0]


def example(page, **replaced):
    """The one block of Python on a page, for Blender."""
    (block,) = re.findall(
        r"^```python\n(.*?)^```$", (ROOT / "docs" / page).read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    for old, new in replaced.items():
        assert old in block
        block = block.replace(old, new)
    return block


@needs_memory
def test_the_example_of_the_deformed_copy_runs(character, capsys):
    ob, twin, _ = character
    ob.name, ob.sinew.output = "Tube", "MESH"
    bpy.context.scene.frame_set(5)
    exec(example("accelerate.md"), {"bpy": bpy})
    assert len(capsys.readouterr().out.splitlines()) == len(ob.data.vertices)


def test_the_example_of_a_bake_runs(character, capsys, tmp_path):
    ob, _, _ = character
    ob.name = "Body"
    package = addon_module("bake").__name__
    code = example(  # the number first: the folder's name may have it
        "bake.md", **{"240": "3", "bl_ext.user_default.sinew.bake": package, "/shots/010/bake": tmp_path.as_posix()}
    )
    exec(code, {"bpy": bpy})
    assert "3 of 3 frames baked" in capsys.readouterr().out and (tmp_path / "Body.pc2").is_file()


def test_the_example_of_weights_runs(character, capsys):
    ob, _, _ = character
    ob.name = "Body"
    exec(example("weights.md", **{"bl_ext.user_default.sinew.weights": addon_module("weights").__name__}), {"bpy": bpy})
    made, checked = capsys.readouterr().out.splitlines()
    assert made.startswith("1,200 vertices in 1 part, none without weights, ") and checked.startswith("1,200 vertices")


def test_the_example_of_weight_tools_runs(character, capsys):
    body, suit, _ = character
    body.name, suit.name = "Body", "Suit"
    package = addon_module("weights").__name__
    exec(example("weight-tools.md", **{"bl_ext.user_default.sinew.weights": package}), {"bpy": bpy})
    copied, smoothed = capsys.readouterr().out.splitlines()
    assert copied == "1,200 vertices: 1,200 matched" and smoothed.endswith(" of 1,200 vertices smoothed")


def test_operators_in_the_text_are_there():
    """With the arguments that the manual gives them."""
    calls = [
        call
        for page in (ROOT / "docs").glob("*.md")
        for call in re.findall(r"bpy\.ops\.(\w+)\.(\w+)\(([^)]*)\)", page.read_text(encoding="utf-8"))
    ]
    assert len(calls) >= 6
    for category, name, arguments in calls:
        known = getattr(getattr(bpy.ops, category), name).get_rna_type().properties.keys()
        assert set(re.findall(r"(\w+)=", arguments)) <= set(known), name
