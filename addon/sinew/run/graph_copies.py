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
from ..host import deform_verts, marks
from ..native import sinew_native
from ..plan import ways
from . import driven_settings, layers, methods, mixes, stages, switching

# Rebuilds allowed between two edits before Blender takes over. If influences depend on where the shape is (envelopes,
# curved B-bones) and the mesh moves relative to its armature, they would have to be rebuilt on every frame.
MOST_REBUILDS = 8
LEAST_PATIENCE, MOST_PATIENCE = 2, 16
# Modes in which each dab of a brush changes the mesh.
PAINTING = {"WEIGHT_PAINT", "VERTEX_PAINT"}


_identities = itertools.count(1)
_edition_numbers = itertools.count(int(time.time()) % 2**30 + 1)


def new_edition() -> int:
    """Returns a number for a changed mesh that no other edition has."""
    return next(_edition_numbers)


class OlderThanOriginal(mixes.NotYet):
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
        self.first = mixes.Mix(self)  # of the Armature modifiers with which the chain begins
        self.later: dict[str, mixes.Mix] = {}  # of the Armature modifiers of the run, by the name of each mix's first
        self.stages = stages.Stages()  # of the run
        self.method = methods.Method()
        # Names of the modifiers that Sinew replaces and that are on in this evaluation.
        self.shown: tuple[str, ...] = ()
        self.driven_settings: Any = None  # driven_settings.DrivenSettings, or None if the plan is new
        self.is_deforming = False  # Sinew deformed the mesh in the last evaluation; otherwise Blender did
        self.patience = LEAST_PATIENCE  # how many equal frames in a row there must be before the fast path is used
        self._alike, self._has_failed, self._frame_before = 0, False, (None, None)
        self._is_method_known = False
        self._faces = ""  # methods.digest of the mesh's faces; "": not known
        self._has_asked = False  # for a plan that leaves later Armature modifiers to Blender
        self._is_copy_true: bool | None = None  # the canvas's copy is like the mesh; None: to be compared
        self._compared = (0, 0)  # addresses of the two
        self._identity, self._computed_by = 0, tuple[Any, ...]()  # see identity

    @property
    def layers(self) -> list[layers.Layer]:
        """The layers with which the chain begins, one per modifier."""
        return self.first.layers

    @property
    def deformer(self) -> Any:
        """The sinew_native.Deformer of these layers, or None if it has to be made."""
        return self.first.native

    def forget_plan(self) -> None:
        """Discards the plan. Call this when Blender has copied the object again, because the new copy's modifiers are
        switched as in the original."""
        self.plan, self.looks = None, -1
        self._compared = (0, 0)

    def follow(self, plan: Any, looks: int) -> None:
        """Uses another plan from now on, after an edit of the object. plan: plans.Plan; looks: the planning's number
        when the plan was made."""
        self.plan, self.looks = plan, looks
        self._is_method_known = False
        self.first.begin_anew()
        for mix in self.later.values():
            mix.begin_anew()
        self._has_asked = False
        self.driven_settings = None
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
        self.first, self.later, self.keys = mixes.Mix(self), {}, None
        self.stages = stages.Stages()
        self.weights = self.rest = None
        self.mesh_address = self.keys_address = 0

    def forget_keys(self) -> None:
        """Discards the shape keys of a mesh that no longer has any."""
        if self.keys is not None:
            self.keys = self.first.native = None

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
            self.first.native = None

    def leaves_dabs(self, ob: Any) -> bool:
        """Whether Blender deforms an evaluated object in an evaluation in which somebody has painted on it.

        To read all weights again takes longer than Blender's Armature modifiers and shape keys, but not as long as its
        smoothing."""
        plan = self.plan
        if ob.mode not in PAINTING or not self.is_read() or plan is None or not plan.is_wired:
            return False
        return (
            self.looks == self.character.planning.looks
            and all(name in ob.modifiers for name in (*plan.replaced, *filter(None, [plan.own])))
            and ob.sinew.installed_output != "MESH"  # which takes the shape that Sinew has written
            and not self.method.kind
            and {name for mix in plan.run.mixes for name in mix}.issuperset(self.stage_names(ob))
        )

    def set_rest(self, found: np.ndarray) -> None:
        """Sets the rest shape, (V, 3). With shape keys, that is the reference key."""
        if self.rest is not None and np.array_equal(found, self.rest):
            return
        shared = self.character.data.shared
        known = shared.equal_to(np.ndarray, lambda each: np.array_equal(each, found))
        self.rest = shared.add(found) if known is None else known
        self.first.native = None

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

    def has_work(self, ob: Any) -> bool:
        """Reads which modifiers are on in this evaluation. Returns whether Sinew has anything to deform. ob: evaluated.
        Raises switching.NotTold."""
        self.shown = switching.shown(ob, self.plan)
        if self.driven_settings is None:
            self.driven_settings = driven_settings.DrivenSettings(ob, self.plan)
        if self.goes_through_keys() and self.plan.taken:
            # With the Armature modifier off, exporters expect shape keys that they can read.
            return any(name in self.shown for name in self.plan.taken)
        return bool(self.shown) or not self.plan.replaced

    def taken_now(self, ob: Any) -> list[Any]:
        """Returns the Armature modifiers that Sinew replaces in this evaluation, with the values of their driven
        settings. ob: evaluated. Raises driven_settings.NoValue."""
        return [self.driven_settings.of(ob.modifiers[name]) for name in self.plan.taken if name in self.shown]

    def mixes_now(self) -> list[tuple[list[str], mixes.Mix]]:
        """Returns [(names of its modifiers that are on in this evaluation, mix)]: of the modifiers with which the chain
        begins, then of those of the run that have any."""
        run = [([name for name in names if name in self.shown], names[0]) for names in self.plan.run.mixes]
        first = [name for name in self.plan.taken if name in self.shown]
        return [(first, self.first), *((names, self.later[key]) for names, key in run if names)]

    def poses(
        self, ob: Any, modifiers: Sequence[Any], channels_of: Callable[[Any], np.ndarray | None] = mixes.no_channels
    ) -> list[tuple[np.ndarray, np.ndarray | None]]:
        """Returns (motions, mesh_from_armature) per layer, as `deformer.deform` takes them. Also updates layers and
        deformer to the current modifiers. ob, modifiers: evaluated, see taken_now; channels_of: see mixes.Mix.poses.
        Raises NotYet or values.Flat."""
        plan = self.plan
        found = self.first.poses(
            ob, modifiers, dict(zip(plan.taken, plan.binds)), dict.fromkeys(plan.taken[:1], self.method), channels_of
        )
        if self.deformer is None:
            self.first.native = sinew_native.Deformer(
                [layer.native for layer in self.layers],
                self.keys and self.keys.native,
                vertex_count=len(self.rest) if self.is_of_stages_alone() else None,
            )
        return found

    def stages_at(
        self,
        ob: Any,
        source: Callable[[], stages.Source] | None = None,
        channels_of: Callable[[Any], np.ndarray | None] = mixes.no_channels,
    ) -> list:
        """Returns the stages of an evaluated object in this frame, a list of sinew_native.Stage. source: see
        stages.Stages.at; channels_of: see mixes.Mix.poses. Raises NotYet, cage_stages.NotReadable,
        driven_settings.NoValue or values.Flat."""
        ready = self._later_stages(ob, channels_of)
        return self.stages.at(ob, self.stage_names(ob), source, ready, self.driven_settings.of)

    def stage_again(self, ob: Any, name: str) -> Any:
        """Returns one of the stages that stages_at has made, except one of layers, in this frame. Returns None if it
        must be made from other settings. Raises what stages_at raises."""
        return self.stages.again(ob, name, self.driven_settings.of)

    def _later_stages(self, ob: Any, channels_of: Callable[[Any], np.ndarray | None]) -> dict[str, Any]:
        """Returns {name of its first modifier that is on: sinew_native.Stage} of each mix of the run in this
        evaluation."""
        plan, found = self.plan, {}
        binds = dict(plan.later)
        self.later = {names[0]: self.later.get(names[0]) or mixes.Mix(self) for names in plan.run.mixes}
        for names, mix in self.mixes_now()[1:]:
            modifiers = [self.driven_settings.of(ob.modifiers[name]) for name in names]
            poses = mix.poses(ob, modifiers, binds, {}, channels_of)
            if mix.native is None:
                self._check_weights(mix)
                mix.native = sinew_native.MixedLayers([layer.native for layer in mix.layers])
                self._frame_before = (None, None)
            found[names[0]] = mix.native.stage(poses)
        return found

    def _check_weights(self, mix: mixes.Mix) -> None:
        """Checks that the weights of a later mix do not follow the shape: after an edit of the bones, they may. Then
        the main thread is asked for another plan. Raises NotYet."""
        if not any(layer.influences.depend_on_shape for layer in mix.layers):
            return
        if not self._has_asked:
            self._has_asked = True
            self.character.planning.ask_to_rewire()
        raise mixes.NotYet

    def check_it_pays(self) -> None:
        """Leaves the mesh to Blender from the next evaluation on if its influences had to be rebuilt on every frame."""
        depends_on_shape = any(layer.influences.depend_on_shape for layer in self.layers)
        planning = self.character.planning
        planning.moves_against_armature |= depends_on_shape and self.first.rebuilds > MOST_REBUILDS
        if depends_on_shape and (planning.moves_against_armature or self.keys is not None):
            planning.ask_to_rewire()

    def stage_names(self, ob: Any) -> tuple[str, ...]:
        """Returns the names of the stages after skinning in this evaluation."""
        return stages.names(ob, self.plan.run, self.shown)

    def is_of_stages_alone(self) -> bool:
        """Whether the mesh has neither layers nor shape keys."""
        return not self.layers and self.keys is None

    def rest_of_stages(self) -> np.ndarray | None:
        """Returns the positions (V, 3) that the stages start from if nothing runs before them; otherwise None."""
        return self.rest if self.is_of_stages_alone() else None

    def identity(self, ob: Any) -> int:
        """Returns a number for the deformer, the native objects of the stages and what they start from, as the last
        evaluation had them. No others have the same number. ob: evaluated."""
        natives = (
            self.later[name].native if name in self.later else self.stages.native_of(name)
            for name in self.stage_names(ob)
        )
        computed_by = self.deformer, self.rest_of_stages(), *natives
        before = self._computed_by  # kept, so that nothing else gets their addresses
        if len(before) != len(computed_by) or any(a is not b for a, b in zip(before, computed_by)):
            self._computed_by, self._identity = computed_by, next(_identities)
        return self._identity

    def check_copy(self, mesh: Any, copied: Any) -> None:
        """Compares the mesh with the canvas's copy, if either may have been edited. mesh, copied: evaluated, before all
        modifiers. Raises NotYet if they differ, or if the mesh has just been edited: then it may be again. In a new
        graph, they are compared at once."""
        is_mesh_seen = marks.test_and_mark(mesh, "MESH")
        is_copy_seen = marks.test_and_mark(copied, "MESH")
        before, self._compared = self._compared, (mesh.as_pointer(), copied.as_pointer())
        if not is_mesh_seen or not is_copy_seen or before != self._compared:
            self._is_copy_true = None
            if not is_mesh_seen and before != (0, 0):
                raise mixes.NotYet
        planning = self.character.planning
        if self._is_copy_true is None:
            self._is_copy_true = meshes.are_same(mesh, copied)
        if not self._is_copy_true:
            if is_mesh_seen:
                planning.ask_for_copy()
            raise mixes.NotYet
        planning.note_copy()

    def goes_through_canvas(self) -> bool:
        """Whether the mesh is read from a canvas, and the deformed shape goes there."""
        return self.plan.way.kind == ways.CANVAS

    def goes_through_keys(self) -> bool:
        """Whether the deformed shape goes into the reference shape key."""
        return self.plan.way.kind == ways.KEYS
