"""Computes which joints move a vertex and how much. This is done once, by the rules that Blender's Armature modifier
applies on every frame: normalisation over deforming bones, envelopes, the segments of B-bones. Uses only numpy and the
native library, nothing of Blender.

Letters: V vertices, B bones, N influences. A *joint* of the deformer is a bone, one end of a segment of a B-bone, or a
joint that never moves, which is the last one.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..native import sinew_native

# The Armature modifier does not move a vertex whose weights sum to this or less.
SMALLEST_WEIGHT_SUM = 1e-4
# Tolerance for a sum of weights that counts as 1. Painted weights are float32, shown with three digits, and Blender's
# automatic weights sum to 0.97 or more.
NORMALIZED_WITHIN = 0.05


@dataclass
class Bones:
    """The properties of an armature's bones that determine influences. All lengths are in the armature's space."""

    names: tuple
    deform: np.ndarray  # (B,) bool
    rest: np.ndarray  # (B, 4, 4) float64, relative to the armature
    length: np.ndarray  # (B,)
    head_radius: np.ndarray  # (B,)
    tail_radius: np.ndarray  # (B,)
    envelope_distance: np.ndarray  # (B,)
    envelope_weight: np.ndarray  # (B,)
    multiply: np.ndarray  # (B,) bool: the envelope multiplies the weights
    segments: np.ndarray  # (B,) int, 1 for an ordinary bone
    curved: np.ndarray  # (B,) bool: vertices are assigned to segments along the bone's curve

    def __post_init__(self) -> None:
        # A bone with n > 1 segments has n + 1 joints; a bone that does not deform has none.
        counts = np.where(self.deform, np.where(self.segments > 1, self.segments + 1, 1), 0)
        self.joint_counts = counts.astype(np.int32)  # (B,)
        self.first_joint = np.where(self.deform, np.cumsum(counts) - counts, -1).astype(np.int32)  # (B,)
        self.joint_count = int(counts.sum())  # without the joint that never moves


@dataclass
class Rules:
    """The settings of an Armature modifier that affect influences."""

    use_vertex_groups: bool = True
    use_envelopes: bool = False


@dataclass
class Bends:
    """The arguments of sinew_native.Bends: influences of bones with segments, before they are split between the ends
    of a segment. N vertices have M influences of D bones."""

    vertices: np.ndarray  # (N,)
    offsets: np.ndarray  # (N + 1,)
    bones: np.ndarray  # (M,), indices into the arrays below, not into the armature's bones
    weights: np.ndarray  # (M,)
    first_joints: np.ndarray  # (D,)
    segments: np.ndarray  # (D,)
    axes: np.ndarray  # (D, 4)


@dataclass
class Influences:
    """The arguments of sinew_native.Skin, for joint_count + 1 joints."""

    offsets: np.ndarray  # (V + 1,)
    joints: np.ndarray  # (N,)
    weights: np.ndarray  # (N,)
    joint_count: int
    depend_on_shape: bool = False  # new rest positions may change the influences in ways that bends do not cover
    bends: Bends | None = None  # None if no bone with segments moves the mesh, or if one of them is curved
    unweighted_count: int = 0  # vertices that no bone moves
    unnormalized_count: int = 0  # vertices whose weights in the mesh do not sum to 1


def columns_of_groups(groups: Iterable[str], names: Iterable[str]) -> np.ndarray:
    """Returns (G + 1,) int32: the place of each vertex group's name among the names, of bones; -1 for one that is not
    there, and at the end for entries whose group, -1, was removed."""
    columns = {name: column for column, name in enumerate(names)}
    return np.array([columns.get(name, -1) for name in groups] + [-1], np.int32)


def influences(
    offsets: np.ndarray,
    groups: np.ndarray,
    weights: np.ndarray,
    bone_of_group: np.ndarray,
    bones: Bones,
    rules: Rules,
    points: Any,
    segment_at: Callable[[int, np.ndarray], tuple[int, float]] | None = None,
    normalize: bool = True,
) -> Influences:
    """Returns the Influences of a mesh. offsets (V + 1,), groups (N,), weights (N,): the weights of each vertex, in the
    order in which Blender stores them; group -1: none. bone_of_group (G,), or as columns_of_groups returns it: -1 for a
    group without a bone. points(): a function that returns the rest positions (V, 3) in the armature's space; for most
    meshes it is not called. segment_at(bone, point): for a curved B-bone, returns the segment at a point and the
    point's position within it, 0 to 1. normalize: the weights of each vertex are divided by their sum.
    """
    counts = (bone_of_group >= 0) & rules.use_vertex_groups
    counts[counts] = bones.deform[bone_of_group[counts]]
    own, used = bone_of_group[counts], np.where(counts, bone_of_group, -1)
    has_envelopes = rules.use_envelopes or bones.multiply[own].any()
    if not has_envelopes and not (bones.segments[own] > 1).any():
        joint_of_group = used.copy()
        joint_of_group[counts] = bones.first_joint[own]
        offsets, joint, weight, *missed = sinew_native.group_influences(
            offsets, groups, weights, joint_of_group, normalize
        )
        return Influences(offsets, joint, weight, bones.joint_count, False, None, *missed)

    points, multiplied = points(), False
    if has_envelopes:
        vertex, bone, weight, missed, multiplied = _with_envelopes(
            offsets, groups, weights, used, bones, rules, points, normalize
        )
    else:
        offsets, bone, weight, *missed = sinew_native.group_influences(offsets, groups, weights, used, normalize)
        vertex = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    joint = bones.first_joint[bone]
    bent = bones.segments[bone] > 1
    curved = bool((bent & bones.curved[bone]).any())
    bends = None
    if bent.any():
        if not curved:
            bends = _bends(vertex, bone, weight, bent, bones, len(points))
        vertex, joint, weight = _split_over_segments(vertex, bone, joint, weight, bent, bones, points, segment_at)
    return Influences(
        np.concatenate(([0], np.cumsum(np.bincount(vertex, minlength=len(points))))),
        joint.astype(np.int32),
        weight.astype(np.float32),
        bones.joint_count,
        bool(multiplied or rules.use_envelopes or curved),
        bends,
        *missed,
    )


def _with_envelopes(
    offsets: np.ndarray,
    groups: np.ndarray,
    weights: np.ndarray,
    bone_of_group: np.ndarray,
    bones: Bones,
    rules: Rules,
    points: np.ndarray,
    normalize: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, Any, bool]:
    """Returns influences (vertices, bones, weights); a pair: how many vertices no bone moves, and how many
    have weights that do not sum to 1; and whether envelopes multiply any weights."""
    vertex_count = len(offsets) - 1
    vertex = np.repeat(np.arange(vertex_count), np.diff(offsets))
    bone, weight = np.append(bone_of_group, -1)[groups], np.asarray(weights, np.float64)
    vertex, bone, weight = _only(bone >= 0, vertex, bone, weight)
    given = np.bincount(vertex, weight, minlength=vertex_count)

    multiplied = bones.multiply[bone]
    if multiplied.any():
        weight = weight.copy()
        weight[multiplied] *= envelope(points[vertex[multiplied]], bones, bone[multiplied])
    if rules.use_envelopes:
        untouched = np.ones(vertex_count, bool)
        untouched[vertex] = False
        more = _envelope_influences(np.flatnonzero(untouched), bones, points)
        vertex, bone, weight = (np.concatenate(pair) for pair in zip((vertex, bone, weight), more))
        order = np.argsort(vertex, kind="stable")
        vertex, bone, weight = vertex[order], bone[order], weight[order]

    vertex, bone, weight = _only(weight != 0, vertex, bone, weight)
    sums = np.bincount(vertex, weight, minlength=vertex_count)
    vertex, bone, weight = _only(sums[vertex] > SMALLEST_WEIGHT_SUM, vertex, bone, weight)
    unweighted = int(np.count_nonzero(sums <= SMALLEST_WEIGHT_SUM))
    unnormalized = int(np.count_nonzero((given > SMALLEST_WEIGHT_SUM) & (np.abs(given - 1) > NORMALIZED_WITHIN)))
    if normalize:
        weight = weight / sums[vertex]
    return vertex, bone, weight, (unweighted, unnormalized), multiplied.any()


def _only(chosen: np.ndarray, *arrays: np.ndarray) -> tuple[np.ndarray, ...]:
    """Returns the chosen entries of the arrays. If all are chosen, as on most meshes, nothing is copied."""
    return arrays if chosen.all() else tuple(array[chosen] for array in arrays)


def group_weights(offsets: np.ndarray, groups: np.ndarray, weights: np.ndarray, group: int) -> np.ndarray:
    """Returns (V,): each vertex's weight in one vertex group, 0 if it is not in the group. offsets, groups and weights
    are as `meshes.read_weights` returns them."""
    vertex = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    dense = np.zeros(len(offsets) - 1)
    dense[vertex[groups == group]] = weights[groups == group]
    return dense


def envelope(points: np.ndarray, bones: Bones, bone: np.ndarray) -> np.ndarray:
    """Returns (N,): how strongly the envelope of bone[i] affects points[i], 0 to 1. It is 1 within the radius, which is
    interpolated from head to tail, and falls to 0 at the envelope's distance from it."""
    head = bones.rest[bone, :3, 3]
    along_axis = bones.rest[bone, :3, 1]  # unit
    length = bones.length[bone]
    offset = points - head
    along = np.einsum("na,na->n", offset, along_axis)
    share = np.clip(along / np.maximum(length, 1e-30), 0, 1)
    nearest = head + along_axis * np.clip(along, 0, length)[:, None]
    distance = np.linalg.norm(points - nearest, axis=1)
    radius = bones.head_radius[bone] * (1 - share) + bones.tail_radius[bone] * share
    reach = bones.envelope_distance[bone]
    beyond = np.maximum(distance - radius, 0)
    fall = 1 - (beyond / np.where(reach > 0, reach, 1)) ** 2
    return np.where(distance < radius, 1.0, np.where((reach > 0) & (beyond < reach), fall, 0.0))


