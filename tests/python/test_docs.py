"""The manual: its reference is what the module says, its examples run, its links lead somewhere."""

import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest
import sinew_native as sinew

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
API = DOCS / "python-api.md"
PAGES = [*sorted(ROOT.glob("*.md")), *sorted(DOCS.glob("*.md"))]
CODE = re.compile(r"^ *```.*?^ *```$|`[^`\n]+`", re.MULTILINE | re.DOTALL)


def generator(name="make_python_api"):
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_reference_is_up_to_date():
    assert generator().check(sinew) is None


def test_an_old_reference_is_noticed(tmp_path):
    maker = generator()
    maker.PAGE = tmp_path / "page.md"
    maker.PAGE.write_text(API.read_text(encoding="utf-8") + "more", encoding="utf-8")
    assert "run docs/make_python_api.py" in maker.check(sinew)
    maker.PAGE.write_text(API.read_text(encoding="utf-8").replace(maker.MARK, ""), encoding="utf-8")
    with pytest.raises(ValueError, match="has lost its line"):
        maker.check(sinew)


def test_the_tables_of_blenders_memory_are_up_to_date(tmp_path):
    maker = generator("make_memory_table")
    assert maker.check() is None
    old = tmp_path / "page.md"
    old.write_text(maker.PAGE.read_text(encoding="utf-8").replace("Blender's own modifiers deform", "all is well"))
    maker.PAGE = old
    assert "run docs/make_memory_table.py" in maker.check()


WRITES = {  # by address, as Python and C++ do
    "addon/sinew/host/*.py": r"\.value = |memmove\(|host\.(write|play|step|silence|restore)_",
    "native/bindings/host/*.*": r"\bwrite\(\w|memcpy\((reinterpret_cast<void|to\b)",
}


def test_all_that_writes_into_blenders_memory_is_listed():
    table = (DOCS / "blenders-memory.md").read_text(encoding="utf-8").split("## What is written")[1].split("\n## ")[0]
    listed = set(re.findall(r"[a-z_]+\.(?:py|cpp|h)\b", table))
    for pattern, writes in WRITES.items():
        for each in ROOT.glob(pattern):
            if re.search(writes, each.read_text(encoding="utf-8")):
                assert each.name in listed
    assert all(any((ROOT / pattern).parent.joinpath(name).exists() for pattern in WRITES) for name in listed)


def python_of(page):
    return re.findall(r"^```python\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def test_the_example_of_a_rig_runs():
    (example,) = python_of(DOCS / "rigs.md")
    exec(compile(example, "rigs.md", "exec"), {})


def test_all_entries_of_rigs_are_explained():
    reader = (ROOT / "native/src/files/rig_file.cpp").read_text(encoding="utf-8")
    known = set(re.findall(r'\{"(\w+)",\s*(?:\[\]|into|read)', reader))
    assert {"format", "matrix_local", "settings", "stored_angles", "use_reverse", "hooks"} < known
    page = (DOCS / "rigs.md").read_text(encoding="utf-8")
    assert len(known) > 90 and [name for name in known if f"`{name}`" not in page and f'"{name}":' not in page] == []


def test_the_tables_of_rigs_are_up_to_date(tmp_path):
    maker = generator("make_rig_tables")
    assert maker.check(sinew) is None
    old = tmp_path / "page.md"
    old.write_text(maker.PAGE.read_text(encoding="utf-8").replace("`rotation_quaternion`", "`rotation`"))
    maker.PAGE = old
    assert "run docs/make_rig_tables.py" in maker.check(sinew)


def test_each_measured_number_is_what_its_table_says():
    maker = generator("make_quotes")
    assert maker.check() is None
    quotes = sum(len(maker.QUOTE.findall(page.read_text(encoding="utf-8"))) for page in maker.pages())
    assert quotes >= 10


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("takes <!--a: x; 5.2; frame-->3<!--/--> ms", "run docs/make_quotes.py"),
        ("<!--a: x; 5.2; frame-->2.50<!--/--> ms", "a quote at the beginning of a line"),
        ("takes <!--a: y; frame-->3<!--/--> ms", "a.md has 0 rows with y and a column frame; expected one"),
        ("takes <!--a: x; frame-->3<!--/--> ms", "a.md has 2 rows with x and a column frame; expected one"),
    ],
)
def test_a_wrong_quote_is_noticed(tmp_path, text, message):
    maker = generator("make_quotes")
    table = "| rig | Blender | frame |\n|---|---|---|\n| x | 5.2 | **2.50** (3x) |\n| x | 4.3 | 2.60 (4x) |\n"
    (tmp_path / "a.md").write_text(table)
    (tmp_path / "b.md").write_text(text)
    maker.DOCS, maker.pages = tmp_path, lambda: [tmp_path / "b.md"]
    try:
        found = maker.check()
    except ValueError as error:
        found = str(error)
    assert message in found
    assert maker.number("a", "x; 5.2; frame") == "2.50" and maker.number("a", "x; 4.3; frame ()") == "4x"


