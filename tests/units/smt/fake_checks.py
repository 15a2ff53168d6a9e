"""Checks that misbehave, for the tests of worker processes; each is run in a worker process."""

from __future__ import annotations

import ctypes
import os
import sys
import time

from scenicq.smt.answer import Answer, NoAnswer, Sat, Unsat
from scenicq.smt.problem import Problem

VERSION = "7.0"


def behave(problem: Problem, *, precision: float, timeout_s: float) -> Answer:
    """Do what the name of the first variable says."""
    name = problem.variables[0].name if problem.variables else ""
    match name:
        case "crash":
            ctypes.string_at(0)
        case "exit":
            os._exit(3)
        case "raise":
            raise RuntimeError("no")
        case "hang":
            time.sleep(3600)
        case "spin":
            while True:
                pass
        case "polite":
            time.sleep(timeout_s)
            return NoAnswer("timeout")
        case "eat":
            return NoAnswer(str(len(bytearray(2**40))))
        case "print":
            print("sat\n" * 10_000)
            os.write(1, b'{"sat": {"x": 1}}\n')
            print("noise", file=sys.stderr)
            return Unsat()
        case "lie":
            return Sat({"lie": 1e6})
        case "forget":
            return Sat({})
        case "odd":
            return Sat({"odd": float("nan")})
        case "pid":
            return Sat({"pid": float(os.getpid())})
        case "slow":
            time.sleep(0.3)
        case _:
            pass
    return Unsat()


def garble(problem: Problem, *, precision: float, timeout_s: float) -> Answer:
    """Write nonsense where the answer belongs."""
    for descriptor in range(3, 20):
        try:
            os.write(descriptor, b"\x00\xff not json\n")
        except OSError:
            continue
    time.sleep(0.2)
    return Unsat()
