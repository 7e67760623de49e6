"""Who may know whom, read from the sources. The reasons stand in CONTRIBUTING.md's layout: logic runs
without Blender, one file talks to TBB, one to the compiled module."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ADDON = ROOT / "addon" / "sinew"
MODULES = sorted(ADDON.rglob("*.py"))

BLENDER = {"addon_utils", "bgl", "blf", "bmesh", "bpy", "bpy_extras", "gpu", "gpu_extras", "mathutils"}
# Which files outside of blender/, ui/ and cli/ talk to Blender; all others work on arrays and on what those give them.
MAY_IMPORT_BLENDER = {
    "binding/bind",
    "binding/deformed_copy",
    "binding/old_files",
    "binding/properties",
    "binding/wiring",
    "profiling/measure",
    "rigs/clip_keyframes",
    "rigs/rig_import",
    "session/characters",
    "session/deformed_copies",
    "session/handlers",
    "without_native",
}


def imported(path):
    """(top-level packages, names of the add-on's own modules) that a file imports, at any depth."""
    packages, own = set(), set()
    for node in ast.walk(ast.parse(path.read_text(), str(path))):
        if isinstance(node, ast.Import):
            packages |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            packages.add(node.module.split(".")[0])
        elif isinstance(node, ast.ImportFrom) and node.module:
            own.add(node.module.split(".")[0])
        elif isinstance(node, ast.ImportFrom):
            own |= {alias.name for alias in node.names}
    return packages, own


def role(path):
    """The folder that a file is in, or its own name."""
    return path.relative_to(ADDON).with_suffix("").parts[0]


def name_of(path):
    return path.relative_to(ADDON).with_suffix("").as_posix()


def rooms_known(path):
    """The folders of the add-on, other than its own, that a file imports from."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(), str(path))):
        if isinstance(node, ast.ImportFrom) and node.level == 2:
            found |= {node.module.split(".")[0]} if node.module else {alias.name for alias in node.names}
    return found


def test_imports_are_seen(tmp_path):
    path = tmp_path / "a.py"
    path.write_text(
        "import os.path, bpy as b\ndef f():\n  from bpy_extras.io import x\n"
        "  from . import native, deform\nfrom .outputs import OUTPUTS\n"
    )
    assert imported(path) == ({"os", "bpy", "bpy_extras"}, {"native", "deform", "outputs"})


def test_there_are_files_to_look_at():
    assert {"deform", "native", "blender", "session"} <= {role(path) for path in MODULES}
    assert len(headers_and_sources()) > 20


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_only_some_modules_know_blender(path):
    packages, _ = imported(path)
    if role(path) not in {"blender", "ui", "cli"} and name_of(path) not in MAY_IMPORT_BLENDER:
        assert not packages & BLENDER


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_only_native_imports_the_compiled_module(path):
    packages, own = imported(path)
    # `from .native import sinew_native` is the way for the others.
    if name_of(path) != "native":
        assert "sinew_native" not in packages | own


@pytest.mark.parametrize(
    "room, may_know",
    [
        ("blender", {"native"}),
        ("deform", {"native"}),
        ("profiling", {"binding", "blender", "session"}),
        ("cli", {"binding", "blender", "profiling", "rigs", "session"}),
    ],
)
def test_who_may_know_whom(room, may_know):
    for path in (ADDON / room).glob("*.py"):
        assert rooms_known(path) <= may_know, path.name


def test_the_command_line_alone_knows_the_command_line():
    assert [path.name for path in MODULES if "cli" in rooms_known(path)] == []


def test_native_knows_nothing_above():
    assert imported(ADDON / "native.py")[1] <= {"sinew_native", "bl_info"}


def headers_and_sources():
    return sorted(path for path in (ROOT / "native").rglob("*") if path.suffix in {".h", ".cpp"})


def included(path):
    return set(re.findall(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', path.read_text(), re.MULTILINE))


def knows(path, *names):
    return any(re.search(rf"\b({'|'.join(names)})\b", header) for header in included(path))


def test_only_parallel_cpp_knows_tbb():
    users = {path.relative_to(ROOT / "native") for path in headers_and_sources() if knows(path, "tbb")}
    # The benchmarks' too: the student report's parallel program is measured as it was.
    assert users == {Path("src/parallel.cpp"), Path("bench/baselines.cpp")}


def test_only_the_bindings_know_python():
    users = {path.parent.name for path in headers_and_sources() if knows(path, "Python", "pybind11")}
    assert users == {"bindings"}


def test_public_headers_include_public_headers_alone():
    public = {f"sinew/{path.name}" for path in (ROOT / "native" / "include" / "sinew").glob("*.h")}
    for path in (ROOT / "native" / "include").rglob("*.h"):
        ours = {header for header in included(path) if header.endswith(".h")}
        assert ours <= public, path.name
