"""Compiled modules for any system, as files: what they need and what they show. Nothing is run.

SINEW_MODULES lists the files, as PATH does. SINEW_LIBPYTHONS is a folder with python.org's libraries for macOS, which
.ci/macos_python prints.
"""

import functools
import hashlib
import os
import re
import struct
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MODULES = [Path(name) for name in os.environ.get("SINEW_MODULES", "").split(os.pathsep) if name]
LIBPYTHONS = os.environ.get("SINEW_LIBPYTHONS")
pytestmark = pytest.mark.skipif(not MODULES, reason="SINEW_MODULES lists no modules")
if MODULES:
    import lief

INIT = "PyInit_sinew_native"
# The end of a file's name: the processors for which it may be. Both kinds of Macs have one name.
PROCESSORS = {
    "-x86_64-linux-gnu.so": {"X86_64"},
    "-aarch64-linux-gnu.so": {"AARCH64"},
    "-win_amd64.pyd": {"AMD64"},
    "-darwin.so": {"ARM64", "X86_64"},
}
# The newest versions of its libraries that Linux needs: those of Debian 12 and of the wheels' manylinux_2_34.
NEWEST = {"GLIBC": (2, 34), "GLIBCXX": (3, 4, 29), "CXXABI": (1, 3, 13), "GCC": (3, 0)}
# What Windows makes ucrtbase.dll: the name under which Blender and Python import mathematics.
UCRT_MATHEMATICS = "api-ms-win-crt-math-l1-1-0.dll"
# What rigs need besides: C++, memory, strings, locks.
NO_MATHEMATICS = re.compile(r"[_.].*|(mem|str|pthread_)\w+|[mc]alloc|free")


def modules(*endings):
    """Parametrizes a test with the modules whose names end so, each as its path and as lief reads it."""
    found = [path for path in MODULES if path.name.endswith(endings)]
    reason = f"SINEW_MODULES lists no *{' or *'.join(endings)}"
    names = [f"{path.parent.parent.name}/{path.name}" for path in found]
    return pytest.mark.parametrize(
        "path", found or [pytest.param(None, marks=pytest.mark.skip(reason=reason))], ids=names or ["none"]
    )


@functools.cache  # which keeps it: what lief hands out of a file dies with it
def parse(path):
    assert path.is_file(), f"there is no {path}"
    return (lief.MachO if path.name.endswith((".dylib", "-darwin.so")) else lief).parse(str(path))


def read(path):
    binary = parse(path)
    if not path.name.endswith("-darwin.so"):
        return binary
    assert binary.size == 1, "a file for several processors"
    return binary.at(0)


def processor(binary):
    if isinstance(binary, lief.ELF.Binary):
        return binary.header.machine_type.name
    if isinstance(binary, lief.PE.Binary):
        return binary.header.machine.name
    return binary.header.cpu_type.name


# --- every system ---------------------------------------------------------------------------------


@modules("")
def test_it_is_for_the_system_in_its_name(path):
    (wanted,) = [names for ending, names in PROCESSORS.items() if path.name.endswith(ending)]
    assert processor(read(path)) in wanted


@modules("")
def test_it_holds_no_folder_of_the_machine_that_compiled_it(path):
    data = path.read_bytes()
    found = [folder for folder in (ROOT, Path.home() / ".cache") if bytes(folder) + b"/" in data]
    assert not found
    assert not re.findall(rb"/(?:tmp|home)/[\w./-]+", data)


@modules("")
def test_it_has_no_notes_for_debuggers(path):
    assert not [each.name for each in read(path).sections if "debug" in each.name or each.name == ".symtab"]


# --- Linux ----------------------------------------------------------------------------------------


@modules("-linux-gnu.so")
def test_on_linux_it_exports_one_symbol(path):
    assert [each.name for each in read(path).exported_symbols] == [INIT]


@modules("-linux-gnu.so")
def test_on_linux_it_needs_only_what_each_distribution_has(path):
    wanted = {"libstdc++.so.6", "libm.so.6", "libgcc_s.so.1", "libc.so.6"}
    loader = re.compile(r"ld-linux-[\w-]+\.so\.[12]")
    assert {name for name in read(path).libraries if not loader.fullmatch(name)} <= wanted


@modules("-linux-gnu.so")
def test_on_linux_its_libraries_may_be_as_old_as_the_manual_says(path):
    needs = [
        need.name.split("_")
        for library in read(path).symbols_version_requirement
        for need in library.get_auxiliary_symbols()
    ]
    assert needs
    newer = [need for need in needs if tuple(map(int, need[1].split("."))) > NEWEST[need[0]]]
    assert not newer


# --- Windows --------------------------------------------------------------------------------------


@modules(".pyd")
def test_on_windows_it_needs_only_the_system_and_its_python(path):
    (digits,) = re.findall(r"\.cp(\d+)-", path.name)
    wanted = {"KERNEL32.dll", "msvcrt.dll", UCRT_MATHEMATICS, f"python{digits}.dll"}
    assert {each.name for each in read(path).imports} == wanted


