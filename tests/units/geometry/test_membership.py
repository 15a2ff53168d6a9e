"""contains, distance, nearest_point and bounds against dense sampling by the definition."""

# pyright: basic

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, Polygon, box

from scenicq.geometry import membership
from scenicq.geometry.regions import (
    DifferenceOf,
    Disc,
    Everywhere,
    IntersectionOf,
    Nowhere,
    PointSet,
    PolygonSet,
    PolylineSet,
    Region,
    Sector,
    UnionOf,
    difference,
)
from scenicq.geometry.terms import terms

from . import oracle

AROUND = (-25.0, -25.0, 25.0, 25.0)
QUARTER = math.pi / 2


@settings(max_examples=80, deadline=None)
@given(oracle.regions(), st.lists(oracle.point, min_size=1, max_size=12))
def test_contains_agrees_with_the_definition(region: Region, places: list[tuple[float, float]]) -> None:
    xy = np.array(places) + 0.0123
    depth = oracle.depth(region, xy)
    clear = np.abs(depth) > 1e-6
    many = membership.contains_many(region, xy)
    one = np.array([membership.contains(region, x, y) for x, y in xy.tolist()])
    assert many.tolist() == one.tolist()
    assert one[clear].tolist() == (depth > 0)[clear].tolist()


@settings(max_examples=60, deadline=None)
@given(oracle.regions(), oracle.point)
def test_distance_agrees_with_dense_sampling(region: Region, place: tuple[float, float]) -> None:
    xy = oracle.grid(AROUND, 0.4)
    inside = xy[oracle.depth(region, xy) > 1e-9]
    found = membership.distance(region, *place)
    if len(inside):
        nearest = float(np.hypot(inside[:, 0] - place[0], inside[:, 1] - place[1]).min())
        assert found <= nearest + 1e-9
    if math.isfinite(found):
        nearest_point = membership.nearest_point(region, *place)
        assert nearest_point is not None
        assert math.dist(nearest_point, place) == pytest.approx(found, abs=1e-6)
        assert oracle.depth(region, np.array([nearest_point]))[0] > -1e-6
    # nothing of the region lies nearer than found
    near = np.array(list(oracle.circle_points(*place, max(0.0, min(found, 60.0) - 1e-6))))
    assert not (oracle.depth(region, near) > 1e-6).any() or found == 0


@settings(max_examples=60, deadline=None)
@given(oracle.regions())
def test_bounds_enclose(region: Region) -> None:
    west, south, east, north = membership.bounds(region)
    xy = oracle.grid(AROUND, 0.5)
    inside = xy[oracle.depth(region, xy) > 0]
    assume(len(inside))
    assert west <= inside[:, 0].min() + 1e-9
    assert south <= inside[:, 1].min() + 1e-9
    assert east >= inside[:, 0].max() - 1e-9
    assert north >= inside[:, 1].max() - 1e-9


def test_the_boundary_is_inside_but_not_what_lies_beyond() -> None:
    square = PolygonSet((box(0, 0, 1, 1),), "square")
    for x, y in [(0, 0), (1, 0.5), (0.5, 1 + 5e-10)]:
        assert membership.contains(square, x, y)
    assert not membership.contains(square, 0.5, 1 + 1e-8)


def test_a_point_in_a_hole_is_outside() -> None:
    ring = PolygonSet((Polygon(box(0, 0, 4, 4).exterior.coords, [list(box(1, 1, 3, 3).exterior.coords)]),), "ring")
    assert not membership.contains(ring, 2, 2)
    assert membership.distance(ring, 2, 2) == 1
    assert membership.contains(ring, 1, 2)


@pytest.mark.parametrize("heading", [0.0, 3.0, math.pi, -math.pi, 7.0])
def test_wide_sectors(heading: float) -> None:
    sector = Sector((5, 5), 2, heading, 3 * QUARTER)
    behind = heading + math.pi

    def at(turn: float, away: float) -> tuple[float, float]:
        return 5 - away * math.sin(turn), 5 + away * math.cos(turn)

    assert membership.contains(sector, *at(heading + 1.5 * QUARTER - 1e-6, 1))
    assert not membership.contains(sector, *at(behind, 1))
    assert membership.contains(sector, *at(heading - 1.4 * QUARTER, 2))
    assert membership.distance(sector, *at(behind, 1)) == pytest.approx(math.sin(QUARTER / 2))
    assert membership.contains(Sector((5, 5), 2, heading, math.tau), *at(behind, 2))
    assert membership.contains(Sector((5, 5), 2, heading, 9.0), *at(behind, 2))


