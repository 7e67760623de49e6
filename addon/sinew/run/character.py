"""One bound mesh at run time: native objects made from the .blend, never saved in it.

The .blend holds everything; what stands here is a cache, made anew when somebody has edited mesh, weights, shape keys
or bones. What was read belongs to the dependency graph from whose copies it was read (graph_copies.py).
"""

import threading
from collections import deque
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from ..blender import meshes, nodes, values
from ..host import marks
from ..plan import mends, plans
from . import mail, methods, stages
from .graph_copies import GraphCopy, OlderThanOriginal, Shared

# Modes in which people edit what they see: there Blender's own modifier shows the shape, as its tools expect.
EDITING = {"EDIT", "SCULPT"}
# Blender gives up a driver that names something that is gone. It is made anew, but not for ever if that does not help.
MOST_REVIVALS = 100
# Evaluated objects of one mesh of which something is kept: each render has objects of its own.
MOST_COPIES = 16
RECENT_FRAMES = 10  # whose times are shown


class Times(NamedTuple):
    """Milliseconds of a frame."""

    pose: float
    skin: float  # with shape keys
    stages: tuple  # of each modifier of the run behind

    @property
    def total(self):
        return self.pose + self.skin + sum(self.stages)


class Timings:
    """Milliseconds of the last frames since an edit, without those on which something was built."""

    def __init__(self):
        self._frames = deque(maxlen=RECENT_FRAMES)  # of (S + 2,) each

    def take(self, numbers):
        """numbers (S + 2,): of the pose, of keys and skinning, of each stage behind. Copied."""
        if self._frames and len(self._frames[-1]) != len(numbers):
            self.forget()
        self._frames.append(numbers.copy())

    def forget(self):
        self._frames.clear()

    @property
    def last(self):
        """Times of the last of them, zeros if there was none."""
        return self._times(self._frames[-1]) if self._frames else Times(0.0, 0.0, ())

    def recent(self):
        """Times: their medians; or None."""
        frames = list(self._frames)
        return self._times(np.median(frames, axis=0)) if frames and len({len(f) for f in frames}) == 1 else None

    @staticmethod
    def _times(numbers):
        pose, skin, *behind = numbers.tolist()
        return Times(pose, skin, tuple(behind))


