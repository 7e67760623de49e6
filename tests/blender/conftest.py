import itertools
import os
import random
import sys
from collections import defaultdict

import bpy
import pytest

from characters import accelerate, make_armature, make_mesh, pose
from helpers import IS_SAFE, addon_module, assert_same_shape, deform_small_meshes, needs_memory, twin_of

FEW = 2000  # tests: fewer than all


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
    """Where SINEW_SAMPLES is a number, not all cases are tried. Which ones depends on that number and on Blender's
    version: each change tries others. Without Blender's memory, a tenth of the rest, unless a few files were named; and
    there is no output Mesh."""
    for item in items if IS_SAFE else ():
        if hasattr(item, "callspec") and any(str(each) == "MESH" for each in item.callspec.params.values()):
            item.add_marker(needs_memory)
    number = os.environ.get("SINEW_SAMPLES")
    if not number:
        return
    cases, kept = defaultdict(list), set()
    for item in items:
        cases[item.nodeid.partition("[")[0]].append(item)
    for name, each in cases.items():
        kept.update(some_of(each, seed=f"{name} {number} {bpy.app.version}"))
    if IS_SAFE and len(items) > FEW:
        kept = set(random.Random(number).sample([item for item in items if item in kept], -(-len(kept) // 10)))
    config.hook.pytest_deselected(items=[item for item in items if item not in kept])
    items[:] = [item for item in items if item in kept]


def some_of(items, seed):
    """Those cases of one test that are tried: each pair of values of its parameters in at least one of them, or as many
    as its marker says."""
    items = random.Random(seed).sample(items, len(items))
    marker = items[0].get_closest_marker("sampled")
    if marker is not None:
        return items[: -(-len(items) // marker.args[0])]
    if len(parameters_of(items[0])) < 3:
        return items
    kept, missing = [], set().union(*map(pairs_of, items))
    while missing:
        kept.append(max(items, key=lambda item: len(pairs_of(item) & missing)))
        missing -= pairs_of(kept[-1])
    return kept


def parameters_of(item):
    """The values of a case's parameters, as its name has them; those that are given together are one."""
    return item.callspec._idlist if hasattr(item, "callspec") else []


def pairs_of(item):
    return set(itertools.combinations(enumerate(parameters_of(item)), 2))


@pytest.fixture(autouse=True)
def nothing_went_wrong(request, caplog):
    """Whatever the shapes are in the end: no frame on the way to them may fail."""
    yield
    if request.node.get_closest_marker("says_errors") is None:
        errors = [record.getMessage() for record in caplog.get_records("call") if record.name == "sinew"]
        assert errors == []


@pytest.fixture
def no_program(monkeypatch):
    """Played characters are recorded, as those are that cannot be programs."""
    monkeypatch.setattr(addon_module("played.computing"), "can_be", lambda _rig: False)
