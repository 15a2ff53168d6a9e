"""The built-in solver on formulas: it never loses a solution, and it decides what it should quickly."""

from __future__ import annotations

import math

import pytest
from built_in import check
from formulas import Var, Variable, evaluate, value
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from scenicq.forest.nodes import Arithmetic, ArithmeticOp
from scenicq.smt.answer import NoAnswer, Sat, Unsat
from scenicq.smt.problem import Formula, Problem, Term, holds
from scenicq.smt.terms import apply, compare, conjunction, disjunction, number

Fn = ArithmeticOp
X, Y = Var("x"), Var("y")
COORDINATES = st.sampled_from((0.0, 1.0, -1.0)) | st.floats(-4, 4)
BINARY = (Fn.ADD, Fn.SUB, Fn.MUL, Fn.DIV, Fn.MIN, Fn.MAX, Fn.ATAN2)
UNARY = (Fn.NEG, Fn.ABS, Fn.SQRT, Fn.SIN, Fn.COS, Fn.TAN, Fn.ASIN, Fn.ACOS, Fn.ATAN, Fn.EXP, Fn.LOG)


@st.composite
def terms(draw: st.DrawFn) -> Term:
    """Terms of a few operators, of every kind."""
    known: list[Term] = [X, Y, number(draw(st.sampled_from((0.0, 1.0, 0.5, -3.0, math.pi)) | st.floats(-3, 3)))]
    for _ in range(draw(st.integers(1, 6))):
        one, two = draw(st.sampled_from(known)), draw(st.sampled_from(known))
        kind = draw(st.sampled_from(("unary", "binary", "power")))
        if kind == "power":
            known.append(Arithmetic(Fn.POW, (one, number(float(draw(st.integers(-2, 4)))))))
        elif kind == "binary":
            known.append(Arithmetic(draw(st.sampled_from(BINARY)), (one, two)))
        else:
            known.append(Arithmetic(draw(st.sampled_from(UNARY)), (one,)))
    return known[-1]


@st.composite
def satisfied(draw: st.DrawFn) -> tuple[Formula, dict[str, float]]:
    """A formula and a point that satisfies it, most often just so."""
    point = {"x": draw(COORDINATES), "y": draw(COORDINATES)}
    parts: list[Formula] = []
    for _ in range(draw(st.integers(1, 3))):
        term = draw(terms())
        there = value(term, point)
        assume(math.isfinite(there) and abs(there) < 1e6)
        slack = 1e-9 * max(1.0, abs(there))
        upper, lower = compare("<=", term, there + slack), compare(">=", term, there - slack)
        other = compare("<=", draw(terms()), draw(st.floats(-3, 3)))
        both = conjunction([upper, lower])
        parts.append(
            draw(st.sampled_from((upper, lower, both, disjunction([other, both]), disjunction([lower, other]))))
        )
    formula = conjunction(parts)
    assume(evaluate(formula, point))
    return formula, point


MARGINS = st.sampled_from((0.0, 1e-3, 1.0, 5.0, math.inf))


@settings(max_examples=400, deadline=None)
@given(satisfied(), MARGINS, MARGINS)
def test_no_solution_is_lost(example: tuple[Formula, dict[str, float]], below: float, above: float) -> None:
    formula, point = example
    variables = tuple(Variable(name, value - below, value + above) for name, value in point.items())
    problem = Problem(variables, formula)
    answer = check(problem, precision=1e-3, timeout_s=0.2)
    assert not isinstance(answer, Unsat)
    if isinstance(answer, Sat):
        assert holds(problem, answer.witness, 1e-3)


def test_exact_witnesses_are_preferred() -> None:
    disc = compare("<=", apply(Fn.ADD, apply(Fn.POW, X, 2.0), apply(Fn.POW, Y, 2.0)), 1.0)
    problem = Problem((Variable("x", -5, 5), Variable("y", -5, 5)), conjunction([disc, compare(">=", X, 0.999)]))
    answer = check(problem, precision=0.1, timeout_s=5.0)
    assert isinstance(answer, Sat)
    assert holds(problem, answer.witness)


