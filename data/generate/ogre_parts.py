"""Eyes, teeth, nails, hair and clothes: separate shells in the ogre's mesh.

Each part is a Shell: vertices in metres in file space, faces, a material a face, and either the
name of the bone that carries it or None, when its weights are copied from the skin below it.
"""
import numpy as np

import ogre_body
from ogre_skeleton import (ELBOW, FINGERS, HAND_BACK, WRIST)
from sculpt import frame_along

UP = np.array([0.0, 1.0, 0.0])


class Shell:
    """One closed surface."""

    def __init__(self, vertices, faces, materials, bone=None, blend=None):
        self.vertices = np.asarray(vertices, float)
        self.faces = faces
        self.materials = [materials] * len(faces) if isinstance(materials, str) else materials
        self.bone = bone
        self.blend = blend          # (V,) share of `bone`; the skin's weights get the rest


def mirrored(shell):
    """The same shell on the right side."""
    bone = shell.bone[:-2] + ".R" if shell.bone and shell.bone.endswith(".L") else shell.bone
    return Shell(shell.vertices * [-1, 1, 1], [face[::-1] for face in shell.faces],
                 list(shell.materials), bone, shell.blend)


def ring_faces(rings, sides):
    """Quads between successive closed rings of vertices, outward for rings that turn
    counter-clockwise seen from the end."""
    return [(r * sides + s, r * sides + (s + 1) % sides,
             (r + 1) * sides + (s + 1) % sides, (r + 1) * sides + s)
            for r in range(rings - 1) for s in range(sides)]


