"""Attributes of map elements that Scenic has and datasets' maps don't say: worked out from where things lie.

A lane group's curb, sidewalk and shoulder are those along its right edge; the crossings of a road or an intersection
those that reach into it. What depends on facts that no map of a dataset holds is an error that says so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar, cast

from shapely.geometry import LineString

from scenicq.compiler.values import ModelValue, fail
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.geometry import shapes
from scenicq.geometry.curbs import right_edges, side_edges
from scenicq.geometry.elements import (
    Intersection,
    Lane,
    LaneGroup,
    LaneSection,
    LongElement,
    NetworkElement,
    PedestrianCrossing,
    Road,
    Shoulder,
    Sidewalk,
)
from scenicq.geometry.network import Network
from scenicq.geometry.regions import PolylineSet, Region, union
from scenicq.geometry.road_direction import along_lines
from scenicq.geometry.shapes import Shape

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["computed_attribute", "computed_names", "is_computed"]

_CURB, _SIDEWALK, _SHOULDER = 5.0, 8.0, 1.0
"""Metres from a road's right edge within which a curb, sidewalk or shoulder belongs to it."""
_SHARE = 1.0
"""Square metres of the strip beside an edge that a sidewalk or shoulder must at least have."""
_INSIDE = 0.5
"""Square metres that a crossing must at least share with the road that it belongs to."""

_Element = TypeVar("_Element", bound=NetworkElement)
_Work = tuple[type, Callable[[Network, Any], ModelValue]]


def _lines(lines: Sequence[Shape], name: str) -> ModelValue:
    own = cast("tuple[LineString, ...]", tuple(lines))
    return build.constant(PolylineSet(own, name, along_lines(own, name))) if own else None


def _edges(group: LaneGroup) -> tuple[LineString, ...]:
    """The right edge of a group's lanes, as far as it is no border between two of them."""
    return right_edges(group.lanes, [])


def _curb(network: Network, group: LaneGroup) -> ModelValue:
    if named := network.curbs_of(group):
        return _lines(named, f"curb of {group.id}")
    edges = _edges(group)
    if not edges:
        return None
    strip = shapes.band(shapes.union_all(edges), _CURB)
    near = [shapes.intersection(line, strip) for line in network.curbs_near(strip)]
    own = [part for part in shapes.simple_parts(near) if part.length > 0]
    # curbs without a group lie outside of intersections: what comes near inside belongs to other roads
    crossing = group.road is not None and group.road.intersection is not None
    along = sum(part.length for part in own) >= 0.5 * sum(edge.length for edge in edges)
    return _lines(own if along and not crossing else edges, f"curb of {group.id}")


def _beside(group: LaneGroup, candidates: Iterable[_Element], reach: float) -> _Element | None:
    """The element that has most of the strip to the right of a group."""
    edges = _edges(group)
    if not edges:
        return None
    strip = shapes.difference(shapes.band(shapes.union_all(edges), reach), group.polygon)
    shares = [(shapes.intersection(each.polygon, strip).area, each) for each in candidates]
    most, found = max(shares, key=lambda share: share[0], default=(0.0, None))
    return found if most >= _SHARE else None


def _crossings(network: Network, element: NetworkElement) -> tuple[PedestrianCrossing, ...]:
    own = [
        crossing
        for crossing in network.crossings
        if crossing.properties.get("road") == element.id
        or shapes.intersection(crossing.polygon, element.polygon).area > _INSIDE
    ]
    return tuple(own)


def _bike_lane(_: Network, group: LaneGroup) -> Lane | None:
    others = group.road.lanes if group.road else group.lanes
    kinds = ((lane, str(lane.properties.get("lane_type", "")).lower()) for lane in others)
    return next((lane for lane, kind in kinds if kind.startswith(("bike", "biking", "bicycle"))), None)


