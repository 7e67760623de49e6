"""Runs computations in threads of their own, for the interface."""

import threading
from collections.abc import Callable, Generator
from typing import Any

from ..native import sinew_native


def steps(work: Callable[[Any], Any], text: str) -> Generator[tuple[float, str], None, Any]:
    """Yields (share done, text) until work(progress) is finished, then returns its result or raises its error.

    progress: a sinew_native.Progress. If the generator is closed early, it is cancelled, and closing waits for the work
    to end. The work must not touch Blender's data."""
    progress = sinew_native.Progress()
    result: list[Any] = []
    errors: list[BaseException] = []

    def run() -> None:
        try:
            result.append(work(progress))
        except BaseException as error:  # raised again in the caller's thread
            errors.append(error)

    thread = threading.Thread(target=run, name="Sinew: weights")
    thread.start()
    try:
        while thread.is_alive():
            yield progress.fraction, text
    finally:
        progress.cancel()
        thread.join()
    if errors:
        raise errors[0]
    return result[0]


class Latest:
    """The newest of several computations: when one begins, the one before it is cancelled, and nobody waits for it."""

    def __init__(self) -> None:
        self.result: Any = None  # of the newest that has ended; an error, if it raised one
        self._progress: Any = None  # of the one that runs
        self._thread: threading.Thread | None = None

    def begin(self, work: Callable[[Any], Any]) -> None:
        """Runs work(progress), which must not touch Blender's data, with a sinew_native.Progress."""
        self.cancel()
        progress = self._progress = sinew_native.Progress()

        def run() -> None:
            try:
                result = work(progress)
            except Exception as error:  # shown by whoever asks for the result
                result = error
            if self._progress is progress:
                self.result, self._progress = result, None

        self._thread = threading.Thread(target=run, name="Sinew: the latest of the weights")
        self._thread.start()

    @property
    def fraction(self) -> float | None:
        """How much of the one that runs is done; None: none runs."""
        progress = self._progress
        return None if progress is None else progress.fraction

    def wait(self, seconds: float) -> bool:
        """Waits for the newest at most so long. Returns whether it has ended."""
        if self._thread is not None:
            self._thread.join(seconds)
        return self._progress is None

    def cancel(self) -> None:
        """Cancels the one that runs."""
        if self._progress is not None:
            self._progress.cancel()
            self._progress = None
