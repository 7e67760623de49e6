"""The ogre's target pose and its walk.

A rig folder holds rotations only, so the root stays where it is; the legs are solved by inverse
kinematics instead, with the feet on a ground at y = 0 that slides below as on a treadmill.
Sides: +1 left, -1 right. Angles in degrees; positive about X pitches the front down, positive
about Y turns to the left, positive about Z tilts to the right.
"""

import numpy as np
import posing
from ogre_skeleton import (
    ANKLE,
    BALL,
    ELBOW,
    FINGERS,
    HAND_ALONG,
    HAND_THUMB,
    HIP,
    INDEX,
    KNEE,
    NAMES,
    PARENTS,
    POSITIONS,
    SHOULDER,
    WRIST,
)

POSES = 32
STANCE = 0.60  # share of the cycle that a foot is on the ground
STEP_FRONT, STEP_BACK = 0.31, 0.33  # of the flat foot from its rest place, metres
STEP_LIFT = 0.10
HEEL = np.array([-0.005, -0.13, -0.14])  # from the ankle to the heel's edge, at rest
PUSH_OFF = BALL - ANKLE - (0, BALL[1], 0)  # from the ankle to the ground below the ball


def turn(axis, degrees):
    """Quaternion about a named or given axis."""
    axes = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
    return posing.axis_quaternion(axes.get(axis, axis) if isinstance(axis, str) else axis, degrees)


def chain(*turns):
    """Product of quaternions; the last one turns first."""
    result = np.array([1.0, 0, 0, 0])
    for q in turns:
        result = posing.multiply(result, q)
    return result


class Pose:
    """Local rotations of all rows, with what inverse kinematics needs to know of them."""

    def __init__(self):
        self.local = np.tile([1.0, 0, 0, 0], (len(NAMES), 1))
        self.origins = posing.turning_points(PARENTS, POSITIONS, True)

    def set(self, name, *turns):
        """Gives the row these turns, the last one first."""
        self.local[INDEX[name]] = chain(*turns)

    def set_both(self, name, *turns):
        """Gives left and right rows mirrored turns."""
        self.set(name + ".L", *turns)
        self.set(name + ".R", *[q * [1, 1, -1, -1] for q in turns])

    def set_side(self, name, side, *turns):
        """Gives the row of one side turns that are written for the left."""
        mirror = np.array([1, 1, side, side])
        self.set(name + (".L" if side > 0 else ".R"), *[q * mirror for q in turns])

    def world(self, name):
        """Global rotation (3, 3) of a row and the posed position of its joint (3,)."""
        row = INDEX[name]
        matrices = posing.skinning_matrices(PARENTS, self.origins, self.local)
        return matrices[row, :, :3], matrices[row, :, :3] @ POSITIONS[row] + matrices[row, :, 3]

    def set_world(self, name, rotation):
        """Gives the row a global rotation (3, 3)."""
        parent = NAMES[PARENTS[INDEX[name]]]
        self.local[INDEX[name]] = posing.from_matrix(self.world(parent)[0].T @ rotation)

    def plant(self, side, ankle, foot_turns, toe_pitch=0.0, splay=0.0):
        """Bends one leg so that the ankle comes to a place; the foot gets a global rotation.

        ankle (3,) and the quaternions foot_turns in world space; splay turns the knee outward.
        """
        suffix = ".L" if side > 0 else ".R"
        mirror = np.array([side, 1, 1])
        rest = [point * mirror for point in (HIP, KNEE, ANKLE)]
        _, hip = self.world("hip" + suffix)
        pole = posing.to_matrices(turn("y", side * splay)) @ (rest[1] - (rest[0] + rest[2]) / 2)
        knee, ankle = two_bones(hip, ankle, pole, np.linalg.norm(rest[1] - rest[0]), np.linalg.norm(rest[2] - rest[1]))
        bent, straight = leg_frames(hip, knee, ankle), leg_frames(*rest)
        for name, new, old in zip(("thigh", "shin"), bent, straight):
            self.set_world(name + suffix, new @ old.T)
        self.set_world("foot" + suffix, posing.to_matrices(chain(*foot_turns)))
        self.set("toes" + suffix, turn("x", toe_pitch))


