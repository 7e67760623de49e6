"""Writes data/capsule: a tube with a chain of four joints, in the joint convention.

Linear blending visibly collapses on it (candy wrapper, pinched bend); dual quaternions do not.
Run: /usr/bin/python3 data/generate/capsule.py
"""

import os
import sys

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))  # Blender does not do it

import posing
import rig_files

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "capsule")
RADIUS = 0.25
STRAIGHT = 2.0  # length of the cylinder, metres; the capsule stands on y = 0
SIDES = 48
CAP_RINGS, SIDE_RINGS = 12, 60
JOINT_HEIGHTS = np.array([0.25, 0.85, 1.45, 2.05])
NAMES = ["base", "lower", "upper", "tip"]
POSES = 48


def profile():
    """Radius and height (rings, 2) in metres, from the lowest ring to the highest."""
    angles = np.linspace(0, np.pi / 2, CAP_RINGS + 1)[1:]
    cap = RADIUS * np.column_stack([np.sin(angles), -np.cos(angles)])
    heights = np.linspace(0, STRAIGHT, SIDE_RINGS + 1)[1:-1]
    side = np.column_stack([np.full(len(heights), RADIUS), heights])
    return np.vstack([cap, side, cap[::-1] * [1, -1] + [0, STRAIGHT]]) + [0, RADIUS]


def capsule_mesh():
    """vertices (V, 3) and faces: quads, with a fan of triangles at each pole."""
    rings = profile()
    turn = 2 * np.pi * np.arange(SIDES) / SIDES
    circle = np.column_stack([np.sin(turn), np.zeros(SIDES), np.cos(turn)])
    body = (rings[:, 0, None, None] * circle + rings[:, 1, None, None] * [0, 1, 0]).reshape(-1, 3)
    vertices = np.vstack([body, [0, 0, 0], [0, STRAIGHT + 2 * RADIUS, 0]])
    bottom, top = len(body), len(body) + 1
    faces = []
    for side in range(SIDES):
        following = (side + 1) % SIDES
        faces.append((bottom, following, side))
        for ring in range(len(rings) - 1):
            low, high = ring * SIDES, (ring + 1) * SIDES
            faces.append((low + side, low + following, high + following, high + side))
        last = (len(rings) - 1) * SIDES
        faces.append((last + side, last + following, top))
    return vertices, faces


def chain_weights(heights):
    """Weights (V, 4): quadratic B-splines over the chain, which are smooth and sum to one."""
    spacing = JOINT_HEIGHTS[1] - JOINT_HEIGHTS[0]
    # A joint carries what lies above it, so its weight is centred half a link higher.
    along = np.clip((heights - JOINT_HEIGHTS[0]) / spacing - 0.5, 0, len(NAMES) - 1)
    weights = np.zeros((len(heights), len(NAMES)))
    for knot in range(-1, len(NAMES) + 1):
        away = np.abs(along - knot)
        outer = np.clip(1.5 - away, 0, None) ** 2 / 2
        spline = np.where(away < 0.5, 0.75 - away**2, outer)
        weights[:, np.clip(knot, 0, len(NAMES) - 1)] += spline
    return weights


def target_pose():
    """Euler degrees (2, J, 3): rest, and a half turn about the long axis in the middle."""
    poses = np.zeros((2, len(NAMES), 3))
    poses[1, 2, 1] = 170
    return poses


def dance():
    """Quaternions (POSES, J, 4) of a looping dance: a bend travels up while the middle twists."""
    phase = 2 * np.pi * np.arange(POSES) / POSES
    poses = np.zeros((POSES, len(NAMES), 4))
    for joint in range(len(NAMES)):
        lag = phase - 0.9 * joint
        bend = (8, 28, 42, 38)[joint] * np.sin(lag)
        sway = (4, 14, 20, 24)[joint] * np.sin(2 * lag + 0.6)
        twist = (0, 30, 75, 40)[joint] * np.sin(phase - 0.5 * joint)
        turn = posing.multiply(posing.axis_quaternion([0, 0, 1], bend), posing.axis_quaternion([1, 0, 0], sway))
        poses[:, joint] = posing.multiply(turn, posing.axis_quaternion([0, 1, 0], twist))
    return posing.same_hemisphere(poses)


def main():
    """Writes the whole folder."""
    os.makedirs(FOLDER, exist_ok=True)
    vertices, faces = capsule_mesh()
    offsets = np.zeros((len(NAMES), 3))
    offsets[:, 1] = np.diff(JOINT_HEIGHTS, prepend=0)
    rows = [(j, j - 1, offsets[j], NAMES[j]) for j in range(len(NAMES))]
    weights = rig_files.round_convex(chain_weights(vertices[:, 1]))
    rig_files.write_obj(os.path.join(FOLDER, "mesh.obj"), vertices, [(None, faces)], "Sinew capsule, CC0")
    rig_files.write_bf(os.path.join(FOLDER, "skeleton.bf"), rows)
    rig_files.write_dmat(os.path.join(FOLDER, "weights.dmat"), weights)
    rig_files.write_eulers(os.path.join(FOLDER, "pose.dmat"), target_pose())
    rig_files.write_quaternions(os.path.join(FOLDER, "walk.dmat"), dance())
    print(f"capsule: {len(vertices)} vertices, {len(faces)} faces, {len(rows)} joints")


if __name__ == "__main__":
    main()
