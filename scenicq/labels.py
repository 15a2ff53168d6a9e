"""Courses, measures and others where real Scenic runs a program: the module that Python finds.

Scenicq itself reads `from scenicq.labels import ...` without running this. Scenic draws scenes of one instant, in which
nothing has a track: a course is that of the lane, as of a label that is seen once
(`scenicq.geometry.driven_courses`), so that drawn scenes match their program. Nobody is there but the program's own
objects. Random arguments are sampled first, as those of Scenic's own functions are.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from typing import Any, cast

import numpy as np

from scenicq.geometry import measures, shapes
from scenicq.geometry.boxes import box_polygon
from scenicq.geometry.driven_courses import CoursePlace, lane_course
from scenicq.geometry.lane_stretches import ahead_in_lanes
from scenicq.geometry.measures import NEVER, STANDING_MPS, MovingBoxes
from scenicq.geometry.network import Network
from scenicq.geometry.own_directions import along_centerline
from scenicq.geometry.regions import PolylineSet
from scenicq.geometry.road_direction import RoadDirection

__all__ = [
    "ahead",
    "along",
    "beside",
    "box_distance",
    "corridor",
    "count",
    "course",
    "course_change",
    "deceleration_to_avoid",
    "hides",
    "jerk",
    "nearest",
    "others",
    "post_encroachment_time",
    "time_headway",
    "time_to_collision",
]


_MAP_SLACK_M = (1e-9, 0.05)


def ahead(owner: Any, distance: Any) -> Any:
    """What lies in the lanes of an object, from it to so many metres on, as one of Scenic's regions.

    Args:
        owner: The object; where it is in no lane, nothing lies ahead.
        distance: Metres along the middle of the lanes.
    """
    return _sampled(_ahead)(owner, distance)


def along(owner: Any, place: Any) -> Any:
    """How far ahead of an object a place is on the course of the object.

    Args:
        owner: The object.
        place: A point, object or vector.

    Returns:
        Metres, behind negative. Where the course does not tell, such as beyond its end, the scene is rejected.
    """
    return _sampled(_along)(owner, place)


def beside(owner: Any, place: Any) -> Any:
    """How far to the left of the course of an object a place is; arguments as of `along`.

    Returns:
        Metres, to the right negative.
    """
    return _sampled(_beside)(owner, place)


def course(owner: Any) -> Any:
    """The course of an object as one of Scenic's regions, a line."""
    return _sampled(_course)(owner)


def corridor(owner: Any, half_width: Any) -> Any:
    """What lies within so many metres of the course of an object, as one of Scenic's regions."""
    return _sampled(_corridor)(owner, half_width)


def others(of: Any) -> list[Any]:
    """Those of a class that play no role: none, for a scene has the objects of its program alone."""
    return []


def count(of: Any, *, within: Any = None, ahead: bool = False) -> int:
    """How many objects of a class there are but the ego, in a region if one is given; for requirements alone.

    Args:
        of: One of Scenic's classes.
        within: A region that their centres lie in.
        ahead: Whether they are to be ahead of the ego, along its course.
    """
    return len(_objects(of, within, ahead))


def nearest(of: Any, *, within: Any = None, ahead: bool = False) -> Any:
    """The nearest to the ego of those that `count` counts, the first of equally near ones.

    Returns:
        The object; where there is none, what is no object, and rejects the scene once something is read of it.
    """
    x, y = _xy(import_module("scenic.syntax.veneer").ego())
    found = _objects(of, within, ahead)
    return min(found, key=lambda each: math.hypot(_xy(each)[0] - x, _xy(each)[1] - y), default=_Nobody())


def time_to_collision(one: Any, other: Any) -> Any:
    """Seconds until the boxes of two objects touch, if both go on with their velocities and do not turn.

    Hayward, *Near-miss determination through use of a scale of danger*, 1972. 0 where they touch; what never comes is
    `NEVER`, a million.
    """
    return _sampled(_time_to_collision)(one, other)


def time_headway(one: Any, other: Any) -> Any:
    """Seconds until the front of an object is where that of another is now, along its course at its speed.

    Vogel, *A comparison of headway and time to collision as safety indicators*, 2003. `NEVER` where the other is not
    ahead, or the first stands.
    """
    return _sampled(_time_headway)(one, other)


