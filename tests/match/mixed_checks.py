"""A solver for worker processes that misbehaves on some problems and decides the others, always the same ones."""

from __future__ import annotations

import os
import signal
import time
import zlib

from scenicq.smt import portable
from scenicq.smt.answer import Unknown, Unsat
from scenicq.smt.formula import flatten


def mood(problem):
    """What happens to a problem: its text decides."""
    return zlib.crc32(repr(flatten(problem.constraint)).encode()) % 7


def check(problem, *, precision, timeout_s):
    """Be killed, hang, write garbage, ask for more memory than there is, or decide."""
    match mood(problem):
        case 0:
            os.kill(os.getpid(), signal.SIGKILL)
        case 1:
            time.sleep(3600)
        case 2:
            for descriptor in range(3, 20):
                try:
                    os.write(descriptor, b"\x00\xff not json\n")
                except OSError:
                    continue
            return Unsat()
        case 3:
            return Unknown(str(len(bytearray(2**45))))
        case _:
            return portable.check(problem, precision=precision, timeout_s=timeout_s)
