"""Linear systems over two numbers against the polygons that they describe."""

from __future__ import annotations

import math
import random

import pytest
from shapely import Polygon, box

from scenicq.errors import CannotEvaluate
from scenicq.forest.nodes import Identity
from scenicq.match.linear.affine_forms import Affine
from scenicq.match.linear.linear_program import LinearSystem, Row

X, Y = (Identity(), 0), (Identity(), 0)
WIDE = 50.0
FRAME = [Row(Affine(0.0, {axis: 1.0}), -WIDE, WIDE) for axis in (X, Y)]


def form(a, b, constant=0.0):
    return Affine(constant, {axis: factor for axis, factor in ((X, a), (Y, b)) if factor})


def beside(a, b, limit):
    """Where a x + b y is at most a limit, as far as it matters."""
    size = math.hypot(a, b)
    u, v = a / size, b / size
    x, y = u * limit / size, v * limit / size
    far = 4 * WIDE
    return Polygon(
        [
            (x - v * far, y + u * far), (x + v * far, y - u * far), (x + v * far - u * far, y - u * far - v * far),
            (x - v * far - u * far, y + u * far - v * far),
        ]
    )  # fmt: skip


def random_rows(rng):
    """Rows, and the polygon in which they hold."""
    rows, left = [*FRAME], box(-WIDE, -WIDE, WIDE, WIDE)
    for _ in range(rng.randint(1, 5)):
        a, b = rng.choice([-2.0, -1.0, 0.0, 1.0, 3.0]), rng.choice([-2.0, 1.0, 3.0])
        low = rng.choice([-math.inf, rng.uniform(-40, 40)])
        high = rng.choice([math.inf, rng.uniform(-40, 40)])
        constant = rng.choice([0.0, 5.0])
        rows.append(Row(form(a, b, constant), low, high))
        if high < math.inf:
            left = left & beside(a, b, high - constant)
        if low > -math.inf:
            left = left & beside(-a, -b, constant - low)
    return rows, left


@pytest.mark.parametrize("seed", range(60))
def test_a_system_is_solved_where_its_polygon_has_points(seed):
    rows, left = random_rows(random.Random(seed))
    first = rows[: len(rows) // 2]
    system = LinearSystem(first)
    found = system.solve(rows[len(first) :])
    if left.area < 1e-6:
        assert found is None or left.area > 0 or not left.is_empty
        return
    assert found is not None
    for row in rows:
        value = row.form.constant + sum(factor * found[axis] for axis, factor in row.form.terms.items())
        assert row.low - 1e-6 <= value <= row.high + 1e-6
    west, south, east, north = left.bounds
    assert system.extent(rows[len(first) :], X) == (pytest.approx(west, abs=1e-5), pytest.approx(east, abs=1e-5))
    assert system.extent(rows[len(first) :], Y) == (pytest.approx(south, abs=1e-5), pytest.approx(north, abs=1e-5))


@pytest.mark.parametrize("seed", range(60))
def test_strict_rows_hold_with_a_margin(seed):
    rows, left = random_rows(random.Random(seed))
    strict = [Row(row.form, row.low, row.high, strict=True) for row in rows]
    found = LinearSystem(strict).solve([])
    assert (found is not None) == (left.area > 1e-4)
    for row in rows if found is not None else ():
        value = row.form.constant + sum(factor * found[axis] for axis, factor in row.form.terms.items())
        assert row.low + 1e-8 <= value <= row.high - 1e-8


@pytest.mark.parametrize("strict", [False, True])
@pytest.mark.parametrize(
    ("low", "high", "holds"),
    [(0.0, 3.0, True), (2.0, 3.0, None), (0.0, 2.0, None), (2.5, 3.0, False), (-1.0, 1.0, False)],
)
def test_a_row_without_variables_holds_or_does_not(low, high, holds, strict):
    row = Row(Affine(2.0, {}), low, high, strict)
    solved = LinearSystem([row]).solve([]) is not None
    # at an end it holds unless it is strict
    assert solved == (holds if holds is not None else not strict)
    among = LinearSystem([*FRAME, row]).solve([]) is not None
    assert among == solved
    if not strict:
        assert (LinearSystem([row]).extent(FRAME, X) is not None) == solved


def test_a_system_that_nothing_holds_has_no_extent_and_an_unbounded_one_is_not_solved():
    never = [Row(form(1, 1), 200.0, math.inf)]
    assert LinearSystem(FRAME).extent(never, X) is None
    with pytest.raises(CannotEvaluate):
        LinearSystem([Row(form(1, 1), 0.0, 1.0)]).extent([], X)
    with pytest.raises(CannotEvaluate):
        LinearSystem([FRAME[0]]).extent([], Y)
