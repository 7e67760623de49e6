"""Frames in which nothing but the pose has changed: of the steps of in_pass.py few are left, most of them native.

When the whole way has been gone twice, all that it went by is put under watch in Blender's memory. As long as that
holds, the next frame of this evaluated object needs its pose, its place and the numbers to write to.
"""

from ..binding import wiring
from ..blender import memory, nodes
from . import character, layers, stages

_known = {}  # address of an evaluated object -> Shortcut


class Shortcut:
    def __init__(self, copy, ob):
        """copy: graph_copies.GraphCopy of that evaluated object."""
        plan = copy.plan
        self.copy = copy
        taken = [ob.modifiers[name] for name in plan.taken]
        behind = [ob.modifiers[name] for name in plan.run.stages]
        armatures = [modifier.object for modifier in taken]
        self._editions = [
            (armature.data.as_pointer(), layer.edition) for armature, layer in zip(armatures, copy.layers)
        ]
        target = wiring.target_of(copy.hook_of(ob), "mesh")
        self._mesh = target.id
        watched = [
            memory.mark_region(ob, "OBJECT"),
            memory.origin_region(ob),
            memory.region(ob, "Object", "mode"),
            *memory.place_regions(ob),
            memory.region(target, "DriverTarget", "*id"),
            memory.mark_region(self._mesh, "MESH"),
        ]
        keys = None
        if copy.goes_through_keys():
            block = self._mesh.shape_keys
            watched += [memory.region(self._mesh, "Mesh", "*key"), memory.mark_region(block, "KEY")]
            keys = memory.key_addresses(block).tolist(), memory.key_layout()
        for modifier, armature in zip(taken, armatures):
            watched += [
                memory.region(modifier, "ArmatureModifierData", name)
                for name in ("deformflag", "multi", "defgrp_name", "*object")
            ]
            watched += [
                *memory.place_regions(armature),
                memory.region(armature, "Object", "mode"),
                memory.region(armature, "Object", "*data"),
                memory.mark_region(armature.data, "ARMATURE"),
                memory.region(armature.data, "bArmature", "flag"),
            ]
        for modifier in behind:
            watched += stages.watched(modifier)
        switches = [memory.mode_switch(modifier, *wiring.OFF) for modifier in (*taken, *behind)]
        if plan.own is not None:
            shown = wiring.OFF if keys else plan.run.shown
            switches.append(memory.mode_switch(ob.modifiers[plan.own], *shown))
        poses = [
            (memory.region(armature, "Object", "*pose")[0], layer.first_joint, layer.bones.joint_counts)
            for layer, armature in zip(copy.layers, armatures)
        ]
        self._has_keys = keys is not None
        self._native = memory.host.Shortcut(
            copy.deformer,
            watched,
            poses,
            memory.posed_layout(),
            [(memory.place_address(ob), memory.place_address(armature)) for armature in armatures],
            switches,
            copy.stages.at(ob, copy.stage_names(ob), None),
            keys,
            copy.rest_of_stages(),
        )
        self.milliseconds = self._native.milliseconds

    def holds(self):
        return self._is_asked_for() and self._native.holds()

    def run(self):
        """Deforms. False: nothing was done, the whole way is to be gone."""
        if not self.holds():
            return False
        # Asking for the address makes Blender give the mesh numbers of its own: see memory.attribute_vectors.
        out = 0 if self._has_keys else self._mesh.attributes[nodes.POSITION_ATTRIBUTE].data[0].as_pointer()
        return self._native.deform(out)

    def _is_asked_for(self):
        copy = self.copy
        return (
            copy.looks == copy.character.looks
            and not character.stands_aside()
            and all(layers.is_edition(*edition) for edition in self._editions)
        )


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
    has_run = False
    try:
        has_run = shortcut.run()
    finally:
        if not has_run:  # for good: the modifiers that it knows may be gone
            _known.pop(address, None)
            shortcut.copy.note_other_frame()
    if has_run:
        shortcut.copy.character.timings.take(shortcut.milliseconds)
    return has_run


def learn(copy, ob):
    """The whole way has just been gone for this evaluated object. Returns whether nothing had to be made for it."""
    alike = copy.note_frame()
    if alike >= copy.patience and _is_plain(copy, ob):
        _known[ob.as_pointer()] = Shortcut(copy, ob)
    return alike > 1


def _is_plain(copy, ob):
    plan = copy.plan
    armatures = [ob.modifiers[name].object for name in plan.taken]
    return (
        copy.deformer.vertex_count > 0
        and ob.sinew.source != "CLIP"
        and all(stages.KINDS[ob.modifiers[name].type].WATCHED for name in plan.run.stages)
        and all(not layer.influences.depend_on_shape for layer in copy.layers)
        and all(layers.is_posed(armature) for armature in armatures)
        and (not armatures or None not in map(memory.place_address, (ob, *armatures)))
    )
