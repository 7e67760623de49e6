"""Eyes, teeth, nails, hair and clothes: separate shells in the ogre's mesh.

Each part is a Shell: vertices in metres in file space, faces, a material a face, and either the
name of the bone that carries it or None, when its weights are copied from the skin below it.
"""

import numpy as np
import ogre_body
from ogre_skeleton import ELBOW, FINGERS, HAND_BACK, WRIST
from sculpt import frame_along

UP = np.array([0.0, 1.0, 0.0])


class Shell:
    """One closed surface."""

    def __init__(self, vertices, faces, materials, bone=None, blend=None):
        self.vertices = np.asarray(vertices, float)
        self.faces = faces
        self.materials = [materials] * len(faces) if isinstance(materials, str) else materials
        self.bone = bone
        self.blend = blend  # (V,) share of `bone`; the skin's weights get the rest


def mirrored(shell):
    """The same shell on the right side."""
    bone = shell.bone[:-2] + ".R" if shell.bone and shell.bone.endswith(".L") else shell.bone
    return Shell(
        shell.vertices * [-1, 1, 1], [face[::-1] for face in shell.faces], list(shell.materials), bone, shell.blend
    )


def ring_faces(rings, sides):
    """Quads between successive closed rings of vertices, outward for rings that turn
    counter-clockwise seen from the end."""
    return [
        (r * sides + s, r * sides + (s + 1) % sides, (r + 1) * sides + (s + 1) % sides, (r + 1) * sides + s)
        for r in range(rings - 1)
        for s in range(sides)
    ]


