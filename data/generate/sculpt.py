"""Signed distances to smoothly blended primitives, and where each point belongs.

A Sculpt is a heap of clay evaluated at N points at once: every call adds or carves one
primitive. Distances are in metres, negative inside. Blends are polynomial smooth minima
(Quilez, "Smooth minimum"): k is the width of the blend in metres.
"""

import numpy as np

FAR = 1.0


def smooth_min(a, b, k):
    """Minimum of a and b, rounded off where they differ by less than k."""
    h = np.maximum(k - np.abs(a - b), 0.0) / k
    return np.minimum(a, b) - h * h * k * 0.25


def smooth_max(a, b, k):
    """Maximum of a and b, rounded off where they differ by less than k."""
    return -smooth_min(-a, -b, k)


def round_cone(p, a, b, ra, rb):
    """Distance from p (N, 3) to the hull of two spheres (Quilez, "Round cone")."""
    axis = b - a
    length2 = axis @ axis
    slope = ra - rb
    height2 = length2 - slope * slope
    q = p - a
    y = q @ axis
    z = y - length2
    radial = q * length2 - y[:, None] * axis
    x2 = np.einsum("ij,ij->i", radial, radial)
    y2, z2 = y * y * length2, z * z * length2
    k = np.sign(slope) * slope * slope * x2
    side = (np.sqrt(x2 * height2 / length2) + y * slope) / length2 - ra
    past_b = np.sign(z) * height2 * z2 > k
    before_a = np.sign(y) * height2 * y2 < k
    return np.where(past_b, np.sqrt(x2 + z2) / length2 - rb, np.where(before_a, np.sqrt(x2 + y2) / length2 - ra, side))


def ellipsoid(p, centre, radii, frame=None):
    """Distance (first-order) from p (N, 3); frame: rows are the ellipsoid's axes."""
    q = p - centre
    if frame is not None:
        q = q @ frame.T
    scaled = np.linalg.norm(q / radii, axis=1)
    gradient = np.linalg.norm(q / (radii * radii), axis=1)
    return np.where(scaled > 0.1, scaled * (scaled - 1) / np.maximum(gradient, 1e-9), -radii.min())


def frame_along(direction, up):
    """Orthonormal rows (side, up, direction), with `up` as close as it can be."""
    forward = np.asarray(direction, float) / np.linalg.norm(direction)
    side = np.cross(up, forward)
    side /= np.linalg.norm(side)
    return np.array([side, np.cross(forward, side), forward])


class Sculpt:
    """Clay at fixed points: `distance` (N,), and `owner` (N,), the tag of the nearest primitive."""

    def __init__(self, points):
        self.points = points
        self.distance = np.full(len(points), FAR)
        self.nearest = np.full(len(points), FAR)
        self.owner = np.full(len(points), -1)

    def _near(self, centres, reach):
        """Indices of the points within reach of the box around centres; the rest cannot change."""
        low, high = np.min(centres, axis=0) - reach, np.max(centres, axis=0) + reach
        return np.flatnonzero(((self.points > low) & (self.points < high)).all(axis=1))

    def _join(self, near, new, k, tag):
        self.distance[near] = smooth_min(self.distance[near], new, k)
        if tag is not None:
            closer = new < self.nearest[near]
            self.nearest[near[closer]] = new[closer]
            self.owner[near[closer]] = tag

    def cone(self, a, ra, b, rb, k=0.05, tag=None):
        """Adds a limb from a with radius ra to b with radius rb."""
        a, b = np.asarray(a, float), np.asarray(b, float)
        near = self._near([a, b], max(ra, rb) + k + 0.1)
        self._join(near, round_cone(self.points[near], a, b, ra, rb), k, tag)

    def ball(self, centre, radii, k=0.05, tag=None, frame=None):
        """Adds an ellipsoid (radii: one number or three)."""
        centre, radii = np.asarray(centre, float), np.broadcast_to(np.asarray(radii, float), 3)
        near = self._near([centre], radii.max() + k + 0.1)
        self._join(near, ellipsoid(self.points[near], centre, radii, frame), k, tag)

    def carve_ball(self, centre, radii, k=0.02, frame=None):
        """Cuts an ellipsoid out."""
        centre, radii = np.asarray(centre, float), np.broadcast_to(np.asarray(radii, float), 3)
        near = self._near([centre], radii.max() + k + 0.05)
        hole = ellipsoid(self.points[near], centre, radii, frame)
        self.distance[near] = smooth_max(self.distance[near], -hole, k)

    def carve_cone(self, a, ra, b, rb, k=0.02):
        """Cuts a groove along a round cone."""
        a, b = np.asarray(a, float), np.asarray(b, float)
        near = self._near([a, b], max(ra, rb) + k + 0.05)
        groove = round_cone(self.points[near], a, b, ra, rb)
        self.distance[near] = smooth_max(self.distance[near], -groove, k)

    def carve(self, hole, k):
        """Cuts out a shape given as a distance (N,) of its own."""
        self.distance = smooth_max(self.distance, -hole, k)

    def merge(self, other, k):
        """Adds another Sculpt over the same points as one piece of clay."""
        self.distance = smooth_min(self.distance, other.distance, k)
        closer = other.nearest < self.nearest
        self.nearest = np.where(closer, other.nearest, self.nearest)
        self.owner = np.where(closer, other.owner, self.owner)
