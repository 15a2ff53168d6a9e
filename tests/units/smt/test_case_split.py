"""The second look: what a solver does not decide as a whole is asked cell by cell."""

from __future__ import annotations

import time

import pytest
from built_in import check
from formulas import Var, Variable

from scenicq.forest.nodes import Logic, LogicOp
from scenicq.forest.walk import postorder
from scenicq.smt.answer import Answer, NoAnswer, Sat, Unsat
from scenicq.smt.case_split import cases, check_by_cases
from scenicq.smt.problem import Formula, Problem
from scenicq.smt.terms import compare, conjunction, disjunction

X, Y = Var("x"), Var("y")
VARIABLES = (Variable("x", 0.0, 100.0), Variable("y", 0.0, 100.0))


def between(name: Var, low: float, high: float) -> Formula:
    return conjunction([compare("<=", low, name), compare("<=", name, high)])


def problem(*wanted: float) -> Problem:
    """Points in every tenth square, at given heights."""
    squares = disjunction(between(X, 10.0 * n, 10.0 * n + 1.0) for n in range(10))
    heights = disjunction(between(Y, height, height + 0.5) for height in wanted)
    return Problem(VARIABLES, conjunction([squares, heights, compare("==", X, Y)]))


class Lost:
    """A solver that is lost among more than a number of cases, and remembers what it was asked."""

    name = "lost"

    def __init__(self, most: int, reason: str = "timeout", nap_s: float = 0.0) -> None:
        self.most = most
        self.reason = reason
        self.nap_s = nap_s
        self.asked: list[float] = []

    def loads(self) -> bool:
        return True

    def check(self, problem: Problem, *, precision: float, timeout_s: float) -> Answer:
        self.asked.append(timeout_s)
        time.sleep(self.nap_s)
        ors = (n for n in postorder((problem.constraint,)) if isinstance(n, Logic) and n.op is LogicOp.OR)
        widest = max((len(node.args) for node in ors), default=0)
        if widest > self.most:
            return NoAnswer(self.reason)
        return check(problem, precision=precision, timeout_s=timeout_s)


def test_a_problem_is_the_union_of_its_cases() -> None:
    found = cases(problem(40.2, 71.0))
    assert len(found) == 10
    answers = [type(check(case, precision=1e-3, timeout_s=5.0)) for case in found]
    assert answers.count(Sat) == 2
    assert answers.count(Unsat) == 8
    assert cases(Problem(VARIABLES, compare("<=", X, Y))) == []


@pytest.mark.parametrize("reason", ["timeout", "budget"])
@pytest.mark.parametrize(("heights", "expected"), [((55.0, 40.2), Sat), ((55.0, 66.0), Unsat)])
def test_the_second_look_decides(reason: str, heights: tuple[float, ...], expected: type) -> None:
    solver = Lost(5, reason)
    assert isinstance(check_by_cases(solver, problem(*heights), precision=1e-3, timeout_s=5.0), expected)
    assert 2 <= len(solver.asked) <= 11
    assert all(share <= 5.0 for share in solver.asked)


def test_one_case_that_stays_open_leaves_the_whole_open() -> None:
    solver = Lost(0)
    assert check_by_cases(solver, problem(55.0, 66.0), precision=1e-3, timeout_s=5.0) == NoAnswer("timeout")
    assert len(solver.asked) == 11


def test_other_reasons_are_not_looked_at_again() -> None:
    solver = Lost(5, "crash")
    assert check_by_cases(solver, problem(55.0), precision=1e-3, timeout_s=5.0) == NoAnswer("crash")
    assert len(solver.asked) == 1


def test_the_second_look_takes_no_longer_than_the_first() -> None:
    solver = Lost(0, nap_s=0.1)
    assert check_by_cases(solver, problem(55.0), precision=1e-3, timeout_s=0.25) == NoAnswer("timeout")
    assert len(solver.asked) <= 5
