"""The description of a cache's content, which is saved beside the cache. Pure."""

import io
import json
import math
import os
from dataclasses import dataclass

import numpy as np

from . import frame_range, point_cache, systems

VERSION = 1


@dataclass(frozen=True)
class Subject:
    """What is baked into a cache. Processes that bake equal subjects into one folder fill the same files."""

    object: str
    format: str  # of point_cache.FORMATS
    vertex_count: int
    frames: frame_range.FrameRange
    rate: float  # frames per second
    until_subdivision: bool
    blend: str  # digest of the saved file, or "": a bake continues only from the same state of the file

    @property
    def layout(self) -> point_cache.Layout:
        return point_cache.Layout(self.format, self.vertex_count, self.frames, self.rate)

    def line(self) -> bytes:
        """Returns a line of JSON, the same bytes for equal subjects."""
        fields = {**vars(self), "frames": str(self.frames), "version": VERSION}
        return json.dumps(fields, sort_keys=True).encode() + b"\n"


def parse(line: bytes) -> Subject:
    """Returns the Subject described by a line of JSON. Raises ValueError."""
    try:
        fields = json.loads(line)
        if fields.pop("version") != VERSION:
            raise ValueError
        subject = Subject(**{**fields, "frames": frame_range.parse(fields["frames"])})
        _check(subject)
        return subject
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError) as error:
        raise ValueError("it is not a description that this version of Sinew has written") from error


def _check(subject):
    """Checks the values, since somebody may have edited the file. Raises ValueError."""
    is_sound = (
        isinstance(subject.object, str)
        and subject.format in point_cache.FORMATS
        and type(subject.vertex_count) is int
        and 0 <= subject.vertex_count <= point_cache.MOST_VERTICES
        and type(subject.rate) in (int, float)
        and math.isfinite(subject.rate)
        and subject.rate > 0
        and isinstance(subject.until_subdivision, bool)
        and isinstance(subject.blend, str)
    )
    if not is_sound:
        raise ValueError


WORDS = {
    "object": "the object {}",
    "format": "the format {}",
    "vertex_count": "{:,} vertices",
    "frames": "the frames {}",
    "rate": "{:g} frames a second",
}


def difference(there: Subject, here: Subject) -> tuple[str, str]:
    """Returns (there, here): the first difference between two subjects, in words."""
    for name, words in WORDS.items():
        if getattr(there, name) != getattr(here, name):
            return words.format(getattr(there, name)), words.format(getattr(here, name))
    if there.until_subdivision != here.until_subdivision:
        shapes = "all modifiers", "the modifiers before Subdivision"
        return shapes[there.until_subdivision], shapes[here.until_subdivision]
    return "another state of the .blend", "the present one"


# --- files beside a cache -------------------------------------------------------------------------


def path_beside(path: str) -> str:
    """Returns NAME.pc2.json."""
    return f"{path}.json"


def world_beside(path: str) -> str:
    """Returns NAME.pc2.world.npy."""
    return f"{path}.world.npy"


def world_header(count: int) -> bytes:
    """Returns the header of a .npy file with (count, 4, 4) float64."""
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": "<f8", "fortran_order": False, "shape": (count, 4, 4)})
    return stream.getvalue()


def of_cache(path: str) -> Subject:
    """Returns the Subject of a complete cache. Raises ValueError or OSError."""
    file = path_beside(path)
    with open(systems.native(file), "rb", opener=systems.open_file) as stream:
        try:
            return parse(stream.read())
        except ValueError as error:
            raise ValueError(f"{file}: {error}") from error


def is_whole(path: str, subject: Subject) -> bool:
    """Whether the finished cache of exactly this subject exists at path."""
    try:
        return of_cache(path) == subject and os.path.getsize(systems.native(path)) == subject.layout.size
    except (ValueError, OSError):
        return False
