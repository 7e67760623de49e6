"""Checks whether a cache is complete. Pure."""

import os
import tokenize

import numpy as np

from . import frame_range, part_files, point_cache, systems
from . import subject as subjects


def problems(path: str, frames: frame_range.FrameRange | None = None) -> list[str]:
    """Returns sentences about what is wrong with the cache at path; none if no frame is missing, the sizes are right
    and all numbers are finite. frames: the FrameRange that it should have, or None."""
    name, path = os.path.basename(path), systems.native(path)
    if part_files.is_unfinished(path):
        return [_unfinished(path, name)]
    if not os.path.isfile(path):
        return [f"{name} is missing"]
    try:
        subject = subjects.of_cache(path)
    except FileNotFoundError:
        return [f"{os.path.basename(subjects.path_beside(path))} is missing, which says what {name} should hold"]
    except ValueError as error:
        return [str(error)]
    layout = subject.layout
    if frames is not None and frames != subject.frames:
        return [f"{name} has the frames {subject.frames}, not {frames}"]
    size = os.path.getsize(path)
    if size != layout.size:
        return [
            f"{name} has {size:,} bytes; with {subject.vertex_count:,} vertices on {len(layout.frames)} frames it "
            f"should have {layout.size:,}"
        ]
    with open(path, "rb") as file:
        if file.read(len(layout.header())) != layout.header():
            kind = subject.format.upper()
            return [f"the header of {name} is not that of a {kind} file with these frames and vertices"]
    return _not_finite(path, name, subject) + _about_world(path, subject)


def _unfinished(path, name):
    try:
        subject, marks = part_files.read_marks(path)
    except (ValueError, OSError):
        return f"{part_files.folder_of(path)} is not an unfinished bake of this version of Sinew"
    missing = [frame for frame, done in zip(subject.frames, marks) if not done]
    return (
        f"{name} is not finished: {len(missing)} of {len(marks)} frames are missing "
        f"({frame_range.words_of(missing, subject.frames.step)})"
        if missing
        else f"{name} is not finished: all frames are there, but the bake ended before it moved the file"
    )


def _not_finite(path, name, subject):
    layout = subject.layout
    bad = [
        frame
        for index, frame in enumerate(subject.frames)
        if not np.isfinite(point_cache.read_frame(path, layout, index)).all()
    ]
    return (
        [f"{name} has numbers that are not finite on frames {frame_range.words_of(bad, subject.frames.step)}"]
        if bad
        else []
    )


def _about_world(path, subject):
    world, count = subjects.world_beside(path), len(subject.frames)
    name = os.path.basename(world)
    try:
        matrices = np.lib.format.open_memmap(world, mode="r")
    except FileNotFoundError:
        return [f"{name} is missing"]
    except (ValueError, OverflowError, SyntaxError, tokenize.TokenError):  # numpy parses the header as Python
        return [f"{name} is not a complete .npy file"]
    if matrices.shape != (count, 4, 4) or matrices.dtype != np.float64:
        return [f"{name} does not hold {count} matrices of float64"]
    return [] if np.isfinite(matrices).all() else [f"{name} has numbers that are not finite"]
