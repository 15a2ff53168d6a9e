"""Instants as sources write them: seconds as a number or a text, or a date."""

from __future__ import annotations

import math
from datetime import UTC, datetime

from scenicq.importers.fields import InvalidError

__all__ = ["microseconds"]


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
