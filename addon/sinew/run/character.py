"""One bound mesh at run time: its plan, its status, and what its graph copies share. Nothing of it is saved.

The .blend holds everything; this is a cache. What was read belongs to the evaluated object of which it was read
(graph_copy.py).
"""

import threading
from typing import Any

import bpy

from ..chain import methods, stages
from ..host import modifier_memory
from ..plan import plans, runs, ways
from . import graph_copies, standing_aside
from .graph_copy import GraphCopy
from .mesh_reading import Shared
from .planning import Planning
from .status import Status

# Modes in which Blender's tools do not need to know which vertex of the mesh one of the result was made from. Where all
# of the result is a canvas's, only Blender's own modifiers tell them.
WITHOUT_INDICES = {"OBJECT", "POSE"}


class Character:
    """One bound mesh."""

    def __init__(self, key: int, name: tuple[str, str | None]) -> None:
        """key: of its object; name: of its object, and the path of its library."""
        self.key, self.name = key, name
        self.planning = Planning(key)
        self.status = Status()
        self.edition = 0  # of the mesh that was last read, see reading.Reading
        self.shared = Shared()
        self.kept = methods.Kept()  # what the method has precomputed
        self.edited_to: int | None = None  # tells the vertices that its own mesh had after the last edit, see bind.py
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
        last = self.last
        return last.chain.stage_names(ob) if last is not None and last.is_deforming else stages.names(ob, self.run)

    def look(self, ob: bpy.types.Object) -> plans.Plan:
        """Makes a plan for the object, original or evaluated, and returns it."""
        with self.lock:
            return self.planning.look(ob)

    def look_again(self) -> None:
        """Has the next evaluation make a new plan. The caller has Blender evaluate."""
        self.planning.look_again()
        self.status.note_success()

    def may_work(self, plan: plans.Plan, ob: bpy.types.Object) -> bool:
        """Whether Sinew deforms an evaluated object that has such a plan, if any modifier that it replaces is on."""
        if plan.way.takes_all and ob.mode not in WITHOUT_INDICES:
            return False
        return plan.is_wired and not standing_aside.is_on() and modifier_memory.can_put_aside()

    # --- its evaluated copies ---------------------------------------------------------------------

    def copy_of(self, ob: bpy.types.Object) -> GraphCopy:
        """Returns what is known of that evaluated object; new if there is nothing. From any thread."""
        return graph_copies.of(self, ob)

    @property
    def last(self) -> GraphCopy | None:
        """What is known of the evaluated copy that was evaluated last, or None."""
        return next(reversed(graph_copies.of_mesh(self)), None)

    @property
    def layers(self) -> list:
        return self.last.chain.first.layers if self.last else []

    @property
    def deformer(self) -> Any:
        return self.last and self.last.chain.deformer

    @property
    def keys(self) -> Any:
        return self.last and self.last.reading.keys

    @property
    def method(self) -> methods.Method:
        return self.last.reading.method if self.last else methods.Method()

    @property
    def is_deforming(self) -> bool:
        """Whether Sinew deformed the mesh in its last evaluation."""
        return self.last is not None and self.last.is_deforming
