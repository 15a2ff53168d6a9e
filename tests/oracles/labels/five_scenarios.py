"""A referee for the matcher: the five sample scenarios, read by hand and decided by brute force.

This module, with `road_map` and `scene_conditions`, deliberately shares no code with the package under test. It reads
an interchange folder directly, writes each scenario out as plain conditions on a label, and tries every injective
assignment of label objects. Slow and simple is the point: a disagreement with the matcher is a bug in one of the two.

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
from itertools import permutations
from pathlib import Path
from typing import Any

import shapely
from road_map import RoadMap
from scene_conditions import Body, Scene, Tolerances

Correspondence = dict[str, str]
CAR_LENGTH = 4.5
COARSE_CLASSES = {"vehicle": "Car", "human": "Pedestrian"}
SCENIC_VEHICLES = "Car Van Truck Bus Motorcycle Bicycle Trailer ConstructionVehicle".split()
SCENIC_PEOPLE = "Pedestrian Adult Child ConstructionWorker PoliceOfficer".split()


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
