"""What each skinning method does to a twist and to a bend, measured: the table in methods.md.

./dev build
PYTHONPATH=build/python /usr/bin/python3 docs/make_methods_table.py
"""

import re
from pathlib import Path

import numpy as np
import sinew_native as sinew

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs/methods.md"
TWISTS = (90, 150, 180)
BEND = 120
SHARE, SMOOTHING = 0.5, 20  # of Blended; iterations of Smooth
TABLE = re.compile(r"^\| Method \| twist (?:.+\n)+", re.MULTILINE)


class Limb:
    """Two bones that meet at a joint, and the skin around it."""

    def __init__(self, name, joint):
        """name: of a folder of data/; joint: where the second bone begins."""
        self.rig = rig = sinew.read_rig(ROOT / "data" / name)
        skeleton, columns = rig.skeleton, rig.skeleton.weight_columns
        weights = np.zeros((len(rig.positions), skeleton.joint_count))
        weights[:, columns >= 0] = rig.weights[:, columns[columns >= 0]]
        self.skin = sinew.Skin.from_dense(rig.positions, weights)
        self.joint = skeleton.names.index(joint)
        upper = skeleton.parents[self.joint]
        self.points = skeleton.heads[upper], skeleton.heads[self.joint], skeleton.tails[self.joint]
        self.rest = rig.positions.astype(float)
        self._cut_out(weights[:, upper] + weights[:, self.joint] > 0.5)

        faces = rig.face_offsets, rig.face_vertices
        self.centers = sinew.RotationCenters.compute(self.skin, *faces)
        self.mush = sinew.DirectDeltaMush.compute(self.skin, *faces)
        strongest = np.eye(weights.shape[1])[weights.argmax(axis=1)]
        self.mush_of_parts = sinew.DirectDeltaMush(rig.positions, *faces, strongest)
        edges = np.concatenate([_edges(each) for each in _polygons(rig)])
        topology = sinew.Topology(len(weights), np.unique(np.sort(edges, axis=1), axis=0), *faces)
        self.smooth = sinew.CorrectiveSmooth(topology, rig.positions).stage(iterations=SMOOTHING)

    def _cut_out(self, follows):
        """The piece between the middles of the two bones: its vertices, and the triangles around it, closed at either
        end by a fan about a point behind the last vertex. follows (V,): whose vertices the two bones move mostly."""
        start, joint, end = self.points
        along = [(self.rest - joint) @ (other - joint) / ((other - joint) @ (other - joint)) for other in (start, end)]
        keep = follows & (along[0] < 0.5) & (along[1] < 0.5)
        skin = self.rig.face_materials <= 0  # not what it wears, if it wears something
        polygons = [polygon for face, polygon in enumerate(_polygons(self.rig)) if skin[face] and keep[polygon].all()]
        sides = [tuple(side) for polygon in polygons for side in _edges(polygon)]
        open_sides = np.array(sorted(set(sides) - {side[::-1] for side in sides}))[:, ::-1]
        is_upper = along[0][open_sides[:, 0]] > 0.25
        self.vertices = np.unique(np.concatenate(polygons))
        self.ends = [np.unique(open_sides[is_upper]), np.unique(open_sides[~is_upper])]
        triangles = [(p[0], p[i], p[i + 1]) for p in polygons for i in range(1, len(p) - 1)]
        fans = np.column_stack([open_sides, len(self.rest) + ~is_upper])
        self.triangles = np.concatenate([triangles, fans])

    @property
    def directions(self):
        """Of the two bones."""
        start, joint, end = self.points
        return [each / np.linalg.norm(each) for each in (joint - start, end - joint)]

    def turned(self, axis, degrees):
        """(J, 4, 4): skinning matrices where the second bone has turned about an axis."""
        rotations = np.tile([1.0, 0, 0, 0], (self.rig.skeleton.joint_count, 1))
        half = np.radians(degrees) / 2
        rotations[self.joint] = [np.cos(half), *np.sin(half) * axis / np.linalg.norm(axis)]
        world = sinew.forward_kinematics(self.rig.skeleton, sinew.rotation_transforms(rotations))
        return sinew.skinning_matrices(self.rig.skeleton, world)

    def twisted(self, degrees):
        return self.turned(self.directions[1], degrees)

    def bent(self, degrees):
        """To this angle between the bones' directions: 0 is a straight limb."""
        upper, lower = self.directions
        return self.turned(np.cross(upper, lower), degrees - np.degrees(np.arccos(upper @ lower)))

    def shapes(self, matrices):
        """{method: positions (V, 3)}"""
        half = sinew.BlendShares(np.full(len(self.rest), SHARE))
        linear = sinew.skin_linear(self.skin, matrices)
        smoothed = linear.copy()
        self.smooth.apply(smoothed)
        return {
            "Linear": linear,
            "Dual Quaternion": sinew.skin_dual_quaternion(self.skin, matrices),
            "Blended": sinew.skin_blended(self.skin, half, matrices),
            "Centers of Rotation": sinew.skin_rotation_centers(self.skin, self.centers, matrices),
            "Direct Delta Mush": sinew.skin_direct_delta_mush(self.mush, matrices),
            "Linear, Smooth": smoothed,
            "Direct Delta Mush, one bone a vertex": sinew.skin_direct_delta_mush(self.mush_of_parts, matrices),
        }

    def volume(self, shape):
        """Of the piece, in percent of what it is at rest."""
        return 100 * self._volume(shape.astype(float)) / self._volume(self.rest)

    def _volume(self, shape):
        corners = np.concatenate([shape, [shape[end].mean(axis=0) for end in self.ends]])[self.triangles]
        return np.linalg.det(corners).sum() / 6

    def bulge(self, shape, matrices):
        """By how many percent the vertex of the piece that has gained most is farther from the bones than at rest."""
        start, joint, end = self.points
        posed = (matrices[self.joint] @ [*end, 1])[:3]
        before = _distance(self.rest[self.vertices], start, joint, end)
        return 100 * (_distance(shape[self.vertices], start, joint, posed) / before).max() - 100


