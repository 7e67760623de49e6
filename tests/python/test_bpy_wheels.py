""".ci/bpy: which official modules are downloaded, and that they are those that are listed. The index is a page here."""

import hashlib
import importlib.util
import platform
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

pytest.importorskip("pip._vendor.packaging", reason="this Python has no pip")
pytestmark = pytest.mark.skipif(
    (sys.platform, platform.machine()) != ("linux", "x86_64"), reason="what .ci has is for Linux on x86-64"
)
SCRIPT = Path(__file__).resolve().parents[2] / ".ci" / "bpy_wheels.py"
LINUX, WINDOWS, MAC = "manylinux_2_28_x86_64", "win_amd64", "macosx_13_0_arm64"


class Index:
    """A page with links to wheels of bpy, the list of those that are wanted, and a folder for those that are there."""

    def __init__(self, folder, monkeypatch):
        self.page, self.list, self.kept = folder / "index.html", folder / "bpy.sha256", folder / "kept"
        self.page.touch()
        self.list.touch()
        self.kept.mkdir()
        self.environment = monkeypatch
        monkeypatch.delenv("SINEW_BPY_INDEX", raising=False)
        monkeypatch.setenv("PIP_NO_INDEX", "1")  # nothing here may ask a real one

    def add(self, version, platform, python="cp313", hashed=True):
        """Puts a small wheel there. Returns its hash."""
        path = self.page.with_name(f"bpy-{version}-{python}-{python}-{platform}.whl")
        info = f"bpy-{version}.dist-info"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr(f"{info}/METADATA", f"Metadata-Version: 2.1\nName: bpy\nVersion: {version}\n")
            archive.writestr(f"{info}/WHEEL", f"Wheel-Version: 1.0\nTag: {python}-{python}-{platform}\n")
            archive.writestr(f"{info}/RECORD", "")
        sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
        with open(self.page, "a") as page:
            page.write(f'<a href="{path.name}{f"#sha256={sha256}" if hashed else ""}">{path.name}</a>\n')
        return sha256

    def want(self, version, platform, sha256, python="cp313"):
        with open(self.list, "a") as file:
            file.write(f"{sha256}  bpy-{version}-{python}-{python}-{platform}.whl\n")

    def ask(self, *arguments):
        """Returns the names that it prints. Raises RuntimeError with what it says if it fails."""
        self.environment.setenv("SINEW_BPY_INDEX", self.page.as_uri())
        done = subprocess.run(
            [sys.executable, SCRIPT, self.list, self.kept, *arguments], capture_output=True, text=True
        )
        if done.returncode:
            raise RuntimeError(done.stderr)
        return [Path(line).name for line in done.stdout.splitlines()]


@pytest.fixture
def index(tmp_path, monkeypatch):
    return Index(tmp_path, monkeypatch)


def test_the_newest_is_the_one_with_the_highest_number(index):
    for version in ("5.9.1", "5.10.0", "5.2.3"):
        index.add(version, LINUX)
    assert index.ask("newest", "linux") == [f"bpy-5.10.0-cp313-cp313-{LINUX}.whl"]


def test_without_a_system_there_are_all(index):
    for each in (LINUX, WINDOWS, MAC, "win_arm64", "some_thing"):
        index.add("5.3.0", each)
    assert [name.split("-", 4)[4] for name in index.ask("newest")] == [f"{LINUX}.whl", f"{WINDOWS}.whl", f"{MAC}.whl"]


def test_an_index_of_daily_builds_needs_no_hashes(index):
    index.add("5.4.0a0", LINUX, "cp314", hashed=False)
    index.add("5.3.0", LINUX)
    assert index.ask("newest", "linux") == [f"bpy-5.4.0a0-cp314-cp314-{LINUX}.whl"]


def test_the_newest_of_pypi_is_a_release(monkeypatch):
    monkeypatch.delenv("SINEW_BPY_INDEX", raising=False)
    spec = importlib.util.spec_from_file_location("bpy_wheels", SCRIPT)
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    names = [f"bpy-{version}-cp313-cp313-{LINUX}.whl" for version in ("5.2.3", "5.3.0", "5.4.0a1", "5.3.0rc1")]
    monkeypatch.setattr(script, "published", lambda: [script.wheel_of(name, "0" * 64) for name in names])
    assert [wheel.name for wheel in script.choose("newest", [])] == [names[1]]


def test_a_listed_one_is_what_is_listed_although_there_is_a_newer_one(index):
    index.want("5.2.3", LINUX, index.add("5.2.3", LINUX))
    index.add("5.2.4", LINUX)
    assert index.ask("5.2", "linux") == [f"bpy-5.2.3-cp313-cp313-{LINUX}.whl"]


def test_another_file_of_the_same_name_is_refused(index):
    index.add("5.2.3", LINUX)
    index.want("5.2.3", LINUX, "0" * 64)
    with pytest.raises(RuntimeError, match="could not be downloaded, or is another file than the one with the hash"):
        index.ask("5.2", "linux")
    assert not list(index.kept.iterdir())


def test_a_damaged_one_that_is_kept_is_replaced(index):
    index.want("5.2.3", LINUX, index.add("5.2.3", LINUX))
    (name,) = index.ask("5.2", "linux")
    right = (index.kept / name).read_bytes()
    (index.kept / name).write_bytes(b"damaged")
    index.ask("5.2", "linux")
    assert (index.kept / name).read_bytes() == right


def test_moving_lists_the_newest_release_of_each_series(index):
    index.want("4.2.1", LINUX, "0" * 64, "cp311")
    hashes = [index.add(f"4.2.{patch}", LINUX, "cp311") for patch in (1, 3)]
    _daily, release = index.add("5.3.1a0", MAC), index.add("5.3.0", MAC)
    index.ask("move", "5.3")
    assert index.list.read_text().split() == [
        hashes[1],
        f"bpy-4.2.3-cp311-cp311-{LINUX}.whl",
        release,
        f"bpy-5.3.0-cp313-cp313-{MAC}.whl",
    ]


def test_moving_changes_nothing_if_a_series_is_missing(index):
    index.want("4.2.1", LINUX, "0" * 64)
    before = index.list.read_text()
    index.add("5.3.0", LINUX)
    with pytest.raises(RuntimeError, match=r"has no release of 4\.2 with hashes, so .* stays as it is"):
        index.ask("move")
    assert index.list.read_text() == before


@pytest.mark.parametrize(
    "arguments, why",
    (
        (("9.9",), r"there is no series '9\.9' in \.ci/bpy\.sha256; expected newest or one of 5\.2"),
        (("5.2", "solaris"), "there is no system 'solaris'; expected linux, windows, macos-arm64, macos-x64"),
        (("5.2", "macos-x64"), r"bpy 5\.2\.3 is not there for macos-x64 but for linux"),
        (("move", "blender"), "'blender' is no series; expected such as 5.3"),
        (("newest",), "has no links to wheels of bpy"),
    ),
)
def test_what_there_is_not_is_named(index, arguments, why):
    index.want("5.2.3", LINUX, "0" * 64)
    with pytest.raises(RuntimeError, match=why):
        index.ask(*arguments)


def test_an_index_that_cannot_be_read_is_named(index):
    index.page.unlink()
    with pytest.raises(
        RuntimeError, match=r"index\.html cannot be read: .* Try again later, or correct SINEW_BPY_INDEX"
    ):
        index.ask("newest")
