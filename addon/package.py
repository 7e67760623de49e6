"""Makes the add-on's zip: one top folder `sinew/`, which Blender 3.4 as well as the extensions of 4.2
and later install.

    package.py MODULE... FOLDER

MODULE are compiled `sinew_native` files, one a Python version. Prints the zip's path in FOLDER. The same
input gives the same zip.
"""

import re
import sys
import zipfile
from pathlib import Path

import manual

SOURCE = Path(__file__).parent / "sinew"
ROOT = SOURCE.parent.parent
EPOCH = (1980, 1, 1, 0, 0, 0)  # zip entries carry a time; ours must not


def version():
    manifest = (SOURCE / "blender_manifest.toml").read_text()
    return re.search(r'^version = "(.+)"$', manifest, re.MULTILINE)[1]


def stamped(init):
    """__init__.py with the version of the manifest, for Blender 3.4."""
    result = init.replace('"version": (0, 0, 0),', f'"version": ({", ".join(version().split("."))}),')
    if result == init:
        sys.exit("package.py: __init__.py has no place for the version")
    return result


def contents(modules):
    """{name in the zip: bytes}"""
    files = {
        path.relative_to(SOURCE).as_posix(): path.read_bytes()
        for path in SOURCE.rglob("*")
        if path.suffix in {".py", ".toml"}
    }
    files["__init__.py"] = stamped(files["__init__.py"].decode()).encode()
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
        # Without an entry for the folder itself, 3.4 writes over an older version's files in place, of which
        # the compiled module is mapped into the running Blender.
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
