import os
import sys
from collections import Counter

import bpy
import pytest

from characters import accelerate, make_armature, make_mesh, pose
from helpers import addon_module, assert_same_shape, deform_small_meshes, twin_of


@pytest.fixture(autouse=True)
def fresh_scene():
    """Every test starts in an empty file, with the add-on enabled. Small meshes are not left to Blender."""
    deform_small_meshes()
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    scene.frame_set(1)
    return scene


@pytest.fixture
def character(fresh_scene):
    """(bound mesh, a twin that the modifier deforms, armature), animated over frames 1 to 10."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    twin = twin_of(ob)
    for frame in (1, 4, 7, 10):
        pose(armature, frame, False)
    accelerate(ob)
    fresh_scene.frame_set(3)
    assert_same_shape(ob, twin)
    return ob, twin, armature


@pytest.fixture
def sinew(capsys):
    """Runs a command of `sinew` in this process. Returns exit code, stdout, stderr."""

    def run(*words):
        capsys.readouterr()
        code = addon_module("cli.command_line").run([str(word) for word in words])
        return code, *capsys.readouterr()

    return run


@pytest.fixture
def usd():
    """USD's Python package: Blender's own or the one in the folder SINEW_USD."""
    sys.path += [path for path in (os.environ.get("SINEW_USD"),) if path and path not in sys.path]
    try:
        addon_module("bake.usd").load(getattr(bpy.utils, "expose_bundled_modules", None))
    except ValueError:
        if os.environ.get("SINEW_USD"):
            raise
        pytest.skip("usd-core is not there: SINEW_USD names its folder")


def pytest_configure(config):
    config.addinivalue_line("markers", "says_errors: something goes wrong on purpose, and the log says so")
    config.addinivalue_line("markers", "sampled(share): where SINEW_SAMPLES is a number, one in so many cases is tried")


def pytest_collection_modifyitems(config, items):
    """Which cases are tried depends on that number and on Blender's version: each change tries others."""
    number, counts, kept, left = os.environ.get("SINEW_SAMPLES"), Counter(), [], []
    for item in items:
        marker = item.get_closest_marker("sampled")
        name = item.nodeid.partition("[")[0]
        is_kept = (
            not number or marker is None or (counts[name] + int(number) + bpy.app.version[1]) % marker.args[0] == 0
        )
        counts[name] += 1
        (kept if is_kept else left).append(item)
    config.hook.pytest_deselected(items=left)
    items[:] = kept


@pytest.fixture(autouse=True)
def nothing_went_wrong(request, caplog):
    """Whatever the shapes are in the end: no frame on the way to them may fail."""
    yield
    if request.node.get_closest_marker("says_errors") is None:
        errors = [record.getMessage() for record in caplog.get_records("call") if record.name == "sinew"]
        assert errors == []


@pytest.fixture
def no_program(monkeypatch):
    """Frozen characters are recorded, as those are that cannot be programs."""
    monkeypatch.setattr(addon_module("frozen.computing"), "can_be", lambda _rig: False)
