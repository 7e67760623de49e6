"""How weights deform a mesh in test poses, in each of which one bone is bent. Independent of Blender."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..blender import bounds
from . import reports
from .entries import Entries

ANGLE = 60.0  # degrees
STRETCHED = 2.5  # an edge that becomes this many times as long is stretched
_BENT = 0.01  # a vertex with a smaller share in the bone and those below it, or in all others, moves as if it had none
_SMALLEST = 1e-6  # of the mesh's size: shorter edges have no length to compare


@dataclass(frozen=True)
class TestPose:
    """What one bone does when it is bent about its own X or Z axis, whichever is worse."""

    bone: int
    axis: str  # "X" or "Z"
    stretch: float  # the largest of (new length / length at rest) of all edges
    squash: float  # the smallest
    # The volume between the bone's head and the faces that bend, as a share of that at rest; NaN: that is none.
    volume: float
    stretched: np.ndarray = field(repr=False)  # vertices of the edges that are stretched, ascending

    def document(self, names: Sequence[str]) -> dict[str, Any]:
        """Returns the numbers, for JSON. names: of all bones."""
        volume = None if np.isnan(self.volume) else self.volume
        own = {"bone": names[self.bone], "volume": volume, "stretched_vertices": len(self.stretched)}
        return {**reports.document(self, stretched=""), **own}


@dataclass(frozen=True)
class Bones:
    """Bones at rest, in the space of the mesh."""

    parents: np.ndarray  # (B,) int: the bone that carries each, -1 for none; in any order
    heads: np.ndarray  # (B, 3)
    axes: np.ndarray  # (B, 3, 3): the bones' own X, Y, Z axes, as rows of length 1

    @cached_property
    def spans(self) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of the bones, (B,), in an order in which those below a bone follow it, and for each bone the number
        behind the last of those."""
        children: list[list[int]] = [[] for _ in self.parents]
        for bone, parent in enumerate(self.parents.tolist()):
            if parent >= 0:
                children[parent].append(bone)
        order, left = [], np.flatnonzero(self.parents < 0).tolist()
        while left:
            order.append(left.pop())
            left += children[order[-1]]
        sizes = np.ones(len(order), int)
        for bone in reversed(order):
            if self.parents[bone] >= 0:
                sizes[self.parents[bone]] += sizes[bone]
        first = np.argsort(order).astype(np.int32)
        return first, (first + sizes).astype(np.int32)


@dataclass(frozen=True)
class Mesh:
    """A mesh at rest."""

    positions: np.ndarray  # (V, 3)
    edges: np.ndarray  # (E, 2) int
    triangles: np.ndarray  # (T, 3) int
    weights: Entries  # above 0, in the vertices' order; those of a vertex sum to 1, or to 0

    @cached_property
    def offsets(self) -> np.ndarray:
        """(V + 1,): where the weights of each vertex begin."""
        return self.weights.offsets(len(self.positions))


def shares(mesh: Mesh, bones: Bones, bone: int, vertices: np.ndarray | None = None) -> np.ndarray:
    """Returns how much of each vertex, or of each of some (P,), moves with a bone. Those without weights do not."""
    own, count = mesh.weights, len(mesh.positions)
    if vertices is not None:
        own, count = own.at(vertices, mesh.offsets), len(vertices)
    first, last = bones.spans
    return own.where((first[own.bones] >= first[bone]) & (first[own.bones] < last[bone])).sums(count)


