"""The phases of a clip as meshes: of a character in the scene, or of a rig folder.

Letters: P phases, V vertices. The crowd's space has the world's axes and scale, and its origin on the ground below the
character.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np

from ..blender import meshes, values
from ..deform.clips import MatrixClip, RotationClip
from ..native import sinew_native
from ..rig_files import rig_import
from ..rig_files.file_options import ImportOptions
from . import stride


@dataclass
class Phases:
    """One cycle. shapes: for each mesh of the character [mesh of phase 0, ...], with positions in world space until
    `settle` is called."""

    name: str
    frames: float  # length of a cycle
    first: float  # frame of phase 0
    drift: np.ndarray  # (3,) how far the clip carries the character in a cycle
    shapes: list = field(default_factory=list)

    @property
    def count(self) -> int:
        return len(self.shapes[0])

    def remove(self) -> None:
        """Removes the meshes."""
        bpy.data.batch_remove([mesh for each in self.shapes for mesh in set(each)])

    def settle(self, seconds: float) -> tuple[np.ndarray, np.ndarray]:
        """Moves the meshes into the crowd's space, and gives them velocities, with which renderers blur moving limbs.
        seconds: length of a cycle. Returns the stride (3,) and the bounding box, lowest and highest corner (2, 3)."""
        away = np.arange(self.count)[:, None] / self.count * self.drift
        found = [[meshes.read_positions(mesh) - shift for mesh, shift in zip(each, away)] for each in self.shapes]
        is_even = all(len({len(positions) for positions in each}) == 1 for each in found)
        corners = np.array([[positions.min(0), positions.max(0)] for each in found for positions in each])
        least, most = corners[:, 0].min(0), corners[:, 1].max(0)
        origin = np.array([*(least + most)[:2] / 2, least[2]])
        for each, shapes in zip(found, self.shapes):
            for mesh, positions in zip(shapes, each):
                meshes.write_positions(mesh, (positions - origin).astype(np.float32))
            if is_even and self.count > 1:
                for mesh, velocity in zip(shapes, stride.velocities(np.array(each, np.float32), seconds)):
                    meshes.write_attribute(mesh, "velocity", velocity)
        walked = self.drift
        if not walked.any() and is_even:
            walked = stride.stride_of(np.concatenate(found, axis=1))
        return walked, np.array([least, most]) - origin


# --- of a character -------------------------------------------------------------------------------


def of_objects(
    context: bpy.types.Context,
    objects: Sequence[bpy.types.Object],
    name: str,
    first: float,
    last: float,
    count: int,
    shown: Any,
) -> Phases:
    """Returns the Phases of the objects' evaluated meshes on the frames first to last. If the last frame shows the
    same pose as the first, the cycle ends before it. count: number of phases; 0: one per frame. The caller has to
    restore the scene's frame. Raises ValueError."""
    start, end = (_all_positions(context, objects, frame) for frame in (first, last))
    if not len(start):
        raise ValueError(f"{name} has no vertices")
    drift = stride.drift_of(start, end) if len(start) == len(end) else np.zeros(3)
    is_closed = len(start) == len(end) and stride.closes(start, end - np.float32(drift))
    frames = last - first if is_closed and last > first else last - first + 1
    if last > first:
        drift *= frames / (last - first)
    phases = Phases(name, frames, first, drift, [[] for _ in objects])
    count = count or round(frames)
    try:
        for number in range(count):
            shown.step(number / count, f"shape {number + 1} of {count}")
            depsgraph = _evaluate(context, first + number * frames / count)
            for ob, shapes in zip(objects, phases.shapes):
                shapes.append(_mesh_of(ob, depsgraph, shapes[0] if shapes else None))
    except BaseException:
        phases.remove()
        raise
    return phases


def _evaluate(context, frame):
    context.scene.frame_set(int(np.floor(frame)), subframe=float(frame - np.floor(frame)))
    return context.evaluated_depsgraph_get()


