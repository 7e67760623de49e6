"""addon/package.py: the zips say for which systems they are, and one file serves both kinds of Mac."""

import base64
import hashlib
import importlib.util
import io
import json
import re
import struct
import sys
import types
import zipfile
from pathlib import Path

import pytest

ADDON = Path(__file__).resolve().parents[2] / "addon"
MANIFEST = (ADDON / "sinew" / "blender_manifest.toml").read_text()
HEADERS = {
    "linux-x64": b"\x7fELF".ljust(18, b"\0") + struct.pack("<H", 62),
    "linux-arm64": b"\x7fELF".ljust(18, b"\0") + struct.pack("<H", 183),
    "windows-x64": b"MZ".ljust(60, b"\0") + struct.pack("<I", 128) + bytes(64) + b"PE\0\0" + struct.pack("<H", 0x8664),
    "windows-arm64": b"MZ".ljust(60, b"\0") + struct.pack("<I", 64) + b"PE\0\0" + struct.pack("<H", 0xAA64),
    "macos-x64": struct.pack("<III", 0xFEEDFACF, 0x01000007, 3),
    "macos-arm64": struct.pack("<III", 0xFEEDFACF, 0x0100000C, 0),
}
NAMES = {"linux": "cpython-311-{}-linux-gnu.so", "windows": "cp311-win_amd64.pyd", "macos": "cpython-311-darwin.so"}


