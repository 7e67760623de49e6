"""A request for a bake, the names of its files, and its result. Pure."""

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass

from . import point_cache
from .frame_range import FrameRange

USD = "usd"
FORMATS = (*point_cache.FORMATS, USD)
DEVICE = re.compile(r"(con|prn|aux|nul|(com|lpt)[0-9\u00b9\u00b2\u00b3]) *(\.|$)", re.IGNORECASE)  # no files of Windows


@dataclass(frozen=True)
class Job:
    """A request for a bake. Raises ValueError if its options contradict each other."""

    folder: str  # created if it does not exist
    frames: FrameRange
    names: tuple = ()  # of objects; empty: all visible meshes with modifiers or shape keys
    format: str = "pc2"
    chunk: tuple | None = None  # FrameRanges: the frames of this run; the files are laid out for all of `frames`
    overwrite: bool = False
    until_subdivision: bool = False
    usd_points: bool = False  # write points, never a skeleton

    def __post_init__(self):
        if self.format not in FORMATS:
            raise ValueError(f"there is no format {self.format}; choose one of {', '.join(FORMATS)}")
        if self.usd_points and self.format != USD:
            raise ValueError("only a USD file has points instead of a skeleton: choose the format usd")
        if self.chunk is not None and self.format == USD:
            raise ValueError("a USD file is written by one process: bake it without chunks")
        if self.chunk is not None and self.overwrite:
            raise ValueError(
                "a chunk cannot overwrite files: it would remove what other processes bake. Remove the old files "
                "before the first chunk, or choose another folder"
            )

    def indices(self) -> list[int]:
        """Returns the indices, from 0, of the frames of this run."""
        return self.frames.indices_of(self.chunk) if self.chunk is not None else list(range(len(self.frames)))

    def path_of(self, name: str) -> str:
        """Returns the path of an object's cache."""
        return os.path.join(self.folder, f"{file_name(name)}.{'usdc' if self.format == USD else self.format}")

    def check_names(self, names: Iterable[str]) -> None:
        """Raises ValueError if two objects would be written to the same file."""
        found: dict[str, str] = {}
        for name in names:
            other = found.setdefault(file_name(name).lower(), name)
            if other != name:
                raise ValueError(
                    f"{other} and {name} would both be written to {file_name(name)}.{self.format}: rename one of them, "
                    "or bake them into two folders"
                )


def file_name(name: str) -> str:
    """Converts an object's name to a file name, the same on all systems."""
    cleaned = re.sub(r'[\x00-\x1f/\\:*?"<>|]', "_", name)
    return f"_{cleaned}" if cleaned.startswith(".") or DEVICE.match(cleaned) else cleaned


@dataclass
class Baked:
    """The state of one object's cache after a bake."""

    name: str
    path: str
    vertices: int
    frames: int  # number of frames of the whole cache
    baked: int = 0  # frames baked in this run
    found: int = 0  # frames baked before this run
    missing: int = 0  # frames that other runs still have to bake
    remark: str = ""

    def sentence(self) -> str:
        text = f"{self.path}: {self.vertices:,} vertices, {self.baked} of {self.frames} frames baked"
        if self.found:
            text += f", {self.found} already baked"
        text += f"; {self.missing} are missing" if self.missing else ""
        return f"{text}; {self.remark}" if self.remark else text
