"""A solver is opened by the first question, once, and closed if it was."""

from __future__ import annotations

import pytest

from scenicq.errors import SolverError
from scenicq.query.execution.lazy_solver import LazySolver
from scenicq.smt.answer import Sat
from scenicq.smt.problem import Problem
from scenicq.smt.terms import TRUE


def test_nothing_is_opened_before_the_first_question():
    with LazySolver("no-such-solver-anywhere") as solver, pytest.raises(SolverError):
        solver.loads()
    with LazySolver("no-such-solver-anywhere"):
        pass


def test_the_built_in_solver_is_nobody_to_ask():
    with LazySolver("portable") as solver:
        assert not solver.loads()


def test_a_solver_is_opened_once(monkeypatch):
    asked = []

    class Counting:
        def check(self, problem, *, precision, timeout_s):
            asked.append("asked")
            return Sat({})

        def close(self):
            asked.append("closed")

    def opened(name):
        asked.append(f"opened {name}")
        return Counting()

    monkeypatch.setattr("scenicq.smt.solver.open_solver", opened)
    with LazySolver("any") as solver:
        for _ in range(2):
            assert solver.loads()
            solver.check(Problem((), TRUE), precision=1e-4, timeout_s=1.0)
    assert asked == ["opened any", "asked", "asked", "closed"]
