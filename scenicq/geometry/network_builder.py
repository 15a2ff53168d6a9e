"""Network elements from map features: makes them all, then fills in what refers to what.

What a map says itself counts; what it doesn't say follows from the rest, as far as it does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar, cast

from shapely.geometry import LineString, MultiPolygon, Polygon

from scenicq.geometry import shapes
from scenicq.geometry.centerlines import centerlines, has_centerline
from scenicq.geometry.element_ends import derive_ends
from scenicq.geometry.element_lines import (
    given_line,
    set_group_lines,
    set_lane_lines,
    set_road_lines,
    set_section_lines,
)
from scenicq.geometry.elements import (
    Curb,
    Intersection,
    Lane,
    LaneGroup,
    LaneSection,
    LongElement,
    NetworkElement,
    PedestrianCrossing,
    Road,
    RoadSection,
    Shoulder,
    Sidewalk,
    Signal,
    keeps_left,
)
from scenicq.geometry.features import MapFeature, names
from scenicq.geometry.maneuvers import by_heading, maneuvers_of
from scenicq.geometry.own_directions import along_unread_centerline, direction_of_intersection, direction_of_lanes
from scenicq.geometry.regions import DeferredPolylines, PolylineSet

__all__ = ["Elements", "link", "relate_elements"]

_Element = TypeVar("_Element", bound=NetworkElement)
_Long = TypeVar("_Long", bound=LongElement)


@dataclass(slots=True, eq=False)
class Elements:
    """All elements of a network by kind and id, in the map's order."""

    lanes: dict[str, Lane] = field(default_factory=dict[str, Lane])
    sections: dict[str, LaneSection] = field(default_factory=dict[str, LaneSection])
    groups: dict[str, LaneGroup] = field(default_factory=dict[str, LaneGroup])
    roads: dict[str, Road] = field(default_factory=dict[str, Road])
    road_sections: dict[str, RoadSection] = field(default_factory=dict[str, RoadSection])
    intersections: dict[str, Intersection] = field(default_factory=dict[str, Intersection])
    crossings: dict[str, PedestrianCrossing] = field(default_factory=dict[str, PedestrianCrossing])
    sidewalks: dict[str, Sidewalk] = field(default_factory=dict[str, Sidewalk])
    shoulders: dict[str, Shoulder] = field(default_factory=dict[str, Shoulder])
    curbs: dict[str, Curb] = field(default_factory=dict[str, Curb])

    def by_id(self) -> dict[str, NetworkElement]:
        """All that have an area."""
        tables: tuple[Mapping[str, NetworkElement], ...] = (
            self.sections, self.road_sections, self.lanes, self.groups, self.roads, self.intersections,
            self.crossings, self.sidewalks, self.shoulders,
        )  # fmt: skip
        return {name: element for table in tables for name, element in table.items()}


def relate_elements(features: Sequence[MapFeature]) -> Elements:
    """The elements of a network, with what they are parts of and lie beside, but neither lines nor ways on.

    Args:
        features: With unique ids.
    """
    elements = Elements()
    for number, feature in enumerate(features):
        _make(feature, number, elements)
    by_kind = _by_kind(features)
    lanes = by_kind.get("lane", [])
    _link_groups(by_kind.get("lane_group", []), lanes, elements)
    _link_roads(by_kind.get("road", []), elements)
    _link_sections(by_kind.get("lane_section", []), lanes, elements)
    for kind, owned in (("sidewalk", elements.sidewalks), ("shoulder", elements.shoulders)):
        for feature in by_kind.get(kind, []):
            owned[feature.id].road = _first(elements.roads, feature, "road")
    return elements


def link(features: Sequence[MapFeature]) -> Elements:
    """The elements of a network with their references; references that dangle are passed over.

    Args:
        features: With unique ids.
    """
    elements, by_kind = relate_elements(features), _by_kind(features)
    lanes = by_kind.get("lane", [])
    _make_curbs(by_kind.get("curb", []), elements)
    _link_road_sections(by_kind.get("road_section", []), elements)
    _link_lanes(lanes, elements)
    _link_intersections(by_kind.get("intersection", []), elements)
    everything = elements.by_id()
    derive_ends(elements.lanes.values(), elements.groups.values(), elements.roads.values())
    for feature in features:
        _link_ends(feature, everything.get(feature.id), everything)
    _link_lines(elements)
    for lane in elements.lanes.values():
        lane.maneuvers = maneuvers_of(lane)
    _link_maneuvers(by_kind.get("intersection", []), elements)
    return elements


def _by_kind(features: Sequence[MapFeature]) -> dict[str, list[MapFeature]]:
    found: dict[str, list[MapFeature]] = {}
    for feature in features:
        found.setdefault(feature.kind, []).append(feature)
    return found


def _make(feature: MapFeature, number: int, elements: Elements) -> None:
    if feature.kind == "curb":
        return
    area = cast("Polygon | MultiPolygon", feature.shape)
    plain = (feature.id, area, feature.properties)
    match feature.kind:
        case "lane":
            elements.lanes[feature.id] = _along(Lane(*plain, number=number), feature)
        case "lane_group":
            elements.groups[feature.id] = _along(LaneGroup(*plain), feature)
        case "road":
            elements.roads[feature.id] = _along(Road(*plain, signals=_signals(feature)), feature)
        case "intersection":
            elements.intersections[feature.id] = Intersection(*plain, signals=_signals(feature))
        case "crossing":
            elements.crossings[feature.id] = PedestrianCrossing(*plain)
        case "sidewalk":
            elements.sidewalks[feature.id] = _along(Sidewalk(*plain), feature)
        case "shoulder":
            elements.shoulders[feature.id] = _along(Shoulder(*plain), feature)
        case _:
            pass


