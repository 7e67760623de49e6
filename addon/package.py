"""Makes the add-on's zips, each with one top folder `sinew/`: Blender 3.4 and the extension system of 4.2 and later can
install them.

    package.py MODULE... FOLDER

Each MODULE is a compiled `sinew_native` file for one Python version and one platform. Prints the paths of the zips in
FOLDER: first the one for all platforms, then, if there are several, one for each, as an index of extensions wants them;
and in FOLDER/with-wheels one for each, in which the modules are wheels that the manifest names, as the guidelines for
extensions ask. The same input gives the same zips.
"""

import base64
import functools
import hashlib
import io
import re
import struct
import sys
import zipfile
from pathlib import Path

import bill_of_materials
import manual

SOURCE = Path(__file__).parent / "sinew"
ROOT = SOURCE.parent.parent
EPOCH = (1980, 1, 1, 0, 0, 0)  # the same time for every zip entry, to make the zip reproducible

# By the number that a module's header has for the processor. The names are Blender's.
ELF_MACHINES = {62: "linux-x64", 183: "linux-arm64"}
PE_MACHINES = {0x8664: "windows-x64", 0xAA64: "windows-arm64"}
MACH_O_PROCESSORS = {0x0100_0007: "macos-x64", 0x0100_000C: "macos-arm64"}
MACH_O, UNIVERSAL = 0xFEEDFACF, 0xCAFEBABE
# What the names of wheels have for a platform, as ./dev wheel gives it.
WHEEL_PLATFORMS = {
    "linux-x64": "manylinux_2_34_x86_64",
    "linux-arm64": "manylinux_2_34_aarch64",
    "windows-x64": "win_amd64",
    "windows-arm64": "win_arm64",
    "macos-x64": "macosx_11_0_x86_64",
    "macos-arm64": "macosx_11_0_arm64",
}
ALIGNMENT = 14  # of the parts of a universal file: 2 to this power, a page of Apple's processors


def version():
    manifest = (SOURCE / "blender_manifest.toml").read_text()
    return re.search(r'^version = "(.+)"$', manifest, re.MULTILINE)[1]


def stamped(init):
    """Returns __init__.py with the version from the manifest filled in, for Blender 3.4."""
    result = init.replace('"version": (0, 0, 0),', f'"version": ({", ".join(version().split("."))}),')
    if result == init:
        sys.exit("package.py: __init__.py has no place for the version")
    return result


def platform_of(module):
    """Returns Blender's name of the platform for which a module is compiled. module: path."""
    with open(module, "rb") as file:
        data = file.read(4096)
    found = None
    if data[:4] == b"\x7fELF":
        found = ELF_MACHINES.get(struct.unpack_from("<H", data, 18)[0])
    elif data[:2] == b"MZ":
        found = PE_MACHINES.get(struct.unpack_from("<H", data, struct.unpack_from("<I", data, 60)[0] + 4)[0])
    elif data[:4] == struct.pack("<I", MACH_O):
        found = MACH_O_PROCESSORS.get(struct.unpack_from("<I", data, 4)[0])
    if found is None:
        known = ", ".join([*ELF_MACHINES.values(), *PE_MACHINES.values(), *MACH_O_PROCESSORS.values()])
        sys.exit(f"package.py: {module} is for no system that Blender has; expected a module for {known}")
    return found


def universal(modules):
    """Returns one file for macOS with several modules in it, for different processors. modules: their bytes."""
    step = 1 << ALIGNMENT
    header, body = struct.pack(">II", UNIVERSAL, len(modules)), b""
    for data in sorted(modules, key=lambda data: data[4:8]):
        body += bytes(-len(body) % step)
        header += struct.pack(">8sIII", data[7:3:-1] + data[11:7:-1], step + len(body), len(data), ALIGNMENT)
        body += data
    return header.ljust(step, b"\0") + body


def for_platforms(manifest, platforms):
    """Returns the manifest with the platforms filled in."""
    listed = ", ".join(f'"{name}"' for name in sorted(platforms))
    result, count = re.subn(r"^platforms = .*$", f"platforms = [{listed}]", manifest, flags=re.MULTILINE)
    if count != 1:
        sys.exit("package.py: blender_manifest.toml has no line for the platforms")
    return result


def with_wheels(manifest, names):
    """Returns the manifest with the wheels of those names."""
    listed = "".join(f'  "./{name}",\n' for name in sorted(names))
    return re.sub(r"^platforms = .*$", rf"\g<0>\nwheels = [\n{listed}]", manifest, flags=re.MULTILINE)


