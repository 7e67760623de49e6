"""Which joints move a vertex and how much, worked out once as Blender's Armature modifier does for
every frame: normalisation over deforming bones, envelopes, the segments of B-bones. Pure.

Letters: V vertices, B bones, N influences. A *joint* of the deformer is a bone, one end of a segment
of a B-bone, or, last of all, one that never moves.
"""

from dataclasses import dataclass

import numpy as np

# Blender's modifier leaves a vertex alone whose weights sum to no more than this.
SMALLEST_WEIGHT_SUM = 1e-4
# Weights painted by hand are kept as float32 and shown with three digits.
NORMALIZED_WITHIN = 0.05  # Blender's own automatic weights sum to 0.97 or more


@dataclass
class Bones:
    """What of an armature's bones decides on influences. All lengths in the armature's space."""

    names: tuple
    deform: np.ndarray  # (B,) bool
    rest: np.ndarray  # (B, 4, 4) float64, relative to the armature
    length: np.ndarray  # (B,)
    head_radius: np.ndarray  # (B,)
    tail_radius: np.ndarray  # (B,)
    envelope_distance: np.ndarray  # (B,)
    envelope_weight: np.ndarray  # (B,)
    multiply: np.ndarray  # (B,) bool: the envelope multiplies the weights
    segments: np.ndarray  # (B,) int, 1: an ordinary bone
    curved: np.ndarray  # (B,) bool: vertices belong to the segments along the bone's curve

    def __post_init__(self):
        # A bone with n > 1 segments has n + 1 joints, one that does not deform has none.
        counts = np.where(self.deform, np.where(self.segments > 1, self.segments + 1, 1), 0)
        self.joint_counts = counts.astype(np.int32)  # (B,)
        self.first_joint = np.where(self.deform, np.cumsum(counts) - counts, -1).astype(np.int32)  # (B,)
        self.joint_count = int(counts.sum())  # without the one that never moves


@dataclass
class Rules:
    """What an Armature modifier's settings say."""

    use_vertex_groups: bool = True
    use_envelopes: bool = False


@dataclass
class Bends:
    """As sinew_native.Bends takes them: the influences of bones with segments before they are split, N vertices
    with M influences of D bones."""

    vertices: np.ndarray  # (N,)
    offsets: np.ndarray  # (N + 1,)
    bones: np.ndarray  # (M,), numbers of the arrays below, not of the armature
    weights: np.ndarray  # (M,)
    first_joints: np.ndarray  # (D,)
    segments: np.ndarray  # (D,)
    axes: np.ndarray  # (D, 4)


@dataclass
class Influences:
    """As sinew_native.Skin takes them, weights summing to 1, for joint_count + 1 joints."""

    offsets: np.ndarray  # (V + 1,)
    joints: np.ndarray  # (N,)
    weights: np.ndarray  # (N,)
    joint_count: int
    depend_on_shape: bool = False  # other rest positions may mean other influences, beyond what bends say
    bends: Bends | None = None  # None: no bone with segments moves the mesh, or one of them is curved
    unweighted_count: int = 0  # vertices that no bone moves
    unnormalized_count: int = 0  # vertices whose weights, as they stand in the mesh, do not sum to 1


