"""Plays frames of the open scene and measures what its objects cost.

If Blender has a clock for each modifier (4.x and later), that clock is read. Everything else is measured by its
absence: a few frames are played with it, without it, and with it again. Modifiers that do not affect it are switched
off then, since their noise would hide its cost; armatures are played without anything else (absences.py). Each
absence ends with its block of frames, so between two steps of `steps` the file is unchanged.
"""

from collections.abc import Callable, Generator, Iterator, Sequence
from functools import partial
from statistics import median
from typing import Any

import bpy

from ..blender import animation, modifier_types, nodes, temporary, values
from ..feedback import long_work
from ..main import whole_frames
from ..plan import bindable, survey, ways, wiring
from ..played import states
from ..run import characters
from . import absences, costs
from .costs import CLOCK, DIFFERENCE, OWN_CLOCK, ObjectCost, Part

# What is played: everything; only what Sinew may take over, and nothing after that; only keys and Armature modifiers.
WHOLE, DEFORMED, BARE = range(3)
BLOCK = 10  # consecutive frames that one absence lasts
HAS_CLOCK = "execution_time" in bpy.types.Modifier.bl_rna.properties


def run(context: bpy.types.Context, first: int, last: int) -> costs.Profile:
    """Runs the whole measurement. Returns a Profile, or raises ValueError."""
    return long_work.finish(steps(context, first, last))


def steps(context: bpy.types.Context, first: int, last: int) -> Generator[tuple[float, str], None, costs.Profile]:
    """Measures step by step: a generator of (share done, what comes next) that returns a costs.Profile. Closing it
    early is safe. Raises ValueError if there is nothing to measure."""
    costs.check_frames(first, last)
    scene = context.scene
    # Some of the rigs would be native, and some of the time.
    with temporary.frame_kept(scene), states.all_live(scene, context.view_layer):
        return (yield from _measure(context, scene, costs.spread(first, last)))


def _measure(context, scene, frames):
    scene.frame_set(frames[0])
    subjects, alone = _subjects(context)
    if not subjects:
        raise ValueError("nothing visible has bones, shape keys or modifiers: show what you want to measure")
    animated = _animated(context, [subject.ob for subject in subjects if subject.ob.type == "ARMATURE"])
    everything = [absence for subject in subjects for absence in subject.absences] + animated
    rounds = [_Round(stage, subjects, everything) for stage in (WHOLE, DEFORMED, BARE)]
    rounds = [each for each in rounds if each is rounds[0] or each.absences]
    blocks = costs.blocks(frames, BLOCK)
    count = len(blocks) * (sum(len(each.absences) + 2 for each in rounds) + alone.step_count)
    done = 0
    for block in blocks:
        work = [step for each in rounds for step in each.steps(context, block, subjects if each is rounds[0] else ())]
        for text, step in (*work, *alone.steps(block)):
            yield done / count, text
            step()
            done += 1
    for each in rounds:
        for absence in each.absences:
            absence.conclude(each.before, each.after)
    for each in (*subjects, alone):
        each.conclude()
    whole = rounds[0]
    return costs.Profile(
        frames,
        median(whole.before + whole.after),
        costs.noise(whole.before, whole.after),
        costs.order([subject.cost for subject in subjects]),
        [absence.part for absence in animated],
    )


class _Round:
    """Absences that are compared with the same frames."""

    def __init__(self, stage, subjects, absences_of_all):
        self.absences = [absence for absence in absences_of_all if absence.stage == stage]
        self.before, self.after = [], []
        self._off = [modifier for subject in subjects for modifier in subject.off[stage]]

    def steps(
        self, context: bpy.types.Context, frames: list[int], subjects: Sequence["_Subject"]
    ) -> Iterator[tuple[str, Callable[[], None]]]:
        """Yields (what is done, a function that does it and restores everything) for a block of frames."""

        def play(times, subjects=()):
            with absences.switched_off(self._off):
                times += _play(context, frames, subjects)

        def play_without(absence):
            with absence.made():
                play(absence.times)

        yield "playing", partial(play, self.before, subjects)
        for absence in self.absences:
            yield f"playing without {absence.part.name} of {absence.name}", partial(play_without, absence)
        yield "playing", partial(play, self.after, subjects)


