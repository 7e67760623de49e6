"""Samples the shapes of meshes, and the motions of a rig's bones, over a range of frames."""

from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ..bake import evaluation, skinned_mesh
from ..bake.frame_range import FrameRange
from ..blender import armatures, values
from ..weights import solid
from .joints import Joints

SHORTEST_BONE = 1e-5  # Blender removes bones that are shorter than a tenth of it


@dataclass(frozen=True)
class Clip:
    """Several meshes in motion, one after the other. Positions are in world space, relative to `origin`."""

    origin: np.ndarray  # (3,), where the new armature will be
    rest: np.ndarray  # (V, 3) float32
    frames: np.ndarray  # (F, V, 3) float32
    face_offsets: np.ndarray  # (faces + 1,) int32
    face_vertices: np.ndarray  # (C,) int32
    starts: np.ndarray  # (objects + 1,): the first vertex of each object
    joints: Joints | None  # the rig's deforming bones
    motions: np.ndarray | None  # (F, J, 4, 4): what moves them from rest, in the space of the positions


def sample(
    context: bpy.types.Context, objects: Sequence[bpy.types.Object], rig: Any, frames: FrameRange
) -> Generator[tuple[float, str], None, Clip]:
    """Yields (share done, what comes next), and returns a Clip. rig: an armature, or None. The frame changes. Raises
    ValueError if a mesh has no vertices, not the same number on all frames, or a position that is not finite."""
    context.scene.frame_set(frames.first)
    graph = context.evaluated_depsgraph_get()
    places = [values.matrix_to_numpy(ob.evaluated_get(graph).matrix_world) for ob in objects]
    origin = places[0][:3, 3].copy()
    faces, counts = zip(*(evaluation.read_topology(ob, graph) for ob in objects))
    for ob, count in zip(objects, counts):
        if not count:
            raise ValueError(f"{ob.name} has no vertices: select a mesh that has some")
    starts = np.concatenate(([0], np.cumsum(counts)))
    try:
        shapes = np.empty((len(frames), starts[-1], 3), np.float32)
    except MemoryError as error:
        raise ValueError(
            f"there is not enough memory for {starts[-1]:,} vertices on {len(frames):,} frames: bake fewer frames"
        ) from error
    motions = []
    for number, frame in enumerate(frames):
        yield number / len(frames), f"sampling frame {frame}"
        context.scene.frame_set(frame)
        graph = context.evaluated_depsgraph_get()
        for ob, first, last in zip(objects, starts, starts[1:]):
            own, world = evaluation.read(ob, graph)
            evaluation.check_count(ob, frame, len(own), int(last - first))
            shapes[number, first:last] = placed(own, world, origin)
            refuse_infinite(ob, shapes[number, first:last], f" on frame {frame}")
        if rig is not None:
            motions.append(_pose(rig, graph))
    rest = _rest(context, objects, rig, frames.first, places, counts, origin)
    offsets, corners = _joined(faces, starts)
    if rig is None:
        return Clip(origin, rest, shapes, offsets, corners, starts, None, None)
    poses = np.array(motions)
    found = _motions(rig, poses, origin)
    return Clip(origin, rest, shapes, offsets, corners, starts, _read_joints(rig, poses[0, -1], origin), found)


