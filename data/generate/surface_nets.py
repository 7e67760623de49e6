"""Even quad meshes of signed distances: surface nets on a grid that is finer where it matters.

Gibson, "Constrained elastic surface nets" (1998), one vertex a cell, one quad a crossed edge.
The grid is regular in a warped space: each Zoom shrinks the cells around its centre, so that a
face or a hand gets more quads than a belly, with no seam between the densities.
"""

import numpy as np

BLOCK = 8  # cells a side of the blocks that are skipped when far from the surface


class Zoom:
    """Cells near `centre` are `factor` times smaller out to `radius`, then grow to normal."""

    def __init__(self, centre, radius, factor, fade):
        self.centre, self.radius, self.fade = np.asarray(centre, float), radius, fade
        self.shrink = 1.0 / factor

    def to_world(self, points):
        """Grid space (N, 3) -> world space (N, 3): a radial map with slope 1/factor, then 1."""
        away = points - self.centre
        r = np.linalg.norm(away, axis=1)
        inner = self.radius / self.shrink  # the zone's radius before it is shrunk
        s = np.clip((r - inner) / self.fade, 0, 1)
        rising = self.fade * (s**3 - s**4 / 2) + np.maximum(r - inner - self.fade, 0)
        mapped = self.shrink * r + (1 - self.shrink) * rising
        return self.centre + away * (mapped / np.maximum(r, 1e-9))[:, None]

    def to_grid(self, points):
        """Inverse of to_world, by bisection on the radius."""
        away = points - self.centre
        goal = np.linalg.norm(away, axis=1)
        low, high = goal.copy(), goal / self.shrink
        along = away / np.maximum(goal, 1e-9)[:, None]
        for _ in range(40):
            middle = (low + high) / 2
            reached = self.to_world(self.centre + along * middle[:, None]) - self.centre
            above = np.linalg.norm(reached, axis=1) > goal
            low, high = np.where(above, low, middle), np.where(above, middle, high)
        return self.centre + along * middle[:, None]


def warp(points, zooms):
    """Grid space -> world space through all zooms."""
    for zoom in zooms:
        points = zoom.to_world(points)
    return points


def unwarp(points, zooms):
    """World space -> grid space."""
    for zoom in reversed(zooms):
        points = zoom.to_grid(points)
    return points


