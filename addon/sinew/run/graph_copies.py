"""All that is known of evaluated objects: what was read, what was built from it, and what is watched. A GraphCopy for
each, by its address.

A viewport, a render and a second scene each evaluate copies of their own, which may be of different ages: while a user
paints, a render still has the mesh as it was when the render began. So what was read of one is never used for another.
Equal data is shared (mesh_reading.Shared), whichever was read first.

Blender does not tell when it frees evaluated objects. So a GraphCopy that is in no graph of the open file and has not
been used for a while is discarded (sweep), and so is the one that has not been used for longest if there are too many.
All that was read of that object, and built from it, goes with it.
"""

import itertools
import weakref
from collections.abc import Collection
from typing import Any

import numpy as np

from ..chain import cage_stages, driven_settings
from ..chain.chain import Chain
from ..chain.leaving import LeaveToBlender
from ..host import marks
from ..plan import animated, ways
from . import switching
from .fast_path import FastPath
from .mesh_reading import Reading

# Modes in which each dab of a brush changes the mesh.
PAINTING = {"WEIGHT_PAINT", "VERTEX_PAINT"}
# Modes in which people edit what they see: Blender's own modifier shows the shape there, as its tools expect.
EDITING = {"EDIT", "SCULPT"}
# For each bound mesh. A viewport and a render have one each; view layers and other scenes have more.
MOST_PER_MESH = 16
_uses = itertools.count(1)
_last_sweep = 0  # the number of uses at that time
_has_strays = False  # whether any may be in no graph of the open file


class GraphCopy:
    """What is known of one evaluated object. Only one thread at a time uses it, because Blender evaluates an object in
    one thread. It is discarded as a whole (graph_copies.py)."""

    def __init__(self, character: Any) -> None:
        """character: character.Character."""
        self.character = character
        self.used = 0  # when, see graph_copies.py
        self.plan: Any = None  # plans.Plan of this copy of the object, or None
        self._looks = -1  # character.planning.looks when the plan was made
        # Names of the modifiers that Sinew replaces and that are switched on in this evaluation.
        self.shown: tuple[str, ...] = ()
        self.stencils: Any = None  # sinew_native.Stencils that make the result in this evaluation, or None
        self.driven_settings: Any = None  # driven_settings.DrivenSettings, or None if the plan is new
        self.reading = Reading(character)
        own = weakref.proxy(self)  # so that nothing waits for the garbage collector
        self.chain = Chain(own)
        self.fast_path = FastPath(own)
        self.unrestored: Any = None  # the original object, while anything that Sinew has set is to be restored
        self.written: np.ndarray | None = None  # (V, 3), the last shape in the keys, kept for the output Mesh
        self._animation: tuple[Any, ...] = ()  # as returned by animated.of_copies
        self.is_deforming = False  # Sinew deformed the mesh in the last evaluation; otherwise Blender did
        self._mode = ""  # of the object at the last evaluation

    # --- the plan ---------------------------------------------------------------------------------

    @property
    def has_current_plan(self) -> bool:
        """Whether nobody has asked for another plan since this one was made."""
        return self._looks == self.character.planning.looks

    def follow_edits(self, ob: Any) -> None:
        """Makes a new plan if the object may have been edited. ob: evaluated. Raises LeaveToBlender."""
        is_animated_anew = self._is_animated_anew(ob)  # first: it needs the marks
        if not marks.test_and_mark(ob, "OBJECT"):
            animated.forget(ob)
            # Blender has copied the object again: the modifiers are switched as in the original.
            self.plan, self._looks = None, -1
            self.reading.canvas.forget()
        elif is_animated_anew:
            self.character.planning.look_again()
        if self.has_current_plan:
            return
        if ob.modifiers.keys() != ob.original.modifiers.keys():
            raise LeaveToBlender("this copy is older than the original, whose settings do not apply to it")
        planning = self.character.planning
        looks = planning.looks
        self.plan, self._looks = self.character.look(ob), looks
        self._is_animated_anew(ob)
        self.driven_settings = None
        self.reading.look_again()
        self.chain.follow_plan()
        switching.release(ob)
        if self.plan.way.in_pass and any(map(cage_stages.was_unbound_late, ob.modifiers)):
            planning.ask_to_rewire()  # which has Blender copy the object again, without the binding

    def _is_animated_anew(self, ob: Any) -> bool:
        """Whether animation may change other parts than at the last call of what was read. ob: evaluated."""
        if self.plan is None:
            return False
        before, self._animation = self._animation, animated.of_copies(ob, self.hook_of(ob))
        return before != self._animation

    def hook_of(self, ob: Any) -> Any:
        """Returns the hook of the object, or None."""
        return self.plan.hook_of(ob)

    def has_all_modifiers(self, ob: Any) -> bool:
        """Whether an evaluated object has all modifiers that are in the plan."""
        names = *self.plan.replaced, *self.plan.way.on_canvas, *filter(None, [self.plan.own])
        return all(name in ob.modifiers for name in names)

    def goes_through_canvas(self) -> bool:
        """Whether the deformed shape goes to a canvas, from which the mesh is read, too, unless there is a tail."""
        return self.plan.way.kind == ways.CANVAS

    def goes_through_keys(self) -> bool:
        """Whether the deformed shape goes into the reference shape key."""
        return self.plan.way.kind == ways.KEYS

    # --- this evaluation --------------------------------------------------------------------------

    def read_switches(self, ob: Any) -> None:
        """Reads which modifiers are on in this evaluation. ob: evaluated. Raises LeaveToBlender."""
        self.shown = switching.shown(ob, self.plan)
        self.stencils = switching.stencils(ob, self.plan)
        if self.driven_settings is None:
            self.driven_settings = driven_settings.DrivenSettings(ob, self.plan)

    def has_work(self) -> bool:
        """Whether any modifier that Sinew replaces is on in this evaluation."""
        if self.plan.way.has_keys and self.plan.taken:
            # With the Armature modifier off, exporters expect shape keys that they can read.
            return any(name in self.shown for name in self.plan.taken)
        return bool(self.shown) or not self.plan.replaced

    def leaves_mode(self, ob: Any) -> bool:
        """Whether the mode of an evaluated object changes the mesh, or did at the last call and Blender deforms the
        object in this evaluation: what was edited is read in the next one."""
        before, self._mode = self._mode, ob.mode
        return ob.mode in EDITING or before in EDITING | PAINTING and ob.mode != before and self._leaves_edits(ob)

    def leaves_dabs(self, ob: Any) -> bool:
        """Whether Blender deforms an evaluated object in an evaluation in which somebody has painted on it."""
        return ob.mode in PAINTING and self._leaves_edits(ob)

    def _leaves_edits(self, ob: Any) -> bool:
        """Whether Blender may deform an evaluated object in an evaluation that follows an edit of the mesh. To read
        all weights again takes longer than Blender's Armature modifiers and shape keys, but not as long as its
        smoothing."""
        plan = self.plan
        if not self.reading.is_done() or plan is None or not plan.is_wired:
            return False
        return (
            self.has_current_plan
            and self.has_all_modifiers(ob)
            and ob.sinew.installed_output != "MESH"  # which takes the shape that Sinew has written
            and not self.reading.method.kind
            and {name for mix in plan.run.mixes for name in mix}.issuperset(self.chain.stage_names(ob))
        )

    def look_at_mesh_again(self) -> None:
        """Checks what was built against what has just been read."""
        self.chain.look_again()
        self.fast_path.begin_anew()


