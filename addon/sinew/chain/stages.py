"""The stages after skinning, made from the modifiers of the run, except for Armature modifiers: see mixes.py.

The native object of a stage is made once, and again when the data it was made from changes. The settings that may be
animated are read on every frame from the evaluated modifier.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..blender import meshes, values
from ..host import mesh_arrays
from ..native import sinew_native
from . import cage_stages, living
from .leaving import LeaveToBlender

# Blender 4.1 weights corners by a polynomial instead of the arc cosine, and no longer ignores negative factors.
BEFORE_4_1 = values.VERSION < (4, 1, 0)
CORNER_ANGLE = "arc_cosine" if BEFORE_4_1 else "polynomial"


@dataclass(frozen=True)
class Source:
    """The data from which stages are made, besides their modifiers."""

    mesh: Any  # evaluated, before all modifiers
    positions: np.ndarray  # (V, 3), of that mesh
    weights: Any  # layers.Weights

    def group(self, modifier: Any) -> np.ndarray | None:
        """Returns the weights of the modifier's vertex group, (V,), or None."""
        if not meshes.has_weights(self.mesh):
            return None
        return self.weights.of_group(modifier.vertex_group)


# Each kind of stage has SETTINGS, the names of the settings from which its native object is made, and three functions:
# arrays returns the arrays from which it is made, make makes it, and stage returns the sinew_native.Stage of a frame.


class CorrectiveSmooth:
    SETTINGS = "vertex_group", "invert_vertex_group", "use_pin_boundary", "rest_source", "use_only_smooth"

    @staticmethod
    def arrays(modifier: Any, source: Source) -> tuple[np.ndarray | None, ...]:
        rest: np.ndarray | None = source.positions
        if modifier.use_only_smooth:
            rest = None
        elif modifier.rest_source == "BIND":
            rest = mesh_arrays.bound_positions(modifier)
            if rest is None or len(rest) != len(source.positions):
                raise LeaveToBlender("keyframes or a driver have set another rest source, for which it is not bound")
        return source.group(modifier), rest

    @staticmethod
    def make(modifier: Any, topology: Any, weights: np.ndarray | None, rest: np.ndarray | None) -> Any:
        return sinew_native.CorrectiveSmooth(
            topology, rest, weights, modifier.invert_vertex_group, modifier.use_pin_boundary, CORNER_ANGLE
        )

    @staticmethod
    def stage(native: Any, _ob: Any, modifier: Any) -> Any:
        return native.stage(
            modifier.factor, modifier.iterations, modifier.scale, modifier.smooth_type.lower(), modifier.use_only_smooth
        )


class Smooth:
    SETTINGS = "vertex_group", "invert_vertex_group"

    @staticmethod
    def arrays(modifier: Any, source: Source) -> tuple[np.ndarray | None, ...]:
        return (source.group(modifier),)

    @staticmethod
    def make(modifier: Any, topology: Any, weights: np.ndarray | None) -> Any:
        return sinew_native.Smooth(topology, weights, modifier.invert_vertex_group)

    @staticmethod
    def stage(native: Any, _ob: Any, modifier: Any) -> Any:
        does_nothing = BEFORE_4_1 and modifier.vertex_group and modifier.factor < 0
        return native.stage(
            modifier.factor, 0 if does_nothing else modifier.iterations, modifier.use_x, modifier.use_y, modifier.use_z
        )


class Hook:
    SETTINGS = "vertex_group", "invert_vertex_group"

    @staticmethod
    def arrays(modifier: Any, source: Source) -> tuple[np.ndarray | None, ...]:
        indices = np.array(modifier.vertex_indices, np.int32)
        if len(indices) == 0:
            return source.group(modifier), None
        return source.group(modifier), indices[indices < len(source.positions)]  # without deleted vertices

    @staticmethod
    def make(modifier: Any, topology: Any, weights: np.ndarray | None, indices: np.ndarray | None) -> Any:
        return sinew_native.Hook(topology.vertex_count, indices, weights, modifier.invert_vertex_group)

    @staticmethod
    def stage(native: Any, ob: Any, modifier: Any) -> Any:
        values.refuse_flat(ob)
        target = modifier.object
        place = target.matrix_world
        if target.type == "ARMATURE" and modifier.subtarget in target.pose.bones:
            place = place @ target.pose.bones[modifier.subtarget].matrix
        back = np.linalg.pinv(values.matrix_to_numpy(ob.matrix_world))
        inverse = values.matrix_to_numpy(modifier.matrix_inverse)
        matrix = back @ values.matrix_to_numpy(place) @ inverse
        if not np.isfinite(matrix).all():
            raise values.Flat(f"{target.name} is at a place that is not a number")
        return native.stage(
            matrix,
            modifier.strength,
            modifier.falloff_type.lower(),
            modifier.falloff_radius,
            tuple(modifier.center),
            inverse[:3, :3] if modifier.use_falloff_uniform else None,
        )


OWN = ""  # used instead of a modifier's name for the smoothing in the mesh's own settings


