"""Ctrl-C, SIGTERM and SIGHUP: a command that is told to stop does stop.

A `KeyboardInterrupt` can get lost on its way. What `__del__` or a callback of a weak reference raises is dropped: this
happens to one interrupt in a hundred that come at random, as the locks of imports have such callbacks. Python tells of
what it drops, and the interrupt is raised again at once. DuckDB turns an interrupt into an error of its own, and what
other libraries do is theirs; so it is also remembered, and raised again while the command goes on as if nothing were.

While a module loads, an interrupt waits: an extension module whose loading was broken off may not be loaded again, as
where an error is handled that only it can name. DuckDB's ends the process then.
"""

from __future__ import annotations

import signal
import sys
import time
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

__all__ = ["Interrupts"]

INSIST_S = 10.0
"""Seconds for cleaning up, after which the interrupt is raised again."""
_LOOK_S = 0.5
"""Seconds between looks at whether anything is being cleaned up; else the interrupt is lost, and raised again."""
_AT_ONCE_S = 0.001
"""Seconds until one that is known to be lost is raised again, outside of what lost it."""
_LOADED_S = 0.01
"""Seconds between looks at whether a module has loaded."""


class Interrupts:
    """Notices that this process is to stop, and makes sure that it does.

    Attributes:
        noticed: Whether it was.
        advice: What the user is told then, besides that it has stopped.
    """

    def __init__(self) -> None:
        """Begin; signals are heeded from `heed` on."""
        self.noticed = False
        self.advice = ""
        self._until = 0.0

    def heed(self) -> None:
        """Treat SIGTERM and SIGHUP like Ctrl-C from now on; who had SIGINT or SIGHUP ignored keeps their will."""
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._notice)
        signal.signal(signal.SIGTERM, self._notice)
        if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:  # `nohup` ignores it
            signal.signal(signal.SIGHUP, self._notice)
        if hasattr(signal, "SIGALRM"):
            signal.signal(signal.SIGALRM, self._notice)
            sys.unraisablehook = self._dropped

    def done(self) -> None:
        """The interrupt has arrived: from now on nothing is raised again while the process ends."""
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, signal.SIG_IGN)

    def _dropped(self, told: UnraisableHookArgs) -> None:
        """Called where Python drops an exception that nobody can take: an interrupt is raised again."""
        if told.exc_type is KeyboardInterrupt:
            signal.setitimer(signal.ITIMER_REAL, _AT_ONCE_S)
        else:
            sys.__unraisablehook__(told)

    def _notice(self, number: int, frame: FrameType | None) -> None:
        now = time.monotonic()
        timed = hasattr(signal, "setitimer")
        again = self.noticed and timed and number == signal.SIGALRM
        in_time = now < self._until if again else timed
        loads = in_time and _loads_a_module(frame)
        # while anything is cleaned up, the interrupt or what has become of it is being handled
        wait = loads or (again and in_time and sys.exc_info()[0] is not None)
        if not (again and wait):
            self.noticed, self._until = True, now + INSIST_S
        if timed:
            look_s = _LOADED_S if loads else _LOOK_S
            signal.setitimer(signal.ITIMER_REAL, min(look_s, max(_AT_ONCE_S, self._until - now)))
        if not wait:
            raise KeyboardInterrupt


def _loads_a_module(frame: FrameType | None) -> bool:
    """Whether a module is loading where the signal has arrived."""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False
