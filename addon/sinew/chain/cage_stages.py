"""The stages that move a mesh with the shape of another object, as in stages.py.

The shape is read on each frame from the object's evaluated copy. The hook waits for it (wiring.SHAPES).
"""

from typing import Any

import numpy as np

from ..blender import meshes, values
from ..host import cage_memory, contract, features
from ..native import sinew_native
from . import layers
from .leaving import LeaveToBlender


class Lattice:
    SETTINGS = "vertex_group", "invert_vertex_group"

    @staticmethod
    def arrays(modifier: Any, source: Any) -> tuple[np.ndarray | None, ...]:
        return (source.group(modifier),)

    @staticmethod
    def make(modifier: Any, topology: Any, weights: np.ndarray | None) -> Any:
        return sinew_native.Lattice(topology.vertex_count, weights, modifier.invert_vertex_group)

    @staticmethod
    def stage(native: Any, ob: Any, modifier: Any) -> Any:
        target = _readable(modifier.object)
        lattice = target.data
        points = np.empty(3 * len(lattice.points), np.float32)
        lattice.points.foreach_get("co_deform", points)
        _check_finite(target, points)
        return native.stage(
            points.reshape(-1, 3),
            (lattice.points_u, lattice.points_v, lattice.points_w),
            *cage_memory.rest_grid(lattice),
            tuple(getattr(lattice, f"interpolation_type_{axis}").removeprefix("KEY_").lower() for axis in "uvw"),
            _relative_matrix(target, ob),
            modifier.strength,
            _point_weights(lattice),
        )


class SurfaceDeform:
    SETTINGS = "vertex_group", "invert_vertex_group"

    @staticmethod
    def arrays(modifier: Any, source: Any) -> tuple[np.ndarray | None, ...]:
        counts = cage_memory.surface_counts(modifier)
        if counts is None or counts.mesh != len(source.positions):
            raise LeaveToBlender("it has just been bound, or the mesh edited")
        return source.group(modifier), *cage_memory.read_surface(modifier)

    @staticmethod
    def make(modifier: Any, topology: Any, weights: np.ndarray | None, *binding: np.ndarray) -> Any:
        return sinew_native.SurfaceDeform(topology.vertex_count, *binding, weights, modifier.invert_vertex_group)

    @staticmethod
    def stage(native: Any, _ob: Any, modifier: Any) -> Any:
        target = _readable(modifier.target)
        positions = meshes.read_positions(target.data)
        counts = cage_memory.surface_counts(modifier)
        # Blender follows a target that has more vertices than before, but none that has fewer.
        if counts is None or len(positions) < max(counts.target, native.least_target_count):
            raise LeaveToBlender(f"{target.name} has fewer vertices than when it was bound")
        return native.stage(positions, cage_memory.surface_matrix(modifier), modifier.strength)


class MeshDeform:
    SETTINGS = "vertex_group", "invert_vertex_group"

    @staticmethod
    def arrays(modifier: Any, source: Any) -> tuple[np.ndarray | None, ...]:
        counts = cage_memory.mesh_counts(modifier)
        if counts is None or counts.mesh != len(source.positions) or modifier.use_dynamic_bind:
            raise LeaveToBlender("it has just been bound, or the mesh edited")
        return source.group(modifier), *cage_memory.read_mesh(modifier)

    @staticmethod
    def make(modifier: Any, _topology: Any, weights: np.ndarray | None, *binding: np.ndarray) -> Any:
        return sinew_native.MeshDeform(*binding, weights, modifier.invert_vertex_group)

    @staticmethod
    def stage(native: Any, ob: Any, modifier: Any) -> Any:
        target = _readable(modifier.object)
        positions = meshes.read_positions(target.data)
        if len(positions) != native.cage_vertex_count:
            raise LeaveToBlender(f"{target.name} has other vertices than when it was bound")
        bound_from_cage = cage_memory.mesh_matrix(modifier)
        bound_from_mesh = bound_from_cage.astype(np.float64) @ _relative_matrix(target, ob)
        if np.linalg.det(bound_from_mesh) == 0:
            raise LeaveToBlender(f"{target.name} has a scale of 0 along an axis")
        return native.stage(positions, bound_from_cage, np.linalg.inv(bound_from_mesh)[:3, :3])


def was_unbound_late(modifier: Any) -> bool:
    """Whether a modifier of an evaluated object has been unbound, but this copy still has its binding. Blender frees a
    Surface Deform's when it next evaluates the modifier, which is during the operator unless Sinew replaces it. With
    the old binding in the evaluated copy, binding it again would go wrong."""
    if modifier.type != "SURFACE_DEFORM" or not contract.has(features.SURFACE):
        return False
    return modifier.is_bound and cage_memory.surface_counts(modifier) is None


def _point_weights(lattice: Any) -> np.ndarray | None:
    """Returns the weights in the vertex group of a lattice, (P,), or None."""
    if not lattice.vertex_group:
        return None
    found = cage_memory.read_weights(lattice)
    return found and layers.Weights(*found, cage_memory.group_names(lattice)).of_group(lattice.vertex_group)


def _readable(target: Any) -> Any:
    """Returns the evaluated object itself. Raises LeaveToBlender if Blender's modifier follows another shape than
    that of its data: in Edit Mode, what is being edited."""
    if target is None or target.original.data.is_editmode:
        raise LeaveToBlender("the object that the mesh follows is in Edit Mode")
    return target


def _relative_matrix(target: Any, ob: Any) -> np.ndarray:
    """Returns the matrix (4, 4) from the object's space to the target's. Raises values.Flat."""
    matrix = values.relative_matrix(target, ob)
    _check_finite(target, matrix)
    return matrix


def _check_finite(target: Any, numbers: np.ndarray) -> None:
    """Raises values.Flat for numbers that are not finite."""
    if not np.isfinite(numbers).all():
        raise values.Flat(f"{target.name} has a point or a place that is not a number")


# By type of modifier, for the types in modifier_types.CAGES.
KINDS: dict[str, Any] = {"LATTICE": Lattice, "MESH_DEFORM": MeshDeform, "SURFACE_DEFORM": SurfaceDeform}