@pytest.fixture
def package(monkeypatch):
    manual = types.ModuleType("manual")  # which needs Python-Markdown
    manual.pages = lambda folder: {"README.html": b"a page"}
    monkeypatch.setitem(sys.modules, "manual", manual)
    monkeypatch.syspath_prepend(ADDON)
    spec = importlib.util.spec_from_file_location("package", ADDON / "package.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def module(tmp_path):
    """A function that writes what looks like a module for a platform, of that many bytes."""

    def made(platform, size=1000):
        system, _, processor = platform.partition("-")
        path = tmp_path / platform / f"sinew_native.{NAMES[system].format(processor)}"
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(HEADERS[platform].ljust(size, platform[-1].encode()))
        return path

    return made


@pytest.mark.parametrize("platform", HEADERS)
def test_a_module_says_for_which_system_it_is(package, module, platform):
    assert package.platform_of(module(platform)) == platform


@pytest.mark.parametrize(
    "data", [b"", b"text", HEADERS["linux-x64"][:18] + b"\x08\0", HEADERS["macos-x64"][:4] + b"\x07\0\0\0"]
)
def test_what_blender_cannot_load_is_refused(package, tmp_path, data):
    path = tmp_path / "sinew_native.so"
    path.write_bytes(data.ljust(64, b"\0"))
    with pytest.raises(SystemExit, match="sinew_native.so is for no system that Blender has; expected .* linux-x64"):
        package.platform_of(path)


def test_the_manifest_names_the_systems(package):
    assert package.for_platforms(MANIFEST, {"linux-x64"}) == MANIFEST
    both = package.for_platforms(MANIFEST, {"windows-x64", "linux-x64"})
    assert both == MANIFEST.replace('"linux-x64"', '"linux-x64", "windows-x64"') != MANIFEST
    with pytest.raises(SystemExit, match="no line for the platforms"):
        package.for_platforms("", {"windows-x64"})


def test_a_universal_file_holds_both(package, module):
    parts = [module("macos-arm64", 20_000).read_bytes(), module("macos-x64", 40_001).read_bytes()]
    data = package.universal(parts)
    assert package.universal(parts[::-1]) == data
    magic, count = struct.unpack_from(">II", data)
    assert (magic, count) == (0xCAFEBABE, 2)
    found = {}
    for i in range(count):
        processor, _kind, start, size, alignment = struct.unpack_from(">IIIII", data, 8 + 20 * i)
        assert start % (1 << alignment) == 0
        found[processor] = data[start : start + size]
    assert found == {0x0100000C: parts[0], 0x01000007: parts[1]}
    assert len(data) == max(data.rindex(part) + len(part) for part in parts)


def zips(package, capsys, *arguments):
    """Names of the zips that it has made, and what each contains."""
    package.main([str(each) for each in arguments])
    paths = [Path(line) for line in capsys.readouterr().out.splitlines()]
    found = {}
    for path in paths:
        with zipfile.ZipFile(path) as archive:
            found[path.name] = {name: archive.read(name) for name in archive.namelist()}
    return found


def platforms_in(files):
    return re.search(r"^platforms = (.*)$", files["sinew/blender_manifest.toml"].decode(), re.MULTILINE)[1]


def modules_in(files):
    return sorted(name.split("/")[1] for name in files if "/sinew_native." in name)


def test_one_zip_for_all_and_one_for_each(package, module, tmp_path, capsys):
    modules = [module(platform) for platform in ("linux-x64", "windows-x64", "macos-arm64", "macos-x64")]
    found = zips(package, capsys, *modules, tmp_path)
    whole, version = f"sinew-{package.version()}.zip", package.version()
    assert list(found) == [
        whole,
        *(f"sinew-{version}-{name}.zip" for name in sorted(HEADERS) if "arm64" not in name or "macos" in name),
        *(f"sinew-{version}-{name}-wheels.zip" for name in sorted(HEADERS) if "arm64" not in name or "macos" in name),
    ]
    assert platforms_in(found[whole]) == '["linux-x64", "macos-arm64", "macos-x64", "windows-x64"]'
    names = sorted([NAMES["windows"], NAMES["linux"].format("x64"), NAMES["macos"]])
    assert modules_in(found[whole]) == [f"sinew_native.{name}" for name in names]
    thin = found[f"sinew-{version}-macos-x64.zip"]
    assert platforms_in(thin) == '["macos-x64"]' and modules_in(thin) == ["sinew_native.cpython-311-darwin.so"]
    assert thin["sinew/sinew_native.cpython-311-darwin.so"] == module("macos-x64").read_bytes()
    assert found[whole]["sinew/sinew_native.cpython-311-darwin.so"][:4] == b"\xca\xfe\xba\xbe"
    before = (tmp_path / whole).read_bytes()
    zips(package, capsys, *modules, tmp_path)
    assert (tmp_path / whole).read_bytes() == before


def test_the_zip_says_what_it_holds(package, module, tmp_path, capsys):
    """Each module with its hash, each library that is linked into one for these systems, with a version and a text of
    its license, and the commit."""
    modules = [module(platform) for platform in ("linux-x64", "macos-x64")]
    found = zips(package, capsys, *modules, tmp_path)
    whole, thin = (found[f"sinew-{package.version()}{end}.zip"] for end in ("", "-linux-x64"))
    bill = json.loads(whole["sinew/sinew.spdx.json"])
    assert {each["fileName"].removeprefix("./"): each["checksums"][1]["checksumValue"] for each in bill["files"]} == {
        name.removeprefix("sinew/"): hashlib.sha256(data).hexdigest()
        for name, data in whole.items()
        if "sinew_native" in name
    }
    own, *linked = bill["packages"]
    assert own["versionInfo"] == package.version() and re.fullmatch(
        "commit ([0-9a-f]{40}(-dirty)?|NOASSERTION)", own["sourceInfo"]
    )
    assert [each["name"] for each in linked] == ["oneTBB", "Highway", "Eigen", "pybind11", "libc++", "zig"]
    for each in linked:
        assert f"sinew/{each['licenseComments'].split()[-1].removesuffix('.')}" in whole
        assert re.match(r"\d+\.\d+", each["versionInfo"])
    numbers = [each["SPDXID"] for each in (*bill["packages"], *bill["files"])]
    assert len(set(numbers)) == len(numbers)
    assert {each["spdxElementId"] for each in bill["relationships"]} <= {"SPDXRef-DOCUMENT", *numbers}
    of_linux = json.loads(thin["sinew/sinew.spdx.json"])
    assert [each["name"] for each in of_linux["packages"]] == ["sinew", "oneTBB", "Highway", "Eigen", "pybind11"]
    assert of_linux["documentNamespace"] != bill["documentNamespace"]


def test_every_library_has_a_version(package):
    bill = sys.modules["bill_of_materials"]
    assert all(re.match(r"\d+\.\d+", bill.version_of(name)) for name in bill.LINKED)


def test_for_one_system_there_is_one_zip(package, module, tmp_path, capsys):
    version = package.version()
    assert list(zips(package, capsys, module("linux-x64"), tmp_path)) == [
        f"sinew-{version}.zip",
        f"sinew-{version}-linux-x64-wheels.zip",
    ]


@pytest.mark.parametrize("platform", HEADERS)
def test_wheels_for_one_system(package, module, tmp_path, capsys, platform):
    """The manifest names each, and each holds its module, as pip wants it."""
    path = module(platform)
    found = zips(package, capsys, path, tmp_path)[f"sinew-{package.version()}-{platform}-wheels.zip"]
    (name,) = [name for name in found if name.endswith(".whl")]
    assert name.startswith(f"sinew/wheels/sinew_native-{package.version()}-cp311-cp311-")
    manifest = found["sinew/blender_manifest.toml"].decode()
    assert f'wheels = [\n  "./{name.removeprefix("sinew/")}",\n]\n' in manifest
    assert re.search(r"(?s)^platforms.*^wheels.*^\[permissions\]", manifest, re.MULTILINE)
    assert modules_in(found) == [] and platforms_in(found) == f'["{platform}"]'
    with zipfile.ZipFile(io.BytesIO(found[name])) as archive:
        parts = {part: archive.read(part) for part in archive.namelist()}
    info = f"sinew_native-{package.version()}.dist-info"
    assert list(parts) == [path.name, *(f"{info}/{part}" for part in ("METADATA", "WHEEL", "RECORD"))]
    assert parts[path.name] == path.read_bytes()
    for line in parts[f"{info}/RECORD"].decode().splitlines()[:-1]:
        part, digest, size = line.split(",")
        wanted = base64.urlsafe_b64encode(hashlib.sha256(parts[part]).digest()).decode().rstrip("=")
        assert (digest, int(size)) == (f"sha256={wanted}", len(parts[part]))
    bill = json.loads(found["sinew/sinew.spdx.json"])
    assert [each["fileName"] for each in bill["files"]] == [f"./{name.removeprefix('sinew/')}"]
