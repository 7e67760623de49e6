"""The zip itself: what is in it, and installing, updating and removing it in a Blender of its own."""

import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import bpy
import pytest

from helpers import COMMAND, ROOT, needs_program

ZIP = Path(os.environ.get("SINEW_ZIP", "no zip"))
EXTENSIONS = bpy.app.version >= (4, 2, 0)
needs_zip = pytest.mark.skipif(not ZIP.is_file(), reason="SINEW_ZIP does not name the zip")

SCRIPTS = {
    "install": """
if extensions:
    bpy.ops.extensions.package_install_files(filepath=path, repo="user_default", enable_on_install=True)
else:
    bpy.ops.preferences.addon_install(filepath=path, overwrite=True)
    bpy.ops.preferences.addon_enable(module="sinew")
bpy.ops.wm.save_userpref()
""",
    "disable": "bpy.ops.preferences.addon_disable(module=module)\nbpy.ops.wm.save_userpref()\n",
    "enable": "bpy.ops.preferences.addon_enable(module=module)\nbpy.ops.wm.save_userpref()\n",
    "remove": """
if extensions:
    bpy.ops.extensions.package_uninstall(repo_index=[repo.module for repo in
        bpy.context.preferences.extensions.repos].index("user_default"), pkg_id="sinew")
else:
    bpy.ops.preferences.addon_disable(module=module)
    class Area:
        tag_redraw = staticmethod(lambda: None)
    from bl_operators.userpref import PREFERENCES_OT_addon_remove as Remove
    path = Remove.path_from_addon("sinew")[0]
    import shutil; shutil.rmtree(path)  # the operator itself wants the window's area
bpy.ops.wm.save_userpref()
""",
    "look": """
import sys
found = sys.modules.get(module)
print("LOOK", module in bpy.context.preferences.addons, hasattr(bpy.types.Object, "sinew"),
      hasattr(bpy.types, "VIEW3D_PT_sinew"),
      sum("sinew" in handler.__module__ for name in dir(bpy.app.handlers)
          for handler in (getattr(bpy.app.handlers, name)
                          if isinstance(getattr(bpy.app.handlers, name), list) else ())),
      sys.modules[module + ".native"].VERSION if found else "-")
""",
    "ask": """
addon = sys.modules[module]
print("MODULES", [part.__name__.rpartition(".")[2] for part in addon.MODULES])
print("PROBLEM", addon.native.problem)
""",
}
HANDLERS = 30 + hasattr(bpy.app.handlers, "save_post_fail")
GONE, RUNNING = "False False False 0 -", f"True True True {HANDLERS} "


