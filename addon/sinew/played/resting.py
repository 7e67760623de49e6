"""Rigs that somebody edits on each frame, such as a script that poses them and inserts keys. To read a rig again takes
as long as Blender does for several frames, so one that has to be read too often stays Blender's until it rests."""

from dataclasses import dataclass
from typing import Any

from ..host import evaluations, keyframes

FRAMES_OF_A_READING = 8  # that are played without an edit until it has paid
MOST_DEBT = 3 * FRAMES_OF_A_READING
FRAMES = 12  # without an edit, until it has rested
MOST_FRAMES = 64 * FRAMES


@dataclass
class Rest:
    """How often a rig is edited."""

    debt: int = 0  # frames that have to be played until its readings have paid
    left: int = 0  # frames without an edit until it has rested; 0: it may be computed
    needed: int = FRAMES  # since it was edited the last time

    def may_read(self) -> bool:
        """Whether it may be read before this frame, which is noted. Otherwise it has to rest."""
        self.debt += FRAMES_OF_A_READING
        if self.debt <= MOST_DEBT:
            return True
        self.needed = min(2 * self.needed, MOST_FRAMES)
        self.debt, self.left = 0, self.needed
        return False

    def note_played(self) -> None:
        """Notes that a frame was computed without an edit before it."""
        self.debt, self.needed = max(self.debt - 1, 0), max(self.needed - 1, FRAMES)

    def note_live(self, is_edited: bool, is_new_frame: bool) -> None:
        """Notes an evaluation by Blender while it rests."""
        if is_edited:
            self.left = self.needed
        elif is_new_frame:
            self.left = max(self.left - 1, 0)

    def end(self) -> None:
        """Says that nothing is done now, or that what follows are frames without edits."""
        self.debt = self.left = 0


def is_edited(ob: Any, graph: Any) -> bool:
    """Whether somebody has edited a live armature object since the last evaluation. Call it before one: time tags it,
    too."""
    blocks = [ob, ob.data, *(each.action for each in keyframes.actions_of(ob) if each.action is not None)]
    return any(evaluations.is_tagged(each.evaluated_get(graph)) for each in blocks)
