"""A process for each formula, as the query paper's authors had it; for worker processes only.

The process is forked from one in which dReal is loaded already: what a start of Python costs is not held against the
algorithm.
"""

from __future__ import annotations

import os
import pickle

from scenicq.limits import LIMITS
from scenicq.smt import dreal
from scenicq.smt.answer import Answer, NoAnswer
from scenicq.smt.problem import Problem

__all__ = ["by_dreal", "by_dreal_as_it_is"]


def _alone(problem: Problem, precision: float, timeout_s: float) -> Answer:
    """Decide a problem in a child of this process."""
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        os.close(reading)
        with os.fdopen(writing, "wb") as pipe:
            pickle.dump(dreal.check(problem, precision=precision, timeout_s=timeout_s), pipe)
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        told = pipe.read()
    os.waitpid(child, 0)
    return pickle.loads(told) if told else NoAnswer("crash")


def by_dreal(problem: Problem, *, precision: float, timeout_s: float) -> Answer:
    """DReal with the adapter's splitting of disjunctions."""
    return _alone(problem, precision, timeout_s)


def by_dreal_as_it_is(problem: Problem, *, precision: float, timeout_s: float) -> Answer:
    """DReal on a formula as it is."""
    LIMITS.dreal_conjunctions = 0
    return _alone(problem, precision, timeout_s)