def placed(positions: np.ndarray, world: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Returns positions (V, 3) of an object's space in world space, relative to origin (3,)."""
    return positions.astype(np.float64) @ world[:3, :3].T + (world[:3, 3] - origin)


def refuse_infinite(ob: bpy.types.Object, positions: np.ndarray, when: str) -> None:
    """Raises ValueError if a position (V, 3) is not finite. when: for the message, such as " on frame 3"."""
    is_finite = np.isfinite(positions).all(axis=1)
    if not is_finite.all():
        raise ValueError(
            f"Vertex {np.flatnonzero(~is_finite)[0]} of {ob.name} is not at a finite position (NaN or infinite){when}: "
            "delete it, mend what moves it, or choose other frames"
        )


def _joined(faces, starts):
    """Returns the faces of several meshes as those of one."""
    offsets, corners, corner_count = [np.zeros(1, np.int32)], [], 0
    for (own_offsets, own_corners), first in zip(faces, starts):
        offsets.append(own_offsets[1:] + corner_count)
        corners.append(own_corners + first)
        corner_count += len(own_corners)
    return np.concatenate(offsets).astype(np.int32), np.concatenate(corners).astype(np.int32)


# --- rest -----------------------------------------------------------------------------------------


def _rest(context, objects, rig, first, places, counts, origin):
    """Returns (V, 3) float32: each mesh's own vertices, where it is on the first frame. If modifiers make other ones,
    its shape on that frame, with the rig, if there is one, at rest."""
    found = [solid.rest_positions(ob.data) for ob in objects]
    others = [i for i, count in enumerate(counts) if len(found[i]) != count]
    if others:
        with _at_rest(rig):
            context.scene.frame_set(first)
            graph = context.evaluated_depsgraph_get()
            for i in others:
                found[i] = evaluation.read(objects[i], graph)[0]
                evaluation.check_count(objects[i], first, len(found[i]), counts[i])
    for i, world in enumerate(places):
        found[i] = placed(found[i], world, origin)
        refuse_infinite(objects[i], found[i], " at rest")
    return np.concatenate(found).astype(np.float32)


@contextmanager
def _at_rest(rig) -> Iterator[None]:
    if rig is None:
        yield
        return
    kept = rig.data.pose_position
    try:
        rig.data.pose_position = "REST"
        yield
    finally:
        rig.data.pose_position = kept


# --- the rig --------------------------------------------------------------------------------------


def deforming(rig: bpy.types.Object) -> np.ndarray:
    """Returns (J,): the numbers of the deforming bones among the pose bones, parents first."""
    return np.flatnonzero([bone.bone.use_deform for bone in rig.pose.bones])


def _read_joints(rig, world, origin):
    """Returns a rig's deforming bones at rest, in world space, relative to origin (3,). Their parents are the nearest
    ancestors that deform. world: (4, 4), the rig's place."""
    bones = [rig.pose.bones[int(number)].bone for number in deforming(rig)]
    number = {bone.name: j for j, bone in enumerate(bones)}
    parents = []
    for bone in bones:
        parent = bone.parent
        while parent is not None and parent.name not in number:
            parent = parent.parent
        parents.append(-1 if parent is None else number[parent.name])
    world = world.copy()
    world[:3, 3] -= origin
    rest = np.array([skinned_mesh.rigid(world @ values.matrix_to_numpy(bone.matrix_local)) for bone in bones])
    size = abs(np.linalg.det(world[:3, :3])) ** (1 / 3)
    lengths = np.maximum(SHORTEST_BONE, [size * bone.length for bone in bones])
    return Joints(tuple(bone.name for bone in bones), np.array(parents), rest, lengths)


def _pose(rig, graph):
    """Returns (J + 1, 4, 4): the motions of the deforming bones in the rig's space, and the rig's place."""
    evaluated = rig.evaluated_get(graph)
    channels = armatures.read_channels(evaluated)[deforming(rig)]
    return np.concatenate((channels, values.matrix_to_numpy(evaluated.matrix_world)[None]))


def _motions(rig, poses, origin):
    """Returns (F, J, 4, 4): the motions of the bones from where they are at rest with the rig's first place."""
    if not np.isfinite(poses).all():
        raise ValueError(f"a bone of {rig.name} is not at a finite place (NaN or infinite): mend what moves it")
    world = poses[:, -1:]
    if np.linalg.det(world[0, 0, :3, :3]) == 0:
        raise values.Flat(f"{rig.name} has a scale of 0 along an axis; set another scale")
    shift = np.eye(4)
    shift[:3, 3] = origin
    return np.linalg.inv(shift) @ world @ poses[:, :-1] @ np.linalg.inv(world[0, 0]) @ shift
