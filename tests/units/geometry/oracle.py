"""Regions by the definition, point by point, with none of the code under test: the exact answers must agree with it."""

# pyright: basic

import math
from collections.abc import Iterator

import numpy as np
import shapely
from hypothesis import strategies as st
from numpy.typing import NDArray
from shapely.geometry import Polygon

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


def depth(region: Region, xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far points (n, 2) lie inside of a region: a lower bound if positive, minus one if negative."""
    x, y = xy[:, 0], xy[:, 1]
    match region:
        case Disc():
            return region.radius - np.hypot(x - region.center[0], y - region.center[1])
        case Sector():
            dx, dy = x - region.center[0], y - region.center[1]
            turn = np.abs((np.arctan2(-dx, dy) - region.heading + math.pi) % math.tau - math.pi)
            away = np.hypot(dx, dy)
            gap = region.angle / 2 - turn
            side = np.where(gap >= 0, 1.0, -1.0) * away * np.sin(np.minimum(np.abs(gap), math.pi / 2))
            return np.minimum(region.radius - away, np.full_like(x, np.inf) if region.angle >= math.tau else side)
        case Rectangle():
            cos, sin = math.cos(region.heading), math.sin(region.heading)
            dx, dy = x - region.center[0], y - region.center[1]
            aside, ahead = dx * cos + dy * sin, -dx * sin + dy * cos
            return np.minimum(region.width / 2 - np.abs(aside), region.length / 2 - np.abs(ahead))
        case PolygonSet():
            found = np.full(len(xy), -np.inf)
            for polygon in region.polygons:
                points = shapely.points(xy)
                away = shapely.distance(points, polygon.boundary)
                found = np.maximum(found, np.where(shapely.contains_xy(polygon, x, y), away, -away))
            return found
        case UnionOf():
            return np.max([depth(part, xy) for part in region.parts], axis=0)
        case IntersectionOf():
            return np.min([depth(part, xy) for part in region.parts], axis=0)
        case DifferenceOf():
            return np.minimum(depth(region.base, xy), -depth(region.removed, xy))
        case _:
            raise AssertionError(region)


def grid(bounds: tuple[float, float, float, float], step: float) -> NDArray[np.float64]:
    """Points (n, 2) over a box."""
    west, south, east, north = bounds
    xs, ys = np.meshgrid(np.arange(west, east + step, step), np.arange(south, north + step, step))
    return np.stack([xs.ravel(), ys.ravel()], axis=1)


coordinate = st.integers(-40, 40).map(lambda n: n / 4)
point = st.tuples(coordinate, coordinate)
size = st.integers(1, 32).map(lambda n: n / 4)
heading = st.floats(-4, 4)


@st.composite
def polygons(draw: st.DrawFn) -> Polygon:
    """Star-shaped polygons, some with a hole."""
    x, y = draw(point)
    count = draw(st.integers(3, 8))
    radii = [draw(size) + 0.5 for _ in range(count)]
    turn = draw(heading)
    ring = [(turn + math.tau * i / count, radius) for i, radius in enumerate(radii)]
    outline = [(x + radius * math.cos(angle), y + radius * math.sin(angle)) for angle, radius in ring]
    shell = Polygon(outline)
    if draw(st.booleans()) and count >= 4:
        hole = [(x + radius * math.cos(angle) * 0.4, y + radius * math.sin(angle) * 0.4) for angle, radius in ring]
        holed = Polygon(outline, [hole])
        return holed if holed.is_valid else shell
    return shell if shell.is_valid else Polygon([(x, y), (x + 1, y), (x, y + 1)])


def simple_regions() -> st.SearchStrategy[Region]:
    """Regions that are no combination."""
    return st.one_of(
        st.builds(Disc, point, size),
        st.builds(Sector, point, size, heading, st.floats(0.2, 7.0)),
        st.builds(Rectangle, point, heading, size, size),
        st.builds(lambda found: PolygonSet(tuple(found), "polygons"), st.lists(polygons(), min_size=1, max_size=3)),
    )


def regions() -> st.SearchStrategy[Region]:
    """Any regions with an area, and combinations of them."""
    return st.recursive(
        simple_regions(),
        lambda inner: st.one_of(
            st.builds(lambda a, b: UnionOf((a, b)), inner, inner),
            st.builds(lambda a, b: IntersectionOf((a, b)), inner, inner),
            st.builds(DifferenceOf, inner, inner),
        ),
        max_leaves=4,
    )


def circle_points(x: float, y: float, radius: float) -> Iterator[tuple[float, float]]:
    """Points that fill a disc."""
    for away in np.linspace(0, radius, 12):
        for angle in np.linspace(0, math.tau, 60):
            yield x + away * math.cos(angle), y + away * math.sin(angle)