def _all_positions(context, objects, frame):
    depsgraph = _evaluate(context, frame)
    found = []
    for ob in objects:
        evaluated = ob.evaluated_get(depsgraph)
        found.append(_in_world(meshes.read_evaluated(evaluated), evaluated))
    return np.concatenate(found)


def _in_world(positions, evaluated):
    matrix = values.matrix_to_numpy(evaluated.matrix_world)
    return (positions @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32)


def _mesh_of(ob, depsgraph, template):
    """Makes a new mesh in world space. template: the mesh of another moment, which is copied for its faces and layers
    if the counts are the same, or None."""
    evaluated = ob.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    try:
        is_alike = template is not None and _counts(mesh) == _counts(template)
        positions = _in_world(meshes.read_positions(mesh), evaluated)
    finally:
        evaluated.to_mesh_clear()
    mesh = template.copy() if is_alike else bpy.data.meshes.new_from_object(evaluated, depsgraph=depsgraph)
    mesh.name = ob.name
    meshes.write_positions(mesh, positions)
    return mesh


def _counts(mesh):
    return len(mesh.vertices), len(mesh.edges), len(mesh.loops), len(mesh.polygons)


# --- of a rig folder ------------------------------------------------------------------------------


def of_rig(path: str, options: ImportOptions, count: int) -> Phases:
    """Returns the Phases of a rig folder's poses, one pose per frame, by linear skinning in one native call. path: of
    its skeleton; options: how it is imported; count: number of phases; 0: one per pose. Raises ValueError or
    OSError."""
    folder, skeleton_name = os.path.split(os.path.abspath(path))
    rig = rig_import.read_rig(folder, skeleton_name, options)
    clip = _clip_of(rig, options)
    if clip is None:
        raise ValueError(f"{folder} has no poses: name their file, or put one beside {skeleton_name}")
    name = os.path.basename(folder) or "rig"
    frames = clip.length - 1 if _is_closed(clip) else clip.length
    count = count or frames
    skinned = _skin(rig, [clip.at(number * frames / count, True).skinning.copy() for number in range(count)])
    to_world = (options.scale * rig_import.orientation(options.up_axis)[:3, :3]).astype(np.float32)
    return Phases(name, frames, 1.0, np.zeros(3), [_meshes_of(rig, name, folder, skinned @ to_world.T)])


def _clip_of(rig, options):
    skeleton = rig.skeleton
    if rig.poses is not None:
        return RotationClip(skeleton, rig.poses, np.tile(np.eye(3), (skeleton.joint_count, 1, 1)))
    if rig.animation is not None:
        return MatrixClip(
            np.array(skeleton.parents), np.array(rig.animation), np.tile(np.eye(4), (skeleton.joint_count, 1, 1))
        )
    return None


def _is_closed(clip):
    """Whether the last pose is the same as the first."""
    first, last = clip.at(0, False).skinning.copy(), clip.at(clip.length - 1, False).skinning
    return clip.length > 1 and np.abs(first - last).max() < 1e-3 * max(1.0, np.abs(first).max())


def _skin(rig, motions):
    """Returns the skinned positions, (P, V, 3) float32, in the space of the rig."""
    columns = np.array(rig.skeleton.weight_columns)
    weights = np.zeros((len(rig.positions), len(columns)))
    weights[:, columns >= 0] = np.array(rig.weights)[:, columns[columns >= 0]]
    skin = sinew_native.Skin.from_dense(rig.positions, weights)
    out = np.empty((len(motions), len(rig.positions), 3), np.float32)
    sinew_native.skin_all([(skin, motion, each, "linear") for motion, each in zip(motions, out)])
    return out


def _meshes_of(rig, name, folder, positions):
    template = meshes.new_mesh(name, rig.positions, rig.face_offsets, rig.face_vertices)
    colors = rig_import.read_colors(os.path.join(folder, rig.material_library))
    rig_import.assign_materials(template, rig, colors, [])
    found = [template, *(template.copy() for _ in positions[1:])]
    for mesh, each in zip(found, positions):
        meshes.write_positions(mesh, each)
    return found
