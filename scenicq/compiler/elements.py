"""What a program may read of the map: the network, its elements and the ways through intersections.

The names are those of Scenic's driving domain.
"""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, Any

import shapely

from scenicq.compiler.element_lookups import LOOKUPS
from scenicq.compiler.element_methods import METHODS, find_among, method_of, nominal_directions
from scenicq.compiler.lookups import look_up
from scenicq.compiler.road_attributes import computed_attribute, computed_names, is_computed
from scenicq.compiler.values import Builtin, ModelValue, Module, fail
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.geometry.angles import heading_of, normalize
from scenicq.geometry.elements import (
    Intersection,
    Lane,
    LaneGroup,
    LaneSection,
    LongElement,
    Maneuver,
    MissingElementError,
    NetworkElement,
    Road,
    RoadSection,
    Shoulder,
    Sidewalk,
    Signal,
)
from scenicq.geometry.fields import VectorField
from scenicq.geometry.network import Network
from scenicq.geometry.regions import Region

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["MANEUVER_TYPES", "MISSING", "is_of_elements", "names_of", "of_element", "of_network"]

MISSING = object()
"""What stands for an attribute that does not exist."""

MANEUVER_TYPES = Module("ManeuverType", {name: name for name in ("STRAIGHT", "LEFT_TURN", "RIGHT_TURN", "U_TURN")})
"""The kinds of maneuvers, each a name."""

_TURN = math.radians(20)
"""Change of direction from which on a way through an intersection is a turn."""
_ATTRIBUTES: dict[type, frozenset[str]] = {
    NetworkElement: frozenset("id name orientation uid".split()),
    LongElement: frozenset("_predecessor _successor centerline predecessor successor".split()),
    LaneSection: frozenset(
        "_fasterLane _laneToLeft _laneToRight _slowerLane adjacentLanes fasterLane group isForward lane laneToLeft "
        "laneToRight openDriveID road slowerLane".split()
    ),
    Lane: frozenset("adjacentLanes group isForward maneuvers predecessors road sections successors".split()),
    LaneGroup: frozenset("_opposite lanes opposite road".split()),
    Road: frozenset("backwardLanes forwardLanes intersection is1Way laneGroups lanes sections signals".split()),
    RoadSection: frozenset("backwardLanes forwardLanes lanes lanesByOpenDriveID road".split()),
    Intersection: frozenset("incomingLanes is3Way is4Way lanes maneuvers outgoingLanes roads signals".split()),
    Sidewalk: frozenset({"road"}),
    Shoulder: frozenset({"road"}),
    Maneuver: frozenset("connectingLane endLane intersection startLane".split()),
    Signal: frozenset("country isTrafficLight openDriveID type uid".split()),
}
"""What a program may read as it stands, for each kind; what else a class has is no part of the language."""
_NETWORK = frozenset(
    "lanes laneSections laneGroups roads connectingRoads allRoads intersections crossings sidewalks shoulders "
    "laneRegion roadRegion intersectionRegion crossingRegion sidewalkRegion shoulderRegion drivableRegion "
    "walkableRegion curbRegion roadDirection".split()
)
_MANEUVER = frozenset({"type", "conflictingManeuvers", "reverseManeuvers"})


def names_of(value: Network | NetworkElement | Maneuver | Signal) -> set[str]:
    """The attributes that a value may have."""
    if isinstance(value, Network):
        own = _NETWORK | LOOKUPS.keys() | METHODS | value.otherRegions.keys()
        return {"findPointIn", *own, *computed_names(value)}
    own = _own_names(type(value))
    if isinstance(value, Signal):
        return set(own)
    if isinstance(value, Maneuver):
        return {*own, *_MANEUVER}
    return set(own) | computed_names(value) | (METHODS if value.orientation is not None else set())


@cache
def _own_names(kind: type) -> frozenset[str]:
    """What a program may read of the values of a class as it stands."""
    return frozenset(name for base, names in _ATTRIBUTES.items() if issubclass(kind, base) for name in names)


def is_of_elements(name: str) -> bool:
    """Whether elements of some kind have an attribute; those without one of their own only have what others have."""
    own = any(name in names for kind, names in _ATTRIBUTES.items() if issubclass(kind, NetworkElement))
    return own or name in METHODS or is_computed(name)


