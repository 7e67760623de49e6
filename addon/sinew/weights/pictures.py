"""Draws meshes into a picture without a window or a graphics card. Independent of Blender."""

import struct
import zlib
from pathlib import Path

import numpy as np

BACKGROUND = (0.92, 0.92, 0.93)
_PER_PIXEL = 1.4  # samples along a pixel's side, so that no pixel of a triangle is left out
_MOST_SAMPLES = 64  # along a triangle's side


class Picture:
    """A square of pixels with depth, in which what is nearer hides what is behind."""

    def __init__(self, size: int) -> None:
        """size: pixels along a side."""
        self.size = size
        self.colors = np.tile(np.array(BACKGROUND, np.float32), (size * size, 1))
        self._depth = np.full(size * size, np.inf)

    def draw(self, points: np.ndarray, triangles: np.ndarray, colors: np.ndarray) -> None:
        """Draws triangles (T, 3) of points (V, 3) in pixels: x to the right, y up, z away. colors (V, 3), 0 to 1, are
        darkened where the surface is seen from the side."""
        corners = points[triangles]
        low, high = corners[..., :2].min(axis=1), corners[..., :2].max(axis=1)
        seen = ((high >= 0) & (low < self.size)).all(axis=1) & np.isfinite(corners).all(axis=(1, 2))
        corners, own = corners[seen], colors[triangles[seen]]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1)
        facing = np.abs(normals[:, 2]) / np.where(lengths > 0, lengths, 1)
        own = own * (0.3 + 0.7 * facing)[:, None, None]
        extent = (corners[..., :2].max(axis=1) - corners[..., :2].min(axis=1)).max(axis=1, initial=0)
        samples = np.clip(np.ceil(_PER_PIXEL * extent), 1, _MOST_SAMPLES).astype(int)
        for count in np.unique(samples).tolist():
            self._splat(corners[samples == count], own[samples == count], count)

    def _splat(self, corners: np.ndarray, colors: np.ndarray, count: int) -> None:
        a, b = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
        inside = a + b <= count
        shares = np.stack((a[inside], b[inside], count - a[inside] - b[inside]), axis=1) / count
        for first in range(0, len(corners), max(1, 2_000_000 // len(shares))):
            own = slice(first, first + max(1, 2_000_000 // len(shares)))
            places = np.einsum("sc,tcx->tsx", shares, corners[own]).reshape(-1, 3)
            shades = np.einsum("sc,tcx->tsx", shares, colors[own]).reshape(-1, 3)
            x, y = np.floor(places[:, 0]).astype(int), np.floor(places[:, 1]).astype(int)
            chosen = np.flatnonzero((x >= 0) & (x < self.size) & (y >= 0) & (y < self.size))
            pixels = (self.size - 1 - y[chosen]) * self.size + x[chosen]
            order = np.lexsort((places[chosen, 2], pixels))
            pixels, chosen = pixels[order], chosen[order]
            nearest = np.flatnonzero(np.diff(pixels, prepend=-1))
            pixels, chosen = pixels[nearest], chosen[nearest]
            before = places[chosen, 2] < self._depth[pixels]
            self._depth[pixels[before]] = places[chosen[before], 2]
            self.colors[pixels[before]] = shades[chosen[before]]

    def pixels(self) -> np.ndarray:
        """Returns (size, size, 3), the topmost row first, 0 to 1."""
        return self.colors.reshape(self.size, self.size, 3)


def side_by_side(tiles: list[np.ndarray], columns: int) -> np.ndarray:
    """Returns one picture of tiles (size, size, 3), row by row."""
    empty = np.broadcast_to(np.array(BACKGROUND, np.float32), tiles[0].shape)
    filled = tiles + [empty] * (-len(tiles) % columns)
    return np.concatenate(
        [np.concatenate(filled[i : i + columns], axis=1) for i in range(0, len(filled), columns)], axis=0
    )


def write_png(path: Path, pixels: np.ndarray) -> None:
    """Writes pixels (height, width, 3), 0 to 1, as they are shown. Raises OSError, which names the path."""
    height, width = pixels.shape[:2]
    rows = np.zeros((height, 1 + 3 * width), np.uint8)
    rows[:, 1:] = np.round(255 * np.clip(pixels, 0, 1)).reshape(height, -1).astype(np.uint8)

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    body = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows.tobytes(), 6)) + chunk(b"IEND", b"")
    try:
        Path(path).write_bytes(b"\x89PNG\r\n\x1a\n" + body)
    except OSError as error:  # a full disk is reported without one
        raise OSError(error.errno, error.strerror, str(path)) from error
