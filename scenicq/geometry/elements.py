"""Elements of a road network, with the attribute names of Scenic's driving domain.

Scenario programs read these attributes by name, so the spelling (`laneGroups`, `_laneToLeft`) is Scenic's. The objects
refer to each other in circles; `network_builder` fills the references in once and nothing changes them afterwards.
"""

# Scenic's own names, which programs use, are in mixed case.
# ruff: noqa: N802, N815

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

from shapely.geometry import LineString, MultiPolygon, Polygon

from scenicq.geometry.regions import PolygonSet, PolylineSet
from scenicq.geometry.road_direction import RoadDirection

__all__ = [
    "Curb",
    "Intersection",
    "Lane",
    "LaneGroup",
    "LaneSection",
    "LongElement",
    "Maneuver",
    "MissingElementError",
    "NetworkElement",
    "PedestrianCrossing",
    "Road",
    "RoadSection",
    "Shoulder",
    "Sidewalk",
    "Signal",
    "keeps_left",
]


_Element = TypeVar("_Element")


class MissingElementError(LookupError):
    """An attribute such as `laneToLeft` names an element that the map does not have; Scenic rejects such a scene."""


@dataclass(eq=False, slots=False)
class NetworkElement:
    """Anything of the map that has an area.

    Attributes:
        id: The map's identifier, unique in the network.
        polygon: The area, in metres.
        properties: What else the map says of it.
        orientation: The field that gives the preferred heading inside, if the kind has one.
    """

    id: str
    polygon: Polygon | MultiPolygon = field(repr=False)
    properties: Mapping[str, Any] = field(default_factory=dict[str, Any], repr=False)
    orientation: RoadDirection | None = field(default=None, repr=False)

    @property
    def uid(self) -> str:
        """Scenic's name for the identifier."""
        return self.id

    @property
    def name(self) -> str:
        """What messages call the element."""
        return f"{type(self).__name__} {self.id}"

    @cached_property
    def region(self) -> PolygonSet:
        """The element's area as a region."""
        return PolygonSet((self.polygon,), self.name, self.orientation, (self.id,))


@dataclass(eq=False)
class LongElement(NetworkElement):
    """An element that runs along a line, and has others before and after it.

    Attributes:
        centerline: Polylines in the direction of travel, of a sidewalk in the road's, or None where the map gives none.
        left_edge, right_edge: Its sides, in the direction of travel beside them, or None where the map gives none.
    """

    centerline: PolylineSet | None = field(default=None, repr=False, kw_only=True)
    left_edge: PolylineSet | None = field(default=None, repr=False, kw_only=True)
    right_edge: PolylineSet | None = field(default=None, repr=False, kw_only=True)
    _predecessor: NetworkElement | None = field(default=None, repr=False, kw_only=True)
    _successor: NetworkElement | None = field(default=None, repr=False, kw_only=True)

    @property
    def predecessor(self) -> NetworkElement:
        """The first element that leads here; MissingElementError if there is none."""
        return _present(self._predecessor, self, "predecessor")

    @property
    def successor(self) -> NetworkElement:
        """The first element that this one leads to; MissingElementError if there is none."""
        return _present(self._successor, self, "successor")


@dataclass(eq=False)
class LaneSection(LongElement):
    """A piece of a lane along which its neighbours stay the same.

    Attributes:
        lane: The lane.
        group: The lane's group, if the map has one.
        road: The lane's road, if the map has one.
        isForward: Whether it runs in its road's forward direction; True where the map doesn't say.
        _laneToLeft, _laneToRight: Neighbouring sections or None; the names without underscore raise instead.
        _fasterLane, _slowerLane: Neighbours in the same direction towards and away from the road's middle.
        openDriveID: Its number in the map's cross-section of the road, or None where the map doesn't say.
    """

    lane: Lane = field(repr=False, kw_only=True)
    group: LaneGroup | None = field(default=None, repr=False, kw_only=True)
    road: Road | None = field(default=None, repr=False, kw_only=True)
    isForward: bool = field(default=True, kw_only=True)
    _laneToLeft: LaneSection | None = field(default=None, repr=False, kw_only=True)
    _laneToRight: LaneSection | None = field(default=None, repr=False, kw_only=True)
    _fasterLane: LaneSection | None = field(default=None, repr=False, kw_only=True)
    _slowerLane: LaneSection | None = field(default=None, repr=False, kw_only=True)
    openDriveID: int | None = field(default=None, repr=False, kw_only=True)

    @property
    def laneToLeft(self) -> LaneSection:
        """The section to the left; MissingElementError if there is none."""
        return _present(self._laneToLeft, self, "lane to its left")

    @property
    def laneToRight(self) -> LaneSection:
        """The section to the right; MissingElementError if there is none."""
        return _present(self._laneToRight, self, "lane to its right")

    @property
    def fasterLane(self) -> LaneSection:
        """The faster neighbour; MissingElementError if there is none."""
        return _present(self._fasterLane, self, "faster lane")

    @property
    def slowerLane(self) -> LaneSection:
        """The slower neighbour; MissingElementError if there is none."""
        return _present(self._slowerLane, self, "slower lane")

    @property
    def adjacentLanes(self) -> tuple[LaneSection, ...]:
        """The neighbours that exist, left first."""
        return tuple(section for section in (self._laneToLeft, self._laneToRight) if section is not None)