def test_removing_neighbours_removes_their_common_border() -> None:
    base = PolygonSet((box(0, 0, 4, 4),), "base")
    removed = PolygonSet((box(1, 1, 2, 3), box(2, 1, 3, 3)), "removed")
    rest = DifferenceOf(base, removed)
    assert not membership.contains(rest, 2, 2)
    assert membership.contains(rest, 2, 1)
    assert membership.distance(rest, 2, 2) == 1
    assert membership.contains_many(rest, np.array([(2, 2), (2, 1), (0.5, 0.5), (9, 9)])).tolist() == [0, 1, 1, 0]


def test_distance_far_away_and_to_nothing() -> None:
    apart = IntersectionOf((Disc((0, 0), 1), Disc((5, 0), 1)))
    assert membership.distance(apart, 0, 0) == math.inf
    assert membership.distance(Nowhere(), 0, 0) == math.inf
    assert membership.distance(DifferenceOf(Disc((0, 0), 0.5), Disc((0, 0), 0.75)), 0, 0) == math.inf
    assert membership.distance(Everywhere(), 3, 4) == 0
    far = difference(PolygonSet((box(0, 0, 1, 1), box(200, 0, 201, 1)), "two"), Disc((0, 0), 5))
    assert membership.distance(far, 0, 0.5) == pytest.approx(200)
    lens = IntersectionOf((Disc((0, 0), 2), Disc((2, 0), 2)))
    assert membership.distance(lens, 4001, 0) == pytest.approx(3999)
    assert membership.distance(difference(Everywhere(), Disc((1, 1), 3)), 1, 1) == pytest.approx(3)
    assert membership.distance(PolygonSet((), "none"), 0, 0) == math.inf


def test_lines_and_points() -> None:
    line = PolylineSet((LineString([(0, 0), (4, 0)]),), "line")
    points = PointSet(((0, 3), (4, 3)), "points")
    assert membership.distance(line, 2, 2) == 2
    assert membership.contains(line, 2, 0)
    assert membership.distance(points, 4, 0) == 3
    assert membership.distance(IntersectionOf((line, Disc((0, 0), 1))), 3, 0) == pytest.approx(2)
    assert membership.distance(IntersectionOf((UnionOf((line, points)), Disc((4, 3), 1))), 0, 0) == pytest.approx(5)


def test_parts_near_a_box_are_those_whose_boxes_meet_it() -> None:
    rng = np.random.default_rng(5)
    centers = rng.uniform(-50, 50, (60, 2)).tolist()
    union = UnionOf(tuple(Disc((x, y), 3.0) for x, y in centers))
    for west, south in rng.uniform(-50, 50, (40, 2)).tolist():
        around = (west, south, west + 8.0, south + 5.0)
        near = [
            part
            for part, (x, y) in zip(union.parts, centers, strict=True)
            if west - 3.0 <= x <= west + 11.0 and south - 3.0 <= y <= south + 8.0
        ]
        assert membership.parts_near(union, around) == near


def test_of_many_parts_those_close_by_alone_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    squares = tuple(box(3.0 * x, 3.0 * y, 3.0 * x + 2.0, 3.0 * y + 2.0) for x in range(20) for y in range(20))
    region = IntersectionOf((PolygonSet(squares, "squares"), Disc((30.0, 30.0), 24.0)))
    asked: list[object] = []
    real = membership.closest_point
    monkeypatch.setattr(membership, "closest_point", lambda term, x, y: asked.append(term) or real(term, x, y))
    for place, nearest in (((32.5, 31.0), (32.0, 31.0)), ((60.5, 30.5), None)):
        asked.clear()
        found = membership.nearest_point(region, *place)
        assert found is not None
        assert nearest is None or found == pytest.approx(nearest)
        least = min(
            math.dist(place, each) for each in (real(term, *place) for term in terms(region, (0, 0, 60, 60))) if each
        )
        assert math.dist(place, found) == pytest.approx(least)
        assert len(asked) < 12
