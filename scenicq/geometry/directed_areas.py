"""Areas with the lines along which one goes in them: which hold a place, and how the nearest of their lines points."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from shapely import STRtree

from scenicq.geometry import shapes
from scenicq.geometry.angles import heading_of_array, rotate_array
from scenicq.geometry.cell_guards import segment_distances
from scenicq.geometry.fields import FieldCell
from scenicq.geometry.road_cells import Outline, convex_outlines, segment_cells
from scenicq.geometry.shapes import Bounds, Coordinates, Shape
from scenicq.number_ranges import expand_ranges

__all__ = ["ONE_HEADING", "TIE", "AreaPairs", "DirectedAreas", "DirectedLane", "distinct_pairs"]

TIE = 1e-9
"""Metres within which distances are the same."""
ONE_HEADING = 1e-6
"""Radians by which a heading that was worked with may be off."""
_DIGITS = 9
"""Digits of a radian to which headings are one."""

AreaPairs: TypeAlias = tuple[NDArray[np.intp], NDArray[np.intp]]
"""Numbers of places and of the areas that belong to them, shapes (n,)."""


@dataclass(frozen=True, slots=True, eq=False)
class DirectedLane:
    """A lane, or something else that one goes along, as fields see it.

    Attributes:
        area: Its polygon.
        centerline: Polylines (n, 2) in the direction of travel; segments of no length are skipped.
        margin: Metres around the polygon that count as in it.
    """

    area: Shape
    centerline: tuple[Coordinates, ...]
    margin: float = 0.0


@dataclass(frozen=True, eq=False)
class DirectedAreas:
    """Some areas under a search tree, without those that have no segment.

    Attributes:
        given: The areas, those without a segment too.
        taken: Where none of them counts.
    """

    given: tuple[DirectedLane, ...] = field(repr=False)
    taken: tuple[Shape, ...] = field(default=(), repr=False)

    def __len__(self) -> int:
        """How many there are that have a segment."""
        return len(self.directed)

    @cached_property
    def directed(self) -> tuple[tuple[Shape, NDArray[np.float64]], ...]:
        """Areas and segments (n, 4) of those that have a direction."""
        pairs = [(each, _segments(each.centerline)) for each in self.given]
        return tuple((self._area_of(each), segments) for each, segments in pairs if len(segments))

    def _area_of(self, one: DirectedLane) -> Shape:
        area = shapes.band(one.area, one.margin) if one.margin else one.area
        hits: list[int] = np.sort(shapes.tree_within(self._taken, area, 0.0)).tolist() if self.taken else []
        return shapes.difference(area, shapes.union_all([self.taken[hit] for hit in hits])) if hits else area

    @cached_property
    def _taken(self) -> STRtree:
        return STRtree(self.taken)

    @cached_property
    def areas(self) -> NDArray[np.object_]:
        """The areas, prepared."""
        return shapes.prepare([area for area, _ in self.directed])

    @cached_property
    def tree(self) -> STRtree:
        """Search tree over the areas."""
        return STRtree(self.areas)

    @cached_property
    def segments(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.intp]]:
        """Segments of all areas, their headings, and where each area's begin (with the end of the last)."""
        segments = np.concatenate([np.empty((0, 4)), *(segments for _, segments in self.directed)])
        along = segments[:, 2:] - segments[:, :2]
        starts = np.cumsum([0, *(len(segments) for _, segments in self.directed)])
        return segments, heading_of_array(along[:, 0], along[:, 1]), starts

    @cached_property
    def _segment_tree(self) -> STRtree:
        ends = self.segments[0].reshape(-1, 2, 2)
        return STRtree(shapes.boxes(np.concatenate([ends.min(axis=1), ends.max(axis=1)], axis=1)))

    @cached_property
    def _rounded(self) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """The headings of all segments in order, rounded, and which of them each segment has."""
        distinct, number = np.unique(np.round(self.segments[1], _DIGITS), return_inverse=True)
        return distinct, number.astype(np.intp)

    @cached_property
    def _neighbours(self) -> NDArray[np.intp]:
        """The segment before each in its area, and the one behind it; itself where there is none, (2, n)."""
        starts = self.segments[2]
        own = np.arange(int(starts[-1]), dtype=np.intp)
        area = np.repeat(np.arange(len(self)), np.diff(starts))
        return np.stack([np.maximum(own - 1, starts[area]), np.minimum(own + 1, starts[area + 1] - 1)])

    def alone(self, x: float, y: float) -> tuple[float, ...] | None:
        """The headings at a point that lies in one area; None at any other."""
        if not len(self):
            return None
        segments, headings, starts = self.segments
        found: list[int] = shapes.tree_within(self.tree, shapes.point(x, y), TIE).tolist()
        if len(found) != 1:
            return None
        own = slice(starts[found[0]], starts[found[0] + 1])
        away = segment_distances(np.array((x, y)), segments[own])
        return tuple(dict.fromkeys(headings[own][away <= away.min() + TIE].tolist()))

    def within(self, xy: Coordinates, reach: NDArray[np.float64]) -> AreaPairs:
        """Pairs (point, area) that are within reach of each other; shapes (n, 2) and (n,)."""
        if not len(self):
            return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
        point, area = shapes.tree_pairs_around(self.tree, xy, reach[:, None])
        near = shapes.within_many(self.areas[area], shapes.points(xy)[point], reach[point])
        return point[near], area[near]

    def nearest(self, xy: Coordinates, reach: float, more: NDArray[np.float64] | float = 0.0) -> AreaPairs:
        """Pairs (point, area) of the areas within reach that are nearest, or by so much more, ties included."""
        if not len(self):
            return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
        more = np.broadcast_to(np.asarray(more, dtype=float), (len(xy),))
        # all distances at once take a third of the time of a search for the nearest, point by point
        point, area = shapes.tree_pairs_around(self.tree, xy, (reach + more)[:, None])
        away = shapes.distances(shapes.points(xy)[point], self.areas[area])
        least = np.full(len(xy), np.inf)
        np.minimum.at(least, point, away)
        near = (least[point] <= reach + more[point]) & (away <= least[point] + 2 * more[point] + TIE)
        return point[near], area[near]

    def headings_of(self, xy: Coordinates, pairs: AreaPairs) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Pairs (point, heading) of the nearest segments of each point's areas, ties included, in the areas' order."""
        order = np.lexsort(pairs[::-1])
        point, segment = self._nearest_segments(xy, (pairs[0][order], pairs[1][order]), np.zeros(len(xy)))
        return point, self.segments[1][segment]

    def headings_around(
        self, xy: Coordinates, pairs: AreaPairs, radius: NDArray[np.float64]
    ) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """The same for all points within a radius (n,) of each, with headings rounded, each pair once."""
        point, segment = self._nearest_segments(xy, pairs, 2 * radius)
        distinct, number = self._rounded
        # as one whole number a pair is found once much sooner than as two fractions
        found = np.sort(point * len(distinct) + number[segment])
        found = found[np.diff(found, prepend=-1) != 0]
        return found // max(1, len(distinct)), distinct[found % max(1, len(distinct))]

    def _nearest_segments(self, xy: Coordinates, pairs: AreaPairs, more: NDArray[np.float64]) -> AreaPairs:
        """Pairs (point, segment) of the nearest segments of each point's areas, and those farther by no more."""
        segments, _, starts = self.segments
        point, area = pairs
        pair, segment = _each_segment(np.arange(len(area)), area, starts)
        away = segment_distances(xy[point[pair]], segments[segment])
        best = np.full(len(area), np.inf)
        np.minimum.at(best, pair, away)
        chosen = np.nonzero(away <= best[pair] + more[point[pair]] + TIE)[0]
        return point[pair[chosen]], segment[chosen]

    def steps_to(
        self, xy: Coordinates, steps: Coordinates, beside: float
    ) -> tuple[NDArray[np.intp], NDArray[np.float64], Coordinates]:
        """Where a step along a segment may have led to some places (n, 2): pairs (place, heading), and from where.

        Args:
            xy: The places.
            steps: By which vector of heading 0 each is reached, (n, 2).
            beside: Metres beside a segment up to which one goes along it.
        """
        if not len(self):
            return np.empty(0, dtype=np.intp), np.empty(0), np.empty((0, 2))
        segments, headings, _ = self.segments
        reach = np.hypot(steps[:, 0], steps[:, 1])[:, None] + beside
        place, segment = shapes.tree_pairs_around(self._segment_tree, xy, reach)
        back = xy[place] - rotate_array(steps[place], headings[segment])
        away = segment_distances(back, segments[segment])
        near = np.nonzero(away <= beside)[0]
        # where the next segment of the same area is nearer, this one does not count: few are left
        for neighbour in self._neighbours:
            least = segment_distances(back[near], segments[neighbour[segment[near]]])
            near = near[away[near] <= least + TIE]
        place, segment = place[near], segment[near]
        _, first = np.unique(place * len(segments) + self._rounded[1][segment], return_index=True)
        return place[first], headings[segment[first]], back[near[first]]

    def covering(self, boxes: NDArray[np.float64], pairs: AreaPairs) -> NDArray[np.bool_]:
        """Which of some boxes (n, 4) one of their areas covers."""
        box, area = pairs
        covered = np.zeros(len(boxes), dtype=bool)
        if len(box):
            covered[box[shapes.covers_many(self.areas[area], shapes.boxes(boxes[box]))]] = True
        return covered

    @cached_property
    def _cells_of(self) -> dict[tuple[int, int], list[FieldCell]]:
        """The cells of each area and segment that were asked for."""
        return {}

    @cached_property
    def _outlines(self) -> dict[int, list[Outline]]:
        """The convex pieces of each area that was asked for."""
        return {}

    def cells(self, area: int, bounds: Bounds, heading: float | None) -> Iterator[FieldCell]:
        """The cells of an area's segments, or those of a heading, that can be the nearest of it within the bounds."""
        _, headings, starts = self.segments
        shape, segments = self.directed[area]
        west, south, east, north = bounds
        gap = segment_distances(np.array([(west + east) / 2, (south + north) / 2]), segments)
        near = gap <= gap.min() + float(np.hypot(east - west, north - south)) + TIE
        if heading is not None:
            near &= np.abs(headings[starts[area] : starts[area + 1]] - heading) <= ONE_HEADING
        for index in np.nonzero(near)[0].tolist():
            found = self._cells_of.get((area, index))
            if found is None:
                if area not in self._outlines:
                    self._outlines[area] = convex_outlines(shape)
                own = headings[starts[area] : starts[area + 1]]
                found = self._cells_of[area, index] = segment_cells(self._outlines[area], segments, own, index)
            yield from found


