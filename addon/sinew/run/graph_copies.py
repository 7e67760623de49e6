"""The one registry of what is known of evaluated objects: a GraphCopy for each, by its address.

Each dependency graph has evaluated objects of its own. Blender does not tell when it frees them. So a GraphCopy that is
in no graph of the open file and has not been used for a while is discarded (`sweep`), and so is the one that has not
been used for longest if there are too many. All that was read of that object, and built from it, goes with it.
"""

import itertools
from collections.abc import Collection
from typing import Any

from .graph_copy import GraphCopy

# For each bound mesh. A viewport and a render have one each; view layers and other scenes have more.
MOST_PER_MESH = 16

_copies: dict[int, GraphCopy] = {}  # by the address of the evaluated object
_uses = itertools.count(1)
_last_sweep = 0  # the number of uses at that time
_has_strays = False  # whether any may be in no graph of the open file


def at(address: int) -> GraphCopy | None:
    """Returns what is known of the evaluated object at an address, or None. It may be of an object that was there
    before: that the object has its mark shows that it is not."""
    found = _copies.get(address)
    if found is not None:
        found.used = next(_uses)
    return found


def of(character: Any, ob: Any) -> GraphCopy:
    """Returns what is known of an evaluated object; new if there is nothing. From any thread. character: its
    character.Character."""
    global _has_strays
    address = ob.as_pointer()
    found = at(address)
    if found is None or found.character is not character:
        found = GraphCopy(character)
        found.used = next(_uses)
        with character.lock:
            _evict(len({character.key, *(copy.character.key for copy in tuple(_copies.values()))}))
            _copies[address] = found
        _has_strays = True
    return found


def of_mesh(character: Any) -> list[GraphCopy]:
    """Returns what is known of all evaluated copies of an object, the one that was used last at the end."""
    found = [copy for copy in tuple(_copies.values()) if copy.character is character]
    return sorted(found, key=lambda copy: copy.used)


def unrestored() -> list[tuple[int, GraphCopy]]:
    """Returns (address, what is known) of the evaluated objects in which Sinew has set something."""
    return [(address, copy) for address, copy in tuple(_copies.items()) if copy.unrestored is not None]


def discard(known: GraphCopy) -> None:
    """Discards what is known of one evaluated object."""
    for address, copy in tuple(_copies.items()):
        if copy is known:
            _copies.pop(address, None)


def forget() -> None:
    """Discards all."""
    _copies.clear()


def has_strays() -> bool:
    """Whether a GraphCopy may be in no graph of the open file: in a render's, or in one that is gone."""
    return _has_strays


def expect_strays() -> None:
    """Notes that objects or graphs may have been deleted."""
    global _has_strays
    _has_strays = True


def sweep(known: Collection[int]) -> None:
    """Discards every GraphCopy that is in no graph of the open file and was not used since the last sweep. known: the
    addresses of the bound objects' evaluated copies in those graphs."""
    global _last_sweep, _has_strays
    strays = {address: copy for address, copy in tuple(_copies.items()) if address not in known}
    for address, copy in strays.items():
        if copy.used <= _last_sweep:
            _copies.pop(address, None)
    _last_sweep, _has_strays = next(_uses), any(address in _copies for address in strays)


def count() -> int:
    """Returns how many there are."""
    return len(_copies)


def _evict(mesh_count: int) -> None:
    """Makes room for one more. What has something to restore stays: nobody else knows what that is."""
    surplus = len(_copies) + 1 - MOST_PER_MESH * mesh_count
    if surplus > 0:
        restored = [item for item in tuple(_copies.items()) if item[1].unrestored is None]
        for address, _copy in sorted(restored, key=lambda item: item[1].used)[:surplus]:
            _copies.pop(address, None)
