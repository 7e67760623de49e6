"""What the evaluation, which runs in other threads, leaves for the main thread to do or to say."""

import logging
import threading
from collections import deque
from time import monotonic

log = logging.getLogger("sinew")
SECONDS_OF_INTEREST = 10.0
REWIRE = "rewire"  # an object, by its key: the file lacks what its plan needs
_letters = deque()  # (function or what is asked for, arguments); appending is safe from any thread
_answers = {}  # what is asked for -> function
_asked_at = float("-inf")


def answer(what, function):
    """From now on that function does what is asked for under that name."""
    _answers[what] = function


def post(function, *arguments):
    """The main thread calls it soon. function: may be the name of what is asked for, such as REWIRE."""
    _letters.append((function, arguments))


def ask(seconds, function, *arguments):
    """From another thread: the main thread calls it, and this one waits. Returns False if that has not begun after so
    many seconds, and then it never does."""
    global _asked_at
    _asked_at = monotonic()
    is_taken, is_done = threading.Lock(), threading.Event()

    def do_it():
        if is_taken.acquire(blocking=False):
            try:
                function(*arguments)
            finally:
                is_done.set()

    post(do_it)
    if is_done.wait(seconds):
        return True
    if is_taken.acquire(blocking=False):
        return False
    return is_done.wait()


def is_asked():
    """Whether other threads have lately waited for the main thread: they may do so again."""
    return monotonic() - _asked_at < SECONDS_OF_INTEREST


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
            _answers.get(function, function)(*arguments)
        except Exception:
            log.exception("what an evaluation asked for could not be done")


def forget():
    _letters.clear()
