"""What comes after skinning: native stages, made from the modifiers of the run.

Each is made once, and again when that has changed of which it is made; the settings of a frame are read on that frame,
from the evaluated modifier.
"""

from dataclasses import dataclass, field

import numpy as np

from ..blender import meshes, values
from ..host import deform_verts, vector_arrays
from ..native import sinew_native

# Blender 4.1 weights corners by a polynomial in place of the arc cosine, and no longer ignores negative factors.
BEFORE_4_1 = values.VERSION < (4, 1, 0)
CORNER_ANGLE = "arc_cosine" if BEFORE_4_1 else "polynomial"


@dataclass(frozen=True)
class Source:
    """What stages are made from, besides their modifiers."""

    mesh: object  # evaluated, as it is before all modifiers
    positions: np.ndarray  # (V, 3), its own
    weights: object  # layers.Weights

    def group(self, modifier):
        """(V,) weights of the modifier's vertex group, or None."""
        if deform_verts.deform_vertices(self.mesh) == 0:  # not even empty ones
            return None
        return self.weights.of_group(modifier.vertex_group)


class CorrectiveSmooth:
    SETTINGS = "vertex_group", "invert_vertex_group", "use_pin_boundary", "rest_source", "use_only_smooth"

    @staticmethod
    def arrays(modifier, source):
        rest = source.positions
        if modifier.use_only_smooth:
            rest = None
        elif modifier.rest_source == "BIND":
            rest = vector_arrays.bound_positions(modifier)
        return source.group(modifier), rest

    @staticmethod
    def make(modifier, topology, weights, rest):
        return sinew_native.CorrectiveSmooth(
            topology, rest, weights, modifier.invert_vertex_group, modifier.use_pin_boundary, CORNER_ANGLE
        )

    @staticmethod
    def stage(native, _ob, modifier):
        return native.stage(
            modifier.factor, modifier.iterations, modifier.scale, modifier.smooth_type.lower(), modifier.use_only_smooth
        )


class Smooth:
    SETTINGS = "vertex_group", "invert_vertex_group"

    @staticmethod
    def arrays(modifier, source):
        return (source.group(modifier),)

    @staticmethod
    def make(modifier, topology, weights):
        return sinew_native.Smooth(topology, weights, modifier.invert_vertex_group)

    @staticmethod
    def stage(native, _ob, modifier):
        does_nothing = BEFORE_4_1 and modifier.vertex_group and modifier.factor < 0
        return native.stage(
            modifier.factor, 0 if does_nothing else modifier.iterations, modifier.use_x, modifier.use_y, modifier.use_z
        )


class Hook:
    SETTINGS = "vertex_group", "invert_vertex_group"

    @staticmethod
    def arrays(modifier, source):
        indices = np.array(modifier.vertex_indices, np.int32)
        if len(indices) == 0:
            return source.group(modifier), None
        return source.group(modifier), indices[indices < len(source.positions)]  # those of vertices that are gone

    @staticmethod
    def make(modifier, topology, weights, indices):
        return sinew_native.Hook(topology.vertex_count, indices, weights, modifier.invert_vertex_group)

    @staticmethod
    def stage(native, ob, modifier):
        values.refuse_flat(ob)
        target = modifier.object
        place = target.matrix_world
        if target.type == "ARMATURE" and modifier.subtarget in target.pose.bones:
            place = place @ target.pose.bones[modifier.subtarget].matrix
        back = np.linalg.pinv(values.matrix_to_numpy(ob.matrix_world))
        inverse = values.matrix_to_numpy(modifier.matrix_inverse)
        return native.stage(
            back @ values.matrix_to_numpy(place) @ inverse,
            modifier.strength,
            modifier.falloff_type.lower(),
            modifier.falloff_radius,
            tuple(modifier.center),
            inverse[:3, :3] if modifier.use_falloff_uniform else None,
        )


OWN = ""  # in place of a modifier's name: the smoothing that the mesh's own settings ask for


class OwnSmoothing:
    """`object.sinew.skinning` as a Corrective Smooth modifier would say it."""

    type = "CORRECTIVE_SMOOTH"
    scale, smooth_type, rest_source = 1.0, "SIMPLE", "ORCO"
    use_pin_boundary = use_only_smooth = False

    def __init__(self, skinning):
        self.factor, self.iterations = skinning.smooth_factor, skinning.smooth_iterations
        self.vertex_group, self.invert_vertex_group = skinning.smooth_group, skinning.smooth_invert


def names(ob, run):
    """Of the stages behind skinning: of modifiers, or OWN. run: runs.Run."""
    own = (OWN,) if ob.sinew.skinning.smooth_iterations > 0 else ()
    return (*own, *run.stages)


def modifier_of(ob, name):
    """The modifier of an evaluated object that a stage stands in for, or what takes its place."""
    return OwnSmoothing(ob.sinew.skinning) if name == OWN else ob.modifiers[name]


KINDS = {"CORRECTIVE_SMOOTH": CorrectiveSmooth, "SMOOTH": Smooth, "HOOK": Hook}  # those of modifier_types.STAGES


@dataclass
class _Made:
    settings: tuple
    arrays: tuple
    native: object


@dataclass
class Stages:
    """Those of one mesh."""

    _made: dict = field(default_factory=dict)  # name of a modifier -> _Made
    _topology: object = None
    _connections: tuple = ()  # what the topology was made of
    _is_fresh: bool = True  # something may have been edited

    def look_again(self):
        self._is_fresh = True

    def at(self, ob, names, source):
        """[sinew_native.Stage] of an evaluated object in this frame. source: function that gives a Source."""
        if self._is_fresh and names:
            self._renew(ob, names, source())
        found = []
        for name in names:
            modifier = modifier_of(ob, name)
            kind, made = KINDS[modifier.type], self._made[name]
            settings = _settings(kind, modifier)
            if settings != made.settings:  # by keyframes
                made = self._make(kind, modifier, settings, kind.arrays(modifier, source()))
                self._made[name] = made
            found.append(kind.stage(made.native, ob, modifier))
        return found

    def _renew(self, ob, names, source):
        connections = meshes.read_topology(source.mesh)
        if self._topology is None or not _same(connections, self._connections):
            self._topology = sinew_native.Topology(len(source.positions), *connections)
            self._connections, self._made = connections, {}
        old, self._made = self._made, {}
        for name in names:
            modifier = modifier_of(ob, name)
            kind = KINDS[modifier.type]
            settings, arrays = _settings(kind, modifier), kind.arrays(modifier, source)
            made = old.get(name)
            if made is None or made.settings != settings or not _same(made.arrays, arrays):
                made = self._make(kind, modifier, settings, arrays)
            self._made[name] = made
        self._is_fresh = False

    def _make(self, kind, modifier, settings, arrays):
        return _Made(settings, arrays, kind.make(modifier, self._topology, *arrays))


def _settings(kind, modifier):
    return kind, *(getattr(modifier, name) for name in kind.SETTINGS)


def _same(ours, theirs):
    return len(ours) == len(theirs) and all(
        (a is None) == (b is None) and (a is None or np.array_equal(a, b)) for a, b in zip(ours, theirs)
    )