def _belonging(group: LaneGroup, key: str, candidates: Sequence[_Element], reach: float) -> _Element | None:
    """What the map says belongs to a group; where it says nothing, what lies along its right edge."""
    if key not in group.properties:
        return _beside(group, candidates, reach)
    told = group.properties[key]
    own = {told} if isinstance(told, str) else set(cast("list[str]", told or []))
    return next((each for each in candidates if each.id in own), None)


def _sidewalk(network: Network, group: LaneGroup) -> Sidewalk | None:
    return _belonging(group, "sidewalk", network.sidewalks, _SIDEWALK)


def _shoulder(network: Network, group: LaneGroup) -> Shoulder | None:
    return _belonging(group, "shoulder", network.shoulders, _SHOULDER)


def _sidewalks(network: Network, road: Road) -> tuple[Sidewalk, ...]:
    found = (_sidewalk(network, group) for group in road.laneGroups)
    return tuple(dict.fromkeys(each for each in found if each is not None))


def _sidewalk_region(network: Network, road: Road) -> ModelValue:
    return build.constant(union(*(each.region for each in _sidewalks(network, road))))


def _side(element: LongElement, *, left: bool) -> ModelValue:
    """A side of an element: as the map gives it, else the border of its area or those of its outermost lanes."""
    given = element.left_edge if left else element.right_edge
    if given is not None:
        return build.constant(given)
    name = f"{'left' if left else 'right'} edge of {element.id}"
    match element:
        case Lane() | LaneSection() if element.centerline is not None:
            return _lines(side_edges(element.polygon, element.centerline.lines, left=left), name)
        case LaneGroup():
            return _lines([edge for lane in element.lanes for edge in _outer_edges(lane, left)], name)
        case Road():
            own, other = element.forwardLanes, element.backwardLanes
            if left:
                own, other = other, own
            return _side(own, left=False) if own else _side(other, left=True) if other else None
        case _:
            return None


def _outer_edges(lane: Lane, left: bool) -> Iterable[LineString]:
    """The sides of a lane's sections that are no border to another one of its group."""
    for section in lane.sections:
        beside = section._laneToLeft if left else section._laneToRight  # pyright: ignore[reportPrivateUsage]
        inside = beside is not None and lane.group is not None and beside.group is lane.group
        if not inside and section.centerline is not None:
            yield from side_edges(section.polygon, section.centerline.lines, left=left)


def _speed_limit(_: Network, element: NetworkElement) -> ModelValue:
    limit = element.properties.get("speed_limit")
    return float(limit) if isinstance(limit, int | float) and not isinstance(limit, bool) else None


def _source_id(_: Network, element: NetworkElement) -> ModelValue:
    told = element.properties.get("source_id")
    return told if isinstance(told, int | str) else element.id


def _signals(_: Network, element: Road | Intersection) -> ModelValue:
    return element.signals if "signals" in element.properties else None


def _signalized(_: Network, element: NetworkElement) -> ModelValue:
    says = element.properties.get("signalized")
    return says if isinstance(says, bool) else None


_WORKED_OUT: dict[str, tuple[_Work, ...]] = {
    "network": ((NetworkElement, lambda network, _: network),),
    "speedLimit": ((NetworkElement, _speed_limit),),
    "tags": ((NetworkElement, lambda _, element: frozenset(element.properties.get("tags") or ())),),
    "leftEdge": ((LongElement, lambda _, element: _side(element, left=True)),),
    "rightEdge": ((LongElement, lambda _, element: _side(element, left=False)),),
    "name": ((NetworkElement, lambda _, element: str(element.properties.get("name", ""))),),
    "id": ((NetworkElement, _source_id),),
    "curb": ((LaneGroup, _curb),),
    "sidewalk": ((LaneGroup, _sidewalk),),
    "shoulder": ((LaneGroup, _shoulder),),
    "bikeLane": ((LaneGroup, _bike_lane),),
    "crossings": (
        (Road, _crossings),
        (Intersection, _crossings),
        (Sidewalk, lambda network, _: None if network.crossings else ()),
    ),
    "sections": ((Road, lambda _, road: road.sections or None),),
    "roadSections": ((Network, lambda network, _: network.roadSections or None),),
    "signals": ((Road, _signals), (Intersection, _signals)),
    "openDriveID": ((LaneSection, lambda _, section: section.openDriveID),),
    "sidewalks": ((Road, _sidewalks),),
    "sidewalkRegion": ((Road, _sidewalk_region),),
    "isSignalized": ((Intersection, _signalized),),
    "elements": ((Network, lambda network, _: dict(network.elements)),),
    "driveOnLeft": ((Network, lambda *_: False),),
    "tolerance": ((Network, lambda *_: 0.05),),
}
"""Attributes by name, for each kind of element that has them; some are also there with an underscore."""

