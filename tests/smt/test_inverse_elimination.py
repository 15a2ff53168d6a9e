"""Inverse functions written as relations: every solution remains one."""

from __future__ import annotations

import math

from hypothesis import assume, given
from hypothesis import strategies as st

from scenicq.smt.evaluation import evaluate
from scenicq.smt.formula import (
    Op,
    Operator,
    Problem,
    Var,
    Variable,
    apply,
    compare,
    conjunction,
    disjunction,
    postorder,
)
from scenicq.smt.inverse_elimination import without_inverses

X, Y = Var("x"), Var("y")
ANGLE = apply(Operator.ATAN2, Y, apply(Operator.SUB, X, 1.0))
ARCS = apply(Operator.ADD, apply(Operator.ASIN, X), apply(Operator.ACOS, Y))
FORMULA = disjunction(
    [
        conjunction([compare("<=", ANGLE, 1.0), compare(">=", ANGLE, -3.0)]),
        compare(">=", ARCS, 1.0),
        compare(">", X, 4.0),
    ]
)
PROBLEM = Problem((Variable("x", -5.0, 5.0), Variable("y", -5.0, 5.0)), FORMULA)


@given(st.floats(-5, 5), st.floats(-5, 5))
def test_solutions_stay(x: float, y: float) -> None:
    related = without_inverses(PROBLEM)
    assume(evaluate(FORMULA, {"x": x, "y": y}))
    values = {variable.name: 0.0 for variable in related.variables} | {"x": x, "y": y}
    angle, length, sine, cosine = [variable.name for variable in related.variables[2:]]
    values |= {angle: math.atan2(y, x - 1.0), length: math.hypot(y, x - 1.0)}
    values |= {sine: math.asin(max(-1.0, min(1.0, x))), cosine: math.acos(max(-1.0, min(1.0, y)))}
    assert evaluate(related.constraint, values, slack=1e-9)
    assert all(variable.low <= values[variable.name] <= variable.high for variable in related.variables)


def test_no_inverse_is_left() -> None:
    nodes = postorder(without_inverses(PROBLEM).constraint)
    assert not any(isinstance(node, Op) and node.op in (Operator.ATAN2, Operator.ASIN, Operator.ACOS) for node in nodes)


def test_others_stay_as_they_are() -> None:
    problem = Problem((Variable("x"),), compare("<=", apply(Operator.ATAN, X), 1.0))
    assert without_inverses(problem) is problem
