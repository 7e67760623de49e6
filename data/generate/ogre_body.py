"""The ogre's skin as one signed distance: what a sculptor would do with clay, in numbers.

All lengths in metres, in file space. Only the left half is written down: points are folded on
to it. Tags are the weight columns of the bones, so that each lump of clay knows its bone.
"""

import functools

import numpy as np
import sculpt
from ogre_skeleton import (
    ANKLE,
    BALL,
    COLUMN,
    ELBOW,
    FINGER_POINTS,
    FINGERS,
    HAND_ALONG,
    HAND_BACK,
    HAND_THUMB,
    HIP,
    KNEE,
    SHOULDER,
    WRIST,
    hand_point,
)
from sculpt import Sculpt, smooth_max, smooth_min
from surface_nets import Zoom, unwarp

BOX = (np.array([-1.85, -0.06, -0.60]), np.array([1.85, 2.50, 0.80]))
EYE = np.array([0.072, 2.112, 0.404])
EYE_RADIUS = 0.028
TOE_ROOTS = [(0.302, 0.059, 0.194), (0.370, 0.055, 0.217), (0.433, 0.051, 0.205), (0.486, 0.046, 0.176)]
TOE_TIPS = [(0.309, 0.047, 0.341), (0.396, 0.040, 0.339), (0.472, 0.037, 0.308), (0.533, 0.033, 0.261)]
TOE_RADII = [0.056, 0.043, 0.040, 0.036]
MOUTH_CORNER = 0.128  # half the width of the mouth


def zooms():
    """Where the mesh is finer than on the belly."""
    hand = hand_point(0.24, 0.02, 0)
    foot = np.array([0.41, 0.05, 0.20])
    wanted = [
        (foot * [-1, 1, 1], 0.17, 1.2, 0.2),
        (foot, 0.17, 1.2, 0.2),
        (hand * [-1, 1, 1], 0.23, 2.0, 0.22),
        (hand, 0.23, 2.0, 0.22),
        (np.array([0, 2.02, 0.41]), 0.16, 3.5, 0.15),
    ]
    chain = []
    # The last zoom of the chain is the nearest to the world; the centres of those before it
    # have to be given in the space that it starts from.
    for centre, radius, factor, fade in reversed(wanted):
        chain.insert(0, Zoom(unwarp(np.atleast_2d(centre), chain)[0], radius, factor, fade))
    return chain


def fold(points):
    """Points on the left half; rounded at the middle plane, so that no crease appears there."""
    folded = points.copy()
    folded[:, 0] = np.sqrt(points[:, 0] ** 2 + 0.006**2)
    return folded


def mouth_line(x):
    """Height of the slit between the lips at |x|: the corners hang."""
    return 1.982 - 2.3 * x * x


def add_torso(body):
    """Pelvis, belly, chest, hump."""
    pelvis, spine, chest = COLUMN["pelvis"], COLUMN["spine"], COLUMN["chest"]
    body.ball((0, 0.96, -0.03), (0.33, 0.19, 0.24), 0.05, pelvis)
    body.ball((0.145, 0.90, -0.17), (0.18, 0.17, 0.15), 0.06, pelvis)
    body.ball((0, 1.21, 0.09), (0.455, 0.31, 0.39), 0.10, spine)
    body.ball((0, 1.11, 0.17), (0.40, 0.20, 0.355), 0.08, spine)
    body.cone((0.29, 1.08, -0.06), 0.16, (0.30, 1.34, -0.10), 0.15, 0.08, spine)
    body.ball((0.335, 1.105, 0.02), (0.150, 0.085, 0.19), 0.035, spine)
    body.ball((0.30, 1.36, -0.06), (0.15, 0.075, 0.17), 0.035, spine)
    body.ball((0, 1.62, -0.05), (0.44, 0.34, 0.28), 0.12, chest)
    body.cone((0.38, 1.70, -0.14), 0.18, (0.28, 1.38, -0.13), 0.14, 0.07, chest)
    pec = sculpt.frame_along((0.30, -0.10, 1.0), (0.22, 1, 0.1))
    body.ball((0.205, 1.685, 0.165), (0.235, 0.150, 0.082), 0.04, chest, pec)
    body.ball((0.215, 1.610, 0.190), (0.165, 0.080, 0.075), 0.04, chest, pec)
    body.ball((0, 1.88, -0.21), (0.40, 0.23, 0.20), 0.10, chest)
    body.ball((0.24, 1.74, -0.27), (0.15, 0.19, 0.10), 0.05, chest)
    body.carve_cone((0, 1.30, -0.345), 0.02, (0, 1.78, -0.44), 0.03, 0.07)
    # Creases: under the breast, and where the belly folds when he slouches.
    for a, b in (
        ((0.03, 1.535, 0.285), (0.20, 1.500, 0.275)),
        ((0.20, 1.500, 0.275), (0.36, 1.545, 0.13)),
        ((0.0, 1.375, 0.430), (0.22, 1.355, 0.385)),
    ):
        body.carve_cone(a, 0.010, b, 0.010, 0.05)
    body.carve_ball((0, 1.15, 0.505), (0.032, 0.020, 0.055), 0.03)


