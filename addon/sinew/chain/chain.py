"""What computes a mesh's shape: the native objects built from what was read, in the order in which they run."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..native import sinew_native
from . import living, mixes, stages
from .leaving import LeaveToBlender

# Rebuilds allowed between two edits before Blender takes over. If influences depend on where the shape is (envelopes,
# curved B-bones) and the mesh moves relative to its armature, they would have to be rebuilt on every frame.
MOST_REBUILDS = 8


class Chain:
    """The deformer of one evaluated object, and the stages behind it."""

    def __init__(self, copy: Any) -> None:
        """copy: graph_copies.GraphCopy."""
        self._copy = copy
        self.deformer: Any = None  # sinew_native.Deformer, or None
        self.first = mixes.Mix(copy)  # of the Armature modifiers with which the chain begins
        self.later: dict[str, mixes.Mix] = {}  # of those of the run, by the name of each mix's first modifier
        self._stages = stages.Stages()  # of the run
        self._made_of: tuple = ()  # what the deformer was made of
        self._has_asked = False  # for a plan that leaves later Armature modifiers to Blender

    def look_again(self) -> None:
        """Has the next frame check what the stages are made from, after an edit."""
        self._stages.look_again()

    def follow_plan(self) -> None:
        """Follows another plan from now on."""
        for mix in (self.first, *self.later.values()):
            mix.begin_anew()
        self._has_asked = False
        self.look_again()

    # --- of this evaluation -----------------------------------------------------------------------

    def taken_now(self, ob: Any) -> list[Any]:
        """Returns the Armature modifiers with which the chain begins in this evaluation, with the values of their
        driven settings. ob: evaluated. Raises LeaveToBlender."""
        copy = self._copy
        return [copy.driven_settings.of(ob.modifiers[name]) for name in copy.plan.taken if name in copy.shown]

    def mixes_now(self) -> list[tuple[list[str], mixes.Mix]]:
        """Returns [(names of its modifiers that are on in this evaluation, mix)]: of the modifiers with which the chain
        begins, then of those of the run that have any."""
        plan, shown = self._copy.plan, self._copy.shown
        run = [([name for name in names if name in shown], names[0]) for names in plan.run.mixes]
        first = [name for name in plan.taken if name in shown]
        return [(first, self.first), *((names, self.later[key]) for names, key in run if names)]

    def stage_names(self, ob: Any) -> tuple[str, ...]:
        """Returns the names of the stages after skinning in this evaluation."""
        return stages.names(ob, self._copy.plan.run, self._copy.shown)

    def poses(
        self, ob: Any, channels_of: Callable[[Any], np.ndarray | None] = mixes.no_channels
    ) -> list[tuple[np.ndarray, np.ndarray | None]]:
        """Returns (motions, mesh_from_armature) per layer, as `deformer.deform` takes them. Also updates layers and
        deformer to the current modifiers. ob: evaluated; channels_of: see mixes.Mix.poses. Raises LeaveToBlender or
        values.Flat."""
        plan, reading = self._copy.plan, self._copy.reading
        methods_of = dict.fromkeys(plan.taken[:1], reading.method)
        found = self.first.poses(ob, self.taken_now(ob), dict(zip(plan.taken, plan.binds)), methods_of, channels_of)
        layers = [layer.native for layer in self.first.layers]
        keys = reading.keys and reading.keys.native
        rest, stencils = self.rest_of_stages(), self._copy.stencils
        if self.deformer is None or not _same(self._made_of, (*layers, keys, rest, stencils)):
            count = None if rest is None else len(rest)
            if stencils is not None and stencils.vertex_count != len(reading.rest):
                raise LeaveToBlender("the stencils of its last modifiers were found for another mesh")
            self.deformer = living.note(sinew_native.Deformer(layers, keys, vertex_count=count, stencils=stencils))
            self._made_of = (*layers, keys, rest, stencils)
        return found

    def stages_at(
        self,
        ob: Any,
        source: Callable[[], stages.Source] | None = None,
        channels_of: Callable[[Any], np.ndarray | None] = mixes.no_channels,
    ) -> list:
        """Returns the stages of an evaluated object in this frame, a list of sinew_native.Stage. source: see
        stages.Stages.at; channels_of: see mixes.Mix.poses. Raises LeaveToBlender or values.Flat."""
        ready = self._later_stages(ob, channels_of)
        return self._stages.at(ob, self.stage_names(ob), source, ready, self._copy.driven_settings.of)

    def stage_again(self, ob: Any, name: str) -> Any:
        """Returns one of the stages that stages_at has made, except one of layers, in this frame. Returns None if it
        must be made from other settings. Raises what stages_at raises."""
        return self._stages.again(ob, name, self._copy.driven_settings.of)

    def _later_stages(self, ob: Any, channels_of: Callable[[Any], np.ndarray | None]) -> dict[str, Any]:
        """Returns {name of its first modifier that is on: sinew_native.Stage} of each mix of the run in this
        evaluation."""
        copy, found = self._copy, {}
        binds = dict(copy.plan.later)
        self.later = {names[0]: self.later.get(names[0]) or mixes.Mix(copy) for names in copy.plan.run.mixes}
        for names, mix in self.mixes_now()[1:]:
            modifiers = [copy.driven_settings.of(ob.modifiers[name]) for name in names]
            poses = mix.poses(ob, modifiers, binds, {}, channels_of)
            if mix.native is None:
                self._check_weights(mix)
                mix.native = living.note(sinew_native.MixedLayers([layer.native for layer in mix.layers]))
                copy.fast_path.begin_anew()
            found[names[0]] = mix.native.stage(poses)
        return found

    def _check_weights(self, mix: mixes.Mix) -> None:
        """Checks that the weights of a later mix do not follow the shape: after an edit of the bones, they may. Then
        the main thread is asked for another plan. Raises LeaveToBlender."""
        if not any(layer.influences.depend_on_shape for layer in mix.layers):
            return
        if not self._has_asked:
            self._has_asked = True
            self._copy.character.planning.ask_to_rewire()
        raise LeaveToBlender("weights of a later Armature modifier follow the shape")

    def check_it_pays(self) -> None:
        """Leaves the mesh to Blender from the next evaluation on if its influences had to be rebuilt on every frame."""
        depends_on_shape = any(layer.influences.depend_on_shape for layer in self.first.layers)
        planning = self._copy.character.planning
        planning.moves_against_armature |= depends_on_shape and self.first.rebuilds > MOST_REBUILDS
        if depends_on_shape and (planning.moves_against_armature or self._copy.reading.keys is not None):
            planning.ask_to_rewire()

    def rest_of_stages(self) -> np.ndarray | None:
        """Returns the positions (V, 3) that the stages start from if the mesh has neither layers nor shape keys;
        otherwise None."""
        reading = self._copy.reading
        return reading.rest if not self.first.layers and reading.keys is None else None


def _same(before: Sequence[Any], now: Sequence[Any]) -> bool:
    return len(before) == len(now) and all(a is b for a, b in zip(before, now))
