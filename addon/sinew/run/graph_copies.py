"""A bound mesh in one dependency graph: what was read from that graph's evaluated copies.

A viewport, a render and a second scene evaluate copies of their own, which need not be of the same age: while somebody
paints, a render still has the mesh as it was when it began. So each keeps what it has read, and nothing of it counts
for another graph. What is equal is shared (`Shared`), whoever has read it first.
"""

import itertools
import time
import weakref

import numpy as np

from ..blender import meshes
from ..host import deform_verts
from ..native import sinew_native
from ..plan import ways, wiring
from . import layers, methods, stages

# Where influences depend on the shape's place (envelopes, curved B-bones) and it moves against its armature, they would
# have to be made anew on each frame. So often it may happen between two edits:
MOST_REBUILDS = 8
LEAST_PATIENCE, MOST_PATIENCE = 2, 16


_edition_numbers = itertools.count(int(time.time()) % 2**30 + 1)


def new_edition():
    return next(_edition_numbers)


class NotYet(Exception):
    """Blender's own modifiers deform in this evaluation, and nothing is wrong."""


class NotYetWired(NotYet):
    """The hook does not wait for all that it needs: the main thread mends that and has Blender evaluate again."""


class OlderThanOriginal(NotYet):
    """This copy has other modifiers than the original has by now: what the original says does not hold for it."""


class Shared:
    """What the graphs' copies of one mesh have in common: weights, rest positions and layers, each as long as a copy
    has it. Under the character's lock."""

    def __init__(self):
        self._known = []  # weak references

    def equal_to(self, kind, is_equal):
        """What is known of that type for which is_equal(known) holds, or None."""
        known = (each() for each in self._known)
        return next((each for each in known if type(each) is kind and is_equal(each)), None)

    def add(self, found):
        self._known = [each for each in self._known if each() is not None] + [weakref.ref(found)]
        return found