def sample(distance, low, cell, counts, zooms):
    """Distances at the corners of a grid, coarse first: blocks far from the surface keep a sign."""

    def at(indices):
        return distance(warp(low + cell * indices, zooms))

    coarse_counts = [n // BLOCK + 1 for n in counts]
    coarse = np.stack(np.meshgrid(*[np.arange(n) for n in coarse_counts], indexing="ij"), -1)
    rough = at((coarse.reshape(-1, 3) * BLOCK + BLOCK / 2).astype(float)).reshape(coarse_counts)
    values = np.repeat(np.repeat(np.repeat(rough, BLOCK, 0), BLOCK, 1), BLOCK, 2)
    values = values[: counts[0], : counts[1], : counts[2]].copy()
    # 1.3 allows for blended distances, which are not quite true distances.
    close = np.abs(values) < 1.3 * cell * BLOCK * np.sqrt(3) / 2 + cell
    indices = np.argwhere(close)
    values[close] = np.concatenate(
        [at(part.astype(float)) for part in np.array_split(indices, len(indices) // 400000 + 1)]
    )
    return values


def without_ambiguity(values):
    """Fills the corners that would make the surface touch itself in an edge or a point."""
    values = values.copy()
    for _ in range(20):
        inside = values < 0
        fill = np.zeros_like(inside)
        for a, b in ((0, 1), (0, 2), (1, 2)):
            c00, c10, c01, c11 = (_shifted(inside, {a: i, b: j}) for i, j in ((0, 0), (1, 0), (0, 1), (1, 1)))
            first = c00 & c11 & ~c10 & ~c01
            second = ~c00 & ~c11 & c10 & c01
            fill |= _placed(first, inside.shape, {a: 1}) | _placed(second, inside.shape, {})
        for corner in np.ndindex(2, 2, 2):  # two opposite corners of a cube
            cube = {key: _shifted(inside, dict(enumerate(key))) for key in np.ndindex(2, 2, 2)}
            opposite = tuple(1 - c for c in corner)
            alone = sum(v.astype(int) for v in cube.values())
            for count, state in ((2, True), (6, False)):
                bad = (alone == count) & (cube[corner] == state) & (cube[opposite] == state)
                for key in cube:
                    fill |= _placed(bad & ~cube[key], inside.shape, dict(enumerate(key)))
        if not fill.any():
            return values
        values[fill] = -1e-4
    return values


def _shifted(array, offsets):
    """The array as cells see the corner at offsets (axis -> 0 or 1); other axes stay whole."""
    window = [slice(None)] * 3
    for axis, offset in offsets.items():
        window[axis] = slice(1, None) if offset else slice(None, -1)
    return array[tuple(window)]


def _placed(mask, shape, offsets):
    """A mask over cells put back at the corner at offsets of a full grid."""
    full = np.zeros(shape, bool)
    window = tuple(slice(offsets.get(axis, 0), offsets.get(axis, 0) + mask.shape[axis]) for axis in range(3))
    full[window] = mask
    return full


def surface_net(values):
    """Vertices (V, 3) in grid units and quads (Q, 4), outward, of the zero level of values."""
    cells_of_quads, points = [], []
    inside = values < 0
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        start = _shifted(inside, {axis: 0})
        end = _shifted(inside, {axis: 1})
        edges = np.argwhere(start != end)
        along = np.eye(3, dtype=int)[axis]
        a, b = values[tuple(edges.T)], values[tuple((edges + along).T)]
        where = edges + (a / (a - b))[:, None] * along
        du, dv = np.eye(3, dtype=int)[u], np.eye(3, dtype=int)[v]
        around = np.stack([edges - du - dv, edges - dv, edges, edges - du], axis=1)
        outward = a < 0  # inside at the start: the normal is +axis
        around[~outward] = around[~outward][:, ::-1]
        cells_of_quads.append(around)
        points.append(np.repeat(where[:, None], 4, axis=1))
    cells, points = np.concatenate(cells_of_quads), np.concatenate(points)
    flat = np.ravel_multi_index(cells.reshape(-1, 3).T, np.array(values.shape) - 1)
    vertex = np.unique(flat, return_inverse=True)[1]
    sums = np.stack([np.bincount(vertex, points.reshape(-1, 3)[:, i]) for i in range(3)], axis=1)
    return sums / np.bincount(vertex)[:, None], vertex.reshape(-1, 4)


def edge_list(quads):
    """Each undirected edge (E, 2) of the faces once."""
    pairs = np.concatenate(
        [np.stack([quads[:, i], quads[:, (i + 1) % quads.shape[1]]], axis=1) for i in range(quads.shape[1])]
    )
    return np.unique(np.sort(pairs, axis=1), axis=0)


def neighbour_mean(values, edges):
    """Mean of the neighbours' values (V, C)."""
    count = np.bincount(edges.ravel(), minlength=len(values))
    total = np.stack(
        [
            np.bincount(edges[:, 0], column[edges[:, 1]], len(values))
            + np.bincount(edges[:, 1], column[edges[:, 0]], len(values))
            for column in values.T
        ],
        axis=1,
    )
    return total / np.maximum(count, 1)[:, None]


def largest_piece(vertices, quads):
    """Drops all but the largest connected piece: bubbles enclosed in the clay."""
    piece = np.arange(len(vertices))
    before = None
    while before is None or (before != piece).any():
        before = piece.copy()
        np.minimum.at(piece, quads.ravel(), np.repeat(piece[quads].min(axis=1), 4))
        piece = piece[piece]
    kept = piece == np.bincount(piece).argmax()
    renumbered = np.cumsum(kept) - 1
    return vertices[kept], renumbered[quads[kept[quads[:, 0]]]]


def gradient(distance, points, step=0.0015):
    """Central differences of a distance (N, 3)."""
    return np.stack(
        [(distance(points + step * axis) - distance(points - step * axis)) / (2 * step) for axis in np.eye(3)], axis=1
    )


def project(points, distance, limit):
    """One Newton step on to the surface, no longer than limit (metres, (N,) or a number)."""
    slope = gradient(distance, points)
    length2 = np.maximum((slope**2).sum(axis=1), 0.05)
    move = distance(points) / length2
    step = np.linalg.norm(slope, axis=1) * np.abs(move)
    move *= np.minimum(1, limit / np.maximum(step, 1e-12))
    return points - slope * move[:, None]


def mesh_of(distance, low, high, cell, zooms=(), rounds=4):
    """Vertices (V, 3) in metres and quads (Q, 4) of distance = 0 inside the world box low..high.

    cell is the grid spacing in metres where no zoom is. Rounds of sliding toward the neighbours
    and back on to the surface make the quads even.
    """
    # Zooms bend the box: its grid-space extent shows only on a dense sampling of it.
    steps = np.stack(np.meshgrid(*[np.linspace(0, 1, 13)] * 3), axis=-1).reshape(-1, 3)
    bent = unwarp(low + steps * (high - low), zooms)
    low, high = bent.min(axis=0), bent.max(axis=0)
    counts = np.ceil((high - low) / cell).astype(int) + 1
    values = without_ambiguity(sample(distance, low, cell, counts, zooms))
    vertices, quads = largest_piece(*surface_net(values))
    vertices = warp(low + cell * vertices, zooms)
    edges = edge_list(quads)
    for _ in range(rounds):
        reach = np.linalg.norm(neighbour_mean(vertices, edges) - vertices, axis=1) + 0.002
        vertices = vertices + 0.5 * (neighbour_mean(vertices, edges) - vertices)
        vertices = project(vertices, distance, 2 * reach)
    return vertices, quads
