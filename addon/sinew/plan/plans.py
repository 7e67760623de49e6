"""What is to be done with a bound mesh: which way it takes, and whether the .blend has what that needs.

A plan is made when the object has been edited, and never changed. Each dependency graph follows the plan of its own
copy of the object, which may be older or newer than another graph's.
"""

from dataclasses import dataclass

from ..blender import nodes, values
from . import runs, ways, wiring


@dataclass(frozen=True)
class Plan:
    way: ways.Way = ways.Way(ways.BLENDER)
    taken: tuple = ()  # names of the Armature modifiers that Sinew stands in for, in their order
    binds: tuple = ()  # of each, as wiring.binds_of has them
    shown: tuple = ()  # of each, as wiring.shown_of has them
    hook_path: str = ""  # what the hook drives
    run: runs.Run = runs.Run()  # what Sinew stands in for behind them, or without them
    own: str | None = None  # name of Sinew's modifier
    waits_for: frozenset = frozenset()  # bones, as wiring.awaited_bones has them
    is_wired: bool = False  # the file has what the way needs

    def hook_of(self, ob):
        """The hook of the object, or None."""
        return ob.animation_data.drivers.find(self.hook_path) if self.hook_path and ob.animation_data else None

    def waits_for_targets(self, original):
        """Whether the hook, if it is where it was, waits for the armatures and for all that the run's Hook modifiers
        follow, and for nothing that is gone: modifiers, objects and bones come and go."""
        hook = self.hook_of(original)
        if hook is None:
            return True
        armatures = [(original.modifiers[name].object, "") for name in self.taken if name in original.modifiers]
        targets = (*armatures, *runs.hooks(original, self.run))
        keys = {(values.key_of(ob), bone) for ob, bone in targets if ob is not None}
        return keys <= wiring.targets_of(hook) and not wiring.has_lost_target(hook)

    def switch(self, ob, deforms):
        """Who deforms this evaluated object in this pass: Sinew, or Blender's own modifiers."""
        wiring.switch(ob, self.taken, self.shown, self.binds, self.run, self.own, deforms, self.way.kind == ways.KEYS)


def make(ob, sharer_count, moves_against_armature):
    """ob: the object, original or evaluated; sharer_count, moves_against_armature: as ways.choose takes them."""
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
