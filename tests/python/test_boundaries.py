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
# What talks to Blender; all else in the add-on works on arrays and on what these give it.
MAY_IMPORT_BLENDER = {"bench", "blender_io", "clip_keyframes", "command_line", "cures", "display", "handlers",
                      "menus", "notice", "operators", "outputs", "panels", "preferences", "progress",
                      "properties", "rig_import", "session", "without_native"}


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
    """operators.py and everything in operators/ is "operators"."""
    return path.relative_to(ADDON).with_suffix("").parts[0]


def test_imports_are_seen(tmp_path):
    path = tmp_path / "a.py"
    path.write_text("import os.path, bpy as b\ndef f():\n  from bpy_extras.io import x\n"
                    "  from . import native, deform\nfrom .outputs import OUTPUTS\n")
    assert imported(path) == ({"os", "bpy", "bpy_extras"}, {"native", "deform", "outputs"})


def test_there_are_files_to_look_at():
    assert {"deform", "native", "blender_io"} <= {role(path) for path in MODULES}
    assert len(headers_and_sources()) > 20


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.name)
def test_only_some_modules_know_blender(path):
    packages, _ = imported(path)
    if role(path) not in MAY_IMPORT_BLENDER:
        assert not packages & BLENDER


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.name)
def test_only_native_imports_the_compiled_module(path):
    packages, own = imported(path)
    # `from .native import sinew_native` is the way for the others.
    if role(path) != "native":
        assert "sinew_native" not in packages | own


@pytest.mark.parametrize("name, may_know", [("deform", {"native"}), ("blender_io", set()),
                                            ("native", {"sinew_native", "bl_info"})])
def test_the_bottom_of_the_addon_knows_nothing_above(name, may_know):
    _, own = imported(ADDON / f"{name}.py")
    assert own <= may_know


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