def deceleration_to_avoid(one: Any, other: Any) -> Any:
    """The constant deceleration, m/s², with which an object just does not hit another that drives ahead on its course.

    Cooper and Ferguson, *Traffic studies at T-junctions*, 1976. 0 where it is not faster, or the other not ahead.
    """
    return _sampled(_deceleration_to_avoid)(one, other)


def box_distance(one: Any, other: Any) -> Any:
    """Metres between the boxes of two objects; 0 where they touch."""
    return _sampled(_box_distance)(one, other)


def hides(screen: Any, thing: Any, viewer: Any = None, *, whole: bool = False) -> Any:
    """Whether the box of an object covers the line from a viewer to the centre of another.

    Args:
        screen: What may be in the way.
        thing: What is behind it.
        viewer: Who looks, from the centre; the ego by default.
        whole: Whether it covers all lines, to all of the box of the other.
    """
    seer = import_module("scenic.syntax.veneer").ego() if viewer is None else viewer
    return _sampled(_hides)(screen, thing, seer, whole)


def jerk(owner: Any) -> Any:
    """The slope of the acceleration of an object, m/s³: 0 in a scene of one instant, in which nothing changes."""
    return _sampled(_unchanged)(owner)


def course_change(owner: Any, seconds: Any) -> Any:
    """How far an object's course turns to the left in the next seconds, radians; 0 in a scene of one instant."""
    return _sampled(_unchanged)(owner, seconds)


def post_encroachment_time(one: Any, other: Any) -> Any:
    """Seconds between two objects at a place that both cover; in a scene of one instant `NEVER`.

    Allen, Shin and Cooper, *Analysis of traffic conflicts and collisions*, 1978. 0 where both are there at once.
    """
    return _sampled(_post_encroachment_time)(one, other)


def _objects(of: Any, within: Any, ahead: bool) -> list[Any]:
    """The objects of a class in the scene, or in the simulation that runs, but the ego."""
    veneer = import_module("scenic.syntax.veneer")
    scene = veneer.currentSimulation or veneer.currentScenario
    ego = veneer.ego()
    found = [each for each in scene.objects if each is not ego and isinstance(each, of)]
    found = [each for each in found if within is None or within.containsPoint(each.position)]
    return [each for each in found if _is_ahead(_place_of(ego), each)] if ahead else found


def _is_ahead(course: CoursePlace, place: Any) -> bool:
    low, high, _, _ = course.ends(*_xy(place))
    return low > 0 or (high > 0 and _known(low, high) > 0)


class _Nobody:
    """Where nobody is the nearest: what is read of it does not hold."""

    def __getattr__(self, name: str) -> Any:
        raise import_module("scenic.core.distributions").RejectionException(f"there is nobody whose {name} is asked")


def _time_to_collision(one: Any, other: Any) -> float:
    boxes = [
        MovingBoxes(_xy(each), each.heading, _xy(each.velocity), each.width, each.length)  # pyright: ignore[reportArgumentType]
        for each in (one, other)
    ]
    return float(measures.time_to_collision(*boxes))


def _hides(screen: Any, thing: Any, viewer: Any, whole: bool) -> bool:
    line = import_module("shapely.geometry").LineString
    ends = _box(thing).exterior.coords[:4] if whole else [_xy(thing)]
    return all(_box(screen).intersects(line([_xy(viewer), end])) for end in ends)


def _box_distance(one: Any, other: Any) -> float:
    return float(_box(one).distance(_box(other)))


def _unchanged(*_: Any) -> float:
    return 0.0


def _post_encroachment_time(one: Any, other: Any) -> float:
    return 0.0 if _box(one).intersects(_box(other)) else NEVER


def _time_headway(one: Any, other: Any) -> float:
    way = _along(one, other) + (float(other.length) - float(one.length)) / 2
    speed = float(one.speed)
    return min(way / speed, NEVER) if way >= 0 and speed > STANDING_MPS else NEVER


def _deceleration_to_avoid(one: Any, other: Any) -> float:
    way, closing = _along(one, other), float(one.speed) - float(other.speed)
    if way <= 0 or closing <= 0:
        return 0.0
    gap = way - (float(one.length) + float(other.length)) / 2
    return min(closing * closing / (2 * gap), NEVER) if gap > STANDING_MPS else NEVER


