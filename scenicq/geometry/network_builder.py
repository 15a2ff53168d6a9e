"""Network elements from map features: makes them all, then fills in what refers to what."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar, cast

from shapely.geometry import LineString, MultiPolygon, Polygon

from scenicq.geometry import shapes
from scenicq.geometry.centerlines import centerlines, direction_along
from scenicq.geometry.elements import (
    Curb,
    Intersection,
    Lane,
    LaneGroup,
    LaneSection,
    Maneuver,
    NetworkElement,
    PedestrianCrossing,
    Road,
    Shoulder,
    Sidewalk,
    keeps_left,
)
from scenicq.geometry.features import MapFeature, names
from scenicq.geometry.fields import VectorField
from scenicq.geometry.regions import PolylineSet

__all__ = ["Elements", "link"]

_Element = TypeVar("_Element", bound=NetworkElement)


@dataclass(slots=True, eq=False)
class Elements:
    """All elements of a network by kind and id, in the map's order."""

    lanes: dict[str, Lane] = field(default_factory=dict[str, Lane])
    sections: dict[str, LaneSection] = field(default_factory=dict[str, LaneSection])
    groups: dict[str, LaneGroup] = field(default_factory=dict[str, LaneGroup])
    roads: dict[str, Road] = field(default_factory=dict[str, Road])
    intersections: dict[str, Intersection] = field(default_factory=dict[str, Intersection])
    crossings: dict[str, PedestrianCrossing] = field(default_factory=dict[str, PedestrianCrossing])
    sidewalks: dict[str, Sidewalk] = field(default_factory=dict[str, Sidewalk])
    shoulders: dict[str, Shoulder] = field(default_factory=dict[str, Shoulder])
    curbs: dict[str, Curb] = field(default_factory=dict[str, Curb])


def link(features: Sequence[MapFeature], direction: VectorField) -> Elements:
    """The elements of a network with their references; references that dangle are passed over.

    Args:
        features: With unique ids.
        direction: The direction of traffic, the orientation of whatever carries any.
    """
    elements = Elements()
    for feature in features:
        _make(feature, direction, elements)
    by_kind = {kind: [f for f in features if f.kind == kind] for kind in ("lane", "lane_section", "lane_group", "road")}
    _link_groups(by_kind["lane_group"], by_kind["lane"], elements)
    _link_roads(by_kind["road"], elements)
    _make_curbs([f for f in features if f.kind == "curb"], elements)
    _link_sections(by_kind["lane_section"], by_kind["lane"], elements)
    _link_lanes(by_kind["lane"], elements)
    _link_intersections([f for f in features if f.kind == "intersection"], elements)
    for lane in elements.lanes.values():
        lane.maneuvers = tuple(_maneuvers(lane))
    for crossing in elements.intersections.values():
        crossing.maneuvers = tuple(
            maneuver
            for lane in crossing.incomingLanes
            for maneuver in lane.maneuvers
            if maneuver.intersection is crossing
        )
    return elements


def _make(feature: MapFeature, direction: VectorField, elements: Elements) -> None:
    if feature.kind == "curb":
        return
    area = cast("Polygon | MultiPolygon", feature.shape)
    plain = (feature.id, area, feature.properties)
    directed = (*plain, direction)
    match feature.kind:
        case "lane":
            elements.lanes[feature.id] = Lane(*directed, centerline=_centerline(feature, direction))
        case "lane_group":
            elements.groups[feature.id] = LaneGroup(*directed)
        case "road":
            elements.roads[feature.id] = Road(*directed)
        case "intersection":
            elements.intersections[feature.id] = Intersection(*directed)
        case "crossing":
            elements.crossings[feature.id] = PedestrianCrossing(*plain)
        case "sidewalk":
            own = direction_along([feature], "sidewalk")
            elements.sidewalks[feature.id] = Sidewalk(*plain, own, centerline=_centerline(feature, own))
        case "shoulder":
            own = direction_along([feature], "shoulder") or direction
            elements.shoulders[feature.id] = Shoulder(*plain, own, centerline=_centerline(feature, own))
        case _:
            pass


def _centerline(feature: MapFeature, direction: VectorField | None) -> PolylineSet | None:
    lines = tuple(LineString(line) for line in centerlines(feature))
    return PolylineSet(lines, f"centerline of {feature.id}", direction) if lines else None