@dataclass
class Character:
    """One bound mesh."""

    key: int  # of its object
    name: tuple  # of its object, and the path of its library or None
    plan: plans.Plan = plans.Plan()  # as its object was last looked at, in whichever graph
    mends: tuple = ()  # mends.Mend: what the file lacks for that plan
    looks: int = 0  # how often that was asked for anew, see look_again
    error: str = ""
    timings: Timings = field(default_factory=Timings)
    newcomers: frozenset = frozenset()  # nodes.identity of those that came since the main thread saw to the mesh
    sharer_count: int | None = None  # objects that have its mesh; None: count
    moves_against_armature: bool = False  # again and again
    edition: int = 0  # the last one that was read, see GraphCopy
    is_copy_known: bool = False  # the deformed copy was looked at
    copy_stays: bool = False  # the shape was not to be had for it
    lock: threading.RLock = field(default_factory=threading.RLock, repr=False)
    shared: Shared = field(default_factory=Shared, repr=False)
    kept: object = field(default_factory=methods.Kept, repr=False)  # what the method has precomputed
    copies: dict = field(default_factory=dict, repr=False)  # address of an evaluated object -> GraphCopy
    last: GraphCopy | None = field(default=None, repr=False)  # that was evaluated
    _modifiers: frozenset | None = None  # nodes.identity of all of them when the object was last looked at
    _lacks: tuple | None = None  # the situation in which the file lacks something
    _given_up: tuple | None = None  # the one that cannot be mended
    _revivals: int = 0  # of the hook

    # --- as it was looked at last -----------------------------------------------------------------

    @property
    def way(self):
        return self.plan.way

    @property
    def is_wired(self):
        return self.plan.is_wired

    @property
    def taken(self):
        return self.plan.taken

    @property
    def run(self):
        return self.plan.run

    @property
    def layers(self):
        return self.last.layers if self.last else []

    @property
    def deformer(self):
        return self.last and self.last.deformer

    @property
    def keys(self):
        return self.last and self.last.keys

    @property
    def method(self):
        return self.last.method if self.last else methods.Method()

    @property
    def is_deforming(self):
        return self.last is not None and self.last.is_deforming

    def hook_of(self, ob):
        """The hook of the object, or None."""
        return self.plan.hook_of(ob)

    def waits_for_targets(self, original):
        return self.plan.waits_for_targets(original)

    def stage_names(self, ob):
        """Of the stages behind skinning, as GraphCopy has them."""
        return stages.names(ob, self.plan.run)

    # --- which way it goes ------------------------------------------------------------------------

    def copy_of(self, ob):
        """What is kept of that evaluated object, new if there is nothing. From any thread."""
        address = ob.as_pointer()
        found = self.copies.get(address)
        if found is None:
            with self.lock:
                while len(self.copies) >= MOST_COPIES:
                    del self.copies[next(iter(self.copies))]
                found = self.copies[address] = GraphCopy(self)
        self.last = found
        return found

    def look(self, ob):
        """Makes a plan and returns it. ob: the object, original or evaluated. What the file lacks for it is put there
        by the main thread; until then Blender's own modifier deforms."""
        with self.lock:
            return self._look(ob)

    def _look(self, ob):
        original = ob.original
        modifiers = frozenset(map(nodes.identity, original.modifiers))
        if self._modifiers is not None:
            self.newcomers |= modifiers - self._modifiers
        self._modifiers = modifiers
        if self.sharer_count is None:
            self.sharer_count = meshes.count_sharers(original)
        plan = plans.make(ob, self.sharer_count, self.moves_against_armature)
        self.mends = mends.needed(plan, original, self.newcomers)
        is_wired = plan.way.in_pass and not any(mend.is_blocking for mend in self.mends)
        plan = self.plan = replace(plan, is_wired=is_wired)
        self._lacks = (plan.way, plan.taken, values.key_of(original.data)) if self.mends else None
        if self.mends and self._lacks != self._given_up:
            self.ask_to_rewire()
        return plan

    def ask_to_rewire(self):
        """Of the main thread."""
        mail.post(mail.REWIRE, self.key)

    def give_up_on_what_lacks(self):
        """The main thread has done what it could: it is not to be asked again for the same."""
        self._given_up = self._lacks

    def is_given_up(self, original):
        """Whether Blender has given the hook up, and it is to be made anew. (That of a mesh without vertices before 3.5
        cannot be helped.)"""
        hook = self.plan.hook_of(original)
        if hook is None or hook.driver.is_valid or self._revivals >= MOST_REVIVALS or not original.data.vertices:
            return False
        self._revivals += 1
        return True

    def is_at_work(self, copy, ob):
        """Whether Sinew is to deform this evaluated object in this pass. copy: its GraphCopy."""
        if not marks.take_mark(ob, "OBJECT"):
            copy.forget_plan()
        if copy.looks != self.looks:
            if ob.modifiers.keys() != ob.original.modifiers.keys():
                raise OlderThanOriginal
            looks = self.looks
            copy.follow(self.look(ob), looks)
        return copy.plan.is_wired and not _stands_aside and ob.mode not in EDITING

    def look_again(self):
        """At the next evaluation, which the caller sees to."""
        self.looks += 1
        self.sharer_count = None
        self.error = ""

    def take_sharer_count(self, count):
        """How many objects have its mesh: it may go another way now."""
        if count == self.sharer_count:
            return
        self.sharer_count = count
        if self._modifiers is not None:  # it was looked at
            self.looks += 1
            self.ask_to_rewire()

    def forget_shape(self):
        """All graphs read everything anew."""
        with self.lock:
            self.copies.clear()
            self.last = None


_stands_aside = False


def stands_aside():
    return _stands_aside


class StandAside:
    """Blender's own modifiers deform all meshes in evaluations meanwhile."""

    def __enter__(self):
        global _stands_aside
        _stands_aside = True

    def __exit__(self, *_):
        global _stands_aside
        _stands_aside = False
