"""What the evaluation, which runs in other threads, leaves for the main thread to do or to say."""

import logging
import threading
from collections import deque

log = logging.getLogger("sinew")
_letters = deque()  # (function, arguments); appending is safe from any thread


def post(function, *arguments):
    """The main thread calls it soon."""
    _letters.append((function, arguments))


def is_empty():
    return not _letters


def deliver():
    """In the main thread; elsewhere nothing happens."""
    if threading.current_thread() is not threading.main_thread():
        return
    for _ in range(len(_letters)):
        if not _letters:  # one of them had Blender evaluate, and so deliver the others
            return
        function, arguments = _letters.popleft()
        try:
            function(*arguments)
        except Exception:
            log.exception("what an evaluation asked for could not be done")


def forget():
    _letters.clear()
