"""Cases are narrowed to where values can be: never less, and no more than needed where a variable occurs once."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings

sys.path.insert(0, str(Path(__file__).parents[2] / "forest"))
from expressions import expressions

from scenicq.forest import build
from scenicq.forest.evaluate import evaluate
from scenicq.forest.groups import Comparison, Condition
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Compare,
    CompareOp,
    Constant,
    Coordinate,
    Index,
    Logic,
    LogicOp,
    Norm,
    PointIn,
    Range,
    Rotate,
    Scale,
    Select,
    Undefined,
    VectorOf,
    VectorSum,
)
from scenicq.forest.scenario import Requirement
from scenicq.geometry.regions import Rectangle
from scenicq.match.fields.constraint_network import ConstraintNetwork
from scenicq.match.fields.contractor import BoxSet
from scenicq.match.tolerance import Tolerance

CLOSE = Tolerance(position=0.01, heading=0.01, other=0.01)
A = Range(build.constant(-9.0), build.constant(9.0))
B = Range(build.constant(2.0), build.constant(2.5))
P = PointIn(Constant(Rectangle((0.0, 0.0), 0.0, 20.0, 20.0)))
THREE = build.constant(3.0)


def number(value):
    return build.constant(float(value))


def op(which, *args):
    return Arithmetic(ArithmeticOp(which), args)


def narrowed(node, seen, name="size"):
    items = [(Comparison(0, name, node, None), node, seen)]
    return BoxSet.start(ConstraintNetwork(items, CLOSE), {}).narrowed()


@given(expressions())
@settings(max_examples=150, deadline=None, derandomize=True)
def test_what_leads_to_the_label_is_kept(case):
    root, values = case
    value = evaluate(root, values)
    assume(not isinstance(value, Undefined))
    assume(all(abs(part) < 1e6 for part in value))
    for node, seen, name in ((root, value, "position"), (Coordinate(root, 0), value[0], "size")):
        left = narrowed(node, seen, name)
        assert left.size
        for identity, limits in left.ranges.items():
            own = np.array(values[identity], dtype=float).reshape(limits.shape[:-2])
            slack = 1e-5 * np.maximum(1.0, np.abs(own))
            assert (limits[..., 0, :] - slack[..., None] <= own[..., None]).all()
            assert (own[..., None] <= limits[..., 1, :] + slack[..., None]).all()


@pytest.mark.parametrize("aside", [0.0, -0.0, 1e-300, -1e-300, 1.8e-56, -1.8e-56, 1e-17, -1e-17, 1e-12, -1e-12])
def test_a_heading_straight_behind_may_be_at_either_end(aside):
    """As a plain number it is half a turn one way or the other, whichever rounding makes of it."""
    behind, factor = Constant((aside, -2.0)), Range(number(-2), number(2))
    root = VectorSum(Scale(behind, factor), VectorOf(number(0), Bearing(behind)))
    left = narrowed(root, evaluate(root, {factor.identity: -2.0}), "position")
    assert left.size
    assert (left.ranges[factor.identity][..., 0, :] <= -2.0 + 1e-5).all()


INVERTED = {
    "itself": (A, 4.0, (4.0, 4.0)),
    "sum": (op("+", A, number(1), B), 7.0, (3.5, 4.0)),
    "difference": (op("-", A, B), 1.0, (3.0, 3.5)),
    "subtracted": (op("-", B, A), 1.0, (1.0, 1.5)),
    "negative": (op("neg", A), 4.0, (-4.0, -4.0)),
    "negative sum": (op("+", op("neg", A), B), 1.0, (1.0, 1.5)),
    "product": (op("*", A, B), 5.0, (2.0, 2.5)),
    "product, other side": (op("*", B, A), 5.0, (2.0, 2.5)),
    "quotient": (op("/", A, B), 2.0, (4.0, 5.02)),
    "magnitude": (op("abs", op("+", A, number(10))), 4.0, (-6.0, -6.0)),
    "x": (Coordinate(VectorOf(A, B), 0), 4.0, (4.0, 4.0)),
    "y": (Coordinate(VectorOf(B, A), 1), 4.0, (4.0, 4.0)),
    "of a sum": (Coordinate(VectorSum(VectorOf(A, B), Constant((1.0, 5.0))), 0), 4.0, (3.0, 3.0)),
    "turned": (Coordinate(Rotate(VectorOf(B, A), number(math.pi / 2)), 0), 4.0, (-4.0, -4.0)),
    "scaled": (Coordinate(Scale(VectorOf(A, B), number(-2)), 0), 4.0, (-2.0, -2.0)),
    "a factor": (Coordinate(Scale(Constant((2.0, 1.0)), A), 0), 4.0, (2.0, 2.0)),
    "twice, each by itself": (op("+", A, A), 8.0, (-1.0, 9.0)),
    "twice, less once": (op("-", op("*", A, number(3)), A), 8.0, (4.0, 4.0)),
    "negative and scaled": (op("-", B, op("*", op("neg", A), number(2))), 10.0, (3.75, 4.0)),
    "many times in a vector": (
        Coordinate(VectorSum(Scale(VectorOf(A, B), THREE), Rotate(VectorOf(A, A), number(math.pi / 2))), 0), 8.0,
        (4.0, 4.0),
    ),
    "smaller": (op("min", A, number(5)), 4.0, (4.0, 4.0)),
    "smaller of two": (op("min", op("+", A, number(8)), B), 1.5, (-6.5, -6.5)),
    "greater": (op("max", A, number(2)), 4.0, (4.0, 4.0)),
    "square": (op("**", op("+", A, number(9)), number(2)), 16.0, (-5.0, -5.0)),
    "cube": (op("**", A, number(3)), -27.0, (-3.0, -3.0)),
    "inverse": (op("**", op("+", A, number(9.5)), number(-1)), 0.25, (-5.65, -5.33)),
    "root": (op("sqrt", A), 2.0, (3.96, 4.04)),
    "sine": (op("sin", op("*", A, number(0.1))), 0.5, (5.12, 5.35)),
    "cosine": (op("cos", op("*", op("+", A, number(9)), number(0.1))), 0.5, (1.36, 1.59)),
    "tangent": (op("tan", op("*", A, number(0.1))), 1.0, (7.8, 7.9)),
    "arc sine": (op("asin", op("*", A, number(0.1))), 0.5, (4.71, 4.88)),
    "arc cosine": (op("acos", op("*", A, number(0.1))), 1.0, (5.32, 5.49)),
    "arc tangent": (op("atan", A), 1.0, (1.53, 1.59)),
    "direction": (op("atan2", A, B), 1.0, (3.06, 4.0)),
    "growth": (op("exp", A), 5.0, (1.6, 1.62)),
    "logarithm": (op("log", A), 1.0, (2.69, 2.75)),
    "whole": (op("floor", A), 4.0, (4.0, 5.0)),
    "whole above": (op("ceil", A), 4.0, (3.0, 4.0)),
    "divided by": (op("/", number(8), op("+", A, number(10))), 2.0, (-6.02, -5.98)),
    "heading": (Bearing(VectorOf(A, B)), -1.0, (3.06, 4.0)),
    "heading ahead": (Bearing(VectorOf(B, A)), -1.0, (1.25, 1.64)),
    "heading behind": (Bearing(VectorOf(B, A)), -2.0, (-1.18, -0.89)),
    "length": (Norm(VectorOf(A, number(0))), 4.0, (-4.0, 4.0)),
    "either": (Select(Index((1.0, 1.0)), (A, op("+", A, number(1)))), 4.0, (-9.0, 9.0)),
}  # fmt: skip


@pytest.mark.parametrize("name", INVERTED)
def test_a_number_that_is_observed_leaves_what_leads_to_it(name):
    node, seen, (low, high) = INVERTED[name]
    left = narrowed(node, seen)
    assert left.size == 1
    assert left.ranges[A.identity][:, 0].tolist() == pytest.approx([low, high], abs=0.025)


NEVER = {
    "too large": (op("+", A, B), 12.0), "too small": (op("-", B, A), -8.0), "no magnitude": (op("abs", A), -1.0),
    "no length": (Norm(VectorOf(A, number(5))), 4.0), "no product": (op("*", B, B), 9.0),
    "no x": (Coordinate(VectorSum(P, Constant((5.0, 0.0))), 0), -6.0),
    "no quotient": (op("/", B, op("abs", op("+", A, number(10)))), 3.0),
    "neither": (Select(Index((1.0, 1.0)), (B, op("+", B, number(2)))), 3.0),
}  # fmt: skip


@pytest.mark.parametrize("name", NEVER)
def test_a_number_that_nothing_leads_to_leaves_no_case(name):
    node, seen = NEVER[name]
    assert not narrowed(node, seen).size or name == "neither"


@pytest.mark.parametrize(
    ("node", "seen", "x", "y"),
    [
        (P, (3.0, 4.0), 3.0, 4.0),
        (VectorSum(P, Constant((1.0, -2.0))), (3.0, 4.0), 2.0, 6.0),
        (Rotate(P, number(math.pi / 2)), (3.0, 4.0), 4.0, -3.0),
        (Scale(P, number(-0.5)), (3.0, 4.0), -6.0, -8.0),
        (VectorOf(Coordinate(P, 1), Coordinate(P, 0)), (3.0, 4.0), 4.0, 3.0),
    ],
)
def test_a_place_that_is_observed_leaves_the_point_that_leads_to_it(node, seen, x, y):
    left = narrowed(node, seen, "position")
    assert left.ranges[P.identity][..., 0].ravel().tolist() == pytest.approx([x, x, y, y], abs=0.05)


def test_a_length_keeps_a_point_near():
    left = narrowed(Norm(P), 4.0)
    assert left.ranges[P.identity][..., 0].tolist() == [pytest.approx([-4.0, 4.0], abs=0.02)] * 2


@pytest.mark.parametrize("turns", [-1, 0, 1])
def test_a_heading_is_observed_up_to_whole_turns(turns):
    turn = Range(number(1), number(4))
    left = narrowed(op("+", turn, number(2)), 5.0 + turns * math.tau, "heading")
    assert left.ranges[turn.identity][:, 0].tolist() == pytest.approx([3.0, 3.0], abs=0.02)
    left = narrowed(op("wrap", op("+", turn, number(2))), 5.0 - math.tau, "heading")
    assert left.ranges[turn.identity][:, 0].tolist() == pytest.approx([3.0, 3.0], abs=0.02)
    left = narrowed(Bearing(VectorOf(number(-1), A)), math.pi / 4)
    assert left.ranges[A.identity][0, 0] <= 1.0 <= left.ranges[A.identity][1, 0]


@pytest.mark.parametrize(
    ("which", "low", "high"), [("<", -9.0, 2.5), ("<=", -9.0, 2.5), (">", 2.0, 9.0), (">=", 2.0, 9.0), ("==", 2.0, 2.5),
     ("!=", -9.0, 9.0)],
)  # fmt: skip
def test_what_is_required_of_a_number_is_left_of_it(which, low, high):
    for condition in (Compare(CompareOp(which), A, B), Logic(LogicOp.AND, (Compare(CompareOp(which), A, B),))):
        items = [(Condition(Requirement(condition, None), condition), condition, None)]
        left = BoxSet.start(ConstraintNetwork(items, CLOSE), {}).narrowed()
        assert left.ranges[A.identity][:, 0].tolist() == pytest.approx([low, high], abs=1e-5)


@pytest.mark.parametrize(("low", "high"), [(-1.0, 1.0), (0.0, 0.0), (-1.0, 0.0), (0.0, 1.0)])
def test_a_bearing_behind_may_be_on_either_side(low, high):
    behind = Bearing(VectorOf(Range(number(low), number(high)), number(-5)))
    for which, holds in (("<", high > 0), (">", low <= 0)):
        condition = Compare(CompareOp(which), behind, number(0))
        items = [(Condition(Requirement(condition, None), condition), condition, None)]
        left = BoxSet.start(ConstraintNetwork(items, CLOSE), {}).narrowed()
        assert left.size or not holds


@pytest.mark.parametrize(
    "partial",
    [op("sqrt", A), op("log", A), op("asin", op("-", A, number(2))), op("/", B, op("max", A, number(0))),
     op("**", A, number(0.5))],
)  # fmt: skip
def test_what_has_no_value_in_an_option_that_is_not_chosen_bounds_nothing(partial):
    either = Select(Index((1.0, 1.0)), (partial, number(7)))
    for node in (either, op("+", either, op("*", A, number(0)))):
        condition = Logic(LogicOp.AND, (Compare(CompareOp.GE, node, number(-99)), Compare(CompareOp.LE, A, number(-4))))
        items = [(Condition(Requirement(condition, None), condition), condition, None)]
        left = BoxSet.start(ConstraintNetwork(items, CLOSE), {}).narrowed()
        assert left.size
        assert left.ranges[A.identity][0, 0] == -9.0


@pytest.mark.parametrize(("low", "high", "end"), [(-2, 5, -2.0), (5, -2, -2.0)])
def test_a_range_between_random_ends_narrows_with_them(low, high, end):
    first = Range(number(low), number(low))
    inner = Range(op("+", first, number(0.5)), number(high))
    left = narrowed(inner, -1.0 if low > high else 4.0)
    assert left.size
    assert not narrowed(inner, end - 0.1 if low > high else -1.7).size


def test_a_choice_that_is_made_leaves_its_option():
    index = Index((1.0, 1.0))
    for name, options, seen in (
        ("size", (B, op("+", B, number(2))), 4.2),
        ("position", (VectorOf(B, A), VectorOf(op("+", B, number(2)), A)), (4.2, 1.0)),
    ):
        node = Select(index, options)
        network = ConstraintNetwork([(Comparison(0, name, node, None), node, seen)], CLOSE)
        cases = BoxSet.start(network, {B.identity: [(2.0, 2.5)] * 3})
        cases.chosen[id(index)] = np.array([0.0, 1.0, 0.0])
        assert cases.narrowed().chosen[id(index)].tolist() == [1.0]


def test_cases_start_from_intervals_and_near_values():
    network = ConstraintNetwork([(Comparison(0, "size", op("+", A, B), None), op("+", A, B), 6.0)], CLOSE)
    cases = BoxSet.start(network, {A.identity: [(0.0, 1.0), (3.0, 3.8), (3.5, 9.0)]}).narrowed()
    assert cases.ranges[A.identity].T.tolist() == [
        pytest.approx([3.5, 3.8], abs=0.02),
        pytest.approx([3.5, 4.0], abs=0.02),
    ]
    near = BoxSet.around(network, {A.identity: 3.0}, 0.25)
    assert near.ranges[A.identity][:, 0].tolist() == [2.75, 3.25]
    assert near.ranges[B.identity][:, 0].tolist() == [2.0, 2.5]
    assert near.those(np.array([False])).size == 0
