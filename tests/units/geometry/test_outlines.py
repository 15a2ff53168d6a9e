"""Polygons for regions: within them, around them, or as large; against their definition at random points."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
import shapely

from scenicq.geometry import shapes
from scenicq.geometry.membership import contains_many
from scenicq.geometry.outlines import outline, sector_outline
from scenicq.geometry.regions import (
    DifferenceOf,
    Disc,
    IntersectionOf,
    PolygonSet,
    Rectangle,
    Region,
    Sector,
    UnionOf,
)

BOUNDS = (-12.0, -12.0, 12.0, 12.0)


def _drawn(rng: random.Random, depth: int) -> Region:
    center = (rng.uniform(-6, 6), rng.uniform(-6, 6))
    if depth and rng.random() < 0.7:
        one, other = _drawn(rng, depth - 1), _drawn(rng, depth - 1)
        return rng.choice([UnionOf, IntersectionOf, lambda parts: DifferenceOf(*parts)])((one, other))
    kind = rng.randrange(4)
    if kind == 0:
        return Disc(center, rng.uniform(0.5, 7))
    if kind == 1:
        angle = rng.choice([rng.uniform(0.05, math.tau), math.tau, 7.0])
        return Sector(center, rng.uniform(0.5, 7), rng.uniform(-4, 4), angle)
    if kind == 2:
        return Rectangle(center, rng.uniform(-4, 4), rng.uniform(0.5, 8), rng.uniform(0.5, 8))
    corners = [(center[0] + dx, center[1] + dy) for dx, dy in ((0, 0), (4, 0), (1, 5))]
    return PolygonSet((shapely.Polygon(corners),), "triangle")


@pytest.mark.parametrize("seed", range(40))
def test_inner_lies_within_and_outer_around(seed):
    rng = random.Random(seed)
    region = _drawn(rng, 2)
    xy = np.random.default_rng(seed).uniform(-12, 12, (2000, 2))
    truth = contains_many(region, xy)
    for side in ("inner", "outer"):
        whole = shapes.union_all(outline(region, BOUNDS, side))
        found = shapely.contains_xy(whole, xy)
        away = shapely.distance(shapely.boundary(whole), shapely.points(xy)) > 1e-6
        wrong = found & ~truth if side == "inner" else truth & ~found
        assert not (wrong & away).any()
        # no more is lost than what an arc is away from its chords
        assert (found != truth).mean() < 0.01


@pytest.mark.parametrize("angle", [0.1, 1.0, 3.0, 6.0, math.tau, 9.0])
@pytest.mark.parametrize("radius", [0.3, 20.0])
def test_the_same_area(angle, radius):
    found = sector_outline(Sector((3.0, -4.0), radius, 0.7, angle), "same area").area
    assert found == pytest.approx(min(angle, math.tau) * radius**2 / 2, rel=1e-9)
