"""Distances of hidden points are areas that leave out no point that satisfies them, and few others."""

from __future__ import annotations

import math
import random

import pytest
from shapely import Point, Polygon

from scenicq.forest.groups import Comparison, Condition
from scenicq.forest.nodes import Compare, CompareOp, Constant, Contains, Distance, Logic, LogicOp, PointIn
from scenicq.forest.scenario import Requirement
from scenicq.geometry.membership import contains
from scenicq.geometry.regions import PolygonSet
from scenicq.match.decide.decomposition import decide_decomposed
from scenicq.match.decide.hidden_distances import with_areas
from scenicq.match.problem.outcome import Refuted, Satisfied
from scenicq.match.tolerance import EXACT, Tolerance

PLAZA = Polygon([(0, 0), (10, 0), (10, 4), (4, 4), (4, 10), (0, 10)])
EVERYWHERE = PointIn(Constant(PolygonSet((Polygon([(-90, -90), (90, -90), (90, 90), (-90, 90)]),), "area")))
WIDE = Tolerance(position=3.0)


def items(op, limit, seen, *, turned=False):
    far = Distance(Constant(PolygonSet((PLAZA,), "plaza")), EVERYWHERE)
    node = Compare(op, Constant(limit), far) if turned else Compare(op, far, Constant(limit))
    both = Logic(LogicOp.AND, (node, Compare(op, Constant(0.0), Constant(0.0)))) if turned else node
    return [
        (Comparison(0, "position", EVERYWHERE, None), EVERYWHERE, seen),
        (Condition(Requirement(both, None), both), both, None),
    ]


@pytest.mark.parametrize("op", [CompareOp.LE, CompareOp.GE])
def test_an_area_holds_exactly_the_points_at_a_distance(op):
    rng = random.Random(1)
    kept = 0
    for _ in range(60):
        seen, limit = (rng.uniform(-15, 25), rng.uniform(-15, 25)), rng.uniform(0, 12)
        found = with_areas(items(op, limit, seen), WIDE)
        area = found[1][1]
        for _ in range(20):
            angle, off = rng.uniform(0, math.tau), rng.uniform(0, 3.0)
            x, y = seen[0] + off * math.cos(angle), seen[1] + off * math.sin(angle)
            away = PLAZA.distance(Point(x, y))
            if abs(away - limit) < 0.03:
                continue
            holds = isinstance(area, Contains) and contains(area.region.value, x, y)
            assert holds is (away < limit if op is CompareOp.LE else away > limit)
            kept += holds
    assert kept > 100


@pytest.mark.parametrize("turned", [False, True])
def test_a_hidden_point_is_placed_by_the_label_without_a_solver(turned):
    near, far = (CompareOp.GE, CompareOp.LE) if turned else (CompareOp.LE, CompareOp.GE)
    for op, limit, seen, expected in (
        (near, 5.0, (17.0, 2.0), Satisfied), (near, 5.0, (19.0, 2.0), Refuted),
        (far, 5.0, (13.0, 2.0), Satisfied), (far, 5.0, (11.0, 2.0), Refuted),
        (far, 5.0, (40.0, 2.0), Satisfied), (near, 5.0, (40.0, 2.0), Refuted),
    ):  # fmt: skip
        found = decide_decomposed(items(op, limit, seen, turned=turned), WIDE)
        assert isinstance(found, expected), (op, limit, seen)


def test_constraints_without_such_distances_stay_as_they_are():
    assert with_areas(items(CompareOp.LE, 5.0, (1.0, 1.0))[:1], EXACT) is None
