"""Smooth weights: each lump of clay belongs to a bone; heat then spreads over the surface.

The segmentation comes from the sculpt itself, and diffusion follows the surface, so nothing
leaks through the air from a hand to a belly or from lip to lip.
"""

import numpy as np
import ogre_body
from ogre_skeleton import BONES, COLUMN, INDEX, POSITIONS
from surface_nets import edge_list

# How far a bone's influence fades into its neighbour, metres.
SPREAD = {
    "pelvis": 0.085,
    "spine": 0.11,
    "chest": 0.09,
    "neck": 0.055,
    "head": 0.030,
    "jaw": 0.026,
    "brow": 0.024,
    "topknot": 0.02,
    "clavicle": 0.075,
    "upper_arm": 0.065,
    "forearm": 0.05,
    "hand": 0.028,
    "thigh": 0.07,
    "shin": 0.05,
    "foot": 0.035,
    "toes": 0.022,
}
FINGER_SPREAD = 0.014
SMALLEST = 0.004  # weights below this are dropped


def spread_of(bone):
    """Fading length of a bone, metres."""
    stem = bone.split(".")[0]
    return SPREAD.get(stem, FINGER_SPREAD)


def owners(vertices):
    """Weight column (V,) of the bone whose clay is nearest, both sides."""
    owner = ogre_body.clay(vertices).owner
    right = np.array([COLUMN[name[:-2] + ".R"] if name.endswith(".L") else COLUMN[name] for name in BONES])
    owner = np.where(vertices[:, 0] < 0, right[owner], owner)
    return split_head(vertices, owner)


def split_head(vertices, owner):
    """Moves the head's vertices below the mouth, back to the hinge, to the jaw."""
    x, y, z = vertices.T
    hinge = POSITIONS[INDEX["head"]]
    lips = ogre_body.mouth_line(np.minimum(np.abs(x), ogre_body.MOUTH_CORNER))
    backward = np.clip((0.38 - z) / (0.38 - hinge[2]), 0, 1)
    border = lips + (hinge[1] - lips) * backward
    face = np.isin(owner, [COLUMN["head"], COLUMN["jaw"], COLUMN["brow"]])
    below = face & (y < border) & (z > hinge[2] + 0.01)
    owner = np.where(face & (owner != COLUMN["brow"]), COLUMN["head"], owner)
    return np.where(below, COLUMN["jaw"], owner)


def vertex_areas(vertices, quads):
    """A quarter of the area of the quads around each vertex (V,), square metres."""
    diagonal1 = vertices[quads[:, 2]] - vertices[quads[:, 0]]
    diagonal2 = vertices[quads[:, 3]] - vertices[quads[:, 1]]
    area = np.linalg.norm(np.cross(diagonal1, diagonal2), axis=1) / 2
    return np.bincount(quads.ravel(), np.repeat(area / 4, 4), len(vertices))


def diffuse(values, spread, vertices, quads):
    """One implicit step of heat flow, by conjugate gradients.

    Solves (M + L) w = M values, (V, B): M vertex areas, L the graph Laplacian times spread^2,
    where spread (V,) is the fading length in metres.
    """
    edges = edge_list(quads)
    mass = vertex_areas(vertices, quads)[:, None]
    conductance = (spread[edges].mean(axis=1) ** 2)[:, None]
    a, b = edges.T
    order = np.argsort(np.concatenate([a, b]), kind="stable")
    ends = np.concatenate([b, a])[order]
    strength = np.concatenate([conductance, conductance])[order]
    starts = np.searchsorted(np.concatenate([a, b])[order], np.arange(len(vertices)))
    total = np.add.reduceat(strength, starts, axis=0)

    def apply(w):
        return (mass + total) * w - np.add.reduceat(strength * w[ends], starts, axis=0)

    preconditioner = 1 / (mass + total)
    w = values.copy()
    residual = mass * values - apply(w)
    direction = preconditioner * residual
    product = (residual * direction).sum()
    first = product
    for _ in range(400):
        image = apply(direction)
        step = product / (direction * image).sum()
        w += step * direction
        residual -= step * image
        fresh = preconditioner * residual
        following = (residual * fresh).sum()
        if following < 1e-12 * first:
            break
        direction = fresh + following / product * direction
        product = following
    return w


def keep_strongest(weights, count=8):
    """Drops all but the strongest few of each row (V, B) and makes the rows sum to one."""
    limit = np.sort(weights, axis=1)[:, -count][:, None]
    kept = np.where((weights >= limit) & (weights > SMALLEST), weights, 0)
    return kept / kept.sum(axis=1, keepdims=True)


def skin_weights(vertices, quads):
    """Weights (V, B) of the skin."""
    owner = owners(vertices)
    hard = np.eye(len(BONES))[owner]
    spread = np.array([spread_of(bone) for bone in BONES])[owner] / np.sqrt(2)
    # Twice, since one step has a kink at the border; the kink would show as a crease.
    once = diffuse(hard, spread, vertices, quads)
    return keep_strongest(np.clip(diffuse(once, spread, vertices, quads), 0, None))


def nearest_rows(points, vertices, batch=500):
    """Index (N,) of the vertex nearest to each point."""
    return np.concatenate(
        [
            ((part[:, None] - vertices[None]) ** 2).sum(-1).argmin(1)
            for part in np.array_split(points, len(points) // batch + 1)
        ]
    )
