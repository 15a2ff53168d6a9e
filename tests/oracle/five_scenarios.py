"""A referee for the matcher: the five sample scenarios, read by hand and decided by brute force.

This module deliberately shares no code with the package under test. It reads an interchange folder directly, writes
each scenario out as plain conditions on a label, and tries every injective assignment of label objects. Slow and simple
is the point: a disagreement with the matcher is a bug in one of the two.

Conventions: metres and radians; heading 0 points along +y and grows counter-clockwise; local offsets are (right,
ahead). An observed position stands for the axis-aligned box of all positions within tolerance of it, an observed
heading for an arc; references to another object's position or heading use the label's value itself, and so do
requirements.

Every condition takes a `slack`: a positive one loosens every inequality by that much, a negative one tightens it. A
frame whose verdict differs between the two signs lies on a boundary, where two correct readings may round apart.
"""

import json
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise, permutations
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

Correspondence = dict[str, str]
Interval = tuple[float, float]
Segments = npt.NDArray[np.float64]
TIE = 1e-9
DIRECTION_REACH = 20.0
CAR_LENGTH = 4.5
COARSE_CLASSES = {"vehicle": "Car", "human": "Pedestrian"}
SCENIC_VEHICLES = "Car Van Truck Bus Motorcycle Bicycle Trailer ConstructionVehicle".split()
SCENIC_PEOPLE = "Pedestrian Adult Child ConstructionWorker PoliceOfficer".split()


@dataclass(frozen=True, slots=True)
class Body:
    """An annotated object or the ego: centre (m), heading (rad), `Car`, `Pedestrian` or None, length (m)."""

    id: str
    x: float
    y: float
    heading: float
    kind: str | None
    length: float


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


def _angle(angle: float) -> float:
    """The same angle in [-pi, pi]."""
    return math.remainder(angle, math.tau)


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Half widths of the position box along x and y (m) and of the heading arc (rad), and the boundary slack."""

    x: float
    y: float
    heading: float
    slack: float


class Scene:
    """One label on its map, with the conditions in which the five programs are written."""

    def __init__(
        self, road_map: RoadMap, ego: Body, bodies: list[Body], tolerances: Tolerances, radius: float | None
    ) -> None:
        """Keep the label objects whose centre is within `radius` (m) of the ego's; None keeps them all."""
        self.map = road_map
        self.ego = ego
        self.slack = tolerances.slack
        self.radius = math.inf if radius is None else radius
        self._tolerances = tolerances
        near = [body for body in bodies if self.distance(body) <= self.radius + self.slack]
        self.cars = [body for body in near if body.kind == "Car"]
        self.pedestrians = [body for body in near if body.kind == "Pedestrian"]
        self._directions: dict[str, frozenset[float]] = {}

    def distance(self, body: Body) -> float:
        """Distance (m) from the ego's centre to the body's."""
        return math.hypot(body.x - self.ego.x, body.y - self.ego.y)

    def _half_sizes(self) -> tuple[float, float]:
        """Half the width and half the height of a tolerance box (m)."""
        return max(self._tolerances.x + self.slack, 0.0), max(self._tolerances.y + self.slack, 0.0)

    def box(self, body: Body) -> BaseGeometry:
        """All positions within tolerance of the body's: a box, or a segment or point where a tolerance is 0."""
        a, b = self._half_sizes()
        return shapely.MultiPoint([(body.x + i * a, body.y + j * b) for i in (-1, 1) for j in (-1, 1)]).convex_hull

    def on(self, area: Area, body: Body, view: tuple[float, float] | None = None) -> bool:
        """Whether the body's position may lie in the area, cut to the radius and, if given, to a view of the ego.

        Args:
            area: The region.
            body: The object to be placed.
            view: Visible distance (m) and full view angle (rad, less than pi) of the ego.
        """
        box, centre = self.box(body), shapely.Point(self.ego.x, self.ego.y)
        reach = self.radius if view is None else min(self.radius, view[0])
        for i in area.meeting(box):
            piece = area.polygons[i].intersection(box)
            if view is not None:
                piece = piece.intersection(self._wedge(*view))
            if not piece.is_empty and piece.distance(centre) <= reach + self.slack:
                return True
        return False

    def _wedge(self, distance: float, angle: float) -> BaseGeometry:
        """A triangle from the ego whose part within `distance` of the ego is the view sector."""
        half = angle / 2 + self.slack
        if half >= math.pi / 2:
            raise ValueError("the sector of a view angle of 180 degrees or more is no triangle")
        side = 2 * distance / math.cos(half)
        sides = (self.ego.heading - half, self.ego.heading + half)
        tips = [(self.ego.x - side * math.sin(h), self.ego.y + side * math.cos(h)) for h in sides]
        return shapely.Polygon([(self.ego.x, self.ego.y), *tips])

    def facing(self, body: Body, degrees: Interval, base: float) -> bool:
        """Whether the body's heading may be `base` (rad) plus an angle of the interval (degrees)."""
        middle = math.radians((degrees[0] + degrees[1]) / 2)
        half = math.radians((degrees[1] - degrees[0]) / 2)
        allowed = half + max(self._tolerances.heading + self.slack, 0.0)
        return abs(_angle(body.heading - base - middle)) <= allowed

    def facing_road(self, body: Body, *degrees: Interval) -> bool:
        """Whether the body's heading may be the road direction at its label position plus an angle of an interval."""
        return any(
            self.facing(body, interval, base) for interval in degrees for base in self._directions_at_label(body)
        )

    def _directions_at_label(self, body: Body) -> frozenset[float]:
        if body.id not in self._directions:
            found = self.map.directions(body.x, body.y)
            moves = [(self.slack, 0.0), (-self.slack, 0.0), (0.0, self.slack), (0.0, -self.slack)]
            for dx, dy in moves if self.slack else []:
                moved = self.map.directions(body.x + dx, body.y + dy)
                found = found | moved if self.slack > 0 else found & moved
            self._directions[body.id] = found
        return self._directions[body.id]

    def offset(self, body: Body, anchor: Body, right: Interval, ahead: Interval) -> bool:
        """Whether the body's position may be the anchor's plus a local offset from a rectangle (m).

        Two convex shapes are apart exactly if they are apart along the normal of one of their sides; those are here the
        map axes and the anchor's own.
        """
        a, b = self._half_sizes()
        x, y = body.x - anchor.x, body.y - anchor.y
        box = [(x + i * a, y + j * b) for i in (-1, 1) for j in (-1, 1)]
        cos, sin = math.cos(anchor.heading), math.sin(anchor.heading)
        rectangle = [
            (u * cos - v * sin, u * sin + v * cos)
            for u in (right[0] - self.slack, right[1] + self.slack)
            for v in (ahead[0] - self.slack, ahead[1] + self.slack)
        ]
        for nx, ny in ((1.0, 0.0), (0.0, 1.0), (cos, sin), (-sin, cos)):
            ours = [px * nx + py * ny for px, py in box]
            theirs = [px * nx + py * ny for px, py in rectangle]
            if max(ours) < min(theirs) or max(theirs) < min(ours):
                return False
        return True

    def ahead_of(self, body: Body, anchor: Body, right: Interval, gap: Interval) -> bool:
        """Like `offset`, with `gap` (m) measured from the anchor's front edge to the body's rear edge."""
        between = anchor.length / 2 + body.length / 2
        return self.offset(body, anchor, right, (gap[0] + between, gap[1] + between))

    def turned_more_than(self, degrees: float, body: Body, other: Body) -> bool:
        """`abs(relative heading of body from other) > degrees`, on the label's values."""
        return abs(_angle(body.heading - other.heading)) > math.radians(degrees) - self.slack

    def nearer_than(self, metres: float, distance: float) -> bool:
        """`distance < metres`, on the label's values."""
        return distance < metres + self.slack


