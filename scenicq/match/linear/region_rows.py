"""Regions as linear facts about a point: one set of rows for each convex piece, polygons for discs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from scenicq.geometry.cells import convex_cells
from scenicq.geometry.membership import parts_near
from scenicq.geometry.regions import PointSet, PolygonSet, PolylineSet, Rectangle, Region, Sector, UnionOf
from scenicq.limits import LIMITS
from scenicq.match.linear.affine_forms import Affine, AffineVector
from scenicq.match.linear.linear_program import Row, not_linear

__all__ = ["Alternative", "disc_rows", "polygon_rows", "region_rows", "sector_rows"]

_SIDES = 32
"""Corners of the polygons around and inside a disc."""

Alternative = list[list[Row]]
"""Sets of linear facts, one of which holds."""


def polygon_rows(place: AffineVector, polygon: np.ndarray) -> list[Row]:
    """Rows that keep a point in a convex polygon whose corners run counter-clockwise."""
    rows: list[Row] = []
    x, y = place
    for (ax, ay), (bx, by) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        length = math.hypot(bx - ax, by - ay)
        if length > 0:
            nx, ny = (by - ay) / length, (ax - bx) / length
            side = x.times(nx).plus(y, ny).plus(Affine(float(nx * ax + ny * ay), {}), -1.0)
            rows.append(Row(side, -math.inf, 0.0))
    return rows


def sector_rows(away: AffineVector, sector: Sector) -> Alternative:
    """Rows that keep a vector from the apex between the edges of a sector; two sets of them beyond half a turn."""
    if sector.angle >= math.tau:
        return [[]]
    if sector.angle < 0:
        return []
    x, y = away

    def along(heading: float) -> Affine:
        return x.times(-math.sin(heading)).plus(y, math.cos(heading))

    half, turn = sector.angle / 2, math.pi / 2
    # left of the right edge, right of the left edge
    edges = [
        Row(along(sector.heading - half + turn), 0.0, math.inf),
        Row(along(sector.heading + half - turn), 0.0, math.inf),
    ]
    return (
        [[*edges, Row(along(sector.heading), 0.0, math.inf)]] if sector.angle <= math.pi else [[row] for row in edges]
    )


def region_rows(region: Region, limits: tuple[float, float, float, float], place: AffineVector) -> Alternative:
    """One set of rows for each convex piece of a region near a box.

    Args:
        region: The region.
        limits: West, south, east and north end of the box.
        place: The point that is in the region.

    Raises:
        CannotEvaluate: The region has too many pieces there, or none that are convex.
    """
    x, y = place
    found: Alternative = []
    for part in parts_near(region, limits) if isinstance(region, UnionOf) else (region,):
        match part:
            case PolygonSet() | Rectangle():
                cells = [cell for cell in convex_cells(part, limits) if _near(cell, limits)]
                found += [polygon_rows(place, cell) for cell in cells]
            case PolylineSet():
                for start, end in _segments(part, limits):
                    found.append(_on_segment(place, start, end))
            case PointSet():
                for px, py in shapely.get_coordinates(part.near(limits)).tolist():
                    found.append([Row(x, px, px), Row(y, py, py)])
            case _:
                raise not_linear()
        if len(found) > LIMITS.linear_cells:
            raise not_linear()
    return found


def _near(corners: np.ndarray, limits: tuple[float, float, float, float]) -> bool:
    low, high = corners.min(axis=0), corners.max(axis=0)
    west, south, east, north = limits
    return bool(low[0] <= east and high[0] >= west and low[1] <= north and high[1] >= south)


def _segments(lines: PolylineSet, limits: tuple[float, float, float, float]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    for piece in lines.near(limits):
        corners = shapely.get_coordinates(piece)
        for start, end in itertools.pairwise(corners):
            if _near(np.array((start, end)), limits):
                yield start, end


def _on_segment(place: AffineVector, start: np.ndarray, end: np.ndarray) -> list[Row]:
    x, y = place
    length = float(np.hypot(*(end - start)))
    if length == 0:
        return [Row(x, float(start[0]), float(start[0])), Row(y, float(start[1]), float(start[1]))]
    ux, uy = (float(part) for part in (end - start) / length)
    across = float(start[0] * -uy + start[1] * ux)
    along = float(start[0] * ux + start[1] * uy)
    return [Row(x.times(-uy).plus(y, ux), across, across), Row(x.times(ux).plus(y, uy), along, along + length)]


def disc_rows(discs: Sequence[tuple[Affine, Affine, float]], *, outer: bool) -> Iterator[Row]:
    """Rows that keep vectors in a regular polygon around (outer) or inside their disc."""
    for x, y, radius in discs:
        reach = radius if outer else radius * math.cos(math.pi / _SIDES)
        for side in range(_SIDES):
            angle = math.tau * side / _SIDES
            yield Row(x.times(math.cos(angle)).plus(y, math.sin(angle)), -math.inf, reach)
