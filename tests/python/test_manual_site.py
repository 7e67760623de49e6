"""The manual as web pages: each section is found, and its links lead there."""

import importlib.util
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

pytest.importorskip("markdown")
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def manual():
    spec = importlib.util.spec_from_file_location("manual", ROOT / "addon/manual.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def site(manual, tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    manual.main([str(folder)])
    return folder


def index_of(site):
    text = (site / "search_index.js").read_text(encoding="utf-8")
    return json.loads(text.removeprefix("const INDEX = ").removesuffix(";\n"))


def test_every_section_is_in_the_index(site):
    index = index_of(site)
    for page in (ROOT / "docs").glob("*.md"):
        text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
        headings = len(re.findall(r"^#{1,4} ", text, re.MULTILINE))
        assert headings == sum(entry[0] == f"{page.stem}.html" for entry in index), page.name
    for page, anchor, _heading, _text in index:
        assert f'id="{anchor}"' in (site / page).read_text(encoding="utf-8")


def test_every_page_has_the_search_and_its_links_lead_somewhere(site):
    pages = list(site.glob("*.html"))
    assert len(pages) > 20 and (site / "index.html").read_bytes() == (site / "README.html").read_bytes()
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert 'id="search"' in text and 'src="search.js"' in text
        for link in re.findall(r'(?:href|src)="([^":]+)"', text):
            name, _, anchor = link.partition("#")
            assert not name or (site / name).exists(), (page.name, link)
            if anchor and (name or page.name).endswith(".html"):
                assert f'id="{anchor}"' in (site / (name or page.name)).read_text(encoding="utf-8"), (page.name, link)


def test_the_start_page_has_four_doors(site):
    text = (site / "index.html").read_text(encoding="utf-8")
    doors = re.findall(r"<h2 [^>]*>(.*?)</h2>\s*<ul>(.*?)</ul>", text, re.DOTALL)
    assert [name for name, _links in doors[:4]] == ["Animator", "Technical director", "Game artist", "Researcher"]
    assert all(links.count("<a ") >= 4 for _name, links in doors[:4])


@pytest.mark.skipif(shutil.which("node") is None, reason="Node.js is not there")
def test_what_is_searched_is_found(site, tmp_path):
    script = tmp_path / "search.js"
    script.write_text(
        (site / "search_index.js").read_text(encoding="utf-8")
        + f"const {{ find }} = require({json.dumps(str(site / 'search.js'))});"
        + "console.log(JSON.stringify(find(INDEX, process.argv[2])));",
        encoding="utf-8",
    )

    def found(query):
        done = subprocess.run(["node", script, query], capture_output=True, text=True, timeout=60, check=True)
        return json.loads(done.stdout)

    (first, *_) = found("check weights")
    assert (first["page"], first["anchor"]) == ("weights.html", "check-weights")
    assert "onion" in found("Onion SKINS")[0]["words"].lower()
    assert found("nosuchword") == found("  ") == [] and len(found("the")) == 20
