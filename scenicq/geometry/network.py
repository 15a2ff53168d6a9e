"""The road network of one map.

`Network` has the attribute names of Scenic's driving domain, because scenario programs use them; it is built from map
features, the same values that the store keeps.
"""

# Scenic's own names, which programs use, are in mixed case.
# ruff: noqa: N802

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cached_property, partial
from typing import TypeVar, cast

from shapely import STRtree
from shapely.geometry import LineString, MultiPolygon, Polygon

from scenicq.geometry import shapes
from scenicq.geometry.centerlines import direction_along, road_direction
from scenicq.geometry.curbs import along_lanes, right_edges
from scenicq.geometry.elements import (
    Curb,
    Intersection,
    Lane,
    LaneGroup,
    LaneSection,
    NetworkElement,
    PedestrianCrossing,
    Road,
    RoadSection,
    Shoulder,
    Sidewalk,
)
from scenicq.geometry.features import MapFeature, dangling, read_geojson, region_name
from scenicq.geometry.fields import VectorField
from scenicq.geometry.followed_direction import FollowedDirection
from scenicq.geometry.map_area import MapArea
from scenicq.geometry.map_traits import MapTraits
from scenicq.geometry.network_builder import Elements, link
from scenicq.geometry.regions import SLACK, DeferredPolylines, PolygonSet, PolylineSet, Region
from scenicq.geometry.road_direction import DeferredDirection, RoadDirection, along_lines
from scenicq.geometry.shapes import Shape

__all__ = ["TOLERANCE", "MapFeature", "Network", "read_geojson"]

_Element = TypeVar("_Element", bound=NetworkElement)

TOLERANCE = 0.05
"""Metres beside an element that still count as in it where no element holds a point (Scenic's `tolerance`)."""


