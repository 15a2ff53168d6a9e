"""covers and overlaps: against dense sampling, with regions of every kind."""

# pyright: basic

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, Polygon

from scenicq.geometry.boxes import box_polygon
from scenicq.geometry.containment import covers, overlaps
from scenicq.geometry.proximity import witness_point
from scenicq.geometry.regions import (
    DifferenceOf,
    Disc,
    Everywhere,
    IntersectionOf,
    Nowhere,
    PointSet,
    PolygonSet,
    PolylineSet,
    Rectangle,
    Region,
    Sector,
    UnionOf,
)

from . import oracle

boxes = st.builds(lambda at, turn, width, length: box_polygon(*at, turn, width, length),
                  oracle.point, oracle.heading, oracle.size, oracle.size)  # fmt: skip
UNIT = box_polygon(0.0, 0.0, 0.0, 1.0, 1.0)


@settings(max_examples=60, deadline=None)
@given(oracle.regions(), boxes)
def test_covers_agrees_with_dense_sampling(region: Region, box: Polygon) -> None:
    found = covers(region, box)
    west, south, east, north = box.bounds
    step = max(east - west, north - south) / 40
    xy = oracle.grid(box.bounds, step)
    xy = np.concatenate([xy[shapely.contains_xy(box, xy[:, 0], xy[:, 1])], np.array(box.exterior.coords)])
    depth = oracle.depth(region, xy)
    if found is not False:
        assert depth.min() > -1e-4
    # every point of the box is that near to a sampled one
    if depth.min() > step:
        assert found is True


@settings(max_examples=60, deadline=None)
@given(oracle.regions(), oracle.regions())
def test_overlaps_agrees_with_dense_sampling(left: Region, right: Region) -> None:
    """Regions that only touch, to a rounding error, may be told apart or not: but a shared point is near both."""
    found = overlaps(left, right)
    xy = oracle.grid((-25, -25, 25, 25), 0.5)
    point = witness_point(IntersectionOf((left, right)), shapely.box(-99, -99, 99, 99)) if found else None
    if (np.minimum(oracle.depth(left, xy), oracle.depth(right, xy)) > 1e-6).any():
        assert found is True
        assert overlaps(right, left) is True
        assert point is not None
    if point is not None:
        assert min(oracle.depth(left, np.array([point]))[0], oracle.depth(right, np.array([point]))[0]) > -1e-6


HOLED = DifferenceOf(Everywhere(), Disc((0.0, 0.0), 0.1))
HALF = Sector((0.0, -1.0), 5.0, 0.0, math.pi)
MORE_THAN_HALF = Sector((0.0, 0.0), 5.0, 0.0, 1.9 * math.pi)
LINE = PolylineSet((LineString([(-5, 0), (5, 0)]),), "line")
POINTS = PointSet(((0.0, 0.0), (3.0, 0.0)), "points")
SQUARES = PolygonSet((shapely.box(-1, -1, 0, 1), shapely.box(0, -1, 1, 1)), "squares")
HALVES = UnionOf((Rectangle((-1.0, 0.0), 0.0, 2.0, 2.0), Disc((5.0, 0.0), 5.0)))


@pytest.mark.parametrize(
    ("region", "expected"),
    [
        (Everywhere(), True), (Nowhere(), False), (HOLED, False), (HALF, True), (MORE_THAN_HALF, False), (LINE, False),
        (POINTS, False), (SQUARES, True), (HALVES, False),
        (UnionOf((HALVES, Rectangle((0.5, 0.0), 0.0, 1.0, 1.0))), True), (DifferenceOf(SQUARES, LINE), True),
        (DifferenceOf(SQUARES, Disc((5.0, 0.0), 1.0)), True),
    ],
)  # fmt: skip
def test_a_unit_box_is_covered(region: Region, expected: bool) -> None:
    assert covers(region, UNIT) is expected


@pytest.mark.parametrize(
    ("left", "right", "expected"),
    [
        (LINE, POINTS, True), (LINE, PolylineSet((LineString([(0, 1), (0, 5)]),), "above"), False),
        (LINE, PolylineSet((LineString([(0, -1), (0, 5)]),), "across"), True), (HALF, MORE_THAN_HALF, True),
        (Sector((0.0, 0.0), 5.0, 0.0, 1.0), Sector((0.0, -1.0), 5.0, math.pi, 1.0), False),
        (HOLED, HOLED, True), (Nowhere(), Everywhere(), False), (HOLED, POINTS, True),
        (HOLED, PointSet(((0.0, 0.0),), "hole"), False),
    ],
)  # fmt: skip
def test_two_regions_overlap(left: Region, right: Region, expected: bool) -> None:
    assert overlaps(left, right) is expected
