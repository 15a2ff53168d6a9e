"""The time that one label may take: our own work and the solver's on one clock.

Whoever decides labels says how long one may take (`limited`). Loops that can be long, in whatever folder, look at the
clock (`look`), and what waits for a solver gives it what is left (`waiting`). Without a limit nothing is ever too long.

Work is counted in processor seconds, our own as that of a worker process, so that a busy machine changes no verdict. A
solver that is a command of somebody else is counted by the wall.
"""

from __future__ import annotations

import math
import time
from collections.abc import Generator
from contextlib import contextmanager
from contextvars import ContextVar, Token

__all__ = ["TimeIsUp", "clock", "leave_out", "limited", "look", "uncounted", "waiting"]


class TimeIsUp(Exception):
    """The label has taken all the time that it may; what is not decided stays unknown."""


_UNTIL: ContextVar[float] = ContextVar("_UNTIL", default=math.inf)
"""When the time is up, on the clock of this thread; what solvers took is taken off beforehand."""


_LEFT_OUT: ContextVar[float] = ContextVar("_LEFT_OUT", default=0.0)
"""Seconds of the wall that were waited, but count for nothing."""


def clock() -> float:
    """Seconds from some moment on, without those that count for nothing."""
    return time.perf_counter() - _LEFT_OUT.get()


def leave_out(seconds: float) -> None:
    """Within `waiting`: so much of the time that has passed counts for nothing."""
    _LEFT_OUT.set(_LEFT_OUT.get() + seconds)


class limited:  # noqa: N801 - read as a statement
    """Let what happens in the block take so long at most, or less where a block around it says so."""

    __slots__ = ("_seconds", "_token")
    _token: Token[float]

    def __init__(self, seconds: float) -> None:
        """Take the time, which begins with the block.

        Args:
            seconds: The time.
        """
        self._seconds = seconds

    def __enter__(self) -> None:
        """Set the clock."""
        self._token = _UNTIL.set(min(_UNTIL.get(), time.thread_time() + self._seconds))

    def __exit__(self, *_: object) -> None:
        """Go back to the clock of the block around."""
        _UNTIL.reset(self._token)


def look() -> None:
    """Look at the clock.

    Raises:
        TimeIsUp: The time is used up.
    """
    if time.thread_time() > _UNTIL.get():
        raise TimeIsUp


@contextmanager
def waiting(seconds: float) -> Generator[float]:
    """The seconds that something outside of this process may take; what it takes counts.

    Args:
        seconds: At most.

    Raises:
        TimeIsUp: Nothing is left.
    """
    look()
    began = clock()
    try:
        yield min(seconds, _UNTIL.get() - time.thread_time())
    finally:
        _UNTIL.set(_UNTIL.get() - (clock() - began))


@contextmanager
def uncounted() -> Generator[None]:
    """Within `waiting`, what is no fault of the label, such as starting a process: it takes no time."""
    began = time.perf_counter()
    try:
        yield
    finally:
        leave_out(time.perf_counter() - began)