@modules(".pyd")
def test_on_windows_rigs_call_the_mathematics_that_blender_calls(path):
    """One function cannot come from two libraries, so what is imported is nowhere MinGW's own."""
    folder = path.parent.parent / "native/CMakeFiles/sinew_rounded.dir"
    if not folder.is_dir():
        pytest.skip(f"{path} is not where it was built")
    objects = [
        lief.COFF.parse(str(each)) for each in sorted(folder.rglob("*.obj")) if re.search("src[_/]rig", str(each))
    ]
    symbols = [symbol for each in objects for symbol in each.symbols if symbol.is_external]
    needed = {each.name for each in symbols if each.is_undefined} - {each.name for each in symbols if each.section_idx}
    needed = {name for name in needed if not NO_MATHEMATICS.fullmatch(name)}
    assert {"sinf", "cosf", "acosf", "atan2f", "powf", "sin", "acos"} <= needed
    (library,) = [each for each in read(path).imports if each.name == UCRT_MATHEMATICS]
    assert not needed - {entry.name.removeprefix("_") for entry in library.entries}


@modules(".pyd")
def test_on_windows_it_can_lie_anywhere_in_memory_and_holds_no_code_in_data(path):
    kinds = lief.PE.OptionalHeader.DLL_CHARACTERISTICS
    wanted = {kinds.DYNAMIC_BASE, kinds.HIGH_ENTROPY_VA, kinds.NX_COMPAT}
    header = read(path).optional_header
    assert wanted <= {kind for kind in wanted if header.has(kind)}


@modules(".pyd")
def test_on_windows_it_exports_its_entry_and_holds_no_time(path):
    binary = read(path)
    exported = binary.get_export()
    assert [entry.name for entry in exported.entries if "Py" in entry.name] == [INIT]
    assert (binary.header.time_date_stamps, exported.timestamp) == (0, 0)


# --- macOS ----------------------------------------------------------------------------------------


@modules("-darwin.so")
def test_on_macos_it_exports_one_symbol(path):
    assert [each.symbol.name for each in read(path).dyld_info.exports] == [f"_{INIT}"]


@modules("-darwin.so")
def test_on_macos_nothing_is_merged_with_what_others_have_loaded(path):
    binary = read(path)
    weak = [each.symbol.name for each in binary.dyld_info.bindings if each.binding_class.name == "WEAK"]
    assert not weak
    flags = {flag.name for flag in binary.header.flags_list}
    assert not flags & {"WEAK_DEFINES", "BINDS_TO_WEAK"} and "TWOLEVEL" in flags


@modules("-darwin.so")
def test_on_macos_it_needs_only_the_system(path):
    assert [each.name for each in read(path).libraries] == ["/usr/lib/libSystem.B.dylib"]


@modules("-darwin.so")
def test_on_macos_the_system_copies_memory(path):
    """The compiler's own functions for that go byte by byte."""
    bound = {each.symbol.name for each in read(path).dyld_info.bindings if each.library_ordinal == 1}
    assert {"_memcpy", "_memmove", "_memset"} <= bound


@modules("-darwin.so")
def test_on_macos_it_is_a_bundle_for_macos_11(path):
    binary = read(path)
    assert binary.header.file_type.name == "BUNDLE"
    assert (binary.build_version.platform.name, binary.build_version.minos) == ("MACOS", [11, 0, 0])


@modules("-darwin.so")
def test_on_macos_it_names_nothing_else_that_it_has(path):
    assert [each.name for each in read(path).symbols if each.type.name == "SECTION"] == [f"_{INIT}"]


@modules("-darwin.so")
def test_on_macos_its_signature_is_true(path):
    """Apple's processors refuse code without one. An ad-hoc signature is a hash of each page, and by nobody."""
    place = read(path).code_signature
    data = path.read_bytes()
    assert place.data_offset + place.data_size == len(data)
    signature = data[place.data_offset :]
    magic, _length, count = struct.unpack_from(">3I", signature)
    assert magic == 0xFADE0CC0
    parts = [struct.unpack_from(">2I", signature, 12 + 8 * at) for at in range(count)]
    assert [kind for kind, _offset in parts] == [0], "more than the hashes: a certificate"
    directory = signature[parts[0][1] :]
    magic, _length, _version, flags, hashes, name, _special, pages, limit, hash_size, hash_type, _platform, page = (
        struct.unpack_from(">9I4B", directory)
    )
    assert magic == 0xFADE0C02
    assert flags & 0x2, "not ad hoc"
    assert directory[name:].split(b"\0")[0].decode() == path.name
    assert (hash_size, hash_type, limit) == (32, 2, place.data_offset)  # SHA-256, of all that is before it
    found = [directory[hashes + 32 * at : hashes + 32 * (at + 1)] for at in range(pages)]
    assert found == [
        hashlib.sha256(data[at : min(at + (1 << page), limit)]).digest() for at in range(0, limit, 1 << page)
    ]


@pytest.mark.skipif(not LIBPYTHONS, reason="SINEW_LIBPYTHONS names no folder with python.org's libraries")
@modules("-darwin.so")
def test_on_macos_python_has_each_symbol_that_is_looked_up(path):
    binary = read(path)
    (minor,) = re.findall(r"\.cpython-3(\d+)-", path.name)
    library = parse(Path(LIBPYTHONS) / f"libpython3.{minor}.dylib")
    python = next(each for each in library if each.header.cpu_type == binary.header.cpu_type)
    there = {each.symbol.name for each in python.dyld_info.exports}
    # What comes from no library in particular: all but the system's.
    wanted = {each.symbol.name for each in binary.dyld_info.bindings if each.library_ordinal <= 0}
    assert "_PyErr_SetString" in wanted
    assert not wanted - there
