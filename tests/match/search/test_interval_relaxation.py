"""Whether a value between bounds can be near what a label observes, compared with values between them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenicq.forest.interval_values import Interval, IntervalVector
from scenicq.geometry.angles import distance
from scenicq.match.search.interval_relaxation import within_margin
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
