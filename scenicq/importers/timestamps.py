"""Instants as sources write them: seconds as a number or a text, or a date."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import UTC, datetime

from scenicq.importers.fields import InvalidError
from scenicq.importers.report import Report

__all__ = ["microseconds", "tell_rate"]

_FEWEST_TIMES, _SHORTEST_STEP_US, _LONGEST_STEP_US = 3, 1e3, 1e8
"""Labels more often than a thousand times a second, or less often than every 100 s, have times in another unit."""


def microseconds(stamp: object, key: str) -> int:
    """Microseconds of an instant.

    Args:
        stamp: Seconds as a number or a text, or a date of ISO 8601; without a zone it is UTC.
        key: What it is called, for messages.

    Raises:
        InvalidError: It is neither, or out of range.
    """
    seconds = math.inf
    if isinstance(stamp, str):
        try:
            seconds = float(stamp)
        except ValueError:
            try:
                date = datetime.fromisoformat(stamp)
                # A date without a zone must not mean another instant on another machine.
                seconds = (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()
            except (ValueError, OverflowError, OSError) as error:
                raise InvalidError(f"`{key}` is neither a number nor a date") from error
    elif isinstance(stamp, int | float) and not isinstance(stamp, bool):
        seconds = float(stamp) if abs(stamp) < 1e15 else math.inf
    else:
        raise InvalidError(f"`{key}` is neither a number nor a date")
    if not abs(seconds) < 1e12:
        raise InvalidError(f"`{key}` is out of range")
    return round(seconds * 1e6)


def tell_rate(name: str, times_us: Sequence[int], report: Report) -> None:
    """Tell a rate that no recorder has, as it comes from times in another unit.

    Args:
        name: Of the recording.
        times_us: Of its labels.
        report: Takes what is told.
    """
    if len(times_us) < _FEWEST_TIMES:
        return
    step_us = (max(times_us) - min(times_us)) / (len(times_us) - 1)
    if not _SHORTEST_STEP_US <= step_us <= _LONGEST_STEP_US:
        message = f"recording `{name}` has a label every {step_us / 1e6:.3g} s; its times may not be microseconds"
        report.assumed("recording", "times in microseconds", message)
