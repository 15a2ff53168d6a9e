"""Map features of lanes that a source gives by their left and right boundaries (Argoverse, CommonRoad, Lanelet2).

Such sources name neighbours and successors, but neither roads nor groups nor, mostly, intersections. These follow from
the neighbours: lanes beside each other in one direction are a group, a group and its opposite are a road, and the lanes
of an intersection that touch are one intersection.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring

from scenicq.geometry import shapes
from scenicq.geometry.features import MapFeature, ProblemSink
from scenicq.importers.fields import InvalidError
from scenicq.importers.lane_parts import LanePart

__all__ = ["BoundedLane", "Points", "centerline", "lane_features", "lengths_along", "sound_area"]

Points = NDArray[np.float64]
"""A polyline: array (n, 2), metres."""

_STEP_M = 2.0
_MOST_POINTS = 2000


@dataclass(frozen=True, slots=True)
class BoundedLane:
    """A lane between two boundaries.

    Attributes:
        id: Unique in the map.
        left, right: Boundaries in the direction of travel.
        beside_left, beside_right: The neighbour's id; None at the edge of the road.
        left_is_opposite, right_is_opposite: Whether that neighbour runs the other way.
        predecessors, successors: Ids; some may be of lanes outside of the map.
        in_intersection: Whether the source says that it crosses an intersection.
        parts: Where neighbours change along the lane: each part with its own.
        properties: What else the source says.
    """

    id: str
    left: Points = field(repr=False)
    right: Points = field(repr=False)
    beside_left: str | None = None
    beside_right: str | None = None
    left_is_opposite: bool = False
    right_is_opposite: bool = False
    predecessors: tuple[str, ...] = ()
    successors: tuple[str, ...] = ()
    in_intersection: bool = False
    parts: tuple[LanePart, ...] = ()
    properties: Mapping[str, Any] = field(default_factory=dict[str, Any])


def centerline(left: Points, right: Points) -> list[list[float]]:
    """Points halfway between two boundaries, at equal shares of their lengths, about 2 m apart.

    Raises:
        InvalidError: A boundary has no length.
    """
    length = max(lengths_along(left)[-1], lengths_along(right)[-1])
    count = min(_MOST_POINTS, max(2, math.ceil(length / _STEP_M) + 1))
    middle = (_resampled(left, count) + _resampled(right, count)) / 2
    apart = np.hypot(*np.diff(middle, axis=0).T) > 1e-6
    if not apart.any():
        raise InvalidError("it has no length")
    return middle[np.concatenate([[True], apart])].tolist()


def sound_area(shape: BaseGeometry) -> Polygon | MultiPolygon:
    """The polygons of a shape, repaired where its outline touches or crosses itself.

    Raises:
        InvalidError: Nothing of an area remains.
    """
    if not shape.is_valid:
        made = shapely.make_valid(shape)
        parts = [part for part in getattr(made, "geoms", [made]) if isinstance(part, Polygon | MultiPolygon)]
        shape = shapes.union_all(parts)
    if not isinstance(shape, Polygon | MultiPolygon) or shape.is_empty or not 0 < shape.area < math.inf:
        raise InvalidError("its polygon is not valid")
    return shape


def lane_features(lanes: Sequence[BoundedLane], on_problem: ProblemSink) -> list[MapFeature]:
    """Lanes with their groups, roads and intersections.

    References to lanes that are not there are left out and told.

    Args:
        lanes: With unique ids.
        on_problem: Called with the id of a lane and what is wrong.
    """
    sound: dict[str, tuple[BoundedLane, Polygon | MultiPolygon, list[list[float]]]] = {}
    for lane in lanes:
        try:
            area = sound_area(Polygon(np.concatenate([lane.left, lane.right[::-1]])))
            sound[lane.id] = lane, area, centerline(lane.left, lane.right)
        except (InvalidError, ValueError) as error:
            on_problem(lane.id, f"the lane is left out: {error}")
    kept = {name: _Linked(lane, sound, on_problem) for name, (lane, _, _) in sound.items()}
    groups = _groups(kept)
    roads = _roads(kept, groups)
    areas = {name: area for name, (_, area, _) in sound.items()}
    crossing_of = {name: f"{first}_intersection" for name, first in _intersections(kept, areas).items()}
    made = [
        MapFeature(
            name, "lane", area, {"centerline": [line], "group": f"{groups[name]}_group", **kept[name].properties}
        )
        for name, (_, area, line) in sound.items()
    ]
    made += _section_features(kept)
    made += _group_features(groups, roads, areas)
    made += _road_features(groups, roads, areas, crossing_of)
    return made + _intersection_features(roads, areas, groups, crossing_of)


class _Linked:
    """A lane's references, without those that dangle."""

    def __init__(self, lane: BoundedLane, present: Mapping[str, object], on_problem: ProblemSink) -> None:
        def there(name: str | None, key: str) -> bool:
            if name is not None and name not in present:
                on_problem(lane.id, f"`{key}`: lane `{name}` is not in the map")
            return name in present

        self.lane = lane
        self._present = present
        self.left = lane.beside_left if there(lane.beside_left, "left") else None
        self.right = lane.beside_right if there(lane.beside_right, "right") else None
        self.properties: dict[str, Any] = {
            **({} if self.left is None else {"left": self.left}),
            **({} if self.right is None else {"right": self.right}),
            "predecessors": [name for name in lane.predecessors if there(name, "predecessors")],
            "successors": [name for name in lane.successors if there(name, "successors")],
            **lane.properties,
        }

    def beside(self, *, opposite: bool) -> Iterator[str]:
        pairs = [(self.left, self.lane.left_is_opposite), (self.right, self.lane.right_is_opposite)]
        for part in self.lane.parts:
            pairs += [(part.left and part.left[0], self.lane.left_is_opposite)]
            pairs += [(part.right and part.right[0], self.lane.right_is_opposite)]
        found = dict.fromkeys(name for name, way in pairs if name is not None and way == opposite)
        return (name for name in found if name in self._present)


