"""Decides what Sinew does with a bound mesh: its path, and whether the file has what the path needs.

A plan is made after an edit of the object and is immutable. Each dependency graph uses the plan of its own copy of the
object, which may be older or newer than another graph's.
"""

from dataclasses import dataclass
from typing import Any

from ..blender import nodes, values
from . import runs, ways, wiring


@dataclass(frozen=True)
class Plan:
    """The decision for one version of an object."""

    way: ways.Way = ways.Way(ways.BLENDER)
    taken: tuple[str, ...] = ()  # names of the Armature modifiers that Sinew replaces, in stack order
    binds: tuple[tuple[bool, bool], ...] = ()  # of each, as returned by wiring.binds_of
    shown: tuple[tuple[bool, bool] | None, ...] = ()  # of each, as returned by wiring.shown_of
    hook_path: str = ""  # path of the property that the hook drives
    run: runs.Run = runs.Run()  # what Sinew replaces behind them, or without them
    own: str | None = None  # name of Sinew's modifier
    waits_for: frozenset[tuple[int, str]] = frozenset()  # bones, as returned by wiring.awaited_bones
    is_wired: bool = False  # the file has what the path needs

    def hook_of(self, ob: Any) -> Any:
        """Returns the hook of the object, or None."""
        return ob.animation_data.drivers.find(self.hook_path) if self.hook_path and ob.animation_data else None

    def waits_for_targets(self, original: Any) -> bool:
        """Whether the hook waits for the armatures and everything that the run's Hook modifiers follow.

        Also checks that no target was deleted: modifiers, objects and bones may be added and removed. True if there is
        no hook at its path.
        """
        hook = self.hook_of(original)
        if hook is None:
            return True
        armatures = [(original.modifiers[name].object, "") for name in self.taken if name in original.modifiers]
        targets = (*armatures, *runs.hooks(original, self.run))
        keys = {(values.key_of(ob), bone) for ob, bone in targets if ob is not None}
        return keys <= wiring.targets_of(hook) and not wiring.has_lost_target(hook)

    def switch(self, ob: Any, deforms: bool) -> None:
        """Sets whether Sinew or Blender's own modifiers deform this evaluated object in this pass."""
        wiring.switch(ob, self.taken, self.shown, self.binds, self.run, self.own, deforms, self.way.kind == ways.KEYS)


def make(ob: Any, sharer_count: int, moves_against_armature: bool) -> Plan:
    """Makes the plan of an object.

    ob: original or evaluated; sharer_count, moves_against_armature: see ways.choose.
    """
    original = ob.original
    taken = wiring.taken_modifiers(ob)
    names = tuple(modifier.name for modifier in taken)
    carrier = wiring.carrier_of(ob)
    way = ways.choose(ob, original.data, sharer_count, moves_against_armature)
    own = nodes.find_modifier(ob)
    hook = carrier and wiring.hook_of(ob, carrier)
    return Plan(
        way,
        names,
        tuple(wiring.binds_of(ob, modifier) for modifier in taken),
        tuple(wiring.shown_of(ob, modifier) for modifier in taken),
        wiring.path_of(carrier) if carrier is not None else "",
        runs.of(ob, names) if way.in_pass else runs.Run(),
        own and own.name,
        wiring.awaited_bones(hook) if hook else frozenset(),
    )