def _make_curbs(features: list[MapFeature], elements: Elements) -> None:
    for feature in features:
        group = _first(elements.groups, feature, "group")
        for number, line in enumerate(shapes.simple_parts([feature.shape])):
            key = feature.id if number == 0 else f"{feature.id}:{number}"
            elements.curbs[key] = Curb(key, cast(LineString, line), group)


def _found(table: dict[str, _Element], feature: MapFeature, key: str) -> tuple[_Element, ...]:
    return tuple(table[name] for name in names(feature, key) if name in table)


def _first(table: dict[str, _Element], feature: MapFeature, key: str) -> _Element | None:
    return next(iter(_found(table, feature, key)), None)


def _link_groups(group_features: list[MapFeature], lane_features: list[MapFeature], elements: Elements) -> None:
    members: dict[str, list[Lane]] = {}
    for feature in lane_features:
        lane = elements.lanes[feature.id]
        lane.group = _first(elements.groups, feature, "group")
        if lane.group is not None:
            members.setdefault(lane.group.id, []).append(lane)
    for feature in group_features:
        group = elements.groups[feature.id]
        group.lanes = tuple(members.get(group.id, ()))
        group.road = _first(elements.roads, feature, "road")
        _set(group, "_opposite", _first(elements.groups, feature, "opposite"))
    for feature in lane_features:
        lane = elements.lanes[feature.id]
        lane.road = _first(elements.roads, feature, "road") or (lane.group.road if lane.group else None)


def _link_roads(features: list[MapFeature], elements: Elements) -> None:
    loose: dict[str, list[Lane]] = {}
    for lane in elements.lanes.values():
        if lane.road is not None:
            loose.setdefault(lane.road.id, []).append(lane)
    for feature in features:
        road = elements.roads[feature.id]
        road.intersection = _first(elements.intersections, feature, "intersection")
        road.forwardLanes = _one_group(_found(elements.groups, feature, "forward"), road, "forward")
        road.backwardLanes = _one_group(_found(elements.groups, feature, "backward"), road, "backward")
        road.laneGroups = tuple(group for group in (road.forwardLanes, road.backwardLanes) if group is not None)
        for group in road.laneGroups:
            group.road = group.road or road
            for lane in group.lanes:
                lane.road = lane.road or road
        lanes = [lane for group in road.laneGroups for lane in group.lanes] + loose.get(road.id, [])
        road.lanes = tuple(dict.fromkeys(lanes))


def _one_group(groups: tuple[LaneGroup, ...], road: Road, side: str) -> LaneGroup | None:
    """Scenic knows one group a direction: several of the map become one."""
    if len(groups) <= 1:
        return groups[0] if groups else None
    polygons = [polygon for group in groups for polygon in shapes.simple_parts([group.polygon])]
    area = cast("Polygon | MultiPolygon", shapes.union_all(polygons))
    lanes = tuple(lane for group in groups for lane in group.lanes)
    merged = LaneGroup(f"{road.id}:{side}", area, {}, groups[0].orientation, road=road, lanes=lanes)
    opposites = (group.__dict__["_opposite"] for group in groups)
    _set(merged, "_opposite", next((opposite for opposite in opposites if opposite is not None), None))
    return merged


def _link_sections(section_features: list[MapFeature], lane_features: list[MapFeature], elements: Elements) -> None:
    listed: dict[str, list[LaneSection]] = {}
    for feature in section_features:
        lane = _first(elements.lanes, feature, "lane")
        if lane is None:
            continue
        area = cast("Polygon | MultiPolygon", feature.shape)
        line = _centerline(feature, lane.orientation) or lane.centerline
        section = LaneSection(feature.id, area, feature.properties, lane.orientation, centerline=line, lane=lane)
        elements.sections[feature.id] = section
        listed.setdefault(lane.id, []).append(section)
    for lane in elements.lanes.values():
        sections = listed.get(lane.id)
        if sections is None:
            key = lane.id if f"{lane.id}_sec" in elements.sections else f"{lane.id}_sec"
            plain = LaneSection(
                key, lane.polygon, lane.properties, lane.orientation, centerline=lane.centerline, lane=lane
            )
            sections = [plain]
            elements.sections[key] = plain
        lane.sections = tuple(sections)
        for section in sections:
            section.group, section.road = lane.group, lane.road
            section.isForward = lane.road is None or lane.group is None or _is_forward(lane, lane.road)
    for feature in section_features:
        if feature.id in elements.sections:
            _link_neighbours(elements.sections[feature.id], lambda key, f=feature: _section(elements, f, key))
    for feature in lane_features:
        lane = elements.lanes[feature.id]
        if lane.id not in listed:
            _link_neighbours(lane.sections[0], lambda key, f=feature: _section(elements, f, key))