def _along(element: _Long, feature: MapFeature) -> _Long:
    """An element with the lines that the map gives, and the direction that its centreline has."""
    element.left_edge, element.right_edge = given_line(feature, "left_edge"), given_line(feature, "right_edge")
    if has_centerline(feature):
        element.orientation = along_unread_centerline(feature.id, feature.shape, partial(centerlines, feature))
        element.centerline = DeferredPolylines(
            f"centerline of {feature.id}", partial(_centerline, feature), element.orientation
        )
    return element


def _centerline(feature: MapFeature) -> PolylineSet:
    return PolylineSet(tuple(LineString(line) for line in centerlines(feature)), "")


def _signals(feature: MapFeature) -> tuple[Signal, ...]:
    """The signals that a feature lists; what is no signal is passed over."""
    entries = feature.properties.get("signals")
    found: list[Signal] = []
    for entry in cast("list[Any]", entries) if isinstance(entries, list) else []:
        if isinstance(entry, dict):
            told = cast("dict[str, Any]", entry)
            number = told.get("number")
            found.append(
                Signal(
                    str(told.get("id", "")),
                    number if isinstance(number, int | str) else 0,
                    str(told.get("country", "")),
                    str(told.get("type", "")),
                )
            )
    return tuple(found)


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
    merged = LaneGroup(f"{road.id}:{side}", area, road=road, lanes=lanes)
    opposites = (group.__dict__["_opposite"] for group in groups)
    _set(merged, "_opposite", next((opposite for opposite in opposites if opposite is not None), None))
    return merged


def _link_sections(section_features: list[MapFeature], lane_features: list[MapFeature], elements: Elements) -> None:
    listed: dict[str, list[LaneSection]] = {}
    for feature in section_features:
        lane = _first(elements.lanes, feature, "lane")
        if lane is None:
            continue
        section = LaneSection(
            feature.id,
            cast("Polygon | MultiPolygon", feature.shape),
            feature.properties,
            lane.orientation,
            lane=lane,
            centerline=lane.centerline,
            openDriveID=_number(feature),
        )
        elements.sections[feature.id] = _along(section, feature)
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


def _number(feature: MapFeature) -> int | None:
    number = feature.properties.get("number")
    return number if isinstance(number, int) and not isinstance(number, bool) else None


def _link_road_sections(features: list[MapFeature], elements: Elements) -> None:
    listed: dict[str, list[RoadSection]] = {}
    for feature in features:
        road = _first(elements.roads, feature, "road")
        if road is None:
            continue
        section = RoadSection(
            feature.id,
            cast("Polygon | MultiPolygon", feature.shape),
            feature.properties,
            road=road,
            forwardLanes=_found(elements.sections, feature, "forward"),
            backwardLanes=_found(elements.sections, feature, "backward"),
        )
        elements.road_sections[feature.id] = _along(section, feature)
        listed.setdefault(road.id, []).append(section)
    for road in elements.roads.values():
        road.sections = tuple(listed.get(road.id, ()))


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
        lane.adjacentLanes = tuple(section.lane for own in lane.sections for section in own.adjacentLanes)


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
        crossing.incomingLanes = by_heading((*_found(elements.lanes, feature, "incoming"), *behind), -1)
        crossing.outgoingLanes = _found(elements.lanes, feature, "outgoing") or by_heading(ahead, 0)


def _link_maneuvers(features: list[MapFeature], elements: Elements) -> None:
    """The ways through each intersection, start lane by start lane, in the map's order if it gives one."""
    for feature in features:
        crossing = elements.intersections[feature.id]
        starts = dict.fromkeys((*_found(elements.lanes, feature, "incoming"), *crossing.incomingLanes))
        crossing.maneuvers = tuple(
            maneuver for lane in starts for maneuver in lane.maneuvers if maneuver.intersection is crossing
        )
        crossing.orientation = direction_of_intersection(crossing)


def _link_ends(feature: MapFeature, element: NetworkElement | None, everything: dict[str, NetworkElement]) -> None:
    """What the map says lies before and behind an element."""
    for key in ("successor", "predecessor"):
        if key in feature.properties and isinstance(element, LongElement):
            _set(element, f"_{key}", _first(everything, feature, key))


def _link_lines(elements: Elements) -> None:
    """The lines of elements that are made of others, and the directions of these."""
    for lane in elements.lanes.values():
        set_lane_lines(lane)
    for section in elements.road_sections.values():
        set_section_lines(section)
        section.orientation = direction_of_lanes(section)
    for road in elements.roads.values():
        for group in road.laneGroups:
            set_group_lines(group, road)
            group.orientation = direction_of_lanes(group)
        set_road_lines(road)
        road.orientation = direction_of_lanes(road)
    for group in elements.groups.values():
        group.orientation = group.orientation if group.road is not None else direction_of_lanes(group)


def _set(element: NetworkElement, name: str, value: Any) -> None:
    """Set one of Scenic's underscored attributes, which programs read but nothing else writes."""
    setattr(element, name, value)
