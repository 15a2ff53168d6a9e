"""Processor time of this process or of a command, and all that it starts: what a measurement costs, however busy the
machine is."""

from __future__ import annotations

import contextlib
import os
import resource
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

__all__ = ["Used", "cpu_s", "run"]


@dataclass(frozen=True, slots=True)
class Used:
    """What a command took.

    Attributes:
        wall_s, cpu_s: Seconds, the latter of all its processes.
        peak_mib: Memory of its largest process.
    """

    wall_s: float
    cpu_s: float
    peak_mib: float


def run(words: Sequence[str], output: int | IO[bytes] = subprocess.DEVNULL) -> Used:
    """Run a command to its end.

    Args:
        words: The command.
        output: Where its standard output goes.

    Raises:
        SystemExit: It failed.
    """
    started = time.perf_counter()
    process = subprocess.Popen(words, stdout=output)
    _, status, used = os.wait4(process.pid, 0)
    wall_s = time.perf_counter() - started
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{' '.join(words)}: exit code {process.returncode}")
    return Used(wall_s, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)


def cpu_s() -> float:
    """Seconds of processor time used so far: this process, its children that ended, and those that run.

    Where running children cannot be asked (no /proc), the time on the wall stands for all of it.
    """
    running = _children()
    if running is None:
        return time.perf_counter()
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + ended.ru_utime + ended.ru_stime + sum(map(_of_process, running))


def _children() -> list[int] | None:
    """Processes that this one started and that still run."""
    threads = Path("/proc/self/task")
    if not (threads / str(os.getpid()) / "children").exists():
        return None
    found: list[int] = []
    for thread in threads.iterdir():
        # a thread may end meanwhile
        with contextlib.suppress(OSError):
            found += map(int, (thread / "children").read_text().split())
    return found


def _of_process(pid: int) -> float:
    """Seconds that a process has used and that its children used that ended: its own clock on Linux, addressed as the
    kernel does, and what the kernel keeps of the children."""
    try:
        own = time.clock_gettime((~pid << 3) | 2)
        # the fields after the name, which may hold blanks
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        # it has just ended
        return 0.0
    return own + (int(fields[13]) + int(fields[14])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    print(f"{cpu_s():.3f} s in process {os.getpid()}")
