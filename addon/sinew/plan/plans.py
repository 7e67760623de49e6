"""Decides what Sinew does with a bound mesh: its path, and whether the file has what the path needs.

A plan is made after an edit of the object and is immutable. Each dependency graph uses the plan of its own copy of the
object, which may be older or newer than another graph's. Does not use Blender.
"""

from dataclasses import dataclass
from typing import Any

from . import runs, ways
from .situation import Driven, Modifier, Situation


@dataclass(frozen=True)
class Plan:
    """The decision for one version of an object."""

    way: ways.Way = ways.Way(ways.BLENDER)
    taken: tuple[str, ...] = ()  # names of the Armature modifiers that Sinew replaces, in stack order
    binds: tuple[tuple[bool, bool], ...] = ()  # of each, as in situation.Modifier
    hook_path: str = ""  # path of the property that the hook drives
    run: runs.Run = runs.Run()  # what Sinew replaces behind them, or without them
    later: tuple[tuple[str, tuple[bool, bool]], ...] = ()  # Armature modifiers of the run: (name, binds)
    own: str | None = None  # name of Sinew's modifier
    waits_for: frozenset[tuple[int, str]] = frozenset()  # bones, see wiring.Waits.awaited
    driven: tuple[tuple[str, tuple[Driven, ...]], ...] = ()  # (name of a modifier that Sinew replaces, its `driven`)
    animation_troubles: frozenset[str] = frozenset()  # as in Situation
    # Whether stencils of the run's tail are lacking, in viewports and in renders
    lacks_stencils: tuple[bool, bool] = (False, False)
    is_wired: bool = False  # the file has what the path needs

    @property
    def replaced(self) -> tuple[str, ...]:
        """Names of all modifiers that Sinew replaces, in stack order, without those of a front."""
        return *self.taken, *self.run.stages

    def hook_of(self, ob: Any) -> Any:
        """Returns the hook of an object of Blender, or None."""
        return ob.animation_data.drivers.find(self.hook_path) if self.hook_path and ob.animation_data else None


def make(situation: Situation) -> Plan:
    """Makes the plan of an object."""
    taken = [situation.modifier(name) for name in situation.taken]
    way = ways.choose(situation)
    own, hook = situation.own, situation.hook
    run = runs.of(situation) if way.in_pass else runs.Run()
    return Plan(
        way,
        situation.taken,
        tuple(modifier.binds for modifier in taken),
        hook.path if hook is not None else "",
        run,
        tuple((name, situation.modifier(name).binds) for mix in run.mixes for name in mix),
        own.name if own is not None else None,
        hook.awaited if hook is not None else frozenset(),
        tuple((modifier.name, modifier.driven) for modifier in replaced_in(situation, run) if modifier.driven),
        situation.animation_troubles,
        _lacks_stencils(way, run),
    )


def _lacks_stencils(way: ways.Way, run: runs.Run) -> tuple[bool, bool]:
    if way.tail is None:
        lacks = way.kind in {ways.ATTRIBUTE, ways.KEYS} and bool(run.tail)
        return lacks, lacks
    viewport, render = way.tail.stencils
    return viewport is None, render is None


def replaced_in(situation: Situation, run: runs.Run) -> list[Modifier]:
    """Returns the modifiers that Sinew replaces, in stack order."""
    return [modifier for modifier in situation.modifiers if modifier.name in (*situation.taken, *run.stages)]
