"""A process for each formula, as the query paper's authors had it; for worker processes only.

The process is forked from one in which the solver is loaded already: what a start of Python costs is not held against
the algorithm.
"""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable

from scenicq.smt import portable
from scenicq.smt.answer import Answer, NoAnswer
from scenicq.smt.formula import Problem

__all__ = ["alone", "by_portable"]


def alone(check: Callable[..., Answer], problem: Problem, precision: float, timeout_s: float) -> Answer:
    """Decide a problem in a child of this process."""
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        os.close(reading)
        with os.fdopen(writing, "wb") as pipe:
            pickle.dump(check(problem, precision=precision, timeout_s=timeout_s), pipe)
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        told = pipe.read()
    os.waitpid(child, 0)
    return pickle.loads(told) if told else NoAnswer("crash")


def by_portable(problem: Problem, *, precision: float, timeout_s: float) -> Answer:
    """The built-in solver."""
    return alone(portable.check, problem, precision, timeout_s)