def test_a_proof_beats_a_near_witness() -> None:
    problem = Problem((Variable("x", -5, 5),), conjunction([compare("<=", X, 1.0), compare(">=", X, 1.05)]))
    assert check(problem, precision=0.5, timeout_s=5.0) == Unsat()


def test_the_same_problem_has_the_same_answer() -> None:
    problem = Problem((Variable("x"), Variable("y")), compare("==", apply(Fn.SIN, apply(Fn.MUL, X, Y)), 0.3))
    answers = [check(problem, precision=1e-6, timeout_s=5.0) for _ in range(3)]
    assert isinstance(answers[0], Sat)
    assert answers[1:] == answers[:1] * 2


@pytest.mark.slow
def test_deep_terms() -> None:
    term: Term = X
    for _ in range(5000):
        term = apply(Fn.SIN, apply(Fn.ADD, term, 0.1))
    there = value(term, {"x": 0.5})
    problem = Problem((Variable("x", 0.0, 1.0),), compare("<=", term, there + 1e-3))
    assert isinstance(check(problem, precision=1e-3, timeout_s=20.0), Sat)


def test_nested_choices() -> None:
    formula: Formula = compare("<=", X, 0.0)
    for level in range(1000):
        formula = conjunction([disjunction([formula, compare("<=", Y, -float(level))]), compare("<=", Y, float(level))])
    problem = Problem((Variable("x", -1, 1), Variable("y", -1, 1)), formula)
    answer = check(problem, precision=1e-3, timeout_s=5.0)
    assert isinstance(answer, Sat)
    assert holds(problem, answer.witness, 1e-3)


def test_the_budget_is_said_so() -> None:
    """Two curves that touch in infinitely many points of less than the precision's width, none of them a double."""
    parts = [
        compare("<", apply(Fn.SIN, apply(Fn.MUL, X, Y)), apply(Fn.SIN, apply(Fn.MUL, Y, X, 1.0))),
        compare(">=", X, 1.0),
    ]
    problem = Problem((Variable("x", 0, 9), Variable("y", 0, 9)), conjunction(parts))
    answer = check(problem, precision=0.0, timeout_s=1.0)
    assert answer in (Unsat(), NoAnswer("timeout"), NoAnswer("budget"))


def test_many_choices_are_quick() -> None:
    """20 choices of 20 intervals: contraction leaves one alternative of each."""
    parts = [
        disjunction(
            [
                conjunction([compare(">=", Var(f"v{n}"), 3.0 * k), compare("<=", Var(f"v{n}"), 3.0 * k + 1)])
                for k in range(20)
            ]
        )
        for n in range(20)
    ]
    links = [compare("==", Var(f"v{n + 1}"), apply(Fn.ADD, Var(f"v{n}"), 1.5)) for n in range(0, 19, 2)]
    variables = tuple(Variable(f"v{n}", 0.0, 100.0) for n in range(20))
    assert check(Problem(variables, conjunction([*parts, *links])), precision=1e-3, timeout_s=20.0) == Unsat()


@pytest.mark.parametrize("limit", [1e-3, 1e-6])
def test_narrow_solutions_are_found(limit: float) -> None:
    """Where two thin rings cross."""

    def ring(x: float, radius: float) -> Formula:
        across = apply(Fn.ADD, apply(Fn.POW, apply(Fn.SUB, X, x), 2.0), apply(Fn.POW, Y, 2.0))
        return conjunction([compare(">=", across, radius**2), compare("<=", across, radius**2 + limit)])

    problem = Problem((Variable("x", -50, 50), Variable("y", -50, 50)), conjunction([ring(0.0, 5.0), ring(6.0, 5.0)]))
    answer = check(problem, precision=limit, timeout_s=20.0)
    assert isinstance(answer, Sat)
    assert answer.witness["x"] == pytest.approx(3.0, abs=1e-2)
