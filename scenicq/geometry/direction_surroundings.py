"""The direction of traffic off all lanes, as convex cells: squares that are split until one heading is left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import look
from scenicq.geometry import shapes
from scenicq.geometry.cell_guards import Guard, NearestSegment, OutsidePolygon, Within, segment_distances
from scenicq.geometry.cells import joined_boxes
from scenicq.geometry.directed_areas import TIE, DirectedAreas
from scenicq.geometry.fields import FieldCell
from scenicq.geometry.shapes import Bounds, Shape

__all__ = ["OffLanes"]

_MARGIN = 0.01
"""Metres by which a box of cells is grown."""
_GRID = 0.5
"""Metres: boxes are grown to a grid of this width where it is remembered whether lanes cover them."""
_LARGEST, _SMALLEST = 16.0, 2.0
"""Metres: sides of the squares that cover the surroundings of lanes, at first and where they are no longer split."""


@dataclass(frozen=True, slots=True)
class _Candidate:
    """A lane that may be nearest to some point of a square.

    Attributes:
        lane: Its number.
        segments: Those of its segments that may then be nearest, by heading.
        sure: Whether all of the square is near enough to some lane to have a heading.
    """

    lane: int
    segments: dict[float, list[int]]
    sure: bool


@dataclass(frozen=True, eq=False)
class OffLanes:
    """What counts off some areas.

    Attributes:
        lanes: The lanes, of which the nearest one counts.
        beside: What else has directions of its own.
        elsewhere: What counts in place of the nearest lane, if it has anything.
        farthest: Metres within which the nearest lane counts.
    """

    lanes: DirectedAreas
    beside: DirectedAreas
    elsewhere: DirectedAreas
    farthest: float

    def cells(self, bounds: Bounds) -> list[FieldCell]:
        """Cells that hold every (point, heading) off the areas within the bounds."""
        # a box without width would count as covered by the lanes that it touches
        west, south, east, north = bounds[0] - _MARGIN, bounds[1] - _MARGIN, bounds[2] + _MARGIN, bounds[3] + _MARGIN
        if self._is_covered(west, south, east, north):
            return []
        columns, rows = (max(1, int(np.ceil(span / _LARGEST))) for span in (east - west, north - south))
        xs, ys = np.linspace(west, east, columns + 1).tolist(), np.linspace(south, north, rows + 1).tolist()
        todo = [(xs[i], ys[j], xs[i + 1], ys[j + 1]) for i in range(columns) for j in range(rows)]
        found_in: dict[float, list[Bounds]] = {}
        guarded: list[FieldCell] = []
        while todo:
            square = todo.pop()
            west, south, east, north = square
            near = self._near(square)
            headings = {heading for each in near for heading in each.segments}
            if len(headings) > 1 and max(east - west, north - south) > _SMALLEST:
                x, y = (west + east) / 2, (south + north) / 2
                todo += [(west, south, x, y), (x, south, east, y), (x, y, east, north), (west, y, x, north)]
            elif len(headings) == 1 and all(each.sure for each in near):
                found_in.setdefault(headings.pop(), []).append(square)
            else:
                guarded += self._guarded(square, near)
        plain = [(heading, box) for heading, squares in found_in.items() for box in joined_boxes(squares)]
        return [FieldCell(_corners(box), heading) for heading, box in plain] + guarded

    @cached_property
    def _covered(self) -> dict[Bounds, bool]:
        """Whether areas cover each box of the grid that was asked for."""
        return {}

    def _is_covered(self, west: float, south: float, east: float, north: float) -> bool:
        """Whether areas surely cover a box; of large ones nothing is said."""
        if max(east - west, north - south) > _SMALLEST:
            return False
        # thousands of boxes that differ by little are asked for, as points are narrowed
        low, high = np.floor(np.array((west, south)) / _GRID) * _GRID, np.ceil(np.array((east, north)) / _GRID) * _GRID
        grown: Bounds = (*low.tolist(), *high.tolist())
        known = self._covered.get(grown)
        if known is None:
            box = shapes.box(*grown)
            areas = [each for _, each in self._within(box, 0.0)]
            known = bool(areas) and shapes.difference(box, shapes.union_all(areas)).area <= 0
            self._covered[grown] = known
        return known

    def _within(self, shape: Shape, reach: float) -> list[tuple[DirectedAreas, Shape]]:
        """The areas within reach of a shape, those of lanes first."""
        found: list[tuple[DirectedAreas, Shape]] = []
        for areas in (self.lanes, self.beside):
            numbers: list[int] = np.sort(shapes.tree_within(areas.tree, shape, reach)).tolist()
            found += [(areas, areas.directed[number][0]) for number in numbers]
        return found

    def _near(self, square: Bounds) -> list[_Candidate]:
        """What may count at a point of a square off the areas: the nearest lanes, or the line that does elsewhere."""
        look()
        west, south, east, north = square
        x, y = (west + east) / 2, (south + north) / 2
        center, radius = shapes.point(x, y), float(np.hypot(east - west, north - south)) / 2
        touching = [area for _, area in self._within(center, radius)]
        if touching and shapes.difference(shapes.box(*square), shapes.union_all(touching)).area <= 0:
            return []
        if len(self.elsewhere):
            return [self._candidate(self.elsewhere, 0, (x, y), radius, sure=not touching)]
        lanes = shapes.tree_within(self.lanes.tree, center, self.farthest + radius)
        if not len(lanes):
            return []
        away = shapes.distances(self.lanes.areas[lanes], center)
        near = lanes[away <= away.min() + 2 * radius + TIE]
        sure = bool(away.min() + radius <= self.farthest) and not any(
            areas is self.beside for areas, _ in self._within(center, radius)
        )
        return [self._candidate(self.lanes, lane, (x, y), radius, sure=sure) for lane in near.tolist()]

    def _candidate(
        self, areas: DirectedAreas, lane: int, middle: tuple[float, float], radius: float, *, sure: bool
    ) -> _Candidate:
        segments, headings, starts = areas.segments
        own = slice(starts[lane], starts[lane + 1])
        gaps = segment_distances(np.array(middle), segments[own])
        by_heading: dict[float, list[int]] = {}
        for index in np.nonzero(gaps <= gaps.min() + 2 * radius + TIE)[0].tolist():
            by_heading.setdefault(float(headings[own][index]), []).append(index)
        return _Candidate(lane, by_heading, sure)

    def _guarded(self, square: Bounds, near: Sequence[_Candidate]) -> list[FieldCell]:
        """A square where several headings are possible, once for each lane and heading, with what decides."""
        corners, box = _corners(square), shapes.box(*square)
        off = [OutsidePolygon(area) for _, area in self._within(box, 0.0)]
        nearest = self.lanes if not len(self.elsewhere) else self.elsewhere
        edges = {} if nearest is self.elsewhere else {each.lane: shapes.edges(self._area(each.lane)) for each in near}
        cells: list[FieldCell] = []
        for each in near:
            lane, by_heading = each.lane, each.segments
            rivals = [edges[other] for other in edges if other != lane]
            common: list[Guard] = [*off]
            if rivals:
                common.append(NearestSegment(edges[lane], np.concatenate(rivals)))
            if edges and not each.sure:
                common.append(Within(edges[lane], self.farthest))
            segments = nearest.directed[lane][1]
            for heading, own in by_heading.items():
                others = [index for key, indices in by_heading.items() if key != heading for index in indices]
                guards = [*common, *([NearestSegment(segments[own], segments[others])] if others else [])]
                cell = FieldCell(corners, heading, tuple(guards)).part(square)
                if cell is not None:
                    cells.append(cell)
        return cells

    def _area(self, lane: int) -> Shape:
        return self.lanes.directed[lane][0]


def _corners(box: Bounds) -> NDArray[np.float64]:
    west, south, east, north = box
    return np.array([(west, south), (east, south), (east, north), (west, north)])