def influences(offsets, bones_of_entries, weights, bones, rules, points, segment_at=None):
    """offsets (V + 1,), bones_of_entries (N,): bone of each entry or -1, weights (N,), in the order
    in which Blender stores them; points (V, 3): rest positions in the armature's space;
    segment_at(bone, point): of a curved B-bone, the segment at a point and how near its end.
    """
    vertex_count = len(offsets) - 1
    vertex = np.repeat(np.arange(vertex_count), np.diff(offsets))
    bone, weight = np.asarray(bones_of_entries), np.asarray(weights, np.float64)
    keep = bone >= 0 if rules.use_vertex_groups else np.zeros(len(bone), bool)
    keep[keep] = bones.deform[bone[keep]]
    vertex, bone, weight = _only(keep, vertex, bone, weight)
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

    counted = weight != 0
    vertex, bone, weight = _only(counted, vertex, bone, weight)
    sums = np.bincount(vertex, weight, minlength=vertex_count)
    moved = sums[vertex] > SMALLEST_WEIGHT_SUM
    vertex, bone, weight = _only(moved, vertex, bone, weight)
    weight = weight / sums[vertex]

    joint = bones.first_joint[bone]
    bent = bones.segments[bone] > 1
    curved = bool((bent & bones.curved[bone]).any())
    bends = None
    if bent.any():
        if not curved:
            bends = _bends(vertex, bone, weight, bent, bones)
        vertex, joint, weight = _split_over_segments(vertex, bone, joint, weight, bent, bones, points, segment_at)
    counts = np.bincount(vertex, minlength=vertex_count)
    return Influences(
        np.concatenate(([0], np.cumsum(counts))),
        joint.astype(np.int32),
        weight.astype(np.float32),
        bones.joint_count,
        bool(multiplied.any() or rules.use_envelopes or curved),
        bends,
        unweighted_count=int(np.count_nonzero(sums <= SMALLEST_WEIGHT_SUM)),
        unnormalized_count=int(
            np.count_nonzero((given > SMALLEST_WEIGHT_SUM) & (np.abs(given - 1) > NORMALIZED_WITHIN))
        ),
    )


def _only(chosen, *arrays):
    """As they are if all are chosen, as on most meshes: copying is what costs here."""
    return arrays if chosen.all() else tuple(array[chosen] for array in arrays)


def group_weights(offsets, groups, weights, group):
    """(V,): each vertex's weight in one vertex group, 0 where it is not in it. The rest as
    `blender_io.read_weights` gives it."""
    vertex = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    dense = np.zeros(len(offsets) - 1)
    dense[vertex[groups == group]] = weights[groups == group]
    return dense


def envelope(points, bones, bone):
    """(N,): how far the envelope of bone[i] takes hold of points[i], 0 to 1: wholly within its
    radius, which goes from head to tail, and not at all beyond its distance."""
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


def _envelope_influences(vertices, bones, points):
    deforming = np.flatnonzero(bones.deform)
    vertex = np.repeat(vertices, len(deforming))
    bone = np.tile(deforming, len(vertices))
    return vertex, bone, envelope(points[vertex], bones, bone) * bones.envelope_weight[bone]


def _axes(bones):
    """(B, 4): a point p lies at share axes[b, :3] . p + axes[b, 3] of the bone's length."""
    return np.linalg.inv(bones.rest)[:, 1] / np.maximum(bones.length, 1e-30)[:, None]


def _bends(vertex, bone, weight, bent, bones):
    vertices = np.unique(vertex[bent])
    own = np.isin(vertex, vertices)
    used, numbers = np.unique(bone[own], return_inverse=True)
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


def _split_over_segments(vertex, bone, joint, weight, bent, bones, points, segment_at):
    """Each influence of a B-bone becomes two, of the ends of the segment that the vertex is at."""
    axes = _axes(bones)[bone]
    share = np.einsum("na,na->n", axes[:, :3], points[vertex]) + axes[:, 3]
    count = bones.segments[bone]
    place = np.clip(share, 0, 1) * count
    index = np.clip(np.floor(place).astype(int), 0, count - 1)
    blend = np.where(bent, place - index, 0)
    for entry in np.flatnonzero(bent & bones.curved[bone]):
        index[entry], blend[entry] = segment_at(bone[entry], points[vertex[entry]])
    joint = np.where(bent, joint + index, joint)
    vertex, joint = np.repeat(vertex, 2), np.stack((joint, joint + 1), 1).reshape(-1)
    weight = np.stack((weight * (1 - blend), weight * blend), 1).reshape(-1)
    used = weight != 0
    return vertex[used], joint[used], weight[used]
