"""The ogre's skin as one signed distance: what a sculptor would do with clay, in numbers.

All lengths in metres, in file space. Only the left half is written down: points are folded on
to it. Tags are the weight columns of the bones, so that each lump of clay knows its bone.
"""
import numpy as np

import sculpt
from ogre_skeleton import (ANKLE, BALL, COLUMN, ELBOW, FINGER_POINTS, FINGERS, HAND_ALONG,
                           HAND_BACK, HAND_THUMB, HIP, KNEE, SHOULDER, TOES, WRIST, hand_point)
from sculpt import Sculpt, smooth_max, smooth_min
from surface_nets import Zoom, unwarp

BOX = (np.array([-1.72, -0.06, -0.60]), np.array([1.72, 2.50, 0.80]))
EYE = np.array([0.070, 2.118, 0.402])
EYE_RADIUS = 0.029
TOE_ROOTS = [(0.272, 0.050, 0.165), (0.330, 0.047, 0.185), (0.383, 0.043, 0.175), (0.428, 0.039, 0.150)]
TOE_TIPS = [(0.278, 0.040, 0.290), (0.352, 0.034, 0.288), (0.416, 0.031, 0.262), (0.468, 0.028, 0.222)]
TOE_RADII = [0.046, 0.036, 0.033, 0.030]
MOUTH_CORNER = 0.118        # half the width of the mouth


def zooms():
    """Where the mesh is finer than on the belly."""
    hand = hand_point(0.2, 0.02, 0)
    foot = np.array([0.36, 0.05, 0.17])
    wanted = [(foot * [-1, 1, 1], 0.16, 1.35, 0.2), (foot, 0.16, 1.35, 0.2),
              (hand * [-1, 1, 1], 0.19, 1.55, 0.2), (hand, 0.19, 1.55, 0.2),
              (np.array([0, 2.05, 0.36]), 0.19, 2.3, 0.25)]
    chain = []
    # The last zoom of the chain is the nearest to the world; the centres of those before it
    # have to be given in the space that it starts from.
    for centre, radius, factor, fade in reversed(wanted):
        chain.insert(0, Zoom(unwarp(np.atleast_2d(centre), chain)[0], radius, factor, fade))
    return chain


def fold(points):
    """Points on the left half; rounded at the middle plane, so that no crease appears there."""
    folded = points.copy()
    folded[:, 0] = np.sqrt(points[:, 0] ** 2 + 0.006 ** 2)
    return folded


def mouth_line(x):
    """Height of the slit between the lips at |x|: the corners hang."""
    return 1.982 - 2.3 * x * x


def add_torso(body):
    """Pelvis, belly, chest, hump."""
    pelvis, spine, chest = COLUMN["pelvis"], COLUMN["spine"], COLUMN["chest"]
    body.ball((0, 0.96, -0.03), (0.32, 0.19, 0.24), 0.05, pelvis)
    body.ball((0.135, 0.90, -0.17), (0.17, 0.17, 0.15), 0.06, pelvis)
    body.ball((0, 1.20, 0.10), (0.415, 0.30, 0.375), 0.10, spine)
    body.ball((0, 1.10, 0.19), (0.33, 0.20, 0.31), 0.10, spine)
    body.cone((0.27, 1.10, -0.06), 0.16, (0.30, 1.34, -0.10), 0.15, 0.10, spine)
    body.ball((0, 1.60, -0.03), (0.40, 0.34, 0.27), 0.12, chest)
    body.cone((0.34, 1.66, -0.12), 0.17, (0.27, 1.36, -0.12), 0.13, 0.08, chest)
    pec = sculpt.frame_along((0.35, -0.28, 1.0), (0.1, 1, 0.2))
    body.ball((0.195, 1.655, 0.185), (0.205, 0.145, 0.095), 0.035, chest, pec)
    body.ball((0, 1.84, -0.19), (0.34, 0.22, 0.19), 0.10, chest)
    body.carve_cone((0, 1.40, -0.385), 0.02, (0, 1.75, -0.42), 0.03, 0.08)
    body.carve_ball((0, 1.16, 0.512), (0.026, 0.020, 0.05), 0.025)


def add_shoulders(body):
    """Trapezius and neck."""
    clavicle, neck = COLUMN["clavicle.L"], COLUMN["neck"]
    body.cone((0.06, 1.98, 0.02), 0.12, (0.40, 1.87, -0.08), 0.125, 0.08, clavicle)
    body.cone((0, 1.80, -0.02), 0.19, (0, 2.02, 0.17), 0.145, 0.07, neck)
    body.cone((0.13, 2.03, 0.20), 0.045, (0.05, 1.76, 0.16), 0.04, 0.05, neck)


