"""The time that one label may take: our own work and the solver's on one clock.

Whoever decides labels says how long one may take (`limited`). Loops that can be long, in whatever folder, look at the
clock (`look`), and what waits for a solver gives it what is left (`waiting`). Without a limit nothing is ever too long.

What may be in vain has a share of its own (`Trials`): how often it may try, counted, so that all that one label asks
for together costs little beside what decides it.

Work is counted in processor seconds, our own as that of a worker process, so that a busy machine changes no verdict. A
solver that is a command of somebody else is counted by the wall.

A whole run may have a `deadline`, by the wall. The same loops look at it; what they work on then is given up.
"""

from __future__ import annotations

import math
import time
from collections.abc import Generator
from contextlib import contextmanager
from contextvars import ContextVar, Token
from dataclasses import dataclass

__all__ = [
    "DeadlineError",
    "Exhausted",
    "Trials",
    "clock",
    "deadline",
    "leave_out",
    "limited",
    "look",
    "stop_clock",
    "time_is_up",
    "time_left_s",
    "trials_left",
    "waiting",
]


class Exhausted(Exception):
    """A limit is used up, or the time; what is not decided stays unknown.

    Attributes:
        reason: As of `Unknown`: "timeout", "budget", ...
        detail: Which limit it was, in words.
    """

    def __init__(self, reason: str, detail: str = "") -> None:
        """Take both."""
        super().__init__(reason)
        self.reason = reason
        self.detail = detail


class DeadlineError(Exception):
    """The time that a run may take is over."""


@dataclass(slots=True)
class _Limit:
    """When the time of a block is up.

    Attributes:
        until: On the clock of this thread; what solvers took is taken off beforehand.
        not_before: By the wall: a thread never works faster than that.
        deadline: When the run is over, as of `time.monotonic`.
    """

    until: float = math.inf
    not_before: float = math.inf
    deadline: float = math.inf


_ENDLESS = _Limit()
_LIMIT: ContextVar[_Limit] = ContextVar("_LIMIT", default=_ENDLESS)


_LEFT_OUT: ContextVar[float] = ContextVar("_LEFT_OUT", default=0.0)
"""Seconds of the wall that were waited, but count for nothing."""


def clock() -> float:
    """Seconds from some moment on, without those that count for nothing."""
    return time.perf_counter() - _LEFT_OUT.get()


def leave_out(seconds: float) -> None:
    """Within `waiting`: so much of the time that has passed counts for nothing."""
    _LEFT_OUT.set(_LEFT_OUT.get() + seconds)


class limited:  # noqa: N801 - read as a statement
    """Let what happens in the block take so long at most, or less where a block around it says so.

    Entered again, it has the time that is left.
    """

    __slots__ = ("_seconds", "_token")
    _token: Token[_Limit]

    def __init__(self, seconds: float) -> None:
        """Take the time, which begins with the block.

        Args:
            seconds: The time.
        """
        self._seconds = seconds

    def __enter__(self) -> None:
        """Set the clock."""
        outer, used_s = _LIMIT.get(), time.thread_time()
        left = min(outer.until - used_s, self._seconds)
        not_before = time.perf_counter() + min(left, time_left_s(outer.deadline))
        self._token = _LIMIT.set(_Limit(used_s + left, not_before, outer.deadline))

    def __exit__(self, *_: object) -> None:
        """Go back to the clock of the block around."""
        self._seconds = _LIMIT.get().until - time.thread_time()
        _LIMIT.reset(self._token)


@contextmanager
def deadline(until: float | None) -> Generator[None]:
    """Give up what happens in the block when the time of the whole run is over.

    Args:
        until: When it is over, as of `time.monotonic`, which never jumps and which all processes of a machine share;
            None for never.

    Raises:
        DeadlineError: It is over; at once, or where the block looks at the clock, or at its end.
    """
    outer = _LIMIT.get()
    over = min(outer.deadline, math.inf if until is None else until)
    token = _LIMIT.set(_Limit(outer.until, -math.inf, over))
    try:
        _look_at_deadline(over)
        yield
        _look_at_deadline(over)
    finally:
        _LIMIT.reset(token)


def _look_at_deadline(over: float) -> None:
    if time.monotonic() >= over:
        raise DeadlineError


def time_left_s(until: float | None) -> float:
    """Seconds until the time of a run is over, below 0 afterwards; infinity without a limit; see `deadline`."""
    return math.inf if until is None else until - time.monotonic()


def look() -> None:
    """Look at the clock.

    Raises:
        Exhausted: The time is used up.
        DeadlineError: The time of the whole run is over.
    """
    limit = _LIMIT.get()
    # the thread's clock takes ten times as long to read as the wall's
    if time.perf_counter() <= limit.not_before:
        return
    _look_at_deadline(limit.deadline)
    left = limit.until - time.thread_time()
    if left < 0:
        raise Exhausted("timeout")
    limit.not_before = time.perf_counter() + min(left, time_left_s(limit.deadline))


def time_is_up() -> bool:
    """Whether the time of the block around is used up."""
    try:
        look()
    except Exhausted:
        return True
    return False


@dataclass(slots=True)
class Trials:
    """How often all that looks for something within the block may try in vain.

    Attributes:
        left: How often still.
    """

    left: float = math.inf
    _token: Token[Trials | None] | None = None

    def __enter__(self) -> Trials:
        """Have what is in the block count on these."""
        self._token = _TRIALS.set(self)
        return self

    def __exit__(self, *_: object) -> None:
        """Go back to those of the block around."""
        if self._token is not None:
            _TRIALS.reset(self._token)


_TRIALS: ContextVar[Trials | None] = ContextVar("_TRIALS", default=None)


def trials_left() -> Trials:
    """The trials of the block around; endless ones where there is none."""
    return _TRIALS.get() or Trials()


@contextmanager
def waiting(seconds: float) -> Generator[float]:
    """The seconds that something outside of this process may take; what it takes counts.

    Args:
        seconds: At most.

    Raises:
        Exhausted: Nothing is left.
    """
    look()
    limit, began = _LIMIT.get(), clock()
    try:
        yield min(seconds, limit.until - time.thread_time(), time_left_s(limit.deadline))
    finally:
        waited = clock() - began
        limit.until -= waited
        limit.not_before -= waited


@contextmanager
def stop_clock() -> Generator[None]:
    """Within `waiting`, what is no fault of the label, such as starting a process: it takes no time."""
    began = time.perf_counter()
    try:
        yield
    finally:
        leave_out(time.perf_counter() - began)
