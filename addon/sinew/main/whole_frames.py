"""What a whole frame of the open scene takes, with Sinew and without: Blender's own modifiers deform the same frames,
in turns, for a machine's pace drifts."""

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from ..blender import values
from ..run import character, characters

BLOCK = 10  # frames in a row that one of the two has
MOST_FRAMES = 40  # of each
MOST_SECONDS = 4.0  # after which no further block begins


@dataclass(frozen=True)
class Measured:
    """Milliseconds, medians of whole calls of scene.frame_set: all that the scene evaluates, without drawing."""

    scene: str  # its name
    sinew: float
    blender: float
    bound: frozenset = frozenset()  # keys of the meshes that were bound

    @property
    def glance(self):
        """How many times as fast, and frames a second."""
        return f"{self.blender / self.sinew:.1f}x, {1e3 / self.sinew:,.0f} fps"


_last = None


def last(scene):
    """What was measured last in that scene, with the meshes that are bound now, or None."""
    return _last if _last is not None and (_last.scene, _last.bound) == (scene.name, _bound()) else None


def _bound():
    return frozenset(values.key_of(ob) for ob in characters.bound_objects())


def forget():
    global _last
    _last = None


def measure(scene, progress):
    """Plays frames of the scene from its first on, and goes back to where it was. Returns a Measured."""
    global _last
    place = scene.frame_current, scene.frame_subframe
    length = scene.frame_end - scene.frame_start + 1
    frames = [scene.frame_start + i % length for i in range(MOST_FRAMES)]
    sinew, blender = [], []
    start = perf_counter()
    try:
        for first in range(0, MOST_FRAMES, BLOCK):
            if sinew and perf_counter() - start > MOST_SECONDS:
                break
            progress.step(first / MOST_FRAMES, "measuring frames")
            block = frames[first : first + BLOCK]
            sinew += frame_times(scene, block)
            with character.StandAside():
                blender += frame_times(scene, block)
    finally:
        for ob in characters.bound_objects():
            ob.update_tag()
        scene.frame_set(place[0], subframe=place[1])
    _last = Measured(scene.name, float(np.median(sinew)), float(np.median(blender)), _bound())
    return _last


def frame_times(scene, frames, before_each=lambda: None):
    """A generator of milliseconds: of each frame the whole call that sets it. A frame before them warms up."""
    scene.frame_set(frames[-1])
    for frame in frames:
        before_each()
        start = perf_counter()
        scene.frame_set(frame)
        yield 1e3 * (perf_counter() - start)
