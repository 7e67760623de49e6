"""What a zip of the add-on holds, as an SPDX 2.3 document in JSON: the modules, what is linked into them, and the
commit that they were made from. Versions are those that .ci pins."""

import hashlib
import json
import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CI = ROOT / ".ci"
UNKNOWN = "NOASSERTION"
CREATED = "1980-01-01T00:00:00Z"  # the time of all that is in a zip, so that the same commit gives the same zip
# Name -> (file with its version, a pattern of the version in it, license, the system that needs it). Texts of licenses
# are in native/licenses.
LINKED = {
    "oneTBB": ("sources.sha256", r"onetbb_([\d.]+)-\S+\.dsc", "Apache-2.0", ""),
    "Highway": ("sources.sha256", r"highway_([\d.]+)-\S+\.dsc", "Apache-2.0", ""),
    "Eigen": ("debian.txt", r"libeigen3-dev (\S+)", "MPL-2.0", ""),
    "pybind11": ("pypi", r"pybind11\) VERSION=(\S+)", "BSD-3-Clause", ""),
    "libc++": ("pypi", r"ziglang\) VERSION=(\S+)", "Apache-2.0 WITH LLVM-exception", "macos"),
    "zig": ("pypi", r"ziglang\) VERSION=(\S+)", "MIT", "macos"),
    "GCC's runtime": (
        "debian.txt",
        r"g\+\+-mingw-w64-x86-64-posix (\S+)",
        "GPL-3.0-or-later WITH GCC-exception-3.1",
        "windows",
    ),
    "mingw-w64": ("debian.txt", r"mingw-w64-x86-64-dev (\S+)", "ZPL-2.1", "windows"),
}


def commit():
    """Returns the hash of the commit, with -dirty if git says that files differ from it. Needs no git."""
    folder = ROOT / ".git"
    try:
        found = (folder / "HEAD").read_text().strip()
        if found.startswith("ref: "):
            name = found.removeprefix("ref: ")
            if (folder / name).exists():
                found = (folder / name).read_text().strip()
            else:
                packed = (folder / "packed-refs").read_text().splitlines()
                found = next(line.split()[0] for line in packed if line.endswith(f" {name}"))
    except (OSError, StopIteration):
        return UNKNOWN
    try:
        command = ["git", "-C", ROOT, "status", "--porcelain", "--untracked-files=no"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError:
        return found
    return found + "-dirty" * bool(done.stdout.strip())


def version_of(name):
    file, pattern, *_ = LINKED[name]
    return re.search(pattern, (CI / file).read_text(encoding="utf-8"))[1]


def document(version, modules, platforms):
    """Returns the text. modules: {name in the zip: bytes}; platforms: Blender's names of those that they are for."""
    made_from = commit()
    own = {"name": "sinew", "SPDXID": "SPDXRef-sinew", "versionInfo": version, "sourceInfo": f"commit {made_from}"}
    packages = [own | _package("GPL-3.0-or-later")]
    relations = [("SPDXRef-DOCUMENT", "DESCRIBES", "SPDXRef-sinew")]
    for name, (_file, _pattern, license_name, system) in LINKED.items():
        if any(each.startswith(system) for each in platforms):
            number = "SPDXRef-" + re.sub(r"[^\w.-]", "-", name)
            text = f"licenses/{name}.txt"
            comment = {"licenseComments": f"The text is in {text}."} if (ROOT / "native" / text).exists() else {}
            packages.append(
                {"name": name, "SPDXID": number, "versionInfo": version_of(name)} | _package(license_name) | comment
            )
            relations.append((number, "STATIC_LINK" if name != "zig" else "BUILD_TOOL_OF", "SPDXRef-sinew"))
    files = []
    for i, (name, data) in enumerate(sorted(modules.items())):
        checksums = [
            {"algorithm": kind.upper(), "checksumValue": hashlib.new(kind, data).hexdigest()}
            for kind in ("sha1", "sha256")
        ]
        files.append({"fileName": f"./{name}", "SPDXID": f"SPDXRef-module-{i}", "checksums": checksums})
        relations.append(("SPDXRef-sinew", "CONTAINS", f"SPDXRef-module-{i}"))
    keys = "spdxElementId", "relationshipType", "relatedSpdxElement"
    found = {
        "spdxVersion": "SPDX-2.3",
        "dataLicense": "CC0-1.0",
        "SPDXID": "SPDXRef-DOCUMENT",
        "name": f"sinew-{version}",
        "documentNamespace": f"https://spdx.org/spdxdocs/sinew-{version}-{made_from}-{'-'.join(sorted(platforms))}",
        "creationInfo": {"created": CREATED, "creators": ["Tool: addon/package.py"]},
        "packages": packages,
        "files": files,
        "relationships": [dict(zip(keys, relation)) for relation in relations],
    }
    return json.dumps(found, indent=1) + "\n"


def _package(license_name):
    return {
        "downloadLocation": UNKNOWN,
        "filesAnalyzed": False,
        "licenseConcluded": license_name,
        "licenseDeclared": license_name,
        "copyrightText": UNKNOWN,
    }
