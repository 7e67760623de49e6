"""When the plan of a bound mesh is made, and when the main thread is asked for the mends that the file needs."""

from dataclasses import replace

import bpy

from ..blender import meshes, modifier_types
from ..chain.leaving import LeaveToBlender
from ..host import contract, driver_memory
from ..plan import canvas_survey, mends, plans, survey
from ..plan.situation import Tail
from . import mail

# Blender disables a driver that names something that is gone. It is made anew, but not for ever if that does not help.
MOST_REVIVALS = 100
MOST_RENEWALS = 4  # of a copy in a row


# Keys of the objects that have modifiers of which a tail may consist.
with_tails: set[int] = set()


class Planning:
    """The plan of one bound mesh, from whichever dependency graph its object was last looked at."""

    def __init__(self, key: int) -> None:
        """key: of the object."""
        self._key = key
        self.plan = plans.Plan()
        self.mends: tuple[mends.Mend, ...] = ()  # what the file lacks for that plan
        self._looks = 0  # how many times a new plan was asked for, see look_again
        self.newcomers: frozenset[int] = frozenset()  # nodes.identity of modifiers added since mends were last applied
        # What the main thread has last read of the rest of the file; None: to be read
        self.surroundings: canvas_survey.Surroundings | None = None
        self.tail: Tail | None = None  # whose stencils were found
        # See stencils/searching.py: what was searched, why in vain, and whether it would have taken too long
        self.sought: tuple[object, str, bool] = (None, "", False)
        self.is_followed = False  # see tails.followed; the main thread looks when it has time, as for what follows
        self.generated_in = ""  # as in situation.Situation
        self.moves_against_armature = False  # frame by frame
        self.is_copy_stale = False  # the canvas's copy of the mesh is not like the mesh
        self._renewals = 0  # of that copy, since it was last like the mesh
        self._modifiers: frozenset[int] | None = None  # nodes.identity of all modifiers at the last look
        self._lacks: tuple | None = None  # the situation in which the file lacks something
        self._given_up: tuple | None = None  # the situation that cannot be mended
        self._revivals = 0  # of the hook
        self._waiting: tuple | None = None  # the drivers and modifiers with which it was seen to wait for all

    def look(self, ob: bpy.types.Object) -> plans.Plan:
        """Makes a plan for the object, original or evaluated, and returns it. The main thread is asked for the mends
        that the file needs; until the blocking ones are applied, Blender's own modifier deforms. Raises LeaveToBlender
        in an evaluation if only the main thread can tell."""
        if self.surroundings is None:
            if ob.is_evaluated:
                self.ask_to_rewire()
                raise LeaveToBlender("nobody has counted yet how many objects have its mesh")
            self.surroundings = canvas_survey.surroundings_of(ob, meshes.count_sharers(ob))
        tail = self.tail if self.tail and self.tail.simplification == self.surroundings.simplification else None
        around = self.surroundings._replace(tail=tail, is_followed=self.is_followed, generated_in=self.generated_in)
        if ob.is_evaluated:
            situation, file = survey.of_evaluated(ob, around, self.moves_against_armature)
        else:
            situation = file = survey.of(ob, around, self.moves_against_armature)
        modifiers = frozenset(modifier.identity for modifier in file.modifiers)
        if self._modifiers is not None:
            self.newcomers |= modifiers - self._modifiers
        self._modifiers = modifiers
        plan = plans.make(situation)
        self.mends = mends.needed(plan, file, self.newcomers)
        is_wired = plan.way.in_pass and not any(mend.is_blocking for mend in self.mends)
        self.plan = replace(plan, is_wired=is_wired)
        may_have_tail = any(modifier.type in modifier_types.TAILS for modifier in file.modifiers)
        (with_tails.add if may_have_tail else with_tails.discard)(self._key)
        self._lacks = (plan.way, plan.taken, file.mesh) if self.mends else None
        if self.mends and self._lacks != self._given_up:
            self.ask_to_rewire()
        return self.plan

    @property
    def has_looked(self) -> bool:
        return self._modifiers is not None

    @property
    def looks(self) -> int:
        """A number that changes when a new plan is asked for, or needed because a part of Blender's memory is not what
        Sinew expects."""
        return self._looks + contract.losses()

    def look_again(self) -> None:
        """Has the next evaluation make a new plan. The caller has Blender evaluate."""
        self._looks += 1

    def follow_undo(self) -> None:
        """Has the next question about the object, which an undo may have changed, look at it again. A graph copy asks
        only if Blender has copied the object again."""
        self.newcomers, self._modifiers, self._given_up = frozenset(), None, None
        self._revivals = self._renewals = 0

    def ask_to_rewire(self) -> None:
        """Asks the main thread to apply the mends."""
        mail.post(mail.REWIRE, self._key)

    def ask_for_copy(self) -> None:
        """Asks the main thread to copy the mesh for the canvas again, unless that does not help."""
        self._renewals += 1
        if self._renewals <= MOST_RENEWALS:
            self.is_copy_stale = True
            self.ask_to_rewire()

    def note_copy(self) -> None:
        """Notes that the canvas's copy is like the mesh."""
        self._renewals = 0

    def give_up_on_what_lacks(self) -> None:
        """Notes that the main thread has done what it could: it is not asked again in the same situation."""
        self._given_up = self._lacks

    def should_revive(self, original: bpy.types.Object) -> bool:
        """Whether Blender has disabled the hook, so that it has to be made anew. Counts. (Before 3.5 the hook of a mesh
        without vertices cannot be helped.)"""
        hook = self.plan.hook_of(original)
        if hook is None or hook.driver.is_valid or self._revivals >= MOST_REVIVALS or not original.data.vertices:
            return False
        self._revivals += 1
        return True

    def waits_for_targets(self, original: bpy.types.Object) -> bool:
        """Whether the hook still waits for everything that the modifiers follow. Looks only if drivers or modifiers
        have changed since the last look; not if bones have."""
        data, names = original.animation_data, self.plan.replaced
        drivers = driver_memory.read_bytes(data.drivers) if data is not None else b""
        awaited = [survey.awaited_by(original.modifiers[name]) for name in names if name in original.modifiers]
        now = drivers, awaited, self.plan.hook_path
        if drivers is None or now != self._waiting:
            is_waiting = survey.waits_for_targets(original, self.plan)
            self._waiting = now if is_waiting else None
            return is_waiting
        return True

    def see_surroundings(self, original: bpy.types.Object, file: canvas_survey.File | None = None) -> None:
        """Reads the surroundings again, except how many objects have the mesh. file: see surroundings_of."""
        if self.surroundings is not None:
            self.surroundings = canvas_survey.surroundings_of(original, self.surroundings.sharer_count, file)

    def see_sharers(self, original: bpy.types.Object, count: int) -> None:
        """Notes how many objects have the mesh. If that has changed, it may need another plan."""
        if self.surroundings is not None and count == self.surroundings.sharer_count:
            return
        self.surroundings = canvas_survey.surroundings_of(original, count)
        if self.has_looked:
            self._looks += 1
            self.ask_to_rewire()
