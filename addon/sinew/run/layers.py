"""One Armature modifier's say in a bound mesh: a native layer made from the .blend, and the motions of its joints.

Ordinarily a mesh has one layer. It has more where Multi Modifier mixes the results of several modifiers.
"""

import functools
import itertools
import threading
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..blender import armatures, values
from ..deform.clips import transformed
from ..deform.influences import Bones, Influences, Rules, group_weights, influences
from ..host import marks, motions
from ..native import sinew_native
from . import methods

# How Blender itself treats scaled bones when it preserves volume, ...
STRETCH = "frame_each" if values.VERSION >= (4, 0, 0) else "frame"
# ... and whether Multi Modifier's mask shows what comes later in the stack.
MASK_SHOWS_LATER = values.VERSION >= (4, 0, 0)


class Settings(NamedTuple):
    """What an Armature modifier says, but for its armature."""

    preserve_volume: bool
    use_vertex_groups: bool
    use_envelopes: bool
    mask_group: str
    mask_invert: bool

    @classmethod
    def of(cls, modifier, binds):
        """binds: as wiring.binds_of gives them."""
        return cls(modifier.use_deform_preserve_volume, *binds, modifier.vertex_group, modifier.invert_vertex_group)


@dataclass
class Weights:
    """A mesh's weights, in the order in which Blender stores them."""

    offsets: np.ndarray  # (V + 1,)
    groups: np.ndarray  # (N,), -1: of a vertex group that was removed
    weights: np.ndarray  # (N,)
    names: tuple  # of the vertex groups

    @classmethod
    def of(cls, mesh, names, read):
        """read: function that reads a mesh's weights, `meshes.read_weights`."""
        offsets, groups, weights = read(mesh)
        groups[groups >= len(names)] = -1
        return cls(offsets, groups, weights, names)

    def same_as(self, other):
        return (
            other is not None
            and self.names == other.names
            and np.array_equal(self.groups, other.groups)
            and np.array_equal(self.offsets, other.offsets)
            and np.array_equal(self.weights, other.weights)
        )

    @functools.cached_property
    def used_names(self):
        """Of the groups in which some vertex has weight."""
        counts = np.bincount(self.groups[(self.weights != 0) & (self.groups >= 0)], minlength=len(self.names))
        return {name for name, count in zip(self.names, counts.tolist()) if count}

    def of_group(self, name):
        """(V,) or None if there is no such group."""
        if name not in self.names:
            return None
        return group_weights(self.offsets, self.groups, self.weights, self.names.index(name))


# --- bones ----------------------------------------------------------------------------------------


_numbers = {}  # key of an armature's data -> [(number, signature)] of the last editions of its bones
_copies = {}  # address of an evaluated armature's data -> number of the edition that was read from it
_editions_lock = threading.Lock()
_new_number = itertools.count(1)
MOST_EDITIONS = 4  # of one armature; another graph may have an older one
MOST_COPIES = 1024


def forget_editions():
    with _editions_lock:
        _numbers.clear()
        _copies.clear()


def edition_of_bones(armature):
    """(key of the armature's data, a number that is another one for other bones), of an evaluated armature. Bones are
    compared only when Blender has copied the armature anew: after edits, and as bones are posed by hand, but not on a
    frame."""
    data = armature.data
    key, address = values.key_of(data), data.as_pointer()
    with _editions_lock:
        if marks.take_mark(data, "ARMATURE") and address in _copies:
            return key, _copies[address]
        signature = armatures.bone_signature(armature)
        known = _numbers.setdefault(key, [])
        number = next((number for number, other in known if other == signature), 0)
        if not number:
            number = next(_new_number)
            known.append((number, signature))
            del known[:-MOST_EDITIONS]
        if len(_copies) >= MOST_COPIES:
            _copies.clear()
        _copies[address] = number
        return key, number


def is_edition(address, number):
    """Whether that is the edition that was last read from the evaluated armature's data there."""
    return _copies.get(address) == number


def is_posed(armature):
    """Whether an evaluated armature shows a pose."""
    return bool(armature.pose.bones) and armature.data.pose_position != "REST" and armature.mode != "EDIT"


