"""What is to be done with a bound mesh: which way it takes, and whether the .blend has what that needs.

A plan is made when the object has been edited, and never changed. Each dependency graph follows the plan of its own
copy of the object, which may be older or newer than another graph's.
"""

from dataclasses import dataclass, replace

from ..blender import meshes, nodes, values
from . import runs, ways, wiring


@dataclass(frozen=True)
class Plan:
    way: ways.Way = ways.Way(ways.BLENDER)
    is_wired: bool = False  # the file has what the way needs
    taken: tuple = ()  # names of the Armature modifiers that Sinew stands in for, in their order
    binds: tuple = ()  # of each, as wiring.binds_of has them
    shown: tuple = ()  # of each, as wiring.shown_of has them
    hook_path: str = ""  # what the hook drives
    run: runs.Run = runs.Run()  # what Sinew stands in for behind them, or without them
    own: str | None = None  # name of Sinew's modifier
    waits_for: frozenset = frozenset()  # bones, as wiring.awaited_bones has them

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
    unwired = Plan(
        way,
        False,
        names,
        tuple(wiring.binds_of(ob, modifier) for modifier in taken),
        tuple(wiring.shown_of(ob, modifier) for modifier in taken),
        wiring.path_of(carrier) if carrier is not None else "",
        runs.of(ob, names) if way.in_pass else runs.Run(),
        own and own.name,
    )
    return _wired(unwired, ob) if way.in_pass else unwired


def _wired(plan, ob):
    """The plan, as far as the file has what its way needs."""
    hook, mesh = plan.hook_of(ob), ob.original.data
    hooked = wiring.waits_for(hook, "mesh"), wiring.waits_for(hook, "keys")
    if [each and each.original for each in hooked] != [mesh, mesh.shape_keys]:
        return plan
    is_wired = plan.waits_for_targets(ob.original) and (
        plan.way.kind == ways.KEYS
        or (
            plan.own is not None
            and runs.is_in_place(ob.original, plan.own, plan.taken, plan.run)
            and meshes.point_attribute(mesh, nodes.POSITION_ATTRIBUTE) is not None
        )
    )
    return replace(plan, is_wired=is_wired, waits_for=wiring.awaited_bones(hook))


def has_too_much(plan, original):
    """Whether the file has what is there for the way through an attribute alone, or Sinew's modifier stands between
    others: an Armature modifier with Multi Modifier mixes with the one right before it."""
    if plan.own is None or plan.way.kind == ways.ATTRIBUTE:
        return False
    own = original.modifiers[plan.own]
    if plan.hook_path == wiring.path_of(own):
        is_last = original.modifiers[-1] == own
        return not is_last or meshes.point_attribute(original.data, nodes.POSITION_ATTRIBUTE) is not None
    return nodes.is_removable(original, own)


def has_displaced(plan, original, newcomers):
    """Whether a modifier that has just come was put before Sinew's."""
    if plan.own is None or not newcomers:
        return False
    before = list(original.modifiers)[: original.modifiers.find(plan.own)]
    return not newcomers.isdisjoint(map(nodes.identity, before))