def _play(context, frames, subjects=()):
    """Returns the milliseconds of each frame; the subjects read their clocks on each."""
    changed = set()

    def look(_scene, depsgraph):
        changed.update(values.key_of(update.id) for update in depsgraph.updates if update.is_updated_geometry)

    bpy.app.handlers.frame_change_post.append(look)
    try:
        times = []
        for milliseconds in whole_frames.frame_times(context.scene, frames, changed.clear):
            times.append(milliseconds)
            for subject in subjects:
                subject.read_clocks(context.view_layer.depsgraph, values.key_of(subject.ob) in changed)
        return times
    finally:
        bpy.app.handlers.frame_change_post.remove(look)


def _subjects(context):
    """Returns the visible objects, including instanced ones, and the evaluated armatures; and these as
    absences.Rigs."""
    depsgraph = context.evaluated_depsgraph_get()
    shown = dict.fromkeys(instance.object.original for instance in depsgraph.object_instances)
    armatures = absences.evaluated_armatures(shown)
    depsgraph = context.evaluated_depsgraph_get()
    found = [_Subject(ob, depsgraph) for ob in {**shown, **dict.fromkeys(armatures)}]
    _share_keys(found)
    for subject in found:
        if subject.ob.type == "MESH" and not subject.ob.sinew.is_bound:
            subject.try_accelerate()
    rigs = [(subject.ob, subject.cost.parts[0]) for subject in found if subject.ob.type == "ARMATURE"]
    return [subject for subject in found if subject.cost.parts or subject.absences], absences.Rigs(rigs)


def _animated(context, armatures):
    """Returns the absences of all keyframes and of all drivers, except the drivers that call Sinew. armatures: the
    evaluated ones, since `depsgraph.ids` lacks hidden armatures."""
    hooks = [wiring.find_hook(ob) for ob in characters.bound_objects()]
    blocks = [block.original for block in context.evaluated_depsgraph_get().ids if hasattr(block, "animation_data")]
    blocks += absences.blocks_of(armatures)
    found = zip(("Keyframes", "Drivers"), ("KEYFRAMES", "DRIVERS"), absences.unmuted_curves(blocks, hooks))
    return [
        _Absence("the scene", [Part(name, kind, None, DIFFERENCE)], absences.muted, curves, BARE)
        for name, kind, curves in found
        if curves
    ]


def _share_keys(subjects):
    """Adds one measurement for shape keys that several objects share."""
    sharers = {}
    for subject in subjects:
        keys = getattr(subject.ob.data, "shape_keys", None)
        if keys is not None and len(keys.key_blocks) > 1 and not subject.is_deformed_by_sinew:
            sharers.setdefault(keys, []).append(subject)
    for keys, together in sharers.items():
        reason = absences.why_not_muted(together[0].ob, keys)
        parts = [Part("Shape Keys", "KEYS", None, reason or DIFFERENCE) for _ in together]
        for subject, part in zip(together, parts):
            subject.cost.parts.insert(0, part)
        if not reason:
            together[0].absences.insert(0, _Absence(together[0].ob.name, parts, absences.muted, keys.key_blocks, BARE))


