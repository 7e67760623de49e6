"""Blender's description of its structs, as official builds for each system hold it: the same everywhere, and what Sinew
expects of it. Nothing is run.

SINEW_BPY_WHEELS is a folder with wheels of bpy. `.ci/layouts` downloads them and runs this.
"""

import functools
import importlib
import os
import re
import sys
import types
import zipfile
from pathlib import Path

import pytest

FOLDER = os.environ.get("SINEW_BPY_WHEELS")
pytestmark = pytest.mark.skipif(not FOLDER, reason="SINEW_BPY_WHEELS names no folder with wheels of bpy")
NAME = re.compile(r"bpy-(?P<version>(?P<series>\d+\.\d+)\.\d+)-\w+-\w+-(?P<system>\w+)\.whl")
SERIES = os.environ.get("SINEW_BPY_SERIES", "").split()  # such as 4.2; none for all
BEGIN, LENGTH = b"SDNANAME", 4 << 20  # of the description: it has 0.2 MB

ADDON = Path(__file__).resolve().parents[2] / "addon" / "sinew"
WHEELS = {
    (match["version"], match["system"]): path
    for path in sorted(Path(FOLDER or os.devnull).glob("bpy-*.whl"))
    if (match := NAME.fullmatch(path.name)) and (not SERIES or match["series"] in SERIES)
}
VERSIONS = sorted({version for version, _system in WHEELS})


@pytest.fixture(scope="module")
def host():
    """The add-on's modules that read and judge the description, without Blender."""
    bpy = types.ModuleType("bpy")
    bpy.types = types.SimpleNamespace(BlendData=None, bpy_struct=None)  # for annotations
    package = types.ModuleType("sinew_described")
    package.__path__ = [str(ADDON)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "bpy", bpy)
        patch.setitem(sys.modules, "sinew_described", package)
        yield types.SimpleNamespace(
            parse=importlib.import_module("sinew_described.host.layout").parse,
            differences=importlib.import_module("sinew_described.host.contract").differences,
        )


@functools.cache
def description(wheel):
    """The bytes of the description, out of the compiled module, as they are in a .blend file."""
    with zipfile.ZipFile(wheel) as archive:
        (module,) = [name for name in archive.namelist() if re.fullmatch(r"bpy/__init__\.[\w.-]*(so|pyd)", name)]
        with archive.open(module) as file:
            seen = b""
            while chunk := file.read(8 << 20):
                seen += chunk
                if (place := seen.find(BEGIN)) >= 0:
                    return b"DNA1" + (seen[place:] + file.read(LENGTH))[:LENGTH]
                seen = seen[-len(BEGIN) :]
    raise ValueError(f"{wheel.name} has no description of its structs")


def test_there_are_wheels():
    assert WHEELS, f"{FOLDER} has no wheels of bpy {' '.join(SERIES)}"


@pytest.mark.parametrize("version, system", WHEELS)
def test_the_contract_holds(host, version, system):
    structs = host.parse(description(WHEELS[version, system]))
    assert len(structs) > 800
    assert host.differences(structs) == []


@pytest.mark.parametrize("version", VERSIONS)
def test_all_systems_have_the_same_structs(host, version):
    systems = [system for of, system in WHEELS if of == version]
    if len(systems) < 2:
        pytest.skip(f"of {version} there is only the wheel for {systems[0]}")
    first, *others = (host.parse(description(WHEELS[version, system])) for system in systems)
    for system, structs in zip(systems[1:], others):
        different = [
            f"{kind}.{member}: {mine} or {theirs}"
            for kind in sorted(first.keys() | structs.keys())
            for member, mine, theirs in members_that_differ(first.get(kind), structs.get(kind))
        ]
        assert different == [], f"{systems[0]} and {system}"


def members_that_differ(mine, theirs):
    """Yields a member's name, and where it is in each: offset, type and size. mine, theirs: a struct, or None."""
    if mine is None or theirs is None or mine.size != theirs.size:
        yield "size", mine and mine.size, theirs and theirs.size
    if mine and theirs:
        for name in sorted(mine.members.keys() | theirs.members.keys()):
            if mine.members.get(name) != theirs.members.get(name):
                yield name, mine.members.get(name), theirs.members.get(name)
