"""Indexes for Get Extensions, as ./dev release makes one: Blender installs from it the zip for its own system, updates
it and removes it. So it does with the zips in which the modules are wheels. The index is a folder, without a network.
"""

import json
import os
import re
import shutil
import subprocess
import zipfile
from pathlib import Path

import bpy
import pytest

from helpers import needs_program

ZIP = Path(os.environ.get("SINEW_ZIP", "no zip"))
ZIPS = {  # those for one system
    "modules": sorted(ZIP.parent.glob(f"{ZIP.stem}-*.zip")),
    "wheels": sorted(ZIP.parent.glob(f"with-wheels/{ZIP.stem}-*-wheels.zip")),
}
pytestmark = [
    needs_program,
    pytest.mark.skipif(bpy.app.version < (4, 2, 0), reason="this Blender has no extensions"),
    pytest.mark.skipif(not all(ZIPS.values()), reason="there are no zips for one system beside SINEW_ZIP"),
]

ADD = """
import bpy
repos = bpy.context.preferences.extensions.repos
bpy.ops.preferences.extension_repo_add(name="Sinew", remote_url=url, type="REMOTE")
"""
SYNC = """
import bpy
repos = bpy.context.preferences.extensions.repos
index = [repo.remote_url for repo in repos].index(url)
bpy.ops.extensions.repo_sync(repo_index=index)
"""
INSTALL = """
bpy.ops.extensions.package_install(repo_index=index, pkg_id="sinew", enable_on_install=True)
bpy.ops.wm.save_userpref()
print("FOLDER", repos[index].directory)
"""
UPDATE = "bpy.ops.extensions.package_upgrade_all()"
REMOVE = """
bpy.ops.extensions.package_uninstall(repo_index=index, pkg_id="sinew")
bpy.ops.wm.save_userpref()
"""
LOOK = """
import bpy, sys
for addon in bpy.context.preferences.addons:
    if addon.module.endswith(".sinew"):
        core = sys.modules[addon.module + ".native"].sinew_native
        print("VERSION", core.__version__)
        print("MODULE", core.__file__)
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
    """A function that makes an index of zips, in place of the one that it has made before. Returns its path."""

    def make(zips):
        folder = tmp_path / "index"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        for path in zips:
            (folder / path.name).symlink_to(path.resolve())
        output, code = blender("--command", "extension", "server-generate", f"--repo-dir={folder}")
        assert code == 0 and f"found {len(zips)} packages" in output, output
        assert "warning" not in output.lower(), output
        return folder / "index.json"

    return make


def older(path, folder):
    """Writes a zip that is that of version 0.1.0. Returns its path."""
    target = folder / path.name
    with zipfile.ZipFile(path) as new, zipfile.ZipFile(target, "w") as old:
        for name in new.namelist():
            data = new.read(name)
            if name == "sinew/blender_manifest.toml":
                data = re.sub(rb'(?m)^version = ".+"$', b'version = "0.1.0"', data)
            old.writestr(name, data)
    return target


@pytest.mark.parametrize("kind", ZIPS)
def test_each_system_has_a_zip_of_its_own(index, kind):
    data = json.loads(index(ZIPS[kind]).read_text(encoding="utf-8"))["data"]
    assert {(*entry["platforms"], entry["archive_url"]) for entry in data} == {
        (system_of(path), f"./{path.name}") for path in ZIPS[kind]
    }
    assert {entry["id"] for entry in data} == {"sinew"}


@pytest.mark.parametrize("kind", ZIPS)
def test_blender_installs_updates_and_removes_the_zip_for_its_system(blender, index, tmp_path, kind):
    (tmp_path / "older").mkdir()
    url = index([older(path, tmp_path / "older") for path in ZIPS[kind]]).as_uri()
    output, code = run_script(blender, ADD + SYNC + INSTALL, url)
    assert code == 0, output
    installed = Path(re.search(r"(?m)^FOLDER (.+)$", output)[1]) / "sinew"
    assert 'version = "0.1.0"' in (installed / "blender_manifest.toml").read_text()

    index(ZIPS[kind])
    output, code = run_script(blender, SYNC + UPDATE, url)
    assert code == 0, output
    (ours,) = [path for path in ZIPS[kind] if manifest(path) == (installed / "blender_manifest.toml").read_text()]
    files = {path.relative_to(installed).as_posix() for path in installed.rglob("*") if path.is_file()}
    names = {name.removeprefix("sinew/") for name in zipfile.ZipFile(ours).namelist()}
    assert {name for name in names if name.startswith("sinew_native.")} <= files
    assert {name for name in files if "__pycache__" not in name} <= names

    output, code = run_script(blender, LOOK)  # at the next start
    version = re.search(r'(?m)^version = "(.+)"$', manifest(ours))[1]
    assert code == 0 and f"VERSION {version}\n" in output, output
    module = Path(re.search(r"(?m)^MODULE (.+)$", output)[1])
    assert module.is_relative_to(installed) == (kind == "modules")
    assert module.is_relative_to(tmp_path / "profile")

    output, code = run_script(blender, SYNC + REMOVE, url)
    assert code == 0, output
    output, code = run_script(blender, LOOK)
    assert code == 0 and "VERSION" not in output and "Traceback" not in output, output
    assert not installed.exists() and not module.exists()
