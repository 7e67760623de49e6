"""One armature's say in a bound mesh: a deformer made from the .blend, and the motions of its joints.

Ordinarily a mesh has one layer. It has more where Multi Modifier mixes the results of several Armature
modifiers.
"""

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from . import blender_io
from .deform import Deformer, transformed
from .influences import Bones, Rules, group_weights, influences

# How Blender itself treats scaled bones when it preserves volume, ...
STRETCH = "frame_each" if blender_io.VERSION >= (4, 0, 0) else "frame"
# ... and whether Multi Modifier's mask shows what comes later in the stack.
MASK_SHOWS_LATER = blender_io.VERSION >= (4, 0, 0)


@dataclass
class Layer:
    """`deformer` is None until it is first needed and after an edit."""

    deformer: Deformer | None = None
    share: np.ndarray | None = None  # (V, 1): of a layer that is mixed in, its part in the result
    bones: Bones | None = None
    matrices: np.ndarray | None = None  # (J + 1, 4, 4) float32, what the deformer takes
    positions: np.ndarray | None = None  # (V, 3) float32, what it writes if nothing better is there
    _channels: np.ndarray | None = None  # (16 B,): the bones' motions as Blender hands them over
    _made_of: tuple = ()  # settings that can change without an edit being seen
    _signature: tuple = ()  # of the bones
    _space: bytes | None = None  # from armature to mesh, when the deformer was made
    making_milliseconds: float = 0.0  # what making the deformer took in the last `prepare`

    def prepare(self, ob, settings, evaluated, evaluated_armature, clip_pose, mixed, rest, captured):
        """Brings deformer and matrices to this frame. clip_pose: (B, 4, 4) instead of the armature's
        own pose, or None. rest: a function that gives the mesh's rest positions; captured: whether they
        may differ from frame to frame. Returns what leads from the armature's space to the mesh's, (4, 4),
        or None if they are one."""
        armature = settings.armature
        mesh_from_armature = _between(evaluated, evaluated_armature)
        made_of = (settings.method, settings.use_vertex_groups, settings.use_envelopes,
                   settings.mask_group, settings.mask_invert, len(ob.data.vertices),
                   blender_io.key_of(armature.data))
        self.making_milliseconds = 0.0
        if self.deformer is None or made_of != self._made_of or not self._holds(
                mesh_from_armature, rest, captured):
            start = perf_counter()
            self._make(ob, settings, evaluated_armature, mesh_from_armature, mixed, rest())
            self._made_of = made_of
            self.making_milliseconds = 1e3 * (perf_counter() - start)
        if armature.data.pose_position == "REST" or armature.mode == "EDIT":
            self.matrices[:] = np.eye(4)
        else:
            self._read_joints(evaluated_armature, clip_pose)
        return mesh_from_armature

    def bones_edited(self, armature):
        """Drops the deformer if the bones are no longer those that it was made for (posing tags an
        armature's data as well as an edit does). Returns {old: new name} of bones that were renamed: they
        are where they were."""
        if self.bones is None or self.deformer is None:
            return {}
        if blender_io.bone_signature(armature) == self._signature:
            return {}
        self.deformer = None
        before, after = self.bones, Bones(**blender_io.read_bones(armature))
        if not np.array_equal(before.rest, after.rest):
            return {}
        return {old: new for old, new in zip(before.names, after.names)
                if old != new and old not in after.names and new not in before.names}

    def _holds(self, mesh_from_armature, rest, captured):
        """Whether the influences are right for this frame's shape and place; gives the deformer the
        shape."""
        hangs_on_shape = self.deformer.influences.hang_on_shape
        if hangs_on_shape and self._space != _bytes(mesh_from_armature):
            return False
        if not captured:
            return True
        positions = rest()
        if self.deformer.has_rest(positions):
            return True
        if not hangs_on_shape:
            self.deformer.set_rest(positions)
        return not hangs_on_shape

    def _make(self, ob, settings, armature, mesh_from_armature, mixed, rest):
        bones = self.bones = Bones(**blender_io.read_bones(armature))
        self._signature = blender_io.bone_signature(armature)
        self._space = _bytes(mesh_from_armature)
        offsets, groups, weights = blender_io.read_weights(ob)
        index = {name: i for i, name in enumerate(bones.names)}
        bone_of_group = np.array(
            [index.get(group.name, -1) for group in ob.vertex_groups] + [-1], np.int32)
        mask, group = None, ob.vertex_groups.get(settings.mask_group)
        if group is not None:
            mask = group_weights(offsets, groups, weights, group.index)
            mask = 1 - mask if settings.mask_invert else mask
        if mixed:
            self.share, mask = _share(mask, len(rest)), None
        linear = settings.method == "LINEAR"
        rules = Rules(settings.use_vertex_groups, settings.use_envelopes, mask if linear else None)
        inverse = None if mesh_from_armature is None else np.linalg.inv(mesh_from_armature)
        own = influences(offsets, bone_of_group[groups], weights, bones, rules,
                         transformed(inverse, rest.astype(np.float64)),
                         lambda bone, point: blender_io.segment_at(armature, bone, point))
        rest_frames = np.tile(np.eye(4), (bones.joint_count + 1, 1, 1))
        rest_frames[bones.first_joint] = bones.rest
        for bone in bones.bent:
            first, count = bones.first_joint[bone], bones.segments[bone] + 1
            rest_frames[first:first + count] = bones.rest[bone] @ blender_io.read_segments(
                armature, bone, rest=True)
        self.deformer = Deformer(rest, own, rest_frames, STRETCH, None if linear else mask)
        # Columns, as Blender stores them: the motions of ordinary bones can be read in place.
        numbers = np.tile(np.eye(4, dtype=np.float32).reshape(-1), bones.joint_count + 1)
        self.matrices = numbers.reshape(-1, 4, 4).transpose(0, 2, 1)
        self._channels = numbers[:-16] if len(bones.bent) == 0 else np.empty(
            16 * len(bones.names), np.float32)
        self.positions = np.empty((len(rest), 3), np.float32)

    def _read_joints(self, armature, clip_pose):
        """The bones' motions into the matrices, those of B-bones spread over their joints."""
        bones = self.bones
        in_place = clip_pose is None and len(bones.bent) == 0
        if clip_pose is None:
            clip_pose = blender_io.read_channels(armature, self._channels)
        if not in_place:
            self.matrices[bones.first_joint] = clip_pose
        for bone in bones.bent:
            first, count = bones.first_joint[bone], bones.segments[bone] + 1
            posed = (blender_io.read_bone_matrix(armature, bone)
                     @ blender_io.read_segments(armature, bone))
            self.matrices[first:first + count] = posed @ np.linalg.inv(
                self.deformer.rest_frames[first:first + count])


# A mesh's `parts`: (layer, its method, what leads from its armature's space to the mesh's), in the order in which
# they are mixed.

def jobs_of(parts, shape):
    """What `sinew_native.skin_all` is to do for a mesh; `finish` comes after it. shape (V, 3) float32: where the
    first layer's result goes."""
    return [layer.deformer.job(method, layer.matrices, change, _own(layer, number, shape))
            for number, (layer, method, change) in enumerate(parts)]


def finish(parts, shape):
    """Mixes the layers' results, in place."""
    for number, (layer, _method, change) in enumerate(parts):
        own = _own(layer, number, shape)
        layer.deformer.finish(own, change)
        if layer.share is not None:
            shape += layer.share * (own - shape)


def _own(layer, number, shape):
    return layer.positions if number else shape


def _share(mask, vertex_count):
    if mask is None:
        mask = np.ones(vertex_count)
    return (mask if MASK_SHOWS_LATER else 1 - mask)[:, None].astype(np.float32)


def _between(mesh_object, armature):
    if mesh_object.matrix_world == armature.matrix_world:
        return None
    return blender_io.relative_matrix(mesh_object, armature)


def _bytes(matrix):
    return None if matrix is None else matrix.tobytes()