def add_arm(body):
    """Shoulder, upper arm, forearm."""
    upper, fore, clavicle = COLUMN["upper_arm.L"], COLUMN["forearm.L"], COLUMN["clavicle.L"]
    along = (ELBOW - SHOULDER) / np.linalg.norm(ELBOW - SHOULDER)
    out = np.array([0.66, 0.75, 0])
    body.ball(SHOULDER + (-0.02, 0.0, 0.0), (0.19, 0.17, 0.20), 0.08, clavicle)
    deltoid = sculpt.frame_along(along, out)
    body.ball(SHOULDER + 0.12 * along + 0.035 * out, (0.165, 0.125, 0.24), 0.05, upper, deltoid)
    body.cone(SHOULDER, 0.155, ELBOW, 0.112, 0.05, upper)
    body.ball(SHOULDER + 0.33 * along + (0.0, -0.01, 0.065), (0.085, 0.085, 0.17), 0.04, upper,
              deltoid)
    body.ball(SHOULDER + 0.30 * along + (-0.01, -0.02, -0.075), (0.085, 0.085, 0.19), 0.04, upper,
              deltoid)
    down = (WRIST - ELBOW) / np.linalg.norm(WRIST - ELBOW)
    muscle = sculpt.frame_along(down, out)
    body.cone(ELBOW, 0.105, WRIST, 0.082, 0.05, fore)
    body.ball(ELBOW + 0.15 * down + 0.03 * out + (0, 0, 0.02), (0.125, 0.105, 0.20), 0.05, fore,
              muscle)
    body.ball(ELBOW + 0.17 * down - 0.035 * out, (0.105, 0.085, 0.19), 0.05, fore, muscle)
    body.ball(ELBOW + (0.0, 0.02, -0.085), (0.055, 0.055, 0.055), 0.05, fore)


def finger_chain(finger):
    """Knuckle, middle joint and tip of a finger in world space."""
    return [hand_point(*point) for point in FINGER_POINTS[finger]]


FINGER_RADII = {"thumb": (0.040, 0.036, 0.031), "index": (0.034, 0.032, 0.028),
                "middle": (0.035, 0.033, 0.029), "ring": (0.034, 0.031, 0.027),
                "pinky": (0.030, 0.028, 0.024)}


def hand(points):
    """The left hand as a Sculpt of its own, so that fingers do not flow into each other."""
    palm, fingers = Sculpt(points), Sculpt(points)
    tag = COLUMN["hand.L"]
    for finger in FINGERS:
        base, middle, tip = finger_chain(finger)
        thick, mid, thin = FINGER_RADII[finger]
        if finger == "thumb":
            palm.cone(hand_point(0.0, 0.03, -0.01), 0.055, base, 0.050, 0.03, tag)
        else:
            palm.cone(hand_point(0.01, 0.25 * FINGER_POINTS[finger][0][1], -0.004), 0.062,
                      base - 0.01 * HAND_BACK, 0.043, 0.03, tag)
        fingers.cone(base, thick, middle, mid, 0.008, COLUMN[f"{finger}1.L"])
        fingers.cone(middle, mid, tip, thin, 0.008, COLUMN[f"{finger}2.L"])
        fingers.ball(middle + 0.010 * HAND_BACK, mid, 0.012, COLUMN[f"{finger}1.L"])
        palm.ball(base + 0.014 * HAND_BACK, 0.030, 0.02, tag)
    pad = np.array([HAND_ALONG, HAND_THUMB, HAND_BACK])
    palm.ball(hand_point(0.075, 0.055, -0.045), (0.07, 0.045, 0.035), 0.03, tag, pad)
    palm.ball(hand_point(0.09, -0.055, -0.035), (0.08, 0.04, 0.035), 0.03, tag, pad)
    palm.merge(fingers, 0.022)
    return palm


