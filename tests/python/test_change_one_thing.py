"""CONTRIBUTING begins with what to change for one thing: its tables name every file that has a part in it."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
# Tests in Blender use anything for anything, and measurements too: the tables name those that a change needs.
INCIDENTAL = re.compile(
    r"tests/blender/(test_|make_|edge_)|tests/native/rig_constraints_test|addon/bench_|docs/(?!(make_\w+\.py|blenders-memory\.md|rigs\.md)$)"
)
SOURCES = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
    for folder in ("addon", "native", "tests", "docs")
    for path in (ROOT / folder).rglob("*")
    if path.suffix in {".py", ".pyi", ".h", ".cpp", ".txt", ".md"} and path != Path(__file__).resolve()
}
TABLES = re.findall(r"<!--names-->(.*?)<!--/-->.*?\n\n(\|.*?\n)\n", PAGE, re.DOTALL)


def files_of(text):
    """Those that a text names, where a file after a comma is in the folder of the one before."""
    found, folder = [], ""
    for name in re.findall(r"`([\w./-]+\.(?:py|pyi|h|cpp|txt|md))`", text):
        if "/" not in name:
            name = f"{folder}/{name}"
        folder = name.rpartition("/")[0]
        found.append(name)
    return found


def first_cells(table):
    return [line.split("|")[1] for line in table.splitlines()[2:]]


@pytest.mark.parametrize(("names", "table"), TABLES, ids=[each[0].split("`")[1] for each in TABLES])
def test_a_table_names_every_file(names, table):
    words = re.findall(r"`(\w+)`", names)
    wanted = {
        name for name, text in SOURCES.items() if any(word in text for word in words) and not INCIDENTAL.match(name)
    }
    named = [name for cell in first_cells(table) for name in files_of(cell)]
    assert named and [name for name in named if name not in SOURCES] == []
    assert wanted - set(named) - {name for name in wanted if f"`{name}`" in table} == set()


def test_all_tables_are_found():
    assert len(TABLES) == 4 and PAGE.index("## Change one thing") < PAGE.index("\n## Layout")


def test_a_new_blender_names_every_file():
    """Those that have something for 5.3 alone: a version, or its place in a list of versions."""
    steps = re.search(r"### A new Blender\n(.*?)\n### ", PAGE, re.DOTALL)[1]
    places = [*(ROOT / ".ci").glob("*"), *(ROOT / ".ci/steps").glob("*"), *(ROOT / ".github").rglob("*.yml")]
    places += [ROOT / "README.md", ROOT / "docs/install.md", ROOT / "CHANGELOG.md"]
    version = re.compile(r"(?<![\d.])5\.3(\.0)?(?![\d.]*\d)|-5\.3\.0-")
    found = {
        path.relative_to(ROOT).as_posix()
        for path in places
        if path.is_file() and version.search(path.read_text(encoding="utf-8"))
    }
    assert len(found) >= 7 and {name for name in found if f"`{name}`" not in steps} == {".ci/bpy_wheels.py"}
