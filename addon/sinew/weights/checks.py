"""Finds what is wrong with the weights of a mesh. Independent of Blender."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..blender import bounds
from ..deform import influences
from . import bone_segments
from .entries import Entries

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
    weights: Entries,
    positions: np.ndarray,
    edges: np.ndarray,
    heads: np.ndarray,
    tails: np.ndarray,
    find_near: Any,
    most_influences: int = MOST_INFLUENCES,
) -> Check:
    """Returns the Check of a mesh.

    weights: those above 0 in deforming bones, a vertex in a bone once, in the vertices' order. positions (V, 3) and the
    ends of the bones, heads and tails (B, 3), are in the same space. edges (E, 2). find_near(points, others, reach): a
    function that returns for each of the points (P, 3) the index of the nearest of the others (Q, 3), or -1 if none is
    within reach."""
    found = Check(len(positions))
    sums, counts = weights.sums(len(positions)), np.bincount(weights.vertices, minlength=len(positions))
    is_weighted = sums > influences.SMALLEST_WEIGHT_SUM
    found.vertices[UNWEIGHTED] = np.flatnonzero(~is_weighted)
    found.vertices[SUMS] = np.flatnonzero(is_weighted & (np.abs(sums - 1) > influences.NORMALIZED_WITHIN))
    found.vertices[MANY] = np.flatnonzero(counts > most_influences)
    found.most_influences = int(counts.max(initial=0))
    found.bones_used = np.unique(weights.bones)
    shares = weights.summing_to(np.ones(len(positions)))
    size = bounds.diagonal(positions)
    found.vertices[FAR_BONES] = _far(shares, positions, heads, tails, size)
    found.vertices[ISLANDS], found.islands_apart = _apart(shares, is_weighted, positions, edges, size, find_near)
    return found


def _far(shares: Entries, positions: np.ndarray, heads: np.ndarray, tails: np.ndarray, size: float) -> np.ndarray:
    """Returns the vertices with a weight in a far bone. The distance is the straight one."""
    large = shares.where(shares.weights >= FAR_WEIGHT)
    own = bone_segments.distances(positions[large.vertices], heads[large.bones], tails[large.bones])
    may_be = own > FAR_AT_LEAST * size
    own, vertices = own[may_be], large.vertices[may_be]
    of, place = np.unique(vertices, return_inverse=True)
    nearest, _segments = bone_segments.nearest(positions[of], heads, tails)
    return np.unique(vertices[own > FAR * nearest[place] + FAR_AT_LEAST * size])


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
    shares: Entries, is_weighted: np.ndarray, positions: np.ndarray, edges: np.ndarray, size: float, find_near: Any
) -> tuple[np.ndarray, int]:
    """Returns the vertices of the islands that move apart from the larger island that they lie on, and how many islands
    these are."""
    weld = welded(positions, size)
    label = islands(len(positions), weld[edges] if len(edges) else edges)[weld]
    names, sizes = np.unique(label, return_counts=True)
    if len(names) < 2:
        return np.empty(0, int), 0
    order = np.argsort(-sizes, kind="stable")
    rank = np.empty(len(names), int)
    rank[order] = np.arange(len(names))
    ranks = rank[np.searchsorted(names, label)]  # 0: a vertex of the largest island
    others = np.flatnonzero((ranks == 0) & is_weighted)
    candidates = np.flatnonzero((ranks > 0) & is_weighted)
    near = find_near(positions[candidates], positions[others], TOUCHING * size)
    candidates, others = candidates[near >= 0], others[near[near >= 0]]
    own = ranks[candidates]
    totals = np.bincount(own, _differences(shares, len(positions), candidates, others), minlength=len(names))
    is_apart = totals > APART * np.maximum(np.bincount(own, minlength=len(names)), 1)
    return np.flatnonzero(is_apart[ranks]), int(is_apart.sum())


def _differences(shares: Entries, vertex_count: int, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Returns (P,): half the sum of the differences of the weights of vertices one (P,) and other (P,)."""
    offsets = shares.offsets(vertex_count)
    both = shares.at(one, offsets).joined(shares.at(other, offsets).times(np.full(len(other), -1)))
    both = both.where(np.lexsort((both.bones, both.vertices)))
    starts = np.flatnonzero((np.diff(both.vertices, prepend=-1) != 0) | (np.diff(both.bones, prepend=-1) != 0))
    sums = np.add.reduceat(both.weights, starts) if len(starts) else both.weights
    return 0.5 * np.bincount(both.vertices[starts], np.abs(sums), minlength=len(one))