def add_leg(body):
    """Thigh and shin, bowed."""
    thigh, shin = COLUMN["thigh.L"], COLUMN["shin.L"]
    body.cone(HIP + (0.015, -0.02, 0), 0.19, KNEE, 0.118, 0.05, thigh)
    body.cone(HIP + (0.10, -0.08, 0.05), 0.10, KNEE + (0.03, 0.10, 0.0), 0.085, 0.05, thigh)
    body.ball(KNEE + (-0.045, 0.11, 0.025), (0.07, 0.11, 0.08), 0.05, thigh)
    body.ball(KNEE + (0.01, 0.01, 0.072), (0.062, 0.068, 0.052), 0.04, thigh)
    body.cone(KNEE, 0.108, ANKLE, 0.082, 0.05, shin)
    body.ball(KNEE + (0.03, -0.13, -0.085), (0.085, 0.14, 0.085), 0.05, shin)
    body.ball(KNEE + (-0.05, -0.15, -0.075), (0.07, 0.13, 0.075), 0.05, shin)
    body.ball(ANKLE + (0.075, 0.0, 0.0), 0.032, 0.04, shin)
    body.ball(ANKLE + (-0.075, 0.015, 0.0), 0.032, 0.04, shin)


def foot(points):
    """The left foot, flat below."""
    whole, toes = Sculpt(points), Sculpt(points)
    tag, toe_tag = COLUMN["foot.L"], COLUMN["toes.L"]
    whole.cone(ANKLE + (-0.005, -0.06, -0.075), 0.082, ANKLE + (0.0, 0.0, 0.0), 0.088, 0.05, tag)
    whole.cone(ANKLE + (0, -0.01, 0.03), 0.085, BALL + (-0.02, 0.015, 0.0), 0.062, 0.05, tag)
    whole.cone(ANKLE + (0.01, -0.075, -0.05), 0.075, BALL + (0.05, -0.01, -0.01), 0.050, 0.05, tag)
    whole.cone(ANKLE + (-0.02, -0.07, -0.04), 0.070, BALL + (-0.07, 0.0, 0.0), 0.055, 0.05, tag)
    for root, tip, radius in zip(TOE_ROOTS, TOE_TIPS, TOE_RADII):
        root, tip = np.array(root), np.array(tip)
        toes.cone(root, radius, tip, radius * 0.94, 0.006, toe_tag)
        toes.ball(root + 0.55 * (tip - root) + (0, 0.012, 0), radius * 0.95, 0.012, toe_tag)
    whole.merge(toes, 0.025)
    whole.distance = smooth_max(whole.distance, -points[:, 1], 0.03)
    return whole


def add_head(body):
    """Skull, brow, nose, cheeks, jaw and lips; the mouth and the nostrils are cut later."""
    head, jaw, brow = COLUMN["head"], COLUMN["jaw"], COLUMN["brow"]
    body.ball((0, 2.155, 0.225), (0.150, 0.150, 0.180), 0.05, head)
    body.cone((0.09, 2.03, 0.26), 0.085, (0.075, 1.955, 0.36), 0.085, 0.05, head)
    body.cone((0, 2.06, 0.33), 0.105, (0, 1.98, 0.36), 0.10, 0.05, head)
    body.cone((0.105, 2.075, 0.37), 0.036, (0.135, 2.085, 0.28), 0.034, 0.04, head)
    # Lower jaw, wider than the skull and thrust forward.
    body.cone((0.125, 1.985, 0.27), 0.062, (0.085, 1.915, 0.405), 0.062, 0.05, jaw)
    body.cone((0.07, 1.910, 0.425), 0.060, (0, 1.905, 0.445), 0.062, 0.04, jaw)
    body.ball((0, 1.880, 0.470), (0.055, 0.040, 0.040), 0.035, jaw)
    # Brow ridge and glabella.
    body.cone((0.025, 2.160, 0.430), 0.034, (0.085, 2.172, 0.408), 0.036, 0.03, brow)
    body.cone((0.085, 2.172, 0.408), 0.036, (0.138, 2.142, 0.340), 0.030, 0.03, brow)
    body.ball((0, 2.150, 0.432), (0.035, 0.030, 0.030), 0.03, brow)
    # Eye sockets below the ridge, then lids around the eyes.
    body.carve_ball(EYE + (0.0, -0.006, 0.030), (0.042, 0.030, 0.038), 0.03)
    add_lids(body, head)
    # Nose: flat bridge, broad bulb, wings.
    body.cone((0, 2.130, 0.440), 0.026, (0, 2.072, 0.478), 0.034, 0.025, head)
    body.ball((0, 2.060, 0.492), (0.046, 0.034, 0.036), 0.02, head)
    body.ball((0.044, 2.050, 0.470), (0.030, 0.026, 0.032), 0.014, head)
    # Lips: the lower one stands out.
    add_lips(body, head, jaw)


