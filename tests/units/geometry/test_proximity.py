"""meets and witness_point: never a false yes or no, against dense sampling and by closed-form cases."""

# pyright: basic

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, Point, Polygon, box

from scenicq.geometry.membership import contains
from scenicq.geometry.proximity import meets, witness_point
from scenicq.geometry.regions import (
    DifferenceOf,
    Disc,
    Everywhere,
    IntersectionOf,
    Nowhere,
    PolygonSet,
    Rectangle,
    Region,
    Sector,
    union,
)

from . import oracle

radii = st.sampled_from([0.0, 0.25, 1.0, 3.0])
small_polygons = oracle.polygons()


@settings(max_examples=120, deadline=None)
@given(oracle.regions(), st.one_of(oracle.point.map(Point), small_polygons), radii)
def test_meets_agrees_with_dense_sampling(region: Region, shape: Point | Polygon, radius: float) -> None:
    found = meets(region, shape, radius)
    assert found is not None
    west, south, east, north = shape.bounds
    step = max(east - west, north - south, radius) / 30 or 1.0
    xy = oracle.grid((west - radius, south - radius, east + radius, north + radius), step)
    xy = xy[shapely.dwithin(shapely.points(xy), shape, max(radius - 1e-9, 0.0))]
    if (oracle.depth(region, xy) > 1e-7).any():
        assert found
    witness = witness_point(region, shape, radius)
    assert (witness is not None) == found
    if witness is not None:
        # together these prove the yes
        assert oracle.depth(region, np.array([witness]))[0] > -1e-6
        assert shapely.distance(Point(witness), shape) <= radius + 1e-6
        assert contains(region, *witness)


@settings(max_examples=50, deadline=None)
@given(oracle.regions(), oracle.point)
def test_meets_turns_at_the_distance(region: Region, place: tuple[float, float]) -> None:
    xy = np.array(list(oracle.circle_points(*place, 6.0)))
    inside = xy[oracle.depth(region, xy) > 1e-6]
    nearest = min(np.hypot(inside[:, 0] - place[0], inside[:, 1] - place[1]), default=math.inf)
    answers = [meets(region, Point(place), radius) for radius in (0.5, 1.5, 4.5, 6.0)]
    assert answers == sorted(answers, key=bool), "a larger radius meets more"
    for radius, answer in zip((0.5, 1.5, 4.5, 6.0), answers, strict=True):
        if nearest <= radius:
            assert answer


def test_two_discs_and_a_polygon_between_them() -> None:
    # the lens of the two discs is |y| <= sqrt(1 - 0.81) around x = 0.9
    reach = math.sqrt(1 - 0.81)
    disc = Disc((0, 0), 1)
    for gap, expected in ((-1e-6, True), (1e-6, False)):
        wall = PolygonSet((box(0.5, reach + gap, 1.3, 3),), "wall")
        region = IntersectionOf((disc, wall))
        assert meets(region, Point(1.8, 0), 1.0) is expected
    assert (
        meets(IntersectionOf((disc, Disc((1.8, 0), 1), PolygonSet((box(-5, -5, 5, 5),), "all"))), Point(0.9, 0)) is True
    )


@pytest.mark.parametrize(("x", "expected"), [(3.0 - 1e-6, True), (3.0 + 1e-6, False)])
def test_touching_discs(x: float, expected: bool) -> None:
    region = IntersectionOf((Disc((0, 0), 1), PolygonSet((box(-5, -5, 5, 5),), "all")))
    assert meets(region, Point(x, 0), 2.0) is expected


def test_a_tolerance_disc_inside_of_a_removed_disc() -> None:
    ring = DifferenceOf(Disc((0, 0), 5), Disc((0, 0), 3))
    assert meets(ring, Point(0, 0), 2.999) is False
    assert meets(ring, Point(0, 0), 3.001) is True
    assert meets(ring, Point(0, 0)) is False
    assert meets(ring, box(-2, -2, 2, 2)) is False
    assert meets(ring, box(-2, -2, 2, 2), 0.2) is True, "corners at 2.83 m reach 3 m"
    assert meets(ring, box(-2, -2, 2, 2), 0.15) is False


def test_a_small_region_beside_an_edge() -> None:
    speck = IntersectionOf((Disc((5, 11), 0.3), PolygonSet((box(5, 10.9, 6, 12),), "plate")))
    assert meets(speck, box(0, 0, 10, 10), 2.0) is True
    assert meets(speck, box(0, 0, 10, 10), 0.9 + 1e-6) is True
    assert meets(speck, box(0, 0, 10, 10), 0.9 - 1e-6) is False


@pytest.mark.parametrize("heading", [0.0, 2.0, math.pi])
def test_the_blind_side_of_a_wide_sector(heading: float) -> None:
    road = PolygonSet((box(-20, -20, 20, 20),), "road")
    visible = IntersectionOf((road, Sector((0, 0), 10, heading, math.radians(300))))
    dx, dy = math.sin(heading), -math.cos(heading)  # straight behind
    gap = 5 * math.sin(math.radians(30))
    assert meets(visible, Point(5 * dx, 5 * dy), gap - 1e-6) is False
    assert meets(visible, Point(5 * dx, 5 * dy), gap + 1e-6) is True
    assert meets(DifferenceOf(road, Sector((0, 0), 10, heading, math.radians(300))), Point(5 * dx, 5 * dy)) is True


def test_many_removed_discs_stay_decided() -> None:
    holes = union(*(Disc((x, y), 0.8) for x in range(4) for y in range(4)))
    sieve = DifferenceOf(PolygonSet((box(0, 0, 3, 3),), "plate"), holes)
    assert meets(sieve, box(0, 0, 3, 3)) is False
    thin = union(*(Disc((x, y), 0.6) for x in range(4) for y in range(4)))
    assert meets(DifferenceOf(PolygonSet((box(0, 0, 3, 3),), "plate"), thin), Point(1.4, 1.4), 0.1) is True


def test_too_many_removed_lenses_are_undecided() -> None:
    lenses = [IntersectionOf((Disc((x / 100, 0), 2), Disc((x / 100 + 0.5, 0), 2))) for x in range(16)]
    region = DifferenceOf(PolygonSet((box(-1, -4, 1, 4),), "plate"), union(*lenses))
    assert meets(region, Point(0.3, 1.9), 0.5) is None
    assert meets(union(region, Disc((0.3, 2), 1)), Point(0.3, 1.9), 0.5) is True
    assert meets(union(region, Disc((9, 9), 1)), Point(0.3, 1.9), 0.5) is None


def test_simple_kinds() -> None:
    assert meets(Everywhere(), Point(0, 0)) is True
    assert meets(Nowhere(), box(0, 0, 1, 1), 5) is False
    assert meets(Everywhere(), Polygon()) is False
    assert meets(Rectangle((0, 0), 0, 2, 4), Point(0, 3), 1.0) is True
    assert meets(Rectangle((0, 0), 0, 2, 4), Point(0, 3), 0.9) is False
    assert meets(Disc((0, 0), 1), LineString([(2, -5), (2, 5)]), 1.0) is True
    assert meets(Disc((0, 0), 1), LineString([(2, -5), (2, 5)]), 0.9) is False
    assert witness_point(Disc((0, 0), 1), Point(0.5, 0)) == (0.5, 0)
    assert witness_point(Nowhere(), Point(0.5, 0), 3) is None