def _polygons(rig):
    return np.split(rig.face_vertices, rig.face_offsets[1:-1])


def _edges(polygon):
    return np.column_stack([polygon, np.roll(polygon, -1)])


def _distance(points, *line):
    """(N,): from the nearest point of a line of segments."""
    found = []
    for begin, end in zip(line, line[1:]):
        along = np.clip((points - begin) @ (end - begin) / ((end - begin) @ (end - begin)), 0, 1)
        found.append(np.linalg.norm(points - begin - along[:, None] * (end - begin), axis=1))
    return np.min(found, axis=0)


def limbs():
    """The one that is twisted, the one that is bent."""
    return Limb("capsule", "upper"), Limb("ogre", "forearm.L")


def measure(capsule, ogre):
    """{method: [volume at each of TWISTS, volume at BEND, bulge at BEND]}, in percent."""
    rows = {}
    for degrees in TWISTS:
        for method, shape in capsule.shapes(capsule.twisted(degrees)).items():
            rows.setdefault(method, []).append(capsule.volume(shape))
    matrices = ogre.bent(BEND)
    for method, shape in ogre.shapes(matrices).items():
        rows[method] += [ogre.volume(shape), ogre.bulge(shape, matrices)]
    return rows


def table(rows):
    heads = ["Method", *(f"twist {degrees}°" for degrees in TWISTS), f"elbow {BEND}°", "bulge there"]
    lines = [heads, ["---", *["---:"] * (len(heads) - 1)]]
    lines += [[method, *(f"{number:.0f} %" for number in numbers)] for method, numbers in rows.items()]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def read_table(page):
    """What table() wrote, whole numbers."""
    lines = TABLE.search(page)[0].splitlines()[2:]
    return {line.split(" | ")[0][2:]: [int(number) for number in re.findall(r"(-?\d+) %", line)] for line in lines}


if __name__ == "__main__":
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(TABLE.sub(lambda _: table(measure(*limbs())), text), encoding="utf-8")