def two_bones(hip, ankle, pole, upper, lower):
    """Knee and reached ankle of a leg whose knee points along pole; lengths in metres."""
    line = ankle - hip
    reach = min(np.linalg.norm(line), 0.998 * (upper + lower))
    along = line / np.linalg.norm(line)
    outward = pole - (pole @ along) * along
    outward /= np.linalg.norm(outward)
    down = (upper**2 - lower**2 + reach**2) / (2 * reach)
    knee = hip + down * along + np.sqrt(upper**2 - down**2) * outward
    return knee, hip + reach * along


def leg_frames(hip, knee, ankle):
    """Orthonormal columns along thigh and shin, sharing the hinge axis of the knee."""
    hinge = np.cross(knee - hip, ankle - knee)
    hinge /= np.linalg.norm(hinge)
    frames = []
    for a, b in ((hip, knee), (knee, ankle)):
        along = (b - a) / np.linalg.norm(b - a)
        frames.append(np.column_stack([along, hinge, np.cross(along, hinge)]))
    return frames


def smooth(t):
    """Smoothstep from 0 to 1."""
    t = np.clip(t, 0, 1)
    return t * t * (3 - 2 * t)


def foot_path(phase):
    """Pitch of the foot, its toes, and the ankle's way from its rest place (3,), at a phase.

    Phase 0 is heel strike; the foot is on the ground until STANCE, then swings forward.
    """
    if phase < STANCE:
        t = phase / STANCE
        z = STEP_FRONT - t * (STEP_FRONT + STEP_BACK)
        lift = 0.0
        pitch = -20 * (1 - smooth(t / 0.18)) + 42 * smooth((t - 0.62) / 0.38)
        toes = -43 * smooth((t - 0.62) / 0.38)
    else:
        t = (phase - STANCE) / (1 - STANCE)
        z = -STEP_BACK + smooth(0.85 * t + 0.15 * t * t) * (STEP_FRONT + STEP_BACK)
        lift = STEP_LIFT * np.sin(np.pi * t) ** 1.3
        pitch = 42 * (1 - smooth(t / 0.55)) - 20 * smooth((t - 0.45) / 0.55)
        toes = -43 * (1 - smooth(t / 0.45)) - 8 * np.sin(np.pi * t)
    pivot = HEEL if pitch < 0 else PUSH_OFF
    rolled = pivot - posing.to_matrices(turn("x", pitch)) @ pivot
    return pitch, toes, rolled + (0, lift, z)


def swing_arm(pose, side, swing):
    """A heavy arm, held away from the belly; swing -1 (back) to 1 (forward)."""
    elbow = 24 + 13 * swing
    pose.set_side("clavicle", side, turn("y", -6 * swing), turn("z", -3))
    pose.set_side("upper_arm", side, turn("x", 4 - 25 * swing), turn("z", -23 + 3 * swing), turn(SHOULDER - ELBOW, 18))
    pose.set_side("forearm", side, turn(np.cross(WRIST - ELBOW, [0, 0, 1]), elbow))
    pose.set_side("hand", side, turn(HAND_THUMB, -8 - 8 * swing))
    curl_fingers(pose, side, 22)


def curl_fingers(pose, side, degrees):
    """Bends all fingers toward the palm."""
    for finger in FINGERS:
        axis, amount = (HAND_ALONG, 0.5 * degrees) if finger == "thumb" else (-HAND_THUMB, degrees)
        pose.set_side(f"{finger}1", side, turn(axis, amount))
        pose.set_side(f"{finger}2", side, turn(axis, 1.2 * amount))


