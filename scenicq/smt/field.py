"""The direction of a vector field at a random point: one case per cell, with its guards."""

from __future__ import annotations

from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.nodes import ArithmeticOp
from scenicq.geometry.cell_guards import Guard, NearestSegment, OutsidePolygon, Segments, Within
from scenicq.geometry.cells import convex_parts, joined_boxes
from scenicq.geometry.fields import VectorField
from scenicq.geometry.shapes import Bounds, Shape, polygonal_part
from scenicq.geometry.terms import overlap
from scenicq.smt.distance_terms import squared_distance
from scenicq.smt.problem import Formula, Term
from scenicq.smt.region_membership import TermVector, convex_cell
from scenicq.smt.terms import apply, compare, conjunction, disjunction, negation

__all__ = ["field_cells"]

_ROUNDING = 1e-7
"""Metres beyond an edge that still count as on it."""


def field_cells(
    field: VectorField, point: TermVector, limits: Bounds, *, borders: bool = True
) -> list[tuple[float, Formula]]:
    """The headings that a field may have at a point, each with where it has it.

    Args:
        field: The field.
        point: The point.
        limits: Where the point can be; cells elsewhere are left out.
        borders: Whether the guards of cells that cover too much are encoded, too.
    """
    found: list[tuple[float, Formula]] = []
    boxes: dict[float, dict[Bounds, None]] = {}
    for cell in field.cells(limits):
        low, high = cell.polygon.min(axis=0).tolist(), cell.polygon.max(axis=0).tolist()
        shared = overlap(limits, (*low, *high))
        if shared[0] > shared[2] or shared[1] > shared[3] or _misses(cell.polygon, shared):
            continue
        part = cell.part(shared)
        if part is None:
            continue
        if not borders and _is_box(cell.polygon):
            boxes.setdefault(cell.heading, {})[*low, *high] = None
        else:
            guards = (_guard(guard, point) for guard in part.guards if borders)
            found.append((cell.heading, conjunction([convex_cell(point, cell.polygon), *guards])))
    for heading, squares in boxes.items():
        found += [(heading, convex_cell(point, _corners(box))) for box in joined_boxes(squares)]
    return found


def _corners(box: Bounds) -> NDArray[np.float64]:
    west, south, east, north = box
    return np.array([(west, south), (east, south), (east, north), (west, north)])


def _is_box(polygon: NDArray[np.float64]) -> bool:
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    return polygon.shape == (4, 2) and bool(((polygon == low) | (polygon == high)).all())


def _misses(polygon: NDArray[np.float64], box: Bounds) -> bool:
    """Whether a box lies beyond an edge of a convex polygon whose corners run counter-clockwise."""
    corners = _corners(box)
    along = np.roll(polygon, -1, axis=0) - polygon
    off = corners[None] - polygon[:, None]
    sides = along[:, None, 0] * off[..., 1] - along[:, None, 1] * off[..., 0]
    return bool((sides.max(axis=1) < -_ROUNDING * np.hypot(along[:, 0], along[:, 1])).any())


def _guard(guard: Guard, point: TermVector) -> Formula:
    match guard:
        case NearestSegment():
            return compare("<=", _least(point, guard.own), _least(point, guard.rivals))
        case OutsidePolygon():
            return negation(_inside(point, guard.area))
        case Within():
            return compare("<=", _least(point, guard.own), guard.reach**2)
        case _:
            assert_never(guard)


def _least(point: TermVector, segments: Segments) -> Term:
    """The square of the distance to the nearest of some segments: squares compare alike, and are polynomial."""
    return apply(ArithmeticOp.MIN, *(squared_distance(point, segment) for segment in segments.tolist()))


def _inside(point: TermVector, area: Shape) -> Formula:
    return disjunction(convex_cell(point, cell) for piece in polygonal_part(area) for cell in convex_parts(piece))
