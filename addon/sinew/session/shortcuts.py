"""Frames in which nothing but the pose has changed: of the steps of in_pass.py few are left, most of them native.

When the whole way has been gone twice, all that it went by is put under watch in Blender's memory. As long as that
holds, the next frame of this evaluated object needs its pose, its place and the numbers to write to.
"""

from time import perf_counter

import numpy as np

from ..binding import ways, wiring
from ..blender import memory, nodes
from . import character, layers, stages

_known = {}  # address of an evaluated object -> Shortcut


class Shortcut:
    def __init__(self, copy, ob, modifiers, behind):
        """copy: graph_copies.GraphCopy; modifiers, behind: evaluated, the Armature modifiers and those of the run
        behind them."""
        self.copy = copy
        self.stages = copy.stages.at(ob, copy.stage_names(ob), None)
        self.armatures = [modifier.object for modifier in modifiers]
        self.editions = [
            (armature.data.as_pointer(), layer.edition) for armature, layer in zip(self.armatures, copy.layers)
        ]
        target = wiring.target_of(copy.hook_of(ob), "mesh")
        self.mesh = target.id
        self.count = len(self.mesh.vertices)
        watched = [
            memory.mark_region(ob, "OBJECT"),
            memory.origin_region(ob),
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
        switches.append(memory.mode_switch(ob.modifiers[copy.plan.own], *copy.plan.run.shown))
        poses = [
            (memory.region(armature, "Object", "*pose")[0], layer.bones.first_joint, layer.bones.joint_counts)
            for layer, armature in zip(copy.layers, self.armatures)
        ]
        self.native = memory.host.Shortcut(copy.deformer, watched, poses, memory.posed_layout(), switches)

    def holds(self):
        copy = self.copy
        return (
            copy.looks == copy.character.looks
            and not character.stands_aside()
            and self.native.holds()
            and all(layers.is_edition(*edition) for edition in self.editions)
        )

    def run(self, ob):
        start = perf_counter()
        out = memory.attribute_vectors(self.mesh.attributes[nodes.POSITION_ATTRIBUTE], self.count)
        spaces = [layers.space_between(ob, armature) for armature in self.armatures]
        milliseconds = np.empty(len(self.stages) + 2)
        milliseconds[0] = 1e3 * (perf_counter() - start)
        self.native.deform(out, spaces, self.stages, milliseconds[1:])
        self.copy.character.timings.take(milliseconds)


def forget():
    _known.clear()


def of(ob):
    """Of an evaluated object, or None."""
    return _known.get(ob.as_pointer())


def take(ob):
    """Deforms an evaluated object. False: nothing was done, the whole way is to be gone."""
    address = ob.as_pointer()
    shortcut = _known.get(address)
    if shortcut is None:
        return False
    if not shortcut.holds():
        _known.pop(address, None)  # for good: the modifiers that it knows may be gone
        shortcut.copy.note_other_frame()
        return False
    try:
        shortcut.run(ob)
    except Exception:
        _known.pop(address, None)
        raise
    return True


def learn(copy, ob):
    """The whole way has just been gone for this evaluated object. Returns whether nothing had to be made for it."""
    alike = copy.note_frame()
    if alike >= copy.patience and _is_plain(copy, ob):
        plan = copy.plan
        _known[ob.as_pointer()] = Shortcut(
            copy, ob, [ob.modifiers[name] for name in plan.taken], [ob.modifiers[name] for name in plan.run.stages]
        )
    return alike > 1


def _is_plain(copy, ob):
    plan = copy.plan
    return (
        plan.way.kind == ways.ATTRIBUTE
        and plan.taken
        and copy.deformer.vertex_count > 0
        and ob.sinew.source != "CLIP"
        and all(stages.KINDS[ob.modifiers[name].type].WATCHED for name in plan.run.stages)
        and all(not layer.influences.depend_on_shape for layer in copy.layers)
        and all(layers.is_posed(ob.modifiers[name].object) for name in plan.taken)
    )
