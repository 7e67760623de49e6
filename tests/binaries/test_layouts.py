"""Blender's description of its structs, as official builds for each system hold it: the same everywhere, and what Sinew
expects of it. Nothing is run.

SINEW_BPY_WHEELS lists wheels of bpy, one a line. `.ci/layouts` downloads them and runs this.
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

LISTED = os.environ.get("SINEW_BPY_WHEELS")
pytestmark = pytest.mark.skipif(LISTED is None, reason="SINEW_BPY_WHEELS lists no wheels of bpy")
NAME = re.compile(r"bpy-(?P<version>[^-]+)-\w+-\w+-(?P<system>\w+)\.whl")
BEGIN, LENGTH = b"SDNANAME", 4 << 20  # of a description: it has 0.2 MB
BLOCK = 32  # what may be between a block's name and its contents in a .blend file

ADDON = Path(__file__).resolve().parents[2] / "addon" / "sinew"
WHEELS = {
    (match["version"], match["system"]): path
    for path in map(Path, (LISTED or "").splitlines())
    if (match := NAME.fullmatch(path.name))
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
        found = own_descriptions(archive.read(module))
    assert len(found) == 1, f"{wheel.name} has {len(found)} descriptions of its structs"
    return found[0]


def own_descriptions(data):
    """The descriptions of Blender's structs in a compiled module, without those in .blend files that are embedded in
    it, which older Blenders have written, and that of the physics library."""
    found = [
        data[place : place + LENGTH]
        for place in (match.start() for match in re.finditer(BEGIN, data))
        if b"DNA1" not in data[max(place - BLOCK, 0) : place]
    ]
    return [b"DNA1" + each for each in found if b"\0bPoseChannel\0" in each[: each.find(b"TLEN")]]


def test_there_are_wheels():
    assert WHEELS


def test_descriptions_in_embedded_files_do_not_count():
    own, older = (BEGIN + text + b"\0TYPE\0bPoseChannel\0TLEN" for text in (b"own", b"older"))
    block, physics = b"DNA1" + bytes(20), BEGIN + b"m_size\0TYPE\0btVector3FloatData\0TLEN"
    data = block + older + bytes(LENGTH) + own + bytes(LENGTH) + physics + b"\0bPoseChannel\0"
    assert [each.rstrip(b"\0") for each in own_descriptions(data)] == [b"DNA1" + own]


@pytest.mark.parametrize("version, system", WHEELS)
def test_the_contract_holds(host, version, system):
    structs = host.parse(description(WHEELS[version, system]))
    assert len(structs) > 800
    found = host.differences(structs)
    assert not found, f"Blender {version}, {system}: {'; '.join(found)}"


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
