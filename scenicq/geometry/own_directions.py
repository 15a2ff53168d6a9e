"""The preferred headings of the elements of a map, each a field of its own.

In a lane it is the direction of the nearest segment of its centreline, wherever the point is. Groups of lanes and roads
have that of their lane at the point, else of their own centreline; intersections that of the nearest of their lanes.
Scenic has the same, but takes the first of several lanes that hold a point, where here any of them will do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from scenicq.geometry.elements import Intersection, Lane, LaneGroup, LaneSection, Road, RoadSection
from scenicq.geometry.regions import PolylineSet
from scenicq.geometry.road_direction import DeferredDirection, DirectedLane, RoadDirection
from scenicq.geometry.shapes import Coordinates, Shape

__all__ = ["along_centerline", "along_unread_centerline", "direction_of_intersection", "direction_of_lanes"]

_EVERYWHERE = 1e6
"""Metres within which an element's direction is looked for: farther than any map."""
_BESIDE = 0.05
"""Metres beside a lane that count as in it where no lane is."""


def along_centerline(name: str, area: Shape, lines: tuple[Coordinates, ...]) -> RoadDirection | None:
    """The direction of the nearest segment of an element's centreline; None where the map gives none.

    Args:
        name: The element's identifier.
        area: Its polygon.
        lines: The polylines of its centreline, (n, 2) each.
    """
    own = (DirectedLane(area, lines),)
    return RoadDirection(own, f"orientation of {name}", farthest=_EVERYWHERE) if lines else None


def along_unread_centerline(name: str, area: Shape, lines: Callable[[], tuple[Coordinates, ...]]) -> RoadDirection:
    """The same of a centreline that the map gives, and that is read when somebody asks for its direction.

    Args:
        name: The element's identifier.
        area: Its polygon.
        lines: Gives the polylines.
    """

    def make() -> RoadDirection:
        return RoadDirection((DirectedLane(area, lines()),), farthest=_EVERYWHERE)

    return DeferredDirection(f"orientation of {name}", make, nowhere=None, has_beside=False, farthest=_EVERYWHERE)


def direction_of_lanes(element: LaneGroup | Road | RoadSection) -> RoadDirection | None:
    """The direction of the lane of a group or road at a point, else of its own centreline; None without any."""
    own = _directed(element.lanes)
    beside = tuple(DirectedLane(lane.area, lane.centerline, _BESIDE) for lane in own)
    elsewhere = _lines(element.centerline)
    name = f"orientation of {element.id}"
    if not own and not elsewhere:
        return None
    return RoadDirection(own, name, beside=beside, elsewhere=elsewhere, farthest=_EVERYWHERE)


def direction_of_intersection(element: Intersection) -> RoadDirection | None:
    """The direction of the nearest lane through an intersection; None without any."""
    lanes = (each.connectingLane for each in element.maneuvers if each.connectingLane is not None)
    own = _directed(dict.fromkeys(lanes)) or _directed(element.lanes)
    return RoadDirection(own, f"orientation of {element.id}", farthest=_EVERYWHERE) if own else None


def _directed(lanes: Iterable[Lane | LaneSection]) -> tuple[DirectedLane, ...]:
    return tuple(lane.orientation.lanes[0] for lane in lanes if lane.orientation is not None)


def _lines(line: PolylineSet | None) -> tuple[Coordinates, ...]:
    """The corners of a centreline, of which its own direction knows them."""
    along = None if line is None else line.orientation
    return along.lanes[0].centerline if isinstance(along, RoadDirection) else ()
