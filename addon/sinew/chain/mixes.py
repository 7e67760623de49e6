"""The layers of one Armature modifier, with those of the modifiers that Multi Modifier mixes with it.

The first mix of a mesh is what its deformer computes. The mixes of later Armature modifiers are stages: each deforms
the shape that the stages before it leave.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..plan import wiring
from . import bone_editions, layers, methods
from .leaving import LeaveToBlender


def no_channels(_armature: Any) -> np.ndarray | None:
    """Stands for: the armatures have the pose that counts."""
    return None


class Mix:
    """One mix of a mesh, in one dependency graph."""

    def __init__(self, copy: Any) -> None:
        """copy: graph_copies.GraphCopy."""
        self._copy = copy
        self.layers: list[layers.Layer] = []  # one per modifier that is on
        self.native: Any = None  # of a later mix: the sinew_native.MixedLayers of these layers; None: it has to be made
        self.rebuilds = 0  # of layers since the last edit
        # Also of modifiers that were switched off, for when they are on again: by name and place among those on.
        self._known: dict[tuple[str, int], layers.Layer] = {}

    def begin_anew(self) -> None:
        """Counts rebuilds from now on, after an edit, and discards the layers that the last evaluation did not use."""
        self.rebuilds = 0
        self._known = {key: layer for key, layer in self._known.items() if any(layer is each for each in self.layers)}

    def poses(
        self,
        ob: Any,
        modifiers: Sequence[Any],
        binds: Mapping[str, tuple[bool, bool]],
        methods_of: Mapping[str, methods.Method],
        channels_of: Callable[[Any], np.ndarray | None],
    ) -> list[tuple[np.ndarray, np.ndarray | None]]:
        """Returns (motions, mesh_from_armature) per layer, as `deformer.deform` takes them. Also updates the layers to
        the current modifiers. ob: evaluated; modifiers: its modifiers that are on in this evaluation, with the values
        of their driven settings; binds: by name of the modifier; methods_of: by name, of those that do not use the
        method of their own settings; channels_of(armature): returns the motions of all bones (B, 4, 4) to use instead
        of the armature's, or None. Raises LeaveToBlender or values.Flat."""
        found, used = [], []
        for number, modifier in enumerate(modifiers):
            if number > 0 and modifier.object.data.is_editmode:
                # Blender skips such a modifier; a layer at rest would mix in the rest shape.
                raise LeaveToBlender(f"{modifier.object.name} is in Edit Mode")
            space = layers.space_between(ob, modifier.object)
            settings = layers.Settings.of(modifier, binds[modifier.name])
            how = settings, methods_of.get(modifier.name, methods.Method()), number
            layer = self._layer(ob, modifier, how, space)
            channels = channels_of(modifier.object)
            pose = layer.read_pose(modifier.object) if channels is None else layer.with_channels(channels)
            found.append((pose, space))
            used.append(layer)
        if list(map(id, used)) != list(map(id, self.layers)):
            self.layers, self.native = used, None
        return found

    def _layer(self, ob: Any, modifier: Any, how: tuple, space: np.ndarray | None) -> layers.Layer:
        """Returns a layer, and makes it if there is none or it is out of date. how: (settings, method, number)."""
        copy, armature = self._copy, modifier.object
        settings, _method, number = how
        made_of = how, *bone_editions.of(armature)

        def holds(layer: layers.Layer) -> bool:
            return layer.holds(copy.reading.weights, copy.reading.rest, made_of, space)

        old = self._known.get((modifier.name, number))
        if old is not None and holds(old):
            return old
        self.rebuilds += old is not None
        # First, because Blender may not have evaluated a bone yet that the hook does not wait for.
        self._check_wires(armature, settings, old is not None and old.made_of != made_of)
        reading, character = copy.reading, copy.character
        text = ob.original.sinew.skinning.data
        layer = character.shared.equal_to(layers.Layer, holds) or character.shared.add(
            layers.make_layer(reading.weights, reading.rest, armature, space, made_of, text, character.kept)
        )
        self._known[modifier.name, number] = layer
        return layer

    def _check_wires(self, armature: Any, settings: layers.Settings, were_edited: bool) -> None:
        """Checks that the hook waits for all bones. They may be new, have become B-bones, or got their first weight.
        Raises LeaveToBlender."""
        copy = self._copy
        names = None if settings.use_envelopes else copy.reading.weights.used_names
        is_missed = not wiring.is_waiting_for(copy.plan.waits_for, armature, names)
        if were_edited or is_missed:
            copy.character.planning.ask_to_rewire()
        if is_missed:
            raise LeaveToBlender("the hook does not wait for all bones")  # until the main thread has rewired it
