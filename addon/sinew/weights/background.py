"""Runs computations in threads of the library, for the interface. They must not touch Blender's data."""

from collections.abc import Callable, Generator
from typing import Any

from ..native import sinew_native


class Latest:
    """The newest of several computations: when one begins, the one before it is cancelled, and nobody waits for it."""

    def __init__(self) -> None:
        self.result: Any = None  # of the newest that has ended; an error, if it raised one
        self._progress: Any = None  # of the one that runs
        self._task: Any = None  # sinew_native.Task, of the newest

    def begin(self, work: Callable[[Any], Any]) -> None:
        """Runs work(progress), with a sinew_native.Progress."""
        self.cancel()
        progress = self._progress = sinew_native.Progress()

        def run() -> None:
            try:
                result = work(progress)
            except BaseException as error:  # shown or raised by whoever asks for the result
                result = error
            if self._progress is progress:
                self.result, self._progress = result, None

        self._task = sinew_native.Task(run)

    @property
    def fraction(self) -> float | None:
        """How much of the one that runs is done; None: none runs."""
        progress = self._progress
        return None if progress is None else progress.fraction

    def wait(self, seconds: float | None = None) -> bool:
        """Waits for the newest, at most so long if told. Returns whether it has ended."""
        if self._task is not None:
            self._task.wait(seconds)
        return self._progress is None

    def cancel(self) -> None:
        """Cancels the one that runs."""
        if self._progress is not None:
            self._progress.cancel()
            self._progress = None

    def steps(self, text: str) -> Generator[tuple[float, str], None, Any]:
        """Yields (share done, text) until the newest has ended, then returns its result or raises its error. If the
        generator is closed early, it is cancelled, and closing waits for it to end."""
        try:
            while (share := self.fraction) is not None:
                yield share, text
        finally:
            self.cancel()
            self.wait()
        if isinstance(self.result, BaseException):
            raise self.result
        return self.result


def steps(work: Callable[[Any], Any], text: str) -> Generator[tuple[float, str], None, Any]:
    """Yields (share done, text) until work(progress) has ended, as Latest.steps does."""
    latest = Latest()
    latest.begin(work)
    return (yield from latest.steps(text))
