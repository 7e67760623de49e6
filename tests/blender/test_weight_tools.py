"""Weights that are transferred, smoothed, reduced and mirrored: what the operators write, keep and refuse."""

import bpy
import numpy as np
import pytest

from characters import make_armature, make_mesh, make_tube, twin_of
from helpers import select
from test_automatic_weights import dense, parent


def bound(name="Body"):
    """A tube with weights made by Sinew, and its armature."""
    armature = make_armature()
    ob = make_tube()
    ob.vertex_groups.clear()
    parent(ob, armature)
    ob.name = name
    return ob, armature


def suit_of(ob, grow=1.05, name="Suit"):
    """The same surface around the body, without weights."""
    suit = twin_of(ob)
    suit.name = name
    suit.vertex_groups.clear()
    suit.modifiers.clear()
    suit.parent = None
    for vertex in suit.data.vertices:
        vertex.co.xy *= grow
    return suit


def transfer(source, *targets, **settings):
    select(source, *targets)
    return bpy.ops.object.sinew_transfer_weights(**settings)


def refusal(operator, *objects, **settings):
    """The sentence with which an operator refuses."""
    select(*objects)
    with pytest.raises(RuntimeError) as raised:
        getattr(bpy.ops.object, operator)(**settings)
    return str(raised.value).strip().removeprefix("Error: ")


def test_clothes_get_the_weights_of_the_body():
    body, _ = bound()
    suit = suit_of(body)
    assert transfer(body, suit) == {"FINISHED"}
    assert np.abs(dense(suit) - dense(body)).max() < 0.05
    assert np.allclose(dense(suit).sum(axis=1), 1, atol=1e-5)
    assert len(suit.modifiers) == 0 and suit.parent is None


def test_smoothing():
    ob = make_mesh(make_armature(), False)
    before = dense(ob)
    select(ob)
    assert bpy.ops.object.sinew_smooth_weights() == {"FINISHED"}
    after = dense(ob)
    assert np.abs(after.sum(axis=1) - before.sum(axis=1)).max() < 2
    assert (
        np.abs(np.diff(after.reshape(60, 20, 6), axis=1)).mean()
        < np.abs(np.diff(before.reshape(60, 20, 6), axis=1)).mean() / 2
    )


def test_mirroring():
    ob, armature = bound()
    select(ob)
    assert bpy.ops.object.sinew_mirror_weights() == {"FINISHED"}