def wheel_of(module, platform):
    """Returns the name in the zip, and the bytes, of a wheel with one module. module: path."""
    python = "cp3" + re.search(r"\.c(?:python-|p)3(\d+)-", module.name)[1]
    tag = f"{python}-{python}-{WHEEL_PLATFORMS[platform]}"
    info = f"sinew_native-{version()}.dist-info"
    text = (
        f"Metadata-Version: 2.1\nName: sinew_native\nVersion: {version()}\nLicense: GPL-3.0-or-later\n"
        "Description-Content-Type: text/plain\n\nThe native core of Sinew, a Blender add-on, for its extension.\n"
    )
    files = {
        module.name: module.read_bytes(),
        f"{info}/METADATA": text.encode(),
        f"{info}/WHEEL": f"Wheel-Version: 1.0\nGenerator: sinew\nRoot-Is-Purelib: false\nTag: {tag}\n".encode(),
    }
    record = "".join(f"{name},sha256={_digest(data)},{len(data)}\n" for name, data in files.items())
    files[f"{info}/RECORD"] = f"{record}{info}/RECORD,,\n".encode()
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            _add(archive, name, data)
    return f"wheels/sinew_native-{version()}-{tag}.whl", made.getvalue()


def _digest(data):
    return base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()


@functools.cache
def manual_pages():
    return manual.pages(ROOT / "docs")


def compiled(modules):
    """Returns {name in the zip: bytes} of the modules. Those of one name, for different Macs, become one file."""
    found = {}
    for module in modules:
        found.setdefault(module.name, []).append(module.read_bytes())
    return {name: parts[0] if len(parts) == 1 else universal(parts) for name, parts in found.items()}


def contents(modules, has_wheels=False):
    """Returns {name in the zip: bytes}. modules: {path: platform}; has_wheels: each is in a wheel."""
    files = {
        path.relative_to(SOURCE).as_posix(): path.read_bytes()
        for path in SOURCE.rglob("*")
        if path.suffix in {".py", ".toml"}
    }
    files["__init__.py"] = stamped(files["__init__.py"].decode()).encode()
    manifest = files["blender_manifest.toml"].decode()
    files["blender_manifest.toml"] = for_platforms(manifest, set(modules.values())).encode()
    files["LICENSE"] = (ROOT / "LICENSE").read_bytes()
    files |= {f"licenses/{path.name}": path.read_bytes() for path in (ROOT / "native" / "licenses").iterdir()}
    files |= {f"manual/{name}": data for name, data in manual_pages().items()}
    found = compiled(modules)
    if has_wheels:
        found = dict(wheel_of(module, platform) for module, platform in modules.items())
        manifest = files["blender_manifest.toml"].decode()
        files["blender_manifest.toml"] = with_wheels(manifest, found).encode()
    files["sinew.spdx.json"] = bill_of_materials.document(version(), found, set(modules.values())).encode()
    return files | found


def _add(archive, name, data):
    entry = zipfile.ZipInfo(name, EPOCH)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = 0o644 << 16
    archive.writestr(entry, data)


def write(target, modules, has_wheels=False):
    """Writes a zip. modules, has_wheels: as of `contents`."""
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        # Without an entry for the folder itself, 3.4 overwrites an older version's files in place, including the
        # compiled module that is mapped into the running Blender.
        folder = zipfile.ZipInfo("sinew/", EPOCH)
        folder.external_attr = 0o40755 << 16 | 0x10
        archive.writestr(folder, b"")
        for name, data in sorted(contents(modules, has_wheels).items()):
            _add(archive, f"sinew/{name}", data)
    print(target)


def main(arguments):
    if len(arguments) < 2:
        sys.exit(__doc__)
    *modules, folder = map(Path, arguments)
    modules = {module: platform_of(module) for module in modules}
    write(folder / f"sinew-{version()}.zip", modules)
    platforms = sorted(set(modules.values()))
    chosen = {
        platform: {module: each for module, each in modules.items() if each == platform} for platform in platforms
    }
    for platform in platforms if len(platforms) > 1 else ():
        write(folder / f"sinew-{version()}-{platform}.zip", chosen[platform])
    (folder / "with-wheels").mkdir(exist_ok=True)  # not beside the others, of which an index is made
    for platform in platforms:
        write(folder / "with-wheels" / f"sinew-{version()}-{platform}-wheels.zip", chosen[platform], has_wheels=True)


if __name__ == "__main__":
    main(sys.argv[1:])
