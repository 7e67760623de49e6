"""What ./dev release does besides building. Run from the repository's folder.

release.py check                  prints the manifest's version, if it can be released now
release.py collect BUILD FOLDER   copies that version's zips and wheels from BUILD to FOLDER
release.py finish FOLDER          looks at the index there, and writes NOTES.md and SHA256SUMS
"""

import fnmatch
import hashlib
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

MANIFEST = Path("addon/sinew/blender_manifest.toml")
CHANGELOG = Path("CHANGELOG.md")
# Blender's name of each platform that has a zip of its own, and what the wheels for it are called.
PLATFORMS = {
    "linux-x64": "*-manylinux_*_x86_64.whl",
    "linux-arm64": "*-manylinux_*_aarch64.whl",
    "windows-x64": "*-win_amd64.whl",
    "macos-x64": "*-macosx_*_x86_64.whl",
    "macos-arm64": "*-macosx_*_arm64.whl",
}


def refuse(why):
    sys.exit(f"./dev release: {why}")


def version_of(manifest):
    return re.search(r'^version = "(.+)"$', manifest, re.MULTILINE)[1]


def sections(changelog):
    """Returns [(heading, text)], as in the file: newest first."""
    parts = re.split(r"^## +(.+?) *$", changelog, flags=re.MULTILINE)[1:]
    return list(zip(parts[::2], (text.strip() for text in parts[1::2])))


def check(version, changes, tags, changelog):
    """Refuses what cannot be released. changes: what `git status --porcelain` prints; tags: names."""
    if changes.strip():
        files = [line.split(maxsplit=1)[-1] for line in changes.strip().splitlines()]
        more = f" and {len(files) - 5} more" if len(files) > 5 else ""
        refuse(f"these files are not committed: {', '.join(files[:5])}{more}. Commit or remove them first")
    if f"v{version}" in tags:
        refuse(
            f"there is a git tag v{version} already, so {version} is out. Raise the version in {MANIFEST}, and "
            f"describe the new one in {CHANGELOG}"
        )
    found = sections(changelog)
    if version not in dict(found):
        refuse(
            f'{CHANGELOG} has no section "## {version}". Describe there what is new, or correct the version in '
            f"{MANIFEST}"
        )
    heading, text = found[0]
    if heading != version:
        refuse(f'{CHANGELOG} begins with "## {heading}"; expected "## {version}". Move what is new to that section')
    if not text:
        refuse(f'the section "## {version}" of {CHANGELOG} is empty. Describe there what is new')


def notes(changelog, version):
    """Returns the version's section for a page that breaks lines where the text does, and that has none of our files:
    each paragraph on one line, without links to files."""
    text = dict(sections(changelog))[version]
    text = re.sub(r"\n +", " ", text)
    text = re.sub(r"\[([^\]]+)\]\((?!https?:)[^)]*\)", r"\1", text)
    return f"# Sinew {version}\n\n{text}\n"


def collect(build, folder, version):
    """Copies the zip for all systems, one for each platform, and the wheels. folder is made anew."""
    zips = [build / f"sinew-{version}.zip", *(build / f"sinew-{version}-{platform}.zip" for platform in PLATFORMS)]
    for path in zips:
        if not path.is_file():
            refuse(f"there is no {path}, which ./dev package should have made. Look for its error above")
    wheels = sorted((build / "wheels").glob(f"sinew_native-{version}-*.whl"))
    for platform, pattern in PLATFORMS.items():
        if not fnmatch.filter([path.name for path in wheels], pattern):
            refuse(
                f"there is no wheel of {version} for {platform} in {build / 'wheels'} ({pattern}), which ./dev wheel "
                "should have made. Look for its error above"
            )
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for path in [*zips, *wheels]:
        shutil.copy(path, folder)


def check_index(folder):
    """Refuses an index in which a platform's zip is missing, or is another than the one in the folder."""
    if not (folder / "index.json").is_file():
        refuse(f"there is no {folder / 'index.json'}, which Blender should have made. Look for its error above")
    entries = json.loads((folder / "index.json").read_text(encoding="utf-8"))["data"]
    listed = {(*entry["platforms"], Path(entry["archive_url"]).name, entry["archive_hash"]) for entry in entries}
    for platform in PLATFORMS:
        (path,) = folder.glob(f"sinew-*-{platform}.zip")
        if (platform, path.name, f"sha256:{digest(path)}") not in listed:
            refuse(f"{folder / 'index.json'} does not list {path.name} for {platform}. Look for Blender's error above")


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def sums(folder):
    """Returns a line for each file, as `sha256sum --check` reads them."""
    files = sorted(path for path in folder.iterdir() if path.name != "SHA256SUMS")
    return "".join(f"{digest(path)}  {path.name}\n" for path in files)


def git(*arguments):
    advice = "Install git, and run this in a clone of the repository"
    try:
        done = subprocess.run(["git", *arguments], capture_output=True, text=True)
    except FileNotFoundError:
        refuse(f"there is no program git. {advice}")
    if done.returncode:
        refuse(f"git {arguments[0]} says: {done.stderr.strip()}. {advice}")
    return done.stdout


def main(arguments):
    version, changelog = version_of(MANIFEST.read_text(encoding="utf-8")), CHANGELOG.read_text(encoding="utf-8")
    match arguments:
        case ["check"]:
            check(version, git("status", "--porcelain"), git("tag").split(), changelog)
            print(version)
        case ["collect", build, folder]:
            collect(Path(build), Path(folder), version)
        case ["finish", folder]:
            check_index(Path(folder))
            (Path(folder) / "NOTES.md").write_text(notes(changelog, version), encoding="utf-8")
            (Path(folder) / "SHA256SUMS").write_text(sums(Path(folder)), encoding="utf-8")
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])
