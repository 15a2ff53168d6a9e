"""Windows around points: they leave out no place that a condition allows, and make no place more likely."""

from __future__ import annotations

import math
import random
from collections import Counter

import numpy as np
import pytest
import shapely
from shapely import LineString, Polygon

from scenicq.forest import build
from scenicq.forest.nodes import (
    Compare,
    CompareOp,
    Constant,
    Contains,
    DiscAt,
    Intersects,
    Logic,
    LogicOp,
    Norm,
    PointIn,
    Range,
    RectangleAt,
    SectorAt,
    VectorOf,
    VectorSum,
)
from scenicq.forest.proximity_pruning import Window, close_boxes, close_points
from scenicq.geometry.regions import PolygonSet, PolylineSet


def street(number: int) -> list[tuple[float, float]]:
    rng = random.Random(number)
    steps = np.cumsum([[rng.uniform(-9, 20), rng.uniform(-14, 14)] for _ in range(12)], axis=0)
    return [tuple(point) for point in steps.tolist()]


LINES = PolylineSet(tuple(LineString(street(number)) for number in range(4)), "lines")
AREAS = PolygonSet(tuple(Polygon(LineString(street(number)).buffer(2.0).exterior) for number in range(16)), "areas")
COVERED = shapely.union_all(AREAS.pieces)


def mass(region, shape):
    if isinstance(region, PolylineSet):
        return sum(piece.intersection(shape).length for piece in region.pieces)
    return COVERED.intersection(shape).area


def around(place, radius):
    return shapely.Point(place).buffer(radius, quad_segs=32)


@pytest.mark.parametrize("radius", [0.8, 3.0, 8.0, 25.0])
@pytest.mark.parametrize("region", [LINES, AREAS], ids=["lines", "areas"])
@pytest.mark.one_in(3)
def test_no_window_holds_more_than_the_limit_which_is_no_idle_one(region, radius):
    window = Window(Constant((0.0, 0.0)), region, radius)
    assert window.total >= mass(region, around((0.0, 0.0), 1e4)) - 1e-6
    places = [tuple(point) for piece in region.pieces for point in np.asarray(shapely.get_coordinates(piece))[::3]]
    most = max(mass(region, around(place, radius)) for place in places)
    assert most <= window.limit <= window.total
    if isinstance(region, PolylineSet):
        assert window.limit <= 3 * most
    else:
        assert window.limit <= 1.02 * math.pi * radius**2


@pytest.mark.parametrize("region", [LINES, AREAS], ids=["lines", "areas"])
def test_a_window_gives_the_points_of_the_region_around_its_centre_in_their_share(region):
    window, rng = Window(Constant((0.0, 0.0)), region, 8.0), random.Random(1)
    center = street(2)[4]
    drawn = [window.draw(center, rng) for _ in range(700)]
    found = [point for point in drawn if point is not None]
    within = [point for point in found if math.dist(point, center) <= 8.0]
    # the window is a polygon around the disc
    assert len(within) > 0.95 * len(found)
    assert len(within) / len(drawn) == pytest.approx(mass(region, around(center, 8.0)) / window.limit, rel=0.15)
    sides = Counter(point[0] < center[0] for point in within)
    left = mass(region, around(center, 8.0) & shapely.box(center[0] - 9, -1e4, center[0], 1e4))
    assert sides[True] / len(within) == pytest.approx(left / mass(region, around(center, 8.0)), abs=0.08)
    assert window.draw((1e4, 1e4), rng) is None


def point(region=AREAS):
    return PointIn(Constant(region))


def apart(one, other):
    return Norm(build.vector_difference(one, other))


NINE = build.constant(9.0)
ASIDE = VectorOf(Range(build.constant(-3.0), build.constant(1.0)), build.constant(4.0))
HELD = {
    "less": (lambda a, b: Compare(CompareOp.LT, apart(a, b), NINE), 9.0),
    "at most": (lambda a, b: Compare(CompareOp.LE, apart(a, b), NINE), 9.0),
    "more": (lambda a, b: Compare(CompareOp.GT, NINE, apart(b, a)), 9.0),
    "random": (lambda a, b: Compare(CompareOp.GE, Range(build.constant(3.0), NINE), apart(b, a)), 9.0),
    "disc": (lambda a, b: Contains(DiscAt(a, NINE), b), 9.0),
    "sector": (lambda a, b: Contains(SectorAt(b, NINE, build.constant(0.3), build.constant(1.0)), a), 9.0),
    "seen": (
        lambda a, b: Intersects(DiscAt(a, NINE), RectangleAt(b, NINE, build.constant(6.0), build.constant(-8.0))), 14.0,
    ),
    "moved": (lambda a, b: Compare(CompareOp.LT, apart(a, VectorSum(b, ASIDE)), NINE), 14.0),
}  # fmt: skip


@pytest.mark.parametrize("name", HELD)
@pytest.mark.parametrize("swapped", [False, True])
def test_what_holds_two_points_together_gives_the_later_one_a_window(name, swapped):
    made, radius = HELD[name]
    one, other = point(), point()
    condition = made(other, one) if swapped else made(one, other)
    # what is in the roots first is drawn first
    roots = (VectorSum(VectorSum(one, ASIDE), other), condition)
    _, windows = close_points([condition], roots)
    # what moves the earlier point is known when the later one is drawn
    radius = 9.0 if swapped and name == "moved" else radius
    assert {identity: window.radius for identity, window in windows.items()} == {other.identity: pytest.approx(radius)}
    assert all(window.region is AREAS for window in windows.values())


@pytest.mark.parametrize(
    "condition",
    [
        lambda a, b: Compare(CompareOp.GT, apart(a, b), NINE),
        lambda a, b: Compare(CompareOp.EQ, apart(a, b), NINE),
        lambda a, b: Compare(CompareOp.LT, apart(a, b), build.constant(500.0)),
        lambda a, b: Compare(CompareOp.LT, Norm(VectorSum(a, b)), NINE),
    ],
)
def test_what_holds_no_points_together_gives_none(condition):
    one, other = point(), point()
    held = condition(one, other)
    roots = (VectorSum(one, other), held)
    same, windows = close_points([held], roots)
    assert windows == {}
    assert all(new is old for new, old in zip(same, roots, strict=True))


def test_the_closest_of_several_conditions_counts():
    one, other = point(), point()
    held = [Compare(CompareOp.LT, apart(one, other), build.constant(size)) for size in (12.0, 7.0, 9.0)]
    _, windows = close_points(held, (VectorSum(one, other), *held))
    assert [window.radius for window in windows.values()] == [7.0]


def test_points_near_known_places_have_boxes():
    one, away = point(), Constant((3.0, 4.0))
    condition = Logic(LogicOp.AND, (Compare(CompareOp.LT, apart(one, away), NINE), build.constant(True)))
    assert list(close_boxes(condition)) == [(one, ((-6.0, 12.0), (-5.0, 13.0)))]
    assert list(close_boxes(Compare(CompareOp.LT, apart(away, away), NINE))) == []