def _pedestrian_facing_ego(s: Scene) -> Iterator[Correspondence]:
    if not (s.on(s.map.roadway, s.ego) and s.facing_road(s.ego, (-15, 15))):
        return
    for pedestrian in s.pedestrians:
        if s.on(s.map.roadway, pedestrian) and s.turned_more_than(70, pedestrian, s.ego):
            yield {"ego": "ego", "pedestrian": pedestrian.id}


def _crossing_cars(s: Scene) -> Iterator[Correspondence]:
    if not (s.on(s.map.roadway, s.ego) and s.facing_road(s.ego, (-15, 15))):
        return
    if not s.nearer_than(10, s.map.intersection.distance(shapely.Point(s.ego.x, s.ego.y))):
        return
    for leftward, rightward in permutations(s.cars, 2):
        if (
            s.facing(leftward, (50, 135), s.ego.heading)
            and s.facing(rightward, (-135, -50), s.ego.heading)
            and s.on(s.map.intersection, leftward)
            and s.on(s.map.intersection, rightward)
            and s.turned_more_than(100, leftward, rightward)
        ):
            yield {"ego": "ego", "leftward": leftward.id, "rightward": rightward.id}


def _against_traffic(s: Scene) -> Iterator[Correspondence]:
    if not (s.on(s.map.road, s.ego) and s.facing_road(s.ego, (90, 180), (-180, -90))):
        return
    for other in s.cars:
        if (
            s.nearer_than(10, s.distance(other))
            and s.on(s.map.road, other, view=(50, math.radians(135)))
            and s.facing_road(other, (-15, 15))
        ):
            yield {"ego": "ego", "other": other.id}


