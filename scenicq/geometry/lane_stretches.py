"""What lies ahead of an object in its lanes: a stretch of them along their middle, cut across at right angles.

A stretch of a lane is what of its area lies between two cuts, through which the middle of the lane runs. A cut goes
through a point of the middle, at a right angle to it, as far as the area reaches on either side.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray
from shapely import LineString
from shapely.geometry import Polygon

from scenicq.geometry import shapes
from scenicq.geometry.angles import leads
from scenicq.geometry.elements import Lane
from scenicq.geometry.network import Network
from scenicq.geometry.shapes import Shape

__all__ = ["ahead_in_lanes", "own_lanes", "stretch"]

_SHORT_M = 1e-6
"""What is shorter than this is a point."""
_BEYOND_M = 1e-6
"""How far a cut reaches beyond an area, so that it cuts it through."""


def own_lanes(network: Network, x: float, y: float, heading: float | None, last: float | None) -> list[Lane]:
    """The lanes of who is at a place: those that lead its way or go on from the last lane of its track, else all.

    Args:
        network: The map.
        x: The place.
        y: The place.
        heading: That of who is there; None where all lanes count.
        last: The number of the last lane of its track; None if there is none.
    """
    lanes = list(network.lanesAt(x, y))
    if heading is None or len(lanes) < 2:
        return lanes
    meant = [
        lane
        for lane in lanes
        if (lane.orientation is not None and leads(lane.orientation.values(x, y), heading))
        or (last is not None and last in lane.continued)
    ]
    return meant or lanes


def ahead_in_lanes(
    network: Network, x: float, y: float, heading: float | None, last: float | None, distance: float
) -> tuple[Polygon, ...]:
    """What lies in the lanes of who is at a place, and in those that these lead to, from there to so many metres on.

    Args:
        network: The map.
        x: The place.
        y: The place.
        heading: As of `own_lanes`.
        last: As of `own_lanes`.
        distance: Metres along the middle of the lanes.

    Returns:
        The region's polygons; none where no lane with a middle is there.
    """
    begins: dict[str, float] = {}
    waiting: list[tuple[float, int, Lane]] = []
    for lane in own_lanes(network, x, y, heading, last):
        line = _middle(lane)
        if line is not None:
            # it begins behind, by as much as lies behind
            begins[lane.id] = -float(line.project(shapes.point(x, y)))
            heapq.heappush(waiting, (begins[lane.id], len(waiting), lane))
    found: list[Polygon] = []
    count = len(waiting)
    while waiting:
        begin, _, lane = heapq.heappop(waiting)
        line = _middle(lane)
        if begin > begins[lane.id] or line is None:
            continue
        found += stretch(lane.polygon, line, -begin, distance - begin)
        end = begin + line.length
        for each in lane.successors if end < distance else ():
            if end < begins.get(each.id, math.inf):
                begins[each.id] = end
                count += 1
                heapq.heappush(waiting, (end, count, each))
    return tuple(found)


def stretch(area: Shape, line: LineString, start: float, end: float) -> list[Polygon]:
    """The parts of a lane's area beside a part of its middle.

    Args:
        area: The area.
        line: The middle.
        start: Where the part begins, in metres along the middle; all from the beginning where it is not positive.
        end: Where it ends.
    """
    parts = cast("list[Polygon]", list(shapes.simple_parts([area])))
    for at in (start, end):
        if 0 < at < line.length:
            parts = [each for part in parts for each in _cut(part, line, at)]
    low, high = max(start, 0.0), min(end, line.length)
    if high - low < _SHORT_M:
        return []
    inside = shapes.part_of_line(line, low, high)
    return [part for part in parts if shapes.intersection(inside, part).length > _SHORT_M]


def _cut(part: Polygon, line: LineString, at: float) -> Sequence[Polygon]:
    """A polygon cut across a line at a point of it; itself where the point is not in it."""
    corners = shapes.coordinates(line)
    lengths = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))))
    segment = min(int(np.searchsorted(lengths, at, side="right")) - 1, len(corners) - 2)
    along = _unit(corners[segment + 1] - corners[segment])
    foot, across = corners[segment] + (at - lengths[segment]) * along, np.array([-along[1], along[0]])
    west, south, east, north = part.bounds
    reach = math.hypot(east - west, north - south) + 1.0
    through = shapes.intersection(LineString([foot - reach * across, foot + reach * across]), part)
    point = shapes.point(*foot.tolist())
    for each in _lines(through):
        if each.distance(point) <= _SHORT_M:
            first, last = shapes.coordinates(each)[[0, -1]]
            beyond = _BEYOND_M * _unit(last - first)
            return shapes.split(part, LineString([first - beyond, last + beyond]))
    return [part]


def _lines(shape: Shape) -> Iterable[LineString]:
    return [each for each in getattr(shape, "geoms", [shape]) if isinstance(each, LineString) and each.length > 0]


def _unit(step: NDArray[np.float64]) -> NDArray[np.float64]:
    return step / float(np.hypot(*step))


def _middle(lane: Lane) -> LineString | None:
    """The middle of a lane as one line; None where the map gives none."""
    if lane.centerline is None:
        return None
    points = [point for line in lane.centerline.lines for point in line.coords]
    line = LineString([point[:2] for point in points])
    return line if line.length > _SHORT_M else None