def test_the_example_runs(monkeypatch):
    monkeypatch.chdir(ROOT)
    examples = [block for block in python_of(API) if "= sinew." in block and "sinew_native as sinew  #" not in block]
    assert len(examples) == 5
    names = {}
    exec(compile("".join(examples), str(API), "exec"), names)
    skin, matrices, shapes = names["skin"], names["matrices"], names["shapes"]
    assert names["positions"].shape == (skin.vertex_count, 3)
    assert np.array_equal(shapes[7], sinew.skin_linear(skin, matrices[7]))
    assert np.abs(shapes[7] - skin.rest_positions).max() > 0.01
    assert names["weighed"].unweighted_count == 0
    stage, expected = names["smooth"].stage(), shapes[7].copy()
    stage.apply(expected)
    assert np.array_equal(names["smoothed"][7], expected) and not np.array_equal(expected, shapes[7])


def anchors(page):
    """Of the headings, as the usual renderers make them."""
    found = set()
    text = re.sub(r"^ *```.*?^ *```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    for heading in re.findall(r"^#+ +(.+?) *$", text, re.MULTILINE):
        name = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        number, unique = 0, name
        while unique in found:
            number += 1
            unique = f"{name}-{number}"
        found.add(unique)
    return found


def links(page):
    text = CODE.sub("", page.read_text(encoding="utf-8"))
    return re.findall(r"\]\(([^)\s]+)", text) + re.findall(r"""(?:src|href)=["']([^"']+)""", text)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    broken = []
    for link in links(page):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        is_there = target.exists() and target.is_relative_to(ROOT)
        if not is_there or (anchor and target.suffix == ".md" and anchor not in anchors(target)):
            broken.append(link)
    assert not broken


def test_links_of_the_manual_lead_nowhere_else():
    """Its pages are in the add-on's zip, which has nothing beside them."""
    assert [(page.name, link) for page in DOCS.glob("*.md") for link in links(page) if link.startswith("..")] == []


def test_links_are_found():
    assert {"how-it-works.md", "#settings"} <= set(links(API))
    assert "rooms.svg" in links(DOCS / "how-it-works.md") and "frame.svg" in links(DOCS / "a-frame.md")
    assert {"the-two-outputs", "layers"} <= anchors(DOCS / "how-it-works.md")


def test_the_picture_of_the_folders_has_all_of_them():
    text = (DOCS / "rooms.svg").read_text(encoding="utf-8")
    words = set(re.findall(r"\w+", " ".join(re.findall(r"<text[^>]*>([^<]+)<", text))))
    for folder in (ROOT / "addon/sinew", ROOT / "native/src"):
        folders = {each.name for each in folder.iterdir() if each.is_dir() and each.name != "__pycache__"}
        assert folders and folders <= words, folders - words


def builds():
    """(version, build) of each line of the one list of versions."""
    script = (ROOT / ".ci/blender").read_text(encoding="utf-8")
    for line in re.search(r'^VERSIONS="\\\n(.+?)"', script, re.MULTILINE | re.DOTALL)[1].splitlines():
        _name, version, source, release, *_ = line.split()
        yield (
            version,
            {"Debian": f"Debian {release}", "PyPI": "official module", "Windows": "official for Windows"}[source],
        )


def test_the_table_of_versions_is_what_is_tested():
    page = (DOCS / "install.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d\.\d)(?: LTS)? \| (.+?), \1\.\d+ \|", page, re.MULTILINE)
    assert rows == list(builds())


def test_the_readme_is_one_page():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 110 and len(text.split()) <= 900


def test_the_changelog_begins_with_this_version():
    """sinew.__version__ comes from the manifest."""
    versions = re.findall(r"^## (\S+)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert versions[0] == sinew.__version__ and "0.1.0" in versions[1:]


def test_contributors_are_sent_to_files_that_are_there():
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = re.findall(r"`([\w./-]+\.(?:py|pyi|h|cpp|toml|txt))`", page)
    there = [
        path.as_posix() for folder in (".ci", "addon", "native", "tests", "docs") for path in (ROOT / folder).rglob("*")
    ]
    assert len(named) > 20
    assert [name for name in named if not any(path.endswith(f"/{name}") for path in there)] == []
