"""Prepares evaluated characters for exporters: the shape is Sinew's, all else is as Blender's own modifiers leave it.

An exporter that evaluates the scene in its own dependency graph (USD, Alembic) reads the shape, and may also read what
produced it: USD writes a skeleton if the evaluated Armature modifier is on, and it writes the evaluated shape keys.
Blender calls the handlers between the evaluation and the exporter. By then, the switches and keys that Sinew set for
the evaluation are no longer needed. The next evaluation sets them again.
"""

from typing import Any

from ..host import key_blocks, marks
from ..plan import wiring
from ..run import characters, switching


def tidy(depsgraph: Any) -> None:
    """Restores switches and shape keys after an evaluation, except in the graph that a window shows, where nothing
    reads them."""
    if depsgraph == depsgraph.view_layer.depsgraph:
        return
    for ob in characters.known():
        evaluated = ob.evaluated_get(depsgraph)
        if evaluated.is_evaluated and ob.sinew.is_bound:
            entry = characters.of(ob)
            copy = entry.copy_of(evaluated)
            with entry.lock:
                if copy.plan is not None:
                    switching.switch(evaluated, copy.plan, False)
                    _restore_keys(copy, evaluated)


def _restore_keys(copy, ob):
    """Restores the shape keys. They still count as read, so the next evaluation does not read them again."""
    hook = copy.plan.hook_of(ob)
    keys = hook and wiring.waits_for(hook, "keys")
    if not keys or copy.reading.keys is None or not marks.is_marked(keys, "KEY"):
        return
    addresses = key_blocks.key_addresses(keys)
    key_blocks.give_keys_back(addresses, key_blocks.key_addresses(keys.original))
    base = key_blocks.key_positions(addresses[0], len(copy.reading.keys.base))
    if base is not None:
        base[:] = copy.reading.keys.base
