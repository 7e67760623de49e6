"""A picture of the test poses of some meshes: one tile for each bone, colored by how far edges are stretched."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..blender import bounds
from . import checking, pictures, pose_checks

TILE, COLUMNS = 200, 8  # pixels; tiles in a row
_TEXT = 13  # pixels: the height of a name
_WIDTH = 2.4  # of the part that bends, or
_LEAST = 0.12  # of the mesh's size, if that is more: what a tile shows
_VIEW = np.array([-0.45, -1.0, 0.35])  # where the view comes from, in the world
_PLAIN, _STRETCHED = np.array([0.75, 0.78, 0.82]), np.array([0.9, 0.15, 0.1])


def write(path: Path, objects: Sequence[bpy.types.Object], degrees: float = pose_checks.ANGLE) -> int:
    """Writes the picture as a PNG. Returns the number of tiles. Raises OSError, and ValueError if no bone bends
    anything."""
    tiles = []
    for ob in objects:
        own = checking.read(ob)
        for pose in pose_checks.check(own.mesh, own.bones, degrees):
            text = f"{own.rest.names[pose.bone]}  {pose.stretch:.1f}"
            tiles.append(_tile(own.mesh, own.bones, pose, degrees, text))
    if not tiles:
        raise ValueError("no bone bends a mesh: there is nothing to draw; make the weights first")
    pictures.write_png(path, pictures.side_by_side(tiles, min(COLUMNS, len(tiles))))
    return len(tiles)


def _tile(mesh: Any, bones: Any, pose: pose_checks.TestPose, degrees: float, text: str) -> np.ndarray:
    share = pose_checks.shares(mesh, bones, pose.bone)
    axis = bones.axes[pose.bone, "XYZ".index(pose.axis)]
    posed = pose_checks.bent(mesh.positions, share, bones.heads[pose.bone], axis, degrees)
    bends = (share > 0.01) & (share < 0.99)
    part = posed[bends] if bends.any() else posed
    size = bounds.diagonal(mesh.positions)
    width = max(_WIDTH * bounds.diagonal(part) / np.sqrt(3), _LEAST * size, 1e-30)
    z = -_VIEW / np.linalg.norm(_VIEW)
    x = np.cross(z, (0, 0, 1))
    x /= np.linalg.norm(x)
    view = np.array([x, np.cross(x, z), z])
    middle = (part.min(axis=0) + part.max(axis=0)) / 2
    points = (posed - middle) @ view.T * (TILE / width) + (TILE / 2, TILE / 2, 0)
    amount = np.clip((pose_checks.stretches(mesh, posed) - 1) / (pose_checks.STRETCHED - 1), 0, 1)[:, None]
    picture = pictures.Picture(TILE)
    picture.draw(points, mesh.triangles, (1 - amount) * _PLAIN + amount * _STRETCHED)
    letters, faces = _letters(text)
    if len(faces):
        near = points[:, 2].min() - 1
        picture.draw(letters * _TEXT + (6, 6, near), faces, np.zeros((len(letters), 3)))
    return picture.pixels()


def _letters(text: str) -> tuple[np.ndarray, np.ndarray]:
    """Returns points (V, 3) and triangles (T, 3) of a line of text, 1 high, in Blender's own font."""
    curve = bpy.data.curves.new("Sinew", "FONT")
    ob = bpy.data.objects.new("Sinew", curve)
    try:
        curve.body, curve.resolution_u = text, 2
        mesh = ob.to_mesh()
        mesh.calc_loop_triangles()
        points = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", points)
        triangles = np.empty(3 * len(mesh.loop_triangles), np.int32)
        mesh.loop_triangles.foreach_get("vertices", triangles)
        ob.to_mesh_clear()
    finally:
        bpy.data.objects.remove(ob)
        bpy.data.curves.remove(curve)
    return points.reshape(-1, 3).astype(float), triangles.reshape(-1, 3)
