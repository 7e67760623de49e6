"""Measures the time of a whole frame of the open scene, with Sinew and with Blender's own modifiers. The two alternate
on the same frames, because a machine's speed drifts."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from ..blender import values
from ..run import characters, switching

BLOCK = 10  # consecutive frames that are played with one of the two before the other's turn
MOST_FRAMES = 40  # with each of the two
MOST_SECONDS = 4.0  # after this time, no further block begins


@dataclass(frozen=True)
class Measured:
    """Median milliseconds of whole calls of scene.frame_set: everything that the scene evaluates, without drawing."""

    scene: str  # its name
    sinew: float
    blender: float
    bound: frozenset = frozenset()  # keys of the meshes that were bound

    @property
    def glance(self) -> str:
        """The speedup by Sinew, and the frames per second, as text."""
        return f"{self.blender / self.sinew:.1f}x, {1e3 / self.sinew:,.0f} fps"


_last = None


def last(scene: Any) -> Measured | None:
    """Returns the last measurement, or None if it was made in a different scene or with other bound meshes."""
    return _last if _last is not None and (_last.scene, _last.bound) == (scene.name, _bound()) else None


def _bound():
    return frozenset(values.key_of(ob) for ob in characters.bound_objects())


def forget() -> None:
    global _last
    _last = None


def measure(scene: Any, progress: Any, without: Callable[[], AbstractContextManager[None]] = nullcontext) -> Measured:
    """Plays frames of the scene, beginning with its first, and then restores the current frame. Returns a Measured.
    without: has Blender do in its `with` block whatever else Sinew does besides deforming."""
    global _last
    place = scene.frame_current, scene.frame_subframe
    length = scene.frame_end - scene.frame_start + 1
    frames = [scene.frame_start + i % length for i in range(MOST_FRAMES)]
    sinew: list[float] = []
    blender: list[float] = []
    start = perf_counter()
    try:
        for first in range(0, MOST_FRAMES, BLOCK):
            if sinew and perf_counter() - start > MOST_SECONDS:
                break
            progress.step(first / MOST_FRAMES, "measuring frames")
            block = frames[first : first + BLOCK]
            sinew += frame_times(scene, block)
            with switching.StandAside(), without():
                blender += frame_times(scene, block)
    finally:
        for ob in characters.bound_objects():
            ob.update_tag()
        scene.frame_set(place[0], subframe=place[1])
    _last = Measured(scene.name, float(np.median(sinew)), float(np.median(blender)), _bound())
    return _last


def frame_times(scene: Any, frames: Sequence[int], before_each: Callable[[], Any] = lambda: None) -> Iterator[float]:
    """Yields the milliseconds of each frame: of the whole call that sets it. The last frame is set first, to warm up.
    before_each: called before each frame, outside the measured time."""
    scene.frame_set(frames[-1])
    for frame in frames:
        before_each()
        start = perf_counter()
        scene.frame_set(frame)
        yield 1e3 * (perf_counter() - start)