class Network:
    """A map's elements, regions and direction of traffic.

    Elements are read when something asks for more than which kinds of them the map has.

    Attributes:
        name: The map's name.
    """

    def __init__(
        self,
        name: str,
        features: Iterable[MapFeature] | Callable[[], Iterable[MapFeature]],
        traits: MapTraits | None = None,
    ) -> None:
        """Take the features, but for those with an id that is already taken; all else is made when it is asked for.

        Args:
            name: The map's name.
            features: What it is built from, or what reads that.
            traits: What is known of the features before they are read; None for nothing.
        """
        self.name = name
        self._read = _Read(features if callable(features) else partial(tuple[MapFeature, ...], features))
        self._traits = traits
        if not callable(features):
            _ = self._read.kept

    @property
    def features(self) -> tuple[MapFeature, ...]:
        """What it is built from."""
        return self._read.features

    @property
    def is_read(self) -> bool:
        """Whether anything has asked for more than the map's traits."""
        return "kept" in vars(self._read)

    @property
    def parts(self) -> dict[str, object]:
        """Itself, and what was made of it so far that can be had of any network, by names for `part`."""
        made = {name: part for name, part in vars(self).items() if name.endswith("Region") or name == "roadDirection"}
        return {"": self, **made, **self.otherRegions}

    def part(self, name: str) -> object:
        """A part by its name among the `parts` of a network with the same traits."""
        return self if not name else self.otherRegions.get(name) or getattr(self, name)

    @cached_property
    def kinds(self) -> frozenset[str]:
        """The kinds of elements that the map has."""
        known = self._traits
        return frozenset(feature.kind for feature in self.features) if known is None else known.kinds

    @cached_property
    def problems(self) -> tuple[str, ...]:
        """Repeated ids (left out) and dangling references (passed over), as facts for the user."""
        return (*self._read.kept[1], *(message for _, message in dangling(self.features)))

    @cached_property
    def roadDirection(self) -> RoadDirection:
        """The direction of traffic, where lanes overlap that of ways through intersections first, as Scenic has it."""
        nowhere = None if self._traits is None else not self._traits.directed
        return DeferredDirection(
            "roadDirection", self._read.direction, nowhere=nowhere, has_beside="shoulder" in self.kinds
        )

    # --- elements

    @cached_property
    def _linked(self) -> Elements:
        return self._read.linked

    @cached_property
    def lanes(self) -> tuple[Lane, ...]:
        """All lanes."""
        return tuple(self._linked.lanes.values())

    @cached_property
    def laneSections(self) -> tuple[LaneSection, ...]:
        """All sections of lanes."""
        return tuple(self._linked.sections.values())

    @cached_property
    def roadSections(self) -> tuple[RoadSection, ...]:
        """All sections of roads outside of intersections."""
        return tuple(section for road in self.roads for section in road.sections)

    @cached_property
    def laneGroups(self) -> tuple[LaneGroup, ...]:
        """All groups of lanes."""
        return tuple(self._linked.groups.values())

    @cached_property
    def allRoads(self) -> tuple[Road, ...]:
        """All roads."""
        return tuple(self._linked.roads.values())

    @cached_property
    def roads(self) -> tuple[Road, ...]:
        """The roads outside of intersections."""
        return tuple(road for road in self.allRoads if road.intersection is None)

    @cached_property
    def connectingRoads(self) -> tuple[Road, ...]:
        """The roads inside intersections."""
        return tuple(road for road in self.allRoads if road.intersection is not None)

    @cached_property
    def intersections(self) -> tuple[Intersection, ...]:
        """All intersections."""
        return tuple(self._linked.intersections.values())

    @cached_property
    def crossings(self) -> tuple[PedestrianCrossing, ...]:
        """All pedestrian crossings."""
        return tuple(self._linked.crossings.values())

    @cached_property
    def sidewalks(self) -> tuple[Sidewalk, ...]:
        """All sidewalks."""
        return tuple(self._linked.sidewalks.values())

    @cached_property
    def shoulders(self) -> tuple[Shoulder, ...]:
        """All shoulders."""
        return tuple(self._linked.shoulders.values())

    @cached_property
    def curbs(self) -> tuple[Curb, ...]:
        """All curbs."""
        return tuple(self._linked.curbs.values())

    @cached_property
    def elements(self) -> dict[str, NetworkElement]:
        """All elements that have an area, by id."""
        areas: tuple[tuple[NetworkElement, ...], ...] = (
            self.laneSections,
            self.lanes,
            self.laneGroups,
            self.allRoads,
            tuple(self._linked.road_sections.values()),
            self.intersections,
            self.crossings,
            self.sidewalks,
            self.shoulders,
        )
        return {element.id: element for kind in areas for element in kind}

    def __reduce__(self) -> tuple[type[Network], tuple[str, tuple[MapFeature, ...]]]:
        """Rebuild from the features: the elements refer to each other too deeply to be pickled."""
        return type(self), (self.name, self.features)

    def __repr__(self) -> str:
        """Name and size."""
        return f"Network({self.name!r}, {len(self.features)} features)"

    @cached_property
    def followedDirection(self) -> FollowedDirection:
        """The direction of traffic for the steps of a way along it: off the road there is one more."""
        kinds = ("lane", "road", "intersection", "shoulder", "drivable")
        paved = tuple(feature.shape for feature in self.features if feature.kind in kinds)
        return FollowedDirection(self.roadDirection.lanes, base=self.roadDirection, paved=paved)

    # --- regions

    def curbs_of(self, group: LaneGroup) -> list[LineString]:
        """The curbs that the map calls those of a lane group, in the direction of traffic."""
        return self._curb_lines.get(group, [])

    def curbs_near(self, area: Shape) -> list[LineString]:
        """The curbs of the map outside of intersections that meet an area, in the direction of traffic."""
        return [self._outer_curbs[number] for number in sorted(shapes.tree_query(self._curb_tree, area).tolist())]

    @cached_property
    def _curb_lines(self) -> dict[LaneGroup | None, list[LineString]]:
        found: dict[LaneGroup | None, list[LineString]] = {}
        for curb in self.curbs:
            traffic = self.roadDirection if curb.group is None else along_lanes(curb.group.lanes) or self.roadDirection
            found.setdefault(curb.group, []).append(traffic.forward(curb.line))
        return found

    @cached_property
    def _outer_curbs(self) -> tuple[LineString, ...]:
        def is_inside(group: LaneGroup | None) -> bool:
            roads = [group.road, *(lane.road for lane in group.lanes)] if group is not None else []
            return any(road is not None and road.intersection is not None for road in roads)

        return tuple(line for group, lines in self._curb_lines.items() if not is_inside(group) for line in lines)

    @cached_property
    def _curb_tree(self) -> STRtree:
        return STRtree(self._outer_curbs)

    @cached_property
    def laneRegion(self) -> PolygonSet:
        """All lanes."""
        return self._region("lane", ("lane",), _always(self.roadDirection))

    @cached_property
    def roadRegion(self) -> PolygonSet:
        """The roads outside of intersections."""
        empty = None if "road" in self.kinds else True
        return MapArea("road", self._read.roads, _always(self.roadDirection), empty)

    @cached_property
    def intersectionRegion(self) -> PolygonSet:
        """All intersections."""
        return self._region("intersection", ("intersection",), _always(self.roadDirection))

    @cached_property
    def crossingRegion(self) -> PolygonSet:
        """All pedestrian crossings."""
        return self._region("crossing", ("crossing",))

    @cached_property
    def sidewalkRegion(self) -> PolygonSet:
        """All sidewalks."""
        return self._region("sidewalk", ("sidewalk",), self._along("sidewalk"))

    @cached_property
    def shoulderRegion(self) -> PolygonSet:
        """All shoulders."""
        return self._region("shoulder", ("shoulder",), self._along("shoulder", self.roadDirection))

    @cached_property
    def curbRegion(self) -> PolylineSet:
        """All curbs, in the direction of traffic; where the map names none, the right edges of the outermost lanes.

        Scenic makes its curbs so from its lane groups. Those of groups inside intersections are no part of it.
        """
        # another network, as this one has the region
        again = partial(Network, self.name, partial(_features_of, self._read), self._traits)
        return DeferredPolylines("curb", lambda: again()._curbs_everywhere())

    def _curbs_everywhere(self) -> PolylineSet:
        lines = self._outer_curbs
        if not lines:
            lines = right_edges(self.lanes, [crossing.polygon for crossing in self.intersections])
        return PolylineSet(lines, "curb", along_lines(lines, "curb"))

    @cached_property
    def drivableRegion(self) -> PolygonSet:
        """Lanes, roads, intersections and what the map calls drivable."""
        return self._region("drivable", ("lane", "road", "intersection", "drivable"), _always(self.roadDirection))

    @cached_property
    def walkableRegion(self) -> PolygonSet:
        """Sidewalks and crossings."""
        along = _always(None) if "crossing" in self.kinds else self._along("sidewalk")
        return self._region("walkable", ("sidewalk", "crossing"), along)

    @cached_property
    def otherRegions(self) -> dict[str, PolygonSet]:
        """The regions of kinds of elements that Scenic does not know, by name: `carparkAreaRegion`."""
        kinds: dict[str, tuple[str, ...]] = {}
        for kind in sorted(self.kinds):
            if (name := region_name(kind)) is not None:
                kinds[name] = *kinds.get(name, ()), kind
        return {name: self._region(" or ".join(found), found) for name, found in kinds.items()}

    def region(self, kind: str) -> Region | None:
        """The region of all features of a kind, or None if the map has none."""
        if kind not in self.kinds:
            return None
        named: dict[str, str] = {name: f"{name}Region" for name in ("lane", "road", "intersection", "crossing")}
        named |= {name: f"{name}Region" for name in ("sidewalk", "shoulder", "curb")}
        return cast(Region, getattr(self, named[kind])) if kind in named else self._region(kind, (kind,))

    # --- what lies at a point

    # The first that holds the point, in the map's order; else the first within the tolerance. So does Scenic.

    def laneAt(self, x: float, y: float) -> Lane | None:
        """The lane at a point."""
        return self._first(((self.lanes, "lane"),), x, y)

    def lanesAt(self, x: float, y: float) -> list[Lane]:
        """All lanes at a point, which overlap in intersections; in the map's order."""
        return self._all(((self.lanes, "lane"),), x, y)

    def laneSectionAt(self, x: float, y: float) -> LaneSection | None:
        """The lane section at a point, one of the lane there."""
        lane = self.laneAt(x, y)
        return _first_within(lane.sections, x, y) if lane else None

    def laneGroupAt(self, x: float, y: float) -> LaneGroup | None:
        """The lane group at a point: one of the road there, else that of the lane there, else any."""
        road, lane = self.roadAt(x, y), self.laneAt(x, y)
        here = self._all(((self.laneGroups, "lane_group"),), x, y)
        own = (group for group in here if road is not None and group.road is road)
        return next(own, None) or (lane.group if lane else None) or next(iter(here), None)

    def roadAt(self, x: float, y: float) -> Road | None:
        """The road at a point, else that of the lane there."""
        road, lane = self._first(((self.allRoads, "road"),), x, y), self.laneAt(x, y)
        return road or (lane.road if lane else None)

    def intersectionAt(self, x: float, y: float) -> Intersection | None:
        """The intersection at a point."""
        return self._first(((self.intersections, "intersection"),), x, y)

    def crossingAt(self, x: float, y: float) -> PedestrianCrossing | None:
        """The pedestrian crossing at a point."""
        return self._first(((self.crossings, "crossing"),), x, y)

    def sidewalkAt(self, x: float, y: float) -> Sidewalk | None:
        """The sidewalk at a point."""
        return self._first(((self.sidewalks, "sidewalk"),), x, y)

    def shoulderAt(self, x: float, y: float) -> Shoulder | None:
        """The shoulder at a point."""
        return self._first(((self.shoulders, "shoulder"),), x, y)

    def elementAt(self, x: float, y: float) -> NetworkElement | None:
        """The element at a point, in the order of `top_level`."""
        names = ("intersection", "main_road", "shoulder", "sidewalk", "crossing", "lane")
        return self._first(tuple(zip(self.top_level, names, strict=True)), x, y)

    @property
    def top_level(self) -> tuple[tuple[NetworkElement, ...], ...]:
        """The elements that `elementAt` knows, in Scenic's order; crossings, and lanes without roads, come last."""
        lanes = () if self.roads else self.lanes
        return (self.intersections, self.roads, self.shoulders, self.sidewalks, self.crossings, lanes)

    # --- how these are made

    @cached_property
    def _indices(self) -> dict[str, tuple[PolygonSet, list[int]]]:
        return {}

    def _first(self, kinds: Sequence[tuple[Sequence[_Element], str]], x: float, y: float) -> _Element | None:
        return next(iter(self._all(kinds, x, y)), None)

    def _all(self, kinds: Sequence[tuple[Sequence[_Element], str]], x: float, y: float) -> list[_Element]:
        """The elements that hold a point, of the first kind of which any does; else those within the tolerance."""
        here = shapes.point(x, y)
        for distance in (SLACK, TOLERANCE):
            for elements, kind in kinds:
                region, owners = self._index(elements, kind)
                hits: list[int] = shapes.tree_within(region.tree, here, distance).tolist()
                if hits:
                    return [elements[i] for i in sorted({owners[hit] for hit in hits})]
        return []

    def _index(self, elements: Sequence[NetworkElement], kind: str) -> tuple[PolygonSet, list[int]]:
        """The areas of the elements of a kind, and whose each is."""
        if kind not in self._indices:
            parts = [(piece, i) for i, e in enumerate(elements) for piece in shapes.simple_parts([e.polygon])]
            self._indices[kind] = PolygonSet(tuple(cast(Polygon, p) for p, _ in parts), kind), [i for _, i in parts]
        return self._indices[kind]

    def _along(self, kind: str, otherwise: VectorField | None = None) -> Callable[[], VectorField | None]:
        """What gives the direction of the centrelines of all elements of a kind, if the map gives them."""
        read, there = self._read, kind in self.kinds
        return lambda: (direction_along(read.features, kind) if there else None) or otherwise

    def _region(
        self, name: str, kinds: tuple[str, ...], orientation: Callable[[], VectorField | None] | None = None
    ) -> PolygonSet:
        read = self._read

        def make() -> PolygonSet:
            return _region_of([feature for feature in read.features if feature.kind in kinds], name)

        return MapArea(name, make, orientation or _always(None), self.kinds.isdisjoint(kinds))


