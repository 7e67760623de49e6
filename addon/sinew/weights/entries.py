"""The weights of a mesh as three arrays, which take as much memory as there are weights. Independent of Blender."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..native import sinew_native


@dataclass(frozen=True)
class Entries:
    """Weights of vertices in bones, in any order."""

    vertices: np.ndarray  # (N,) int
    bones: np.ndarray  # (N,) int
    weights: np.ndarray  # (N,)

    @classmethod
    def of(cls, weights: Any) -> "Entries":
        """Returns those of a sinew_native.WeightTable, vertex after vertex, by the bones."""
        return cls.from_offsets(weights.offsets, weights.bones, np.array(weights.weights, float))

    @classmethod
    def from_offsets(cls, offsets: np.ndarray, bones: np.ndarray, weights: np.ndarray) -> "Entries":
        """Returns those of which vertex v has the ones from offsets[v] up to offsets[v + 1]."""
        counts = np.diff(offsets)
        return cls(np.repeat(np.arange(len(counts)), counts), np.asarray(bones), weights)

    def where(self, chosen: np.ndarray) -> "Entries":
        """Returns the chosen ones: (N,) bool, or their numbers."""
        return Entries(self.vertices[chosen], self.bones[chosen], self.weights[chosen])

    def offsets(self, vertex_count: int) -> np.ndarray:
        """Returns (V + 1,): where the weights of each vertex begin, if they are in the vertices' order."""
        return np.append(0, np.cumsum(np.bincount(self.vertices, minlength=vertex_count)))

    def at(self, vertices: np.ndarray, offsets: np.ndarray) -> "Entries":
        """Returns those of some vertices (P,), numbered by their place among these. offsets: of all, which are in the
        vertices' order."""
        last = offsets[vertices + 1]
        counts = last - offsets[vertices]
        own = np.arange(counts.sum()) + np.repeat(last - np.cumsum(counts), counts)
        return Entries(np.repeat(np.arange(len(vertices)), counts), self.bones[own], self.weights[own])

    def times(self, factors: np.ndarray) -> "Entries":
        """Returns all, multiplied by a factor for each vertex, (V,)."""
        return Entries(self.vertices, self.bones, self.weights * factors[self.vertices])

    def sums(self, vertex_count: int) -> np.ndarray:
        """Returns the sum of each vertex's weights, (V,)."""
        return np.bincount(self.vertices, self.weights, minlength=vertex_count)

    def summing_to(self, wanted: np.ndarray) -> "Entries":
        """Returns all, scaled so that those of each vertex sum to what is wanted, (V,). A sum of 0 stays."""
        sums = self.sums(len(wanted))
        return self.times(wanted / np.where(sums > 0, sums, 1))

    def joined(self, other: "Entries") -> "Entries":
        """Returns all of both."""
        return stacked((self, other), (0, 0))

    def renumbered(self, numbers: np.ndarray) -> "Entries":
        """Returns those whose bones have a number in `numbers` (B,), with these numbers; -1: none. A bone -1 has the
        last."""
        own = numbers[self.bones]
        return Entries(self.vertices, own, self.weights).where(own >= 0)

    def largest(self, counts: np.ndarray) -> "Entries":
        """Returns so many of the largest of each vertex, counts (V,), scaled to the sum of all that it has."""
        order = np.lexsort((self.bones, -self.weights, self.vertices))
        own = self.where(order)
        rank = np.arange(len(order)) - np.searchsorted(own.vertices, own.vertices)
        return own.where(rank < counts[own.vertices]).summing_to(self.sums(len(counts)))

    def table(self, vertex_count: int, bone_count: int) -> Any:
        """Returns a sinew_native.WeightTable."""
        order = np.argsort(self.vertices, kind="stable")
        return sinew_native.WeightTable(self.offsets(vertex_count), self.bones[order], self.weights[order], bone_count)


def stacked(parts: Sequence[Entries], starts: Iterable[int]) -> Entries:
    """Returns all of several meshes, the first vertices of which get the numbers `starts`."""
    return Entries(
        np.concatenate([own.vertices + start for own, start in zip(parts, starts)]),
        np.concatenate([own.bones for own in parts]),
        np.concatenate([own.weights for own in parts]),
    )


def differ(one: Any, other: Any) -> np.ndarray:
    """Returns (V,) bool: the vertices whose weights differ between two of sinew_native.WeightTable."""
    counts = np.diff(one.offsets)
    result = counts != np.diff(other.offsets)
    own, others = (each.where(~result[each.vertices]) for each in (Entries.of(one), Entries.of(other)))
    result[own.vertices[(own.bones != others.bones) | (own.weights != others.weights)]] = True
    return result