def of_network(run: Interpreter, network: Network, name: str, span: Span) -> ModelValue:
    """An attribute of the network, or `MISSING`."""
    if name == "nominalDirectionsAt":
        return nominal_directions(run, network)
    if name in LOOKUPS:

        def find(span: Span, point: ModelValue, reject: ModelValue = None) -> ModelValue:
            return look_up(run, network, name, point, reject, span)

        return Builtin(name, find)
    if name == "findPointIn":

        def find_in(span: Span, point: ModelValue, elems: ModelValue, reject: ModelValue = None) -> ModelValue:
            return find_among(run, point, elems, reject, span)

        return Builtin(name, find_in)
    worked = computed_attribute(run, network, name, span)
    if worked is not None:
        return worked[0]
    if name in network.otherRegions:
        return build.constant(network.otherRegions[name], span)
    if name not in _NETWORK:
        if (kind := name.removesuffix("Region")) in ("", name):
            return MISSING
        hints = tuple(f"it has `network.{each}`" for each in sorted(network.otherRegions))
        raise fail("map-lacks", f"the map has no elements of the kind `{kind}`", span, "not in this map", hints)
    found = getattr(network, name)
    return build.constant(found, span) if name.endswith("Region") or name == "roadDirection" else found


def of_element(run: Interpreter, value: NetworkElement | Maneuver | Signal, name: str, span: Span) -> ModelValue:
    """An attribute of an element, maneuver or signal, or `MISSING`.

    Raises:
        ScenarioError: map-lacks, where Scenic would reject the scene.
    """
    if isinstance(value, Maneuver) and name in _MANEUVER:
        return _of_maneuver(value, name)
    if isinstance(value, NetworkElement):
        worked = computed_attribute(run, value, name, span)
        if worked is not None:
            return worked[0]
        method = method_of(run, value, name)
        if method is not None:
            return method
    if name not in _own_names(type(value)):
        return MISSING
    try:
        found: Any = getattr(value, name)
    except MissingElementError as error:
        hints = (f"`_{name}` is None there: exclude such elements by a condition",)
        raise fail("map-lacks", f"the map says that {error}", span, "not in this map", hints) from None
    if found is None and name == "centerline":
        raise fail("map-lacks", f"the map gives no centreline for {value.name}", span, "not in this map")  # type: ignore[union-attr]
    return build.constant(found, span) if isinstance(found, Region | VectorField) else found


def _of_maneuver(maneuver: Maneuver, name: str) -> ModelValue:
    if name == "type":
        return _type_of(maneuver)
    if maneuver.intersection is None:
        return ()
    others = maneuver.intersection.maneuvers
    if name == "reverseManeuvers":
        start, end = maneuver.startLane.road, maneuver.endLane.road
        return tuple(each for each in others if each.startLane.road is end and each.endLane.road is start)
    own = _way(maneuver.connectingLane)
    return tuple(
        each
        for each in others
        if each.startLane is not maneuver.startLane and own is not None
        if (way := _way(each.connectingLane)) is not None and shapely.intersects(own, way)
    )


def _way(lane: Lane | None) -> Any:
    """The centreline of a lane as one geometry; its area where there is none."""
    if lane is None:
        return None
    # a union would make new nodes, and lines that meet at their ends would miss each other
    return shapely.multilinestrings(lane.centerline.lines) if lane.centerline else lane.polygon


def _type_of(maneuver: Maneuver) -> str:
    """The kind of a way through an intersection, by its change of direction, as Scenic guesses it."""
    lane = maneuver.connectingLane
    if lane is None:
        return "STRAIGHT"
    if maneuver.startLane.road is not None and maneuver.startLane.road is maneuver.endLane.road:
        return "U_TURN"
    if lane.centerline is None:
        return "STRAIGHT"
    first, last = lane.centerline.lines[0].coords, lane.centerline.lines[-1].coords
    enter = heading_of(first[1][0] - first[0][0], first[1][1] - first[0][1])
    leave = heading_of(last[-1][0] - last[-2][0], last[-1][1] - last[-2][1])
    turn = normalize(leave - enter)
    return "LEFT_TURN" if turn >= _TURN else "RIGHT_TURN" if turn <= -_TURN else "STRAIGHT"
