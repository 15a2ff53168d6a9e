"""Random points in sectors and in what lies in them: linear programs agree with plain membership."""

from __future__ import annotations

import math

import numpy as np
import pytest
from comparisons import c, compared
from shapely import LineString

from scenicq.errors import CannotEvaluate
from scenicq.forest.nodes import PointIn
from scenicq.geometry.membership import contains
from scenicq.geometry.regions import IntersectionOf, PolylineSet, Sector
from scenicq.match.linear.linear_relaxation import solve_affine
from scenicq.match.tolerance import parse_tolerance

NEAR = parse_tolerance("position=0.01")
ANGLES = [0.0, 0.4, math.pi / 2, math.pi, 4.0, 6.0, math.tau, 7.0]


def answer(region, place):
    """Whether a point of the region lies at a place: None where the linear programs do not tell."""
    try:
        return solve_affine([compared("position", PointIn(c(region)), place)], [], NEAR) is not None
    except CannotEvaluate:
        return None


@pytest.mark.parametrize("angle", ANGLES)
def test_a_point_in_a_sector_is_found_where_the_sector_is(angle):
    drawn = np.random.default_rng(17)
    sector = Sector((3.0, -2.0), 10.0, 0.7, angle)
    told = 0
    for x, y in drawn.uniform(-15, 20, (60, 2)).tolist():
        close = [contains(sector, x + dx, y + dy) for dx in (-0.02, 0, 0.02) for dy in (-0.02, 0, 0.02)]
        if any(close) != all(close):
            continue  # at the edge the tolerance decides
        found = answer(sector, (x, y))
        assert found in (None, all(close)), (x, y)
        told += found is not None
    assert told > 50


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.one_in(2)
def test_a_point_of_a_line_in_a_sector_is_found_where_both_are(angle):
    line = PolylineSet((LineString([(-12, -9), (4, 1), (9, 14)]),), "line", None)
    sector = Sector((0.0, 0.0), 12.0, -0.8, angle)
    region = IntersectionOf((line, sector))
    points = [line.lines[0].interpolate(share, normalized=True).coords[0] for share in np.linspace(0.013, 0.987, 40)]
    told = 0
    for x, y in points:
        close = [contains(sector, x + dx, y + dy) for dx in (-0.02, 0, 0.02) for dy in (-0.02, 0, 0.02)]
        if any(close) != all(close):
            continue
        found = answer(region, (x, y))
        assert found in (None, all(close)), (x, y)
        told += found is not None
        assert answer(region, (x + 1, y - 1)) is not True
    assert told > 25
