"""The fast path: frames in which only the pose has changed. It skips most steps of in_pass.py; most others are native.

After the full path has run at least twice with the same data, everything that it depended on is watched in Blender's
memory. While none of it changes, the next frame of this evaluated object needs only its pose, its transform and the
array to write to. Stages that follow something else on each frame, another object's shape or a driver, are made anew.

Posing by hand has Blender copy the armature again, with its bones. If these are the same, the fast path still holds.
"""

from typing import Any

from ..blender import nodes
from ..chain import bone_editions, layers, living
from ..host import contract, features, modifier_memory, places, poses, watched_tree
from ..native import sinew_native
from ..plan import wiring
from . import switching

LEAST_PATIENCE, MOST_PATIENCE = 2, 16


class FastPath:
    """The fast path of one evaluated object, if there is one."""

    def __init__(self, copy: Any) -> None:
        """copy: graph_copies.GraphCopy."""
        self._copy = copy
        self.shortcut: Shortcut | None = None
        self._patience = LEAST_PATIENCE  # how many equal frames in a row there must be before there is one
        self._alike = 0  # how many equal frames in a row there were
        self._has_failed = False  # the last shortcut could not be used
        self._is_refused = False  # this Blender keeps some of what would be watched in another way
        self._frame_before: tuple[Any, Any] = (None, None)  # the deformer and the plan of the last frame

    def run(self, ob: Any) -> bool:
        """Deforms the evaluated object. Returns False if nothing was done and the full path has to run. Raises
        LeaveToBlender or values.Flat."""
        shortcut = self.shortcut
        if shortcut is None:
            return False
        has_run = False
        try:
            has_run = shortcut.run(ob)
        finally:
            if not has_run:  # removed for good: its modifiers may no longer exist
                self.shortcut = None
                # Something was edited, or a setting is animated and may change on every frame.
                self._has_failed = True
        if has_run:
            self._copy.character.status.timings.add(shortcut.milliseconds)
        return has_run

    def begin_anew(self) -> None:
        """Has the next frames count as other ones than those before."""
        self._frame_before = (None, None)

    def learn(self, ob: Any) -> bool:
        """Counts a frame that the full path has just deformed, and makes a shortcut after enough equal frames. Returns
        whether this frame used the same deformer and plan as the one before."""
        copy = self._copy
        before, self._frame_before = self._frame_before, (copy.chain.deformer, copy.plan)
        is_edited = any(a is not b for a, b in zip(before, self._frame_before))
        if is_edited:
            self._patience, self._is_refused = LEAST_PATIENCE, False
        elif self._has_failed:
            self._patience = min(2 * self._patience, MOST_PATIENCE)
        self._alike = 1 if is_edited or self._has_failed else self._alike + 1
        self._has_failed = False
        if self._alike >= self._patience and not self._is_refused and _is_plain(copy, ob):
            try:
                self.shortcut = Shortcut(copy, ob)
            except contract.Broken:
                self._is_refused = True
        return self._alike > 1


