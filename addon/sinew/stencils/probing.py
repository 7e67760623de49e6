"""Finds stencils by asking Blender.

The modifiers are evaluated on a copy of the mesh, in a scene of its own, where all vertices but a few are at 0. Each of
the few is at (1, a, b), by which it is known: a vertex of the result at (w, w a, w b) has it with the weight w. The few
are so far apart that no vertex of the result has two of them, and after one evaluation for each colour of
sinew_native.colours_apart all weights are known, to the bits that Blender has used. What was found is compared with
Blender on a shape with random positions.

Mirror and Array place copies. With all vertices at 0, one sees how far a copy is shifted; with all at (1, 1, 1), along
which axes it is mirrored. The shifts are switched off for all else, so that no digit is lost."""

from collections.abc import Callable, Generator, Sequence
from time import perf_counter
from typing import Any

import bpy
import numpy as np

from ..blender import bounds, meshes, modifier_types, modifiers, values
from ..native import sinew_native
from ..plan import tails

TOLERANCE = 2e-6  # of the diagonal
ROUNDING = 2.0**-22  # of a number far away, such as that of an Array's last copy
MOST_ROWS = 1_500_000  # vertices of the result
LEAST = 1e-6  # a smaller weight need not be known
NEAR, FAR = 2, 4  # how far apart vertices have to be, in steps; more are tried if that is not enough
BASE = 1024  # of the two digits by which a vertex is known: float32 holds w times each of them well enough
NAME = ".Sinew Stencils"


class NotFound(Exception):
    """There are no stencils, or it would take too long to find them. The message says why, a clause."""


class TooLong(NotFound):
    """It would take too long."""


class Canvas:
    """Copies of the modifiers of a tail on a mesh, in a scene of its own."""

    def __init__(
        self,
        ob: bpy.types.Object,
        tail: Sequence[bpy.types.Modifier],
        render: bpy.types.RenderSettings,
        mesh_of: Callable[[], bpy.types.Mesh],
        is_render: bool = False,
    ) -> None:
        """ob: original; render: of its scene; mesh_of: makes a copy of the mesh before the tail; is_render: as renders
        evaluate it, not as viewports do."""
        self._ob, self._tail, self._render, self._mesh_of, self._is_render = ob, tail, render, mesh_of, is_render
        self.needs_quads = tails.needs_quads(tail)
        self.places_copies = any(modifier.type in modifier_types.PLACING for modifier in tail)
        self._made: tuple[Any, ...] = ()  # scene, object, mesh
        self.seconds = 0.0  # of all results

    def __enter__(self) -> "Canvas":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def mesh(self) -> bpy.types.Mesh:
        self._open()
        return self._made[2]

    def _open(self) -> None:
        if self._made and all(map(values.is_alive, self._made)):
            return
        self.close()
        mesh = self._mesh_of()
        mesh.name = NAME
        scene, copy = bpy.data.scenes.new(NAME), bpy.data.objects.new(NAME, mesh)
        meshes.clear_keys(copy)
        self._made = scene, copy, mesh
        for group in self._ob.vertex_groups:
            if group.name not in copy.vertex_groups:
                copy.vertex_groups.new(name=group.name)
        _strip(copy, any(modifier.type == "MASK" for modifier in self._tail))
        for modifier in self._tail:
            own = modifiers.copy(modifier, copy)
            own.show_viewport = True
            if self._is_render and own.type == "SUBSURF":
                own.levels = own.render_levels
        name = "simplify_subdivision_render" if self._is_render else "simplify_subdivision"
        scene.render.use_simplify, scene.render.simplify_subdivision = (
            self._render.use_simplify,
            getattr(self._render, name),
        )
        scene.frame_current = bpy.context.scene.frame_current
        scene.collection.objects.link(copy)

    def close(self) -> None:
        """Removes what it has made. The next result makes it again."""
        made, self._made = self._made, ()
        for block, remove in zip(made, (_remove_scene, bpy.data.objects.remove, bpy.data.meshes.remove)):
            if values.is_alive(block):
                remove(block)

    def result(self, positions: np.ndarray, is_shifted: bool = True) -> np.ndarray:
        """Returns the vertices (R, 3) that the modifiers make of these (V, 3). is_shifted: with Arrays' offsets."""
        begin = perf_counter()
        self._open()
        scene, copy, mesh = self._made
        for modifier, own in zip(self._tail, copy.modifiers):
            if own.type == "ARRAY":
                own.constant_offset_displace = modifier.constant_offset_displace if is_shifted else (0, 0, 0)
        layer = scene.view_layers[0]
        meshes.write_positions(mesh, positions)
        layer.update()
        found = meshes.read_evaluated(copy.evaluated_get(layer.depsgraph)).copy()
        self.seconds += perf_counter() - begin
        return found


