"""Which wheels of bpy there are, and downloading them: see .ci/bpy, which runs this.

    bpy_wheels.py LIST FOLDER SERIES|newest [SYSTEM...] | move [SERIES...]

LIST has lines as `sha256sum --check` reads them. FOLDER is where the wheels are kept.
"""

import fnmatch
import hashlib
import html
import os
import re
import ssl
import subprocess
import sys
import tempfile
import urllib.parse
import urllib.request
from pathlib import Path
from typing import NamedTuple

from pip._internal.models.index import PyPI
from pip._vendor.packaging.version import InvalidVersion, Version

# Those for which there are zips: the ends of wheels' names.
SYSTEMS = {
    "linux": "manylinux_*_x86_64",
    "windows": "win_amd64",
    "macos-arm64": "macosx_*_arm64",
    "macos-x64": "macosx_*_x86_64",
}
NAME = re.compile(r"bpy-(?P<version>[^-]+)-cp3(?P<minor>\d+)-[^-]+-(?P<platform>\w+)\.whl")
LINK = re.compile(r"""<a\s[^>]*?href=["']([^"']+)["']""")


class Wheel(NamedTuple):
    """A wheel for one system. python: such as 3.13; sha256: None if the index has none."""

    name: str
    version: Version
    python: str
    platform: str
    sha256: str | None

    @property
    def series(self):
        return f"{self.version.major}.{self.version.minor}"

    @property
    def system(self):
        return next((name for name, end in SYSTEMS.items() if fnmatch.fnmatchcase(self.platform, end)), None)


def fail(why):
    sys.exit(f".ci/bpy: {why}")


def wheel_of(name, sha256):
    """Returns the Wheel, or None if the file is not one of bpy for one of the systems."""
    match = NAME.fullmatch(name)
    try:
        found = match and Wheel(name, Version(match["version"]), f"3.{match['minor']}", match["platform"], sha256)
    except InvalidVersion:
        return None
    return found if found and found.system else None


def listed(path):
    """Returns the wheels in the list."""
    lines = (line.split() for line in path.read_text().splitlines())
    return [wheel_of(name, sha256) for sha256, name in lines]


def index_page():
    """Returns the address of the page with links to wheels: as pip is set up here, or SINEW_BPY_INDEX."""
    if page := os.environ.get("SINEW_BPY_INDEX"):
        return page
    asked = subprocess.run([sys.executable, "-m", "pip", "config", "get", "global.index-url"], capture_output=True)
    index = os.environ.get("PIP_INDEX_URL") or asked.stdout.decode().strip() or PyPI.simple_url
    return f"{index.rstrip('/')}/bpy/"


def published():
    """Returns the wheels to which the index has links."""
    page = index_page()
    context = ssl.create_default_context(cafile=os.environ.get("PIP_CERT"))
    try:
        request = urllib.request.Request(page, headers={"Accept": "text/html"})
        with urllib.request.urlopen(request, timeout=60, context=context) as answer:
            text = answer.read().decode("utf-8", "replace")
    except (OSError, ValueError) as error:
        fail(f"{page} cannot be read: {error}. Try again later, or correct SINEW_BPY_INDEX if it is set")
    links = [urllib.parse.urlsplit(html.unescape(link)) for link in LINK.findall(text)]
    wheels = [
        wheel_of(
            urllib.parse.unquote(link.path).rpartition("/")[2],
            link.fragment[len("sha256=") :] if link.fragment.startswith("sha256=") else None,
        )
        for link in links
    ]
    return [wheel for wheel in wheels if wheel] or fail(f"{page} has no links to wheels of bpy")


def newest_of(wheels):
    """Returns those of the newest version."""
    newest = max((wheel.version for wheel in wheels), default=None)
    return [wheel for wheel in wheels if wheel.version == newest]


def choose(series, wheels):
    """Returns the wheels of a series, or of the newest version. wheels: those that are listed."""
    if series == "newest":
        any_build = bool(os.environ.get("SINEW_BPY_INDEX"))
        return newest_of([wheel for wheel in published() if any_build or not wheel.version.is_prerelease])
    return [wheel for wheel in wheels if wheel.series == series] or fail(
        f"there is no series '{series}' in .ci/bpy.sha256; expected newest or one of "
        f"{' '.join(sorted({wheel.series for wheel in wheels}))}. `.ci/bpy move SERIES` adds one that the index has"
    )


def get(wheel, folder):
    """Returns the path of the wheel in the folder, where it is downloaded if no file with its hash is there."""
    path = folder / wheel.name
    if wheel.sha256 and path.is_file() and digest(path) == wheel.sha256:
        return path
    print(f"downloading {wheel.name}", file=sys.stderr)
    where = ("--no-index", "--find-links", index_page()) if os.environ.get("SINEW_BPY_INDEX") else ()
    with tempfile.TemporaryDirectory(dir=folder) as new:
        wanted = Path(new) / "wanted"
        wanted.write_text(f"bpy=={wheel.version}" + (f" --hash=sha256:{wheel.sha256}" if wheel.sha256 else ""))
        how = ("--no-deps", "--only-binary=:all:", "--ignore-requires-python", "--python-version", wheel.python)
        done = subprocess.run(
            [sys.executable, "-m", "pip", "download", "-q", *where, *how, "--platform", wheel.platform]
            + ["--dest", new, "-r", str(wanted)],
            stdout=sys.stderr,
        )
        if done.returncode:
            fail(f"{wheel.name} could not be downloaded, or is another file than the one with the hash: see above")
        os.replace(Path(new) / wheel.name, path)
    return path


def digest(path):
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def move(path, more):
    """Rewrites the list. more: series that are not in it yet."""
    releases, lines = [wheel for wheel in published() if not wheel.version.is_prerelease], []
    for series in sorted({wheel.series for wheel in listed(path)} | set(more), key=Version):
        found = newest_of([wheel for wheel in releases if wheel.series == series])
        if not found or not all(wheel.sha256 for wheel in found):
            fail(f"{index_page()} has no release of {series} with hashes, so .ci/bpy.sha256 stays as it is")
        lines += [f"{wheel.sha256}  {wheel.name}\n" for wheel in sorted(found)]
    path.write_text("".join(lines))


def main(path, folder, what, *names):
    path, folder = Path(path), Path(folder)
    if what == "move":
        if wrong := [name for name in names if not re.fullmatch(r"\d+\.\d+", name)]:
            fail(f"'{wrong[0]}' is no series; expected such as 5.3")
        return move(path, names)
    if wrong := [name for name in names if name not in SYSTEMS]:
        fail(f"there is no system '{wrong[0]}'; expected {', '.join(SYSTEMS)}")
    wheels = choose(what, listed(path))
    there = {wheel.system: wheel for wheel in wheels}
    if missing := [name for name in names if name not in there]:
        fail(f"bpy {wheels[0].version} is not there for {missing[0]} but for {', '.join(there)}")
    folder.mkdir(parents=True, exist_ok=True)
    for system in names or [name for name in SYSTEMS if name in there]:
        print(get(there[system], folder))


if __name__ == "__main__":
    main(*sys.argv[1:])
