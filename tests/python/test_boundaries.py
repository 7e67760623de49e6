"""Who may know whom. The layers stand in docs/how-it-works.md: logic runs without Blender, one file talks to TBB, one
to the compiled module."""

import ast
import graphlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ADDON = ROOT / "addon" / "sinew"
MODULES = sorted(ADDON.rglob("*.py"))
# From the lowest. Folders of the same layer do not know each other.
LAYERS = (
    {"native"},
    {"deform", "feedback", "host"},
    {"blender"},
    {"clips", "plan"},
    {"chain"},
    {"run"},
    {"install", "stencils", "weights"},
    {"description", "main", "rig_files"},
    {"played"},
    {"onion"},
    {"bake", "profiling"},
    {"crowd", "to_bones"},
    {"ui", "cli", "without_native"},
    {"__init__"},
)
# Likewise the folders of native/src.
NATIVE_LAYERS = (
    {"base"},
    {"mesh", "rig", "skeleton"},
    {"files", "skinning"},
    {"cages", "mush", "smoothing", "weights"},
    {"decompose", "deformer"},
    {"weight_tools"},
)
PURE = {
    "bake.job",
    "bake.frame_range",
    "bake.leftovers",
    "bake.part_files",
    "bake.point_cache",
    "bake.subject",
    "bake.systems",
    "bake.usd",
    "bake.verify",
    "blender.materials",
    "blender.modifier_types",
    "blender.spoken_paths",
    "cli.arguments",
    "cli.command_options",
    "crowd.stride",
    "deform.choices",
    "deform.clips",
    "deform.influences",
    "played.records",
    "host.features",
    "main.crash_files",
    "host.members",
    "feedback.options",
    "native",
    "plan.mends",
    "plan.plans",
    "plan.fronts",
    "plan.runs",
    "plan.situation",
    "plan.ways",
    "profiling.costs",
    "description.rna_paths",
    "rig_files.file_options",
    "run.mail",
    "to_bones.bake_options",
    "to_bones.bone_names",
    "to_bones.joints",
    "to_bones.reduction",
    "weights.bone_segments",
    "weights.pictures",
    "weights.pose_checks",
    "weights.checks",
    "weights.entries",
    "weights.mirrored_bones",
    "weights.reports",
    "weights.weight_settings",
}
# Imports the modules that are named, where Blender's cannot be had, and the add-on's list of modules is not wanted.
WITHOUT_BLENDER = """
import importlib, sys, types
for name in ("bpy", "bmesh", "mathutils", "bpy_extras", "gpu"):
    sys.modules[name] = None
package = types.ModuleType("sinew")
package.__path__, package.bl_info = [sys.argv[1]], {"version": (0, 0, 0)}
sys.modules["sinew"] = package
for name in sys.argv[2:]:
    importlib.import_module("sinew." + name)
"""


def name_of(path):
    return ".".join(path.relative_to(ADDON).with_suffix("").parts)


def room_of(name):
    """The folder that a module is in, or its own name."""
    return name.split(".")[0]


NAMES = {name_of(path) for path in MODULES}


def imported(path, names=NAMES, top=ADDON):
    """The add-on's own modules (of those names) that a file imports, at any depth."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(), str(path))):
        if isinstance(node, ast.ImportFrom) and node.level:
            folder = path.parents[node.level - 1].relative_to(top).parts
            base = (*folder, *(node.module or "").split(".")) if node.module else folder
            for alias in node.names:
                found |= {".".join((*base, alias.name)), ".".join(base)} & names
    return found


def packages_of(path):
    """Top-level names that a file imports, at any depth."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(), str(path))):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {node.module.split(".")[0]} if node.module else {alias.name for alias in node.names}
    return found


def test_imports_are_seen(tmp_path):
    path = tmp_path / "ui" / "a.py"
    path.parent.mkdir()
    path.write_text(
        "import os.path, bpy as b\ndef f():\n  from bpy_extras.io import x\n"
        "  from . import b\nfrom .c import D\nfrom ..rig_files.d import e\nfrom .. import native\n"
    )
    names = {"ui.a", "ui.b", "ui.c", "rig_files.d", "native", "b"}
    assert imported(path, names, tmp_path) == {"ui.b", "ui.c", "rig_files.d", "native"}
    assert packages_of(path) == {"os", "bpy", "bpy_extras", "b", "c", "rig_files", "native"}


def test_every_folder_has_a_layer():
    assert {room_of(name) for name in NAMES} == set().union(*LAYERS)
    assert len(headers_and_sources()) > 20


def test_the_manual_has_the_layers():
    page = (ROOT / "docs/how-it-works.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| `(\w+)` \|", page, re.MULTILINE)
    files = {"native", "without_native", "__init__"}
    assert rows and {(int(number), room) for number, room in rows} == {
        (i, room) for i, layer in enumerate(LAYERS) for room in layer - files
    }
    levels = re.search(r"lowest first: (.+?)\. Folders at", page, re.DOTALL)[1].split(";")
    assert [set(re.findall(r"`(\w+)`", level)) for level in levels] == list(NATIVE_LAYERS)


