"""A solver for worker processes that misbehaves on some problems and decides the others, always the same ones."""

from __future__ import annotations

import os
import signal
import zlib

import bad_checks
import built_in

from scenicq.smt.smtlib import to_smtlib


def mood(problem):
    """What happens to a problem: its text decides."""
    return zlib.crc32(to_smtlib(problem, 1e-3).encode()) % 7


def check(problem, *, precision, timeout_s):
    """Be killed, hang, write garbage, ask for more memory than there is, or decide."""
    match mood(problem):
        case 0:
            os.kill(os.getpid(), signal.SIGKILL)
        case 1:
            return bad_checks.hang(problem, precision=precision, timeout_s=timeout_s)
        case 2:
            return bad_checks.garble(problem, precision=precision, timeout_s=timeout_s)
        case 3:
            return bad_checks.eat(problem, precision=precision, timeout_s=timeout_s)
        case _:
            return built_in.check(problem, precision=precision, timeout_s=timeout_s)
