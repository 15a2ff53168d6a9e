"""The centrelines and sides of elements: as the map gives them, else those of the parts that they are made of."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from math import dist
from typing import cast

from shapely.geometry import LineString

from scenicq.geometry import shapes
from scenicq.geometry.elements import Lane, LaneGroup, LaneSection, Road, RoadSection
from scenicq.geometry.features import MapFeature
from scenicq.geometry.regions import DeferredPolylines, PolylineSet
from scenicq.geometry.road_direction import along_lines
from scenicq.geometry.shapes import XY

__all__ = ["given_line", "set_group_lines", "set_lane_lines", "set_road_lines", "set_section_lines"]

_SAME = 1e-6
"""Metres within which corners are one, and a corner is on the line between its neighbours."""


def given_line(feature: MapFeature, key: str) -> PolylineSet | None:
    """A line that the map gives, such as `left_edge`; None where it gives none."""
    lines = cast("list[list[list[float]]]", feature.properties.get(key) or [])
    return _deferred(f"{key} of {feature.id}", lambda: [LineString(line) for line in lines]) if lines else None


def set_lane_lines(lane: Lane) -> None:
    """A lane's sides are those of its sections, one after the other."""
    sections = lane.sections
    for key in ("left_edge", "right_edge"):
        if getattr(lane, key) is None and sections and all(getattr(section, key) is not None for section in sections):
            own = [cast(PolylineSet, getattr(section, key)) for section in sections]
            line = own[0] if len(own) == 1 else _deferred(f"{key} of {lane.id}", lambda own=own: _chain(own))
            setattr(lane, key, line)


def set_section_lines(section: RoadSection) -> None:
    """The sides of a section of a road, both in the road's direction."""
    if section.backwardLanes:
        section.left_edge = _reversed(section.backwardLanes[-1].right_edge)
    elif section.forwardLanes:
        section.left_edge = section.forwardLanes[-1].left_edge
    if section.forwardLanes:
        section.right_edge = section.forwardLanes[0].right_edge
    elif section.backwardLanes:
        section.right_edge = _reversed(section.backwardLanes[0].left_edge)


def set_group_lines(group: LaneGroup, road: Road) -> None:
    """A lane group has the sides of its outermost lanes, section by section, and the centreline of a lane amid."""
    forward = group is road.forwardLanes
    ends = road.sections[:1] if forward else road.sections[-1:]
    starts = [lane for end in ends for lane in (end.forwardLanes if forward else end.backwardLanes)]
    middle = starts[len(starts) // 2].lane if starts else group.lanes[len(group.lanes) // 2] if group.lanes else None
    if group.centerline is None and middle is not None:
        group.centerline = middle.centerline
    if not starts:
        return
    for key, beside, start in (("left_edge", "_laneToLeft", starts[-1]), ("right_edge", "_laneToRight", starts[0])):
        edges = _outermost(start, road, beside, key)
        if getattr(group, key) is None and edges:
            setattr(group, key, _deferred(f"{key} of {group.id}", lambda edges=edges: _chain(edges)))


def _outermost(start: LaneSection, road: Road, beside: str, key: str) -> list[PolylineSet]:
    """The sides of the sections that follow each other in a road, each time of the outer one where there is one."""
    found: list[PolylineSet] = []
    current, forward, seen = start, start.isForward, set[LaneSection]()
    while current.road is road and current not in seen:
        outer = cast("LaneSection | None", getattr(current, beside))
        if outer is not None and outer.isForward == forward:
            current = outer
        seen.add(current)
        edge = cast("PolylineSet | None", getattr(current, key))
        if edge is None:
            return []
        found.append(edge)
        following = current.__dict__["_successor"]
        if not isinstance(following, LaneSection):
            break
        current = following
    return found


def set_road_lines(road: Road) -> None:
    """A road's sides are those of its groups: the right one of each, or the left one where a direction is missing."""
    forward, backward = road.forwardLanes, road.backwardLanes
    if road.right_edge is None:
        road.right_edge = forward.right_edge if forward else backward.left_edge if backward else None
    if road.left_edge is None:
        road.left_edge = backward.right_edge if backward else forward.left_edge if forward else None
    if road.centerline is None and (group := forward or backward) is not None and not (forward and backward):
        road.centerline = group.centerline


def _deferred(name: str, make: Callable[[], Sequence[LineString]]) -> PolylineSet:
    def made() -> PolylineSet:
        lines = tuple(make())
        return PolylineSet(lines, name, along_lines(lines, name))

    return DeferredPolylines(name, made)


def _reversed(line: PolylineSet | None) -> PolylineSet | None:
    if line is None:
        return None
    return _deferred(line.name, lambda: [cast(LineString, part.reverse()) for part in reversed(line.pieces)])


def _chain(lines: Iterable[PolylineSet]) -> list[LineString]:
    """Polylines one after the other as one, without corners that say nothing."""
    corners = [(x, y) for line in lines for part in line.pieces for x, y in shapes.coordinates(part).tolist()]
    apart = [corners[0]]
    for there in corners[1:]:
        if dist(there, apart[-1]) > _SAME:
            apart.append(there)
    kept: list[XY] = apart[:1]
    for here, there in pairwise(apart[1:]):
        if _off_line(here, kept[-1], there) > _SAME:
            kept.append(here)
    kept.append(apart[-1])
    return [LineString(kept)] if len(apart) > 1 else []


def _off_line(point: XY, start: XY, end: XY) -> float:
    (x, y), (x0, y0), (x1, y1) = point, start, end
    length = dist(start, end)
    return abs((x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)) / length if length else dist(point, start)
