"""The native objects that frames have made and that are alive. What outlives the evaluated objects is a leak."""

import collections
import weakref
from typing import Any

_objects: weakref.WeakSet = weakref.WeakSet()


def note(native: Any) -> Any:
    """Counts a native object as long as it is alive. Returns it."""
    _objects.add(native)
    return native


def counts() -> dict[str, int]:
    """Returns {name of a class: how many are alive}."""
    return dict(collections.Counter(type(each).__name__ for each in list(_objects)))
