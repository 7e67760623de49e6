"""What is baked into a cache, as it stands beside it. Pure."""

import json
import math
import os
from dataclasses import dataclass

from . import frame_range, point_cache

VERSION = 1


@dataclass(frozen=True)
class Subject:
    """Two processes that bake the same into one folder fill the same files."""

    object: str
    format: str  # of point_cache.FORMATS
    vertex_count: int
    frames: frame_range.FrameRange
    rate: float  # frames a second
    until_subdivision: bool
    blend: str  # digest of the saved file, or "": only from the same state of it does a bake go on

    @property
    def layout(self):
        return point_cache.Layout(self.format, self.vertex_count, self.frames, self.rate)

    def line(self):
        """JSON, the same bytes for the same subject."""
        fields = {**vars(self), "frames": str(self.frames), "version": VERSION}
        return json.dumps(fields, sort_keys=True).encode() + b"\n"


def parse(line):
    """The Subject of a line of JSON. Raises ValueError."""
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
    """Somebody may have edited the file. Raises ValueError."""
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


def difference(there, here):
    """(there, here): what two subjects differ in first, as people say it."""
    for name, words in WORDS.items():
        if getattr(there, name) != getattr(here, name):
            return words.format(getattr(there, name)), words.format(getattr(here, name))
    if there.until_subdivision != here.until_subdivision:
        shapes = "all modifiers", "the modifiers before Subdivision"
        return shapes[there.until_subdivision], shapes[here.until_subdivision]
    return "another state of the .blend", "the present one"


# --- files beside a cache -------------------------------------------------------------------------


def path_beside(path):
    """NAME.pc2.json"""
    return f"{path}.json"


def world_beside(path):
    """NAME.pc2.world.npy"""
    return f"{path}.world.npy"


def of_cache(path):
    """What a whole cache holds. Raises ValueError or OSError."""
    file = path_beside(path)
    with open(file, "rb") as stream:
        try:
            return parse(stream.read())
        except ValueError as error:
            raise ValueError(f"{file}: {error}") from error


def is_whole(path, subject):
    """Whether the cache of just this subject stands there, finished."""
    try:
        return of_cache(path) == subject and os.path.getsize(path) == subject.layout.size
    except (ValueError, OSError):
        return False
