"""The domain of intervals over columns agrees with plain evaluation, row by row."""

from __future__ import annotations

import itertools
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parent))
from expressions import expressions

from scenicq.forest import build
from scenicq.forest.evaluate import evaluate
from scenicq.forest.interpret import interpret, steps_of
from scenicq.forest.interval_ends import ARRAYS, FLOATS
from scenicq.forest.interval_values import Interval, IntervalVector, Truth
from scenicq.forest.intervals import IntervalDomain
from scenicq.forest.nodes import (
    Compare,
    CompareOp,
    Coordinate,
    Distance,
    Feature,
    Intersects,
    Logic,
    LogicOp,
    PointIn,
    Range,
    Undefined,
)
from scenicq.forest.walk import transform
from scenicq.geometry.regions import Disc

ROWS = 5


def observing(root):
    """The expression with features in place of its random numbers and points, and their kinds."""
    kinds = {}

    def step(node):
        if isinstance(node, Range | PointIn):
            kind = "vector" if isinstance(node, PointIn) else "scalar"
            kinds.setdefault(node.identity, (len(kinds), kind))
            return Feature(kinds[node.identity][0], "seen", kind)
        return node

    return transform(root, step), list(kinds.values())


def bounds_of(value, kind):
    if kind == "vector":
        return IntervalVector(*(Interval(part, part, True) for part in value))
    return Interval(value, value, True)


@given(expressions(), st.integers(0, 1000))
@settings(max_examples=200, deadline=None, derandomize=True)
def test_columns_hold_the_value_of_each_row(case, seed):
    root, kinds = observing(case[0])
    rng = np.random.default_rng(seed)
    columns = {n: rng.uniform(-9, 9, (2, ROWS)) if kind == "vector" else rng.uniform(-9, 9, ROWS) for n, kind in kinds}
    domain = IntervalDomain(ARRAYS, lambda node: bounds_of(columns[node.object], node.kind))
    with np.errstate(all="ignore"):
        found = interpret(steps_of(root), domain)[id(root)]
    assert isinstance(found, IntervalVector)
    for row in range(ROWS):
        seen = {(n, "seen"): tuple(v[:, row].tolist()) if v.ndim > 1 else float(v[row]) for n, v in columns.items()}
        value = evaluate(root, case[1], seen)
        if isinstance(value, Undefined):
            continue
        for number, bounds in zip(value, found, strict=True):
            low, high = (float(np.broadcast_to(end, ROWS)[row]) for end in bounds[:2])
            slack = 1e-9 * max(1.0, abs(number))
            assert low - slack <= number <= high + slack
            assert not bounds.exact or high - low <= slack


def test_a_condition_over_columns_holds_fails_or_is_unknown_row_by_row():
    speed, limit = Feature(0, "speed", "scalar"), Feature(1, "limit", "scalar")
    fast = Compare(CompareOp.GT, speed, limit)
    far = Compare(CompareOp.GE, Coordinate(Feature(0, "position", "vector"), 0), build.constant(5.0))
    root = Logic(LogicOp.AND, (fast, Logic(LogicOp.NOT, (far,))))
    x = np.array([0.0, 9.0, 0.0, 0.0])
    columns = {
        (0, "speed"): Interval(np.array([3.0, 3.0, 1.0, 1.0]), np.array([3.0, 3.0, 1.0, 9.0])),
        (0, "position"): IntervalVector(Interval(x, x, True), Interval(0 * x, 0 * x, True)),
    }
    domain = IntervalDomain(ARRAYS, lambda node: columns.get((node.object, node.property), Interval(2.0, 2.0, True)))
    truth = interpret(steps_of(root), domain)[id(root)]
    assert isinstance(truth, Truth)
    assert truth.can_hold.tolist() == [True, False, False, True]
    assert truth.can_fail.tolist() == [False, True, True, True]


def test_what_is_not_observed_is_unbounded_and_what_has_no_value_says_nothing():
    domain = IntervalDomain(FLOATS)
    assert domain.feature(Feature(0, "speed", "scalar")) == (-np.inf, np.inf, False)
    assert domain.feature(Feature(0, "colour", "other")) is None
    assert domain.divide(FLOATS.between(1.0, 1.0), FLOATS.between(0.0, 0.0)) == (-np.inf, np.inf, False)
    assert domain.divide(FLOATS.between(1.0, 1.0), FLOATS.between(-1.0, 2.0)) == (-np.inf, np.inf, False)


_SEEN = [Feature(0, name, "scalar") for name in "abc"]
_COMPARED = st.builds(
    Compare, st.sampled_from([*CompareOp]), st.sampled_from(_SEEN), st.sampled_from([*_SEEN, build.constant(1.0)])
)
_CONDITIONS = st.recursive(
    _COMPARED,
    lambda parts: st.one_of(
        parts.map(lambda part: Logic(LogicOp.NOT, (part,))),
        st.builds(lambda op, args: Logic(op, tuple(args)), st.sampled_from([LogicOp.AND, LogicOp.OR]),
                  st.lists(parts, min_size=1, max_size=3)),
    ),
    max_leaves=6,
)  # fmt: skip
_ENDS = st.tuples(st.integers(-2, 3), st.integers(0, 3)).map(lambda ends: (float(ends[0]), float(sum(ends))))