class Shortcut:
    """What is watched of one evaluated object, and what deforms it while that is unchanged."""

    def __init__(self, copy: Any, ob: Any) -> None:
        """ob: an evaluated object that the full path has just deformed; copy: its GraphCopy. Raises
        contract.Broken."""
        plan, chain = copy.plan, copy.chain
        self._copy = copy
        replaced = [ob.modifiers[name] for name in plan.replaced]
        armatures, own = _armatures_and_layers(copy, ob)
        self._bones = [(each, each.data.as_pointer(), layer.edition) for each, layer in zip(armatures, own)]
        hook = copy.hook_of(ob)
        self._mesh = wiring.source_of(hook)
        has_keys, keys = plan.way.has_keys, copy.reading.keys
        key_block = wiring.waits_for(hook, "mesh").shape_keys if has_keys else None
        watched = watched_tree.Tree(ob)
        if copy.goes_through_canvas():
            watched.add_canvas(wiring.target_of(hook, "canvas"), self._mesh)
            for name in ("mesh", "copied") if plan.way.has_copy else ():
                target = wiring.target_of(hook, name)
                watched.add_mesh(target, target.id, has_keys and name == "mesh")
        else:
            watched.add_mesh(wiring.target_of(hook, "mesh"), self._mesh, has_keys)
        self._live = _live_stages(copy, ob)
        live = {name for _number, name in self._live}
        for modifier in replaced:
            if modifier.name in copy.shown and modifier.name not in live:
                watched.add_modifier(modifier)
        names = switching.aside(plan, copy.stencils is not None)
        aside = {name: modifier_memory.aside_switch(ob.modifiers[name]) for name in names}
        modes = list(aside.values())
        # Drivers and keyframes may change these.
        kept = [(aside[name][0], modifier_memory.SWITCHES) for name in plan.replaced]
        if plan.own is not None:
            modes.append(modifier_memory.mode_switch(ob.modifiers[plan.own], *switching.switches_of_own(ob, plan)))
        read = [
            (poses.pose_address_at(armature), layer.first_joint, layer.bones.joint_counts)
            for layer, armature in zip(own, armatures)
        ]
        self._goes_through_keys = copy.goes_through_keys()
        native = sinew_native.host.Shortcut(
            chain.deformer,
            watched.structs,
            read,
            poses.pose_layout(_has_segments(own)) if own else poses.NO_LAYOUT,
            [(places.place_at(ob), places.place_at(armature)) for armature in armatures],
            modes,
            chain.stages_at(ob),
            watched_tree.key_source(key_block, keys.relative, keys.base) if has_keys else None,
            chain.rest_of_stages(),
            kept,
            watched.bones,
        )
        self._native = living.note(native)
        self.milliseconds = native.milliseconds

    def holds(self) -> bool:
        """Whether everything is still as it was when the shortcut was made."""
        if (
            contract.is_broken()
            or not self._copy.has_current_plan
            or switching.stands_aside()
            or not self._native.holds()
        ):
            return False
        has_copied = not self._native.has_bones()
        for armature, address, edition in self._bones:  # not all(...): that takes a microsecond for each mesh
            if has_copied:
                bone_editions.of(armature)  # which marks the new copy
            if not bone_editions.is_last(address, edition):
                return False
        return True

    def restore(self) -> bool:
        """Restores what the last frame has set, after the evaluation. Returns False if it did nothing."""
        return self._native.restore()

    def run(self, ob: Any) -> bool:
        """Deforms the mesh. ob: the evaluated object. Returns False if it did nothing and the full path has to run.
        Raises what Chain.stages_at raises."""
        if not self.holds():
            return False
        for number, name in self._live:
            stage = self._copy.chain.stage_again(ob, name)
            if stage is None:
                return False
            self._native.set_stage(number, stage)
        # Asking for the address makes Blender give the mesh its own array: see host/mesh_arrays.py.
        out = 0 if self._goes_through_keys else self._mesh.attributes[nodes.POSITION_ATTRIBUTE].data[0].as_pointer()
        return self._native.deform(out)


def _is_plain(copy: Any, ob: Any) -> bool:
    """Whether everything that the frame depends on can be watched."""
    armatures, own = _armatures_and_layers(copy, ob)
    return (
        copy.chain.deformer.vertex_count > 0
        and copy.chain.deformer.result_count > 0
        and ob.sinew.source != "CLIP"
        and not any(name in copy.driven_settings for names, _mix in copy.chain.mixes_now() for name in names)
        and all(not layer.influences.depend_on_shape for layer in own)
        and all(layers.is_posed(armature) for armature in armatures)
        and (not armatures or all(map(places.is_found, (ob, *armatures))))
        and contract.has(features.FAST)
    )


def _has_segments(own: list[layers.Layer]) -> bool:
    """Whether any of the bones that move the layers is a B-bone."""
    return any((layer.bones.joint_counts[layer.first_joint >= 0] > 1).any() for layer in own)


def _live_stages(copy: Any, ob: Any) -> list[tuple[int, str]]:
    """Returns [(number, name)] of the stages that are made anew on each frame: a driver may change them, or they depend
    on more than their modifiers. ob: evaluated."""
    return [
        (number, name)
        for number, name in enumerate(copy.chain.stage_names(ob))
        if name in ob.modifiers
        and (name in copy.driven_settings or not watched_tree.can_watch(ob.modifiers[name].type))
    ]


def _armatures_and_layers(copy: Any, ob: Any) -> tuple[list[Any], list[layers.Layer]]:
    """Returns the armatures of all mixes of this evaluation, one per layer, and their layers, in the order in which the
    native deformer and its stages have them. ob: evaluated."""
    mixes_now = copy.chain.mixes_now()
    armatures = [ob.modifiers[name].object for names, _mix in mixes_now for name in names]
    return armatures, [layer for _names, mix in mixes_now for layer in mix.layers]
