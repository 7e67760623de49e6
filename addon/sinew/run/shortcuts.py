"""The fast path: frames in which only the pose has changed. It skips most steps of in_pass.py; most others are native.

After the full path has run at least twice with the same data, everything that it depended on is watched in Blender's
memory. While none of it changes, the next frame of this evaluated object needs only its pose, its transform and the
array to write to.
"""

from typing import Any

from ..blender import nodes
from ..host import contract, motions, places, switches, watch
from ..native import sinew_native
from ..plan import wiring
from . import character, graph_copies, layers

_known: dict[int, "Shortcut"] = {}  # by the address of the evaluated object


class Shortcut:
    """The fast path of one evaluated object."""

    def __init__(self, copy: graph_copies.GraphCopy, ob: Any) -> None:
        """ob: an evaluated object that the full path has just deformed; copy: its GraphCopy."""
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
        has_keys = copy.goes_through_keys()
        watched = watch.of_object(ob, target, self._mesh, has_keys)
        for modifier in taken:
            watched += watch.of_armature(modifier)
        for modifier in behind:
            watched += watch.of_stage(modifier)
        modes = [switches.mode_switch(modifier, *wiring.OFF) for modifier in (*taken, *behind)]
        if plan.own is not None:
            shown = wiring.OFF if has_keys else plan.run.shown
            modes.append(switches.mode_switch(ob.modifiers[plan.own], *shown))
        poses = [
            (motions.pose_address_at(armature), layer.first_joint, layer.bones.joint_counts)
            for layer, armature in zip(copy.layers, armatures)
        ]
        self._has_keys = has_keys
        self._native = sinew_native.host.Shortcut(
            copy.deformer,
            watched,
            poses,
            motions.pose_layout(),
            [(places.place_address(ob), places.place_address(armature)) for armature in armatures],
            modes,
            copy.stages.at(ob, copy.stage_names(ob), None),
            watch.key_source(self._mesh.shape_keys) if has_keys else None,
            copy.rest_of_stages(),
        )
        self.milliseconds = self._native.milliseconds

    def holds(self) -> bool:
        """Whether everything is still as it was when the Shortcut was made."""
        return self._is_asked_for() and self._native.holds()

    def run(self) -> bool:
        """Deforms the mesh. Returns False if it did nothing and the full path has to run."""
        if not self.holds():
            return False
        # Asking for the address makes Blender give the mesh its own array: see host/vector_arrays.py.
        out = 0 if self._has_keys else self._mesh.attributes[nodes.POSITION_ATTRIBUTE].data[0].as_pointer()
        return self._native.deform(out)

    def _is_asked_for(self) -> bool:
        copy = self.copy
        return (
            not contract.is_broken()
            and copy.looks == copy.character.planning.looks
            and not character.stands_aside()
            and all(layers.is_edition(*edition) for edition in self._editions)
        )


def forget() -> None:
    """Discards all shortcuts."""
    _known.clear()


def of(ob: Any) -> Shortcut | None:
    """Returns the Shortcut of an evaluated object, or None."""
    return _known.get(ob.as_pointer())


def deform(ob: Any) -> bool:
    """Deforms an evaluated object by its shortcut. Returns False if it did nothing and the full path has to run."""
    address = ob.as_pointer()
    shortcut = _known.get(address)
    if shortcut is None:
        return False
    has_run = False
    try:
        has_run = shortcut.run()
    finally:
        if not has_run:  # removed for good: its modifiers may no longer exist
            _known.pop(address, None)
            shortcut.copy.note_other_frame()
    if has_run:
        shortcut.copy.character.status.timings.add(shortcut.milliseconds)
    return has_run


def learn(copy: graph_copies.GraphCopy, ob: Any) -> bool:
    """Counts a frame that the full path has just deformed, and makes a Shortcut after enough equal frames. Returns
    whether this frame used the same deformer and plan as the one before."""
    alike = copy.note_frame()
    if alike >= copy.patience and _is_plain(copy, ob):
        _known[ob.as_pointer()] = Shortcut(copy, ob)
    return alike > 1


def _is_plain(copy: graph_copies.GraphCopy, ob: Any) -> bool:
    """Whether everything that the frame depends on can be watched."""
    plan = copy.plan
    armatures = [ob.modifiers[name].object for name in plan.taken]
    return (
        copy.deformer.vertex_count > 0
        and ob.sinew.source != "CLIP"
        and all(watch.can_watch(ob.modifiers[name].type) for name in plan.run.stages)
        and all(not layer.influences.depend_on_shape for layer in copy.layers)
        and all(layers.is_posed(armature) for armature in armatures)
        and (not armatures or None not in map(places.place_address, (ob, *armatures)))
    )
