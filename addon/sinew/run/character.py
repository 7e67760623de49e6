"""One bound mesh at run time: its plan, its data and its status. Nothing of it is saved.

The .blend holds everything; this is a cache, made anew when somebody has edited mesh, weights, shape keys or bones.
What was read belongs to the dependency graph from whose copies it was read (graph_copies.py).
"""

import threading
from dataclasses import dataclass, field
from typing import Any

import bpy

from ..host import marks, switches
from ..plan import plans, runs, ways
from . import cage_stages, methods, stages, switching
from .graph_copies import GraphCopy, OlderThanOriginal, Shared
from .planning import Planning
from .status import Status

# Modes in which people edit what they see: Blender's own modifier shows the shape there, as its tools expect.
EDITING = {"EDIT", "SCULPT"}
# Modes in which Blender's tools do not need to know which vertex of the mesh one of the result was made from. Where all
# of the result is a canvas's, only Blender's own modifiers tell them.
WITHOUT_INDICES = {"OBJECT", "POSE"}
# Evaluated objects per mesh of which something is kept: each render has objects of its own.
MOST_COPIES = 16


@dataclass
class Data:
    """What was read of one bound mesh, and the native objects made from it."""

    edition: int = 0  # of the mesh that was last read, see GraphCopy
    shared: Shared = field(default_factory=Shared, repr=False)
    kept: methods.Kept = field(default_factory=methods.Kept, repr=False)  # what the method has precomputed
    copies: dict[int, GraphCopy] = field(default_factory=dict, repr=False)  # by the address of the evaluated object
    last: GraphCopy | None = field(default=None, repr=False)  # the last one that was evaluated


class Character:
    """One bound mesh."""

    def __init__(self, key: int, name: tuple[str, str | None], edition: int = 0) -> None:
        """key: of its object; name: of its object, and the path of its library; edition: of its mesh, 0 if unknown."""
        self.key, self.name = key, name
        self.planning = Planning(key)
        self.data = Data(edition)
        self.status = Status()
        self.lock = threading.RLock()

    # --- its plan ---------------------------------------------------------------------------------

    @property
    def plan(self) -> plans.Plan:
        return self.planning.plan

    @property
    def way(self) -> ways.Way:
        return self.plan.way

    @property
    def is_wired(self) -> bool:
        return self.plan.is_wired

    @property
    def taken(self) -> tuple[str, ...]:
        return self.plan.taken

    @property
    def run(self) -> runs.Run:
        return self.plan.run

    def stage_names(self, ob: bpy.types.Object) -> tuple[str, ...]:
        """Returns the names of the stages after skinning that the last evaluation had."""
        last = self.data.last
        return last.stage_names(ob) if last is not None and last.is_deforming else stages.names(ob, self.plan.run)

    def look(self, ob: bpy.types.Object) -> plans.Plan:
        """Makes a plan for the object, original or evaluated, and returns it."""
        with self.lock:
            return self.planning.look(ob)

    def look_again(self) -> None:
        """Has the next evaluation make a new plan. The caller has Blender evaluate."""
        self.planning.look_again()
        self.status.error = ""

    # --- its data ---------------------------------------------------------------------------------

    @property
    def layers(self) -> list:
        return self.data.last.layers if self.data.last else []

    @property
    def deformer(self) -> Any:
        return self.data.last and self.data.last.deformer

    @property
    def keys(self) -> Any:
        return self.data.last and self.data.last.keys

    @property
    def method(self) -> methods.Method:
        return self.data.last.method if self.data.last else methods.Method()

    @property
    def is_deforming(self) -> bool:
        """Whether Sinew deformed the mesh in its last evaluation."""
        return self.data.last is not None and self.data.last.is_deforming

    def copy_of(self, ob: bpy.types.Object) -> GraphCopy:
        """Returns what is kept of that evaluated object; new if there is nothing. From any thread."""
        address, data = ob.as_pointer(), self.data
        found = data.copies.get(address)
        if found is None:
            with self.lock:
                while len(data.copies) >= MOST_COPIES:
                    del data.copies[next(iter(data.copies))]
                found = data.copies[address] = GraphCopy(self)
        data.last = found
        return found

    def forget_shape(self) -> None:
        """Has all graphs read everything anew."""
        with self.lock:
            self.data.copies.clear()
            self.data.last = None

    # --- in an evaluation -------------------------------------------------------------------------

    def is_at_work(self, copy: GraphCopy, ob: bpy.types.Object) -> bool:
        """Whether Sinew deforms this evaluated object in this evaluation. copy: its GraphCopy."""
        if not marks.test_and_mark(ob, "OBJECT"):
            copy.forget_plan()
        if copy.looks != self.planning.looks:
            if ob.modifiers.keys() != ob.original.modifiers.keys():
                raise OlderThanOriginal
            looks = self.planning.looks
            copy.follow(self.look(ob), looks)
            switching.release(ob)
            if copy.plan.way.in_pass and any(map(cage_stages.was_unbound_late, ob.modifiers)):
                self.planning.ask_to_rewire()  # which has Blender copy the object again, without the binding
        if copy.plan.way.takes_all and ob.mode not in WITHOUT_INDICES:
            return False
        return copy.plan.is_wired and not _stands_aside and ob.mode not in EDITING and switches.can_put_aside()


_stands_aside = False


def stands_aside() -> bool:
    """Whether Blender's own modifiers deform all meshes for now, see StandAside."""
    return _stands_aside


class StandAside:
    """Has Blender's own modifiers deform all meshes in evaluations inside the `with` block."""

    def __enter__(self) -> None:
        global _stands_aside
        _stands_aside = True

    def __exit__(self, *_: object) -> None:
        global _stands_aside
        _stands_aside = False
