"""Map expansion of nuScenes (`maps/expansion/LOCATION.json`, version 1.3) as map features.

Areas are polygons of nodes; the driving direction of a lane is not in its polygon but in `arcline_path_3`, a chain of
arcs and straight pieces. `connectivity` says which lanes follow which. What is not read is counted
(`specifications/nuscenes-map.json`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from scenicq.errors import DataError, Diagnostic
from scenicq.geometry import shapes
from scenicq.geometry.features import MapFeature, ProblemSink
from scenicq.importers import fields
from scenicq.importers.fields import InvalidError, Record
from scenicq.importers.nuscenes_roads import link_roads
from scenicq.importers.report import Report
from scenicq.importers.specification import load_specification

__all__ = ["arcline_points", "read_expansion"]

_STEP_M = 1.0
_LONGEST_M = 20_000.0
_KINDS = {
    "drivable_area": "drivable",
    "lane": "lane",
    "lane_connector": "lane",
    "road_block": "lane_group",
    "ped_crossing": "crossing",
    "walkway": "sidewalk",
    "stop_line": "stop_line",
    "carpark_area": "carpark_area",
}
"""Layers with the kinds of the elements that they become; `road_segment` becomes `road` or `intersection`."""


def read_expansion(
    path: Path, on_problem: ProblemSink, report: Report, *, left_hand: bool = False
) -> tuple[MapFeature, ...]:
    """Read a map.

    Args:
        path: The file of a location.
        on_problem: Called with the token of an element that is left out and the reason.
        report: Takes counts of what is not read.
        left_hand: Whether traffic keeps to the left there, which the file does not say.

    Raises:
        DataError: `file-missing` or `file-invalid`.
    """
    try:
        content = fields.record(fields.parse_json(path.read_bytes()), "the map")
        load_specification("nuscenes-map").count_json(content, report)
        expansion = _Expansion(content, on_problem, report)
        return tuple(link_roads(list(expansion.features()), expansion.segments(), left_hand=left_hand))
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"map {path} cannot be read: {error.strerror}")) from error
    except InvalidError as error:
        raise DataError(Diagnostic("file-invalid", f"map {path}: {error}")) from error


class _Expansion:
    def __init__(self, content: Record, on_problem: ProblemSink, report: Report) -> None:
        self._content = content
        self._report = report
        self._on_problem = on_problem
        nodes = self._layer("node")
        self._nodes = {
            token: point for token, node in nodes if (point := self._try(token, lambda node=node: _point(node)))
        }
        self._polygons = dict(self._layer("polygon"))
        self._paths = fields.optional_record(content, "arcline_path_3")
        self._links = fields.optional_record(content, "connectivity")
        segments = self._layer("road_segment", quiet=True)
        self._roads = {token for token, entry in segments if not entry.get("is_intersection")}
        self._lanes = {token for layer in ("lane", "lane_connector") for token, _ in self._layer(layer, quiet=True)}

    def features(self) -> Iterator[MapFeature]:
        for layer, kind in _KINDS.items():
            for token, entry in self._layer(layer):
                shape = self._try(token, lambda entry=entry: self._area(entry))
                if shape is not None:
                    properties = self._lane(token, layer) if kind == "lane" else self._road(entry, layer)
                    yield MapFeature(token, kind, shape, {"layer": layer} | properties)
        for token, entry in self._layer("road_segment"):
            shape = self._try(token, lambda entry=entry: self._area(entry))
            if shape is None:
                continue
            if entry.get("is_intersection"):
                yield MapFeature(token, "intersection", shape, {"layer": "road_segment"})
            else:
                yield MapFeature(token, "road", shape, {"layer": "road_segment"})

    def segments(self) -> dict[str, str]:
        """The road segment of each road block that names one."""
        blocks = self._layer("road_block", quiet=True)
        named = ((token, entry.get("road_segment_token")) for token, entry in blocks)
        return {token: segment for token, segment in named if isinstance(segment, str)}

    def _layer(self, name: str, *, quiet: bool = False) -> Iterator[tuple[str, Record]]:
        for number, value in enumerate(fields.optional_items(self._content, name)):
            try:
                entry = fields.record(value, "it")
                yield fields.text(entry, "token"), entry
            except InvalidError as error:
                if not quiet:
                    self._on_problem(f"{name} number {number}", str(error))

    def _try(self, token: str, make: Callable[[], Any]) -> Any:
        try:
            return make()
        except (InvalidError, ValueError) as error:
            self._on_problem(token, str(error))
            return None

    def _area(self, entry: Record) -> BaseGeometry:
        if entry.get("polygon_tokens") is not None:
            polygons = [self._polygon(token) for token in fields.items(entry, "polygon_tokens")]
            return _sound(MultiPolygon(polygons))
        return _sound(self._polygon(fields.text(entry, "polygon_token")))

    def _polygon(self, token: object) -> Polygon:
        if not isinstance(token, str) or token not in self._polygons:
            raise InvalidError(f"polygon `{token}` is not there")
        entry = self._polygons[token]
        holes = [self._ring(fields.record(hole, "a hole")) for hole in fields.optional_items(entry, "holes")]
        return Polygon(self._ring({"node_tokens": fields.items(entry, "exterior_node_tokens")}), holes)

    def _ring(self, entry: Record) -> list[tuple[float, float]]:
        tokens = fields.items(entry, "node_tokens")
        missing = [token for token in tokens if not isinstance(token, str) or token not in self._nodes]
        if missing:
            raise InvalidError(f"node `{missing[0]}` is not there")
        if len(tokens) < 3:
            raise InvalidError("a ring has fewer than three nodes")
        return [self._nodes[token] for token in tokens]

    def _road(self, entry: Record, layer: str) -> dict[str, Any]:
        """The road that a crossing belongs to; a block's is found with those of its lanes."""
        road = entry.get("road_segment_token")
        return {"road": road} if layer == "ped_crossing" and isinstance(road, str) and road in self._roads else {}

    def _lane(self, token: str, layer: str) -> dict[str, Any]:
        properties: dict[str, Any] = {}
        if self._paths.get(token) is not None:
            points = self._try(token, lambda: arcline_points(fields.items(self._paths, token)))
            if points:
                properties["centerline"] = [[list(point) for point in points]]
        elif layer == "lane":
            self._on_problem(token, "the lane has no path, so no direction")
        for name, key in (("predecessors", "incoming"), ("successors", "outgoing")):
            others: list[str] = self._try(token, lambda key=key: self._linked(token, key)) or []
            properties[name] = [other for other in others if other in self._lanes]
            self._report.count_unread(
                f"connectivity/*/{key} of lanes that are not there", len(others) - len(properties[name])
            )
        return properties

    def _linked(self, token: str, key: str) -> list[str]:
        others = fields.optional_items(fields.optional_record(self._links, token), key)
        return [other for other in others if isinstance(other, str)]


