"""Whether a value between bounds can be near what a label observes, compared with values between them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.forest.interpret import interpret, steps_of
from scenicq.forest.interval_ends import ARRAYS
from scenicq.forest.interval_values import Interval, IntervalVector
from scenicq.forest.intervals import IntervalDomain
from scenicq.forest.nodes import Constant
from scenicq.geometry.angles import distance
from scenicq.geometry.default_street import street
from scenicq.match.options import MatchOptions
from scenicq.match.problem.constraints import build_groups, relevant_properties
from scenicq.match.problem.preprocess import prepare_scenario
from scenicq.match.search.interval_relaxation import Relaxation, within_margin
from scenicq.match.tolerance import SLACK, Margin

NUMBERS = st.floats(-8, 8, allow_nan=False)
WIDTHS = st.floats(0, 9)
SIZES = st.floats(0, 1)
CLOSE = 1e-3
"""What lies nearer than this at the edge of being allowed is not asked about."""


@given(NUMBERS, WIDTHS, NUMBERS, SIZES, st.sampled_from(["arc", "interval"]))
def test_a_number_is_near_bounds_where_it_is_near_a_value_between_them(low, width, seen, size, kind):
    between = np.linspace(low, low + width, 20_001)
    off = np.abs(between - seen) if kind == "interval" else np.array([distance(each, seen) for each in between[::10]])
    excess = float(off.min()) - size - SLACK
    found = bool(within_margin(Interval(low, low + width, True), seen, Margin(kind, size, size)))
    if abs(excess) > CLOSE + width / 2000:
        assert found == (excess < 0)


@pytest.mark.parametrize("kind", ["arc", "interval"])
def test_the_ends_of_what_is_allowed_belong_to_it(kind):
    bounds, margin = Interval(1.0, 2.0, True), Margin(kind, 0.25, 0.25)
    # far less than the slack from it, so that rounding does not decide
    for seen, allowed in ((0.75, True), (2.25, True), (0.75 - 3 * SLACK, False), (2.25 + 3 * SLACK, False)):
        assert bool(within_margin(bounds, seen, margin)) == allowed
        if kind == "arc":
            assert bool(within_margin(bounds, seen + math.tau, margin)) == allowed


@given(NUMBERS, WIDTHS, NUMBERS, WIDTHS, NUMBERS, NUMBERS, SIZES)
def test_a_point_is_near_a_box_where_it_is_within_reach_of_it_along_both_axes(left, wide, low, high, x, y, size):
    box = IntervalVector(Interval(left, left + wide, True), Interval(low, low + high, True))
    excess = max(left - x, x - left - wide, low - y, y - low - high) - size - SLACK
    if abs(excess) > CLOSE:
        assert bool(within_margin(box, (x, y), Margin("disc", size, size))) == (excess < 0)


def test_bounds_that_no_label_changes_are_found_once():
    """A look-up among many lanes costs a label no step for each of them."""
    text = "model scenic.domains.driving.model\nego = new Car on road\nnew Car on ego.lane, facing Range(-9, 9) deg\n"
    scenario = prepare_scenario(compile_scenario(Source("p.scenic", text), street()))
    groups = build_groups(scenario, tuple(relevant_properties(scenario, MatchOptions())), MatchOptions())
    relaxations = [Relaxation.of(group) for group in groups]
    assert any(len(each.given) > 3 for each in relaxations)
    for relaxation in relaxations:
        roots = [item.expression for item in relaxation.group.constraints]
        plain = interpret(steps_of(*roots), IntervalDomain(ARRAYS, slack=SLACK, boxed=False))
        for node, _ in relaxation.steps:
            assert not isinstance(node, Constant)
        for each, bounds in relaxation.given.items():
            assert bounds == plain[each]
