"""Finds what is wrong with the weights of a mesh. Independent of Blender."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..blender import bounds
from ..deform import influences
from . import bone_segments

MOST_INFLUENCES = 4  # what most game engines allow
FAR = 2.0  # a bone is far from a vertex if its distance is more than this many times the nearest bone's,
FAR_AT_LEAST = 0.1  # and by this share of the mesh's size more
FAR_WEIGHT = 0.05  # the least weight in a far bone that is found
TOUCHING = 0.02  # of the mesh's size: an island lies on what is not farther away
APART = 0.25  # half the sum of the differences of the weights, above which an island moves apart
WELDED = 1e-6  # of the mesh's size: vertices that are not farther from each other are one

UNWEIGHTED, SUMS, MANY, FAR_BONES, ISLANDS = "UNWEIGHTED", "SUMS", "MANY", "FAR", "ISLANDS"
STRETCHED = "STRETCHED"


@dataclass
class Weights:
    """The weights of a mesh in deforming bones. Entries with the bone -1 count for nothing."""

    offsets: np.ndarray  # (V + 1,)
    bones: np.ndarray  # (N,) int
    weights: np.ndarray  # (N,)

    @property
    def vertices(self) -> np.ndarray:
        """The vertex of each entry, (N,)."""
        return np.repeat(np.arange(len(self.offsets) - 1), np.diff(self.offsets))

    @property
    def count(self) -> int:
        """V."""
        return len(self.offsets) - 1

    def used(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Returns vertices, bones and weights of the entries above 0 in a bone."""
        chosen = (self.bones >= 0) & (self.weights > 0)
        return self.vertices[chosen], self.bones[chosen], self.weights[chosen]


@dataclass
class Check:
    """What was found in one mesh: for each problem the vertices, and the bones that move none."""

    vertex_count: int
    vertices: dict[str, np.ndarray] = field(default_factory=dict)  # {problem: (N,) int}
    islands_apart: int = 0
    most_influences: int = 0
    bones_used: np.ndarray = field(default_factory=lambda: np.empty(0, int))

    def count(self, problem: str) -> int:
        return len(self.vertices[problem])

    def document(self) -> dict[str, Any]:
        """Returns the numbers, for JSON."""
        return {
            "vertices": self.vertex_count,
            "unweighted": self.count(UNWEIGHTED),
            "sums": self.count(SUMS),
            "many_influences": self.count(MANY),
            "most_influences": self.most_influences,
            "far": self.count(FAR_BONES),
            "islands_apart": self.islands_apart,
            "island_vertices": self.count(ISLANDS),
        }


def check(
    weights: Weights,
    positions: np.ndarray,
    edges: np.ndarray,
    heads: np.ndarray,
    tails: np.ndarray,
    find_near: Any,
    most_influences: int = MOST_INFLUENCES,
) -> Check:
    """Returns the Check of a mesh.

    positions (V, 3) and the ends of the bones, heads and tails (B, 3), are in the same space. edges (E, 2).
    find_near(points, others, reach): a function that returns for each of the points (P, 3) the index of the nearest of
    the others (Q, 3), or -1 if none is within reach."""
    found = Check(weights.count)
    vertices, bones, values = weights.used()
    sums = np.bincount(vertices, values, minlength=weights.count)
    counts = np.bincount(vertices, minlength=weights.count)
    is_weighted = sums > influences.SMALLEST_WEIGHT_SUM
    found.vertices[UNWEIGHTED] = np.flatnonzero(~is_weighted)
    found.vertices[SUMS] = np.flatnonzero(is_weighted & (np.abs(sums - 1) > influences.NORMALIZED_WITHIN))
    found.vertices[MANY] = np.flatnonzero(counts > most_influences)
    found.most_influences = int(counts.max(initial=0))
    found.bones_used = np.unique(bones)
    shares = values / sums[vertices]
    size = bounds.diagonal(positions)
    found.vertices[FAR_BONES] = _far(vertices, bones, shares, positions, heads, tails, size)
    found.vertices[ISLANDS], found.islands_apart = _apart(
        vertices, bones, shares, is_weighted, positions, edges, len(heads), size, find_near
    )
    return found


