"""The referee's map: named areas, and the direction of lanes, read from interchange features."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

Segments = npt.NDArray[np.float64]
TIE = 1e-9
DIRECTION_REACH = 20.0


class Area:
    """A union of polygons, kept as the polygons themselves: being in one of them is being in the union."""

    def __init__(self, polygons: list[BaseGeometry]) -> None:
        """Index the polygons (m, map axes)."""
        self.polygons = polygons
        self._tree = shapely.STRtree(polygons)

    def meeting(self, geometry: BaseGeometry) -> list[int]:
        """The indices of the polygons that share a point with the geometry, boundaries included."""
        return sorted(int(i) for i in self._tree.query(geometry, predicate="intersects"))

    def distance(self, geometry: BaseGeometry) -> float:
        """Euclidean distance (m), 0 inside, infinite if there is no polygon."""
        return min((polygon.distance(geometry) for polygon in self.polygons), default=math.inf)


class RoadMap:
    """The named areas of one map and the direction of its lanes."""

    def __init__(self, features: list[dict[str, Any]]) -> None:
        """Read the features of an interchange map."""
        shapes: dict[str, list[BaseGeometry]] = {"lane": [], "road": [], "intersection": [], "lane_section": []}
        properties: dict[str, list[dict[str, Any]]] = {kind: [] for kind in shapes}
        for feature in features:
            kind = feature["properties"]["kind"]
            if kind in shapes:
                shapes[kind].append(shapely.geometry.shape(feature["geometry"]))
                properties[kind].append(feature["properties"])
        self.intersection = Area(shapes["intersection"])
        self.roadway = Area(shapes["lane"] + shapes["intersection"])
        self.road = Area(shapes["lane"] + shapes["road"] + shapes["intersection"])

        sectioned = {section["lane"] for section in properties["lane_section"]}
        ids = {str(lane["id"]) for kind in ("lane", "lane_section") for lane in properties[kind]}
        self.beside_another = Area(
            [
                shape
                for kind in ("lane", "lane_section")
                for shape, section in zip(shapes[kind], properties[kind], strict=True)
                if section.get("right") in ids and not (kind == "lane" and section["id"] in sectioned)
            ]
        )

        directed = [
            (shape, segments)
            for shape, lane in zip(shapes["lane"], properties["lane"], strict=True)
            if len(segments := _segments(lane.get("centerline") or []))
        ]
        self._directed = Area([shape for shape, _ in directed])
        self._segments = [segments for _, segments in directed]

    def directions(self, x: float, y: float) -> frozenset[float]:
        """Every heading that `roadDirection` may have at a point; empty where it is undefined."""
        point = shapely.Point(x, y)
        lanes = self._directed.meeting(point)
        if lanes and not self.intersection.meeting(point):
            return _nearest_headings(np.concatenate([self._segments[lane] for lane in lanes]), x, y)
        if not lanes:
            distances = [polygon.distance(point) for polygon in self._directed.polygons]
            nearest = min(distances, default=math.inf)
            if nearest > DIRECTION_REACH:
                return frozenset()
            lanes = [lane for lane, distance in enumerate(distances) if distance <= nearest + TIE]
        return frozenset().union(*(_nearest_headings(self._segments[lane], x, y) for lane in lanes))


def _segments(centerline: list[list[list[float]]]) -> Segments:
    """The segments of some polylines as rows (x0, y0, x1, y1), without those of length zero."""
    rows = [[*a[:2], *b[:2]] for line in centerline for a, b in pairwise(line) if a[:2] != b[:2]]
    return np.array(rows, dtype=np.float64).reshape(-1, 4)


def _nearest_headings(segments: Segments, x: float, y: float) -> frozenset[float]:
    """The headings of the segment nearest to a point, of each of them in a tie."""
    along = segments[:, 2:] - segments[:, :2]
    offset = np.array([x, y]) - segments[:, :2]
    fraction = np.clip((along * offset).sum(axis=1) / (along * along).sum(axis=1), 0, 1)
    distance = np.hypot(*(offset - fraction[:, None] * along).T)
    return frozenset(math.atan2(-dx, dy) for dx, dy in along[distance <= distance.min() + TIE].tolist())