def _envelope_influences(
    vertices: np.ndarray, bones: Bones, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    deforming = np.flatnonzero(bones.deform)
    vertex = np.repeat(vertices, len(deforming))
    bone = np.tile(deforming, len(vertices))
    return vertex, bone, envelope(points[vertex], bones, bone) * bones.envelope_weight[bone]


def _axes(bones: Bones) -> np.ndarray:
    """Returns axes (B, 4): a point p is at the fraction axes[b, :3] . p + axes[b, 3] of the bone's length."""
    return np.linalg.inv(bones.rest)[:, 1] / np.maximum(bones.length, 1e-30)[:, None]


def _bends(
    vertex: np.ndarray, bone: np.ndarray, weight: np.ndarray, bent: np.ndarray, bones: Bones, vertex_count: int
) -> Bends:
    is_bent = np.zeros(vertex_count, bool)
    is_bent[vertex[bent]] = True
    vertices, own = np.flatnonzero(is_bent), is_bent[vertex]
    is_used = np.zeros(len(bones.names), bool)
    is_used[bone[own]] = True
    used, numbers = np.flatnonzero(is_used), (np.cumsum(is_used) - 1)[bone[own]]
    offsets = np.concatenate(([0], np.cumsum(np.bincount(vertex)[vertices])))
    return Bends(
        vertices,
        offsets,
        numbers.astype(np.int32),
        weight[own].astype(np.float32),
        bones.first_joint[used],
        bones.segments[used],
        _axes(bones)[used],
    )


def _split_over_segments(
    vertex: np.ndarray,
    bone: np.ndarray,
    joint: np.ndarray,
    weight: np.ndarray,
    bent: np.ndarray,
    bones: Bones,
    points: np.ndarray,
    segment_at: Any,
) -> tuple[np.ndarray, ...]:
    """Splits each influence of a B-bone into two, for the ends of the segment that contains the vertex."""
    entries = np.flatnonzero(bent)
    own, at = bone[entries], points[vertex[entries]]
    axes, count = _axes(bones)[own], bones.segments[own]
    place = np.clip(np.einsum("na,na->n", axes[:, :3], at) + axes[:, 3], 0, 1) * count
    index = np.clip(np.floor(place).astype(int), 0, count - 1)
    blend = place - index
    for i in np.flatnonzero(bones.curved[own]):
        index[i], blend[i] = segment_at(own[i], at[i])
    first = entries + np.arange(len(entries))  # the index of each pair's first entry, after all splits before it
    vertex, joint, weight = (np.repeat(array, 1 + bent) for array in (vertex, joint, weight))
    joint[first] += index
    joint[first + 1] += index + 1
    weight[first] *= 1 - blend
    weight[first + 1] *= blend
    return _only(weight != 0, vertex, joint, weight)
