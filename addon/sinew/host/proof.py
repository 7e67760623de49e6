"""The first time that something is read or written by address, it is compared with what Blender's API says of it.

So a Blender that has moved its data, or given a bit another meaning, is noticed before it makes a wrong shape.
"""

import threading

from . import contract

_proved = set()  # what was compared and found equal
_lock = threading.Lock()


def is_due(what):
    """Whether that has not been compared yet."""
    return what not in _proved


def give(what, is_equal=True, difference=""):
    """Notes the outcome of a comparison. difference: a clause that says what differs. Raises contract.Broken."""
    if not is_equal:
        raise contract.distrust(difference)
    with _lock:
        _proved.add(what)


def forget():
    """For tests."""
    _proved.clear()
