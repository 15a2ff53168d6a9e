"""Vector map of Argoverse 2 (`log_map_archive_*.json`) as map features.

A lane lies between its left and its right boundary; traffic runs in the order of their points. There are no polygons of
intersections: one is the union of lanes with `is_intersection` that touch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from shapely.geometry import Polygon

from scenicq.errors import DataError, Diagnostic
from scenicq.geometry.features import MapFeature, ProblemSink
from scenicq.importers import fields
from scenicq.importers.fields import InvalidError, Record
from scenicq.importers.lane_graph import BoundedLane, Points, lane_features, sound_area
from scenicq.importers.report import Report
from scenicq.importers.specification import load_specification

__all__ = ["read_archive"]

_LARGEST_BYTES = 256 << 20


def read_archive(path: Path, on_problem: ProblemSink, report: Report) -> tuple[MapFeature, ...]:
    """Read a map.

    Args:
        path: The archive of a log or of a forecasting scenario.
        on_problem: Called with the id of an element and what is wrong with it.
        report: Takes counts of what is not read.

    Raises:
        DataError: `file-missing` or `file-invalid`.
    """
    try:
        if path.stat().st_size > _LARGEST_BYTES:
            raise InvalidError("larger than a map is")
        content = fields.record(fields.parse_json(path.read_bytes()), "the map")
        load_specification("argoverse2-map").count_json(content, report)
        lanes = list(_each(content, "lane_segments", _lane, on_problem))
        areas = [
            *_each(content, "pedestrian_crossings", _crossing, on_problem),
            *_each(content, "drivable_areas", _drivable, on_problem),
        ]
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"map {path} cannot be read: {error.strerror}")) from error
    except InvalidError as error:
        raise DataError(Diagnostic("file-invalid", f"map {path}: {error}")) from error
    directed = [_with_ways(lane, {lane.id: lane for lane in lanes}) for lane in lanes] if lanes else []
    features: dict[str, MapFeature] = {}
    for feature in (*lane_features(directed, on_problem), *areas):
        if feature.id in features:
            on_problem(feature.id, "the id is used twice; this element is left out")
        else:
            features[feature.id] = feature
    return tuple(features.values())


def _each(content: Record, key: str, make: Callable[[str, Record], Any], on_problem: ProblemSink) -> Iterator[Any]:
    for name, value in fields.optional_record(content, key).items():
        try:
            fields.check_characters(name)
            yield make(name, fields.record(value, "it"))
        except (InvalidError, ValueError) as error:
            on_problem(f"{name!a}"[1:-1], str(error))


def _lane(name: str, entry: Record) -> BoundedLane:
    return BoundedLane(
        id=name,
        left=_line(entry, "left_lane_boundary"),
        right=_line(entry, "right_lane_boundary"),
        beside_left=_id(entry.get("left_neighbor_id")),
        beside_right=_id(entry.get("right_neighbor_id")),
        predecessors=_ids(entry, "predecessors"),
        successors=_ids(entry, "successors"),
        in_intersection=entry.get("is_intersection") is True,
        properties={
            key: value
            for key in ("lane_type", "left_lane_mark_type", "right_lane_mark_type")
            if (value := fields.optional_text(entry, key)) is not None
        },
    )


def _with_ways(lane: BoundedLane, lanes: dict[str, BoundedLane]) -> BoundedLane:
    """The lane, told which of its neighbours run the other way."""
    left = lanes.get(lane.beside_left or "")
    right = lanes.get(lane.beside_right or "")
    return replace(
        lane,
        left_is_opposite=left is not None and _opposite(lane, left),
        right_is_opposite=right is not None and _opposite(lane, right),
    )


def _opposite(a: BoundedLane, b: BoundedLane) -> bool:
    ways = [lane.left[-1] - lane.left[0] for lane in (a, b)]
    return float(ways[0] @ ways[1]) < 0


def _crossing(name: str, entry: Record) -> MapFeature:
    outline = np.concatenate([_line(entry, "edge1"), _line(entry, "edge2")[::-1]])
    return MapFeature(name, "crossing", sound_area(Polygon(outline)))


def _drivable(name: str, entry: Record) -> MapFeature:
    return MapFeature(name, "drivable", sound_area(Polygon(_line(entry, "area_boundary"))))


def _line(entry: Record, key: str) -> Points:
    points = [fields.record(value, "a point") for value in fields.items(entry, key)]
    if len(points) < 2:
        raise InvalidError(f"`{key}` has fewer than two points")
    line = np.array([(fields.number(point, "x"), fields.number(point, "y")) for point in points])
    if not np.abs(line).max() < 1e7:
        raise InvalidError(f"`{key}` has a point too far away")
    return line


def _id(value: object) -> str | None:
    if value is None or isinstance(value, bool) or not isinstance(value, int | str):
        return None
    return str(value)


def _ids(entry: Record, key: str) -> tuple[str, ...]:
    found = (_id(value) for value in fields.optional_items(entry, key))
    return tuple(name for name in found if name is not None)