def _remove_scene(scene: bpy.types.Scene) -> None:
    """Removes a canvas's scene. If the user has deleted all others meanwhile, it stays, as one of theirs."""
    if any(each.library is None for each in bpy.data.scenes if each != scene):
        bpy.data.scenes.remove(scene)
    else:
        scene.name = "Scene"


def remove_leftovers() -> None:
    """Removes what an undo step, or a file that was saved by itself, has kept of canvases."""
    for scene in [each for each in bpy.data.scenes if each.name.startswith(NAME)]:
        found = [(ob, ob.data) for ob in scene.collection.objects]
        _remove_scene(scene)
        for ob, mesh in found:
            bpy.data.objects.remove(ob)
            bpy.data.meshes.remove(mesh)


def _strip(copy: bpy.types.Object, keeps_groups: bool) -> None:
    """Removes what positions do not depend on."""
    mesh: Any = copy.data
    if not keeps_groups:
        copy.vertex_groups.clear()  # with the weights
    while mesh.uv_layers:  # to remove one moves the others
        mesh.uv_layers.remove(mesh.uv_layers[0])
    names = [each.name for each in mesh.attributes if not (each.is_internal or getattr(each, "is_required", False))]
    for name in names:
        if name not in {"position", *tails.READ}:  # without the others Blender is faster
            mesh.attributes.remove(mesh.attributes[name])


def steps(
    made: Canvas, what: str, most: int, most_seconds: float = float("inf")
) -> Generator[tuple[float, str], None, Any]:
    """Finds the stencils of a canvas: a generator like that of bake/baking.py, which returns a sinew_native.Stencils.
    what: it is that of, for its sentences; most: how many evaluations it may take, and how long all of them may take.
    Raises NotFound."""
    rest = meshes.read_positions(made.mesh).copy()
    edges, offsets, corners = meshes.read_topology(made.mesh)
    if len(rest) == 0 or not np.isfinite(rest).all():
        raise NotFound("its vertices are not all at finite positions" if len(rest) else "it has no vertices")
    if made.needs_quads and np.diff(offsets).max(initial=0) > 4:
        raise NotFound("Triangulate cuts faces with more than four corners by their shape")
    placings = _placings(made, len(rest)) if made.places_copies else (None, None)
    for apart in range(NEAR, FAR + 1):
        colours = sinew_native.colours_apart(len(rest), edges, offsets, corners, apart, max(most, 1))
        if colours is None:
            raise TooLong("it would take longer to find its weights than to do without")
        found = yield from _ask(made, what, colours, most_seconds, placings[0])
        if found is not None:
            break
    else:
        raise NotFound("its vertices depend on too many of those before them")
    rows, vertices, weights, count = found
    stencils = _assembled(rows, vertices, weights, count, len(rest), *placings)
    shape = np.random.default_rng(0).uniform(-1, 1, rest.shape).astype(np.float32)
    compare(stencils, shape, made.result(shape))
    return stencils


