"""Runs a computation in a thread of its own, step by step for the interface."""

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
