"""Makes the add-on's zip, with one top folder `sinew/`: both Blender 3.4 and the extension system of 4.2 and later can
install it.

    package.py MODULE... FOLDER

Each MODULE is a compiled `sinew_native` file for one Python version and one platform. Prints the path of the zip in
FOLDER. The same input gives the same zip.
"""

import platform
import re
import sys
import zipfile
from pathlib import Path

import manual

SOURCE = Path(__file__).parent / "sinew"
ROOT = SOURCE.parent.parent
EPOCH = (1980, 1, 1, 0, 0, 0)  # the same time for every zip entry, to make the zip reproducible

# A module's name ends with Python's name for the platform; the manifest uses Blender's names.
PLATFORMS = {
    "-x86_64-linux-gnu.so": "linux-x64",
    "-aarch64-linux-gnu.so": "linux-arm64",
    "-win_amd64.pyd": "windows-x64",
    "-darwin.so": "macos-arm64" if platform.machine() == "arm64" else "macos-x64",
}


def version():
    manifest = (SOURCE / "blender_manifest.toml").read_text()
    return re.search(r'^version = "(.+)"$', manifest, re.MULTILINE)[1]


def stamped(init):
    """Returns __init__.py with the version from the manifest filled in, for Blender 3.4."""
    result = init.replace('"version": (0, 0, 0),', f'"version": ({", ".join(version().split("."))}),')
    if result == init:
        sys.exit("package.py: __init__.py has no place for the version")
    return result


def for_platforms(manifest, modules):
    """Returns the manifest with the platforms of the modules filled in. modules: file names."""
    found = set()
    for module in modules:
        names = [name for ending, name in PLATFORMS.items() if module.endswith(ending)]
        if not names:
            sys.exit(f"package.py: {module} is for no system that Blender has; expected *{', *'.join(PLATFORMS)}")
        found |= set(names)
    listed = ", ".join(f'"{name}"' for name in sorted(found))
    result, count = re.subn(r"^platforms = .*$", f"platforms = [{listed}]", manifest, flags=re.MULTILINE)
    if count != 1:
        sys.exit("package.py: blender_manifest.toml has no line for the platforms")
    return result


def contents(modules):
    """Returns {name in the zip: bytes}."""
    files = {
        path.relative_to(SOURCE).as_posix(): path.read_bytes()
        for path in SOURCE.rglob("*")
        if path.suffix in {".py", ".toml"}
    }
    files["__init__.py"] = stamped(files["__init__.py"].decode()).encode()
    manifest = files["blender_manifest.toml"].decode()
    files["blender_manifest.toml"] = for_platforms(manifest, [module.name for module in modules]).encode()
    files["LICENSE"] = (ROOT / "LICENSE").read_bytes()
    files |= {f"licenses/{path.name}": path.read_bytes() for path in (ROOT / "native" / "licenses").iterdir()}
    files |= {f"manual/{name}": data for name, data in manual.pages(ROOT / "docs").items()}
    files |= {module.name: module.read_bytes() for module in modules}
    return files


def main(arguments):
    if len(arguments) < 2:
        sys.exit(__doc__)
    *modules, folder = map(Path, arguments)
    target = folder / f"sinew-{version()}.zip"
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        # Without an entry for the folder itself, 3.4 overwrites an older version's files in place, including the
        # compiled module that is mapped into the running Blender.
        folder = zipfile.ZipInfo("sinew/", EPOCH)
        folder.external_attr = 0o40755 << 16 | 0x10
        archive.writestr(folder, b"")
        for name, data in sorted(contents(modules).items()):
            entry = zipfile.ZipInfo(f"sinew/{name}", EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, data)
    print(target)


if __name__ == "__main__":
    main(sys.argv[1:])