def add_shoulders(body):
    """Trapezius and neck."""
    clavicle, neck = COLUMN["clavicle.L"], COLUMN["neck"]
    body.cone((0.07, 2.04, 0.0), 0.13, (0.20, 2.00, -0.035), 0.132, 0.07, neck)
    body.cone((0.20, 2.00, -0.035), 0.132, (0.45, 1.93, -0.10), 0.135, 0.07, clavicle)
    body.cone((0, 1.82, -0.02), 0.20, (0, 2.03, 0.17), 0.150, 0.07, neck)
    body.cone((0.135, 2.03, 0.20), 0.042, (0.05, 1.78, 0.175), 0.036, 0.04, neck)
    body.cone((0.07, 1.815, 0.165), 0.035, (0.40, 1.90, 0.06), 0.04, 0.05, clavicle)


def add_arm(body):
    """Shoulder, upper arm, forearm."""
    upper, fore, clavicle = COLUMN["upper_arm.L"], COLUMN["forearm.L"], COLUMN["clavicle.L"]
    along = (ELBOW - SHOULDER) / np.linalg.norm(ELBOW - SHOULDER)
    out = np.array([0.66, 0.75, 0])
    limb = sculpt.frame_along(along, out)
    body.ball(SHOULDER + (-0.03, 0.0, 0.0), (0.20, 0.18, 0.21), 0.08, clavicle)
    body.ball(SHOULDER + 0.11 * along + 0.055 * out, (0.190, 0.140, 0.235), 0.045, upper, limb)
    body.cone(SHOULDER, 0.16, ELBOW, 0.115, 0.05, upper)
    body.ball(SHOULDER + 0.33 * along + (0.0, -0.01, 0.085), (0.085, 0.085, 0.165), 0.03, upper, limb)
    body.ball(SHOULDER + 0.29 * along + (-0.01, -0.02, -0.090), (0.085, 0.090, 0.19), 0.03, upper, limb)
    down = (WRIST - ELBOW) / np.linalg.norm(WRIST - ELBOW)
    muscle = sculpt.frame_along(down, out)
    body.cone(ELBOW, 0.112, WRIST, 0.092, 0.05, fore)
    body.ball(ELBOW + 0.16 * down + 0.045 * out + (0, 0, 0.04), (0.130, 0.110, 0.20), 0.035, fore, muscle)
    body.ball(ELBOW + 0.18 * down - 0.045 * out - (0, 0, 0.02), (0.125, 0.100, 0.20), 0.035, fore, muscle)
    body.ball(ELBOW + (0.0, 0.02, -0.095), 0.055, 0.05, fore)


def finger_chain(finger):
    """Knuckle, middle joint and tip of a finger in world space."""
    return [hand_point(*point) for point in FINGER_POINTS[finger]]


FINGER_RADII = {
    "thumb": (0.047, 0.043, 0.038),
    "index": (0.039, 0.038, 0.034),
    "middle": (0.040, 0.039, 0.035),
    "ring": (0.039, 0.037, 0.033),
    "pinky": (0.035, 0.033, 0.030),
}


def hand(points):
    """The left hand as a Sculpt of its own, so that fingers do not flow into each other."""
    palm, fingers = Sculpt(points), Sculpt(points)
    tag = COLUMN["hand.L"]
    for finger in FINGERS:
        base, middle, tip = finger_chain(finger)
        thick, mid, thin = FINGER_RADII[finger]
        if finger == "thumb":
            palm.cone(hand_point(0.0, 0.035, -0.01), 0.066, base, 0.060, 0.03, tag)
        else:
            palm.cone(
                hand_point(0.01, 0.25 * FINGER_POINTS[finger][0][1], -0.004),
                0.074,
                base - 0.012 * HAND_BACK,
                0.052,
                0.03,
                tag,
            )
        fingers.cone(base, thick, middle, mid, 0.008, COLUMN[f"{finger}1.L"])
        fingers.cone(middle, mid, tip, thin, 0.008, COLUMN[f"{finger}2.L"])
        fingers.ball(middle + 0.012 * HAND_BACK, mid, 0.012, COLUMN[f"{finger}1.L"])
        palm.ball(base + 0.020 * HAND_BACK, 0.036, 0.02, tag)
    pad = np.array([HAND_ALONG, HAND_THUMB, HAND_BACK])
    palm.ball(hand_point(0.09, 0.065, -0.055), (0.085, 0.055, 0.042), 0.03, tag, pad)
    palm.ball(hand_point(0.11, -0.065, -0.045), (0.095, 0.05, 0.042), 0.03, tag, pad)
    palm.merge(fingers, 0.018)
    return palm