def _is_forward(lane: Lane, road: Road) -> bool:
    back = road.backwardLanes
    return back is None or lane not in back.lanes


def _section(elements: Elements, feature: MapFeature, key: str) -> LaneSection | None:
    """A neighbour that is named by its section or by its lane."""
    for name in names(feature, key):
        if name in elements.sections and elements.sections[name].lane.id != name:
            return elements.sections[name]
        if name in elements.lanes:
            return elements.lanes[name].sections[0]
    return None


def _link_neighbours(section: LaneSection, neighbour: Callable[[str], LaneSection | None]) -> None:
    left, right = neighbour("left"), neighbour("right")
    _set(section, "_laneToLeft", left)
    _set(section, "_laneToRight", right)
    # towards the middle of the road, lanes get faster
    faster, slower = (right, left) if keeps_left(section) else (left, right)
    _set(section, "_fasterLane", faster if faster is not None and _same_way(section, faster) else None)
    _set(section, "_slowerLane", slower if slower is not None and _same_way(section, slower) else None)


def _same_way(a: LaneSection, b: LaneSection) -> bool:
    if a.group is not None and b.group is not None:
        return a.group is b.group or (a.road is b.road and a.isForward == b.isForward)
    return a.isForward == b.isForward


def _link_lanes(features: list[MapFeature], elements: Elements) -> None:
    after: dict[str, list[Lane]] = {}
    before: dict[str, list[Lane]] = {}
    for feature in features:
        lane = elements.lanes[feature.id]
        for other in _found(elements.lanes, feature, "successors"):
            after.setdefault(lane.id, []).append(other)
            before.setdefault(other.id, []).append(lane)
        for other in _found(elements.lanes, feature, "predecessors"):
            after.setdefault(other.id, []).append(lane)
            before.setdefault(lane.id, []).append(other)
    for lane in elements.lanes.values():
        lane.successors = tuple(dict.fromkeys(after.get(lane.id, ())))
        lane.predecessors = tuple(dict.fromkeys(before.get(lane.id, ())))
        _set(lane, "_successor", next(iter(lane.successors), None))
        _set(lane, "_predecessor", next(iter(lane.predecessors), None))
        near = (section.lane for own in lane.sections for section in own.adjacentLanes)
        lane.adjacentLanes = tuple(dict.fromkeys(near))


def _link_intersections(features: list[MapFeature], elements: Elements) -> None:
    roads: dict[Intersection | None, list[Road]] = {}
    for road in elements.roads.values():
        roads.setdefault(road.intersection, []).append(road)
    for feature in features:
        crossing = elements.intersections[feature.id]
        named = _found(elements.roads, feature, "roads")
        inside = roads.get(crossing, [])
        # Scenic counts the roads that meet; those inside only stand in where the map names none
        crossing.roads = named or tuple(inside)
        crossing.lanes = tuple(lane for road in inside for lane in road.lanes)
        own = set(crossing.lanes)
        ahead = [other for lane in crossing.lanes for other in lane.successors if other not in own]
        behind = [other for lane in crossing.lanes for other in lane.predecessors if other not in own]
        crossing.incomingLanes = tuple(dict.fromkeys(behind))
        crossing.outgoingLanes = tuple(dict.fromkeys(ahead))


def _maneuvers(lane: Lane) -> list[Maneuver]:
    found: list[Maneuver] = []
    for following in lane.successors:
        crossing = following.road.intersection if following.road is not None else None
        if crossing is None:
            found.append(Maneuver(lane, following))
        elif lane not in crossing.lanes:
            found += [Maneuver(lane, end, following, crossing) for end in following.successors]
    return found


def _set(element: NetworkElement, name: str, value: Any) -> None:
    """Set one of Scenic's underscored attributes, which programs read but nothing else writes."""
    setattr(element, name, value)
