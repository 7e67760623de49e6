"""A bound mesh in one dependency graph: what was read from that graph's evaluated copies.

A viewport, a render and a second scene each evaluate their own copies, which may be of different ages: while a user
paints, a render still has the mesh as it was when the render began. So each graph stores what it has read, which is
never used for another graph. Equal data is shared (`Shared`), whichever graph read it first.
"""

import itertools
import time
import weakref
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..blender import meshes
from ..host import deform_verts
from ..native import sinew_native
from ..plan import ways, wiring
from . import layers, methods, stages

# Rebuilds allowed between two edits before Blender takes over. If influences depend on where the shape is (envelopes,
# curved B-bones) and the mesh moves relative to its armature, they would have to be rebuilt on every frame.
MOST_REBUILDS = 8
LEAST_PATIENCE, MOST_PATIENCE = 2, 16


_edition_numbers = itertools.count(int(time.time()) % 2**30 + 1)


def new_edition() -> int:
    """Returns a number for a changed mesh that no other edition has."""
    return next(_edition_numbers)


class NotYet(Exception):
    """Blender's own modifiers deform the mesh in this evaluation, and that is not an error."""


class NotYetWired(NotYet):
    """The hook does not wait for everything it needs. The main thread fixes that and has Blender evaluate again."""


class OlderThanOriginal(NotYet):
    """This copy has different modifiers than the original has now, so the original's settings do not apply to it."""


class Shared:
    """The data that the graph copies of one mesh share: weights, rest positions and layers, each for as long as a graph
    copy uses it. Hold the character's lock."""

    def __init__(self) -> None:
        self._known: list[weakref.ref] = []

    def equal_to(self, kind: type, is_equal: Callable[[Any], bool]) -> Any:
        """Returns a shared object of that type for which is_equal(object) is true, or None."""
        known = (each() for each in self._known)
        return next((each for each in known if type(each) is kind and is_equal(each)), None)

    def add(self, found: Any) -> Any:
        """Shares an object and returns it."""
        self._known = [each for each in self._known if each() is not None] + [weakref.ref(found)]
        return found


