"""The fast path: frames in which only the pose has changed. It skips most steps of in_pass.py; most others are native.

After the full path has run at least twice with the same data, everything that it depended on is watched in Blender's
memory. While none of it changes, the next frame of this evaluated object needs only its pose, its transform and the
array to write to. Stages that follow something else on each frame, another object's shape or a driver, are made anew.
"""

from typing import Any

from ..blender import nodes
from ..host import contract, motions, places, switches, watch
from ..native import sinew_native
from ..plan import wiring
from . import character, frame_shapes, graph_copies, layers, switching

_known: dict[int, "Shortcut"] = {}  # by the address of the evaluated object


class Shortcut:
    """The fast path of one evaluated object."""

    def __init__(self, copy: graph_copies.GraphCopy, ob: Any) -> None:
        """ob: an evaluated object that the full path has just deformed; copy: its GraphCopy."""
        plan = copy.plan
        self.copy = copy
        replaced = [ob.modifiers[name] for name in plan.replaced]
        armatures, own = _armatures_and_layers(copy, ob)
        self._editions = [(armature.data.as_pointer(), layer.edition) for armature, layer in zip(armatures, own)]
        hook = copy.hook_of(ob)
        self._mesh = wiring.source_of(hook)
        has_keys = copy.goes_through_keys()
        watched = watch.Tree(ob)
        if copy.goes_through_canvas():
            watched.add_canvas(wiring.target_of(hook, "canvas"), self._mesh)
            for name in ("mesh", "copied") if plan.way.has_copy else ():
                target = wiring.target_of(hook, name)
                watched.add_mesh(target, target.id, False)
        else:
            watched.add_mesh(wiring.target_of(hook, "mesh"), self._mesh, has_keys)
        self._live = _live_stages(copy, ob)
        live = {name for _number, name in self._live}
        for modifier in replaced:
            if modifier.name in copy.shown and modifier.name not in live:
                watched.add_modifier(modifier)
        front = [ob.modifiers[name] for name in plan.way.front]
        modes = [switches.aside_switch(modifier) for modifier in (*replaced, *front)]
        self._switches = [(address, switches.switches_at(address)) for address, *_ in modes[: len(replaced)]]
        if plan.own is not None:
            modes.append(switches.mode_switch(ob.modifiers[plan.own], *switching.switches_of_own(ob, plan)))
        poses = [
            (motions.pose_address_at(armature), layer.first_joint, layer.bones.joint_counts)
            for layer, armature in zip(own, armatures)
        ]
        self._has_keys, self._identity = has_keys, copy.identity(ob)
        self._native = sinew_native.host.Shortcut(
            copy.deformer,
            watched.structs,
            poses,
            motions.pose_layout(),
            [(places.place_address(ob), places.place_address(armature)) for armature in armatures],
            modes,
            copy.stages_at(ob),
            watch.key_source(self._mesh.shape_keys, plan.animated_mutes) if has_keys else None,
            copy.rest_of_stages(),
            self._identity,
        )
        self.milliseconds = self._native.milliseconds

    def holds(self) -> bool:
        """Whether everything is still as it was when the Shortcut was made."""
        return self._is_asked_for() and self._native.holds() and self._are_switches_alike()

    def run(self, ob: Any) -> bool:
        """Deforms the mesh. ob: the evaluated object. Returns False if it did nothing and the full path has to run.
        Raises what GraphCopy.stages_at raises."""
        if not self.holds():
            return False
        for number, name in self._live:
            stage = self.copy.stage_again(ob, name)
            if stage is None:
                return False
            self._native.set_stage(number, stage)
        # Asking for the address makes Blender give the mesh its own array: see host/vector_arrays.py.
        out = 0 if self._has_keys else self._mesh.attributes[nodes.POSITION_ATTRIBUTE].data[0].as_pointer()
        keeper = frame_shapes.of(ob)
        if keeper is None:
            return self._native.deform(out)
        has_run = self._native.deform(out, keeper.known, keeper.is_keeping)
        keeper.found, keeper.identity = self._native.shape if has_run else None, self._identity
        return has_run

    def _are_switches_alike(self) -> bool:
        """Whether drivers and keyframes have left the switches of modifiers as they were. Only if the native shortcut
        holds, because otherwise the modifiers may no longer exist."""
        return all(switches.switches_at(address) == before for address, before in self._switches)

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
        has_run = shortcut.run(ob)
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
    armatures, own = _armatures_and_layers(copy, ob)
    return (
        copy.deformer.vertex_count > 0
        and ob.sinew.source != "CLIP"
        and not any(name in copy.driven_settings for names, _mix in copy.mixes_now() for name in names)
        and all(not layer.influences.depend_on_shape for layer in own)
        and all(layers.is_posed(armature) for armature in armatures)
        and (not armatures or None not in map(places.place_address, (ob, *armatures)))
    )


def _live_stages(copy: graph_copies.GraphCopy, ob: Any) -> list[tuple[int, str]]:
    """Returns [(number, name)] of the stages that are made anew on each frame: a driver may change them, or they depend
    on more than their modifiers. ob: evaluated."""
    return [
        (number, name)
        for number, name in enumerate(copy.stage_names(ob))
        if name in ob.modifiers and (name in copy.driven_settings or not watch.can_watch(ob.modifiers[name].type))
    ]


def _armatures_and_layers(copy: graph_copies.GraphCopy, ob: Any) -> tuple[list[Any], list[layers.Layer]]:
    """Returns the armatures of all mixes of this evaluation, one per layer, and their layers, in the order in which the
    native deformer and its stages have them. ob: evaluated."""
    mixes_now = copy.mixes_now()
    armatures = [ob.modifiers[name].object for names, _mix in mixes_now for name in names]
    return armatures, [layer for _names, mix in mixes_now for layer in mix.layers]
