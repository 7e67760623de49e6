"""Operators that compute new weights while the interface stays responsive, and then write them."""

from typing import Any

import bpy

from ..weights import background
from .in_steps import InSteps


class InBackground(InSteps):
    """In a window, the computation runs in a thread of its own, with progress and Esc. Each operator defines
    `assignment(context)`, which may raise ValueError and returns something with `compute(progress)`, and
    `finish(context, assignment)`."""

    bl_options = {"REGISTER", "UNDO"}
    computing = "making weights"
    stopped = "Stopped: no weights were changed"

    def execute(self: Any, context):
        def work():
            made = self.assignment(context)
            made.compute()
            return self.finish(context, made)

        return self.at_once(work)

    def invoke(self: Any, context, _event):
        if bpy.app.background or context.window is None:
            return self.execute(context)
        return self.at_once(lambda: self.begin(context, self.in_thread(self.assignment(context))))

    def in_thread(self, made: Any) -> Any:
        yield from background.steps(made.compute, self.computing)
        return made
