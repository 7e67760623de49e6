"""Shows the progress of long operations in the status bar and at the mouse cursor."""

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter

import bpy

SHOWN_AFTER = 0.5  # seconds: shorter operations show no text


class _Silent:
    def step(self, share: float, text: str) -> None:
        """Does nothing. share: how much is done, 0 to 1; text: what is being done now."""


SILENT = _Silent()


class Part:
    """One of several equal parts of the work, with its own shares from 0 to 1."""

    def __init__(self, whole: "_Silent | _Shown | Part", number: int, count: int) -> None:
        self._whole, self._number, self._count = whole, number, count

    def step(self, share: float, text: str) -> None:
        """Reports progress within this part. share: how much of it is done, 0 to 1; text: what is being done now."""
        self._whole.step((self._number + share) / self._count, text)


class _Shown:
    def __init__(self, context: bpy.types.Context, draws: bool) -> None:
        self._context, self._draws, self._start, self._said = context, draws, perf_counter(), False

    def step(self, share: float, text: str) -> None:
        """Shows progress. share: how much is done, 0 to 1; text: what is being done now."""
        self._context.window_manager.progress_update(100 * share)
        if perf_counter() - self._start < SHOWN_AFTER:
            return
        self._said = True
        self._context.workspace.status_text_set(f"Sinew: {text} ({100 * share:.0f} %)")
        if self._draws:
            bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)

    def close(self) -> None:
        """Removes the text and the progress at the cursor."""
        if self._said:
            self._context.workspace.status_text_set(None)
        self._context.window_manager.progress_end()


@contextmanager
def shown(context: bpy.types.Context, draws: bool = True) -> Iterator[_Silent | _Shown]:
    """Shows progress: `with shown(context) as progress: progress.step(0.5, "reading weights")`. Shows nothing without a
    window. draws: whether to redraw the window at each step; a modal operator does not need it, because Blender redraws
    between its steps."""
    if bpy.app.background or context.window is None:
        yield SILENT
        return
    progress = _Shown(context, draws)
    context.window_manager.progress_begin(0, 100)
    try:
        yield progress
    finally:
        progress.close()