def _each_segment(owner: NDArray[np.intp], area: NDArray[np.intp], starts: NDArray[np.intp]) -> AreaPairs:
    """Pairs (owner, segment) for all segments of each owner's area."""
    counts = starts[area + 1] - starts[area]
    return np.repeat(owner, counts), expand_ranges(starts[area], counts)


def headings_by_point(owner: NDArray[np.intp], heading: NDArray[np.float64], count: int) -> list[tuple[float, ...]]:
    """The headings of each of some points, each once and in order."""
    owner, heading = distinct_pairs(owner, heading)
    values: list[float] = heading.tolist()
    ends: list[int] = np.searchsorted(owner, np.arange(count + 1)).tolist()
    return [tuple(values[first:end]) for first, end in pairwise(ends)]


def distinct_pairs(
    owner: NDArray[np.intp], heading: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Pairs (owner, heading) in order, each once; shapes (n,)."""
    order = np.lexsort((heading, owner))
    owner, heading = owner[order], heading[order]
    again = (owner[1:] == owner[:-1]) & (heading[1:] == heading[:-1])
    kept = np.concatenate([[True], ~again])[: len(owner)]
    return owner[kept], heading[kept]


def _segments(lines: Sequence[Coordinates]) -> NDArray[np.float64]:
    """Segments (n, 4) of positive length."""
    pairs = [np.concatenate([line[:-1], line[1:]], axis=1) for line in lines if len(line) > 1]
    segments = np.concatenate([np.empty((0, 4)), *pairs])
    return segments[np.any(segments[:, :2] != segments[:, 2:], axis=1)]
