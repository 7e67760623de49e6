"""One bound mesh at run time: native objects made from the .blend, never saved in it.

The .blend holds everything; what stands here is a cache, made anew when somebody has edited mesh, weights, shape keys
or bones.
"""

import threading
from dataclasses import dataclass, field

import numpy as np

from ..binding import runs, ways, wiring
from ..blender import memory, meshes, nodes, values
from ..native import sinew_native
from . import layers, mail, methods, stages

UNKNOWN = ways.Way(ways.BLENDER)
# Modes in which people edit what they see: there Blender's own modifier shows the shape, as its tools expect.
EDITING = {"EDIT", "SCULPT"}
# Where influences depend on the shape's place (envelopes, curved B-bones) and it moves against its armature, they would
# have to be made anew on each frame. So often it may happen between two edits:
MOST_REBUILDS = 8
# Blender gives up a driver that names something that is gone. It is made anew, but not for ever if that does not help.
MOST_REVIVALS = 100


@dataclass
class Timings:
    """Milliseconds of the last frame, by stage, without what has to be made once after an edit."""

    pose: float = 0.0
    skin: float = 0.0  # with shape keys
    stages: tuple = ()  # of each modifier of the run behind

    def take(self, seconds, milliseconds):
        """seconds: of the pose; milliseconds (S + 1,): as sinew_native gives them."""
        self.pose, self.skin, self.stages = 1e3 * seconds, float(milliseconds[0]), tuple(milliseconds[1:].tolist())

    @property
    def total(self):
        return self.pose + self.skin + sum(self.stages)


class NotYetWired(Exception):
    """The hook does not wait for all that it needs: the main thread mends that and has Blender evaluate again."""


