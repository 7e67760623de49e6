"""Passes work from the evaluation, which runs in other threads, to the main thread."""

import logging
import threading
from collections import deque
from collections.abc import Callable
from time import monotonic
from typing import Any

log = logging.getLogger("sinew")
SECONDS_OF_INTEREST = 10.0
_MAIN_THREAD = threading.main_thread().ident
REWIRE = "rewire"  # argument: the key of an object for whose plan the file lacks something
# (function or the name of a request, arguments); appending is safe from any thread
letters: deque[tuple[Any, tuple[Any, ...]]] = deque()
_answers: dict[Any, Callable[..., object]] = {}  # by the name of the request
waiting: set[int] = set()  # identifiers of the threads that wait in `ask`
_asked_at = float("-inf")
removals: deque[tuple[Callable[..., object], tuple[Any, ...]]] = deque()


def is_main_thread() -> bool:
    """Whether the call is from the main thread. A render evaluates in its own, while the user may be editing."""
    return threading.get_ident() == _MAIN_THREAD


def answer(what: str, function: Callable[..., object]) -> None:
    """Registers the function that handles requests with that name."""
    _answers[what] = function


def post(function: Callable[..., object] | str, *arguments: Any) -> None:
    """Has the main thread call a function soon. function: may be the name of a request, such as REWIRE."""
    letters.append((function, arguments))


def ask(seconds: float, function: Callable[..., object], *arguments: Any) -> bool:
    """Has the main thread call a function, and waits until it has returned. For other threads. Returns False if the
    call has not begun within that many seconds; it is then never made."""
    global _asked_at
    _asked_at = monotonic()
    is_taken, is_done = threading.Lock(), threading.Event()

    def do_it() -> None:
        if is_taken.acquire(blocking=False):
            try:
                function(*arguments)
            finally:
                is_done.set()

    waiting.add(threading.get_ident())
    try:
        post(do_it)
        if is_done.wait(seconds):
            return True
        if is_taken.acquire(blocking=False):
            return False
        return is_done.wait()
    finally:
        waiting.discard(threading.get_ident())


def is_asked() -> bool:
    """Whether another thread has waited for the main thread recently, and so may do it again."""
    return monotonic() - _asked_at < SECONDS_OF_INTEREST


def is_empty() -> bool:
    return not letters


def deliver() -> None:
    """Makes the calls that were posted. Does nothing except in the main thread."""
    if not is_main_thread():
        return
    for _ in range(len(letters)):
        if not letters:  # a call made Blender evaluate, which delivered the others
            return
        function, arguments = letters.popleft()
        try:
            _answers.get(function, function)(*arguments)
        except Exception:
            log.exception("what an evaluation asked for could not be done")


class _AmongHandlers:
    """Around what a handler does after an evaluation. Until all handlers have run, other add-ons may ask the graph for
    the originals of what was evaluated (`Depsgraph.updates`), so no data-block may be removed."""

    count = 0

    def __enter__(self) -> None:
        self.count += 1

    def __exit__(self, *_: object) -> None:
        self.count -= 1


among_handlers = _AmongHandlers()


def once_handlers_are_done(function: Callable[..., object], *arguments: Any) -> None:
    """Calls a function that removes data-blocks: now, or before the next evaluation if handlers run."""
    if among_handlers.count:
        removals.append((function, arguments))
    else:
        function(*arguments)


def remove_what_waits() -> None:
    """Makes the calls that had to wait for handlers. Does nothing while these run."""
    while removals and not among_handlers.count and is_main_thread():
        function, arguments = removals.popleft()
        function(*arguments)


def forget() -> None:
    letters.clear()