def rotation(axis: np.ndarray, degrees: float) -> np.ndarray:
    """Returns the matrix (3, 3) of a rotation about an axis of length 1."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.radians(degrees)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def bent(points: np.ndarray, share: np.ndarray, head: np.ndarray, axis: np.ndarray, degrees: float) -> np.ndarray:
    """Returns points (N, 3), with the share (N,) that moves, after a bend about the head: linear skinning."""
    turned = (points - head) @ rotation(axis, degrees).T + head
    return points + share[:, None] * (turned - points)


def check(
    mesh: Mesh, bones: Bones, degrees: float = ANGLE, goes_on: Callable[[float], bool] = lambda _share: True
) -> list[TestPose]:
    """Returns a TestPose for each bone that bends anything, in the order of the bones. goes_on(share): is told how much
    is done, and returns whether to go on; if not, some are missing."""
    size, count, found = bounds.diagonal(mesh.positions), len(mesh.positions), []
    all_edges, all_faces = (_by_span(mesh, bones, corners) for corners in (mesh.edges, mesh.triangles))
    used, place = np.unique(mesh.weights.bones).tolist(), np.empty(count, np.int32)
    for number, bone in enumerate(used):
        if not goes_on(number / len(used)):
            break
        edges, faces = (_split(each, *(end[bone] for end in bones.spans)) for each in (all_edges, all_faces))
        is_used = np.zeros(count, bool)
        is_used[edges] = is_used[faces] = True
        own = np.flatnonzero(is_used)
        place[own] = np.arange(len(own))
        share = shares(mesh, bones, bone, own)
        edges, faces = place[edges], place[faces]
        edges, faces = edges[_bends(share, edges)], faces[_bends(share, faces)]
        if len(edges):
            found.append(_measure(mesh.positions[own], share, edges, faces, own, bones, bone, degrees, size))
    return found


def _by_span(mesh, bones, corners):
    """Returns edges or faces in classes, by how far apart the bones of their corners are in the order of bones.spans:
    for each class a number that is larger, the corners, and the first and last of their bones. Sorted by the first;
    -1: a vertex without weights."""
    numbers, starts = bones.spans[0][mesh.weights.bones], np.flatnonzero(np.diff(mesh.weights.vertices, prepend=-1))
    ends = np.full((2, len(mesh.positions)), -1, np.int32)
    if len(starts):
        for own, of_vertex in zip(ends, (np.minimum, np.maximum)):
            own[mesh.weights.vertices[starts]] = of_vertex.reduceat(numbers, starts)
    low, high = ends[0][corners].min(axis=1), ends[1][corners].max(axis=1)
    order = np.argsort(low, kind="stable")
    exponents = np.frexp(high - low)[1][order]
    classes = [(2**each, order[exponents == each]) for each in np.unique(exponents).tolist()]
    return [(width, corners[own], low[own], high[own]) for width, own in classes]


def _split(classes, first, last):
    """Returns those edges or faces of which some, but not all bones are from first up to last."""
    found = [np.empty((0, classes[0][1].shape[1]), np.int32)] if classes else [np.empty((0, 3), np.int32)]
    for width, corners, low, high in classes:
        for begin, end in ((first - width, first), (max(first, last - width), last)):
            own = slice(*np.searchsorted(low, (begin, end)))
            found.append(corners[own][high[own] >= end])
    return np.concatenate(found)


def _bends(share: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Returns for each edge or face whether not all of its corners stay, or move as one."""
    moved = (share >= _BENT).astype(np.int8) + (share > 1 - _BENT)  # 0: stays, 2: as one, 1: neither
    first, *others = (moved[corner] for corner in corners.T)
    return np.any([first == 1, *(other != first for other in others)], axis=0)


def _measure(rest, share, edges, faces, vertices, bones, bone, degrees, size):
    """Returns the worse pose. rest (P, 3) and share (P,): of what bends; edges and faces: of these points; vertices
    (P,): their numbers in the mesh."""
    head = bones.heads[bone]

    def lengths(points):
        along = points[edges[:, 0]] - points[edges[:, 1]]
        return np.sqrt(np.einsum("na,na->n", along, along))

    def volume(points):
        a, b, c = (points[faces[:, i]] - head for i in range(3))
        return np.einsum("na,na->", a, np.cross(b, c)) / 6

    before, at_rest = lengths(rest), volume(rest)
    is_long, is_hollow = before > _SMALLEST * size, not abs(at_rest) > (_SMALLEST * size) ** 3
    worst = None
    for axis, direction in zip("XZ", bones.axes[bone, [0, 2]]):
        posed = bent(rest, share, head, direction, degrees)
        ratios = np.where(is_long, lengths(posed) / np.where(is_long, before, 1), 1.0)
        if worst is None or ratios.max() > worst[0].max():
            worst = ratios, axis, posed
    ratios, axis, posed = worst
    return TestPose(
        bone,
        axis,
        float(ratios.max()),
        float(ratios.min()),
        float("nan") if is_hollow else volume(posed) / at_rest,
        np.unique(vertices[edges[ratios > STRETCHED]]),
    )


def stretches(mesh: Mesh, posed: np.ndarray) -> np.ndarray:
    """Returns (V,): the largest of (new length / length at rest) of the edges of each vertex, 1 at least.
    posed (V, 3)."""
    a, b = mesh.edges[:, 0], mesh.edges[:, 1]
    before = np.linalg.norm(mesh.positions[a] - mesh.positions[b], axis=1)
    ratio = np.linalg.norm(posed[a] - posed[b], axis=1) / np.where(before > 0, before, np.inf)
    found = np.ones(len(posed))
    for end in (a, b):
        np.maximum.at(found, end, ratio)
    return found
