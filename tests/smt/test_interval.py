"""Interval functions and contraction lose no value: forward, backward, on tapes, and for affine atoms."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenicq.smt.affine import EMPTY, ENTAILED, affine_atoms, contract_affine
from scenicq.smt.backward import BACKWARD, root
from scenicq.smt.evaluation import evaluate
from scenicq.smt.formula import Num, Op, Operator, Term, TermComparison, Var, apply, compare
from scenicq.smt.hc4 import Tape
from scenicq.smt.interval import FORWARD, EmptyError, Interval, power
from scenicq.smt.operators import operate

BINARY = {Operator.ADD, Operator.SUB, Operator.MUL, Operator.DIV, Operator.MIN, Operator.MAX, Operator.ATAN2}
SPECIAL = (0.0, 1.0, -1.0, math.pi, -math.pi, math.pi / 2, 2.0, -2.0)
VALUES = st.sampled_from(SPECIAL) | st.floats(-5, 5) | st.floats(-1e6, 1e6)
MARGINS = st.sampled_from((0.0, 1e-3, 0.5, 3.0, math.inf)) | st.floats(0, 10)


@st.composite
def boxes(draw: st.DrawFn, size: int) -> tuple[list[float], list[Interval]]:
    """A point and an interval around each of its coordinates."""
    point = [draw(VALUES) for _ in range(size)]
    return point, [(value - draw(MARGINS), value + draw(MARGINS)) for value in point]


def _inside(value: float, interval: Interval) -> bool:
    slack = 1e-12 * max(1.0, abs(value))
    return interval[0] - slack <= value <= interval[1] + slack


@pytest.mark.parametrize("operator", sorted(FORWARD))
@settings(max_examples=300)
@given(data=st.data())
@pytest.mark.one_in(4)
def test_functions_lose_nothing(operator: Operator, data: st.DataObject) -> None:
    point, box = data.draw(boxes(2 if operator in BINARY else 1))
    value = operate(operator, point)
    if not math.isfinite(value):
        return
    result = FORWARD[operator](*box)
    assert _inside(value, result)
    # the true value differs from the computed one by rounding
    rounding = 1e-14 * max(1.0, abs(value))
    below, above = data.draw(MARGINS) + rounding, data.draw(MARGINS) + rounding
    narrow = (max(result[0], value - below), min(result[1], value + above))
    found = BACKWARD[operator](narrow, *box)
    assert all(_inside(*pair) for pair in zip(point, found, strict=True))


@settings(max_examples=500)
@given(boxes(1), st.integers(-4, 5), MARGINS, MARGINS)
def test_powers_lose_nothing(
    example: tuple[list[float], list[Interval]], exponent: int, below: float, above: float
) -> None:
    (base,), (interval,) = example
    value = operate(Operator.POW, [base, float(exponent)])
    if not math.isfinite(value):
        return
    result = power(interval, exponent)
    assert _inside(value, result)
    rounding = 1e-14 * abs(value)
    assert _inside(base, root((value - below - rounding, value + above + rounding), interval, exponent))


def test_ranges_are_tight() -> None:
    assert FORWARD[Operator.SIN]((0.0, 1.0)) == pytest.approx((0.0, math.sin(1.0)))
    assert FORWARD[Operator.COS]((-1.0, 2.0)) == pytest.approx((math.cos(2.0), 1.0))
    assert FORWARD[Operator.ATAN2]((1.0, 2.0), (-1.0, 1.0)) == pytest.approx((math.pi / 4, 3 * math.pi / 4))
    assert FORWARD[Operator.ATAN2]((-1.0, 1.0), (-2.0, -1.0)) == pytest.approx((-math.pi, math.pi))
    assert power((-2.0, 1.0), 2) == pytest.approx((0.0, 4.0))
    assert FORWARD[Operator.DIV]((1.0, 2.0), (0.0, 4.0)) == pytest.approx((0.25, math.inf))
    assert BACKWARD[Operator.SIN]((0.5, 1.0), (0.0, 6.0))[0] == pytest.approx((math.pi / 6, 5 * math.pi / 6))
    assert BACKWARD[Operator.TAN]((1.0, 1.0), (0.0, 3.0))[0] == pytest.approx((math.pi / 4, math.pi / 4))


@pytest.mark.parametrize(
    "call",
    [
        lambda: FORWARD[Operator.SQRT]((-2.0, -1.0)),
        lambda: FORWARD[Operator.LOG]((-2.0, 0.0)),
        lambda: FORWARD[Operator.ASIN]((1.5, 2.0)),
        lambda: FORWARD[Operator.DIV]((1.0, 2.0), (0.0, 0.0)),
        lambda: FORWARD[Operator.ATAN2]((0.0, 0.0), (0.0, 0.0)),
        lambda: BACKWARD[Operator.ABS]((-2.0, -1.0), (-5.0, 5.0)),
        lambda: BACKWARD[Operator.COS]((1.5, 2.0), (-5.0, 5.0)),
    ],
)
def test_nothing_is_left(call: Callable[[], object]) -> None:
    with pytest.raises(EmptyError):
        call()


X, Y = Var("x"), Var("y")
INDEX = {"x": 0, "y": 1}
NUMBERS = st.floats(-100, 100).map(lambda value: round(value, 3))


@settings(max_examples=500)
@given(boxes(2), NUMBERS, NUMBERS, NUMBERS, st.sampled_from(("<=", "<", "==")), st.booleans())
def test_affine_atoms_lose_nothing(
    example: tuple[list[float], list[Interval]], a: float, b: float, shift: float, relation: str, touch: bool
) -> None:
    point, box = example
    values = dict(zip("xy", point, strict=True))
    term = apply(Operator.SUB, apply(Operator.MUL, a, apply(Operator.ADD, X, b)), apply(Operator.MUL, Y, b))
    bound = a * (point[0] + b) - b * point[1] + (0.0 if touch else shift)
    atom = compare(relation, term, bound)
    if not isinstance(atom, TermComparison):
        return
    found = affine_atoms(atom, INDEX, {})
    assert found is not None
    low, high = [list(ends) for ends in zip(*box, strict=True)]
    verdicts = [contract_affine(part, low, high) for part in found]
    if evaluate(atom, values):
        assert EMPTY not in verdicts
        assert all(_inside(value, ends) for value, ends in zip(point, zip(low, high, strict=True), strict=True))
    if set(verdicts) == {ENTAILED}:
        assert evaluate(atom, values, slack=1e-6)


def test_affine_contraction_is_tight() -> None:
    (atom,) = affine_atoms(_atom("<=", apply(Operator.ADD, X, apply(Operator.MUL, 2.0, Y)), 4.0), INDEX, {}) or ()
    low, high = [0.0, 0.0], [math.inf, math.inf]
    contract_affine(atom, low, high)
    assert high == pytest.approx([4.0, 2.0])
    assert contract_affine(atom, [0.0, 0.0], [1.0, 1.0]) == ENTAILED
    assert contract_affine(atom, [3.0, 1.0], [4.0, 2.0]) == EMPTY


def _atom(relation: str, left: Term, right: float) -> TermComparison:
    atom = compare(relation, left, right)
    assert isinstance(atom, TermComparison)
    return atom


def test_cancelled_coefficients_are_not_trusted() -> None:
    """0.1 x + 0.2 x - 0.3 x is not 0 x in floating point; nothing may follow from its sign."""
    parts = [apply(Operator.MUL, factor, X) for factor in (0.1, 0.2, -0.3)]
    found = affine_atoms(_atom("<=", apply(Operator.ADD, *parts), -1e-18), INDEX, {})
    assert found is not None
    low, high = [-1e3, 0.0], [1e3, 0.0]
    assert contract_affine(found[0], low, high) != EMPTY
    assert (low[0], high[0]) == (-1e3, 1e3)


def test_products_of_variables_are_not_affine() -> None:
    assert affine_atoms(_atom("<=", apply(Operator.MUL, X, Y), 1.0), INDEX, {}) is None
    assert affine_atoms(_atom("<=", apply(Operator.DIV, 1.0, Y), 1.0), INDEX, {}) is None


def test_tape_narrows_and_excludes() -> None:
    squares = apply(Operator.ADD, apply(Operator.POW, X, 2.0), apply(Operator.MUL, Y, Y))
    tape = Tape([_atom("<=", squares, 4.0)], INDEX)
    low, high = [-math.inf, 1.0], [math.inf, math.inf]
    assert tape.contract(low, high)
    assert (low, high) == ([pytest.approx(-math.sqrt(3.0)), 1.0], pytest.approx([math.sqrt(3.0), 2.0]))
    assert not tape.contract([3.0, 0.0], [4.0, 0.0])
    assert not Tape(
        [_atom("<", X, 0.0), TermComparison(compare("<", Num(1.0), Y).relation, Num(0.0), X)], INDEX
    ).contract([-1.0, 0.0], [1.0, 0.0])


def test_tape_of_undefined_constants() -> None:
    assert not Tape([TermComparison(_atom("<=", X, 0.0).relation, Op(Operator.SQRT, (Num(-1.0),)), X)], INDEX).contract(
        [0.0, 0.0], [1.0, 0.0]
    )
