"""A question asked before is answered at once, and as before."""

import pytest

from scenicq.smt.answer import NoAnswer, Sat, Unsat
from scenicq.smt.answer_cache import RememberingSolver
from scenicq.smt.formula import Problem, Var, Variable, compare
from scenicq.smt.solver import open_solver


class Teller:
    """A solver that counts and says what it is told to."""

    name = "teller"

    def __init__(self, *answers):
        self.answers = list(answers)

    def check(self, problem, *, precision, timeout_s):
        return self.answers.pop(0)


def question(limit):
    return Problem((Variable("x", 0.0, 1.0),), compare(">=", Var("x"), limit))


def ask(solver, problem, precision=1e-3):
    return solver.check(problem, precision=precision, timeout_s=5.0)


def test_a_question_is_passed_on_once():
    solver = RememberingSolver(Teller(Sat({"x": 0.5}), Unsat()))
    assert [ask(solver, question(0.25)) for _ in range(3)] == [Sat({"x": 0.5})] * 3
    assert ask(solver, question(2.0)) == Unsat()
    assert (solver.asked, solver.passed_on, solver.name) == (4, 2, "teller")


def test_another_precision_is_another_question():
    solver = RememberingSolver(Teller(Sat({"x": 0.5}), Unsat()))
    assert [ask(solver, question(0.25), precision) for precision in (1e-3, 1e-5)] == [Sat({"x": 0.5}), Unsat()]


def test_what_was_unknown_is_tried_again():
    solver = RememberingSolver(Teller(NoAnswer("crash"), Unsat()))
    assert [ask(solver, question(2.0)) for _ in range(3)] == [NoAnswer("crash"), Unsat(), Unsat()]


def test_the_oldest_answers_go(monkeypatch):
    monkeypatch.setattr("scenicq.smt.answer_cache.MOST", 2)
    solver = RememberingSolver(Teller(*[Unsat()] * 9))
    for limit in (2.0, 3.0, 2.0, 4.0, 2.0, 3.0):
        ask(solver, question(limit))
    assert (solver.asked, solver.passed_on) == (6, 4)


@pytest.mark.parametrize("limit", [0.25, 2.0])
def test_with_a_real_solver(limit):
    with open_solver("portable") as session:
        solver = RememberingSolver(session)
        first = ask(solver, question(limit))
        assert ask(solver, question(limit)) == first
        assert isinstance(first, Sat if limit < 1 else Unsat)
        assert solver.passed_on == 1
