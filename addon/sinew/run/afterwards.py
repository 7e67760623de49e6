"""Restores, after an evaluation, what Sinew has set in evaluated copies: switches of modifiers and shape keys.

Exporters, scripts and other add-ons' handlers then find Sinew's shape, and all else as Blender's own modifiers leave
it. Blender calls handlers after an evaluation, in the thread that has evaluated. The next evaluation sets all again.
Shape keys are left to Blender in evaluations after which it calls none, unless a window plays the scene.
"""

from typing import Any

import numpy as np

from ..chain import shape_keys
from ..host import key_blocks, marks
from ..plan import wiring
from . import characters, graph_copies, switching
from .graph_copies import GraphCopy


def is_waiting(ob: Any) -> bool:
    """Whether an evaluated object was deformed, but not restored."""
    copy = graph_copies.at(ob.as_pointer())
    return copy is not None and copy.unrestored is not None and marks.is_marked(ob, "OBJECT")


def restore(depsgraph: Any) -> None:
    """Restores the objects of a dependency graph that Sinew has deformed since the last call. From any thread."""
    for address, copy in graph_copies.unrestored():
        original = copy.unrestored
        if original is None:  # another thread, which evaluates the graph that has it, was faster
            continue
        try:
            ob = original.evaluated_get(depsgraph)
        except ReferenceError:  # freed, as by an undo
            ob = None
        if ob is not None and ob.as_pointer() != address:
            continue  # of another graph
        if ob is not None and marks.is_marked(ob, "OBJECT"):
            if original.sinew.installed_output == "MESH":
                _keep_shape(ob, copy)
            shortcut = copy.fast_path.shortcut
            if shortcut is None or not shortcut.restore():
                _restore(ob, copy)
        copy.unrestored = None


def shape_in_keys(ob: Any) -> np.ndarray | None:
    """Returns a view of the shape, (V, 3), that Sinew has written into the keys of an evaluated object with the output
    Mesh, or None. Use it at once and do not keep it."""
    copy = characters.of(ob).copy_of(ob)
    keys = _keys_of(ob, copy) if copy.unrestored is not None else None
    if keys is None:
        return copy.written
    return key_blocks.key_positions(key_blocks.key_addresses(keys)[0], len(copy.reading.keys.base))


def _keep_shape(ob: Any, copy: GraphCopy) -> None:
    """Keeps the shape in the keys of an evaluated object, which are about to be restored."""
    keys = _keys_of(ob, copy)
    if keys is not None:
        shape = key_blocks.key_positions(key_blocks.key_addresses(keys)[0], len(copy.reading.keys.base))
        copy.written = None if shape is None else shape.copy()


def _keys_of(ob: Any, copy: GraphCopy) -> Any:
    """Returns the key data-block of an evaluated object if its keys were read, otherwise None."""
    hook = copy.hook_of(ob) if copy.plan is not None else None
    keys = hook and wiring.waits_for(hook, "keys")
    return keys if keys and copy.reading.has_read_keys(keys) else None


def _restore(ob: Any, copy: GraphCopy) -> None:
    """Restores one evaluated object. Its keys still count as read, so that the next evaluation does not read them
    again."""
    with copy.character.lock:
        if copy.plan is None:
            return
        switching.switch(ob, copy.plan, False)
        keys = _keys_of(ob, copy)
        if keys is not None:
            shape_keys.restore(keys, copy.reading.keys)