def _box(owner: Any) -> Any:
    return box_polygon(*_xy(owner), float(owner.heading), float(owner.width), float(owner.length))


def _ahead(owner: Any, distance: float) -> Any:
    network = cast(Network, _ScenicMap(getattr(owner, "_lane", None)))
    parts = ahead_in_lanes(network, *_xy(owner), float(owner.heading), None, float(distance))
    regions = import_module("scenic.core.regions")
    return regions.PolygonalRegion(polygon=shapes.union_all(parts)) if parts else regions.nowhere


def _along(owner: Any, place: Any) -> float:
    low, high, _, _ = _place_of(owner).ends(*_xy(place))
    return _known(low, high)


def _beside(owner: Any, place: Any) -> float:
    _, _, low, high = _place_of(owner).ends(*_xy(place))
    return _known(low, high)


def _known(low: float, high: float) -> float:
    """A number that is known; what a label would leave open is no scene."""
    if low != high:
        raise import_module("scenic.core.distributions").RejectionException("the course does not tell where this is")
    return low


def _course(owner: Any) -> Any:
    lines = [list(each.coords) for each in _line_of(owner).region.lines]
    shapes = import_module("shapely.geometry")
    return import_module("scenic.core.regions").PolylineRegion(polyline=shapes.MultiLineString(lines))


def _corridor(owner: Any, half_width: float) -> Any:
    polygons = _line_of(owner).within(float(half_width)).polygons
    return import_module("scenic.core.regions").PolygonalRegion(polygon=polygons[0])


def _line_of(owner: Any) -> Any:
    line = _place_of(owner).line
    if line is None:
        raise import_module("scenic.core.distributions").RejectionException("there is no course")
    return line


def _sampled(function: Callable[..., Any]) -> Callable[..., Any]:
    try:
        distributions = import_module("scenic.core.distributions")
    except ImportError:
        message = (
            "scenicq.labels is for programs that Scenic runs, which is not installed: scenicq reads them without it"
        )
        raise RuntimeError(message) from None
    return distributions.distributionFunction(function)


def _xy(place: Any) -> tuple[float, float]:
    x, y, *_ = getattr(place, "position", place)
    return float(x), float(y)


def _place_of(owner: Any) -> CoursePlace:
    x, y = _xy(owner)
    lane = getattr(owner, "_lane", None)
    return lane_course(cast(Network, _ScenicMap(lane)), x, y, float(owner.heading))


@dataclass(eq=False)
class _ScenicLane:
    """One of Scenic's lanes as courses read them."""

    lane: Any
    network: Any

    @property
    def id(self) -> str:
        return str(self.lane.uid)

    @cached_property
    def centerline(self) -> PolylineSet:
        line = import_module("shapely.geometry").LineString([(x, y) for x, y, *_ in self.lane.centerline.points])
        return PolylineSet((line,), "the middle of a lane")

    @property
    def polygon(self) -> Any:
        return self.lane.polygon

    @cached_property
    def orientation(self) -> RoadDirection | None:
        lines = tuple(np.array(each.coords) for each in self.centerline.lines)
        return along_centerline(self.id, self.polygon, lines)

    @property
    def successors(self) -> list[_ScenicLane]:
        return [_ScenicLane(each, self.network) for each in _following(self.lane)]

    @property
    def predecessors(self) -> list[_ScenicLane]:
        return [_ScenicLane(each, self.network) for each in self.network.lanes if self.lane in _following(each)]


def _following(lane: Any) -> list[Any]:
    ways = [each.connectingLane or each.endLane for each in lane.maneuvers]
    after = getattr(lane, "_successor", None)
    return list(dict.fromkeys([*ways, *([after] if type(after) is type(lane) else [])]))


@dataclass(eq=False)
class _ScenicMap:
    """The map that one of Scenic's lanes lies in; where there is none, no lane is anywhere."""

    lane: Any

    def lanesAt(self, x: float, y: float) -> list[_ScenicLane]:  # noqa: N802 - as networks have it
        if self.lane is None:
            return []
        network, here = self.lane.network, import_module("shapely.geometry").Point(x, y)
        for slack in _MAP_SLACK_M:
            near = [each for each in network.lanes if each.polygon.distance(here) <= slack]
            if near:
                return [_ScenicLane(each, network) for each in near]
        return []
