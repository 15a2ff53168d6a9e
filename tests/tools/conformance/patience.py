"""A limit of processor time. Runs where `scenicq` is and where Scenic is, so that it needs neither."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["OutOfPatienceError", "patience"]


class OutOfPatienceError(BaseException):
    """Something takes too long; not an `Exception`, so that nothing takes it for its own."""


@contextmanager
def patience(seconds: float) -> Iterator[None]:
    """Raise OutOfPatienceError after so many seconds of processor time."""

    def expired(*_: object) -> None:
        raise OutOfPatienceError

    signal.signal(signal.SIGPROF, expired)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
