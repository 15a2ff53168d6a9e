"""A process for each formula, forked from one in which dReal is loaded; for worker processes only."""

from __future__ import annotations

from forked import alone

from scenicq.limits import LIMITS
from scenicq.smt import dreal
from scenicq.smt.answer import Answer
from scenicq.smt.formula import Problem

__all__ = ["by_dreal", "by_dreal_as_it_is"]


def by_dreal(problem: Problem, *, precision: float, timeout_s: float) -> Answer:
    """DReal with the adapter's splitting of disjunctions."""
    return alone(dreal.check, problem, precision, timeout_s)


def by_dreal_as_it_is(problem: Problem, *, precision: float, timeout_s: float) -> Answer:
    """DReal on a formula as it is."""
    LIMITS.dreal_conjunctions = 0
    return alone(dreal.check, problem, precision, timeout_s)
