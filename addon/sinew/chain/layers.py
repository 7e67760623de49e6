"""One Armature modifier's contribution to a mesh: a native layer made from the .blend, and the motions of its joints.

A mesh usually has one layer. It has several if Multi Modifier mixes the results of several modifiers.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ..blender import armatures, values
from ..deform.clips import transformed
from ..deform.influences import Bones, Influences, Rules, columns_of_groups, group_weights, influences
from ..host import poses
from ..native import sinew_native
from . import living, methods
from .leaving import LeaveToBlender

# How Blender treats scaled bones with Preserve Volume.
STRETCH = "frame_each" if values.VERSION >= (4, 0, 0) else "frame"
# Whether Multi Modifier's mask selects the result of the later modifier in the stack.
MASK_SHOWS_LATER = values.VERSION >= (4, 0, 0)


class Settings(NamedTuple):
    """The settings of an Armature modifier, except its armature."""

    preserve_volume: bool
    use_vertex_groups: bool
    use_envelopes: bool
    mask_group: str
    mask_invert: bool

    @classmethod
    def of(cls, modifier: Any, binds: tuple[bool, bool]) -> "Settings":
        """Reads the settings of a modifier. binds: as returned by wiring.binds_of."""
        return cls(modifier.use_deform_preserve_volume, *binds, modifier.vertex_group, modifier.invert_vertex_group)


@dataclass
class Weights:
    """A mesh's weights, in the order in which Blender stores them."""

    offsets: np.ndarray  # (V + 1,)
    groups: np.ndarray  # (N,), -1 for a vertex group that was removed
    weights: np.ndarray  # (N,)
    names: tuple  # of the vertex groups

    @classmethod
    def of(
        cls, mesh: Any, names: tuple[str, ...], read: Callable[[Any], tuple[np.ndarray, np.ndarray, np.ndarray]]
    ) -> "Weights":
        """Reads the weights of a mesh. names: of its vertex groups; read: `meshes.read_weights`."""
        offsets, groups, weights = read(mesh)
        groups[groups >= len(names)] = -1
        return cls(offsets, groups, weights, names)

    def same_as(self, other: "Weights | None") -> bool:
        """Whether the other weights are equal."""
        return (
            other is not None
            and self.names == other.names
            and np.array_equal(self.groups, other.groups)
            and np.array_equal(self.offsets, other.offsets)
            and np.array_equal(self.weights, other.weights)
        )

    @functools.cached_property
    def used_names(self) -> set[str]:
        """The names of the groups in which any vertex has a weight other than 0."""
        is_used = _with_weight(self.groups, self.weights, len(self.names))
        return {name for name, used in zip(self.names, is_used.tolist()) if used}

    def of_group(self, name: str) -> np.ndarray | None:
        """Returns the weights in one group, (V,), or None if there is no such group."""
        if name not in self.names:
            return None
        return group_weights(self.offsets, self.groups, self.weights, self.names.index(name))


def is_posed(armature: Any) -> bool:
    """Whether an evaluated armature moves meshes: in its rest position, too, because B-bones may bend there."""
    # It may be in Edit Mode by another object that shares its data.
    return bool(armature.pose.bones) and not armature.data.is_editmode


@dataclass
class Layer:
    """What one Armature modifier does to a mesh. Immutable, because a frame in another thread may still use it."""

    native: Any  # sinew_native.Layer
    skin: Any  # sinew_native.Skin
    influences: Influences
    bones: Bones
    weights: Weights
    rest: np.ndarray  # (V, 3)
    first_joint: np.ndarray  # (B,), -1 for bones that move no vertex
    # (settings, method, number of the layer), *bone_editions.of: if this changes, the layer is made again
    made_of: tuple
    space: bytes | None  # mesh_from_armature when the layer was made
    wanted: str = ""  # methods.made_of for a precomputed method
    splits_motions: bool = False  # into a rotation and a stretch, as Blender does with Preserve Volume
    lacks: str = ""  # why the precomputed data cannot be used: ABSENT, STALE, UNFIT of methods.py, or ""
    _blank: Any = field(repr=False, default=None)  # (J + 1, 4, 4), a pose in which nothing moves

    @property
    def edition(self) -> int:
        """The edition of the bones, the number returned by bone_editions.of."""
        return self.made_of[-1]

    def holds(self, weights: Weights, rest: np.ndarray, made_of: tuple, mesh_from_armature: np.ndarray | None) -> bool:
        """Whether the layer is up to date: whether it would be made from the same data again."""
        return (
            self.weights is weights
            and self.rest is rest
            and self.made_of == made_of
            and (not self.influences.depend_on_shape or self.space == _bytes(mesh_from_armature))
        )

    def read_pose(self, armature: Any) -> np.ndarray:
        """Returns the motions of an evaluated armature's joints, (J + 1, 4, 4) float32. The last is the identity.
        Raises LeaveToBlender."""
        numbers = self._blank.copy()
        if is_posed(armature):
            bones = self.first_joint, self.bones.joint_counts
            poses.read_motions(armature, *bones, numbers)
            if self.splits_motions and sinew_native.host.is_any_flat(numbers, *bones):
                raise LeaveToBlender("a B-bone is flat, and how Preserve Volume turns it depends on Blender's rounding")
        return numbers.transpose(0, 2, 1)

    def with_channels(self, channels: np.ndarray) -> np.ndarray:
        """Returns the same as read_pose, from the motions of all bones in a clip, (B, 4, 4)."""
        numbers = self._blank.copy()
        used = self.bones.first_joint >= 0
        for bone in np.flatnonzero(used):
            first, count = self.bones.first_joint[bone], self.bones.joint_counts[bone]
            numbers[first : first + count] = channels[bone].T
        return numbers.transpose(0, 2, 1)