def test_all_of_deform_is_logic():
    assert {name for name in NAMES if name.startswith("deform.")} - {"deform.__init__"} <= PURE


@pytest.mark.parametrize("name", sorted(PURE))
def test_logic_is_imported_without_blender(name):
    result = subprocess.run(
        [sys.executable, "-c", WITHOUT_BLENDER, str(ADDON), name], capture_output=True, text=True, timeout=60
    )
    assert result.returncode == 0, result.stderr


def test_what_needs_blender_is_refused_there():
    result = subprocess.run(
        [sys.executable, "-c", WITHOUT_BLENDER, str(ADDON), "blender.meshes"],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert "import of bmesh halted" in result.stderr


def test_layers_know_those_below_them_alone():
    number = {room: i for i, layer in enumerate(LAYERS) for room in layer}
    for path in MODULES:
        room = room_of(name_of(path))
        for other in {room_of(name) for name in imported(path)} - {room, "__init__"}:
            assert number[other] < number[room], f"{name_of(path)} imports {other}"


def test_native_rooms_know_those_below_them_alone():
    number = {room: i for i, layer in enumerate(NATIVE_LAYERS) for room in layer}
    sources = ROOT / "native" / "src"
    assert {path.name for path in sources.iterdir()} == set(number)
    known = {room: set() for room in number}
    for path in [*sources.rglob("*.h"), *sources.rglob("*.cpp")]:
        for other in re.findall(r'#include "(.*?)/', path.read_text()):
            known[path.relative_to(sources).parts[0]].add(other)
    for room, others in known.items():
        for other in others - {room, "sinew"}:
            assert number[other] < number[room], f"native/src/{room} includes {other}"
    assert known["deformer"] >= {"base", "mush", "skinning"}


def test_no_two_modules_know_each_other():
    graph = {name_of(path): imported(path) for path in MODULES}
    assert graph["ui.panels"] >= {"ui.sections", "run.characters"}
    graphlib.TopologicalSorter(graph).prepare()  # CycleError names the circle


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_only_native_imports_the_compiled_module(path):
    # `from .native import sinew_native` is the way for the others.
    if name_of(path) != "native":
        assert "sinew_native" not in packages_of(path)


def headers_and_sources():
    return sorted(path for path in (ROOT / "native").rglob("*") if path.suffix in {".h", ".cpp"})


def included(path):
    return set(re.findall(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', path.read_text(), re.MULTILINE))


def knows(path, *names):
    return any(re.search(rf"\b({'|'.join(names)})\b", header) for header in included(path))


def test_only_parallel_cpp_knows_tbb():
    users = {path.relative_to(ROOT / "native") for path in headers_and_sources() if knows(path, "tbb")}
    # The benchmarks' too: the student report's parallel program is measured as it was.
    assert users == {Path("src/base/parallel.cpp"), Path("bench/baselines.cpp")}


def test_what_a_thread_keeps_is_kept_by_per_thread_h():
    """A thread_local of its own would not be destroyed in time on Windows, as that header says."""
    users = {
        path.name
        for path in headers_and_sources()
        if re.search(r"^\s*(static )?thread_local\b", path.read_text(), re.M)
    }
    assert users == {"per_thread.h"}


def test_only_the_bindings_know_python():
    users = {
        path.relative_to(ROOT / "native").parts[0]
        for path in headers_and_sources()
        if knows(path, "Python", "pybind11")
    }
    assert users == {"bindings"}


def test_public_headers_include_public_headers_alone():
    public = {f"sinew/{path.name}" for path in (ROOT / "native" / "include" / "sinew").glob("*.h")}
    for path in (ROOT / "native" / "include").rglob("*.h"):
        ours = {header for header in included(path) if header.endswith(".h")}
        assert ours <= public, path.name


def asked_for(text):
    """The modules of the add-on for which a test in Blender asks by name, and beginnings of names that it completes."""
    rooms = dict(re.findall(r'^def (\w+)\(\w+\):\n    return addon_module\(f"(\w+)\.\{\w+\}"\)$', text, re.MULTILINE))
    found = set(re.findall(r'\baddon_module\(f?"([\w.]+)', text))
    for function, room in rooms.items():
        found |= {f"{room}.{name}" for name in re.findall(rf'\b{function}\("(\w+)"\)', text)}
    return found


def test_modules_that_tests_ask_for_by_name_are_there():
    """Some are asked for only where there is a file or an exporter, by tests that are skipped elsewhere."""
    rooms = {each.name for each in ADDON.iterdir() if each.is_dir()}
    known = NAMES | rooms | {f"{room}." for room in rooms}
    asked = {
        (path.name, name)
        for path in (ROOT / "tests" / "blender").rglob("*.py")
        for name in asked_for(path.read_text(encoding="utf-8"))
    }
    assert len(asked) > 300
    assert {(path, name) for path, name in asked if name not in known} == set()