def add_leg(body):
    """Thigh and shin, bowed."""
    thigh, shin = COLUMN["thigh.L"], COLUMN["shin.L"]
    body.cone(HIP + (0.02, -0.02, 0), 0.205, KNEE, 0.125, 0.05, thigh)
    body.cone(HIP + (0.12, -0.10, 0.06), 0.115, KNEE + (0.035, 0.10, 0.01), 0.088, 0.035, thigh)
    body.ball(KNEE + (-0.055, 0.11, 0.030), (0.07, 0.11, 0.085), 0.035, thigh)
    body.ball(KNEE + (0.01, 0.01, 0.080), (0.068, 0.075, 0.052), 0.03, thigh)
    body.cone(KNEE, 0.115, ANKLE, 0.092, 0.05, shin)
    body.ball(KNEE + (0.035, -0.12, -0.095), (0.090, 0.14, 0.090), 0.04, shin)
    body.ball(KNEE + (-0.060, -0.14, -0.085), (0.075, 0.13, 0.080), 0.04, shin)
    body.cone(KNEE + (0.0, -0.06, 0.075), 0.035, ANKLE + (0, 0.06, 0.055), 0.03, 0.05, shin)
    body.ball(ANKLE + (0.085, 0.0, 0.0), 0.036, 0.035, shin)
    body.ball(ANKLE + (-0.085, 0.015, 0.0), 0.036, 0.035, shin)


def foot(points):
    """The left foot, flat below."""
    whole, toes = Sculpt(points), Sculpt(points)
    tag, toe_tag = COLUMN["foot.L"], COLUMN["toes.L"]
    whole.cone(ANKLE + (-0.005, -0.06, -0.085), 0.095, ANKLE, 0.100, 0.05, tag)
    whole.cone(ANKLE + (0, -0.01, 0.03), 0.100, BALL + (-0.02, 0.020, 0.0), 0.075, 0.05, tag)
    whole.cone(ANKLE + (0.012, -0.075, -0.06), 0.085, BALL + (0.055, -0.01, -0.01), 0.060, 0.05, tag)
    whole.cone(ANKLE + (-0.02, -0.07, -0.05), 0.080, BALL + (-0.08, 0.0, 0.0), 0.066, 0.05, tag)
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
    body.ball((0, 2.150, 0.225), (0.145, 0.145, 0.180), 0.05, head)
    body.cone((0.09, 2.03, 0.26), 0.085, (0.075, 1.955, 0.36), 0.085, 0.05, head)
    body.cone((0, 2.06, 0.33), 0.105, (0, 1.98, 0.36), 0.10, 0.05, head)
    body.cone((0.108, 2.070, 0.378), 0.036, (0.138, 2.080, 0.28), 0.034, 0.03, head)
    # Lower jaw, wider than the skull and thrust forward.
    body.cone((0.135, 1.990, 0.27), 0.066, (0.092, 1.912, 0.415), 0.066, 0.05, jaw)
    body.cone((0.078, 1.902, 0.435), 0.060, (0, 1.898, 0.458), 0.064, 0.04, jaw)
    body.ball((0.028, 1.868, 0.492), (0.038, 0.036, 0.034), 0.025, jaw)
    # Brow ridge, low toward the nose, and the knot between its halves.
    body.cone((0.022, 2.150, 0.442), 0.035, (0.080, 2.178, 0.424), 0.038, 0.022, brow)
    body.cone((0.080, 2.178, 0.424), 0.038, (0.142, 2.150, 0.345), 0.032, 0.022, brow)
    body.ball((0, 2.146, 0.440), (0.030, 0.026, 0.028), 0.02, brow)
    for side in (0.012, 0.030):
        body.carve_cone((side, 2.165, 0.478), 0.004, (side * 1.3, 2.200, 0.452), 0.003, 0.012)
    # Wrinkles across the forehead.
    for height, depth in ((2.222, 0.417), (2.252, 0.386)):
        body.carve_cone((0, height - 0.008, depth + 0.008), 0.005, (0.055, height, depth - 0.014), 0.005, 0.02)
        body.carve_cone((0.055, height, depth - 0.014), 0.005, (0.095, height - 0.014, depth - 0.05), 0.003, 0.02)
    # Eye sockets below the ridge, then lids around the eyes.
    body.carve_ball(EYE + (0.0, -0.006, 0.030), (0.044, 0.030, 0.038), 0.025)
    # Fills the socket behind the lids; the eyeball hides it.
    body.ball(EYE, 0.86 * EYE_RADIUS, 0.010, head)
    add_lids(body, head)
    # Nose: flat bridge, broad bulb, wings.
    body.cone((0, 2.125, 0.442), 0.025, (0, 2.072, 0.482), 0.036, 0.02, head)
    body.ball((0, 2.058, 0.498), (0.052, 0.034, 0.036), 0.018, head)
    body.ball((0.052, 2.048, 0.472), (0.032, 0.028, 0.034), 0.012, head)
    body.carve_cone((0.078, 2.068, 0.462), 0.006, (0.128, 1.985, 0.430), 0.005, 0.025)
    body.ball((0, 2.035, 0.435), 0.045, 0.02, head)
    add_lips(body, head, jaw)