@given(_CONDITIONS, st.tuples(_ENDS, _ENDS, _ENDS))
@settings(max_examples=150, deadline=None, derandomize=True)
def test_a_condition_can_hold_or_fail_where_some_values_make_it(root, limits):
    known = {f"{name}": Interval(low, high, low == high) for name, (low, high) in zip("abc", limits, strict=True)}
    domain = IntervalDomain(FLOATS, lambda node: known[node.property])
    truth = interpret(steps_of(root), domain)[id(root)]
    said = set()
    for values in itertools.product(*({low, (low + high) / 2, high} for low, high in limits)):
        seen = {(0, name): value for name, value in zip("abc", values, strict=True)}
        said.add(evaluate(root, {}, seen))
    assert isinstance(truth, Truth)
    assert said <= ({True} if truth.can_hold else set()) | ({False} if truth.can_fail else set())
    if isinstance(root, Compare) and root.left is not root.right and root.op not in (CompareOp.EQ, CompareOp.NE):
        # of numbers apart an order is known as well as can be
        assert (bool(truth.can_hold), bool(truth.can_fail)) == (True in said, False in said)


@pytest.mark.parametrize(
    ("one", "other", "product", "quotient"),
    [
        ((1.0, 2.0), (4.0, 8.0), (4.0, 16.0), (0.125, 0.5)),
        ((-1.0, 2.0), (4.0, 8.0), (-8.0, 16.0), (-0.25, 0.5)),
        ((-2.0, -1.0), (-8.0, -4.0), (4.0, 16.0), (0.125, 0.5)),
        ((1.0, 2.0), (4.0, 4.0), (4.0, 8.0), (0.25, 0.5)),
        ((1.0, 2.0), (-4.0, -4.0), (-8.0, -4.0), (-0.5, -0.25)),
        ((8.0, 8.0), (2.0, 4.0), (16.0, 32.0), (2.0, 4.0)),
    ],
)
@pytest.mark.parametrize("columns", [False, True])
def test_products_and_quotients_are_no_wider_than_they_are(one, other, product, quotient, columns):
    domain = IntervalDomain(ARRAYS if columns else FLOATS)

    def between(low, high):
        ends = (np.full(2, low), np.full(2, high)) if columns else (low, high)
        return Interval(*ends, low == high)

    for operation, expected in ((domain.multiply, product), (domain.divide, quotient)):
        low, high, _ = operation(between(*one), between(*other))
        assert np.all(low == expected[0])
        assert np.all(high == expected[1])


@pytest.mark.parametrize("columns", [False, True])
def test_a_known_vector_has_a_known_heading_but_near_the_seam(columns):
    domain = IntervalDomain(ARRAYS if columns else FLOATS, slack=1e-6)
    for x, y, heading in ((0.0, 5.0, 0.0), (-3.0, 0.0, math.pi / 2), (2.0, 2.0, -math.pi / 4)):
        ends = (np.full(2, x), np.full(2, y)) if columns else (x, y)
        low, high, _ = domain.bearing(IntervalVector(*(Interval(end, end, True) for end in ends)))
        assert np.allclose([low, high], heading)
    for x, y in ((0.0, -5.0), (0.0, 0.0)):
        ends = (np.full(2, x), np.full(2, y)) if columns else (x, y)
        low, high, _ = domain.bearing(IntervalVector(*(Interval(end, end, True) for end in ends)))
        assert np.all(low <= -math.pi)
        assert np.all(high >= math.pi)


def test_without_boxes_nothing_is_said_of_what_is_asked_of_regions():
    """With them a distance from a region is bounded, and regions that lie apart do not meet."""
    near, far = (build.constant(Disc((x, 0.0), 1.0)) for x in (0.0, 50.0))
    distance, meeting = Distance(far, build.constant((0.0, 0.0))), Intersects(near, far)
    for boxed in (True, False):
        domain = IntervalDomain(FLOATS, boxed=boxed)
        bounds = interpret(steps_of(distance), domain)[id(distance)]
        truth = interpret(steps_of(meeting), domain)[id(meeting)]
        assert bounds[0] == (49.0 if boxed else 0.0)
        assert truth.can_hold is (not boxed)


def test_ends_in_arrays_are_those_in_numbers():
    values = [-math.inf, -2.5, -1.0, 0.0, 0.5, 3.0, math.inf, math.nan]
    with np.errstate(invalid="ignore"):
        for some in (values, values[1:-2], values[-1:]):
            found = ARRAYS.known(np.array(some))
            expected = [FLOATS.known(value) for value in some]
            assert np.broadcast_to(found.low, len(some)).tolist() == [each.low for each in expected]
            assert np.broadcast_to(found.high, len(some)).tolist() == [each.high for each in expected]
            assert found.exact == all(each.exact for each in expected)


@pytest.mark.parametrize("ends", [FLOATS, ARRAYS])
def test_what_is_chosen_lies_in_the_hull_of_numbers_or_of_vectors(ends):
    domain = IntervalDomain(ends)
    numbers = [Interval(1.0, 1.0, True), Interval(-2.0, 0.5), Interval(4.0, 5.0)]
    vectors = [IntervalVector(one, other) for one, other in itertools.pairwise(numbers)]
    assert domain.select(None, numbers)[:2] == (-2.0, 5.0)
    assert [each[:2] for each in domain.select(None, vectors)] == [(-2.0, 1.0), (-2.0, 5.0)]
    assert domain.select(None, [*numbers, *vectors]) is None
