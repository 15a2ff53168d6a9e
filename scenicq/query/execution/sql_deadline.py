"""The deadline of a run while DuckDB works: a statement looks at no clock, and is interrupted from outside."""

from __future__ import annotations

import math
import threading
from collections.abc import Generator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from scenicq.budget import DeadlineError, deadline, time_left_s

if TYPE_CHECKING:
    import duckdb

__all__ = ["SqlWatch", "sql_deadline"]

_AGAIN_S = 0.05
"""Seconds until a connection is interrupted again: a statement may begin when the time is over."""
_LONGEST_WAIT_S = 3600.0


@contextmanager
def sql_deadline(until: float | None) -> Generator[None]:
    """Give up what happens in the block when the time is over, also within statements of a connection that is watched.

    Args:
        until: As of `budget.deadline`.

    Raises:
        DeadlineError: As of `budget.deadline`.
    """
    with deadline(until):
        try:
            yield
        except Exception as error:
            if time_left_s(until) > 0 or not _was_interrupted(error):
                raise
            raise DeadlineError from error


def _was_interrupted(error: Exception) -> bool:
    # takes long to load, and is there where a statement was interrupted
    import duckdb  # noqa: PLC0415

    return isinstance(error, duckdb.InterruptException)


class SqlWatch:
    """Interrupts the statements of a connection from a moment on; a context manager."""

    def __init__(self, connection: duckdb.DuckDBPyConnection, until: float | None) -> None:
        """Watch nothing yet.

        Args:
            connection: The connection, which stays open as long as it is watched.
            until: The moment, as of `budget.deadline`; None for never.
        """
        self._connection, self._until = connection, math.inf if until is None else until
        self._done = threading.Event()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> SqlWatch:
        """Watch from now on."""
        if self._until < math.inf:
            self._thread = threading.Thread(target=self._watch, daemon=True)
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Watch no longer."""
        self._done.set()
        if self._thread is not None:
            self._thread.join()

    def _watch(self) -> None:
        left_s = time_left_s(self._until)
        while not self._done.wait(min(max(left_s, _AGAIN_S), _LONGEST_WAIT_S)):
            left_s = time_left_s(self._until)
            if left_s <= 0:
                self._connection.interrupt()
