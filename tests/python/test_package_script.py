"""addon/package.py: the zip says for which systems it is."""

import importlib.util
import sys
import types
from pathlib import Path

import pytest

ADDON = Path(__file__).resolve().parents[2] / "addon"


@pytest.fixture
def package(monkeypatch):
    monkeypatch.setitem(sys.modules, "manual", types.ModuleType("manual"))  # which needs Python-Markdown
    spec = importlib.util.spec_from_file_location("package", ADDON / "package.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_manifest_names_the_systems_of_the_modules(package):
    manifest = (ADDON / "sinew" / "blender_manifest.toml").read_text()
    linux = ["sinew_native.cpython-311-x86_64-linux-gnu.so", "sinew_native.cpython-313-x86_64-linux-gnu.so"]
    windows = "sinew_native.cp311-win_amd64.pyd"
    assert package.for_platforms(manifest, linux) == manifest
    both = package.for_platforms(manifest, [*linux, windows])
    assert both == manifest.replace('"linux-x64"', '"linux-x64", "windows-x64"') != manifest
    assert '["windows-x64"]' in package.for_platforms(manifest, [windows])


def test_what_blender_cannot_load_is_refused(package):
    manifest = (ADDON / "sinew" / "blender_manifest.toml").read_text()
    with pytest.raises(SystemExit, match="sinew_native.so is for no system that Blender has; expected"):
        package.for_platforms(manifest, ["sinew_native.so"])
    with pytest.raises(SystemExit, match="no line for the platforms"):
        package.for_platforms("", ["sinew_native.cp311-win_amd64.pyd"])
