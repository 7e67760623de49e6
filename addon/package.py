"""Makes the add-on's zip: one top folder `sinew/`, which Blender 3.4 as well as the extensions of 4.2
and later install.

    package.py MODULE... ZIP

MODULE are compiled `sinew_native` files, one a Python version. The same input gives the same zip.
"""

import re
import sys
import zipfile
from pathlib import Path

SOURCE = Path(__file__).parent / "sinew"
ROOT = SOURCE.parent.parent
EPOCH = (1980, 1, 1, 0, 0, 0)  # zip entries carry a time; ours must not


def version():
    manifest = (SOURCE / "blender_manifest.toml").read_text()
    return re.search(r'^version = "(.+)"$', manifest, re.MULTILINE)[1]


def contents(modules):
    """{name in the zip: bytes}"""
    files = {}
    for path in sorted(SOURCE.rglob("*")):
        if path.suffix in {".py", ".toml"}:
            files[f"sinew/{path.relative_to(SOURCE).as_posix()}"] = path.read_bytes()
    init = files["sinew/__init__.py"].decode()
    numbers = ", ".join(version().split("."))
    stamped = init.replace('"version": (0, 0, 0),', f'"version": ({numbers}),')
    if stamped == init:
        sys.exit("package.py: __init__.py has no place for the version")
    files["sinew/__init__.py"] = stamped.encode()
    files["sinew/LICENSE"] = (ROOT / "LICENSE").read_bytes()
    for module in modules:
        files[f"sinew/{module.name}"] = module.read_bytes()
    return files


def main(arguments):
    *modules, target = map(Path, arguments)
    if not modules:
        sys.exit(__doc__)
    target.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in sorted(contents(modules).items()):
            entry = zipfile.ZipInfo(name, EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, data)
    print(target)


if __name__ == "__main__":
    main(sys.argv[1:])