def _section_features(lanes: Mapping[str, _Linked]) -> Iterator[MapFeature]:
    """The parts of lanes that have several, or lie beside parts of others."""
    several = {name for name, linked in lanes.items() if len(linked.lane.parts) > 1}
    cut = several | {
        name
        for name, linked in lanes.items()
        if any(
            side is not None and side[0] in several for part in linked.lane.parts for side in (part.left, part.right)
        )
    }

    def called(part: tuple[str, int] | None) -> str | None:
        if part is None or part[0] not in lanes:
            return None
        return f"{part[0]}_sec{part[1]}" if part[0] in cut else part[0]

    for name in (name for name in lanes if name in cut):
        lane = lanes[name].lane
        for number, part in enumerate(lane.parts):
            left, right = (_between(line, part.start, part.end) for line in (lane.left, lane.right))
            try:
                area = sound_area(Polygon(np.concatenate([left, right[::-1]])))
                line = centerline(left, right)
            except (InvalidError, ValueError):  # bent back on itself; the lane has its shape
                continue
            beside = {"left": called(part.left), "right": called(part.right)}
            links = {key: other for key, other in beside.items() if other is not None}
            yield MapFeature(f"{name}_sec{number}", "lane_section", area, {"lane": name, "centerline": [line], **links})


def _between(line: Points, start: float, end: float) -> Points:
    """A stretch of a polyline, by shares of its length."""
    return shapely.get_coordinates(substring(LineString(line), start, end, normalized=True))


def _groups(lanes: Mapping[str, _Linked]) -> dict[str, str]:
    """The first lane of the group of each lane."""
    pairs = ((name, other) for name, lane in lanes.items() for other in lane.beside(opposite=False))
    return _components(lanes, ((a, b) for a, b in pairs if _alike(lanes, a, b)))


def _roads(lanes: Mapping[str, _Linked], groups: Mapping[str, str]) -> dict[str, tuple[str, bool]]:
    """For each group, its road (called by its first lane) and whether it is the road's forward direction."""
    opposite: dict[str, list[str]] = {group: [] for group in dict.fromkeys(groups.values())}
    for name, lane in lanes.items():
        for other in lane.beside(opposite=True):
            if _alike(lanes, name, other):
                opposite[groups[name]].append(groups[other])
                opposite[groups[other]].append(groups[name])
    roads: dict[str, tuple[str, bool]] = {}
    for first in opposite:
        waiting = [(first, True)]
        while waiting:
            group, forward = waiting.pop()
            if group not in roads:
                roads[group] = first, forward
                waiting += [(other, not forward) for other in opposite[group]]
    return roads


