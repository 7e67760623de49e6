"""Checks data/ogre and data/capsule; exits non-zero when something is wrong.

Run: /usr/bin/python3 data/generate/check.py
"""

import os
import sys

import numpy as np
import rig_files

DATA = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")
LARGEST_FOLDER = 9_000_000  # bytes, both rigs together


class Report:
    """Collects what failed."""

    def __init__(self):
        self.failures = []

    def expect(self, condition, sentence):
        """Notes the sentence when the condition does not hold."""
        if not condition:
            self.failures.append(sentence)


def check_mesh(report, name, vertices, faces):
    """Closed, manifold, every vertex used, no degenerate or duplicate face."""
    report.expect(np.isfinite(vertices).all(), f"{name}: a vertex is not finite")
    used = np.unique(np.concatenate([np.array(face) for _, face in faces]))
    report.expect(
        len(used) == len(vertices) and used[-1] == len(vertices) - 1,
        f"{name}: {len(vertices) - len(used)} vertices are in no face",
    )
    report.expect(all(len(set(face)) == len(face) for _, face in faces), f"{name}: degenerate face")
    report.expect(len({tuple(sorted(face)) for _, face in faces}) == len(faces), f"{name}: duplicate face")
    directed = np.array([(a, b) for _, face in faces for a, b in zip(face, face[1:] + face[:1])])
    keys = directed[:, 0] * len(vertices) + directed[:, 1]
    backward = directed[:, 1] * len(vertices) + directed[:, 0]
    report.expect(len(np.unique(keys)) == len(keys), f"{name}: an edge is used twice the same way")
    report.expect(np.isin(backward, keys).all(), f"{name}: the mesh is open")
    report.expect(len(np.unique(vertices, axis=0)) == len(vertices), f"{name}: two vertices in one place")
    corners = [(face[0], b, c) for _, face in faces for b, c in zip(face[1:], face[2:])]
    a, b, c = (vertices[list(column)] for column in zip(*corners))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    report.expect(volume > 0, f"{name}: faces look inward")
    report.expect(area.min() > 0, f"{name}: a face without area")


def check_skeleton(report, name, weight_index, parents, names):
    """Parents before children, weight indices each once, one name each."""
    report.expect(
        (parents < np.arange(len(parents))).all() and parents[0] == -1, f"{name}: a parent comes after its child"
    )
    carried = np.sort(weight_index[weight_index >= 0])
    report.expect((carried == np.arange(len(carried))).all(), f"{name}: weight indices have gaps")
    report.expect(len(set(names)) == len(names), f"{name}: two joints of one name")


def check_weights(report, name, weights, vertex_count, columns):
    """Convex rows, few influences."""
    report.expect(
        weights.shape == (vertex_count, columns), f"{name}: weights are {weights.shape}, not {(vertex_count, columns)}"
    )
    report.expect(np.isfinite(weights).all() and weights.min() >= 0, f"{name}: a weight below 0")
    report.expect(np.abs(weights.sum(axis=1) - 1).max() < 1e-6, f"{name}: a row does not sum to 1")
    report.expect((weights > 0).sum(axis=1).max() <= 8, f"{name}: more than 8 influences")
    report.expect((weights.max(axis=0) > 0.5).all(), f"{name}: a bone that leads nowhere")


def check_poses(report, name, pose, walk, joints):
    """Target pose from rest; a clip of unit quaternions without jumps that ends as it starts."""
    report.expect(
        pose.shape == (3 * joints, 2) and not pose[:, 0].any() and pose[:, 1].any(),
        f"{name}: pose.dmat is not rest and a target",
    )
    report.expect(walk.shape[0] == 4 * joints and walk.shape[1] >= 24, f"{name}: walk too short")
    clip = walk.T.reshape(walk.shape[1], -1, 4)
    report.expect(np.abs(np.linalg.norm(clip, axis=-1) - 1).max() < 1e-6, f"{name}: a quaternion is not unit")
    steps = np.abs((clip * np.roll(clip, -1, axis=0)).sum(axis=-1)).min(axis=1)
    report.expect(steps[-1] > 0.5 * (steps[:-1].min() + 1) - 0.02, f"{name}: the loop jumps")
    report.expect(2 * np.degrees(np.arccos(min(steps.min(), 1))) < 25, f"{name}: a joint jumps")
    return clip


def check_folder(report, name):
    """One rig folder; prints a line about it and returns its size in bytes."""
    folder = os.path.join(DATA, name)
    vertices, faces = rig_files.read_obj(os.path.join(folder, "mesh.obj"))
    weight_index, parents, offsets, names = rig_files.read_bf(os.path.join(folder, "skeleton.bf"))
    weights, pose, walk = (
        rig_files.read_dmat(os.path.join(folder, f"{stem}.dmat")) for stem in ("weights", "pose", "walk")
    )
    check_mesh(report, name, vertices, faces)
    check_skeleton(report, name, weight_index, parents, names)
    columns = int((weight_index >= 0).sum())
    check_weights(report, name, weights, len(vertices), columns)
    clip = check_poses(report, name, pose, walk, len(parents))
    if name == "ogre":
        check_ogre(report, folder, vertices, faces, columns)
    else:
        report.expect(weight_index[0] == 0, "capsule: not in the joint convention")
    size = sum(entry.stat().st_size for entry in os.scandir(folder))
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    print(
        f"{name}: {len(vertices)} vertices, {len(faces)} faces "
        f"({np.mean([len(face) == 4 for _, face in faces]):.1%} quads), {len(parents)} joints, "
        f"{columns} weight columns, {(weights > 0).sum() / len(weights):.2f} influences a vertex "
        f"(at most {(weights > 0).sum(axis=1).max()}), {len(clip)} walk poses, "
        f"{size / 1e6:.2f} MB, box {np.round(low, 2)} to {np.round(high, 2)}"
    )
    return size


def check_ogre(report, folder, vertices, faces, columns):
    """What is promised of the ogre alone."""
    report.expect(25000 <= len(vertices) <= 35000, "ogre: not 25,000 to 35,000 vertices")
    report.expect(columns >= 22, "ogre: fewer than 22 bones")
    report.expect(abs(vertices[:, 1].min()) < 0.02, "ogre: does not stand on y = 0")
    with open(os.path.join(folder, "mesh.mtl"), encoding="ascii") as file:
        known = {line.split()[1] for line in file if line.startswith("newmtl")}
    report.expect({material for material, _ in faces} == known, "ogre: materials do not match")


def main():
    """Checks everything and sets the exit code."""
    report = Report()
    size = sum(check_folder(report, name) for name in ("ogre", "capsule"))
    report.expect(size < LARGEST_FOLDER, f"the rigs take {size} bytes")
    for sentence in report.failures:
        print("FAIL", sentence)
    print("all good" if not report.failures else f"{len(report.failures)} failures")
    sys.exit(bool(report.failures))


if __name__ == "__main__":
    main()
