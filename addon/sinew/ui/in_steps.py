"""Modal operators that work step by step while the interface stays responsive, with progress and Esc."""

from collections.abc import Generator
from contextlib import ExitStack
from time import perf_counter
from typing import Any

from ..feedback import progress
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
