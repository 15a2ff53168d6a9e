"""The direction of traffic as a vector field (`roadDirection` of Scenic's driving domain).

At a point it is the direction of the nearest segment of the centreline of the lane that holds it. Where lanes overlap,
each gives a direction of its own: Scenic takes that of the first in its lists. Off all lanes, the nearest lane within
20 m counts. What ties within a nanometre is all allowed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from shapely import LineString, STRtree

from scenicq.budget import look
from scenicq.geometry import shapes
from scenicq.geometry.angles import heading_of_array
from scenicq.geometry.cell_guards import Guard, Nearer, Off, Within, segment_distances
from scenicq.geometry.cells import joined_boxes
from scenicq.geometry.fields import FieldCell
from scenicq.geometry.road_cells import Outline, convex_outlines, segment_cells
from scenicq.geometry.shapes import Bounds, Coordinates, Shape

__all__ = ["ONE_HEADING", "DirectedLane", "RoadDirection", "along_lines", "distinct_pairs"]

REACH = 20.0
"""Metres within which a point off all lanes takes the direction of the nearest one."""
_TIE = 1e-9
_BESIDE = 0.01
"""Metres beside a polyline that count as on it."""
_CHUNK = 20_000
_MARGIN = 0.01
"""Metres by which a box of cells is grown."""
_DIGITS = 9
"""Of a radian, to which headings are one."""
ONE_HEADING = 1e-6
"""Radians by which a heading that was worked with may be off."""
_GRID = 0.5
"""Metres: boxes are grown to a grid of this width where it is remembered whether lanes cover them."""
_LARGEST, _SMALLEST = 16.0, 2.0
"""Metres: sides of the squares that cover the surroundings of lanes, at first and where they are no longer split."""


@dataclass(frozen=True, slots=True, eq=False)
class DirectedLane:
    """A lane as the field sees it.

    Attributes:
        area: Its polygon.
        centerline: Polylines (n, 2) in the direction of travel; segments of no length are skipped.
    """

    area: Shape
    centerline: tuple[Coordinates, ...]


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
class RoadDirection:
    """The direction of traffic on some lanes; see the module.

    Attributes:
        lanes: The lanes; those without a segment have no direction and are passed over.
        name: What messages call the field.
    """

    lanes: tuple[DirectedLane, ...] = field(repr=False)
    name: str = "roadDirection"

    @property
    def is_nowhere(self) -> bool:
        """Whether no lane has a direction."""
        return not any(len(_segments(lane.centerline)) for lane in self.lanes)

    @property
    def reach(self) -> tuple[Sequence[Shape], float]:
        """The lanes that have a direction, and how far around them there is a heading, in metres."""
        return [area for area, _ in self._directed], REACH

    def values(self, x: float, y: float) -> tuple[float, ...]:
        """The headings allowed at a point, in (-pi, pi]; none where the field is undefined."""
        segments, headings, starts = self._all
        if len(segments):
            lanes: list[int] = shapes.tree_within(self._tree, shapes.point(x, y), _TIE).tolist()
            if len(lanes) == 1:
                # most places, one at a time: a third of the time
                own = slice(starts[lanes[0]], starts[lanes[0] + 1])
                away = segment_distances(np.array((x, y)), segments[own])
                return tuple(sorted({*headings[own][away <= away.min() + _TIE].tolist()}))
        return self._values(np.array([(x, y)], dtype=float))[0]

    def values_many(self, xy: Coordinates) -> list[tuple[float, ...]]:
        """`values` for points of shape (n, 2)."""
        return [value for start in range(0, len(xy), _CHUNK) for value in self._values(xy[start : start + _CHUNK])]

    def forward(self, line: LineString) -> LineString:
        """The line, turned around if most of it runs against the traffic beside it."""
        corners = shapes.coordinates(line)
        along, middle = corners[1:] - corners[:-1], (corners[1:] + corners[:-1]) / 2
        agreement = 0.0
        for (dx, dy), headings in zip(along.tolist(), self.values_many(middle), strict=True):
            if len(headings) == 1:
                agreement += dy * math.cos(headings[0]) - dx * math.sin(headings[0])
        return line if agreement >= 0 else line.reverse()

    def headings(self, boxes: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Pairs (box, heading) that hold every heading somewhere in each of some boxes, see `VectorField`."""
        found = [(np.empty(0, dtype=np.intp), np.empty(0))]
        for start in range(0, len(boxes), _CHUNK):
            owner, heading = self._headings(boxes[start : start + _CHUNK])
            found.append((owner + start, heading))
        return np.concatenate([owner for owner, _ in found]), np.concatenate([heading for _, heading in found])

    def cells(self, bounds: Bounds) -> list[FieldCell]:
        """Convex cells that hold every (point, heading) within the bounds; those of lanes stay whole."""
        return self._cells_near(bounds, None)

    def cells_of(self, heading: float, bounds: Bounds) -> list[FieldCell]:
        """Those of one heading, and perhaps others off the lanes: cells of other segments need not be made."""
        return self._cells_near(bounds, heading)

    def _cells_near(self, bounds: Bounds, heading: float | None) -> list[FieldCell]:
        box = shapes.box(*bounds)
        near = np.sort(shapes.tree_query(self._tree, box)).tolist()
        return [cell for lane in near for cell in self._lane_cells(lane, bounds, heading)] + self._surroundings(bounds)

    @cached_property
    def _directed(self) -> tuple[tuple[Shape, NDArray[np.float64]], ...]:
        """Areas and segments (n, 4) of the lanes that have a direction."""
        pairs = [(lane.area, _segments(lane.centerline)) for lane in self.lanes]
        return tuple((area, segments) for area, segments in pairs if len(segments))

    @cached_property
    def _areas(self) -> NDArray[np.object_]:
        return shapes.prepared([area for area, _ in self._directed])

    @cached_property
    def _tree(self) -> STRtree:
        return STRtree(self._areas)

    @cached_property
    def _all(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.intp]]:
        """Segments of all lanes, their headings, and where each lane's begin (with the end of the last)."""
        segments = np.concatenate([np.empty((0, 4)), *(segments for _, segments in self._directed)])
        along = segments[:, 2:] - segments[:, :2]
        starts = np.cumsum([0, *(len(segments) for _, segments in self._directed)])
        return segments, heading_of_array(along[:, 0], along[:, 1]), starts

    @cached_property
    def _distinct(self) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """The headings of all segments in order, rounded, and which of them each segment has."""
        distinct, number = np.unique(np.round(self._all[1], _DIGITS), return_inverse=True)
        return distinct, number.astype(np.intp)

    @cached_property
    def _cells_of(self) -> dict[tuple[int, int], list[FieldCell]]:
        """Of each lane and segment that were asked for."""
        return {}

    @cached_property
    def _outlines(self) -> dict[int, list[Outline]]:
        """Of each lane that was asked for the convex pieces."""
        return {}

    def _values(self, xy: Coordinates) -> list[tuple[float, ...]]:
        segments, headings, starts = self._all
        if not len(segments):
            return [()] * len(xy)
        point, lane = self._lanes_within(xy, np.full(len(xy), _TIE))
        lanes = np.bincount(point, minlength=len(xy))
        off = np.nonzero(lanes == 0)[0]
        if len(off):
            off_point, off_lane = self._nearest_lanes(xy[off])
            point = np.concatenate([point, off[off_point]])
            lane = np.concatenate([lane, off_lane])
        counts = starts[lane + 1] - starts[lane]
        pair = np.repeat(np.arange(len(lane)), counts)
        segment = np.arange(len(pair)) - np.repeat(np.cumsum(counts) - counts, counts) + starts[lane][pair]
        away = segment_distances(xy[point[pair]], segments[segment])
        best = np.full(len(lane), np.inf)
        np.minimum.at(best, pair, away)
        chosen = np.nonzero(away <= best[pair] + _TIE)[0]
        owner, heading = distinct_pairs(point[pair[chosen]], headings[segment[chosen]])
        values: list[float] = heading.tolist()
        ends: list[int] = np.searchsorted(owner, np.arange(len(xy) + 1)).tolist()
        return [tuple(values[first:end]) for first, end in pairwise(ends)]

    def _headings(self, boxes: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        segments, _, starts = self._all
        middle = (boxes[:, :2] + boxes[:, 2:]) / 2
        radius = np.hypot(*(boxes[:, 2:] - boxes[:, :2]).T) / 2 + _TIE
        # inside of a lane only those that reach in can count, elsewhere those that may be the nearest
        inside = np.zeros(len(boxes), dtype=bool)
        box, lane = self._lanes_within(middle, radius)
        held = shapes.covers_many(self._areas[lane], shapes.boxes(boxes[box]))
        inside[box[held]] = True
        outer = np.nonzero(~inside)[0]
        if len(outer):
            far, other = self._lanes_within(middle[outer], REACH + radius[outer])
            away = shapes.distances(shapes.points(middle[outer])[far], self._areas[other])
            least = np.full(len(outer), np.inf)
            np.minimum.at(least, far, away)
            near = away <= least[far] + 2 * radius[outer][far] + _TIE
            kept = inside[box]
            box, lane = np.concatenate([box[kept], outer[far[near]]]), np.concatenate([lane[kept], other[near]])
        counts = starts[lane + 1] - starts[lane]
        pair = np.repeat(np.arange(len(lane)), counts)
        segment = np.arange(len(pair)) - np.repeat(np.cumsum(counts) - counts, counts) + starts[lane][pair]
        gap = segment_distances(middle[box[pair]], segments[segment])
        best = np.full(len(lane), np.inf)
        np.minimum.at(best, pair, gap)
        chosen = gap <= best[pair] + 2 * radius[box[pair]] + _TIE
        distinct, number = self._distinct
        # as one whole number a pair is found once much sooner than as two fractions
        found = np.sort(box[pair[chosen]] * len(distinct) + number[segment[chosen]])
        found = found[np.diff(found, prepend=-1) != 0]
        return found // max(1, len(distinct)), distinct[found % max(1, len(distinct))]

    def _lanes_within(self, xy: Coordinates, reach: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Pairs (point, lane) that are within reach of each other; shapes (n, 2) and (n,)."""
        point, lane = shapes.tree_pairs_around(self._tree, xy, reach[:, None])
        near = shapes.within_many(self._areas[lane], shapes.points(xy)[point], reach[point])
        return point[near], lane[near]

    def _nearest_lanes(self, xy: Coordinates) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Pairs (point, lane) of the lanes within reach that are nearest, ties included."""
        # all distances at once take a third of the time of a search for the nearest, point by point
        point, lane = shapes.tree_pairs_around(self._tree, xy, REACH)
        away = shapes.distances(shapes.points(xy)[point], self._areas[lane])
        least = np.full(len(xy), np.inf)
        np.minimum.at(least, point, away)
        nearest = (least[point] <= REACH) & (away <= least[point] + _TIE)
        return point[nearest], lane[nearest]

    def _lane_cells(self, lane: int, bounds: Bounds, heading: float | None) -> Iterator[FieldCell]:
        """The cells of a lane's segments, or those of a heading, that can be the nearest of it within the bounds."""
        _, headings, starts = self._all
        area, segments = self._directed[lane]
        west, south, east, north = bounds
        gap = segment_distances(np.array([(west + east) / 2, (south + north) / 2]), segments)
        near = gap <= gap.min() + math.hypot(east - west, north - south) + _TIE
        if heading is not None:
            near &= np.abs(headings[starts[lane] : starts[lane + 1]] - heading) <= ONE_HEADING
        for index in np.nonzero(near)[0].tolist():
            found = self._cells_of.get((lane, index))
            if found is None:
                if lane not in self._outlines:
                    self._outlines[lane] = convex_outlines(area)
                own = headings[starts[lane] : starts[lane + 1]]
                found = self._cells_of[lane, index] = segment_cells(self._outlines[lane], segments, own, index)
            yield from found

    def _surroundings(self, bounds: Bounds) -> list[FieldCell]:
        """Squares over what lies off the lanes, split until one heading is left or they are small."""
        # a box without width would count as covered by the lanes that it touches
        west, south, east, north = bounds[0] - _MARGIN, bounds[1] - _MARGIN, bounds[2] + _MARGIN, bounds[3] + _MARGIN
        if self._on_lanes(west, south, east, north):
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
        """Of each box of the grid that was asked for, whether lanes cover it."""
        return {}

    def _on_lanes(self, west: float, south: float, east: float, north: float) -> bool:
        """Whether lanes surely cover a box; of large ones nothing is said."""
        if max(east - west, north - south) > _SMALLEST:
            return False
        # thousands of boxes that differ by little are asked for, as points are narrowed
        low, high = np.floor(np.array((west, south)) / _GRID) * _GRID, np.ceil(np.array((east, north)) / _GRID) * _GRID
        grown: Bounds = (*low.tolist(), *high.tolist())
        known = self._covered.get(grown)
        if known is None:
            box = shapes.box(*grown)
            lanes: list[int] = np.sort(shapes.tree_query(self._tree, box)).tolist()
            known = bool(lanes) and shapes.difference(box, self._union(lanes)).area <= 0
            self._covered[grown] = known
        return known

    def _near(self, square: Bounds) -> list[_Candidate]:
        """The lanes that may be nearest to a point of a square off the lanes."""
        look()
        west, south, east, north = square
        x, y = (west + east) / 2, (south + north) / 2
        center, radius = shapes.point(x, y), float(np.hypot(east - west, north - south)) / 2
        lanes = shapes.tree_within(self._tree, center, REACH + radius)
        if not len(lanes):
            return []
        away = shapes.distances(self._areas[lanes], center)
        near = lanes[away <= away.min() + 2 * radius + _TIE]
        if away.min() <= radius:
            touching: list[int] = lanes[away <= radius].tolist()
            if shapes.difference(shapes.box(*square), self._union(touching)).area <= 0:
                return []
        sure = bool(away.min() + radius <= REACH)
        segments, headings, starts = self._all
        found: list[_Candidate] = []
        for lane in near.tolist():
            own = slice(starts[lane], starts[lane + 1])
            gaps = segment_distances(np.array((x, y)), segments[own])
            by_heading: dict[float, list[int]] = {}
            for index in np.nonzero(gaps <= gaps.min() + 2 * radius + _TIE)[0].tolist():
                by_heading.setdefault(float(headings[own][index]), []).append(index)
            found.append(_Candidate(lane, by_heading, sure))
        return found

    def _union(self, lanes: Sequence[int]) -> Shape:
        return shapes.union_all([self._directed[lane][0] for lane in lanes])

    def _guarded(self, square: Bounds, near: Sequence[_Candidate]) -> list[FieldCell]:
        """A square where several headings are possible, once for each lane and heading, with what decides."""
        corners, box = _corners(square), shapes.box(*square)
        edges = {each.lane: shapes.edges(self._directed[each.lane][0]) for each in near}
        off = [Off(area) for lane in edges if shapes.distance(area := self._directed[lane][0], box) <= 0]
        cells: list[FieldCell] = []
        for each in near:
            lane, by_heading = each.lane, each.segments
            rivals = [edges[other] for other in edges if other != lane]
            common: list[Guard] = [*off]
            if rivals:
                common.append(Nearer(edges[lane], np.concatenate(rivals)))
            if not each.sure:
                common.append(Within(edges[lane], REACH))
            segments = self._directed[lane][1]
            for heading, own in by_heading.items():
                others = [index for key, indices in by_heading.items() if key != heading for index in indices]
                guards = [*common, *([Nearer(segments[own], segments[others])] if others else [])]
                cell = FieldCell(corners, heading, tuple(guards)).part(square)
                if cell is not None:
                    cells.append(cell)
        return cells


def distinct_pairs(
    owner: NDArray[np.intp], heading: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Pairs (owner, heading) in order, each once; shapes (n,)."""
    order = np.lexsort((heading, owner))
    owner, heading = owner[order], heading[order]
    again = (owner[1:] == owner[:-1]) & (heading[1:] == heading[:-1])
    kept = np.concatenate([[True], ~again])[: len(owner)]
    return owner[kept], heading[kept]


def _corners(box: Bounds) -> NDArray[np.float64]:
    west, south, east, north = box
    return np.array([(west, south), (east, south), (east, north), (west, north)])


def _segments(lines: Sequence[Coordinates]) -> NDArray[np.float64]:
    """Segments (n, 4) of positive length."""
    pairs = [np.concatenate([line[:-1], line[1:]], axis=1) for line in lines if len(line) > 1]
    segments = np.concatenate([np.empty((0, 4)), *pairs])
    return segments[np.any(segments[:, :2] != segments[:, 2:], axis=1)]


def along_lines(lines: Sequence[Shape], name: str) -> RoadDirection:
    """The field that follows polylines: at a point the direction of the nearest segment."""
    parts = shapes.simple_parts(lines)
    bands = tuple(DirectedLane(shapes.band(part, _BESIDE), (shapes.coordinates(part),)) for part in parts)
    return RoadDirection(bands, name=name)