def add_lids(body, tag):
    """A thick upper and a thinner lower lid, hugging the eyeball, and a bag below."""
    for height, lift, radius in ((0.017, 0.008, 0.014), (-0.021, -0.004, 0.012)):
        inner, middle, outer = (
            EYE + (dx, height + dy, dz)
            for dx, dy, dz in ((-0.034, -0.55 * height, 0.016), (0.0, lift, 0.025), (0.036, -0.35 * height, 0.004))
        )
        body.cone(inner, radius * 0.8, middle, radius, 0.010, tag)
        body.cone(middle, radius, outer, radius * 0.8, 0.010, tag)
    body.carve_cone(EYE + (-0.03, -0.044, 0.030), 0.004, EYE + (0.036, -0.040, 0.014), 0.004, 0.012)


def add_lips(body, head, jaw):
    """Rolls of flesh above and below the slit."""
    for drop, forward, radius, tag in ((0.024, 0.0, 0.021, head), (-0.027, 0.022, 0.026, jaw)):
        xs = np.array([0.0, 0.045, 0.090, MOUTH_CORNER])
        zs = np.array([0.470, 0.464, 0.436, 0.392]) + forward
        heights = mouth_line(xs) + drop * np.array([1, 1, 0.9, 0.55])
        path = np.column_stack([xs, heights, zs])
        for a, b in zip(path[:-1], path[1:]):
            body.cone(a, radius, b, radius * 0.95, 0.015, tag)


def add_ear(body):
    """A long pointed ear with a bowl, out and back."""
    head = COLUMN["head"]
    root, tip = np.array([0.140, 2.095, 0.225]), np.array([0.325, 2.175, 0.130])
    flat = sculpt.frame_along(tip - root, (0.45, 0.15, 1.0))
    body.ball(root + 0.36 * (tip - root), (0.056, 0.022, 0.105), 0.03, head, flat)
    body.cone(root + 0.45 * (tip - root), 0.028, tip, 0.016, 0.03, head)
    front = flat[1] * np.sign(flat[1][2])
    body.carve_ball(root + 0.38 * (tip - root) + 0.024 * front, (0.036, 0.020, 0.075), 0.012, flat)
    body.ball(root + 0.02 * (tip - root) + 0.014 * front - (0, 0.02, 0), 0.018, 0.012, head)


def cut_face(body, points):
    """Nostrils, and the mouth: a slit between the lips that opens into a cavity."""
    body.carve_ball((0.034, 2.036, 0.506), (0.016, 0.012, 0.020), 0.008)
    x, y, z = points.T
    off = np.abs(y - mouth_line(x)) - 0.0105
    slit = np.maximum(np.maximum(off, x - MOUTH_CORNER), 0.36 - z)
    cavity = sculpt.ellipsoid(points, np.array([0, 1.965, 0.375]), np.array([0.100, 0.032, 0.085]))
    near = (np.abs(y - 1.965) < 0.12) & (x < 0.2) & (z > 0.2)
    hole = np.where(near, smooth_min(slit, cavity, 0.02), 1.0)
    body.carve(hole, 0.008)