class _Subject:
    """One object."""

    def __init__(self, ob, depsgraph):
        self.ob = ob
        self.cost = ObjectCost((ob.name, ob.library.filepath if ob.library else None), ob.type)
        self.absences = []
        self.off = {WHOLE: [], DEFORMED: [], BARE: []}  # modifiers that are switched off while that stage is played
        self._clocked = {}  # {name of a modifier: (part, milliseconds of each frame)}
        self._own = None  # (part, milliseconds of each frame) of Sinew itself
        self.is_deformed_by_sinew = False
        evaluated = ob.evaluated_get(depsgraph)
        if ob.type == "ARMATURE":
            self.cost.parts.append(Part("Pose", "POSE", None, DIFFERENCE))
        if ob.type == "MESH" and ob.sinew.is_bound:
            self._add_own()
        self._add_modifiers(evaluated)

    def _add_own(self):
        entry = characters.looked_at(self.ob)
        self.cost.is_bound = True
        self.cost.reason = entry.status.error or entry.way.reason
        if not self.cost.reason:
            self.is_deformed_by_sinew = True
            self._own = (Part("Sinew", "SINEW", None, OWN_CLOCK), [])
            self.cost.parts.append(self._own[0])

    def _add_modifiers(self, evaluated):
        """Adds the modifiers that Blender runs."""
        shown = [modifier for modifier in evaluated.modifiers if modifier.show_viewport]
        if self.is_deformed_by_sinew:  # after an evaluation the modifiers that Sinew replaces are on again
            plan = characters.of(self.ob).plan
            shown = [modifier for modifier in shown if modifier.name not in (*plan.way.on_canvas, *plan.replaced)]
        kinds = [(modifier.name, modifier.type) for modifier in shown if not nodes.is_sinew(modifier)]
        tail = costs.after_deforming(kinds, {"ARMATURE", *modifier_types.STAGES})
        for modifier in shown:
            original = self.ob.modifiers[modifier.name]
            is_animated = "show_viewport" in animation.animated_properties(self.ob, original)
            if modifier.name in tail and not is_animated:
                self.off[DEFORMED].append(original)
            if (
                modifier.type not in {"ARMATURE", *costs.SIMULATIONS}
                and not is_animated
                and not nodes.is_sinew(modifier)
            ):
                self.off[BARE].append(original)
            part = Part(modifier.name, modifier.type, None, CLOCK)
            if HAS_CLOCK and self.ob.type == "MESH":
                self.cost.parts.append(part)
                self._clocked[modifier.name] = (part, [])
            elif modifier.type in costs.SIMULATIONS:
                part.how = "simulations are not switched off"
                self.cost.parts.append(part)
            elif not nodes.is_sinew(modifier):
                part.how = DIFFERENCE
                self._add_absence(
                    part, absences.switched_off, [original], is_animated, WHOLE if modifier.name in tail else DEFORMED
                )
        if getattr(bpy.context.preferences.system, "use_gpu_subdivision", False):
            self.cost.remarks += costs.about_subdivision(kinds)

    def _add_absence(self, part, absent, what, is_animated, stage):
        self.cost.parts.append(part)
        if is_animated:
            part.how = "its switch is animated"
        else:
            self.absences.append(_Absence(self.ob.name, [part], absent, what, stage))

    def try_accelerate(self) -> None:
        """Prepares to measure what Accelerate saves, by playing frames with the mesh bound."""
        armature = bindable.armature_to_bind(self.ob)
        if armature is None:
            is_deformed = not ways.why_idle(survey.if_bound(self.ob))
        else:
            is_deformed = bindable.armature_modifier(self.ob, armature) is not None
        if not is_deformed:
            self.cost.reason = "nothing deforms it that Sinew could take over"
            return
        self.cost.reason = bindable.why_not_accelerated(self.ob)
        if not self.cost.reason:
            self.cost.saves = Part("Blender's deformation", "SAVES", None, DIFFERENCE)
            self.absences.append(_Absence(self.ob.name, [self.cost.saves], absences.bound_for_now, self.ob, DEFORMED))

    def read_clocks(self, depsgraph: bpy.types.Depsgraph, was_evaluated: bool) -> None:
        """Reads the clocks of one frame. On frames without an evaluation, a clock still shows an old time."""
        modifiers: Any = self.ob.evaluated_get(depsgraph).modifiers if self._clocked else ()
        for name, (_, times) in self._clocked.items():
            modifier = modifiers.get(name)
            times.append(1e3 * modifier.execution_time if was_evaluated and modifier is not None else 0.0)
        if self._own:
            entry = characters.character(self.ob)
            self._own[1].append(entry.status.timings.last.total if was_evaluated and entry else 0.0)

    def conclude(self) -> None:
        for part, times in (*self._clocked.values(), *([self._own] if self._own else ())):
            part.ms = median(times)


class _Absence:
    """Something of an object that is absent while frames are played."""

    def __init__(self, name, parts, absent, what, stage):
        """name: of the owner; parts: they share the result evenly; absent(what): a context manager; stage: what is
        played."""
        self.name, self.part, self.stage, self.times = name, parts[0], stage, []
        self._parts, self._absent, self._what = parts, absent, what

    def made(self) -> Any:
        return self._absent(self._what)

    def conclude(self, before: Sequence[float], after: Sequence[float]) -> None:
        costs.set_difference(self._parts, before, self.times, after)
