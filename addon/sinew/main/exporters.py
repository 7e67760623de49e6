"""Evaluated characters as exporters expect them: the shape is Sinew's, all else as Blender's own modifiers leave it.

An exporter that evaluates the scene in a graph of its own (USD, Alembic) reads the shape, and may read what made it as
well: USD writes a skeleton if the evaluated Armature modifier is on, and the evaluated shape keys. Between the
evaluation and the exporter Blender calls the handlers. Then the switches and keys that Sinew has set for the evaluation
are no longer needed. The next evaluation sets them again.
"""

from ..host import key_blocks, marks
from ..plan import wiring
from ..run import characters


def tidy(depsgraph):
    """After an evaluation. The graph that a window shows stays as it is, where nobody looks for them."""
    if depsgraph == depsgraph.view_layer.depsgraph:
        return
    for ob in characters.known():
        evaluated = ob.evaluated_get(depsgraph)
        if evaluated.is_evaluated and ob.sinew.is_bound:
            entry = characters.of(ob)
            copy = entry.copy_of(evaluated)
            with entry.lock:
                if copy.plan is not None:
                    copy.plan.switch(evaluated, False)
                    _restore_keys(copy, evaluated)


def _restore_keys(copy, ob):
    """They count as read all the same: the next evaluation need not read them again."""
    hook = copy.plan.hook_of(ob)
    keys = hook and wiring.waits_for(hook, "keys")
    if not keys or copy.keys is None or not marks.is_marked(keys, "KEY"):
        return
    addresses = key_blocks.key_addresses(keys)
    key_blocks.give_keys_back(addresses)
    base = key_blocks.key_positions(addresses[0], len(copy.keys.base))
    if base is not None:
        base[:] = copy.keys.base