def tube(path, radii, sides, material, bone, flatten=1.0, flat_axis=UP):
    """A closed tube along path (N, 3); radii (N,); flattened across flat_axis."""
    path, radii = np.asarray(path, float), np.asarray(radii, float)
    tangents = np.gradient(path, axis=0)
    if abs(tangents[len(path) // 2] @ flat_axis) > 0.9 * np.linalg.norm(tangents[len(path) // 2]):
        flat_axis = np.array([0.0, 0.0, 1.0])       # any axis serves that is not the tube's own
    turn = 2 * np.pi * np.arange(sides) / sides
    rings = []
    for point, radius, tangent in zip(path, radii, tangents):
        side, up, _ = frame_along(tangent, flat_axis)
        rings.append(point + radius * (np.cos(turn)[:, None] * side
                                       + flatten * np.sin(turn)[:, None] * up))
    count = len(path)
    vertices = np.vstack(rings + [path[:1], path[-1:]])
    faces = ring_faces(count, sides)
    first, last, low = count * sides, count * sides + 1, (count - 1) * sides
    faces += [(first, (s + 1) % sides, s) for s in range(sides)]
    faces += [(last, low + s, low + (s + 1) % sides) for s in range(sides)]
    return Shell(vertices, faces, material, bone)


def curve(points, count):
    """Quadratic Bezier curve through three control points, (count, 3)."""
    a, b, c = (np.asarray(p, float) for p in points)
    t = np.linspace(0, 1, count)[:, None]
    return (1 - t) ** 2 * a + 2 * t * (1 - t) * b + t * t * c


def horn(points, radius, sides, count, material, bone, tip=0.12):
    """A tapering curved cone."""
    t = np.linspace(0, 1, count)
    return tube(curve(points, count), radius * ((1 - t) ** 0.75 * (1 - tip) + tip),
                sides, material, bone)


def eye():
    """Left eyeball, looking forward and a little inward and down; iris and pupil are materials."""
    gaze = np.array([-0.10, -0.06, 1.0])
    side, up, forward = frame_along(gaze, UP)
    polar = np.radians([0, 13, 29, 34, 52, 75, 100, 130, 155])[1:]
    sides = 16
    turn = 2 * np.pi * np.arange(sides) / sides
    rings = [np.cos(a) * forward + np.sin(a) * (np.cos(turn)[:, None] * side
                                                + np.sin(turn)[:, None] * up) for a in polar]
    vertices = np.vstack(rings + [forward[None], -forward[None]])
    count = len(polar)
    front, back, low = count * sides, count * sides + 1, (count - 1) * sides
    faces = [face[::-1] for face in ring_faces(count, sides)]
    bands = ["iris", "pupil", "eye", "eye", "eye", "eye", "eye"]
    materials = [bands[i // sides] for i in range(len(faces))]
    faces += [(front, s, (s + 1) % sides) for s in range(sides)]
    materials += ["pupil"] * sides
    faces += [(back, low + (s + 1) % sides, low + s) for s in range(sides)]
    materials += ["eye"] * sides
    return Shell(ogre_body.EYE + ogre_body.EYE_RADIUS * vertices, faces, materials, "head")


def teeth():
    """Two tusks, one of them broken, and rows of pegs, carried by jaw and head."""
    def tusk(side, length):
        base = np.array([0.074 * side, 1.930, 0.458])
        bend = np.array([0.100 * side, 1.985, 0.498])
        tip = np.array([0.108 * side, 2.075, 0.468])
        path = curve((base, bend, tip), 11)
        stop = base + length * (path[-1] - base) if length == 1 else path[6]
        radius, end = (0.0205, 0.10) if length == 1 else (0.0205, 0.62)
        return horn((base, bend - (0, 0, 0.0) if length == 1 else path[3] + (0.004 * side, 0, 0.003),
                     stop), radius, 12, 9, "tusk", "jaw", end)

    shells = [tusk(1, 1), tusk(-1, 0.6)]
    for x in (-0.046, -0.016, 0.016, 0.044):
        z = 0.470 - 3.5 * x * x
        y = ogre_body.mouth_line(x)
        shells.append(horn(((x, y - 0.022, z), (x, y - 0.005, z + 0.003), (x, y + 0.014, z)),
                           0.0115, 8, 5, "tusk", "jaw", 0.45))
    for x in (-0.06, -0.03, 0.0, 0.032, 0.06):
        z = 0.446 - 3.5 * x * x
        y = ogre_body.mouth_line(x)
        shells.append(horn(((x, y + 0.028, z), (x, y + 0.008, z + 0.002), (x, y - 0.006, z)),
                           0.012, 8, 5, "tusk", "head", 0.5))
    return shells


def nail(point, direction, normal, width, bone):
    """A flat shell on the back of a finger or toe tip."""
    direction = direction / np.linalg.norm(direction)
    along = np.array([-1.0, -0.75, -0.1, 0.6, 1.0])
    path = point + np.outer(along * 0.95 * width, direction) - np.outer(
        0.30 * width * np.clip(along, 0, None) ** 2, normal)
    return tube(path, width * np.array([0.35, 0.72, 0.85, 0.80, 0.45]), 8, "nail", bone, 0.35, normal)


def nails():
    """Finger and toe nails of the left side."""
    shells = []
    for finger in FINGERS:
        _, middle, tip = ogre_body.finger_chain(finger)
        radius = ogre_body.FINGER_RADII[finger][2]
        direction = (tip - middle) / np.linalg.norm(tip - middle)
        normal = HAND_BACK - (HAND_BACK @ direction) * direction
        normal /= np.linalg.norm(normal)
        shells.append(nail(tip + 0.82 * radius * normal + 0.35 * radius * direction, direction, normal,
                           0.66 * radius, f"{finger}2.L"))
    for root, tip, radius in zip(ogre_body.TOE_ROOTS, ogre_body.TOE_TIPS, ogre_body.TOE_RADII):
        root, tip = np.array(root), np.array(tip)
        direction = (tip - root) / np.linalg.norm(tip - root)
        shells.append(nail(tip + 0.74 * radius * UP + 0.38 * radius * direction, direction,
                           UP, 0.62 * radius, "toes.L"))
    return shells


def march(origins, directions, start, offset):
    """Points (N, 3) where rays from outside (start, metres) come to `offset` from the skin."""
    reach = np.full(len(origins), float(start))
    for _ in range(40):
        gap = ogre_body.distance(origins + reach[:, None] * directions) - offset
        reach = np.maximum(reach - 0.7 * gap, 0.0)
    return origins + reach[:, None] * directions


def band(centre, axis, start, half_height, thickness, sides, material, bone=None, forward=(0, 0, 1),
         lift=0.004):
    """A strap around the body: the section of the skin by a plane, thickened."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    side, up, _ = frame_along(axis, np.asarray(forward, float))
    turn = 2 * np.pi * np.arange(sides) / sides
    outward = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * up
    profile = [(-1.0, -0.6), (-1.0, 0.7), (-0.8, 1.0), (0.8, 1.0), (1.0, 0.7), (1.0, -0.6)]
    rings = []
    for height, out in profile:
        origins = np.broadcast_to(centre + height * half_height * axis, (sides, 3))
        inner = march(origins, outward, start, lift)
        rings.append(inner + out * thickness * outward)
    count = len(profile)
    faces = ring_faces(count, sides)
    faces += [((count - 1) * sides + s, (count - 1) * sides + (s + 1) % sides, (s + 1) % sides, s)
              for s in range(sides)]
    return Shell(np.vstack(rings), faces, material, bone)


BELT_CENTRE, BELT_AXIS = np.array([0, 0.985, -0.02]), np.array([0, 0.975, 0.22])


def belt():
    """Leather belt under the belly, and its buckle."""
    strap = band(BELT_CENTRE, BELT_AXIS, 0.8, 0.042, 0.016, 72, "leather")
    front = strap.vertices[np.argmax(strap.vertices[:, 2])]
    disc = tube([front * [0, 1, 1] + (0, -0.0, z) for z in (-0.03, 0.008, 0.018, 0.022)],
                [0.058, 0.062, 0.052, 0.02], 20, "metal", None)
    return [strap, disc]


def flap(sign, columns=25, rows=17):
    """A ragged hide hanging from the belt, in front (sign 1) or behind (sign -1)."""
    u = np.linspace(-1, 1, columns)
    length = 0.40 + 0.035 * np.sin(5.1 * u + sign) + 0.028 * np.sign(np.sin(17.0 * u + 0.7))
    top = BELT_CENTRE[1] - sign * 0.22 / 0.975 * 0.30
    direction = np.tile([0.0, 0.0, float(sign)], (columns, 1))
    sheet = np.zeros((rows, columns, 3))
    for row in range(rows):
        t = row / (rows - 1)
        x = u * (0.25 + 0.03 * t)
        origins = np.column_stack([x, top + 0.02 - t * length, np.zeros(columns)])
        reach = march(origins, direction, 0.8, 0.022)[:, 2] * sign
        reach = np.where(reach < 0.02, 0.0, reach)
        if row:
            # Cloth hangs straight down from what holds it out, and spans gaps.
            reach = np.maximum(reach, previous - 0.10 * length / (rows - 1))
        for _ in range(4):
            padded = np.pad(reach, 1, mode="edge")
            reach = np.maximum(reach, (padded[:-2] + padded[2:]) / 2)
        previous = reach
        fold = 0.012 * t * np.sin(11 * u + 1.3 * sign) + 0.006 * t * np.sin(23 * u)
        sheet[row] = np.column_stack([x, origins[:, 1], sign * (reach + fold + 0.004)])
    return thicken(sheet, sign)


def thicken(sheet, sign, thickness=0.014):
    """Closes a sheet (rows, columns, 3) into a flat bag with its back `thickness` behind."""
    rows, columns, _ = sheet.shape
    back = sheet - [0, 0, sign * thickness]
    vertices = np.vstack([sheet.reshape(-1, 3), back.reshape(-1, 3)])
    half = rows * columns
    at = np.arange(half).reshape(rows, columns)
    faces = []
    for r in range(rows - 1):
        for c in range(columns - 1):
            quad = (at[r, c], at[r + 1, c], at[r + 1, c + 1], at[r, c + 1])
            faces += [quad, tuple(half + i for i in quad[::-1])]
    border = np.concatenate([at[0, ::-1], at[1:, 0], at[-1, 1:], at[-2:0:-1, -1]])
    for a, b in zip(border, np.roll(border, -1)):
        faces.append((b, a, half + a, half + b))
    faces = [tuple(int(i) for i in face) for face in faces]
    if sign < 0:
        faces = [face[::-1] for face in faces]
    drop = np.repeat(np.linspace(0, 1, rows), columns)
    name = "flap.front" if sign > 0 else "flap.back"
    return Shell(vertices, faces, "cloth", name, np.tile(np.clip(2.5 * drop, 0, 1), 2))


def bracer():
    """Leather around the left forearm, with two metal rims."""
    along = WRIST - ELBOW
    shells = [band(ELBOW + 0.74 * along, along, 0.3, 0.075, 0.010, 28, "leather")]
    for place in (0.585, 0.895):
        shells.append(band(ELBOW + place * along, along, 0.3, 0.011, 0.017, 28, "metal"))
    return shells


def topknot():
    """A tied tuft of hair that falls backward."""
    path = curve(((0, 2.285, 0.18), (0, 2.47, 0.14), (0, 2.36, -0.10)), 12)
    radii = [0.040, 0.036, 0.026, 0.026, 0.040, 0.048, 0.048, 0.044, 0.038, 0.030, 0.018, 0.006]
    tie = tube(path[1:5:1] + (0, 0.004, 0), [0.030, 0.040, 0.038, 0.028], 14, "leather", "topknot")
    return [tube(path, radii, 14, "hair", "topknot"), tie]


def earring():
    """A metal ring through the left ear."""
    turn = np.linspace(0, 2 * np.pi, 17)[:-1]
    centre = np.array([0.215, 2.085, 0.185])
    ring = centre + 0.030 * (np.cos(turn)[:, None] * [0.5, 0, -0.86] + np.sin(turn)[:, None] * UP)
    sides = 8
    around = 2 * np.pi * np.arange(sides) / sides
    rings = []
    for point in ring:
        out = (point - centre) / 0.030
        axis = np.array([0.86, 0, 0.5])
        rings.append(point + 0.0065 * (np.cos(around)[:, None] * out + np.sin(around)[:, None] * axis))
    count = len(ring)
    faces = [(r * sides + s, ((r + 1) % count) * sides + s,
              ((r + 1) % count) * sides + (s + 1) % sides, r * sides + (s + 1) % sides)
             for r in range(count) for s in range(sides)]
    return Shell(np.vstack(rings), faces, "metal", "head")


def all_parts():
    """Every shell of both sides."""
    left = [eye()] + nails() + bracer()
    return (left + [mirrored(shell) for shell in left] + teeth() + belt() + [flap(1), flap(-1)]
            + topknot() + [earring()])
