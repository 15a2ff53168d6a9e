"""Triangles and convex cells tile the polygons that they come from."""

# pyright: basic

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Polygon, box

from scenicq.geometry.cells import convex_cells, triangles
from scenicq.geometry.regions import Disc, PolygonSet, Rectangle, difference, intersection, union

from . import oracle

ALL = (-100.0, -100.0, 100.0, 100.0)


def is_convex(corners: np.ndarray) -> bool:
    ahead = np.roll(corners, -1, axis=0) - corners
    turns = ahead[:, 0] * np.roll(ahead[:, 1], -1) - ahead[:, 1] * np.roll(ahead[:, 0], -1)
    return bool((turns >= -1e-9).all())


@settings(max_examples=150, deadline=None)
@given(oracle.polygons(), st.floats(0, 6.6e5))
def test_cells_tile_a_polygon(polygon: Polygon, offset: float) -> None:
    polygon = shapely.transform(polygon, lambda xy: xy + offset)
    region = PolygonSet((polygon,), "polygon")
    bounds = polygon.bounds
    for cells in (triangles(region, bounds), convex_cells(region, bounds)):
        assert all(is_convex(cell) for cell in cells)
        assert all(Polygon(cell).exterior.is_ccw for cell in cells)
        total = sum(Polygon(cell).area for cell in cells)
        assert total == pytest.approx(polygon.area, rel=1e-6)
        assert shapely.union_all([Polygon(cell) for cell in cells]).symmetric_difference(polygon).area < 1e-5
    assert len(convex_cells(region, bounds)) <= len(triangles(region, bounds))


def test_a_convex_polygon_is_one_cell() -> None:
    circle = Polygon([(math.cos(i / 5), math.sin(i / 5)) for i in range(31)])
    assert len(convex_cells(PolygonSet((circle,), "circle"), ALL)) == 1
    corner = Polygon([(0, 0), (4, 0), (4, 1), (1, 1), (1, 4), (0, 4)])
    assert len(convex_cells(PolygonSet((corner,), "corner"), ALL)) == 2


def test_only_polygons_near_the_bounds() -> None:
    region = PolygonSet((box(0, 0, 1, 1), box(50, 50, 51, 51)), "two")
    assert {tuple(cell.min(axis=0)) for cell in convex_cells(region, (-1, -1, 2, 2))} == {(0.0, 0.0)}
    assert triangles(region, (10, 10, 20, 20)) == []
    assert convex_cells(Rectangle((0, 0), 0.3, 1, 2), (10, 10, 20, 20)) == []


def test_combinations_are_cut() -> None:
    left, right = PolygonSet((box(0, 0, 2, 2),), "left"), Rectangle((2, 1), 0, 2, 2)
    for region, area in ((intersection(left, right), 2), (difference(left, right), 2), (union(left, right), 8)):
        assert sum(Polygon(cell).area for cell in convex_cells(region, ALL)) == pytest.approx(area)


def test_discs_are_refused() -> None:
    with pytest.raises(ValueError, match="not polygonal"):
        triangles(Disc((0, 0), 1), ALL)
