"""The paths of bones around the current frame, computed by the programs of their rigs: nothing has to be played, and an
edit that drops a program drops what it has computed."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from ..played import leading, rigs

MOST_KEPT = 4000  # frames of a rig


class Path(NamedTuple):
    """Where the head of a bone is, frame by frame."""

    points: np.ndarray  # (F, 3) float32, in world space
    now: int  # which of them is the current frame


def around(bones: Iterable[tuple[Any, str]], frame: int, count: int) -> list[Path]:
    """Returns the paths of bones from `count` frames before a frame to `count` after it. bones: (original armature
    object, name); those of rigs that are not computed, or whose object has keyframes, have no path."""
    frames, found = list(range(frame - count, frame + count + 1)), []
    chosen: dict[Any, list[str]] = {}
    for ob, name in bones:
        chosen.setdefault(ob, []).append(name)
    for ob, names in chosen.items():
        rig = rigs.get(ob)
        if rig is None or not rig.is_idle or rig.source.program is None or rig.source.place:
            continue
        heads = _heads(rig, frames)
        if heads is None:
            continue
        numbers = {name: number for number, name in enumerate(rig.source.program.names)}
        matrix, every = np.array(ob.matrix_world, np.float32), np.stack([heads[each] for each in frames])
        for number in [numbers[name] for name in names if name in numbers]:
            found.append(Path(every[:, number] @ matrix[:3, :3].T + matrix[:3, 3], count))
    return found


def _heads(rig: rigs.Rig, frames: list[int]) -> dict[int, np.ndarray] | None:
    """Returns the heads of all bones, (B, 3) float32 in the armature's space, by frame; None if one cannot be
    computed."""
    known = rig.source.heads
    lacking = [each for each in frames if each not in known]
    if len(known) + len(lacking) > MOST_KEPT:
        known.clear()
        lacking = frames
    if lacking:
        try:
            poses = rig.source.program.evaluate(np.array(lacking, np.float32), leading.inputs(rig, lacking))
        except ValueError:  # a driver divides by 0, or it follows one that is not computed
            return None
        known.update(zip(lacking, poses[..., :3, 3].copy()))
    return known
