"""Keeps the shapes that Sinew has given to meshes, for whoever asks for them, and takes a known shape in place of
computing it again.

A shape is known together with a digest of all that it was computed from: the deformer, the stages and their settings,
the poses, the places and the values of shape keys. It is taken only if all of that is the same to the bit.
"""

import threading
from dataclasses import dataclass
from typing import Any

from ..native import sinew_native


@dataclass
class Keeper:
    """Asks for the shape of one evaluated object, in each evaluation."""

    known: Any = None  # sinew_native.host.FrameShape that may be taken, or None
    is_keeping: bool = False  # otherwise a shape that has to be computed is not kept
    found: Any = None  # the FrameShape of the last evaluation, or None
    identity: int = 0  # of what computed it, see chain.Chain.identity

    def ask(self, known: Any, is_keeping: bool) -> None:
        """Says what the next evaluation may take, and whether to keep its shape."""
        self.known, self.is_keeping, self.found = known, is_keeping, None


_keepers: dict[int, Keeper] = {}  # by the address of the evaluated object
_lock = threading.Lock()


def keep(address: int) -> Keeper:
    """Returns the keeper of the evaluated object at an address. From now on, there is one."""
    with _lock:
        return _keepers.setdefault(address, Keeper())


def drop(address: int) -> None:
    """Removes a keeper."""
    with _lock:
        _keepers.pop(address, None)


def of(ob: Any) -> Keeper | None:
    """Returns the keeper of an evaluated object, or None. From any thread."""
    return _keepers.get(ob.as_pointer())


def note(ob: Any, identity: int, poses: Any, key_values: Any, stages: Any, positions: Any) -> None:
    """Keeps the shape that the full path has just computed for an evaluated object, if anybody asks for it. The
    arguments are those of sinew_native.host.shape_of."""
    keeper = of(ob)
    if keeper is None:
        return
    keeper.identity, keeper.found = identity, None
    if keeper.is_keeping or keeper.known is not None:
        found = sinew_native.host.shape_of(identity, poses, key_values, stages, positions)
        is_known = found is not None and keeper.known is not None and keeper.known.is_of_same(found)
        keeper.found = keeper.known if is_known else found