class _Read:
    """What is read of a map, when something asks for it: a network's regions know this, and not the network.

    So networks go when nobody has them any more, and not when somebody looks for circles.
    """

    def __init__(self, source: Callable[[], Iterable[MapFeature]]) -> None:
        """Take what reads the features."""
        self._source = source

    @cached_property
    def kept(self) -> tuple[dict[str, MapFeature], list[str]]:
        """The features by id, and what is said of the others."""
        kept: dict[str, MapFeature] = {}
        repeated: list[str] = []
        for feature in self._source():
            if feature.id in kept:
                repeated.append(f"{feature.kind} `{feature.id}`: the id is used before")
            else:
                kept[feature.id] = feature
        return kept, repeated

    @cached_property
    def features(self) -> tuple[MapFeature, ...]:
        """The features."""
        return tuple(self.kept[0].values())

    @cached_property
    def linked(self) -> Elements:
        """The elements that they make."""
        return link(self.features)

    def direction(self) -> RoadDirection:
        """The direction of traffic, for which elements are linked when one is asked for: many a program never does."""
        return road_direction(self.features, self._ways)

    def _ways(self) -> list[str]:
        """The lanes through intersections, in the order of their maneuvers."""
        if not any(feature.kind == "intersection" for feature in self.features):
            return []
        crossings = self.linked.intersections.values()
        ways = (each.connectingLane for crossing in crossings for each in crossing.maneuvers)
        return [lane.id for lane in ways if lane is not None]

    def roads(self) -> PolygonSet:
        """The roads outside of intersections."""
        inside = {road.id for road in self.linked.roads.values() if road.intersection is not None}
        return _region_of([each for each in self.features if each.kind == "road" and each.id not in inside], "road")


def _features_of(read: _Read) -> tuple[MapFeature, ...]:
    return read.features


def _always(direction: VectorField | None) -> Callable[[], VectorField | None]:
    return lambda: direction


def _region_of(features: Sequence[MapFeature], name: str) -> PolygonSet:
    polygons = tuple(cast("Polygon | MultiPolygon", feature.shape) for feature in features)
    return PolygonSet(polygons, name, None, tuple(feature.id for feature in features))


def _first_within(elements: Sequence[_Element], x: float, y: float) -> _Element | None:
    here = shapes.point(x, y)
    away = [shapes.distance(element.polygon, here) for element in elements]
    return next(
        (e for limit in (SLACK, TOLERANCE) for e, far in zip(elements, away, strict=True) if far <= limit), None
    )