def walk_pose(phase):
    """One pose of the walk; phase 0..1, at 0 the left heel strikes."""
    cycle = 2 * np.pi * phase
    wave, quarter, double = np.cos(cycle), np.sin(cycle), np.cos(2 * cycle)
    pose = Pose()
    pose.set("root", turn("z", -2.5 * quarter), turn("x", 2))
    pose.set("pelvis", turn("y", -9 * wave), turn("z", 5.5 * quarter))
    pose.set("spine", turn("y", 5 * wave), turn("z", -5 * quarter), turn("x", 3 + 2.0 * double))
    pose.set("chest", turn("y", 8 * wave), turn("z", 1.5 * quarter), turn("x", 2 - 1.5 * double))
    pose.set("neck", turn("y", -6 * wave), turn("z", 3 * quarter), turn("x", -4 - 2.5 * double))
    pose.set("head", turn("y", -6 * wave), turn("z", 3 * quarter), turn("x", -3 + 3 * np.cos(2 * cycle - 0.9)))
    pose.set("jaw", turn("x", 5 + 4 * np.cos(2 * cycle - 1.3)))
    pose.set("topknot", turn("x", 10 * np.cos(2 * cycle - 1.6)), turn("z", 9 * np.sin(cycle - 0.7)))
    thigh_pitch = []
    for side, lag in ((1, 0.0), (-1, 0.5)):
        pitch, toes, way = foot_path((phase + lag) % 1)
        inward = np.array([-0.03 * side, 0, 0])  # feet come under the body, not too far
        pose.plant(side, ANKLE * [side, 1, 1] + way + inward, (turn("y", 4 * side), turn("x", pitch)), toes)
        swing_arm(pose, side, -side * np.cos(cycle - 0.25))
        _, knee = pose.world("thigh.L" if side > 0 else "thigh.R")
        thigh_pitch.append(knee[2] - KNEE[2])
    hang_flaps(pose, thigh_pitch, cycle)
    return pose.local


def hang_flaps(pose, thigh_pitch, cycle):
    """The hides give way to the thighs, metres that the knees are ahead of their rest place."""
    ahead, behind = max(max(thigh_pitch), 0), max(-min(thigh_pitch), 0)
    pose.set("flap.front", turn("x", -95 * ahead), turn("z", 4 * np.sin(cycle - 0.8)))
    pose.set("flap.back", turn("x", 75 * behind), turn("z", 4 * np.sin(cycle - 0.8)))


def walk():
    """Quaternions (POSES, J, 4) of one cycle, two steps."""
    return posing.same_hemisphere(np.array([walk_pose(p / POSES) for p in range(POSES)]))


def roar():
    """The target pose: a wide stance, arms flung up, jaw open."""
    pose = Pose()
    pose.set("root", turn("x", -4), turn("y", -8))
    pose.set("pelvis", turn("x", 6))
    pose.set("spine", turn("x", -6), turn("y", 6))
    pose.set("chest", turn("x", -12), turn("y", 8))
    pose.set("neck", turn("x", 8))
    pose.set("head", turn("x", -8), turn("y", 4), turn("z", -5))
    pose.set("jaw", turn("x", 32))
    pose.set("brow", turn("x", 3))
    pose.set("topknot", turn("x", -25))
    for side, lift, elbow in ((1, 50, 58), (-1, 38, 74)):
        pose.set_side("clavicle", side, turn("z", 12), turn("y", 6))
        pose.set_side("upper_arm", side, turn("y", 8), turn("z", lift), turn(ELBOW - SHOULDER, -58))
        pose.set_side("forearm", side, turn(np.cross(WRIST - ELBOW, [0, 0, 1]), elbow))
        pose.set_side("hand", side, turn(HAND_THUMB, 8))
        curl_fingers(pose, side, 30)
    pose.plant(1, ANKLE + (0.10, 0, 0.20), (turn("y", 14),), splay=12)
    pose.plant(-1, ANKLE * [-1, 1, 1] + (-0.12, 0, -0.12), (turn("y", -24),), splay=18)
    pose.set("flap.front", turn("x", -14))
    pose.set("flap.back", turn("x", 8))
    return pose.local


def target_pose():
    """Euler degrees (2, J, 3): rest, and the roar."""
    return np.stack([np.zeros((len(NAMES), 3)), np.round(posing.to_eulers(roar()), 3)])