class GraphCopy:
    """Of one evaluated object: for one thread at a time, as Blender evaluates it."""

    def __init__(self, character):
        self.character = character
        self.plan = None  # plans.Plan of this copy of the object
        self.looks = -1  # character.planning.looks when it was made
        self.mesh_address = self.keys_address = 0  # of the evaluated copies that were read
        self.edition = character.data.edition  # a number that no other edition of this mesh has had; 0: not known
        self.weights = None  # layers.Weights
        self.rest = None  # (V, 3)
        self.keys = None  # shape_keys.Keys, of a mesh that has them
        self.layers = []  # of layers.Layer, as long as there are modifiers
        self.deformer = None  # sinew_native.Deformer of these layers, or None: make it anew
        self.stages = stages.Stages()  # of the run
        self.method = methods.Method()
        self.is_deforming = False  # in the last pass; else Blender did
        self.patience = LEAST_PATIENCE  # so many frames in a row have to be alike before the shorter way is taken
        self._alike, self._has_failed, self._frame_before = 0, False, (None, None)
        self._is_method_known = False
        self._faces = ""  # methods.digest of the mesh's; "": not known
        self._rebuilds = 0  # of layers since the last edit

    def forget_plan(self):
        """Blender has copied the object anew: its modifiers are as their owner left them."""
        self.plan, self.looks = None, -1

    def follow(self, plan, looks):
        """Goes by another plan: the object was edited."""
        self.plan, self.looks = plan, looks
        self._is_method_known = False
        self._rebuilds = 0
        self.stages.look_again()

    # --- frames that are alike, see shortcuts.py --------------------------------------------------

    def note_frame(self):
        """Returns how many frames in a row were deformed with the same, this one included."""
        before, self._frame_before = self._frame_before, (self.deformer, self.plan)
        is_edited = any(a is not b for a, b in zip(before, self._frame_before))
        if is_edited:
            self.patience = LEAST_PATIENCE
        elif self._has_failed:
            self.patience = min(2 * self.patience, MOST_PATIENCE)
        self._alike = 1 if is_edited or self._has_failed else self._alike + 1
        self._has_failed = False
        return self._alike

    def note_other_frame(self):
        """What was taken for alike was not: somebody has edited something, or a setting is animated, and it might be so
        on each frame."""
        self._has_failed = True

    def hook_of(self, ob):
        return self.plan.hook_of(ob)

    # --- what it is made of -----------------------------------------------------------------------

    def forget_shape(self):
        """Weights, rest positions and shape keys are to be read anew."""
        self.layers, self.deformer, self.keys = [], None, None
        self.stages = stages.Stages()
        self.weights = self.rest = None
        self.mesh_address = self.keys_address = 0

    def forget_keys(self):
        """Somebody has taken them away."""
        if self.keys is not None:
            self.keys = self.deformer = None

    def read_mesh(self, mesh, is_edited):
        """mesh: evaluated, as it is before all modifiers. What has not changed is kept."""
        self.mesh_address = mesh.as_pointer()
        self._frame_before = (None, None)
        if is_edited or not self.edition:
            self.edition = self.character.data.edition = new_edition()
        self.stages.look_again()
        self._is_method_known, self._faces = False, ""
        self.read_weights(mesh)

    def read_weights(self, mesh):
        found = layers.Weights.of(mesh, deform_verts.group_names(mesh), meshes.read_weights)
        if not found.same_as(self.weights):
            shared = self.character.data.shared
            self.weights = shared.equal_to(layers.Weights, found.same_as) or shared.add(found)
            self.deformer = None

    def set_rest(self, found):
        """found (V, 3): the rest shape, of shape keys the reference."""
        if self.rest is not None and np.array_equal(found, self.rest):
            return
        shared = self.character.data.shared
        known = shared.equal_to(np.ndarray, lambda each: np.array_equal(each, found))
        self.rest = shared.add(found) if known is None else known
        self.deformer = None

    def is_read(self):
        return self.rest is not None

    def read_method(self, ob, mesh):
        """ob, mesh: evaluated."""
        if not self._is_method_known:
            self.method = methods.Method.of(ob.original.sinew, lambda: self._digest_of_faces(mesh))
            self._is_method_known = True
            if self.method.kind not in methods.PRECOMPUTED:
                self.character.data.kept = methods.Kept()

    def _digest_of_faces(self, mesh):
        self._faces = self._faces or methods.digest(*meshes.read_faces(mesh)[:2])
        return self._faces

    def poses(self, ob, modifiers, channels_of=lambda modifier: None):
        """What `deformer.deform` takes: (motions, change of space) a layer. Sees to it that layers and deformer are
        those of the modifiers as they stand. ob, modifiers: evaluated. channels_of(modifier): motions of all bones
        (B, 4, 4) that are to be used instead of the armature's, or None."""
        found = []
        for number, modifier in enumerate(modifiers):
            if number > 0 and modifier.object.mode == "EDIT":
                raise NotYet  # such a modifier does nothing, where one at rest would mix the rest shape in
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

    def _layer(self, number, ob, modifier, space):
        """The layers.Layer of that number, made if there is none that holds."""
        armature = modifier.object
        # Multi Modifier's others have the method that they say.
        method = self.method if number == 0 else methods.Method()
        settings = layers.Settings.of(modifier, self.plan.binds[number])
        made_of = (settings, method, number), *layers.edition_of_bones(armature)

        def holds(layer):
            return layer.holds(self.weights, self.rest, made_of, space)

        old = self.layers[number] if number < len(self.layers) else None
        if old is not None and holds(old):
            return old
        self._rebuilds += old is not None
        # First: of a bone for which nobody has waited Blender may have nothing to read yet.
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

    def _check_wires(self, armature, settings, were_edited):
        """Bones may have come, become B-bones, or got their first weight."""
        names = None if settings.use_envelopes else self.weights.used_names
        is_missed = not wiring.is_waiting_for(self.plan.waits_for, armature, names)
        if were_edited or is_missed:
            self.character.planning.ask_to_rewire()
        if is_missed:
            raise NotYetWired

    def check_it_pays(self):
        """What would have to be worked out anew on each frame is left to Blender from the next evaluation on."""
        depends_on_shape = any(layer.influences.depend_on_shape for layer in self.layers)
        planning = self.character.planning
        planning.moves_against_armature |= depends_on_shape and self._rebuilds > MOST_REBUILDS
        if depends_on_shape and (planning.moves_against_armature or self.keys is not None):
            planning.ask_to_rewire()

    def stage_names(self, ob):
        return stages.names(ob, self.plan.run)

    def is_of_stages_alone(self):
        return not self.layers and self.keys is None

    def rest_of_stages(self):
        """(V, 3): what stages start from that have nothing before them; else None."""
        return self.rest if self.is_of_stages_alone() else None

    def goes_through_keys(self):
        return self.plan.way.kind == ways.KEYS