_copies: dict[int, GraphCopy] = {}  # by the address of the evaluated object


def at(address: int) -> GraphCopy | None:
    """Returns what is known of the evaluated object at an address, or None. It may be of an object that was there
    before: that the object has its mark shows that it is not."""
    found = _copies.get(address)
    if found is not None:
        found.used = next(_uses)
    return found


def of(character: Any, ob: Any) -> GraphCopy:
    """Returns what is known of an evaluated object; new if there is nothing. From any thread. character: its
    character.Character."""
    global _has_strays
    address = ob.as_pointer()
    found = at(address)
    if found is None or found.character is not character:
        found = GraphCopy(character)
        found.used = next(_uses)
        with character.lock:
            _evict(len({character.key, *(copy.character.key for copy in tuple(_copies.values()))}))
            _copies[address] = found
        _has_strays = True
    return found


def of_mesh(character: Any) -> list[GraphCopy]:
    """Returns what is known of all evaluated copies of an object, the one that was used last at the end."""
    found = [copy for copy in tuple(_copies.values()) if copy.character is character]
    return sorted(found, key=lambda copy: copy.used)


def unrestored() -> list[tuple[int, GraphCopy]]:
    """Returns (address, what is known) of the evaluated objects in which Sinew has set something."""
    return [(address, copy) for address, copy in tuple(_copies.items()) if copy.unrestored is not None]


def discard(known: GraphCopy) -> None:
    """Discards what is known of one evaluated object."""
    for address, copy in tuple(_copies.items()):
        if copy is known:
            _copies.pop(address, None)


def forget() -> None:
    """Discards all."""
    _copies.clear()


def has_strays() -> bool:
    """Whether a GraphCopy may be in no graph of the open file: in a render's, or in one that is gone."""
    return _has_strays


def expect_strays() -> None:
    """Notes that objects or graphs may have been deleted."""
    global _has_strays
    _has_strays = True


def sweep(known: Collection[int]) -> None:
    """Discards every GraphCopy that is in no graph of the open file and was not used since the last sweep. known: the
    addresses of the bound objects' evaluated copies in those graphs."""
    global _last_sweep, _has_strays
    strays = {address: copy for address, copy in tuple(_copies.items()) if address not in known}
    for address, copy in strays.items():
        if copy.used <= _last_sweep:
            _copies.pop(address, None)
    _last_sweep, _has_strays = next(_uses), any(address in _copies for address in strays)


def count() -> int:
    """Returns how many there are."""
    return len(_copies)


def _evict(mesh_count: int) -> None:
    """Makes room for one more. What has something to restore stays: nobody else knows what that is."""
    surplus = len(_copies) + 1 - MOST_PER_MESH * mesh_count
    if surplus > 0:
        restored = [item for item in tuple(_copies.items()) if item[1].unrestored is None]
        for address, _copy in sorted(restored, key=lambda item: item[1].used)[:surplus]:
            _copies.pop(address, None)