@dataclass(eq=False)
class Lane(LongElement):
    """A lane.

    Attributes:
        group: Its group, if the map has one.
        road: Its road, if the map has one.
        sections: Its sections in the direction of travel; a lane that the map doesn't cut is its own single section.
        adjacentLanes: Neighbouring lanes, section by section, left first.
        maneuvers: Ways on from its end.
        predecessors: Lanes that lead here.
        successors: Lanes that it leads to.
        number: Its number among the elements of its map; -1 of one that is in none.
    """

    group: LaneGroup | None = field(default=None, repr=False, kw_only=True)
    road: Road | None = field(default=None, repr=False, kw_only=True)
    sections: tuple[LaneSection, ...] = field(default=(), repr=False, kw_only=True)
    adjacentLanes: tuple[Lane, ...] = field(default=(), repr=False, kw_only=True)
    maneuvers: tuple[Maneuver, ...] = field(default=(), repr=False, kw_only=True)
    predecessors: tuple[Lane, ...] = field(default=(), repr=False, kw_only=True)
    successors: tuple[Lane, ...] = field(default=(), repr=False, kw_only=True)
    number: int = field(default=-1, repr=False, kw_only=True)

    @property
    def continued(self) -> frozenset[int]:
        """The numbers of the lanes that it continues: itself, and those that lead to it."""
        return frozenset(each.number for each in (self, *self.predecessors))

    @property
    def isForward(self) -> bool:
        """Whether it runs in its road's forward direction."""
        return self.sections[0].isForward


@dataclass(eq=False)
class LaneGroup(LongElement):
    """The lanes of a road that run in one direction.

    Attributes:
        road: Its road, if the map has one.
        lanes: Its lanes, in the map's order.
        _opposite: The group of the other direction, or None; `opposite` raises instead.
    """

    road: Road | None = field(default=None, repr=False, kw_only=True)
    lanes: tuple[Lane, ...] = field(default=(), repr=False, kw_only=True)
    _opposite: LaneGroup | None = field(default=None, repr=False, kw_only=True)

    @property
    def opposite(self) -> LaneGroup:
        """The group of the other direction; MissingElementError if there is none."""
        return _present(self._opposite, self, "opposite lane group")


@dataclass(eq=False)
class Road(LongElement):
    """A road between intersections, or the part of one that crosses an intersection.

    Attributes:
        lanes: All lanes, those of the forward group first.
        forwardLanes: The group of the forward direction, or None.
        backwardLanes: The group of the other direction, or None.
        laneGroups: Those of the two that exist.
        intersection: The intersection that it lies in, or None.
        sections: Its cuts across all lanes, from start to end; none where the map gives none.
        signals: Its signals; none where the map gives none.
    """

    lanes: tuple[Lane, ...] = field(default=(), repr=False, kw_only=True)
    forwardLanes: LaneGroup | None = field(default=None, repr=False, kw_only=True)
    backwardLanes: LaneGroup | None = field(default=None, repr=False, kw_only=True)
    laneGroups: tuple[LaneGroup, ...] = field(default=(), repr=False, kw_only=True)
    intersection: Intersection | None = field(default=None, repr=False, kw_only=True)
    sections: tuple[RoadSection, ...] = field(default=(), repr=False, kw_only=True)
    signals: tuple[Signal, ...] = field(default=(), repr=False, kw_only=True)

    @property
    def is1Way(self) -> bool:
        """Whether it has lanes in one direction only."""
        return self.forwardLanes is None or self.backwardLanes is None