# Directions in which warts grow, seen from a point inside the body, and their radius (metres).
WARTS = [
    ((0, 2.10, 0.25), (0.62, 0.30, 0.62), 0.010),
    ((0, 2.10, 0.25), (-0.50, -0.10, 0.75), 0.012),
    ((0, 2.10, 0.25), (-0.35, 0.85, 0.40), 0.011),
    ((0, 2.10, 0.25), (-0.43, 0.80, 0.28), 0.007),
    ((0, 2.06, 0.30), (0.13, 0.06, 1.0), 0.009),
    ((0, 1.95, 0.30), (0.45, -0.28, 0.8), 0.012),
    ((0.5, 1.80, -0.07), (0.15, 1.0, 0.35), 0.022),
    ((0.5, 1.80, -0.07), (0.38, 0.9, 0.45), 0.015),
    ((-0.5, 1.80, -0.07), (-0.2, 1.0, -0.15), 0.020),
    ((-0.5, 1.80, -0.07), (-0.5, 0.8, 0.35), 0.024),
    ((-0.5, 1.80, -0.07), (-0.62, 0.8, 0.2), 0.014),
    ((0, 1.20, 0.05), (0.75, -0.30, 0.75), 0.017),
    ((0, 1.20, 0.05), (-0.85, 0.10, 0.60), 0.024),
    ((0, 1.20, 0.05), (-0.95, 0.25, 0.62), 0.015),
    ((0.1, 1.80, -0.1), (0.25, 0.45, -1.0), 0.026),
    ((0.1, 1.80, -0.1), (0.60, 0.10, -1.0), 0.020),
    ((-0.1, 1.80, -0.1), (-0.45, 0.0, -1.0), 0.028),
    ((0, 1.66, 0), (0.42, 0.1, 1.0), 0.015),
    ((0.30, 0.70, 0.04), (1.0, 0.2, 0.4), 0.020),
    ((-0.30, 0.70, 0.04), (-0.9, -0.5, 0.6), 0.018),
]
# A scar over the right brow and cheek: points on the face.
SCAR = [(-0.118, 2.235, 0.385), (-0.098, 2.180, 0.455), (-0.088, 2.060, 0.430), (-0.108, 2.015, 0.415)]


@functools.cache
def wart_places():
    """Points of the skin (N, 3) under each wart."""
    starts = np.array([start for start, _, _ in WARTS], float)
    ways = np.array([np.array(way) / np.linalg.norm(way) for _, way, _ in WARTS])
    reach = np.full(len(WARTS), 0.6)
    for _ in range(60):
        reach -= 0.7 * clay(starts + reach[:, None] * ways, warts=False).distance
    return starts + reach[:, None] * ways


def lumps(p):
    """Uneven hide: two skewed gyroids of p (N, 3), between -1 and 1."""
    x, y, z = p[:, 0] + 0.4 * p[:, 1], p[:, 1] - 0.3 * p[:, 2], p[:, 2] + 0.2 * p[:, 0]
    coarse = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
    fine = np.sin(2.3 * z) * np.cos(1.9 * x) + np.sin(1.9 * x) * np.cos(2.1 * y)
    return (coarse + 0.5 * fine) / 2.5


def add_blemishes(body, points):
    """Warts and a scar; with the lumps, all that differs between left and right."""
    whole = Sculpt(points)
    whole.distance = body.distance
    for place, (_, _, radius) in zip(wart_places(), WARTS):
        whole.ball(place, radius, 0.6 * radius)
    for a, b in zip(SCAR[:-1], SCAR[1:]):
        whole.carve_cone(a, 0.010, b, 0.010, 0.006)
    body.distance = whole.distance


def clay(points, warts=True):
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
            body.distance[near_hand],
            body.nearest[near_hand],
            body.owner[near_hand],
        )
        part.merge(hand(folded[near_hand]), 0.04)
        body.distance[near_hand], body.nearest[near_hand], body.owner[near_hand] = (
            part.distance,
            part.nearest,
            part.owner,
        )
    body.merge(foot(folded), 0.04)
    cut_face(body, folded)
    if warts:
        add_blemishes(body, points)
        calmer = np.clip((2.0 - points[:, 1]) / 0.2, 0.3, 1)  # on the face
        body.distance += 0.0026 * calmer * lumps(points / 0.022)
    return body


def distance(points):
    """Signed distance (N,) of the skin."""
    return clay(points).distance


def in_mouth(points):
    """True (N,) where a point of the skin lies inside the lips."""
    folded = fold(points)
    x, y, z = folded.T
    lips_end = 0.452 - 5.0 * x * x
    return (
        (np.abs(y - mouth_line(x)) < 0.05)
        & (x < MOUTH_CORNER)
        & (z < lips_end)
        & (z > 0.28)
        & inside_closed_face(folded)
    )


def inside_closed_face(folded):
    """True (N,) where the face would be solid if no mouth were cut into it."""
    body = Sculpt(folded)
    add_head(body)
    return body.distance < -0.004
