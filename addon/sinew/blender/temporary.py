"""Context managers that restore what they change."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import bpy


@contextmanager
def changed(settings: Iterable[tuple[Any, str, Any]]) -> Iterator[None]:
    """Sets properties inside the `with` block. settings: (owner, name, value) each."""
    settings = list(settings)
    before = [getattr(owner, name) for owner, name, _value in settings]
    try:
        for owner, name, value in settings:
            setattr(owner, name, value)
        yield
    finally:
        for (owner, name, _value), value in zip(settings, before):
            setattr(owner, name, value)


@contextmanager
def frame_kept(scene: bpy.types.Scene) -> Iterator[None]:
    """Returns to the scene's frame at the end of the `with` block."""
    frame, subframe = scene.frame_current, scene.frame_subframe
    try:
        yield
    finally:
        scene.frame_set(frame, subframe=subframe)
