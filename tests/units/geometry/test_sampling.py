"""Samples lie in the region and are spread evenly over it."""

# pyright: basic

import math
import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, box

from scenicq.geometry.membership import contains
from scenicq.geometry.regions import (
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
    difference,
)
from scenicq.geometry.sampling import sample, sampler

from . import oracle

COUNT = 2000


def share(region: Region, part: Region) -> float:
    rng, draw = random.Random(7), sampler(region)
    return sum(contains(part, *draw(rng)) for _ in range(COUNT)) / COUNT


@settings(max_examples=60, deadline=None)
@given(oracle.simple_regions(), st.integers(0, 2**32))
def test_samples_lie_inside(region: Region, seed: int) -> None:
    rng = random.Random(seed)
    xy = np.array([sample(region, rng) for _ in range(20)])
    assert (oracle.depth(region, xy) > -1e-9).all()


@pytest.mark.parametrize(
    ("region", "part", "expected"),
    [
        (Disc((1, 1), 2), Disc((1, 1), 1), 0.25),
        (Sector((0, 0), 2, 1.0, 4.0), Sector((0, 0), 2, 1.0, 1.0), 0.25),
        (Rectangle((0, 0), 1.0, 2, 4), Rectangle((0, 0), 1.0, 1, 2), 0.25),
        (PolygonSet((box(0, 0, 2, 1), box(1, 0, 3, 1)), "overlapping"), Rectangle((1.5, 0.5), 0, 1, 1), 1 / 3),
        (PolylineSet((LineString([(0, 0), (3, 0)]), LineString([(0, 5), (1, 5)])), "l"), Disc((0, 5), 2), 0.25),
        (UnionOf((Disc((0, 0), 1), Disc((0, 0), 2))), Disc((0, 0), 1), 0.25),
        (UnionOf((Disc((0, 0), 1), PointSet(((9.0, 9.0),), "p"))), Disc((0, 0), 1), 1.0),
        (IntersectionOf((Everywhere(), Disc((0, 0), 2))), Disc((0, 0), 1), 0.25),
        (difference(Disc((0, 0), 2), Disc((0, 0), 1)), Disc((0, 0), math.sqrt(2.5)), 0.5),
        # what is left is a hundred-thousandth of what it is left from
        (difference(Rectangle((0, 0), 0, 9, 8), Rectangle((-1e-4, 0), 0, 9, 8)), Rectangle((4, 2), 0, 2, 4), 0.5),
        (difference(Disc((0, 0), 2), Sector((0, 0), 3, 0, math.tau - 6e-5)), Disc((0, 0), 1), 0.25),
    ],
)
def test_samples_are_uniform(region: Region, part: Region, expected: float) -> None:
    assert share(region, part) == pytest.approx(expected, abs=4 * math.sqrt(0.25 / COUNT))


def test_points_are_equally_likely() -> None:
    assert share(PointSet(((0, 0), (1, 0), (2, 0), (3, 0)), "points"), Disc((3, 0), 0.1)) == pytest.approx(
        0.25, abs=0.04
    )


@pytest.mark.parametrize(
    "region", [Nowhere(), PolygonSet((), "none"), PointSet((), "none"), UnionOf(()), Disc((0, 0), -1)]
)
def test_empty(region: Region) -> None:
    with pytest.raises(ValueError, match="empty"):
        sample(region, random.Random(1))


def test_empty_combinations_end() -> None:
    for region in (
        IntersectionOf((Disc((0, 0), 1), Disc((1.5, 0), 0.4))),
        difference(Rectangle((0, 0), 0, 1, 1), Sector((0, -2), 4, 0, math.pi)),
    ):
        draw = sampler(region)
        # that nothing is there is found out once
        for _ in range(200):
            with pytest.raises(ValueError, match="empty"):
                draw(random.Random(1))


def test_the_plane_has_no_uniform_point() -> None:
    with pytest.raises(ValueError, match="unbounded"):
        sample(Everywhere(), random.Random(1))
