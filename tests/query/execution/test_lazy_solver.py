"""A solver is opened by the first question, and asked none twice."""

from __future__ import annotations

import pytest

from scenicq.errors import SolverError
from scenicq.query.execution.lazy_solver import LazySolver
from scenicq.smt.answer import Sat
from scenicq.smt.formula import TRUE, Problem


def test_nothing_is_opened_before_the_first_question():
    with LazySolver("no-such-solver-anywhere") as solver, pytest.raises(SolverError):
        solver.check(Problem((), TRUE), precision=1e-4, timeout_s=1.0)
    with LazySolver("no-such-solver-anywhere") as solver:
        assert solver.calls == 0


def test_a_question_is_asked_once(monkeypatch):
    asked = []

    class Counting:
        name = "counting"

        def check(self, problem, *, precision, timeout_s):
            asked.append(problem)
            return Sat({})

        def close(self):
            asked.append("closed")

    monkeypatch.setattr("scenicq.smt.solver.open_solver", lambda name: Counting())
    with LazySolver("any") as solver:
        for _ in range(3):
            solver.check(Problem((), TRUE), precision=1e-4, timeout_s=1.0)
        assert solver.calls == 3
    assert len(asked) == 2
    assert asked[-1] == "closed"