def _placings(made: Canvas, vertex_count: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns by what the vertices of the result are multiplied, and how far they are shifted then, (R, 3) each."""
    nowhere = np.zeros((vertex_count, 3), np.float32)
    shifts, scales = made.result(nowhere), made.result(nowhere + 1, is_shifted=False)
    if shifts.shape != scales.shape:
        raise NotFound("it has another number of vertices in another shape")
    return np.sign(scales), shifts


def _ask(
    made: Canvas, what: str, colours: np.ndarray, most_seconds: float, scales: np.ndarray | None
) -> Generator[tuple[float, str], None, tuple[np.ndarray, np.ndarray, np.ndarray, int] | None]:
    """Returns (rows, vertices, weights, R), or None if two vertices of a colour have met."""
    rows, vertices, weights, count, made.seconds = [], [], [], 0, 0.0
    codes = np.arange(1, len(colours) + 1)
    digits = np.stack((np.ones(len(codes)), codes % BASE, codes // BASE), axis=1).astype(np.float32)
    last = int(colours.max())
    for colour in range(last + 1):
        yield 0.0, f"finding the weights of {what}: {colour / (last + 1):.0%}"
        result = made.result(np.where((colours == colour)[:, None], digits, np.float32(0)), is_shifted=False)
        if made.seconds * (last + 1) > most_seconds * (colour + 1) and colour >= min(2, last):
            raise TooLong(
                f"it would take about {made.seconds * (last + 1) / (colour + 1):.0f} seconds to find its weights"
            )
        if len(result) > MOST_ROWS:
            raise NotFound(f"it has more than {MOST_ROWS:,} vertices")
        if colour and len(result) != count:
            raise NotFound("it has another number of vertices in another shape")
        count = len(result)
        if scales is not None:
            if len(scales) != count:
                raise NotFound("it has another number of vertices in another shape")
            result *= scales  # which are 1 or -1
        own = np.flatnonzero(result[:, 0])
        weight = result[own, 0].astype(np.float64)
        low, high = result[own, 1] / weight, result[own, 2] / weight
        vertex = (np.rint(high) * BASE + np.rint(low) - 1).astype(np.int64)
        is_near = np.maximum(np.abs(low - np.rint(low)), np.abs(high - np.rint(high))) < 0.1
        is_there = (vertex >= 0) & (vertex < len(colours)) & is_near
        is_known = is_there & (colours[np.where(is_there, vertex, 0)] == colour)
        if not (is_known | (np.abs(weight) < LEAST)).all():
            return None
        rows.append(own[is_known].astype(np.int32))
        vertices.append(vertex[is_known].astype(np.int32))
        weights.append(weight[is_known].astype(np.float32))
    return np.concatenate(rows), np.concatenate(vertices), np.concatenate(weights), count


def _assembled(
    rows: np.ndarray,
    vertices: np.ndarray,
    weights: np.ndarray,
    count: int,
    vertex_count: int,
    scales: np.ndarray | None = None,
    shifts: np.ndarray | None = None,
) -> Any:
    order = np.argsort(rows.astype(np.int64) * vertex_count + vertices)
    offsets = np.concatenate(([0], np.cumsum(np.bincount(rows, minlength=count))))
    sums = np.bincount(rows, weights, minlength=count)
    if not (np.abs(sums - 1) < 1e-5).all():
        raise NotFound("its vertices are no means of those before them")
    return sinew_native.Stencils(offsets, vertices[order], weights[order], vertex_count, scales, shifts)


def compare(stencils: Any, positions: np.ndarray, expected: np.ndarray) -> None:
    """Raises NotFound if stencils make other vertices (R, 3) than Blender of positions (V, 3)."""
    if len(expected) != stencils.count:
        raise NotFound("it has another number of vertices in another shape")
    off = np.abs(stencils.apply(positions) - expected).max(initial=0)
    size = bounds.diagonal(positions)
    if not off <= TOLERANCE * size + ROUNDING * np.abs(expected).max(initial=0):
        raise NotFound(f"it was off by {off / (size or 1):.1e} of its size in a shape with which it was compared")
