"""Tracks which kinds of data have been compared with Blender's API, the first time they are read or written by address.

If a version of Blender has moved its data or changed the meaning of a bit, this is detected before a shape is wrong.
"""

import threading
from collections.abc import Hashable

from . import contract, features

_proved: set[Hashable] = set()  # what was compared and found equal
_lock = threading.Lock()


def is_due(what: Hashable) -> bool:
    """Whether something has not been compared yet. what: its name, or any other key."""
    return what not in _proved


def give(what: Hashable, is_equal: bool = True, difference: str = "", feature: str = features.DEFORMING) -> None:
    """Records the result of a comparison. difference: a clause that describes what differs; feature: what is lost
    then. Raises contract.Broken if it is not equal."""
    if not is_equal:
        raise contract.distrust(feature, difference)
    with _lock:
        _proved.add(what)


def forget() -> None:
    """Discards all results, so that everything is compared again. For tests."""
    _proved.clear()
