"""Linear programs: rows of polygons, boxes of what is observed, and affine constraints."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
import shapely

from scenicq.forest import build
from scenicq.forest.groups import Comparison
from scenicq.forest.nodes import Constant, Identity, PointIn, Range, Scale, VectorOf, VectorSum
from scenicq.geometry.regions import Rectangle
from scenicq.match.linear.affine_forms import Affine
from scenicq.match.linear.linear_program import Row
from scenicq.match.linear.linear_relaxation import position_boxes, solve_affine
from scenicq.match.linear.region_rows import polygon_rows
from scenicq.match.tolerance import Tolerance

X, Y = (Identity(), 0), (Identity(), 1)
CLOSE = Tolerance(position=0.5)


@pytest.mark.parametrize("seed", range(20))
def test_the_rows_of_a_polygon_hold_inside_of_it_alone(seed):
    rng = np.random.default_rng(seed)
    hull = shapely.MultiPoint(rng.uniform(-9, 9, (7, 2))).convex_hull
    corners = shapely.get_coordinates(shapely.geometry.polygon.orient(hull))[:-1]
    # a corner twice makes no side
    corners = np.concatenate([corners, corners[-1:]])
    rows = polygon_rows((Affine(1.0, {X: 2.0}), Affine(0.0, {Y: -1.0})), corners)
    assert len(rows) == len(corners) - 1
    for u, v in rng.uniform(-7, 7, (60, 2)):
        place = shapely.Point(1.0 + 2.0 * u, -v)
        off = []
        for row in rows:
            value = row.form.constant + row.form.terms.get(X, 0.0) * u + row.form.terms.get(Y, 0.0) * v
            assert row.low == -math.inf
            off.append(value - row.high)
        assert (max(off) <= 0) == hull.covers(place)
        if max(off) <= 0:
            # rows are in metres
            assert -max(off) == pytest.approx(hull.exterior.distance(place), abs=1e-9)


def test_a_point_lies_where_its_place_is_observed_and_rows_leave_it():
    point = PointIn(Constant(Rectangle((0.0, 0.0), 0.0, 90.0, 90.0)))
    node = VectorSum(Scale(point, build.constant(2.0)), Constant((4.0, 0.0)))
    items = [(Comparison(0, "position", node, None), node, (10.0, 6.0))]
    (box,) = position_boxes(items, CLOSE).values()
    assert box[0] == pytest.approx((2.75, 3.25), abs=1e-5)
    assert box[1] == pytest.approx((2.75, 3.25), abs=1e-5)
    rows = [
        Row(Affine(1.0, {(point.identity, 0): -2.0}), -5.2, 90.0),
        Row(Affine(0.0, {(point.identity, 1): 4.0}), 12.0, math.inf),
        Row(Affine(0.0, {(point.identity, 0): 1.0, (point.identity, 1): 1.0}), 0.0, 1.0),
    ]  # fmt: skip
    (box,) = position_boxes(items, CLOSE, rows).values()
    assert box[0] == pytest.approx((2.75, 3.1), abs=1e-5)
    assert box[1] == pytest.approx((3.0, 3.25), abs=1e-5)
    (box,) = position_boxes([], CLOSE, rows).values()
    assert box[0] == pytest.approx((-44.5, 3.1), abs=1e-5)
    assert box[1] == pytest.approx((3.0, math.inf), abs=1e-5)


@pytest.mark.parametrize("seed", range(12))
def test_affine_constraints_are_solved_by_values_that_meet_them(seed):
    rng = random.Random(seed)
    point = PointIn(Constant(Rectangle((3.0, 1.0), 0.4, 6.0, 10.0)))
    shift = Range(build.constant(-1.0), build.constant(2.0))
    near = VectorSum(point, VectorOf(shift, build.constant(2.0)))
    there = (3.0 + rng.uniform(-1, 1), 1.0 + rng.uniform(-2, 2))
    by = rng.uniform(-1, 2)
    items = [
        (Comparison(0, "position", point, None), point, there),
        (Comparison(1, "position", near, None), near, (there[0] + by, there[1] + 2.0)),
    ]
    found = solve_affine(items, [], CLOSE)
    assert found is not None
    (x, y), moved = found[point.identity], found[shift.identity]
    assert math.dist((x, y), there) <= 0.5 + 1e-5
    assert -1 - 1e-6 <= moved <= 2 + 1e-6
    assert math.dist((x + moved, y + 2.0), (there[0] + by, there[1] + 2.0)) <= 0.5 + 1e-5
    items[1] = (*items[1][:2], (there[0] + 3.5, there[1] + 2.0))
    assert solve_affine(items, [], CLOSE) is None
