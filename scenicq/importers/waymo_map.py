"""Map features of a Waymo Open Motion scenario.

Its lanes are centrelines without width and without polygons: each becomes a band of a nominal width, which its
properties say. Lanes that only join others (`interpolating`) lie in intersections.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon

from scenicq.geometry.features import MapFeature, ProblemSink
from scenicq.importers.fields import InvalidError
from scenicq.importers.lane_graph import BoundedLane, Points, lane_features, lengths_along, sound_area
from scenicq.importers.lane_parts import AdjacentLane, cut_lanes
from scenicq.importers.protobuf import Message, Value, integers, parse, to_signed
from scenicq.importers.report import Report
from scenicq.importers.specification import load_specification

__all__ = ["LANE_WIDTH_M", "scenario_features"]

LANE_WIDTH_M = 3.5
_BIKE_LANE_WIDTH_M = 1.8
_BIKE_LANE = 3
_LANE_KINDS = {1: "freeway", 2: "surface_street", 3: "bike_lane"}
_AREAS = {8: "crossing", 9: "speed_bump", 10: "driveway"}
_NAMES = {"crossing": "crosswalk"}
"""What the source calls a kind of area, where that is another word."""

_AT, _AT_LANE = "map_features:8", "map_features:8/lane:3"
"""Where their fields stand in the list of the specification."""

_TOLERANCE_M = 0.02
_SHORTEST_PART_M = 0.75
"""The lines of the source have a point every half metre, and neighbours begin and end at points."""


class _Neighbour(NamedTuple):
    """As the source says it: places are numbers of points of either line."""

    lane: str
    is_left: bool
    start: int
    end: int
    its_start: int
    its_end: int


def scenario_features(messages: Sequence[Value], on_problem: ProblemSink, report: Report) -> tuple[MapFeature, ...]:
    """The features of the field `map_features`.

    Args:
        messages: Its values.
        on_problem: Called with the id of a feature and what is wrong with it.
        report: Takes counts of what is not read.
    """
    lanes: dict[str, BoundedLane] = {}
    lines: dict[str, Points] = {}
    neighbours: dict[str, list[_Neighbour]] = {}
    others: dict[str, MapFeature] = {}
    for value in messages:
        name = ""
        try:
            feature = _message(value, report, _AT)
            name = str(to_signed(feature.get(1, [0])[0]))
            if name in lanes or name in others:
                raise InvalidError("the id is used twice")
            if 3 in feature:
                lane = _message(feature[3][0], report, _AT_LANE)
                line = _points(lane.get(8, []), 2, report, f"{_AT_LANE}/polyline:8")
                neighbours[name] = list(_neighbours(lane, report))
                lanes[name], lines[name] = _lane(name, lane, line, neighbours[name]), line
                continue
            for number, kind in _AREAS.items():
                if number in feature:
                    at = f"{_AT}/{_NAMES.get(kind, kind)}:{number}"
                    area = _message(feature[number][0], report, at)
                    points = _points(area.get(1, []), 3, report, f"{at}/polygon:1")
                    others[name] = MapFeature(name, kind, sound_area(Polygon(points)))
        except (InvalidError, ValueError) as error:
            on_problem(name, str(error))
    return (*lane_features(_cut(lanes, lines, neighbours), on_problem), *others.values())


def _cut(
    lanes: dict[str, BoundedLane], lines: dict[str, Points], neighbours: dict[str, list[_Neighbour]]
) -> list[BoundedLane]:
    """The lanes with their parts, between which neighbours change."""
    along = {name: lengths_along(line) for name, line in lines.items()}
    shares = {name: lengths / lengths[-1] for name, lengths in along.items()}

    def stretch(lane: str, start: int, end: int) -> tuple[float, float]:
        # A stretch goes on to where the next begins.
        last = len(shares[lane]) - 1
        low, high = (min(max(place, 0), last) for place in (start, end + 1))
        return float(shares[lane][low]), float(shares[lane][high])

    beside = {
        name: [
            AdjacentLane(
                each.lane, each.is_left, *stretch(name, each.start, each.end),
                *stretch(each.lane, each.its_start, each.its_end),
            )
            for each in found
            if each.lane in shares
        ]
        for name, found in neighbours.items()
    }  # fmt: skip
    parts = cut_lanes({name: float(lengths[-1]) for name, lengths in along.items()}, beside, _SHORTEST_PART_M)
    return [replace(lane, parts=parts[name]) for name, lane in lanes.items()]


def _lane(name: str, lane: Message, line: Points, neighbours: Sequence[_Neighbour]) -> BoundedLane:
    kind = to_signed(lane.get(2, [0])[0])
    width = _BIKE_LANE_WIDTH_M if kind == _BIKE_LANE else LANE_WIDTH_M
    line = _simplified(line)
    left, right = _offset(line, width / 2), _offset(line, -width / 2)
    return BoundedLane(
        id=name,
        left=left,
        right=right,
        beside_left=next((each.lane for each in neighbours if each.is_left), None),
        beside_right=next((each.lane for each in neighbours if not each.is_left), None),
        predecessors=tuple(str(other) for other in integers(lane.get(9, []))),
        successors=tuple(str(other) for other in integers(lane.get(10, []))),
        in_intersection=to_signed(lane.get(3, [0])[0]) == 1,
        properties={"lane_type": _LANE_KINDS.get(kind, "undefined"), "nominal_width": width},
    )


def _neighbours(lane: Message, report: Report) -> Iterator[_Neighbour]:
    for number, side in ((11, "left"), (12, "right")):
        for value in lane.get(number, []):
            found = _message(value, report, f"{_AT_LANE}/{side}_neighbors:{number}")
            places = [to_signed(found.get(field, [0])[0]) for field in (2, 3, 4, 5)]
            if 1 in found:
                yield _Neighbour(str(to_signed(found[1][0])), side == "left", *places)


def _message(value: Value, report: Report, at: str) -> Message:
    """A message, whose fields that are not read are counted."""
    if not isinstance(value, memoryview):
        raise InvalidError("a field is not a message")
    message = parse(value)
    load_specification("waymo").count_message(message, report, at)
    return message


def _points(values: Sequence[Value], least: int, report: Report, at: str) -> Points:
    points: list[tuple[float, float]] = []
    for value in values:
        point = _message(value, report, at)
        x, y = point.get(1, [0.0])[0], point.get(2, [0.0])[0]
        if not isinstance(x, float) or not isinstance(y, float) or not (abs(x) < 1e7 and abs(y) < 1e7):
            raise InvalidError("a point is not finite")
        points.append((x, y))
    if len(points) < least:
        raise InvalidError(f"it has fewer than {least} points")
    return np.array(points)


def _simplified(line: Points) -> Points:
    return shapely.get_coordinates(shapely.simplify(LineString(line), _TOLERANCE_M))


def _offset(line: Points, distance: float) -> Points:
    """The line moved to its left."""
    steps = np.diff(line, axis=0)
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    if not (lengths > 0).any():
        raise InvalidError("it has no length")
    units = steps[lengths > 0] / lengths[lengths > 0, None]
    kept = line[np.concatenate([[True], lengths > 0])]
    ways = np.concatenate([units[:1], units[:-1] + units[1:], units[-1:]])
    norms = np.maximum(np.hypot(ways[:, 0], ways[:, 1]), 1e-9)[:, None]
    ways = ways / norms
    return kept + distance * np.stack([-ways[:, 1], ways[:, 0]], axis=1)
