"""Frames in which nothing but the pose has changed: of the steps of in_pass.py few are left, most of them native.

When the whole way has been gone twice, all that it went by is put under watch in Blender's memory. As long as that
holds, the next frame of this evaluated object needs its pose, its place and the numbers to write to.
"""

from time import perf_counter

import numpy as np

from ..binding import ways, wiring
from ..blender import memory, nodes
from . import layers, stages

MOST = 32  # of one mesh: a render has evaluated objects of its own, and each render new ones


class Shortcut:
    def __init__(self, entry, ob, modifiers, behind):
        """modifiers, behind: evaluated, the Armature modifiers and those of the run behind them."""
        self.deformer = entry.deformer
        self.stages = entry.stages.at(ob, entry.stage_names(ob), None)
        self.editions = [layer.edition for layer in entry.layers]
        self.armatures = [modifier.object for modifier in modifiers]
        target = wiring.target_of(entry.hook_of(ob), "mesh")
        self.mesh = target.id
        self.count = len(self.mesh.vertices)
        watched = [
            memory.mark_region(ob, "OBJECT"),
            memory.region(ob, "Object", "mode"),
            memory.region(target, "DriverTarget", "*id"),
            memory.mark_region(self.mesh, "MESH"),
        ]
        for modifier, armature in zip(modifiers, self.armatures):
            watched += [
                memory.region(modifier, "ArmatureModifierData", name)
                for name in ("deformflag", "multi", "defgrp_name", "*object")
            ]
            watched += [
                memory.region(armature, "Object", "mode"),
                memory.region(armature, "Object", "*data"),
                memory.mark_region(armature.data, "ARMATURE"),
                memory.region(armature.data, "bArmature", "flag"),
            ]
        for modifier in behind:
            watched += stages.watched(modifier)
        switches = [memory.mode_switch(modifier, *wiring.OFF) for modifier in (*modifiers, *behind)]
        switches.append(memory.mode_switch(ob.modifiers[entry.own], *entry.run.shown))
        poses = [
            (memory.region(armature, "Object", "*pose")[0], layer.bones.first_joint, layer.bones.joint_counts)
            for layer, armature in zip(entry.layers, self.armatures)
        ]
        self.native = memory.host.Shortcut(self.deformer, watched, poses, memory.posed_layout(), switches)

    def holds(self, entry):
        return (
            entry.is_made_with(self.deformer)
            and self.native.holds()
            and all(layers.is_edition(*edition) for edition in self.editions)
        )

    def prepare(self, ob):
        """What its native half takes."""
        return (
            memory.attribute_vectors(self.mesh.attributes[nodes.POSITION_ATTRIBUTE], self.count),
            [layers.space_between(ob, armature) for armature in self.armatures],
        )


def take(entry, ob):
    """Deforms an evaluated object. False: nothing was done, the whole way is to be gone."""
    address = ob.as_pointer()
    shortcut = entry.shortcuts.get(address)
    if shortcut is None:
        return False
    if not shortcut.holds(entry):
        entry.shortcuts[address] = None  # for good: the whole way marks the object anew, and its modifiers may be gone
        return False
    start = perf_counter()
    out, spaces = shortcut.prepare(ob)
    milliseconds = np.empty(len(shortcut.stages) + 1)
    prepared = perf_counter()
    shortcut.native.deform(out, spaces, shortcut.stages, milliseconds)
    entry.timings.take(prepared - start, milliseconds)
    return True


def learn(entry, ob):
    """The whole way has just been gone for this evaluated object."""
    known, address = entry.shortcuts, ob.as_pointer()
    if address not in known:  # while somebody edits, no two frames are alike
        if len(known) >= MOST:
            known.clear()
        known[address] = None
    elif _is_plain(entry, ob):
        known[address] = Shortcut(
            entry, ob, [ob.modifiers[name] for name in entry.taken], [ob.modifiers[name] for name in entry.run.stages]
        )


def _is_plain(entry, ob):
    return (
        entry.way.kind == ways.ATTRIBUTE
        and entry.taken
        and entry.deformer.vertex_count > 0
        and ob.sinew.source != "CLIP"
        and all(stages.KINDS[ob.modifiers[name].type].WATCHED for name in entry.run.stages)
        and all(not layer.influences.depend_on_shape for layer in entry.layers)
        and all(layers.is_posed(ob.modifiers[name].object) for name in entry.taken)
    )
