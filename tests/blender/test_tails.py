"""Modifiers behind those that deform whose vertices are weighted sums: Sinew finds the sums and makes the vertices, and
the shape is as that of a twin that Blender deforms, with all that its mesh has."""

import bpy
import pytest

from characters import accelerate, make_armature, make_mesh, pose
from helpers import addon_module, depsgraph, shortcut_of, twin_of, way
from test_canvases import are_deforming, assert_all_same
from test_stencils import TAILS, add_modifiers

pytestmark = pytest.mark.skipif(bpy.app.version < (4, 1, 0), reason="left to Blender in this version")
BEHIND = "UV_WARP", {}  # for which Blender has to make the vertices before it


def character_with(*modifiers, add=None):
    """[(object, its twin)]: bound. modifiers: (type, settings) behind the Armature modifier."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    ob.parent = armature
    for frame in (1, 4, 7, 10):
        pose(armature, frame, True)
    if add is not None:
        add(ob)
    add_modifiers(ob, modifiers)
    pairs = [(ob, twin_of(ob))]
    accelerate(ob)
    return pairs


def find_stencils(frames=24):
    """Plays so long that stencils are found."""
    searching = addon_module("stencils.searching")
    for frame in range(1, frames + 2):
        bpy.context.scene.frame_set(1 + frame % 10)
    return searching


def tail_of(ob):
    tail = addon_module("run.characters").character(ob).way.tail
    return tail and tail.names


@pytest.mark.parametrize("modifiers", TAILS.values(), ids=TAILS.keys())
def test_the_same_shape(fresh_scene, modifiers):
    pairs = character_with(*modifiers, BEHIND)
    assert_all_same(pairs, (1, 2))
    ((ob, _twin),) = pairs
    assert way(ob) == "ATTRIBUTE" and tail_of(ob) is None
    find_stencils()
    assert_all_same(pairs)
    assert tail_of(ob) == tuple(
        modifier.name for modifier in ob.modifiers if modifier.type not in {"ARMATURE", "NODES", "UV_WARP"}
    )
    assert are_deforming(pairs) == [True] and shortcut_of(ob, depsgraph()) is not None
