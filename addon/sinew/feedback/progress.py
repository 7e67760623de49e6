"""Shows the progress of longer operations in the status bar and at the mouse cursor."""

from contextlib import contextmanager
from time import perf_counter

import bpy

SHOWN_AFTER = 0.5  # seconds: shorter operations show no text


class _Silent:
    def step(self, share, text):
        """share: how much is done, 0 to 1; text: what is being done now."""


SILENT = _Silent()


class Part:
    """One of several equal parts of the work, whose own shares go from 0 to 1."""

    def __init__(self, whole, number, count):
        self._whole, self._number, self._count = whole, number, count

    def step(self, share, text):
        self._whole.step((self._number + share) / self._count, text)


class _Shown:
    def __init__(self, context, draws):
        self._context, self._draws, self._start, self._said = context, draws, perf_counter(), False

    def step(self, share, text):
        self._context.window_manager.progress_update(100 * share)
        if perf_counter() - self._start < SHOWN_AFTER:
            return
        self._said = True
        self._context.workspace.status_text_set(f"Sinew: {text} ({100 * share:.0f} %)")
        if self._draws:
            bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)

    def close(self):
        if self._said:
            self._context.workspace.status_text_set(None)
        self._context.window_manager.progress_end()


@contextmanager
def shown(context, draws=True):
    """`with shown(context) as progress: progress.step(0.5, "reading weights")`. Shows nothing without a window. draws:
    whether to redraw the window at each step, because Blender cannot; with a modal operator it can."""
    if bpy.app.background or context.window is None:
        yield SILENT
        return
    progress = _Shown(context, draws)
    context.window_manager.progress_begin(0, 100)
    try:
        yield progress
    finally:
        progress.close()