def _far(
    vertices: np.ndarray,
    bones: np.ndarray,
    shares: np.ndarray,
    positions: np.ndarray,
    heads: np.ndarray,
    tails: np.ndarray,
    size: float,
) -> np.ndarray:
    """Returns the vertices with a weight in a far bone. The distance is the straight one."""
    if not len(vertices):
        return np.empty(0, int)
    nearest = np.full(len(positions), np.inf)
    for bone in range(len(heads)):
        ends = np.broadcast_to(heads[bone], positions.shape), np.broadcast_to(tails[bone], positions.shape)
        np.minimum(nearest, bone_segments.distances(positions, *ends), out=nearest)
    own = bone_segments.distances(positions[vertices], heads[bones], tails[bones])
    is_far = (own > FAR * nearest[vertices] + FAR_AT_LEAST * size) & (shares >= FAR_WEIGHT)
    return np.unique(vertices[is_far])


def islands(count: int, edges: np.ndarray) -> np.ndarray:
    """Returns (V,): for each of the vertices the smallest vertex that edges (E, 2) connect it to."""
    label = np.arange(count)
    while len(edges):
        one, other = label[edges[:, 0]], label[edges[:, 1]]
        differs = one != other
        if not differs.any():
            break
        edges = edges[differs]
        low, high = np.minimum(one, other)[differs], np.maximum(one, other)[differs]
        np.minimum.at(label, high, low)
        while True:  # until each label is the smallest of its tree
            next_label = label[label]
            if np.array_equal(next_label, label):
                break
            label = next_label
    return label


def welded(positions: np.ndarray, size: float) -> np.ndarray:
    """Returns (V,): for each vertex the first one at the same place."""
    if not len(positions):
        return np.empty(0, int)
    cells = np.round(positions / max(WELDED * size, np.finfo(float).tiny)).astype(np.int64)
    _, first, inverse = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    return first[inverse.reshape(-1)]


def _apart(
    vertices: np.ndarray,
    bones: np.ndarray,
    shares: np.ndarray,
    is_weighted: np.ndarray,
    positions: np.ndarray,
    edges: np.ndarray,
    bone_count: int,
    size: float,
    find_near: Any,
) -> tuple[np.ndarray, int]:
    """Returns the vertices of the islands that move apart from the larger island that they lie on, and how many islands
    these are."""
    weld = welded(positions, size)
    label = islands(len(positions), weld[edges] if len(edges) else edges)[weld]
    names, sizes = np.unique(label, return_counts=True)
    if len(names) < 2 or not bone_count:
        return np.empty(0, int), 0
    order = np.argsort(-sizes, kind="stable")
    rank = np.empty(len(names), int)
    rank[order] = np.arange(len(names))
    ranks = rank[np.searchsorted(names, label)]  # 0: a vertex of the largest island
    largest = ranks == 0
    starts = np.searchsorted(vertices, np.arange(len(positions) + 1))

    def row(vertex: int) -> np.ndarray:
        dense = np.zeros(bone_count)
        np.add.at(dense, bones[starts[vertex] : starts[vertex + 1]], shares[starts[vertex] : starts[vertex + 1]])
        return dense

    others = np.flatnonzero(largest & is_weighted)
    candidates = np.flatnonzero(~largest & is_weighted)
    near = find_near(positions[candidates], positions[others], TOUCHING * size)
    touching = near >= 0
    difference = np.array(
        [0.5 * np.abs(row(a) - row(others[b])).sum() for a, b in zip(candidates[touching], near[touching])]
    )
    own = ranks[candidates[touching]]
    totals = np.bincount(own, difference, minlength=len(names)) if len(own) else np.zeros(len(names))
    counts = np.bincount(own, minlength=len(names))
    is_apart = totals > APART * np.maximum(counts, 1)
    return np.flatnonzero(is_apart[ranks]), int(is_apart.sum())