class GraphCopy:
    """What was read from one evaluated object, and built from it. Only one thread at a time uses it, because Blender
    evaluates an object in one thread."""

    def __init__(self, character: Any) -> None:
        """character: character.Character."""
        self.character = character
        self.plan: Any = None  # plans.Plan of this copy of the object, or None
        self.looks = -1  # character.planning.looks when the plan was made
        self.mesh_address = self.keys_address = 0  # of the evaluated copies that were read
        self.edition: int = character.data.edition  # a number that no other edition of this mesh has; 0: not known
        self.weights: Any = None  # layers.Weights, or None
        self.rest: Any = None  # (V, 3), or None
        self.keys: Any = None  # shape_keys.Keys, or None if the mesh has no shape keys
        self.layers: list[layers.Layer] = []  # one per modifier
        self.deformer: Any = None  # sinew_native.Deformer of these layers, or None if it has to be made
        self.stages = stages.Stages()  # of the run
        self.method = methods.Method()
        self.is_deforming = False  # Sinew deformed the mesh in the last evaluation; otherwise Blender did
        self.patience = LEAST_PATIENCE  # how many equal frames in a row there must be before the fast path is used
        self._alike, self._has_failed, self._frame_before = 0, False, (None, None)
        self._is_method_known = False
        self._faces = ""  # methods.digest of the mesh's faces; "": not known
        self._rebuilds = 0  # of layers since the last edit

    def forget_plan(self) -> None:
        """Discards the plan. Call this when Blender has copied the object again, because the new copy's modifiers are
        switched as in the original."""
        self.plan, self.looks = None, -1

    def follow(self, plan: Any, looks: int) -> None:
        """Uses another plan from now on, after an edit of the object. plan: plans.Plan; looks: the planning's number
        when the plan was made."""
        self.plan, self.looks = plan, looks
        self._is_method_known = False
        self._rebuilds = 0
        self.stages.look_again()

    # --- equal frames, see shortcuts.py -----------------------------------------------------------

    def note_frame(self) -> int:
        """Returns how many frames in a row, including this one, used the same deformer and plan."""
        before, self._frame_before = self._frame_before, (self.deformer, self.plan)
        is_edited = any(a is not b for a, b in zip(before, self._frame_before))
        if is_edited:
            self.patience = LEAST_PATIENCE
        elif self._has_failed:
            self.patience = min(2 * self.patience, MOST_PATIENCE)
        self._alike = 1 if is_edited or self._has_failed else self._alike + 1
        self._has_failed = False
        return self._alike

    def note_other_frame(self) -> None:
        """Notes that the fast path could not be used: something was edited, or a setting is animated and may change on
        every frame."""
        self._has_failed = True

    def hook_of(self, ob: Any) -> Any:
        """Returns the hook of the object, or None."""
        return self.plan.hook_of(ob)

    # --- what it is built from --------------------------------------------------------------------

    def forget_shape(self) -> None:
        """Has weights, rest positions and shape keys read again."""
        self.layers, self.deformer, self.keys = [], None, None
        self.stages = stages.Stages()
        self.weights = self.rest = None
        self.mesh_address = self.keys_address = 0

    def forget_keys(self) -> None:
        """Discards the shape keys of a mesh that no longer has any."""
        if self.keys is not None:
            self.keys = self.deformer = None

    def read_mesh(self, mesh: Any, is_edited: bool) -> None:
        """Reads a mesh and keeps what has not changed. mesh: evaluated, before all modifiers."""
        self.mesh_address = mesh.as_pointer()
        self._frame_before = (None, None)
        if is_edited or not self.edition:
            self.edition = self.character.data.edition = new_edition()
        self.stages.look_again()
        self._is_method_known, self._faces = False, ""
        self.read_weights(mesh)

    def read_weights(self, mesh: Any) -> None:
        """Reads the weights of a mesh, and shares them if another graph copy has equal ones."""
        found = layers.Weights.of(mesh, deform_verts.group_names(mesh), meshes.read_weights)
        if not found.same_as(self.weights):
            shared = self.character.data.shared
            self.weights = shared.equal_to(layers.Weights, found.same_as) or shared.add(found)
            self.deformer = None

    def set_rest(self, found: np.ndarray) -> None:
        """Sets the rest shape, (V, 3). With shape keys, that is the reference key."""
        if self.rest is not None and np.array_equal(found, self.rest):
            return
        shared = self.character.data.shared
        known = shared.equal_to(np.ndarray, lambda each: np.array_equal(each, found))
        self.rest = shared.add(found) if known is None else known
        self.deformer = None

    def is_read(self) -> bool:
        return self.rest is not None

    def read_method(self, ob: Any, mesh: Any) -> None:
        """Reads the method and its settings, if they may have changed. ob, mesh: evaluated."""
        if not self._is_method_known:
            self.method = methods.Method.of(ob.original.sinew, lambda: self._digest_of_faces(mesh))
            self._is_method_known = True
            if self.method.kind not in methods.PRECOMPUTED:
                self.character.data.kept = methods.Kept()

    def _digest_of_faces(self, mesh: Any) -> str:
        self._faces = self._faces or methods.digest(*meshes.read_faces(mesh)[:2])
        return self._faces

    def poses(
        self, ob: Any, modifiers: Sequence[Any], channels_of: Callable[[Any], np.ndarray | None] = lambda modifier: None
    ) -> list[tuple[np.ndarray, np.ndarray | None]]:
        """Returns (motions, mesh_from_armature) per layer, as `deformer.deform` takes them. Also updates layers and
        deformer to the current modifiers. ob, modifiers: evaluated; channels_of(modifier): returns the motions of all
        bones (B, 4, 4) to use instead of the armature's, or None. Raises NotYet or values.Flat."""
        found = []
        for number, modifier in enumerate(modifiers):
            if number > 0 and modifier.object.mode == "EDIT":
                raise NotYet  # Blender skips such a modifier; a layer at rest would mix in the rest shape
            space = layers.space_between(ob, modifier.object)
            layer = self._layer(number, ob, modifier, space)
            channels = channels_of(modifier)
            pose = layer.read_pose(modifier.object) if channels is None else layer.with_channels(channels)
            found.append((pose, space))
        if len(self.layers) > len(modifiers):
            del self.layers[len(modifiers) :]
            self.deformer = None
        if self.deformer is None:
            self.deformer = sinew_native.Deformer(
                [layer.native for layer in self.layers],
                self.keys and self.keys.native,
                vertex_count=len(self.rest) if self.is_of_stages_alone() else None,
            )
        return found

    def _layer(self, number: int, ob: Any, modifier: Any, space: np.ndarray | None) -> layers.Layer:
        """Returns the layer with that number, and makes it if there is none or it is out of date."""
        armature = modifier.object
        # The other modifiers that Multi Modifier mixes use the method of their own settings.
        method = self.method if number == 0 else methods.Method()
        settings = layers.Settings.of(modifier, self.plan.binds[number])
        made_of = (settings, method, number), *layers.edition_of_bones(armature)

        def holds(layer: layers.Layer) -> bool:
            return layer.holds(self.weights, self.rest, made_of, space)

        old = self.layers[number] if number < len(self.layers) else None
        if old is not None and holds(old):
            return old
        self._rebuilds += old is not None
        # First, because Blender may not have evaluated a bone yet that the hook does not wait for.
        self._check_wires(armature, settings, old is not None and old.made_of != made_of)
        shared = self.character.data.shared
        layer = shared.equal_to(layers.Layer, holds) or shared.add(
            layers.make_layer(
                self.weights,
                self.rest,
                armature,
                space,
                made_of,
                ob.original.sinew.skinning.data,
                self.character.data.kept,
            )
        )
        self.layers[number : number + 1] = [layer]
        self.deformer = None
        return layer

    def _check_wires(self, armature: Any, settings: layers.Settings, were_edited: bool) -> None:
        """Checks that the hook waits for all bones. They may be new, have become B-bones, or got their first weight.
        Raises NotYetWired."""
        names = None if settings.use_envelopes else self.weights.used_names
        is_missed = not wiring.is_waiting_for(self.plan.waits_for, armature, names)
        if were_edited or is_missed:
            self.character.planning.ask_to_rewire()
        if is_missed:
            raise NotYetWired

    def check_it_pays(self) -> None:
        """Leaves the mesh to Blender from the next evaluation on if its influences had to be rebuilt on every frame."""
        depends_on_shape = any(layer.influences.depend_on_shape for layer in self.layers)
        planning = self.character.planning
        planning.moves_against_armature |= depends_on_shape and self._rebuilds > MOST_REBUILDS
        if depends_on_shape and (planning.moves_against_armature or self.keys is not None):
            planning.ask_to_rewire()

    def stage_names(self, ob: Any) -> tuple[str, ...]:
        """Returns the names of the stages after skinning."""
        return stages.names(ob, self.plan.run)

    def is_of_stages_alone(self) -> bool:
        """Whether the mesh has neither layers nor shape keys."""
        return not self.layers and self.keys is None

    def rest_of_stages(self) -> np.ndarray | None:
        """Returns the positions (V, 3) that the stages start from if nothing runs before them; otherwise None."""
        return self.rest if self.is_of_stages_alone() else None

    def goes_through_keys(self) -> bool:
        """Whether the deformed shape goes into the reference shape key."""
        return self.plan.way.kind == ways.KEYS