@dataclass
class Layer:
    """Immutable once made: a frame that runs meanwhile in another thread keeps what it has."""

    native: object  # sinew_native.Layer
    skin: object  # sinew_native.Skin
    influences: Influences
    bones: Bones
    weights: Weights
    rest: np.ndarray  # (V, 3)
    first_joint: np.ndarray  # (B,) of the bones by which some vertex moves; -1 of the others
    made_of: tuple  # (settings, method, its number), edition of the bones: if they change, the layer is made anew
    space: bytes | None  # from armature to mesh, when it was made
    wanted: str = ""  # methods.made_of, of a method that is precomputed
    lacks: str = ""  # what is the matter with what was precomputed, see methods.py
    _blank: np.ndarray = field(repr=False, default=None)  # (J + 1, 4, 4), a pose in which nothing moves

    @property
    def edition(self):
        """Of the bones, the number that edition_of_bones gives."""
        return self.made_of[-1]

    def holds(self, weights, rest, made_of, mesh_from_armature):
        return (
            self.weights is weights
            and self.rest is rest
            and self.made_of == made_of
            and (not self.influences.depend_on_shape or self.space == _bytes(mesh_from_armature))
        )

    def read_pose(self, armature):
        """(J + 1, 4, 4) float32: the motions of the joints of an evaluated armature, the last the identity."""
        numbers = self._blank.copy()
        if is_posed(armature):
            motions.read(armature, self.first_joint, self.bones.joint_counts, numbers)
        return numbers.transpose(0, 2, 1)

    def with_channels(self, channels):
        """The same from the motions of all bones, (B, 4, 4), as a clip gives them."""
        numbers = self._blank.copy()
        used = self.bones.first_joint >= 0
        for bone in np.flatnonzero(used):
            first, count = self.bones.first_joint[bone], self.bones.joint_counts[bone]
            numbers[first : first + count] = channels[bone].T
        return numbers.transpose(0, 2, 1)


def make_layer(weights, rest, armature, mesh_from_armature, made_of, text, kept):
    """weights: Weights; rest (V, 3): rest positions, space of the mesh; armature: evaluated; mesh_from_armature (4, 4)
    or None; made_of: ((Settings, methods.Method, number of the layer), edition of the bones); text: with what the
    method has precomputed, or None; kept: methods.Kept, which reads it."""
    settings, method, number = made_of[0]
    bones = Bones(**armatures.read_bones(armature))
    index = {name: i for i, name in enumerate(bones.names)}
    bone_of_group = np.array([index.get(name, -1) for name in weights.names], np.int32)
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
        bone_of_group,
        bones,
        Rules(settings.use_vertex_groups, settings.use_envelopes),
        lambda: transformed(inverse, rest.astype(np.float64)),
        lambda bone, point: armatures.segment_at(armature, bone, point),
    )
    moves = _moving(own, bones)
    rest_frames = None
    if settings.preserve_volume or method.kind == methods.BLENDED:
        rest_frames = np.tile(np.eye(4), (bones.joint_count + 1, 1, 1))
        for bone in np.flatnonzero(moves):  # nobody waits for the others
            first, count = bones.first_joint[bone], bones.joint_counts[bone]
            rest_frames[first : first + count] = bones.rest[bone]
            if count > 1:
                frames = bones.rest[bone] @ armatures.read_segments(armature, bone, rest=True)
                # A bone's rest matrix may be 5e-5 from orthonormal. Blender brings the axes of segments to length 1,
                # and those of bones without segments not.
                frames[:, :3, :3] /= np.linalg.norm(frames[:, :3, :3], axis=1, keepdims=True)
                rest_frames[first : first + count] = frames
    skin = sinew_native.Skin(rest, own.offsets, own.joints, own.weights, bones.joint_count + 1)
    how = {"method": "linear"}
    if settings.preserve_volume:
        how = {"method": "dual_quaternion", "stretch": STRETCH, "rest_frames": rest_frames}
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
        sinew_native.Layer(skin, mask=mask, share=share, **how),
        skin,
        own,
        bones,
        weights,
        rest,
        np.where(moves, bones.first_joint, -1).astype(np.int32),
        made_of,
        _bytes(mesh_from_armature),
        wanted,
        lacks,
        blank,
    )


def space_between(ob, armature):
    """(4, 4): from the armature's space to the mesh object's; None where they are one. Raises values.Flat."""
    values.refuse_flat(ob, armature)
    return sinew_native.host.space_between(*(np.array(each.matrix_world, np.float32) for each in (ob, armature)))


def _moving(own, bones):
    """(B,) bool: by which bones some vertex moves. own: its Influences."""
    has_weight = np.zeros(bones.joint_count + 1, bool)
    has_weight[own.joints[own.weights != 0]] = True
    moves = np.zeros(len(bones.names), bool)
    for bone in np.flatnonzero(bones.first_joint >= 0):
        first = bones.first_joint[bone]
        moves[bone] = has_weight[first : first + bones.joint_counts[bone]].any()
    return moves


def _share(mask, vertex_count):
    if mask is None:
        mask = np.ones(vertex_count)
    return mask if MASK_SHOWS_LATER else 1 - mask


def _bytes(matrix):
    return None if matrix is None else matrix.tobytes()
