"""Curbs of a map that names none: the outer edges of its roads, as Scenic takes them from its lane groups.

A lane without a neighbour to its right ends at the curb: its right edge, in the direction of travel. Where traffic
keeps to the left, everything is mirrored.
"""

# shapely carries no type annotations
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
# pyright: reportUnknownParameterType=false, reportMissingTypeArgument=false

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
import shapely
from shapely.geometry import LineString

from scenicq.geometry import shapes
from scenicq.geometry.elements import Lane, keeps_left
from scenicq.geometry.road_direction import DirectedLane, RoadDirection
from scenicq.geometry.shapes import Shape

__all__ = ["along_lanes", "right_edges", "side_edges"]

_CORNER = np.cos(np.radians(60))
"""A boundary that turns away from the direction of travel by more than this is a lane's end, not its side."""


def along_lanes(lanes: Sequence[Lane]) -> RoadDirection | None:
    """The direction of traffic on some lanes alone, whatever else lies there; None if none has a centreline."""
    directed = [
        DirectedLane(lane.polygon, tuple(shapes.coordinates(line) for line in lane.centerline.lines))
        for lane in lanes
        if lane.centerline is not None
    ]
    return RoadDirection(tuple(directed)) if directed else None


def right_edges(lanes: Sequence[Lane], intersections: Sequence[Shape]) -> tuple[LineString, ...]:
    """The right edges of the lanes that have no lane to their right, outside of intersections.

    Args:
        lanes: Lanes with centrelines; others are passed over.
        intersections: Polygons of the intersections.

    Returns:
        Polylines in metres, in the direction of travel.
    """
    crossing = shapes.union_all(list(intersections)) if intersections else None
    found: list[LineString] = []
    for lane in lanes:
        for section in lane.sections:
            left = keeps_left(section)
            outer = section._laneToLeft if left else section._laneToRight  # pyright: ignore[reportPrivateUsage]
            if outer is None and section.centerline is not None:
                edges = side_edges(cast(Shape, section.polygon), section.centerline.lines, left=left)
                found += edges if crossing is None else [part for edge in edges for part in _outside(edge, crossing)]
    return tuple(found)


def _outside(edge: LineString, area: Shape) -> list[LineString]:
    rest = shapes.difference(edge, area)
    return [cast(LineString, part) for part in shapes.simple_parts([rest]) if part.length > 0]


def side_edges(area: Shape, centerlines: Sequence[Shape], *, left: bool = False) -> list[LineString]:
    """The parts of a lane's boundary on the right of its centreline, or the left, in the direction of travel."""
    line = centerlines[0] if len(centerlines) == 1 else shapely.line_merge(shapes.union_all(centerlines))
    if not isinstance(line, LineString):
        return []
    points = shapely.get_coordinates(shapely.get_exterior_ring(shapely.get_parts(area)[0]))
    if not shapely.is_ccw(shapely.linearrings(points)):
        points = points[::-1]
    # counter-clockwise, the right side of the lane is passed in the direction of travel
    starts, ends = points[:-1], points[1:]
    middles = shapely.points((starts + ends) / 2)
    along = shapely.line_locate_point(line, middles)
    ahead = shapely.get_coordinates(shapely.line_interpolate_point(line, np.minimum(along + 0.5, line.length)))
    behind = shapely.get_coordinates(shapely.line_interpolate_point(line, np.maximum(along - 0.5, 0.0)))
    travel, side = ahead - behind, ends - starts
    lengths = np.hypot(*travel.T) * np.hypot(*side.T)
    way = -1 if left else 1
    follows = way * (travel * side).sum(axis=1) > _CORNER * lengths
    away = (starts + ends) / 2 - (ahead + behind) / 2
    beside = way * (travel[:, 0] * away[:, 1] - travel[:, 1] * away[:, 0]) < 0
    runs = _runs(points, follows & beside)
    return [run.reverse() for run in runs] if left else runs


def _runs(points: np.ndarray, kept: np.ndarray) -> list[LineString]:
    """The maximal runs of kept segments of a ring."""
    count = len(kept)
    if not kept.any():
        return []
    first = 0 if kept.all() else next(n for n in range(count) if kept[n] and not kept[n - 1])
    runs: list[list[tuple[float, float]]] = []
    for step in range(count):
        number = (first + step) % count
        if not kept[number]:
            continue
        if not runs or not kept[number - 1] or step == 0:
            runs.append([tuple(points[number])])
        runs[-1].append(tuple(points[number + 1]))
    return [LineString(run) for run in runs]
