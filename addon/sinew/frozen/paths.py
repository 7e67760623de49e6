"""The paths of bones around the current frame, computed by the programs of their rigs: nothing has to be played, and an
edit that drops a program drops what it has computed."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from . import rigs

MOST_KEPT = 4000  # frames of a rig


class Path(NamedTuple):
    """Where the head of a bone is, frame by frame."""

    points: np.ndarray  # (F, 3) float32, in world space
    now: int  # which of them is the current frame


def around(bones: Iterable[tuple[Any, str]], frame: int, count: int) -> list[Path]:
    """Returns the paths of bones from `count` frames before a frame to `count` after it. bones: (original armature
    object, name); those of rigs that are not computed have no path."""
    frames, found = list(range(frame - count, frame + count + 1)), []
    numbers: dict[int, dict[str, int]] = {}
    for ob, name in bones:
        rig = rigs.get(ob)
        program = rig.source.program if rig is not None and rig.is_idle else None
        if rig is None or program is None:
            continue
        names = numbers.setdefault(rig.key, {each: number for number, each in enumerate(program.names)})
        heads = _heads(rig.source, frames)
        if name in names and heads is not None:
            matrix = np.array(ob.matrix_world, np.float32)
            points = np.stack([heads[each][names[name]] for each in frames])
            found.append(Path(points @ matrix[:3, :3].T + matrix[:3, 3], count))
    return found


def _heads(source: rigs.Source, frames: list[int]) -> dict[int, np.ndarray] | None:
    """Returns the heads of all bones, (B, 3) float32 in the armature's space, by frame; None if one cannot be
    computed."""
    known = source.heads
    lacking = [each for each in frames if each not in known]
    if len(known) + len(lacking) > MOST_KEPT:
        known.clear()
        lacking = frames
    if lacking:
        try:
            poses = source.program.evaluate(np.array(lacking, np.float32))
        except ValueError:  # a driver divides by 0
            return None
        known.update(zip(lacking, poses[..., :3, 3].copy()))
    return known
