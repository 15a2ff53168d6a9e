"""A limit on a whole run: what is decided when the time is over is given out, and no more is begun."""

from __future__ import annotations

import math
from time import monotonic

__all__ = ["DeadlineError", "check_deadline", "time_left_s"]


class DeadlineError(Exception):
    """The time that a run may take is over."""


def check_deadline(until: float | None) -> None:
    """Look at the clock.

    Args:
        until: When the time is over, as of `time.monotonic`, which never jumps and which all processes of a machine
            share; None for never.

    Raises:
        DeadlineError: It is over.
    """
    if until is not None and monotonic() >= until:
        raise DeadlineError


def time_left_s(until: float | None) -> float:
    """Seconds until the time is over, below 0 afterwards; infinity without a limit."""
    return math.inf if until is None else until - monotonic()
