"""The frames of a bake: `A-B` or `A-B:step`, and the part of them that one process bakes. Pure."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

LIMIT = 1_048_574  # Blender's largest frame number


@dataclass(frozen=True)
class FrameRange:
    """The frames first, first + step, ... up to last. Raises ValueError."""

    first: int
    last: int
    step: int = 1

    def __post_init__(self):
        if self.last < self.first:
            raise ValueError(f"the last frame ({self.last}) comes before the first ({self.first}): swap them")
        if self.step < 1:
            raise ValueError(f"the step between frames is {self.step}; the smallest is 1")
        if max(-self.first, self.last) > LIMIT:
            raise ValueError(f"the frames {self} go beyond Blender's, {-LIMIT:,} to {LIMIT:,}; choose others")

    def __str__(self):
        if self.first == self.last:
            return str(self.first)
        return f"{self.first}-{self.last}" + (f":{self.step}" if self.step > 1 else "")

    def __len__(self):
        return (self.last - self.first) // self.step + 1

    def __iter__(self):
        return iter(range(self.first, self.last + 1, self.step))

    def indices_of(self, chunk: Iterable["FrameRange"]) -> list[int]:
        """Returns the indices, from 0, of the frames of this range that are in a chunk (FrameRanges), in order. Raises
        ValueError if the chunk reaches beyond this range or has none of its frames."""
        words = ",".join(map(str, chunk))
        if any(part.first < self.first or part.last > self.last for part in chunk):
            raise ValueError(f"the chunk {words} reaches beyond the frames {self}: choose one within them")
        wanted = set().union(*chunk)
        found = [index for index, frame in enumerate(self) if frame in wanted]
        if not found:
            raise ValueError(f"the chunk {words} has none of the frames {self}: choose one that has some")
        return found


def parse(words: str) -> FrameRange:
    """Parses "A-B", "A-B:step" or one frame "A"; a frame may be negative. Raises ValueError."""
    found = re.fullmatch(r"(-?\d+)(?:-(-?\d+)(?::(\d+))?)?", words)
    if not found:
        raise ValueError(f"{words} is not a range of frames; write it like 1-40, or 1-40:2 for every second frame")
    first = int(found[1])
    return FrameRange(first, int(found[2] or first), int(found[3] or 1))


def parse_chunk(words: str) -> tuple[FrameRange, ...]:
    """Parses one or more comma-separated ranges, as farms write chunks. Returns (FrameRange, ...)."""
    return tuple(map(parse, words.split(",")))


def words_of(frames: Iterable[int], step: int = 1) -> str:
    """Returns ordered frames as people write them: "1-3, 7", or, with a step of 2, "1-5:2, 9"."""
    found: list[list[int]] = []
    for frame in frames:
        if found and frame == found[-1][1] + step:
            found[-1][1] = frame
        else:
            found.append([frame, frame])
    return ", ".join(str(FrameRange(first, last, step)) for first, last in found)
