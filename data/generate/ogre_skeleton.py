"""The ogre's joints. A row is named for the bone that ends at it (bone convention).

Positions in metres: Y up, facing +Z, the character's left at +X.
"""

import numpy as np

FINGERS = ("thumb", "index", "middle", "ring", "pinky")

CENTRE = [  # name, parent, position, carries weights
    ("root", None, (0, 1.02, -0.03), False),
    ("pelvis", "root", (0, 0.88, -0.01), True),
    ("spine", "root", (0, 1.32, -0.03), True),
    ("chest", "spine", (0, 1.78, -0.07), True),
    ("neck", "chest", (0, 1.93, 0.12), True),
    ("head", "neck", (0, 2.03, 0.22), True),
    ("jaw", "head", (0, 1.89, 0.46), True),
    ("brow", "head", (0, 2.17, 0.45), True),
    ("scalp", "head", (0, 2.31, 0.19), False),
    ("topknot", "scalp", (0, 2.42, 0.02), True),
    ("belt.front", "pelvis", (0, 0.99, 0.36), False),
    ("flap.front", "belt.front", (0, 0.58, 0.36), True),
    ("belt.back", "pelvis", (0, 0.99, -0.30), False),
    ("flap.back", "belt.back", (0, 0.58, -0.32), True),
]

SHOULDER = np.array([0.545, 1.845, -0.07])
ELBOW = np.array([0.945, 1.505, -0.12])
WRIST = np.array([1.305, 1.165, 0.02])
HIP = np.array([0.215, 0.89, -0.02])
KNEE = np.array([0.375, 0.49, 0.11])
ANKLE = np.array([0.335, 0.135, -0.06])
BALL = np.array([0.405, 0.05, 0.19])
TOES = np.array([0.46, 0.04, 0.35])

HAND_ALONG = np.array([0.72, -0.66, 0.20]) / np.linalg.norm([0.72, -0.66, 0.20])
HAND_BACK = np.cross(HAND_ALONG, [0, 0, 1])
HAND_BACK /= -np.linalg.norm(HAND_BACK)  # out of the back of the hand: up and outward
HAND_THUMB = np.cross(HAND_ALONG, HAND_BACK)
HAND_THUMB *= np.sign(HAND_THUMB[2])  # toward the thumb: forward


def hand_point(along, thumbward, back):
    """World position of a point given in the left hand's own axes, metres from the wrist."""
    return WRIST + along * HAND_ALONG + thumbward * HAND_THUMB + back * HAND_BACK


# Each finger: knuckle, middle joint, tip, in the hand's own axes. Slightly curled and spread.
FINGER_POINTS = {
    "thumb": [(0.060, 0.095, -0.024), (0.130, 0.170, -0.050), (0.205, 0.205, -0.075)],
    "index": [(0.220, 0.108, 0.005), (0.325, 0.152, -0.006), (0.410, 0.178, -0.050)],
    "middle": [(0.235, 0.036, 0.014), (0.352, 0.050, 0.004), (0.450, 0.056, -0.042)],
    "ring": [(0.228, -0.037, 0.010), (0.338, -0.054, -0.003), (0.430, -0.066, -0.048)],
    "pinky": [(0.205, -0.104, -0.004), (0.294, -0.146, -0.018), (0.366, -0.174, -0.058)],
}


def left_limbs():
    """The rows of the left side, in the layout of CENTRE."""
    rows = [
        ("hip.L", "pelvis", HIP, False),
        ("thigh.L", "hip.L", KNEE, True),
        ("shin.L", "thigh.L", ANKLE, True),
        ("foot.L", "shin.L", BALL, True),
        ("toes.L", "foot.L", TOES, True),
        ("clavicle.L", "chest", SHOULDER, True),
        ("upper_arm.L", "clavicle.L", ELBOW, True),
        ("forearm.L", "upper_arm.L", WRIST, True),
        ("hand.L", "forearm.L", hand_point(0.225, 0.0, 0.006), True),
    ]
    for finger in FINGERS:
        knuckle, middle, tip = (hand_point(*point) for point in FINGER_POINTS[finger])
        rows += [
            (f"{finger}_base.L", "hand.L", knuckle, False),
            (f"{finger}1.L", f"{finger}_base.L", middle, True),
            (f"{finger}2.L", f"{finger}1.L", tip, True),
        ]
    return rows


def mirrored(rows):
    """The right side of left rows."""

    def other(name):
        return name[:-2] + ".R" if name.endswith(".L") else name

    return [
        (other(name), other(parent), np.array(position) * [-1, 1, 1], carries)
        for name, parent, position, carries in rows
    ]


ROWS = CENTRE + left_limbs() + mirrored(left_limbs())
NAMES = [row[0] for row in ROWS]
INDEX = {name: row for row, name in enumerate(NAMES)}
PARENTS = np.array([-1 if row[1] is None else INDEX[row[1]] for row in ROWS])
# Rounded as skeleton.bf writes them, so that poses and weights see what a reader sees.
POSITIONS = np.round(np.array([row[2] for row in ROWS], float), 5)
OFFSETS = np.where(PARENTS[:, None] >= 0, POSITIONS - POSITIONS[np.maximum(PARENTS, 0)], POSITIONS)
WEIGHT_INDEX = np.cumsum([row[3] for row in ROWS]) - 1
WEIGHT_INDEX[[not row[3] for row in ROWS]] = -1
BONES = [row[0] for row in ROWS if row[3]]  # in the order of the weight columns
COLUMN = {name: column for column, name in enumerate(BONES)}


def bf_rows():
    """Rows for rig_files.write_bf."""
    return [(int(w), int(p), o, n) for w, p, o, n in zip(WEIGHT_INDEX, PARENTS, OFFSETS, NAMES)]