def make_layer(
    weights: Weights,
    rest: np.ndarray,
    armature: Any,
    mesh_from_armature: np.ndarray | None,
    made_of: tuple,
    text: Any,
    kept: methods.Kept,
) -> Layer:
    """Makes a layer. rest (V, 3): rest positions in mesh space; armature: evaluated; mesh_from_armature (4, 4) or None;
    made_of: ((Settings, methods.Method, number of the layer), *bone_editions.of); text: the text data-block with the
    method's precomputed data, or None; kept: reads that data."""
    settings, method, number = made_of[0]
    bones = Bones(**armatures.read_bones(armature))
    mask = weights.of_group(settings.mask_group)
    if mask is not None and settings.mask_invert:
        mask = 1 - mask
    share = None
    if number > 0:
        share, mask = _share(mask, len(rest)), None
    inverse = None if mesh_from_armature is None else np.linalg.pinv(mesh_from_armature)
    own = influences(
        weights.offsets,
        weights.groups,
        weights.weights,
        columns_of_groups(weights.names, bones.names),
        bones,
        Rules(settings.use_vertex_groups, settings.use_envelopes),
        lambda: transformed(inverse, rest.astype(np.float64)),
        lambda bone, point: armatures.segment_at(armature, bone, point),
        # Where bones lie half a turn apart, the last bit of the weights decides which way is taken between them.
        normalize=not settings.preserve_volume or bool(method.kind),
    )
    moves = _moving(own, bones)
    rest_frames = None
    if settings.preserve_volume or method.kind == methods.BLENDED:
        rest_frames = np.tile(np.eye(4), (bones.joint_count + 1, 1, 1))
        for bone in np.flatnonzero(moves):  # the hook does not wait for the others
            first, count = bones.first_joint[bone], bones.joint_counts[bone]
            rest_frames[first : first + count] = bones.rest[bone]
            if count > 1:
                frames = bones.rest[bone] @ armatures.read_segments(armature, bone, rest=True)
                # A bone's rest matrix may be up to 5e-5 from orthonormal. Blender normalizes the axes of segments, but
                # not those of bones without segments.
                frames[:, :3, :3] /= np.linalg.norm(frames[:, :3, :3], axis=1, keepdims=True)
                rest_frames[first : first + count] = frames
    skin = sinew_native.Skin(rest, own.offsets, own.joints, own.weights, bones.joint_count + 1)
    how: dict[str, Any] = {"method": "linear"}
    if settings.preserve_volume:
        how = {"method": "dual_quaternion", "stretch": STRETCH, "rest_frames": rest_frames}
        # The rotations of B-bones' segments, and all in Blender 3.4, are not Blender's to the last bit.
        how["refuse_half_turns"] = STRETCH == "frame" or bool((bones.joint_counts[moves] > 1).any())
    wanted = lacks = ""
    if method.kind == methods.BLENDED:
        how = {"method": "blended", "stretch": STRETCH, "rest_frames": rest_frames}
        how["data"] = methods.shares(method, weights, len(rest))
    elif method.kind:
        wanted = methods.made_of(method, rest, own, skin.joint_count, bones.names)
        data, lacks = kept.read(method.kind, text, wanted, skin)
        if data is not None:
            how = {"method": data.method, "data": data}
    blank = np.tile(np.eye(4, dtype=np.float32), (bones.joint_count + 1, 1, 1))
    if own.bends is not None:
        how |= {"bends": sinew_native.Bends(**vars(own.bends)), "split_space": mesh_from_armature}
    return Layer(
        living.note(sinew_native.Layer(skin, mask=mask, share=share, **how)),
        skin,
        own,
        bones,
        weights,
        rest,
        np.where(moves, bones.first_joint, -1).astype(np.int32),
        made_of,
        _bytes(mesh_from_armature),
        wanted,
        settings.preserve_volume and not method.kind,
        lacks,
        blank,
    )


def space_between(ob: Any, armature: Any) -> np.ndarray | None:
    """Returns mesh_from_armature, (4, 4), or None if the two spaces are the same. Raises values.Flat."""
    values.refuse_flat(ob, armature)
    return sinew_native.host.space_between(*(np.array(each.matrix_world, np.float32) for each in (ob, armature)))


def _moving(own: Influences, bones: Bones) -> np.ndarray:
    """Returns which bones move any vertex, (B,) bool. own: the influences of the mesh."""
    has_weight = _with_weight(own.joints, own.weights, bones.joint_count + 1)
    moves = np.zeros(len(bones.names), bool)
    for bone in np.flatnonzero(bones.first_joint >= 0):
        first = bones.first_joint[bone]
        moves[bone] = has_weight[first : first + bones.joint_counts[bone]].any()
    return moves


def _with_weight(numbers: np.ndarray, weights: np.ndarray, count: int) -> np.ndarray:
    """Returns which joints or groups have a weight other than 0, (count,) bool. numbers (N,): those of the weights,
    negative for none."""
    counts = weights != 0
    if len(numbers) and numbers.min() < 0:
        counts &= numbers >= 0
    return np.bincount(numbers if counts.all() else numbers[counts], minlength=count) > 0


def _share(mask: np.ndarray | None, vertex_count: int) -> np.ndarray:
    if mask is None:
        mask = np.ones(vertex_count)
    return mask if MASK_SHOWS_LATER else 1 - mask


def _bytes(matrix: np.ndarray | None) -> bytes | None:
    return None if matrix is None else matrix.tobytes()
