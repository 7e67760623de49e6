"""Chooses the line segments that stand for the bones when weights are made. Independent of Blender."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

AUTOMATIC, TAIL, CHILD = "AUTOMATIC", "TAIL", "CHILD"
_TOUCHES = 0.1  # of a bone's length: how far its tail may be from its child's head
_MEANT = 0.5  # the least share of bones whose tails touch their only child, if people have placed the tails
_CELLS = 64  # along the longest side of some points, to find the segments that may be nearest
_SHORTEST = 1e-3  # of a bone's length: a child whose head is nearer shows no direction


@dataclass(frozen=True)
class RestBones:
    """All bones of an armature at rest, in world space."""

    names: tuple[str, ...]
    parents: np.ndarray  # (B,) int: each bone's parent, -1 for none
    deform: np.ndarray  # (B,) bool
    heads: np.ndarray  # (B, 3)
    tails: np.ndarray  # (B, 3)
    curves: dict[int, np.ndarray]  # of each B-bone with n > 1 segments: their ends, (n + 1, 3)


class Segments(NamedTuple):
    """The line segments of some bones. A B-bone has several."""

    heads: np.ndarray  # (S, 3)
    tails: np.ndarray  # (S, 3)
    bones: np.ndarray  # (S,) int: the bone of each, an index into the chosen bones


def choose(bones: RestBones, chosen: np.ndarray, ends: str = AUTOMATIC) -> Segments:
    """Returns the segments of the chosen bones, an array of their numbers (C,).

    ends: where a segment ends. TAIL: at the bone's tail. CHILD: at the mean of its children's heads; without a child,
    it continues in its parent's direction, half as long as the parent's segment. AUTOMATIC: TAIL, unless most tails
    are far from the only child's head, as in rigs whose file formats have joints but no tails."""
    if ends == AUTOMATIC:
        ends = TAIL if _are_tails_meant(bones) else CHILD
    tails = bones.tails if ends == TAIL else _tails_at_children(bones)
    heads_found, tails_found, owners = [np.empty((0, 3))], [np.empty((0, 3))], []
    for number, bone in enumerate(chosen.tolist()):
        points = bones.curves.get(bone) if ends == TAIL else None
        if points is None:
            points = np.array([bones.heads[bone], tails[bone]])
        heads_found.append(points[:-1])
        tails_found.append(points[1:])
        owners += [number] * (len(points) - 1)
    return Segments(np.concatenate(heads_found), np.concatenate(tails_found), np.array(owners, int))


def _children(bones: RestBones) -> list[np.ndarray]:
    """Returns the deforming children of each bone. A child that does not deform is replaced by its own children."""
    found: list[list[int]] = [[] for _ in bones.names]
    for bone in np.flatnonzero(bones.deform).tolist():
        parent = bones.parents[bone]
        while parent >= 0 and not bones.deform[parent]:
            parent = bones.parents[parent]
        if parent >= 0:
            found[parent].append(bone)
    return [np.array(each, int) for each in found]


def _are_tails_meant(bones: RestBones) -> bool:
    touching = []
    for bone, children in enumerate(_children(bones)):
        if bones.deform[bone] and len(children) == 1:
            length = np.linalg.norm(bones.tails[bone] - bones.heads[bone])
            gap = np.linalg.norm(bones.heads[children[0]] - bones.tails[bone])
            touching.append(gap <= _TOUCHES * length)
    return not touching or float(np.mean(touching)) >= _MEANT


def _tails_at_children(bones: RestBones) -> np.ndarray:
    """Returns (B, 3): the ends of segments that lead to the children. The tail, where neither a child nor a parent
    shows a direction."""
    tails, children = bones.tails.copy(), _children(bones)
    is_found = np.zeros(len(tails), bool)
    for bone, own in enumerate(children):
        if len(own):
            end = bones.heads[own].mean(axis=0)
            length = np.linalg.norm(bones.tails[bone] - bones.heads[bone])
            if np.linalg.norm(end - bones.heads[bone]) > _SHORTEST * length:
                tails[bone], is_found[bone] = end, True
    parent_of = np.full(len(tails), -1)
    for bone, own in enumerate(children):
        parent_of[own] = bone
    for bone in np.flatnonzero(bones.deform & ~is_found):
        parent = parent_of[bone]
        if parent >= 0 and is_found[parent] and not len(children[bone]):
            tails[bone] = bones.heads[bone] + 0.5 * (tails[parent] - bones.heads[parent])
    return tails


def distances(points: np.ndarray, heads: np.ndarray, tails: np.ndarray) -> np.ndarray:
    """Returns (N,): the distance of points[i] to the segment from heads[i] to tails[i], all (N, 3)."""
    along, offset = tails - heads, points - heads
    squared = np.einsum("na,na->n", along, along)
    share = np.einsum("na,na->n", offset, along) / np.where(squared > 0, squared, 1)
    offset = offset - np.clip(share, 0, 1)[:, None] * along
    return np.sqrt(np.einsum("na,na->n", offset, offset))


def nearest(points: np.ndarray, heads: np.ndarray, tails: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns for each of the points (P, 3) how far the nearest of the segments from heads (S, 3) to tails (S, 3) is,
    (P,), and its number, (P,) int; infinity and -1 without segments."""
    best, found = np.full(len(points), np.inf), np.full(len(points), -1)
    if not len(points) or not len(heads):
        return best, found
    low = points.min(axis=0)
    width = max(float(np.ptp(points, axis=0).max()) / _CELLS, np.finfo(float).tiny)
    cells = ((points - low) / width).astype(np.int64) @ ((_CELLS + 1) ** np.arange(3))
    _, first, cell = np.unique(cells, return_index=True, return_inverse=True)
    # From any point of a cell, a distance differs by at most the cell's diagonal from that of another.
    middles, diagonal = points[first], np.sqrt(3) * width
    ends = (
        (np.broadcast_to(head, middles.shape), np.broadcast_to(tail, middles.shape)) for head, tail in zip(heads, tails)
    )
    there = np.array([distances(middles, *each) for each in ends])
    may_be = there <= (there.min(axis=0) + 2.001 * diagonal)
    for segment in np.flatnonzero(may_be.any(axis=1)).tolist():
        chosen = np.flatnonzero(may_be[segment][cell])
        shape = len(chosen), 3
        own = distances(points[chosen], np.broadcast_to(heads[segment], shape), np.broadcast_to(tails[segment], shape))
        nearer = own < best[chosen]
        best[chosen[nearer]], found[chosen[nearer]] = own[nearer], segment
    return best, found
