"""Operators that compute new weights while the interface stays responsive, and then write them."""

from time import sleep
from typing import Any

import bpy

from ..feedback import progress
from ..weights import background
from .in_steps import SECONDS_BETWEEN_STEPS, InSteps


class InBackground(InSteps):
    """In a window, the computation runs in a thread of its own, with progress and Esc. Each operator defines
    `assignment(context)`, which may raise ValueError and returns something with `compute(progress)`, and
    `finish(context, assignment)`."""

    bl_options = {"REGISTER", "UNDO"}
    computing = "making weights"
    stopped = "Stopped: no weights were changed"

    def run(self: Any, context):
        """For scripts, and for Adjust Last Operation. That takes back what was done, calls this, and gives up what does
        not end with FINISHED, so it cannot go on in `modal`: Blender waits, and the cursor shows the progress."""
        made = self.assignment(context)
        with progress.shown(context, draws=False) as shown:
            for step in self.in_thread(made):
                shown.step(*step)
                sleep(SECONDS_BETWEEN_STEPS)
        return self.finish(context, made)

    def invoke(self: Any, context, _event):
        if bpy.app.background or context.window is None:
            return self.execute(context)
        return self.at_once(lambda: self.begin(context, self.in_thread(self.assignment(context))))

    def in_thread(self, made: Any) -> Any:
        """Yields (share done, text) until `made` is computed, then returns it. What is computed in Python tells its
        share itself."""
        for share, text in background.steps(made.compute, self.computing):
            yield getattr(made, "share", share), text
        return made
