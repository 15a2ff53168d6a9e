"""A round of attacks: how long it goes on, what it has come to so far, and what its runs have cost."""

import os
import resource
import signal
import threading
import time
from collections.abc import Callable

TOLD_EVERY_S = 600.0


class Round:
    """Goes on until its time is over or the process is asked to end, and prints figures now and then.

    Args:
        minutes: For how long.
        figures: What the round has come to so far, in a line or more.
    """

    def __init__(self, minutes: float, figures: Callable[[], str]) -> None:
        self._began = self._told = time.monotonic()
        self._until = self._began + 60 * minutes
        self._figures = figures
        self._asked = False
        self.longest_s = 0.0
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGTERM, signal.SIGINT):
                signal.signal(number, self._end)

    def _end(self, *_: object) -> None:
        self._asked = True

    def goes_on(self, more: bool = True) -> bool:
        """Whether there is another run; prints the figures every ten minutes and after the last run.

        Args:
            more: Whether there is anything left to do.
        """
        now = time.monotonic()
        over = not more or self._asked or now >= self._until
        if over or now >= self._told + TOLD_EVERY_S:
            self._told = now
            most = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
            print(f"after {(now - self._began) / 60:.1f} min: {self._figures()}", flush=True)
            print(f"at most {most // 1024} MiB, longest run {self.longest_s:.1f} CPU s", flush=True)
        return not over

    def took(self, cpu_seconds: float) -> None:
        """Note what a run has cost."""
        self.longest_s = max(self.longest_s, cpu_seconds)


def cpu_seconds() -> float:
    """The processor time of this process and of all that it has waited for."""
    used = (resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN))
    return sum(each.ru_utime + each.ru_stime for each in used)


def attend(child: int, patience_s: float) -> tuple[int, resource.struct_rusage, bool]:
    """Wait for a process, and kill it if it takes too long: its status, what it has used, and whether it was killed."""
    deadline = time.monotonic() + patience_s
    while True:
        done, status, usage = os.wait4(child, os.WNOHANG)
        if done:
            return status, usage, False
        if time.monotonic() > deadline:
            os.kill(child, signal.SIGKILL)
            _, status, usage = os.wait4(child, 0)
            return status, usage, True
        time.sleep(0.005)