@dataclass
class Character:
    """One bound mesh."""

    key: int  # of its object
    name: tuple  # of its object, and the path of its library or None
    way: ways.Way = UNKNOWN
    is_wired: bool = False  # the file has what the way needs
    taken: tuple = ()  # names of the Armature modifiers that Sinew stands in for, in their order
    binds: tuple = ()  # of each, as wiring.binds_of has them
    shown: tuple = ()  # of each, as wiring.shown_of has them
    hook_path: str = ""  # what the hook drives
    run: runs.Run = runs.Run()  # what Sinew stands in for behind them, or without them
    own: str | None = None  # name of Sinew's modifier
    waits_for: frozenset = frozenset()  # the B-bones that the hook waits for, as wiring.bendy_bones_of has them
    error: str = ""
    layers: list = field(default_factory=list)  # of layers.Layer, as long as there are modifiers
    deformer: object = None  # sinew_native.Deformer of these layers, or None: make it anew
    keys: object = None  # shape_keys.Keys, of a mesh that has them
    shortcuts: dict = field(default_factory=dict)  # see shortcuts.py
    stages: object = field(default_factory=stages.Stages)  # of the run
    timings: Timings = field(default_factory=Timings)
    newcomers: frozenset = frozenset()  # nodes.identity of those that came since the main thread saw to the mesh
    _modifiers: frozenset | None = None  # that of all of them when the object was last looked at
    sharer_count: int | None = None  # objects that have its mesh; None: count
    moves_against_armature: bool = False  # again and again
    lock: threading.RLock = field(default_factory=threading.RLock, repr=False)
    weights: object = None  # layers.Weights
    method: methods.Method = methods.Method()
    kept: object = field(default_factory=methods.Kept, repr=False)  # what the method has precomputed
    _rest: np.ndarray | None = None  # (V, 3)
    _is_known: bool = False  # the object was looked at
    _is_method_known: bool = False
    _faces: str = ""  # methods.digest of the mesh's; "": not known
    _lacks: tuple | None = None  # the situation in which the file lacks something
    _given_up: tuple | None = None  # the one that cannot be mended
    _rebuilds: int = 0  # of layers since the last edit
    _revivals: int = 0  # of the hook
    edition: int = 0  # a number that no other edition of this mesh has had; 0: not known
    is_deforming: bool = False  # in the last pass; else Blender did
    is_copy_known: bool = False  # the deformed copy was looked at
    copy_stays: bool = False  # the shape was not to be had for it

    # --- which way it goes ------------------------------------------------------------------------

    def look(self, ob):
        """Decides the way. ob: the object, original or evaluated. What the file lacks for it is put there by the
        main thread; until then Blender's own modifier deforms."""
        original = ob.original
        taken = wiring.taken_modifiers(ob)
        self.taken = tuple(modifier.name for modifier in taken)
        self.binds = tuple(wiring.binds_of(ob, modifier) for modifier in taken)
        self.shown = tuple(wiring.shown_of(ob, modifier) for modifier in taken)
        modifiers = frozenset(map(nodes.identity, original.modifiers))
        if self._modifiers is not None:
            self.newcomers |= modifiers - self._modifiers
        self._modifiers = modifiers
        carrier = wiring.carrier_of(ob)
        self.hook_path = wiring.path_of(carrier) if carrier is not None else ""
        if self.sharer_count is None:
            self.sharer_count = meshes.count_sharers(original)
        self.way = ways.choose(ob, original.data, self.sharer_count, self.moves_against_armature)
        self.run = runs.of(ob, self.taken) if self.way.in_pass else runs.Run()
        self._is_method_known = False
        self.stages.look_again()
        own = nodes.find_modifier(ob)
        self.own = own and own.name
        self.is_wired = self.way.in_pass and self._has_what_it_needs(ob, original.data)
        self._is_known = True
        lacks = self.way.in_pass != self.is_wired or self._has_too_much(original) or self._has_displaced(original)
        self._lacks = (self.way, self.taken, values.key_of(original.data)) if lacks else None
        if lacks and self._lacks != self._given_up:
            mail.post(rewire, self.key)

    def give_up_on_what_lacks(self):
        """The main thread has done what it could: it is not to be asked again for the same."""
        self._given_up = self._lacks

    def _has_what_it_needs(self, ob, mesh):
        hook = self.hook_of(ob)
        hooked = wiring.waits_for(hook, "mesh"), wiring.waits_for(hook, "keys")
        if [each and each.original for each in hooked] != [mesh, mesh.shape_keys]:
            return False
        self.waits_for = wiring.bendy_bones_of(hook)
        if not self.waits_for_targets(ob.original):
            return False
        return self.way.kind == ways.KEYS or (
            self.own is not None
            and runs.is_in_place(ob.original, self.own, self.taken, self.run)
            and meshes.point_attribute(mesh, nodes.POSITION_ATTRIBUTE) is not None
        )

    def waits_for_targets(self, original):
        """Whether the hook, if it is where it was, waits for the armatures and for all that the run's Hook modifiers
        follow, and for nothing that is gone: modifiers, objects and bones come and go."""
        hook = self.hook_of(original)
        if hook is None:
            return True
        armatures = [(original.modifiers[name].object, "") for name in self.taken if name in original.modifiers]
        targets = (*armatures, *runs.hooks(original, self.run))
        keys = {(values.key_of(ob), bone) for ob, bone in targets if ob is not None}
        return keys <= wiring.targets_of(hook) and not wiring.has_lost_target(hook)

    def is_given_up(self, original):
        """Whether Blender has given the hook up, and it is to be made anew. (That of a mesh without vertices before 3.5
        cannot be helped.)"""
        hook = self.hook_of(original)
        if hook is None or hook.driver.is_valid or self._revivals >= MOST_REVIVALS or not original.data.vertices:
            return False
        self._revivals += 1
        return True

    def _has_too_much(self, original):
        """Whether the file has what is there for the way through an attribute alone."""
        if self.own is None or self.way.kind == ways.ATTRIBUTE:
            return False
        own = original.modifiers[self.own]
        if self.hook_path == wiring.path_of(own):
            return meshes.point_attribute(original.data, nodes.POSITION_ATTRIBUTE) is not None
        return nodes.is_removable(original, own)

    def _has_displaced(self, original):
        """Whether a modifier that has just come was put before Sinew's."""
        if self.own is None or not self.newcomers:
            return False
        before = list(original.modifiers)[: original.modifiers.find(self.own)]
        return not self.newcomers.isdisjoint(map(nodes.identity, before))

    def switch(self, ob, deforms):
        """Who deforms this evaluated object in this pass: Sinew, or Blender's own modifiers."""
        wiring.switch(ob, self.taken, self.shown, self.binds, self.run, self.own, deforms, self.way.kind == ways.KEYS)

    def hook_of(self, ob):
        """The hook of the object, or None."""
        return ob.animation_data.drivers.find(self.hook_path) if self.hook_path and ob.animation_data else None

    def is_at_work(self, ob):
        """Whether Sinew is to deform this evaluated object in this pass."""
        if not memory.take_mark(ob, "OBJECT") or not self._is_known:
            self.look(ob)
        return self.is_wired and not _stands_aside and ob.mode not in EDITING

    def look_again(self):
        """At the next evaluation, which the caller sees to."""
        self._is_known = False
        self.sharer_count = None
        self.error = ""
        self._rebuilds = 0

    def take_sharer_count(self, count):
        """How many objects have its mesh: it may go another way now."""
        if count == self.sharer_count:
            return
        self.sharer_count = count
        if self._is_known:
            self._is_known = False
            mail.post(rewire, self.key)

    # --- what it is made of -----------------------------------------------------------------------

    def forget_shape(self):
        """Weights, rest positions and shape keys are to be read anew."""
        self.layers, self.deformer, self.keys = [], None, None
        self.stages = stages.Stages()
        self.weights = self._rest = None

    def forget_keys(self):
        """Somebody has taken them away."""
        if self.keys is not None:
            self.keys = self.deformer = None

    def read_weights(self, mesh, names):
        """names: of its vertex groups. What has not changed is kept."""
        self.stages.look_again()
        self._is_method_known, self._faces = False, ""
        weights = layers.Weights.of(mesh, names, meshes.read_weights)
        if not weights.same_as(self.weights):
            self.layers, self.deformer = [], None
        self.weights = weights

    def read_method(self, ob, mesh):
        """ob, mesh: evaluated."""
        if not self._is_method_known:
            self.method = methods.Method.of(ob.original.sinew, lambda: self._digest_of_faces(mesh))
            self._is_method_known = True
            if self.method.kind not in methods.PRECOMPUTED:
                self.kept = methods.Kept()

    def _digest_of_faces(self, mesh):
        self._faces = self._faces or methods.digest(*meshes.read_faces(mesh)[:2])
        return self._faces

    def take_rest(self, rest):
        """rest (V, 3): the rest shape, of shape keys the reference."""
        if self._rest is None or not np.array_equal(rest, self._rest):
            self.layers, self.deformer = [], None
        self._rest = rest

    def is_made_with(self, deformer):
        """Whether nothing has been said since then that asks for another one."""
        return self._is_known and self.deformer is deformer and not _stands_aside

    def is_read(self):
        return self._rest is not None

    def poses(self, ob, modifiers, channels_of=lambda modifier: None):
        """What `deformer.deform` takes: (motions, change of space) a layer. Sees to it that layers and deformer are
        those of the modifiers as they stand. ob, modifiers: evaluated. channels_of(modifier): motions of all bones
        (B, 4, 4) that are to be used instead of the armature's, or None."""
        found = []
        for number, modifier in enumerate(modifiers):
            armature = modifier.object
            space = layers.space_between(ob, armature)
            settings = layers.Settings.of(modifier, self.binds[number])
            # Multi Modifier's others have the method that they say.
            method = self.method if number == 0 else methods.Method()
            made_of = (settings, method), *layers.edition_of_bones(armature)
            if number == len(self.layers):
                self.layers.append(None)
            layer = self.layers[number]
            if layer is None or not layer.holds(made_of, space):
                self._rebuilds += layer is not None
                self._check_wires(armature, layer is not None and layer.made_of != made_of)
                layer = self.layers[number] = layers.make_layer(
                    settings,
                    self.weights,
                    self._rest,
                    armature,
                    space,
                    made_of,
                    number,
                    method,
                    ob.original.sinew.skinning.data,
                    self.kept,
                )
                self.deformer = None
            channels = channels_of(modifier)
            found.append((layer.read_pose(armature) if channels is None else layer.with_channels(channels), space))
        if len(self.layers) > len(modifiers):
            del self.layers[len(modifiers) :]
            self.deformer = None
        if self.deformer is None:
            self.deformer = sinew_native.Deformer(
                [layer.native for layer in self.layers],
                self.keys and self.keys.native,
                vertex_count=len(self._rest) if self.is_of_stages_alone() else None,
            )
        return found

    def stage_names(self, ob):
        """Of the stages behind skinning: of modifiers, or stages.OWN."""
        own = (stages.OWN,) if ob.sinew.skinning.smooth_iterations > 0 else ()
        return (*own, *self.run.stages)

    def is_of_stages_alone(self):
        return not self.layers and self.keys is None

    def rest_of_stages(self):
        """(V, 3): what stages start from that have nothing before them; else None."""
        return self._rest if self.is_of_stages_alone() else None

    def _check_wires(self, armature, were_edited):
        """Bones may have come, or become B-bones."""
        is_missed = self.way.in_pass and not wiring.bendy_bones(armature) <= self.waits_for
        if were_edited or is_missed:
            mail.post(rewire, self.key)
        if is_missed:
            raise NotYetWired

    def check_it_pays(self):
        """What would have to be worked out anew on each frame is left to Blender from the next evaluation on."""
        depends_on_shape = any(layer.influences.depend_on_shape for layer in self.layers)
        self.moves_against_armature |= depends_on_shape and self._rebuilds > MOST_REBUILDS
        if depends_on_shape and (self.moves_against_armature or self.keys is not None):
            mail.post(rewire, self.key)


_stands_aside = False


class StandAside:
    """Blender's own modifiers deform all meshes in evaluations meanwhile."""

    def __enter__(self):
        global _stands_aside
        _stands_aside = True

    def __exit__(self, *_):
        global _stands_aside
        _stands_aside = False


def rewire(key):
    """Brings the .blend to what the way needs. Set by binding.bind, which knows how."""
    raise NotImplementedError
