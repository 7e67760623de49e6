"""Operators that work step by step while the interface stays responsive, with progress and Esc: modal ones, those that
compute new weights in a thread and then write them, and those of a dialog that sets what another one does on frames."""

from collections.abc import Generator
from contextlib import ExitStack
from time import perf_counter, sleep
from typing import Any

import bpy
from bpy.props import IntProperty

from ..bake.frame_range import FrameRange
from ..feedback import progress
from ..weights import background
from . import available

SECONDS_BETWEEN_STEPS = 0.01  # lets Blender draw and notice Esc


class InSteps(available.Reports):
    """The operator calls `begin` in its invoke(). It defines `finish(context, value)`, which receives the return value
    of the steps, and returns and raises what `run` does."""

    stopped = ""  # the message after Esc
    seconds_in_a_row = 0.0  # how long steps may run before Blender draws again

    def begin(self, context: Any, steps: Generator[tuple[float, str], None, Any]) -> set[str]:
        """Starts the steps. steps: a generator of (share done, what comes next), which can safely be closed early and
        may raise ValueError and OSError."""
        self._steps = steps
        self._stack = ExitStack()
        self._stack.callback(steps.close)
        self._progress = self._stack.enter_context(progress.shown(context, draws=False))
        manager = context.window_manager
        timer = manager.event_timer_add(SECONDS_BETWEEN_STEPS, window=context.window)
        self._stack.callback(manager.event_timer_remove, timer)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            self.cancel(context)
            self.report({"INFO"}, self.stopped)
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}
        start = perf_counter()
        try:
            share, text = next(self._steps)
            while perf_counter() - start < self.seconds_in_a_row:
                share, text = next(self._steps)
            self._progress.step(share, f"{text}, Esc stops it")
            return {"RUNNING_MODAL"}
        except StopIteration as end:
            self.cancel(context)
            done = end.value
            return self.at_once(lambda: self.finish(context, done))
        except available.ERRORS as error:
            self.cancel(context)
            return self.fail(error)
        except BaseException:
            self.cancel(context)
            raise

    def cancel(self, _context):
        self._stack.close()


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


class OverFrames:
    """The properties of both operators. Those of a job derive from this and add their own."""

    frame_start: IntProperty(name="First Frame", description="The first frame to bake; by default the scene's")
    frame_end: IntProperty(name="Last Frame", description="The last frame to bake; by default the scene's")
    frame_step: IntProperty(name="Step", description="Distance from one baked frame to the next", default=1, min=1)

    def settings(self: Any) -> dict[str, Any]:
        """Returns the properties that are set, without those of the operator itself."""
        names = [
            name
            for kind in type(self).__mro__
            if issubclass(kind, OverFrames) and not issubclass(kind, bpy.types.Operator)
            for name in kind.__annotations__
        ]
        return {name: getattr(self, name) for name in names if self.properties.is_property_set(name)}

    def frames(self: Any, scene: bpy.types.Scene) -> FrameRange:
        is_set = self.properties.is_property_set
        return FrameRange(
            self.frame_start if is_set("frame_start") else scene.frame_start,
            self.frame_end if is_set("frame_end") else scene.frame_end,
            self.frame_step,
        )

    def set_frames(self: Any, scene: bpy.types.Scene) -> None:
        """Has the dialog show the scene's frames."""
        for name in ("frame_start", "frame_end"):
            if not self.properties.is_property_set(name):
                setattr(self, name, getattr(scene, name))

    def start(self: Any, steps: Any) -> set[str]:
        """Calls the operator `steps` with the settings: with progress if there is a window. Raises ValueError
        with its error."""
        how = "EXEC_DEFAULT" if bpy.app.background or bpy.context.window is None else "INVOKE_DEFAULT"
        try:
            return {"FINISHED"} & steps(how, **self.settings()) or {"CANCELLED"}
        except RuntimeError as error:
            raise ValueError(str(error).strip().removeprefix("Error: ")) from error