@dataclass(eq=False)
class RoadSection(LongElement):
    """A piece of a road along which its lanes stay the same.

    Attributes:
        road: The road.
        forwardLanes: Its lane sections in the road's direction, the rightmost first.
        backwardLanes: Those in the other direction, the one nearest to the middle first.
    """

    road: Road = field(repr=False, kw_only=True)
    forwardLanes: tuple[LaneSection, ...] = field(default=(), repr=False, kw_only=True)
    backwardLanes: tuple[LaneSection, ...] = field(default=(), repr=False, kw_only=True)

    @property
    def lanes(self) -> tuple[LaneSection, ...]:
        """All lane sections, from right to left."""
        return self.forwardLanes + self.backwardLanes

    @property
    def lanesByOpenDriveID(self) -> dict[int, LaneSection]:
        """The lane sections by their numbers, as far as the map gives any."""
        return {lane.openDriveID: lane for lane in self.lanes if lane.openDriveID is not None}


@dataclass(frozen=True, slots=True, eq=False)
class Signal:
    """A traffic light or sign.

    Attributes:
        uid: Unique in its map.
        openDriveID: The map's own identifier.
        country: Whose types these are.
        type: What it is, in the country's numbers.
    """

    uid: str
    openDriveID: int | str
    country: str
    type: str

    @property
    def isTrafficLight(self) -> bool:
        """Whether it is a traffic light."""
        return self.type == "1000001"


@dataclass(eq=False)
class Intersection(NetworkElement):
    """An intersection.

    Attributes:
        roads: The roads that the map lists for it.
        lanes: The lanes of those roads that lie inside.
        incomingLanes: Lanes that end at it, by the heading from the middle of their ends, from -pi on.
        outgoingLanes: Lanes that start at it, in the map's order if it gives one, else as those.
        maneuvers: Ways through it, start lane by start lane.
        signals: The signals of the roads inside; none where the map gives none.
    """

    roads: tuple[Road, ...] = field(default=(), repr=False, kw_only=True)
    lanes: tuple[Lane, ...] = field(default=(), repr=False, kw_only=True)
    incomingLanes: tuple[Lane, ...] = field(default=(), repr=False, kw_only=True)
    outgoingLanes: tuple[Lane, ...] = field(default=(), repr=False, kw_only=True)
    maneuvers: tuple[Maneuver, ...] = field(default=(), repr=False, kw_only=True)
    signals: tuple[Signal, ...] = field(default=(), repr=False, kw_only=True)

    @property
    def is3Way(self) -> bool:
        """Whether three roads meet here."""
        return self._meeting() == 3

    @property
    def is4Way(self) -> bool:
        """Whether four roads meet here."""
        return self._meeting() == 4

    def _meeting(self) -> int:
        return sum(road.intersection is not self for road in self.roads)


@dataclass(frozen=True, slots=True, eq=False)
class Maneuver:
    """A way on from the end of a lane.

    Attributes:
        startLane: Where it starts.
        endLane: Where it ends.
        connectingLane: The lane inside the intersection in between, or None where the lanes meet directly.
        intersection: The intersection that it crosses, or None.
    """

    startLane: Lane
    endLane: Lane
    connectingLane: Lane | None = None
    intersection: Intersection | None = None


@dataclass(eq=False)
class PedestrianCrossing(NetworkElement):
    """A crosswalk."""


@dataclass(eq=False)
class Sidewalk(LongElement):
    """A sidewalk.

    Attributes:
        road: Its road, if the map has one.
    """

    road: Road | None = field(default=None, repr=False, kw_only=True)


@dataclass(eq=False)
class Shoulder(LongElement):
    """A shoulder of a road.

    Attributes:
        road: Its road, if the map has one.
    """

    road: Road | None = field(default=None, repr=False, kw_only=True)


@dataclass(frozen=True, slots=True, eq=False)
class Curb:
    """A curb.

    Attributes:
        id: The map's identifier.
        line: Where it runs, in metres.
        group: The lane group whose curb it is, if the map says so.
    """

    id: str
    line: LineString
    group: LaneGroup | None = None


def keeps_left(section: LaneSection) -> bool:
    """Whether traffic keeps to the left there; the map says so of the section or of its lane."""
    return "left" in (section.properties.get("traffic"), section.lane.properties.get("traffic"))


def _present(element: _Element | None, owner: NetworkElement, what: str) -> _Element:
    if element is None:
        raise MissingElementError(f"{owner.name} has no {what}")
    return element