def tube(path, radii, sides, material, bone, flatten=1.0, flat_axis=UP):
    """A closed tube along path (N, 3); radii (N,); flattened across flat_axis."""
    path, radii = np.asarray(path, float), np.asarray(radii, float)
    tangents = np.gradient(path, axis=0)
    if abs(tangents[len(path) // 2] @ flat_axis) > 0.9 * np.linalg.norm(tangents[len(path) // 2]):
        flat_axis = np.array([0.0, 0.0, 1.0])  # any axis serves that is not the tube's own
    turn = 2 * np.pi * np.arange(sides) / sides
    rings = []
    for point, radius, tangent in zip(path, radii, tangents):
        side, up, _ = frame_along(tangent, flat_axis)
        rings.append(point + radius * (np.cos(turn)[:, None] * side + flatten * np.sin(turn)[:, None] * up))
    count = len(path)
    vertices = np.vstack(rings + [path[:1], path[-1:]])
    faces = ring_faces(count, sides)
    first, last, low = count * sides, count * sides + 1, (count - 1) * sides
    faces += [(first, (s + 1) % sides, s) for s in range(sides)]
    faces += [(last, low + s, low + (s + 1) % sides) for s in range(sides)]
    return Shell(vertices, faces, material, bone)


def curve(points, t):
    """Quadratic Bezier curve with three control points at parameters t (N,): (N, 3)."""
    a, b, c = (np.asarray(p, float) for p in points)
    t = np.asarray(t, float)[:, None]
    return (1 - t) ** 2 * a + 2 * t * (1 - t) * b + t * t * c


def eye():
    """Left eyeball, looking forward and a little inward and down; iris and pupil are materials."""
    gaze = np.array([0.0, -0.04, 1.0])
    side, up, forward = frame_along(gaze, UP)
    polar = np.radians([0, 15, 33, 38, 52, 75, 100, 130, 155])[1:]
    sides = 16
    turn = 2 * np.pi * np.arange(sides) / sides
    rings = [
        np.cos(a) * forward + np.sin(a) * (np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * up) for a in polar
    ]
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


def tusk(side, length):
    """A tusk of the lower jaw; length 1 is whole, less is broken off there."""
    root = np.array([0.086 * side, 1.918, 0.468])
    bend = np.array([0.112 * side, 1.985, 0.520])
    tip = np.array([0.122 * side, 2.085, 0.480])
    t = np.linspace(0, length, 10)
    path = curve((root, bend, tip), t)
    return tube(path, 0.024 * ((1 - t) ** 0.7 * 0.93 + 0.07), 12, "tusk", "jaw")


def teeth():
    """Two tusks, one of them broken, and rows of pegs, carried by jaw and head."""
    shells = [tusk(1, 1.0), tusk(-1, 0.55)]
    lower = [(x, "jaw", 1, 0.474) for x in (-0.052, -0.020, 0.018, 0.048)]
    upper = [(x, "head", -1, 0.448) for x in (-0.070, -0.038, -0.004, 0.034, 0.068)]
    for x, bone, way, front in lower + upper:
        z = front - 4.0 * x * x
        y = ogre_body.mouth_line(x)
        size = 0.0125 + 0.002 * np.sin(311 * x)
        path = np.array(
            [(x, y - way * 0.024, z), (x, y - way * 0.006, z), (x, y + way * 0.007, z), (x, y + way * 0.014, z - 0.001)]
        )
        shells.append(tube(path, size * np.array([1.0, 1.0, 0.85, 0.45]), 8, "tusk", bone))
    return shells


def nail(point, direction, normal, width, bone):
    """A flat shell on the back of a finger or toe tip."""
    direction = direction / np.linalg.norm(direction)
    along = np.array([-1.0, -0.75, -0.1, 0.6, 1.0])
    path = (
        point
        + np.outer(along * 0.95 * width, direction)
        - np.outer(0.30 * width * np.clip(along, 0, None) ** 2, normal)
    )
    return tube(path, width * np.array([0.35, 0.72, 0.85, 0.80, 0.45]), 6, "nail", bone, 0.35, normal)


def nails():
    """Finger and toe nails of the left side."""
    shells = []
    for finger in FINGERS:
        _, middle, tip = ogre_body.finger_chain(finger)
        radius = ogre_body.FINGER_RADII[finger][2]
        direction = (tip - middle) / np.linalg.norm(tip - middle)
        normal = HAND_BACK - (HAND_BACK @ direction) * direction
        normal /= np.linalg.norm(normal)
        place = tip + 0.82 * radius * normal + 0.35 * radius * direction
        shells.append(nail(place, direction, normal, 0.66 * radius, f"{finger}2.L"))
    for root, tip, radius in zip(ogre_body.TOE_ROOTS, ogre_body.TOE_TIPS, ogre_body.TOE_RADII):
        root, tip = np.array(root), np.array(tip)
        direction = (tip - root) / np.linalg.norm(tip - root)
        shells.append(
            nail(tip + 0.74 * radius * UP + 0.38 * radius * direction, direction, UP, 0.62 * radius, "toes.L")
        )
    return shells


def march(origins, directions, start, offset):
    """Points (N, 3) where rays from outside (start, metres) come to `offset` from the skin."""
    reach = np.full(len(origins), float(start))
    for _ in range(40):
        gap = ogre_body.distance(origins + reach[:, None] * directions) - offset
        reach = np.maximum(reach - 0.7 * gap, 0.0)
    return origins + reach[:, None] * directions


def band(centre, axis, start, half_height, thickness, sides, material, taut=4, lift=0.004):
    """A strap around the body: the section of the skin by a plane, thickened.

    Rays from start metres away come in to the centre; half_height, thickness, lift in metres.
    """
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    side, up, _ = frame_along(axis, np.array([0.0, 0.0, 1.0]))
    turn = 2 * np.pi * np.arange(sides) / sides
    outward = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * up
    # Around the strap's section; the inner side sinks in, or it would show in hollows.
    profile = [
        (0.0, -1.5),
        (-1.0, -0.6),
        (-1.0, 0.7),
        (-0.8, 1.0),
        (-0.3, 1.0),
        (0.3, 1.0),
        (0.8, 1.0),
        (1.0, 0.7),
        (1.0, -0.6),
    ]
    rings = []
    for height, out in profile:
        origins = np.broadcast_to(centre + height * half_height * axis, (sides, 3))
        reach = np.linalg.norm(march(origins, outward, start, lift) - origins, axis=1)
        for _ in range(taut):  # leather spans hollows
            reach = np.maximum(reach, (np.roll(reach, 1) + np.roll(reach, -1)) / 2)
        rings.append(origins + (reach + out * thickness)[:, None] * outward)
    count = len(profile)
    faces = ring_faces(count, sides)
    faces += [
        ((count - 1) * sides + s, (count - 1) * sides + (s + 1) % sides, (s + 1) % sides, s) for s in range(sides)
    ]
    return Shell(np.vstack(rings), faces, material)


BELT_CENTRE, BELT_AXIS = np.array([0, 0.985, -0.02]), np.array([0, 0.975, 0.22])


def belt():
    """Leather belt under the belly, its round buckle, and rivets."""
    strap = band(BELT_CENTRE, BELT_AXIS, 0.9, 0.046, 0.018, 64, "leather")
    front = strap.vertices[np.argmax(strap.vertices[:, 2])] * [0, 1, 1] - (0, 0.018, 0)
    lean = np.array([0, -0.35, 1.0])
    disc = tube(
        [front + depth * lean for depth in (-0.035, 0.012, 0.020, 0.014, 0.026)],
        [0.078, 0.082, 0.066, 0.050, 0.018],
        20,
        "metal",
        None,
    )
    return [strap, disc]


STRAP_CENTRE = np.array([0.02, 1.58, -0.03])
STRAP_AXIS = np.array([0.66, 0.75, 0.10])


def baldric():
    """A leather strap from the right shoulder to the left hip, with metal studs."""
    strap = band(STRAP_CENTRE, STRAP_AXIS, 0.95, 0.040, 0.012, 72, "leather", taut=20, lift=0.007)
    outer = strap.vertices.reshape(9, 72, 3)[4:6].mean(axis=0)
    shells = [strap]
    for at in range(0, 72, 6):
        out = np.cross(outer[(at + 1) % 72] - outer[at - 1], STRAP_AXIS)
        out /= np.linalg.norm(out)
        out *= np.sign(out @ (outer[at] - STRAP_CENTRE))
        shells.append(
            tube([outer[at] + depth * out for depth in (-0.006, 0.004, 0.010)], [0.019, 0.018, 0.009], 7, "metal", None)
        )
    return shells


def flap(sign, columns=21, rows=12):
    """A ragged hide hanging from the belt, in front (sign 1) or behind (sign -1)."""
    u = np.linspace(-1, 1, columns)
    length = 0.40 + 0.035 * np.sin(5.1 * u + sign) + 0.028 * np.sign(np.sin(17.0 * u + 0.7))
    top = BELT_CENTRE[1] - sign * 0.22 / 0.975 * 0.30
    direction = np.tile([0.0, 0.0, float(sign)], (columns, 1))
    sheet = np.zeros((rows, columns, 3))
    above = np.zeros(columns)
    for row in range(rows):
        t = row / (rows - 1)
        x = u * (0.25 + 0.03 * t)
        origins = np.column_stack([x, top + 0.02 - t * length, np.zeros(columns)])
        reach = march(origins, direction, 0.8, 0.022)[:, 2] * sign
        reach = np.where(reach < 0.02, 0.0, reach)
        # Cloth hangs straight down from what holds it out, and spans gaps.
        reach = np.maximum(reach, above - 0.10 * length / (rows - 1))
        for _ in range(4):
            padded = np.pad(reach, 1, mode="edge")
            reach = np.maximum(reach, (padded[:-2] + padded[2:]) / 2)
        above = reach
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
    shells = [band(ELBOW + 0.77 * along, along, 0.3, 0.070, 0.010, 20, "leather", lift=0.007)]
    for place in (0.625, 0.915):
        shells.append(band(ELBOW + place * along, along, 0.3, 0.011, 0.017, 20, "metal"))
    return shells


def topknot():
    """A tied tuft of hair that falls backward."""
    path = curve(((0, 2.265, 0.17), (0, 2.47, 0.13), (0, 2.34, -0.12)), np.linspace(0, 1, 12))
    radii = [0.040, 0.036, 0.026, 0.026, 0.040, 0.048, 0.048, 0.044, 0.038, 0.030, 0.018, 0.006]
    tie = tube(path[1:5:1] + (0, 0.004, 0), [0.030, 0.040, 0.038, 0.028], 14, "leather", "topknot")
    return [tube(path, radii, 14, "hair", "topknot"), tie]


def earring():
    """A metal ring through the left ear."""
    turn = np.linspace(0, 2 * np.pi, 17)[:-1]
    centre = np.array([0.222, 2.082, 0.182])
    ring = centre + 0.030 * (np.cos(turn)[:, None] * [0.5, 0, -0.86] + np.sin(turn)[:, None] * UP)
    sides = 8
    around = 2 * np.pi * np.arange(sides) / sides
    rings = []
    for point in ring:
        out = (point - centre) / 0.030
        axis = np.array([0.86, 0, 0.5])
        rings.append(point + 0.0065 * (np.cos(around)[:, None] * out + np.sin(around)[:, None] * axis))
    count = len(ring)
    faces = [
        (
            r * sides + s,
            ((r + 1) % count) * sides + s,
            ((r + 1) % count) * sides + (s + 1) % sides,
            r * sides + (s + 1) % sides,
        )
        for r in range(count)
        for s in range(sides)
    ]
    return Shell(np.vstack(rings), faces, "metal", "head")


def all_parts():
    """Every shell of both sides."""
    left = [eye()] + nails() + bracer()
    return (
        left
        + [mirrored(shell) for shell in left]
        + teeth()
        + belt()
        + baldric()
        + [flap(1), flap(-1)]
        + topknot()
        + [earring()]
    )
