"""How weights deform a mesh in test poses, in each of which one bone is bent. Independent of Blender."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..blender import bounds

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
        return {
            "bone": names[self.bone],
            "axis": self.axis,
            "stretch": self.stretch,
            "squash": self.squash,
            "volume": None if np.isnan(self.volume) else self.volume,
            "stretched_vertices": len(self.stretched),
        }


@dataclass(frozen=True)
class Bones:
    """Bones at rest, in the space of the mesh."""

    parents: np.ndarray  # (B,) int, -1 for none; in any order
    heads: np.ndarray  # (B, 3)
    axes: np.ndarray  # (B, 3, 3): the bones' own X, Y, Z axes, as rows of length 1


@dataclass(frozen=True)
class Mesh:
    """A mesh at rest, with weights of which those of a vertex sum to 1, or to 0."""

    positions: np.ndarray  # (V, 3)
    edges: np.ndarray  # (E, 2) int
    triangles: np.ndarray  # (T, 3) int
    vertices: np.ndarray  # (N,) int, the vertex of each weight
    bones: np.ndarray  # (N,) int
    weights: np.ndarray  # (N,)


def below(parents: np.ndarray, bone: int) -> np.ndarray:
    """Returns (B,) bool: the bone and all below it."""
    found = np.zeros(len(parents), bool)
    found[bone] = True
    while True:
        more = found | ((parents >= 0) & found[parents])
        if np.array_equal(more, found):
            return found
        found = more


def shares(mesh: Mesh, bones: Bones, bone: int) -> np.ndarray:
    """Returns (V,): how much of each vertex moves with a bone. Vertices without weights do not move."""
    chosen = below(bones.parents, bone)[mesh.bones]
    return np.bincount(mesh.vertices[chosen], mesh.weights[chosen], minlength=len(mesh.positions))


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


def check(mesh: Mesh, bones: Bones, degrees: float = ANGLE) -> list[TestPose]:
    """Returns a TestPose for each bone that bends anything, in the order of the bones."""
    size = bounds.diagonal(mesh.positions)
    found = []
    for bone in np.unique(mesh.bones[mesh.weights > 0]).tolist():
        share = shares(mesh, bones, bone)
        edges = mesh.edges[_bends(share, mesh.edges)]
        if len(edges):
            faces = mesh.triangles[_bends(share, mesh.triangles)]
            poses = [_measure(mesh, bones, bone, share, edges, faces, axis, degrees, size) for axis in "XZ"]
            found.append(max(poses, key=lambda pose: pose.stretch))
    return found


def _bends(share: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Returns for each edge or face whether not all of its corners stay, or move as one."""
    own = share[corners]
    return ~((own < _BENT).all(axis=1) | (own > 1 - _BENT).all(axis=1))


def _measure(mesh, bones, bone, share, edges, faces, axis, degrees, size):
    head, direction = bones.heads[bone], bones.axes[bone, "XYZ".index(axis)]
    used = np.unique(np.concatenate((edges.reshape(-1), faces.reshape(-1))))
    rest = mesh.positions[used]
    posed = bent(rest, share[used], head, direction, degrees)
    ends, corners = np.searchsorted(used, edges), np.searchsorted(used, faces)

    def lengths(points):
        return np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)

    def volume(points):
        a, b, c = (points[corners[:, i]] - head for i in range(3))
        return np.einsum("na,na->", a, np.cross(b, c)) / 6

    before = lengths(rest)
    ratios = np.where(before > _SMALLEST * size, lengths(posed) / np.where(before > 0, before, 1), 1.0)
    at_rest = volume(rest)
    is_hollow = not abs(at_rest) > (_SMALLEST * size) ** 3
    return TestPose(
        bone,
        axis,
        float(ratios.max()),
        float(ratios.min()),
        float("nan") if is_hollow else volume(posed) / at_rest,
        np.unique(edges[ratios > STRETCHED]),
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
