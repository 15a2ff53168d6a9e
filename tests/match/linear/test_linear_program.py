"""Linear programs: solutions satisfy the rows, strict ones with a margin, and extents are those of the corners."""

from __future__ import annotations

import math

import pytest

from scenicq.forest.nodes import Identity
from scenicq.match.linear.affine_forms import Affine
from scenicq.match.linear.linear_program import LinearSystem, NotSolved, Row

X, Y = (Identity(), 0), (Identity(), 0)


def row(low, high, constant=0.0, *, strict=False, x=0.0, y=0.0):
    return Row(Affine(constant, {key: value for key, value in ((X, x), (Y, y)) if value}), low, high, strict)


TRIANGLE = LinearSystem([row(0, math.inf, x=1), row(0, math.inf, y=1), row(-math.inf, 4, x=1, y=2)])


def test_a_solution_satisfies_all_rows():
    found = TRIANGLE.solve([row(3, 3, x=1)])
    assert found[X] == pytest.approx(3.0)
    assert -1e-9 <= found[Y] <= 0.5 + 1e-9
    assert TRIANGLE.solve([row(5, math.inf, x=1)]) is None


def test_a_strict_row_needs_a_margin():
    assert TRIANGLE.solve([row(4, math.inf, x=1)]) is not None
    assert TRIANGLE.solve([row(4, math.inf, x=1, strict=True)]) is None
    assert TRIANGLE.solve([row(3.9, math.inf, x=1, strict=True)])[X] > 3.9


def test_rows_without_a_variable_hold_or_not():
    assert LinearSystem().solve([row(0, 1, 0.5)]) == {}
    assert LinearSystem().solve([row(0, 1, 2.0)]) is None
    assert LinearSystem().solve([row(0, 1, 1.0, strict=True)]) is None


def test_an_extent_is_that_of_the_corners():
    assert TRIANGLE.extent([], X) == pytest.approx((0.0, 4.0))
    assert TRIANGLE.extent([row(1, math.inf, y=1)], X) == pytest.approx((0.0, 2.0))
    assert TRIANGLE.extent([row(3, math.inf, y=1)], X) is None
    with pytest.raises(NotSolved):
        LinearSystem([row(0, math.inf, x=1)]).extent([], X)
