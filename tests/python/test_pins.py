"""What is downloaded is taken by version and hash."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CI = ROOT / ".ci"
HASH = "[0-9a-f]{64}"


def lines(path):
    return [line for line in path.read_text(encoding="utf-8").splitlines() if line and not line.startswith("#")]


@pytest.mark.parametrize("path", sorted((ROOT / ".github" / "workflows").glob("*.yml")), ids=lambda path: path.name)
def test_actions_are_taken_by_the_hash_of_a_commit(path):
    used = [line for line in lines(path) if re.match(r"[\s-]*uses:", line)]
    assert used
    assert not [
        line for line in used if not re.fullmatch(r"[\s-]*uses: [\w-]+/[\w-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", line)
    ]


@pytest.mark.parametrize("path", sorted(set(CI.glob("*.txt")) - {CI / "debian.txt"}), ids=lambda path: path.name)
def test_packages_from_pypi_are_taken_by_version_and_hash(path):
    wrong = [line for line in lines(path) if not re.fullmatch(rf"[\w.-]+==[\w.]+( --hash=sha256:{HASH})+", line)]
    assert not wrong


@pytest.mark.parametrize("path", sorted(CI.glob("*.sha256")), ids=lambda path: path.name)
def test_files_are_listed_with_their_hashes(path):
    assert lines(path)
    assert not [line for line in lines(path) if not re.fullmatch(rf"{HASH}  [\w.+-]+", line)]


def test_each_official_module_of_the_tests_is_listed():
    (versions,) = re.findall(
        r'^VERSIONS="\\\n(.*?)"', (CI / "blender").read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    ends = {"PyPI": "manylinux_2_28_x86_64", "Windows": "win_amd64"}
    wanted = [
        (series, ends[source]) for _name, series, source, *_ in map(str.split, versions.splitlines()) if source in ends
    ]
    names = [line.split()[1] for line in lines(CI / "bpy.sha256")]
    assert len(wanted) > 6
    for series, end in wanted:
        found = [name for name in names if re.fullmatch(rf"bpy-{re.escape(series)}\.\d+-\w+-\w+-{end}\.whl", name)]
        assert len(found) == 1, f"{series}, {end}: {found}"