def arcline_points(path: list[Mapping[str, Any]]) -> list[tuple[float, float]]:
    """Points about a metre apart along a chain of arcline paths, in driving direction.

    Args:
        path: Each with `start_pose` [x, y, direction from +x], `shape` of three letters (L, R: arcs to the left and
            right; S: straight), `radius` of the arcs, `segment_length` of each letter, and `end_pose`.

    Raises:
        InvalidError: A field is not sound.
    """
    points: list[tuple[float, float]] = []
    for piece in path:
        entry = fields.record(piece, "a piece of the path")
        x, y, direction = fields.vector(entry, "start_pose", 3)
        points.append((x, y))
        lengths = fields.vector(entry, "segment_length", 3)
        for letter, length in zip(fields.text(entry, "shape"), lengths, strict=False):
            curvature = {"L": 1.0, "R": -1.0, "S": 0.0}.get(letter)
            if curvature is None:
                raise InvalidError(f"`shape` has the letter {letter!r}")
            if curvature:
                curvature /= fields.positive(entry, "radius") or math.inf
            if not 0 <= length <= _LONGEST_M or len(points) > _LONGEST_M / _STEP_M:
                raise InvalidError(f"the path of the lane is longer than {_LONGEST_M:,.0f} m, or shorter than nothing")
            steps = max(1, math.ceil(length / _STEP_M)) if length else 0
            for _ in range(steps):
                x, y, direction = _advance(x, y, direction, curvature, length / steps)
                points.append((x, y))
    # Pieces share their ends: a point that repeats the one before it has no direction.
    kept = [point for number, point in enumerate(points) if number == 0 or math.dist(point, points[number - 1]) > 1e-6]
    if len(kept) < 2:
        raise InvalidError("the path of the lane has no length")
    return kept


def _advance(x: float, y: float, direction: float, curvature: float, length: float) -> tuple[float, float, float]:
    """The pose after a piece of constant curvature; the chord of an arc is exact in direction and length."""
    half = curvature * length / 2
    chord = length if half == 0 else length * math.sin(half) / half
    return x + chord * math.cos(direction + half), y + chord * math.sin(direction + half), direction + 2 * half


def _point(node: Record) -> tuple[float, float]:
    return fields.number(node, "x"), fields.number(node, "y")


def _sound(shape: BaseGeometry) -> BaseGeometry:
    """The polygons of a shape, repaired where its outline touches or crosses itself."""
    if not shape.is_valid:
        made = shapely.make_valid(shape)
        parts = [part for part in getattr(made, "geoms", [made]) if isinstance(part, Polygon | MultiPolygon)]
        shape = shapes.union_all(parts)
    if shape.is_empty or shape.area == 0:
        raise InvalidError("its polygon is not valid")
    return shape
