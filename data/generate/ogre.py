"""Writes data/ogre: mesh.obj, mesh.mtl, skeleton.bf, weights.dmat, pose.dmat, walk.dmat.

Run: /usr/bin/python3 data/generate/ogre.py
"""

import os
import sys

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))  # Blender does not do it

import ogre_body
import ogre_motion
import ogre_parts
import ogre_skeleton
import ogre_weights
import rig_files
import surface_nets

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "ogre")
CELL = 0.0425  # metres between grid points where no zoom is
COLOURS = {
    "skin": (0.118, 0.140, 0.076),
    "mouth": (0.16, 0.035, 0.03),
    "eye": (0.75, 0.66, 0.40),
    "iris": (0.55, 0.20, 0.02),
    "pupil": (0.01, 0.01, 0.01),
    "tusk": (0.72, 0.62, 0.42),
    "nail": (0.23, 0.19, 0.12),
    "hair": (0.025, 0.02, 0.018),
    "cloth": (0.20, 0.115, 0.06),
    "leather": (0.085, 0.045, 0.025),
    "metal": (0.30, 0.27, 0.22),
}


def skin():
    """Vertices, quads, weights and a material for each quad."""
    vertices, quads = surface_nets.mesh_of(ogre_body.distance, *ogre_body.BOX, CELL, ogre_body.zooms(), rounds=4)
    weights = ogre_weights.skin_weights(vertices, quads)
    middle = vertices[quads].mean(axis=1)
    materials = np.where(ogre_body.in_mouth(middle), "mouth", "skin")
    return vertices, quads, weights, materials


def shell_weights(shell, skin_vertices, skin_rows):
    """Weights (V, B) of a part: its bone's, its neighbours on the skin, or a mix of both."""
    rigid = np.zeros((len(shell.vertices), len(ogre_skeleton.BONES)))
    if shell.bone:
        rigid[:, ogre_skeleton.COLUMN[shell.bone]] = 1
        if shell.blend is None:
            return rigid
    copied = skin_rows[ogre_weights.nearest_rows(shell.vertices, skin_vertices)]
    if not shell.bone:
        return copied
    share = shell.blend[:, None]
    return share * rigid + (1 - share) * copied


def assemble():
    """The whole mesh: vertices (V, 3), material -> faces, weights (V, B)."""
    vertices, quads, weights, materials = skin()
    groups = {name: [] for name in COLOURS}
    for material, quad in zip(materials, quads.tolist()):
        groups[material].append(quad)
    all_vertices, all_weights, count = [vertices], [weights], len(vertices)
    for shell in ogre_parts.all_parts():
        for material, face in zip(shell.materials, shell.faces):
            groups[material].append([count + index for index in face])
        all_vertices.append(shell.vertices)
        all_weights.append(shell_weights(shell, vertices, weights))
        count += len(shell.vertices)
    return np.vstack(all_vertices), groups, np.vstack(all_weights)


def main():
    """Writes the whole folder."""
    os.makedirs(FOLDER, exist_ok=True)
    vertices, groups, weights = assemble()
    poses, walk = ogre_motion.target_pose(), ogre_motion.walk()
    rows = ogre_skeleton.bf_rows()
    rig_files.write_mtl(os.path.join(FOLDER, "mesh.mtl"), COLOURS)
    rig_files.write_obj(os.path.join(FOLDER, "mesh.obj"), vertices, list(groups.items()), "Sinew ogre, CC0", "mesh.mtl")
    rig_files.write_bf(os.path.join(FOLDER, "skeleton.bf"), rows)
    rig_files.write_dmat(os.path.join(FOLDER, "weights.dmat"), rig_files.round_convex(weights))
    rig_files.write_eulers(os.path.join(FOLDER, "pose.dmat"), poses)
    rig_files.write_quaternions(os.path.join(FOLDER, "walk.dmat"), walk)
    print(
        f"ogre: {len(vertices)} vertices, {sum(map(len, groups.values()))} faces, "
        f"{len(rows)} joints, {len(ogre_skeleton.BONES)} bones"
    )


if __name__ == "__main__":
    main()
