"""Point caches: PC2 and MDD. Each frame has a fixed place in the file. Pure.

Letters: F frames, V vertices.

PC2   "POINTCACHE2\\0", 1, V, first frame, frames from one sample to the next, F; then F x V x 3 float32, little-endian
MDD   F, V, F times in seconds, starting at 0; then F x V x 3 float32; all big-endian
"""

import struct
from dataclasses import dataclass

import numpy as np

from . import systems
from .frame_range import FrameRange

PC2_MAGIC = b"POINTCACHE2\0"
PC2_HEADER, MDD_HEADER = struct.Struct("<12siiffi"), struct.Struct(">ii")
NUMBERS = {"pc2": np.dtype("<f4"), "mdd": np.dtype(">f4")}
FORMATS = tuple(NUMBERS)
MOST_VERTICES = 2**31 - 1  # the largest number that a header can hold


@dataclass(frozen=True)
class Layout:
    """The layout of a file in a format of FORMATS."""

    format: str
    vertex_count: int
    frames: FrameRange
    rate: float  # frames per second, no more precise than float32, for MDD's times

    def header(self) -> bytes:
        """Returns the header as bytes."""
        count = len(self.frames)
        if self.format == "pc2":
            return PC2_HEADER.pack(PC2_MAGIC, 1, self.vertex_count, self.frames.first, self.frames.step, count)
        times = np.arange(count) * self.frames.step / self.rate
        return MDD_HEADER.pack(count, self.vertex_count) + times.astype(">f4").tobytes()

    @property
    def frame_size(self) -> int:
        return 12 * self.vertex_count

    @property
    def size(self) -> int:
        """The size of the whole file, in bytes."""
        return self.offset(len(self.frames))

    def offset(self, index: int) -> int:
        """Returns where the frame with that index, from 0, begins."""
        start = PC2_HEADER.size if self.format == "pc2" else MDD_HEADER.size + 4 * len(self.frames)
        return start + index * self.frame_size

    def encode(self, positions: np.ndarray) -> memoryview:
        """Converts positions (V, 3) float32 to the bytes of the file, without a copy where none is needed."""
        # numpy's types do not declare arrays as buffers.
        return memoryview(
            np.ascontiguousarray(positions, NUMBERS[self.format]).reshape(-1).view(np.uint8)  # type: ignore[arg-type]
        )


def read_header(path: str) -> tuple[int, float | None, float]:
    """Returns (V, first frame or None, step) from the file's header. Raises ValueError if it is neither PC2 nor MDD, or
    OSError."""
    with open(systems.native(path), "rb") as file:
        start = file.read(PC2_HEADER.size)
    if start.startswith(PC2_MAGIC) and len(start) == PC2_HEADER.size:
        _magic, _version, vertices, first, step, _count = PC2_HEADER.unpack(start)
        return vertices, first, step or 1.0
    if path.endswith(".mdd") and len(start) >= MDD_HEADER.size:
        return MDD_HEADER.unpack_from(start)[1], None, 1.0
    raise ValueError(f"{path} is neither a PC2 nor an MDD file")


def read_frame(path: str, layout: Layout, index: int) -> np.ndarray:
    """Returns the positions of one frame, (V, 3) float32."""
    found = np.fromfile(
        systems.native(path), NUMBERS[layout.format], 3 * layout.vertex_count, offset=layout.offset(index)
    )
    return found.astype(np.float32).reshape(-1, 3)
