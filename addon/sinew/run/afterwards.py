"""Restores, after an evaluation, what Sinew has set in evaluated copies: switches of modifiers and shape keys.

Exporters, scripts and other add-ons' handlers then find Sinew's shape, and all else as Blender's own modifiers leave
it. Blender calls handlers after an evaluation, in the thread that has evaluated. The next evaluation sets all again.
Shape keys are left to Blender in evaluations after which it calls none, unless a window plays the scene.
"""

import threading
from typing import Any

import numpy as np

from ..host import key_blocks, marks
from ..plan import wiring
from . import characters, graph_copies, shape_keys, switching
from .graph_copy import GraphCopy

MOST_WAITING = 4096  # objects of graphs that are evaluated without handlers wait for ever
_deformed: dict[int, Any] = {}  # by the address of an evaluated object: its original
_lock = threading.Lock()


def note(ob: Any) -> None:
    """Notes that Sinew has deformed an evaluated object. From any thread."""
    original = ob.original
    with _lock:
        _deformed[ob.as_pointer()] = original
        if len(_deformed) > MOST_WAITING:
            del _deformed[next(iter(_deformed))]


def is_waiting(ob: Any) -> bool:
    """Whether an evaluated object was deformed, but not restored."""
    return ob.as_pointer() in _deformed


def restore(depsgraph: Any) -> None:
    """Restores the objects of a dependency graph that Sinew has deformed since the last call. From any thread."""
    with _lock:
        waiting = list(_deformed.items())
    for address, original in waiting:
        try:
            ob = original.evaluated_get(depsgraph)
        except ReferenceError:  # freed, as by an undo
            ob = None
        if ob is not None and ob.as_pointer() != address:
            continue  # of another graph
        if ob is not None and marks.is_marked(ob, "OBJECT"):
            if original.sinew.installed_output == "MESH":
                _keep_shape(ob)
            known = graph_copies.at(address)
            shortcut = known.fast_path.shortcut if known is not None else None
            if shortcut is None or not shortcut.restore():
                _restore(ob)
        with _lock:
            _deformed.pop(address, None)


def forget() -> None:
    """Discards what waits to be restored."""
    with _lock:
        _deformed.clear()


def shape_in_keys(ob: Any) -> np.ndarray | None:
    """Returns a view of the shape, (V, 3), that Sinew has written into the keys of an evaluated object with the output
    Mesh, or None. Use it at once and do not keep it."""
    copy = characters.of(ob).copy_of(ob)
    keys = _keys_of(ob, copy) if is_waiting(ob) else None
    if keys is None:
        return copy.written
    return key_blocks.key_positions(key_blocks.key_addresses(keys)[0], len(copy.reading.keys.base))


def _keep_shape(ob: Any) -> None:
    """Keeps the shape in the keys of an evaluated object, which are about to be restored."""
    copy = characters.of(ob).copy_of(ob)
    keys = _keys_of(ob, copy)
    if keys is not None:
        shape = key_blocks.key_positions(key_blocks.key_addresses(keys)[0], len(copy.reading.keys.base))
        copy.written = None if shape is None else shape.copy()


def _keys_of(ob: Any, copy: GraphCopy) -> Any:
    """Returns the key data-block of an evaluated object if its keys were read, otherwise None."""
    hook = copy.hook_of(ob) if copy.plan is not None else None
    keys = hook and wiring.waits_for(hook, "keys")
    return keys if keys and copy.reading.has_read_keys(keys) else None


def _restore(ob: Any) -> None:
    """Restores one evaluated object. Its keys still count as read, so that the next evaluation does not read them
    again."""
    entry = characters.of(ob)
    with entry.lock:
        copy = entry.copy_of(ob)
        if copy.plan is None:
            return
        switching.switch(ob, copy.plan, False)
        keys = _keys_of(ob, copy)
        if keys is not None:
            shape_keys.restore(keys, copy.reading.keys)