def _alike(lanes: Mapping[str, _Linked], a: str, b: str) -> bool:
    return lanes[a].lane.in_intersection == lanes[b].lane.in_intersection


def _intersections(lanes: Mapping[str, _Linked], areas: Mapping[str, Polygon | MultiPolygon]) -> dict[str, str]:
    """For each lane of an intersection, the first lane of that intersection."""
    inside = [name for name, lane in lanes.items() if lane.lane.in_intersection]
    shapes = [areas[name] for name in inside]
    found = shapely.STRtree(shapes).query(shapes, predicate="intersects") if inside else np.empty((2, 0), int)
    pairs = cast("list[tuple[int, int]]", found.T.tolist())
    # Lanes that only follow each other touch too; that is one intersection as well.
    return _components(inside, ((inside[a], inside[b]) for a, b in pairs))


def _components(names: Iterable[str], pairs: Iterable[tuple[str, str]]) -> dict[str, str]:
    """For each name, the first name that pairs connect it to."""
    order = {name: number for number, name in enumerate(names)}
    first = {name: name for name in order}

    def root(name: str) -> str:
        while first[name] != name:
            first[name] = first[first[name]]
            name = first[name]
        return name

    for a, b in pairs:
        one, two = sorted((root(a), root(b)), key=order.__getitem__)
        first[two] = one
    return {name: root(name) for name in order}


def _members(keys: Mapping[str, str]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for name, key in keys.items():
        found.setdefault(key, []).append(name)
    return found


def _union(areas: Iterable[Polygon | MultiPolygon]) -> Polygon | MultiPolygon:
    return cast("Polygon | MultiPolygon", shapes.union_all(list(areas)))


def _group_features(
    groups: Mapping[str, str], roads: Mapping[str, tuple[str, bool]], areas: Mapping[str, Polygon | MultiPolygon]
) -> Iterator[MapFeature]:
    on_road: dict[tuple[str, bool], str] = {}
    for group, place in roads.items():
        on_road.setdefault(place, group)
    for group, members in _members(groups).items():
        road, forward = roads[group]
        properties = {"road": f"{road}_road"}
        if (opposite := on_road.get((road, not forward))) is not None:
            properties["opposite"] = f"{opposite}_group"
        yield MapFeature(f"{group}_group", "lane_group", _union(areas[name] for name in members), properties)


def _road_features(
    groups: Mapping[str, str],
    roads: Mapping[str, tuple[str, bool]],
    areas: Mapping[str, Polygon | MultiPolygon],
    crossing_of: Mapping[str, str],
) -> Iterator[MapFeature]:
    for road, members in _members({name: roads[group][0] for name, group in groups.items()}).items():
        found = dict.fromkeys(groups[name] for name in members)
        properties: dict[str, Any] = {
            "forward": [f"{group}_group" for group in found if roads[group][1]],
            "backward": [f"{group}_group" for group in found if not roads[group][1]],
        }
        if road in crossing_of:
            properties["intersection"] = crossing_of[road]
        yield MapFeature(f"{road}_road", "road", _union(areas[name] for name in members), properties)


def _intersection_features(
    roads: Mapping[str, tuple[str, bool]],
    areas: Mapping[str, Polygon | MultiPolygon],
    groups: Mapping[str, str],
    crossing_of: Mapping[str, str],
) -> list[MapFeature]:
    return [
        MapFeature(
            crossing,
            "intersection",
            _union(areas[name] for name in members),
            {"roads": list(dict.fromkeys(f"{roads[groups[name]][0]}_road" for name in members))},
        )
        for crossing, members in _members(crossing_of).items()
    ]


def lengths_along(line: Points) -> Points:
    """Length along a polyline at each of its points."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])


def _resampled(line: Points, count: int) -> Points:
    """Points at equal distances along a polyline."""
    along = lengths_along(line)
    wanted: Points = np.linspace(0.0, float(along[-1]), count)
    return np.stack([np.interp(wanted, along, line[:, 0]), np.interp(wanted, along, line[:, 1])], axis=1)
