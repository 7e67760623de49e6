"""The index for Get Extensions that ./dev release makes: Blender installs from it the zip for its own system. The index
is in a folder and needs no network."""

import json
import os
import re
import subprocess
import zipfile
from pathlib import Path

import bpy
import pytest

from helpers import needs_program

ZIP = Path(os.environ.get("SINEW_ZIP", "no zip"))
ZIPS = sorted(ZIP.parent.glob(f"{ZIP.stem}-*.zip"))  # those for one system
pytestmark = [
    needs_program,
    pytest.mark.skipif(bpy.app.version < (4, 2, 0), reason="this Blender has no extensions"),
    pytest.mark.skipif(not ZIPS, reason="there are no zips for one system beside SINEW_ZIP"),
]

ADD = """
import bpy
repos = bpy.context.preferences.extensions.repos
bpy.ops.preferences.extension_repo_add(name="Sinew", remote_url=url, type="REMOTE")
index = [repo.remote_url for repo in repos].index(url)
bpy.ops.extensions.repo_sync(repo_index=index)
"""
INSTALL = """
bpy.ops.extensions.package_install(repo_index=index, pkg_id="sinew", enable_on_install=True)
bpy.ops.wm.save_userpref()
print("FOLDER", repos[index].directory)
"""
LOOK = """
import bpy, sys
(name,) = [addon.module for addon in bpy.context.preferences.addons if addon.module.endswith(".sinew")]
print("VERSION", sys.modules[name + ".native"].sinew_native.__version__)
"""


def manifest(path):
    return zipfile.ZipFile(path).read("sinew/blender_manifest.toml").decode()


def system_of(path):
    """The one system in a zip's manifest."""
    return re.search(r'(?m)^platforms = \["([\w-]+)"\]$', manifest(path))[1]


@pytest.fixture
def blender(tmp_path):
    """A function that runs a Blender in a profile of its own and returns what it printed, and how it ended."""

    def run(*arguments):
        environment = {**os.environ, "HOME": str(tmp_path), "BLENDER_USER_RESOURCES": str(tmp_path / "profile")}
        (tmp_path / "profile").mkdir(exist_ok=True)
        done = subprocess.run([bpy.app.binary_path, *arguments], env=environment, capture_output=True, text=True)
        return done.stdout + done.stderr, done.returncode

    return run


def run_script(blender, text, url=""):
    # Blender installs from no index while it is offline, be it in a folder.
    return blender(*("-b", "--online-mode", "--python-exit-code", "1", "--python-expr"), f"url = {url!r}\n{text}")


@pytest.fixture
def index(blender, tmp_path):
    """A function that makes an index of zips. Returns its path."""

    def make(zips):
        folder = tmp_path / "index"
        folder.mkdir()
        for path in zips:
            (folder / path.name).symlink_to(path.resolve())
        output, code = blender("--command", "extension", "server-generate", f"--repo-dir={folder}")
        assert code == 0 and f"found {len(zips)} packages" in output, output
        assert "warning" not in output.lower(), output
        return folder / "index.json"

    return make


def test_each_system_has_a_zip_of_its_own(index):
    data = json.loads(index(ZIPS).read_text(encoding="utf-8"))["data"]
    assert {(*entry["platforms"], entry["archive_url"]) for entry in data} == {
        (system_of(path), f"./{path.name}") for path in ZIPS
    }
    assert {entry["id"] for entry in data} == {"sinew"}


def test_blender_installs_the_zip_for_its_system(blender, index):
    output, code = run_script(blender, ADD + INSTALL, index(ZIPS).as_uri())
    assert code == 0, output
    installed = Path(re.search(r"(?m)^FOLDER (.+)$", output)[1]) / "sinew"
    (ours,) = [path for path in ZIPS if manifest(path) == (installed / "blender_manifest.toml").read_text()]
    files = {path.relative_to(installed).as_posix() for path in installed.rglob("*") if path.is_file()}
    names = {name.removeprefix("sinew/") for name in zipfile.ZipFile(ours).namelist()}
    assert {name for name in names if name.startswith("sinew_native.")} <= files
    assert {name for name in files if "__pycache__" not in name} <= names
    output, code = run_script(blender, LOOK)  # at the next start
    version = re.search(r'(?m)^version = "(.+)"$', manifest(ours))[1]
    assert code == 0 and f"VERSION {version}\n" in output, output