class OwnSmoothing:
    """Presents the smoothing settings of `object.sinew.skinning` as a Corrective Smooth modifier."""

    type, name = "CORRECTIVE_SMOOTH", OWN
    scale, smooth_type, rest_source = 1.0, "SIMPLE", "ORCO"
    use_pin_boundary = use_only_smooth = False

    def __init__(self, skinning: Any) -> None:
        self.factor, self.iterations = skinning.smooth_factor, skinning.smooth_iterations
        self.vertex_group, self.invert_vertex_group = skinning.smooth_group, skinning.smooth_invert


def names(ob: Any, run: Any, shown: Collection[str] | None = None) -> tuple[str, ...]:
    """Returns the names of the stages after skinning: OWN or names of modifiers; of a mix, that of its first. run:
    runs.Run; shown: names of the modifiers that are switched on, None for all."""
    own = (OWN,) if ob.sinew.skinning.smooth_iterations > 0 else ()
    on = run.stages if shown is None else [name for name in run.stages if name in shown]
    mixed_in = {name for mix in run.mixes for name in [each for each in mix if each in on][1:]}
    return (*own, *(name for name in on if name not in mixed_in))


def modifier_of(ob: Any, name: str) -> Any:
    """Returns the modifier of an evaluated object that a stage replaces, or an OwnSmoothing."""
    return OwnSmoothing(ob.sinew.skinning) if name == OWN else ob.modifiers[name]


# By type of modifier, for the types in modifier_types.STAGES except ARMATURE.
KINDS: dict[str, Any] = {"CORRECTIVE_SMOOTH": CorrectiveSmooth, "SMOOTH": Smooth, "HOOK": Hook, **cage_stages.KINDS}


@dataclass
class _Made:
    settings: tuple
    arrays: tuple
    native: Any


@dataclass
class Stages:
    """The stages of one mesh."""

    _made: dict[str, _Made] = field(default_factory=dict)  # by the name of the modifier
    _topology: Any = None  # sinew_native.Topology
    _connections: tuple = ()  # the arrays from which the topology was made
    _is_fresh: bool = True  # something may have been edited

    def look_again(self) -> None:
        """Has the next frame check what the stages are made from, after an edit."""
        self._is_fresh = True

    def at(
        self, ob: Any, names: Sequence[str], source: Any, ready: Mapping[str, Any], driven: Callable[[Any], Any]
    ) -> list:
        """Returns the stages of an evaluated object in this frame, a list of sinew_native.Stage. source: function that
        returns a Source; may be None if nothing has changed since the last call; ready: {name: stage} of those that
        are made elsewhere; driven(modifier): returns the modifier with the values of its driven settings."""
        wanted = [name for name in names if name not in ready]
        if self._is_fresh and wanted:
            self._renew(ob, wanted, source(), driven)
        found = []
        for name in names:
            stage = ready.get(name) or self.again(ob, name, driven)
            if stage is None:  # settings changed by keyframes or drivers, or it has just been switched on
                modifier = driven(modifier_of(ob, name))
                kind = KINDS[modifier.type]
                made = self._make(kind, modifier, _settings(kind, modifier), kind.arrays(modifier, source()))
                self._made[name] = made
                stage = kind.stage(made.native, ob, modifier)
            found.append(stage)
        return found

    def again(self, ob: Any, name: str, driven: Callable[[Any], Any]) -> Any:
        """Returns one of the stages in this frame, a sinew_native.Stage, or None if what it is made from has other
        settings now. driven: see at."""
        modifier = driven(modifier_of(ob, name))
        kind, made = KINDS[modifier.type], self._made.get(name)
        if made is None or _settings(kind, modifier) != made.settings:
            return None
        return kind.stage(made.native, ob, modifier)

    def native_of(self, name: str) -> Any:
        """Returns the native object of a stage, or None."""
        made = self._made.get(name)
        return made and made.native

    def _renew(self, ob: Any, names: Sequence[str], source: Source, driven: Callable[[Any], Any]) -> None:
        connections = meshes.read_topology(source.mesh)
        count = len(source.positions)  # which a loose vertex changes, but none of the connections
        is_same = self._topology is not None and self._topology.vertex_count == count
        if not is_same or not _same(connections, self._connections):
            self._topology = sinew_native.Topology(count, *connections)
            self._connections, self._made = connections, {}
        old, self._made = self._made, {}
        for name in names:
            modifier = driven(modifier_of(ob, name))
            kind = KINDS[modifier.type]
            settings, arrays = _settings(kind, modifier), kind.arrays(modifier, source)
            made = old.get(name)
            if made is None or made.settings != settings or not _same(made.arrays, arrays):
                made = self._make(kind, modifier, settings, arrays)
            self._made[name] = made
        self._is_fresh = False

    def _make(self, kind: Any, modifier: Any, settings: tuple, arrays: tuple) -> _Made:
        return _Made(settings, arrays, living.note(kind.make(modifier, self._topology, *arrays)))


def _settings(kind: Any, modifier: Any) -> tuple:
    return kind, *(getattr(modifier, name) for name in kind.SETTINGS)


def _same(ours: Sequence[Any], theirs: Sequence[Any]) -> bool:
    return len(ours) == len(theirs) and all(
        (a is None) == (b is None) and (a is None or np.array_equal(a, b)) for a, b in zip(ours, theirs)
    )
