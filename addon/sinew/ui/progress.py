"""Progress of what takes longer than a moment: in the status bar and at the mouse cursor."""

from contextlib import contextmanager
from time import perf_counter

import bpy

SHOWN_AFTER = 0.5  # seconds: what ends before that needs no words


class _Silent:
    def step(self, share, text):
        """share: what is done, 0 to 1; text: what is being done now."""


SILENT = _Silent()


class Part:
    """One of several equal parts of the work, with shares of its own."""

    def __init__(self, whole, number, count):
        self._whole, self._number, self._count = whole, number, count

    def step(self, share, text):
        self._whole.step((self._number + share) / self._count, text)


class _Shown:
    def __init__(self, context):
        self._context, self._start, self._said = context, perf_counter(), False

    def step(self, share, text):
        self._context.window_manager.progress_update(100 * share)
        if perf_counter() - self._start < SHOWN_AFTER:
            return
        self._said = True
        self._context.workspace.status_text_set(f"Sinew: {text} ({100 * share:.0f} %)")
        bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)  # Blender draws nothing by itself now

    def close(self):
        if self._said:
            self._context.workspace.status_text_set(None)
        self._context.window_manager.progress_end()


@contextmanager
def shown(context):
    """`with shown(context) as progress: progress.step(0.5, "reading weights")`. Nothing without a window."""
    if bpy.app.background or context.window is None:
        yield SILENT
        return
    progress = _Shown(context)
    context.window_manager.progress_begin(0, 100)
    try:
        yield progress
    finally:
        progress.close()
