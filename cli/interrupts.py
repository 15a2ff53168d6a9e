"""Ctrl-C and SIGTERM: a command that is asked to stop stops.

A `KeyboardInterrupt` can get lost on its way: DuckDB turns it into an error of its own, and what a callback or
`__del__` raises is dropped. So it is remembered, and raised again while the command goes on.
"""

from __future__ import annotations

import signal
from types import FrameType

__all__ = ["Interrupts"]

INSIST_S = 10.0
"""Seconds for cleaning up, after which the interrupt is taken for lost and raised again."""


class Interrupts:
    """Whether this process was asked to stop."""

    def __init__(self) -> None:
        """Nothing is heeded yet."""
        self.noticed = False

    def heed(self) -> None:
        """Treat SIGTERM like Ctrl-C from now on; a shell that had SIGINT ignored keeps its will."""
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._notice)
        signal.signal(signal.SIGTERM, self._notice)
        if hasattr(signal, "SIGALRM"):
            signal.signal(signal.SIGALRM, self._notice)

    def done(self) -> None:
        """The interrupt has arrived."""
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0)

    def _notice(self, number: int, frame: FrameType | None) -> None:
        self.noticed = True
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, INSIST_S)
        raise KeyboardInterrupt
