"""The domain of intervals over columns agrees with plain evaluation, row by row."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
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
