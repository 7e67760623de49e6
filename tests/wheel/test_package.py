"""The installed package: what it says of itself, and what it brings. tests/wheel/run installs it."""

import os
import platform
import re
import sys
import zipfile
from importlib import metadata
from pathlib import Path

import pytest
import sinew_native as sinew

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = metadata.distribution("sinew-native")
INFO = f"sinew_native-{PACKAGE.version}.dist-info"
MODULE = Path(sinew.__file__)
ZIP = os.environ.get("SINEW_ZIP")  # of the add-on, made with the wheel that is installed
from_dev_wheel = pytest.mark.skipif(not ZIP, reason="made by pip install .")


def test_the_module_is_the_installed_one():
    assert MODULE.is_relative_to(sys.prefix)
    assert MODULE == Path(PACKAGE.locate_file(MODULE.name))


def test_the_version_is_the_manifests():
    manifest = (ROOT / "addon" / "sinew" / "blender_manifest.toml").read_text(encoding="utf-8")
    assert PACKAGE.version == sinew.__version__ == re.search(r'(?m)^version = "(.+)"$', manifest)[1]


def test_what_it_says_of_itself():
    said = PACKAGE.metadata
    assert said["Requires-Python"] == ">=3.11"
    assert said.get_all("Requires-Dist") == ["numpy>=1.24"]
    assert said["License-Expression"] == "GPL-3.0-or-later"
    assert said.get_payload().strip() == (ROOT / "docs" / "python-api.md").read_text(encoding="utf-8").strip()


def test_licences_of_sinew_and_of_the_libraries():
    sources = [Path("LICENSE"), *(path.relative_to(ROOT) for path in (ROOT / "native" / "licenses").iterdir())]
    assert {path.stem for path in sources} == {
        "LICENSE",
        "oneTBB",
        "Highway",
        "Eigen",
        "pybind11",
        "libc++",
        "zig",
        "mingw-w64",
    }
    assert sorted(PACKAGE.metadata.get_all("License-File")) == sorted(path.as_posix() for path in sources)
    for path in sources:
        assert PACKAGE.read_text(f"licenses/{path}") == (ROOT / path).read_text(encoding="utf-8")


def test_the_stub_is_where_type_checkers_look():
    stub = Path(PACKAGE.locate_file("sinew_native-stubs/__init__.pyi"))
    assert stub.read_bytes() == (ROOT / "native" / "bindings" / "sinew_native.pyi").read_bytes()


def test_nothing_else_comes_with_it():
    assert {file.parts[0] for file in PACKAGE.files} == {MODULE.name, "sinew_native-stubs", INFO}
    assert [file.name for file in PACKAGE.files if file.parts[0] == "sinew_native-stubs"] == ["__init__.pyi"]


@from_dev_wheel
def test_it_is_for_this_python_alone():
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    (tag,) = re.findall(r"(?m)^Tag: (.+)$", PACKAGE.read_text("WHEEL"))
    system = "win_amd64" if sys.platform == "win32" else f"manylinux_2_34_{platform.machine()}"
    assert tag == f"{python}-{python}-{system}"


@from_dev_wheel
def test_the_module_is_the_zips():
    assert MODULE.read_bytes() == zipfile.ZipFile(ZIP).read(f"sinew/{MODULE.name}")


@from_dev_wheel
@pytest.mark.skipif(sys.platform == "win32", reason="only on Linux do libraries say which version they need")
@pytest.mark.parametrize(
    "prefix, newest", [("GLIBC", (2, 34)), ("GLIBCXX", (3, 4, 29)), ("CXXABI", (1, 3, 13)), ("GCC", (11,))]
)
def test_no_newer_system_library_is_wanted_than_its_tag_says(prefix, newest):
    wanted = re.findall(rb"\0" + prefix.encode() + rb"_([0-9.]+)(?=\0)", MODULE.read_bytes())
    assert wanted and max(tuple(map(int, version.split(b"."))) for version in wanted) <= newest
