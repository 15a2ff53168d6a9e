"""Checks that misbehave on every problem; each is run in a worker process."""

from __future__ import annotations

import os
import signal
import sys
import time

from scenicq.smt.answer import NoAnswer, Unsat


def hang(problem, *, precision, timeout_s):
    """Never answer."""
    time.sleep(3600)


def garble(problem, *, precision, timeout_s):
    """Write nonsense where the answer belongs."""
    for descriptor in range(3, 20):
        try:
            os.write(descriptor, b"\x00\xff not json\n")
        except OSError:
            continue
    return Unsat()


def eat(problem, *, precision, timeout_s):
    """Ask for more memory than there is."""
    return NoAnswer(str(len(bytearray(2**50))))


def die(problem, *, precision, timeout_s):
    """End the process."""
    sys.stdout.flush()
    os._exit(3)


def killed(problem, *, precision, timeout_s):
    """Be killed as by the system."""
    os.kill(os.getpid(), signal.SIGKILL)
