"""What a map says about positions: regions around them, lane, direction of the road. Computed once, at ingest."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from scenicq.geometry.angles import normalize_array
from scenicq.geometry.centerlines import centerlines, has_centerline, lane_direction
from scenicq.geometry.features import MapFeature, names
from scenicq.geometry.network import Network
from scenicq.geometry.own_directions import along_centerline
from scenicq.geometry.road_direction import RoadDirection
from scenicq.store.arrays import Texts
from scenicq.store.columns import Memberships
from scenicq.store.last_lanes import LanePairs, last_lanes
from scenicq.store.schema import MEMBERSHIP_RADIUS_M

__all__ = ["MapIndex"]

NO_WAY = 1e9
"""How far what has no direction leads from any heading."""


class MapIndex:
    """A map prepared for many positions."""

    def __init__(self, features: Sequence[MapFeature]) -> None:
        """Index a map; without elements every answer is empty."""
        self.ids = Texts([feature.id for feature in features])
        self.kinds = Texts([feature.kind for feature in features])
        self._direction = lane_direction(features)
        self._shapes = np.array([feature.shape for feature in features], dtype=object)
        self._tree = shapely.STRtree(self._shapes)
        shapely.prepare(self._shapes)
        self._is_lane = np.array([feature.kind == "lane" for feature in features], dtype=bool)
        self._features = features
        self._ways: dict[int, RoadDirection | None] = {}

    def memberships(self, xy: NDArray[np.float64]) -> Memberships:
        """Regions within `MEMBERSHIP_RADIUS_M` of positions of shape (n, 2)."""
        x, y = np.ascontiguousarray(xy.T)
        reach = MEMBERSHIP_RADIUS_M
        point, feature = self._tree.query(shapely.box(x - reach, y - reach, x + reach, y + reach))
        order = np.lexsort((feature, point))
        point, feature = point[order], feature[order]
        # most are inside, which prepared shapes tell at once
        distance = np.zeros(len(point))
        outside = np.flatnonzero(~shapely.intersects_xy(self._shapes[feature], x[point], y[point]))
        points = np.asarray(shapely.points(xy[point[outside]]))
        distance[outside] = _distance(points, self._shapes[feature[outside]])
        near = distance <= reach
        return Memberships(point[near], feature[near], distance[near])

    def lanes(self, xy: NDArray[np.float64], near: Memberships) -> NDArray[np.int64]:
        """The number of the lane that contains each position, -1 for none, shape (n,).

        Where there are several, as in intersections, it is that with the nearest centreline.
        """
        chosen = (near.distance == 0) & self._is_lane[near.feature] if len(self._features) else np.zeros(0, dtype=bool)
        point, feature = near.point[chosen], near.feature[chosen]
        lane = np.full(len(xy), -1, dtype=np.int64)
        if len(point):
            first = np.flatnonzero(np.diff(point, prepend=-1))
            alone = np.diff(first, append=len(point)) == 1
            lane[point[first[alone]]] = feature[first[alone]]
            several = np.repeat(~alone, np.diff(first, append=len(point)))
            point, feature = point[several], feature[several]
            some, at = np.unique(feature, return_inverse=True)
            lines = np.array([_centerline(self._features[number]) for number in some.tolist()], dtype=object)[at]
            offset = np.nan_to_num(_distance(np.asarray(shapely.points(xy[point])), lines), nan=np.inf)
            # Written from the farthest to the nearest, so that the nearest stays; of equals the first in the map.
            order = np.lexsort((-feature, -offset))
            lane[point[order]] = feature[order]
        return lane

    def last_lanes(
        self,
        times_us: NDArray[np.int64],
        tracks: NDArray[np.int64],
        xy: NDArray[np.float64],
        headings: NDArray[np.float64],
        near: Memberships,
    ) -> NDArray[np.int64]:
        """The last lane of each label object's track where it tells more than its heading, as `last_lanes`, else -1.

        Args:
            times_us: When each is seen, shape (n,).
            tracks: The number of the track of each; below 0 of what is seen once.
            xy: Where each is, shape (n, 2).
            headings: That of each; nan where it is not known.
            near: The regions near each.
        """
        chosen = (near.distance == 0) & self._is_lane[near.feature]
        pairs = LanePairs(near.point[chosen], near.feature[chosen])

        def ways(member: NDArray[np.int64], lane: NDArray[np.int64]) -> list[tuple[float, ...]]:
            return self._directions(xy[member], lane)

        return last_lanes(times_us, tracks, headings, pairs, ways, lambda lane: self._continued[lane])

    def turns(
        self,
        xy: NDArray[np.float64],
        place: NDArray[np.intp],
        headings: NDArray[np.float64],
        near: Memberships,
    ) -> NDArray[np.float64]:
        """How far each lane, or lane of a section, leads from the heading of who is in it, shape as of `near`.

        It is 0 for who has no heading, and nan of what is no lane, has no direction there or does not contain them.

        Args:
            xy: Where each is, shape (n, 2).
            place: The number of the place of each; who stands at the same place has the same.
            headings: That of each; nan where it is not known.
            near: The regions near each.
        """
        found = np.full(len(near.point), np.nan)
        lane = self._lane_of[near.feature] if len(self._features) else np.empty(0, dtype=np.int64)
        inside = np.flatnonzero((near.distance == 0) & (lane >= 0))
        found[inside] = self._turned(xy, place, headings, near.point[inside], lane[inside])
        return found

    def section_turns(
        self,
        xy: NDArray[np.float64],
        place: NDArray[np.intp],
        headings: NDArray[np.float64],
        near: Memberships,
    ) -> NDArray[np.float64]:
        """The same of each section that has a line of its own, by that line; nan of all else.

        It is `NO_WAY` where the line has no direction. Arguments as of `turns`.
        """
        found = np.full(len(near.point), np.nan)
        own = self._has_line[near.feature] if len(self._features) else np.empty(0, dtype=bool)
        inside = np.flatnonzero((near.distance == 0) & own)
        turned = self._turned(xy, place, headings, near.point[inside], near.feature[inside])
        found[inside] = np.where(np.isnan(turned), NO_WAY, turned)
        return found

    def _turned(
        self,
        xy: NDArray[np.float64],
        place: NDArray[np.intp],
        headings: NDArray[np.float64],
        member: NDArray[np.int64],
        lane: NDArray[np.int64],
    ) -> NDArray[np.float64]:
        """How far elements lead from the headings of who is in them, by their lines; nan where they do not lead."""
        if not len(member):
            return np.empty(0)
        _, first, at = np.unique(place[member] * len(self._features) + lane, return_index=True, return_inverse=True)
        ways = self._directions(xy[member[first]], lane[first])
        # of several directions at a place the nearest counts
        turns = np.full(len(member), np.inf)
        for rank in range(max(map(len, ways))):
            way = np.array([each[rank] if rank < len(each) else np.nan for each in ways])[at]
            turns = np.fmin(turns, np.abs(normalize_array(way - headings[member])))
        turns[np.isinf(turns)] = np.nan
        turns[np.isnan(headings[member])] = 0.0
        return turns

    @cached_property
    def network(self) -> Network:
        """The map as a network."""
        return Network("", self._features)

    @cached_property
    def _lane_of(self) -> NDArray[np.int64]:
        """The number of the lane that each element is, or is a section of; -1 of all others."""
        found = np.where(self._is_lane, np.arange(len(self._features)), -1)
        lanes = {self._features[number].id: number for number in np.flatnonzero(self._is_lane).tolist()}
        for number, feature in enumerate(self._features):
            if feature.kind == "lane_section":
                own = (lanes[name] for name in names(feature, "lane") if name in lanes)
                found[number] = next(own, -1)
        return found

    @cached_property
    def _has_line(self) -> NDArray[np.bool_]:
        """Whether each element is a section of a lane with a line of its own."""
        own = (feature.kind == "lane_section" and has_centerline(feature) for feature in self._features)
        return np.fromiter(own, dtype=bool, count=len(self._features))

    @cached_property
    def _continued(self) -> dict[int, frozenset[int]]:
        """The lanes that each lane continues: itself, and those that lead to it."""
        lanes = {self._features[number].id: number for number in np.flatnonzero(self._is_lane).tolist()}
        found = defaultdict[int, set[int]](set)
        for number in lanes.values():
            found[number].add(number)
            for other in names(self._features[number], "successors"):
                if other in lanes:
                    found[lanes[other]].add(number)
            found[number].update(lanes[each] for each in names(self._features[number], "predecessors") if each in lanes)
        return {number: frozenset(each) for number, each in found.items()}

    def _directions(self, xy: NDArray[np.float64], lanes: NDArray[np.int64]) -> list[tuple[float, ...]]:
        """The directions of lanes, each at the place of its row."""
        found: list[tuple[float, ...]] = [()] * len(xy)
        order = np.argsort(lanes, kind="stable")
        for rows in np.split(order, np.flatnonzero(np.diff(lanes[order])) + 1) if len(order) else ():
            number = int(lanes[rows[0]])
            if number not in self._ways:
                feature = self._features[number]
                self._ways[number] = along_centerline(feature.id, feature.shape, centerlines(feature))
            way = self._ways[number]
            if way is not None:
                for row, each in zip(rows.tolist(), way.values_many(xy[rows]), strict=True):
                    found[row] = each
        return found

    def road_directions(self, xy: NDArray[np.float64]) -> list[tuple[float, ...]]:
        """The headings of the lanes at positions of shape (n, 2); none off the lanes."""
        return self._direction.values_many(xy)


def _distance(points: NDArray[Any], shapes: NDArray[Any]) -> NDArray[np.float64]:
    """Distance of each pair; nan where there is no shape."""
    return shapely.distance(points, shapes)  # pyright: ignore[reportUnknownMemberType]


def _centerline(feature: MapFeature) -> shapely.MultiLineString | None:
    lines = centerlines(feature)
    return shapely.MultiLineString(lines) if lines else None
