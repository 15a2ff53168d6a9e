"""Inverse functions written as relations: every solution remains one."""

from __future__ import annotations

import math
import re

from formulas import Var, Variable, evaluate
from hypothesis import assume, given
from hypothesis import strategies as st

from scenicq.forest.nodes import Arithmetic, ArithmeticOp
from scenicq.forest.walk import postorder
from scenicq.smt.answer import Sat
from scenicq.smt.inverse_elimination import without_inverses
from scenicq.smt.problem import Problem, holds
from scenicq.smt.smtlib import read_reply, to_smtlib
from scenicq.smt.terms import apply, compare, conjunction, disjunction

X, Y = Var("x"), Var("y")
ANGLE = apply(ArithmeticOp.ATAN2, Y, apply(ArithmeticOp.SUB, X, 1.0))
ARCS = apply(ArithmeticOp.ADD, apply(ArithmeticOp.ASIN, X), apply(ArithmeticOp.ACOS, Y))
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
    assert holds(related, values, slack=1e-9)
    assert all(variable.low <= values[variable.name] <= variable.high for variable in related.variables)


def test_no_inverse_is_left() -> None:
    nodes = postorder((without_inverses(PROBLEM).constraint,))
    inverses = (ArithmeticOp.ATAN2, ArithmeticOp.ASIN, ArithmeticOp.ACOS)
    assert not any(isinstance(node, Arithmetic) and node.op in inverses for node in nodes)


def test_others_stay_as_they_are() -> None:
    problem = Problem((Variable("x"),), compare("<=", apply(ArithmeticOp.ATAN, X), 1.0))
    assert without_inverses(problem) is problem


@given(st.floats(-5, 5), st.floats(-5, 5))
def test_no_command_is_sent_an_inverse_and_the_model_of_its_reply_holds(x: float, y: float) -> None:
    """Any solver behind a command line gets the relations; the values that it gives for what is new are passed over."""
    assume(evaluate(FORMULA, {"x": x, "y": y}))
    script = to_smtlib(PROBLEM, 1e-3)
    assert not re.search(r"atan2|asin|acos|arc", script)
    declared = re.findall(r"\(declare-fun (\S+) \(\) Real\)", script)
    assert len(declared) == 6
    assert declared[:2] == ["x", "y"]
    values = dict.fromkeys(declared, 0.0) | {"x": x, "y": y}
    numbers = {name: f"{value:.30f}" if value >= 0 else f"(- {-value:.30f})" for name, value in values.items()}
    model = " ".join(f"(define-fun {name} () Real {number})" for name, number in numbers.items())
    answer = read_reply(f"sat\n(model {model})\n", PROBLEM)
    assert isinstance(answer, Sat)
    assert answer.witness.keys() == {"x", "y"}
    assert holds(PROBLEM, answer.witness, 1e-3)
