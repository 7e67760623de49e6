"""Long work as a generator of (share done, what comes next) that returns its result."""

from collections.abc import Generator
from typing import Any

Work = Generator[tuple[float, str], None, Any]


def finish(work: Work) -> Any:
    """Does all of the work at once. Returns its result, or raises what it raises."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            return end.value


def scaled(work: Work, first: float, last: float) -> Work:
    """Yields the steps of some work as a part of the whole, from share first to last, and returns its result. Closing
    it early closes the work."""
    try:
        while True:
            share, text = next(work)
            yield first + share * (last - first), text
    except StopIteration as end:
        return end.value
    finally:
        work.close()
