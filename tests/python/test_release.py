""".ci/release.py: what may be released, and what lies beside the zips."""

import hashlib
import importlib.util
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / ".ci" / "release.py"
CHANGELOG = """\
# Changelog

What users notice, newest first.

## 1.2.0

**Deforming**
* Frames are faster, as
  [measured](docs/speed.md#a-shot) and as [others](https://example.org/x) say.
* A second line.

## 1.1.0

* Older.
"""


needs_git = pytest.mark.skipif(not shutil.which("git"), reason="git is not there")


def load():
    spec = importlib.util.spec_from_file_location("release", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


release = load()


def made(folder, version="1.2.0"):
    """A build folder with what ./dev package and ./dev wheel write."""
    (folder / "wheels").mkdir(parents=True)
    for ending in ("", *(f"-{platform}" for platform in release.PLATFORMS)):
        (folder / f"sinew-{version}{ending}.zip").write_bytes(f"zip{ending}".encode())
    for tag in (
        "manylinux_2_34_x86_64",
        "manylinux_2_34_aarch64",
        "win_amd64",
        "macosx_11_0_x86_64",
        "macosx_11_0_arm64",
    ):
        (folder / "wheels" / f"sinew_native-{version}-cp311-cp311-{tag}.whl").write_bytes(tag.encode())
    return folder


def write_index(folder, platforms=release.PLATFORMS):
    entries = []
    for platform in platforms:
        name = f"sinew-1.2.0-{platform}.zip"
        digest = hashlib.sha256((folder / name).read_bytes()).hexdigest()
        entries.append({"platforms": [platform], "archive_url": f"./{name}", "archive_hash": f"sha256:{digest}"})
    (folder / "index.json").write_text(json.dumps({"version": "v1", "data": entries}))


def test_a_version_that_is_described_and_not_out_is_released():
    release.check("1.2.0", "", ["v1.1.0", "v1.20.0"], CHANGELOG)


@pytest.mark.parametrize(
    "version, changes, tags, changelog, message",
    [
        ("1.2.0", " M dev\n?? new file.py\n", [], CHANGELOG, "not committed: dev, new file.py. Commit or remove them"),
        ("1.2.0", "".join(f" M {n}\n" for n in range(7)), [], CHANGELOG, "not committed: 0, 1, 2, 3, 4 and 2 more. "),
        (
            "1.2.0",
            "",
            ["v1.2.0"],
            CHANGELOG,
            "there is a git tag v1.2.0 already, so 1.2.0 is out. Raise the version in",
        ),
        ("1.3.0", "", [], CHANGELOG, 'CHANGELOG.md has no section "## 1.3.0". Describe there what is new'),
        ("1.2.0", "", [], "# Changelog\n", 'CHANGELOG.md has no section "## 1.2.0"'),
        ("1.1.0", "", [], CHANGELOG, 'CHANGELOG.md begins with "## 1.2.0"; expected "## 1.1.0". Move what is new'),
        (
            "1.2.0",
            "",
            [],
            CHANGELOG.replace("## 1.2.0", "## Not yet released\n\n* New.\n\n## 1.2.0"),
            'CHANGELOG.md begins with "## Not yet released"; expected "## 1.2.0". Move what is new to that section',
        ),
        (
            "1.3.0",
            "",
            [],
            CHANGELOG.replace("## 1.2.0", "## 1.3.0\n\n## 1.2.0"),
            'the section "## 1.3.0" of CHANGELOG.md is empty',
        ),
    ],
)
def test_what_cannot_be_released_is_refused(version, changes, tags, changelog, message):
    with pytest.raises(SystemExit) as refusal:
        release.check(version, changes, tags, changelog)
    assert str(refusal.value).startswith("./dev release: ") and message in str(refusal.value)


def test_notes_are_the_versions_section():
    assert release.notes(CHANGELOG, "1.2.0") == (
        "# Sinew 1.2.0\n\n"
        "**Deforming**\n"
        "* Frames are faster, as measured and as [others](https://example.org/x) say.\n"
        "* A second line.\n"
    )
    assert release.notes(CHANGELOG, "1.1.0") == "# Sinew 1.1.0\n\n* Older.\n"


def test_the_projects_own_changelog_has_notes():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    notes = release.notes(text, "0.2.0")
    assert notes.startswith("# Sinew 0.2.0\n") and "](docs/" not in notes and "## 0.1.0" not in notes


def test_zips_and_wheels_of_the_version_are_collected(tmp_path):
    build, folder = made(tmp_path / "build"), tmp_path / "build" / "release"
    (build / "sinew-1.1.0.zip").write_bytes(b"older")
    (build / "wheels" / "sinew_native-1.1.0-cp311-cp311-win_amd64.whl").write_bytes(b"older")
    folder.mkdir()
    (folder / "left from an earlier run").write_bytes(b"")
    release.collect(build, folder, "1.2.0")
    names = [path.name for path in folder.iterdir()]
    assert len(names) == 1 + 2 * len(release.PLATFORMS) and all("1.2.0" in name for name in names)
    assert (folder / "sinew-1.2.0-macos-x64.zip").read_bytes() == b"zip-macos-x64"


@pytest.mark.parametrize("platform", release.PLATFORMS)
def test_a_platform_without_a_zip_or_a_wheel_is_refused(tmp_path, platform):
    build = made(tmp_path / "no wheel")
    for path in (build / "wheels").glob(release.PLATFORMS[platform]):
        path.unlink()
    with pytest.raises(
        SystemExit, match=f"there is no wheel of 1.2.0 for {platform} in .*which ./dev wheel should have"
    ):
        release.collect(build, tmp_path / "release", "1.2.0")
    build = made(tmp_path / "no zip")
    (build / f"sinew-1.2.0-{platform}.zip").unlink()
    with pytest.raises(
        SystemExit, match=f"there is no .*sinew-1.2.0-{platform}.zip, which ./dev package should have made"
    ):
        release.collect(build, tmp_path / "release", "1.2.0")
    assert not (tmp_path / "release").exists()


def test_an_index_lists_the_very_zips(tmp_path):
    folder = made(tmp_path)
    write_index(folder)
    release.check_index(folder)
    (folder / "sinew-1.2.0-windows-x64.zip").write_bytes(b"another")
    with pytest.raises(
        SystemExit, match="does not list sinew-1.2.0-windows-x64.zip for windows-x64. Look for Blender's"
    ):
        release.check_index(folder)


def test_an_index_that_lacks_a_platform_is_refused(tmp_path):
    folder = made(tmp_path)
    write_index(folder, [platform for platform in release.PLATFORMS if platform != "linux-arm64"])
    with pytest.raises(SystemExit, match="does not list sinew-1.2.0-linux-arm64.zip for linux-arm64"):
        release.check_index(folder)


def test_without_an_index_there_is_no_release(tmp_path):
    with pytest.raises(
        SystemExit, match=r"there is no .*index.json, which Blender should have made. Look for its error"
    ):
        release.check_index(tmp_path)


def test_git_is_wanted(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(SystemExit, match="there is no program git. Install git, and run this in a clone"):
        release.git("tag")


@needs_git
def test_a_clone_is_wanted(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    with pytest.raises(SystemExit, match="git tag says: fatal: not a git repository.* run this in a clone"):
        release.git("tag")


@pytest.mark.parametrize("old_sums", [False, True])
def test_checksums_are_of_all_other_files(tmp_path, old_sums):
    (tmp_path / "b.whl").write_bytes(b"b")
    (tmp_path / "a.zip").write_bytes(b"a")
    if old_sums:
        (tmp_path / "SHA256SUMS").write_text("from before")
    expected = "".join(f"{hashlib.sha256(n[:1].encode()).hexdigest()}  {n}\n" for n in ("a.zip", "b.whl"))
    assert release.sums(tmp_path) == expected


@needs_git
def test_the_commands_in_a_repository(tmp_path):
    """From the question whether to release to the notes and the sums."""

    def run(*command):
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)

    def git(*words):
        done = run("git", "-c", "user.name=A", "-c", "user.email=a@example.org", *words)
        assert done.returncode == 0, done.stderr

    (tmp_path / "addon/sinew").mkdir(parents=True)
    (tmp_path / "addon/sinew/blender_manifest.toml").write_text('schema_version = "1.0.0"\nversion = "1.2.0"\n')
    (tmp_path / "CHANGELOG.md").write_text(CHANGELOG)
    (tmp_path / ".gitignore").write_text("build\n")
    git("init", "--quiet")
    assert "not committed: " in run(sys.executable, str(SCRIPT), "check").stderr
    git("add", ".")
    git("commit", "--quiet", "--message", "All")
    done = run(sys.executable, str(SCRIPT), "check")
    assert (done.returncode, done.stdout.strip()) == (0, "1.2.0"), done.stderr

    folder = made(tmp_path / "build") / "release"
    assert run(sys.executable, str(SCRIPT), "collect", "build", "build/release").returncode == 0
    write_index(folder)
    assert run(sys.executable, str(SCRIPT), "finish", "build/release").returncode == 0
    assert (folder / "NOTES.md").read_text().startswith("# Sinew 1.2.0\n")
    lines = (folder / "SHA256SUMS").read_text().splitlines()
    assert len(lines) == 1 + 2 * len(release.PLATFORMS) + 2  # the index and the notes too

    git("tag", "v1.2.0")
    done = run(sys.executable, str(SCRIPT), "check")
    assert done.returncode == 1 and "git tag v1.2.0 already" in done.stderr
    assert "release.py check" in run(sys.executable, str(SCRIPT)).stderr