@pytest.fixture
def profile(tmp_path):
    """A function that runs scripts, one after the other, in a Blender with a profile of its own. Returns
    what it printed."""

    def run(*scripts, path=ZIP):
        text = (
            f"import bpy, sys\nextensions = {EXTENSIONS}\npath = {str(path)!r}\n"
            "module = 'bl_ext.user_default.sinew' if extensions else 'sinew'\n"
        )
        text += "".join(SCRIPTS[script] for script in scripts)
        environment = {**os.environ, "HOME": str(tmp_path), "BLENDER_USER_RESOURCES": str(tmp_path / "profile")}
        (tmp_path / "profile").mkdir(exist_ok=True)
        done = subprocess.run(
            [*COMMAND, "-b", "--python-exit-code", "1", "--python-expr", text],
            env=environment,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        assert "sinew" not in "".join(re.findall(r"(?s)Traceback.*", done.stderr)), done.stderr
        return done.stdout

    return run


def seen(output):
    return re.findall(r"^LOOK (.*)$", output, re.MULTILINE)


def files_of(folder):
    return sorted(
        str(path.relative_to(folder))
        for path in folder.rglob("*")
        if path.is_file() and "sinew" in str(path.relative_to(folder))
    )


def changed_zip(folder, version=None, without_modules=False):
    """The zip with another version stated, or without the compiled modules that this Python could load."""
    target = folder / "changed.zip"
    with zipfile.ZipFile(ZIP) as old, zipfile.ZipFile(target, "w") as new:
        for entry in old.infolist():
            data, name = old.read(entry), entry.filename
            if version and name == "sinew/blender_manifest.toml":
                data = re.sub(rb'(?m)^version = ".+"', f'version = "{version}"'.encode(), data)
            if version and name == "sinew/__init__.py":
                numbers = version.replace(".", ", ").encode()
                data = re.sub(rb'"version": \(.+?\)', b'"version": (' + numbers + b")", data)
            if without_modules and "/sinew_native." in name:
                name, data = "sinew/sinew_native.cpython-36-x86_64-linux-gnu.so", b""
            if name not in new.namelist():
                new.writestr(name, data)
    return target


def version():
    return re.search(r'(?m)^version = "(.+)"', (ROOT / "addon/sinew/blender_manifest.toml").read_text())[1]


@needs_zip
def test_contents():
    names = zipfile.ZipFile(ZIP).namelist()
    assert names[0] == "sinew/"  # 3.4 removes an older version for the sake of this entry
    assert all(name.startswith("sinew/") for name in names)
    assert {
        "sinew/LICENSE",
        "sinew/blender_manifest.toml",
        "sinew/__init__.py",
        "sinew/manual/README.html",
        *(
            f"sinew/licenses/{library}.txt"
            for library in ("oneTBB", "Highway", "Eigen", "pybind11", "libc++", "zig", "mingw-w64")
        ),
    } <= set(names)
    assert any("/sinew_native." in name for name in names)
    assert not any("__pycache__" in name for name in names)


@needs_zip
def test_modules_are_stripped_and_depend_on_nothing_unusual():
    archive = zipfile.ZipFile(ZIP)
    for name in archive.namelist():
        if "/sinew_native." in name:
            data = archive.read(name)
            assert b".symtab" not in data and b".debug_info" not in data
            assert set(re.findall(rb"lib[\w+-]+\.so\.\d+", data)) & {b"libtbb.so.12", b"libhwy.so.1"} == set()


@needs_zip
@needs_program
def test_installing_disabling_enabling_removing(profile, tmp_path):
    assert seen(profile("install", "look")) == [RUNNING + version()]
    assert seen(profile("look")) == [RUNNING + version()]
    assert seen(profile("disable", "look"))[0].startswith("False False False 0")
    assert seen(profile("look")) == [GONE]
    assert seen(profile("enable", "look", "disable", "enable", "look")) == 2 * [RUNNING + version()]
    profile("remove")
    assert seen(profile("look")) == [GONE]
    assert files_of(tmp_path / "profile") == []


@needs_zip
def test_a_newer_version_over_a_running_one(profile, tmp_path):
    """The older one's compiled module stays in the process: the newer says so, and works from then on."""
    newer = changed_zip(tmp_path, version="9.8.7")
    profile("install")
    output = profile("install", "look", "ask", path=newer)
    assert seen(output) == ["True False False 0 9.8.7"]
    assert f"Sinew 9.8.7 was installed over {version()}" in output and "restart Blender" in output
    # Here the module is the old one still, whatever the zip says; the next start finds that too.
    assert "without_native" in profile("ask")
    assert seen(profile("install", "look"))[0].startswith("True")
    assert seen(profile("look")) == [RUNNING + version()]


@needs_zip
def test_the_same_version_over_a_running_one(profile):
    profile("install")
    assert seen(profile("install", "look")) == [RUNNING + version()]


@needs_zip
def test_a_python_without_a_module(profile, tmp_path):
    output = profile("install", "ask", path=changed_zip(tmp_path, without_modules=True))
    assert "MODULES ['without_native']" in output
    assert "PROBLEM Sinew has no native library for Python" in output
    assert "this package has those for Python 3.6 (x86_64-linux-gnu)" in output


WHEELS = sorted(ZIP.parent.glob(f"with-wheels/{ZIP.stem}-*-wheels.zip"))


@pytest.fixture(params=("modules", "wheels"))
def either_zip(request):
    """The zip with the modules, or the one for this system in which they are wheels."""
    if request.param == "modules":
        return ZIP
    system = {"linux": "linux-x64", "win32": "windows-x64", "darwin": "macos-arm64"}[sys.platform]
    found = [path for path in WHEELS if system in path.name]
    if not found:
        pytest.skip("there is no zip with wheels beside SINEW_ZIP")
    return found[0]


LOOK_AT_MODULE = """
import sys
native = sys.modules["bl_ext.user_default.sinew.native"]
print("MODULE", native.sinew_native.__name__, native.sinew_native.__version__, native.problem)
"""


@needs_zip
@needs_program
@pytest.mark.skipif(not EXTENSIONS, reason="this Blender has no extensions")
def test_extension_commands(tmp_path, either_zip):
    environment = {**os.environ, "HOME": str(tmp_path), "BLENDER_USER_RESOURCES": str(tmp_path)}

    def command(*arguments):
        done = subprocess.run(
            [bpy.app.binary_path, "--command", "extension", *arguments], env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    assert "Success" in command("validate", str(either_zip))
    command("install-file", "--repo", "user_default", "--enable", str(either_zip))
    assert "sinew" in command("list")
    output = subprocess.run(
        [bpy.app.binary_path, "-b", "--python-exit-code", "1", "--python-expr", LOOK_AT_MODULE],
        env=environment,
        capture_output=True,
        text=True,
    ).stdout
    package = "sinew_native" if either_zip in WHEELS else "bl_ext.user_default.sinew.sinew_native"
    assert f"MODULE {package} {version()} \n" in output
    command("remove", "sinew")
    assert files_of(tmp_path) == []