def _two_lane_traffic(s: Scene) -> Iterator[Correspondence]:
    if not (s.on(s.map.roadway, s.ego) and s.facing_road(s.ego, (-15, 15))):
        return
    for leader, oncoming, second in permutations(s.cars, 3):
        if (
            s.ahead_of(leader, s.ego, right=(-1, 1), gap=(0, 40))
            and s.facing_road(leader, (-15, 15))
            and s.offset(oncoming, s.ego, right=(-10, -1), ahead=(0, 50))
            and s.facing(oncoming, (140, 220), s.ego.heading)
            and s.ahead_of(second, oncoming, right=(-1, 1), gap=(0, 40))
            and s.facing_road(second, (-15, 15))
        ):
            yield {"ego": "ego", "leader": leader.id, "oncoming": oncoming.id, "second": second.id}


def _cut_in_from_right(s: Scene) -> Iterator[Correspondence]:
    if not (s.on(s.map.beside_another, s.ego) and s.facing_road(s.ego, (-15, 15))):
        return
    for cutting in s.cars:
        if s.offset(cutting, s.ego, right=(0, 4), ahead=(0, 5)) and s.facing_road(cutting, (15, 30), (-30, -15)):
            yield {"ego": "ego", "cutting": cutting.id}


SCENARIOS: Mapping[int, Callable[[Scene], Iterator[Correspondence]]] = {
    1: _pedestrian_facing_ego,
    2: _crossing_cars,
    3: _against_traffic,
    4: _two_lane_traffic,
    5: _cut_in_from_right,
}


def _kind(name: str, coarse: bool) -> str | None:
    """`Car`, `Pedestrian` or neither, for a class name of nuScenes or of Scenic's libraries."""
    family = name.split(".", maxsplit=1)[0]
    if name in SCENIC_PEOPLE:
        return "Pedestrian"
    if name in SCENIC_VEHICLES:
        return "Car" if coarse or name == "Car" else None
    if coarse or family == "human":
        return COARSE_CLASSES.get(family)
    return "Car" if name == "vehicle.car" else None


def _body(item: dict[str, Any], angle: str, coarse: bool) -> Body:
    x, y = item["position"]
    return Body(
        id=item["id"],
        x=float(x),
        y=float(y),
        heading=float(item[angle]) - (math.pi / 2 if angle == "yaw" else 0.0),
        kind=_kind(item.get("class", ""), coarse),
        length=float(item.get("length") or CAR_LENGTH),
    )


def frames(
    dataset_folder: Path | str,
    scenario_number: int,
    *,
    tolerance_x: float,
    tolerance_y: float,
    heading_tolerance: float,
    coarse: bool = True,
    radius: float | None = None,
    slack: float = 0.0,
) -> dict[str, list[Correspondence]]:
    """Find every correspondence of a sample scenario with every label of an interchange folder.

    Args:
        dataset_folder: Holds `dataset.json` (with nuScenes classes), `labels.jsonl` and `maps/NAME.geojson`.
        scenario_number: 1 to 5, the number that starts the sample's file name.
        tolerance_x: Half width of the position tolerance along the map's x axis (m).
        tolerance_y: The same along y (m).
        heading_tolerance: Half width of the heading tolerance (rad).
        coarse: Count every vehicle as a Car; otherwise only `vehicle.car`. Every human is a Pedestrian in both.
        radius: Drops label objects, and cuts drawn regions, beyond this distance (m) from the ego; None drops nothing.
        slack: Added to every inequality (m or rad), see the module's introduction.

    Returns:
        For each label id all correspondences {object name: label object id}, sorted; the ego's id is "ego". The list is
        empty where the label does not match.

    Raises:
        ValueError: If the folder's classes are neither those of nuScenes nor Scenic's.
    """
    folder = Path(dataset_folder)
    dataset = json.loads((folder / "dataset.json").read_text())
    if dataset.get("classes") not in ("nuscenes", "scenic"):
        raise ValueError(f"classes {dataset.get('classes')!r} are neither nuscenes nor scenic")
    angle: str = dataset["angle"]
    tolerances = Tolerances(tolerance_x, tolerance_y, heading_tolerance, slack)
    maps: dict[str, RoadMap] = {}
    found: dict[str, list[Correspondence]] = {}
    for line in (folder / "labels.jsonl").read_text().splitlines():
        label = json.loads(line)
        name = label["map"]
        if name not in maps:
            maps[name] = RoadMap(json.loads((folder / "maps" / f"{name}.geojson").read_text())["features"])
        ego = _body({**label["ego"], "id": "ego"}, angle, coarse)
        bodies = [_body(item, angle, coarse) for item in label["objects"]]
        scene = Scene(maps[name], ego, bodies, tolerances, radius)
        found[label["id"]] = sorted(SCENARIOS[scenario_number](scene), key=lambda c: sorted(c.items()))
    return found
