"""Sinew's tools for weights, on a mesh and its twin alike."""

import bpy
import numpy as np

from helpers import own_positions, select

from . import scene
from .kinds import on_both


def alone(step):
    """Begins and ends in Object Mode, for an operator may have entered another one."""

    def run(random, ob):
        scene.leave_modes()
        select(ob)
        try:
            step(random, ob)
        finally:
            scene.leave_modes()

    run.__name__ = step.__name__
    return run


def are_alike(ob, twin):
    """Whether both have the same vertices to the last bit. Otherwise tools that choose, a bone or a nearest point, may
    choose differently among equals."""
    return np.array_equal(own_positions(ob), own_positions(twin))


@on_both(1)
def lock_groups(random, ob):
    for group in ob.vertex_groups:
        group.lock_weight = random.random() < 0.15


@on_both(2)
@alone
def smooth_weights(random, ob):
    in_a_mode(random, ob)
    strength = random.choice((0.0, 0.0, 5.0))
    bpy.ops.object.sinew_smooth_weights(steps=random.randint(1, 4), factor=random.random(), strength=strength)


@on_both(2, wanted=are_alike)
@alone
def mirror_weights(random, ob):
    in_a_mode(random, ob)
    bpy.ops.object.sinew_mirror_weights(axis=random.choice("XXYZ"), direction=random.choice(("POSITIVE", "NEGATIVE")))


@on_both(2, wanted=are_alike)
@alone
def reduce_influences(random, ob):
    in_a_mode(random, ob)
    first = random.randint(1, scene.LAST_FRAME - 3)
    bpy.ops.object.sinew_reduce_influences(
        max_influences=random.randint(1, 4),
        poses=random.choice(("FRAMES", "TEST")),
        frame_start=first,
        frame_end=first + 3,
        rings=random.randint(0, 2),
        measure=random.random() < 0.2,
        tolerance=random.choice((0.0, 0.05)),
    )


@on_both(2)
@alone
def transfer_weights(random, ob):
    """From the twin of another mesh, to both."""
    others = [twin for each, twin in scene.pairs() if ob not in (each, twin)]
    source = random.choice(others) if others else None
    if source is not None:
        select(source, ob)
        bpy.ops.object.sinew_transfer_weights(
            distance=random.choice((0.01, 0.1, 1.0)),
            angle=random.uniform(0.3, 3.1),
            flipped=random.random() < 0.5,
            preview=random.random() < 0.1,
        )


def in_a_mode(random, ob):
    """Sometimes Weight Paint, with a mask."""
    if random.random() < 0.4:
        ob.data.use_paint_mask_vertex = random.random() < 0.7
        count = len(ob.data.vertices)
        ob.data.vertices.foreach_set("select", np.arange(count) % 3 < random.randint(0, 3))
        bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