_UNDERSCORED = frozenset({"sidewalk", "shoulder", "bikeLane"})
_REQUIRED = _UNDERSCORED | {"curb", "leftEdge", "rightEdge"}
_UNKNOWN: dict[str, tuple[type | tuple[type, ...], str]] = {
    "signals": ((Road, Intersection), "where traffic signals are"),
    "isSignalized": (Intersection, "which intersections have traffic signals"),
    "openDriveID": (LaneSection, "the numbers of lanes in OpenDRIVE"),
    "crossings": (Sidewalk, "which crossings lead to a sidewalk"),
    "sections": (Road, "where roads are cut into sections; those of their lanes are `sections` of these"),
    "roadSections": (Network, "where roads are cut into sections; those of lanes are `laneSections`"),
    "startSidewalk": (PedestrianCrossing, "which sidewalks a crossing joins"),
    "endSidewalk": (PedestrianCrossing, "which sidewalks a crossing joins"),
    "parent": (PedestrianCrossing, "what a crossing belongs to"),
    "centerline": (PedestrianCrossing, "the centrelines of crossings"),
    "vehicleTypes": (NetworkElement, "which vehicles may use a lane"),
}
_REFUSED: dict[str, tuple[type | tuple[type, ...], str]] = {
    "shiftLanes": (Road, "use `shiftedBy` of a lane section"),
}


def is_computed(name: str) -> bool:
    """Whether an attribute is worked out for elements of some kind."""
    return name in _WORKED_OUT or name.removeprefix("_") in _UNDERSCORED


def computed_names(value: NetworkElement | Network) -> set[str]:
    """The attributes that are worked out for a value."""
    found = {name for name, works in _WORKED_OUT.items() if any(isinstance(value, kind) for kind, _ in works)}
    return found | {f"_{name}" for name in found & _UNDERSCORED}


def computed_attribute(
    run: Interpreter, value: NetworkElement | Network, name: str, span: Span
) -> tuple[ModelValue] | None:
    """An attribute that is worked out, in a tuple of its own; None for any other.

    Raises:
        ScenarioError: map-lacks, where there is no such element or the map doesn't say; unsupported-construct.
    """
    plain = name.removeprefix("_") if name.removeprefix("_") in _UNDERSCORED else name
    work = next((work for kind, work in _WORKED_OUT.get(plain, ()) if isinstance(value, kind)), None)
    if work is not None:
        run.budget.step(span, 50)
        found = work(run.network, value)
        if found is None and plain is name and name in _REQUIRED:
            assert isinstance(value, NetworkElement)
            raise fail("map-lacks", f"the map has no {name} of {value.name}", span, "not in this map")
        if found is not None or name not in _UNKNOWN:
            return (build.constant(found, span) if isinstance(found, Region) else cast(ModelValue, found),)
    if name in _UNKNOWN and isinstance(value, _UNKNOWN[name][0]):
        raise fail("map-lacks", f"the map does not say {_UNKNOWN[name][1]}", span, "not in this map",
                   ("leave out what needs it",))  # fmt: skip
    if name in _REFUSED and isinstance(value, _REFUSED[name][0]):
        raise fail("unsupported-construct", f"`{name}` is not supported here", span, "of a whole road",
                   (_REFUSED[name][1],))  # fmt: skip
    return None