def add_lids(body, tag):
    """A thick upper and a thinner lower lid, hugging the eyeball."""
    for height, lift, radius in ((0.017, 0.008, 0.014), (-0.021, -0.004, 0.012)):
        inner, middle, outer = (EYE + (dx, height + dy, dz) for dx, dy, dz in
                                ((-0.034, -0.4 * height, 0.014), (0.0, lift, 0.025),
                                 (0.036, -0.5 * height, 0.004)))
        body.cone(inner, radius * 0.8, middle, radius, 0.012, tag)
        body.cone(middle, radius, outer, radius * 0.8, 0.012, tag)


def add_lips(body, head, jaw):
    """Rolls of flesh above and below the slit."""
    for drop, forward, radius, tag in ((0.024, 0.0, 0.022, head), (-0.026, 0.020, 0.026, jaw)):
        xs = np.array([0.0, 0.045, 0.085, MOUTH_CORNER])
        zs = np.array([0.470, 0.462, 0.436, 0.395]) + forward
        heights = mouth_line(xs) + drop * np.array([1, 1, 0.9, 0.55])
        path = np.column_stack([xs, heights, zs])
        for a, b in zip(path[:-1], path[1:]):
            body.cone(a, radius, b, radius * 0.95, 0.02, tag)


def add_ear(body):
    """A long pointed ear with a bowl, out and back."""
    head = COLUMN["head"]
    root, tip = np.array([0.140, 2.095, 0.225]), np.array([0.325, 2.175, 0.130])
    flat = sculpt.frame_along(tip - root, (0.45, 0.15, 1.0))
    body.ball(root + 0.36 * (tip - root), (0.056, 0.022, 0.105), 0.03, head, flat)
    body.cone(root + 0.45 * (tip - root), 0.024, tip, 0.007, 0.03, head)
    front = flat[1] * np.sign(flat[1][2])
    body.carve_ball(root + 0.38 * (tip - root) + 0.024 * front, (0.036, 0.020, 0.075), 0.012, flat)
    body.ball(root + 0.02 * (tip - root) + 0.014 * front - (0, 0.02, 0), 0.018, 0.012, head)


def cut_face(body, points):
    """Nostrils, and the mouth: a slit between the lips that opens into a cavity."""
    body.carve_ball((0.030, 2.038, 0.502), (0.013, 0.011, 0.016), 0.010)
    x, y, z = points.T
    off = np.abs(y - mouth_line(x)) - 0.0065
    slit = np.maximum(np.maximum(off, x - MOUTH_CORNER), 0.36 - z)
    cavity = sculpt.ellipsoid(points, np.array([0, 1.965, 0.375]), np.array([0.085, 0.032, 0.080]))
    near = (np.abs(y - 1.965) < 0.12) & (x < 0.2) & (z > 0.2)
    hole = np.where(near, smooth_min(slit, cavity, 0.02), 1.0)
    body.carve(hole, 0.008)


def clay(points):
    """The whole skin as a Sculpt at points (N, 3) of both sides."""
    folded = fold(points)
    body = Sculpt(folded)
    add_torso(body)
    add_shoulders(body)
    add_arm(body)
    add_leg(body)
    add_head(body)
    add_ear(body)
    near_hand = folded[:, 0] > 1.0
    if near_hand.any():
        part = Sculpt(folded[near_hand])
        part.distance, part.nearest, part.owner = (
            body.distance[near_hand], body.nearest[near_hand], body.owner[near_hand])
        part.merge(hand(folded[near_hand]), 0.04)
        body.distance[near_hand], body.nearest[near_hand], body.owner[near_hand] = (
            part.distance, part.nearest, part.owner)
    body.merge(foot(folded), 0.04)
    cut_face(body, folded)
    return body


def distance(points):
    """Signed distance (N,) of the skin."""
    return clay(points).distance


def in_mouth(points):
    """True (N,) where a point of the skin lies inside the lips."""
    folded = fold(points)
    x, y, z = folded.T
    lips_end = 0.452 - 5.0 * x * x
    return (np.abs(y - mouth_line(x)) < 0.05) & (x < MOUTH_CORNER) & (z < lips_end) & (
        z > 0.28) & inside_closed_face(folded)


def inside_closed_face(folded):
    """True (N,) where the face would be solid if no mouth were cut into it."""
    body = Sculpt(folded)
    add_head(body)
    return body.distance < -0.004
