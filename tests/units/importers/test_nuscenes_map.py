"""The map expansion of nuScenes: areas, directions, what lies beside what, left-hand traffic; params of its scenes."""

from __future__ import annotations

import json
import math
import shutil
from itertools import pairwise
from pathlib import Path
from random import Random

import pytest

from scenicq.geometry import angles
from scenicq.geometry.network import Network
from scenicq.importers.fields import InvalidError
from scenicq.importers.ingest import ingest
from scenicq.importers.nuscenes_map import arcline_points, read_expansion
from scenicq.importers.report import Report
from scenicq.store.dataset import open_dataset

TINY = Path(__file__).parents[3] / "sample_data" / "nuscenes_tiny" / "maps" / "expansion" / "tiny-town.json"


def piece(shape: str, lengths: list[float], radius: float = 10.0) -> dict[str, object]:
    return {"start_pose": [0.0, 0.0, 0.0], "end_pose": [], "shape": shape, "radius": radius, "segment_length": lengths}


def test_quarter_turn_to_the_left_then_straight() -> None:
    points = arcline_points([piece("LSR", [5 * math.pi, 20.0, 0.0])])
    assert points[0] == (0.0, 0.0)
    assert points[-1] == pytest.approx((10.0, 30.0))
    # Every point of the arc lies on its circle.
    assert all(math.hypot(x, y - 10) == pytest.approx(10) for x, y in points if y < 9.9)
    assert max(math.dist(a, b) for a, b in pairwise(points)) <= 1.0 + 1e-9


def test_right_is_the_mirror_of_left() -> None:
    left, right = (arcline_points([piece(shape, [4.0, 3.0, 2.0])]) for shape in ("LSR", "RSL"))
    assert right == [pytest.approx((x, -y)) for x, y in left]


@pytest.mark.parametrize(
    "path",
    [
        [],
        [piece("LSX", [1, 1, 1])],
        [piece("SSS", [0, 0, 0])],
        [{"shape": "LSR"}],
        [piece("LSR", [1.0])],
        [7],
        [piece("LSR", [0, 1e150, 0])],
        [piece("LSR", [0, -5, 0])],
        [piece("LSR", [0, 15_000, 0])] * 100,
    ],
)
def test_unsound_paths(path: list[dict[str, object]]) -> None:
    with pytest.raises(InvalidError):
        arcline_points(path)


def test_tiny_town() -> None:
    problems: list[tuple[str, str]] = []
    features = read_expansion(TINY, lambda id, problem: problems.append((id, problem)), Report())
    assert problems == []
    kinds = sorted(feature.kind for feature in features)
    assert kinds == sorted(
        [
            *["drivable", "road", "intersection", "lane", "lane", "lane", "lane_group", "lane_group"],
            # The connector inside of the intersection is a road of its own.
            *["crossing", "sidewalk", "stop_line", "carpark_area", "lane_group", "road"],
        ]
    )
    network = Network("tiny-town", features)
    assert network.problems == ()
    east, west = network.roadDirection.values(50, -1.75), network.roadDirection.values(50, 1.75)
    assert (*east, *west) == pytest.approx((-math.pi / 2, math.pi / 2))
    turn = next(feature for feature in features if feature.properties.get("predecessors"))
    assert turn.properties["centerline"][0][-1] == pytest.approx([111.75, 10.0])


def test_dangling_tokens_are_told_and_left_out(tmp_path: Path) -> None:
    content = json.loads(TINY.read_text())
    content["node"] = content["node"][:-1]
    content["lane"].append({"token": "lost", "polygon_token": "nowhere"})
    del content["arcline_path_3"][content["lane"][0]["token"]]
    file = tmp_path / "town.json"
    file.write_text(json.dumps(content))
    problems: dict[str, str] = {}
    features = read_expansion(file, problems.__setitem__, Report())
    assert problems["lost"] == "polygon `nowhere` is not there"
    assert problems[content["lane"][0]["token"]] == "the lane has no path, so no direction"
    assert len(problems) == 3
    assert len(features) == 13


@pytest.mark.parametrize("seed", range(8))
def test_directions_agree_with_step_by_step_integration(seed: int) -> None:
    random = Random(seed)
    start = [random.uniform(-50, 50), random.uniform(-50, 50), random.uniform(-math.pi, math.pi)]
    path: list[dict[str, object]] = []
    poses = [list(start)]
    for _ in range(random.randint(1, 4)):
        radius, shape = random.uniform(6, 300), random.choice(["LSR", "RSL", "LSL", "RSR", "LRL", "RLR"])
        lengths = [random.choice([0.0, random.uniform(0.01, 40)]) for _ in range(3)]
        path.append({"start_pose": poses[-1], "shape": shape, "radius": radius, "segment_length": lengths})
        pose = list(poses[-1])
        for letter, length in zip(shape, lengths, strict=True):
            pose = integrated(pose, {"L": 1 / radius, "R": -1 / radius, "S": 0.0}[letter], length)
        path[-1]["end_pose"] = pose
        poses.append(pose)
    if math.dist(poses[0][:2], poses[-1][:2]) < 1e-3:
        pytest.skip("a path without length")
    points = arcline_points(path)
    assert points[0] == pytest.approx(start[:2])
    assert points[-1] == pytest.approx(poses[-1][:2], abs=1e-5)
    for x, y, _ in poses:
        assert min(math.dist((x, y), point) for point in points) < 1e-5
    (x, y), (before_x, before_y) = points[-1], points[-2]
    # The last chord is at most a metre long: on the narrowest circle it turns by less than 1/6 / 2.
    assert angles.distance(math.atan2(y - before_y, x - before_x), poses[-1][2]) < 0.09


def integrated(pose: list[float], curvature: float, length: float, steps: int = 4000) -> list[float]:
    """A pose moved along an arc by many small steps: the midpoint rule, with an error of micrometres."""
    x, y, direction = pose
    step = length / steps
    for _ in range(steps):
        x += math.cos(direction + curvature * step / 2) * step
        y += math.sin(direction + curvature * step / 2) * step
        direction += curvature * step
    return [x, y, direction]


def street(tmp_path: Path) -> Path:
    """The tiny town with a second lane to the south, beside the one to the east and in its direction."""
    town = json.loads(TINY.read_text())
    first = town["lane"][0]
    nodes = [
        {"token": f"s{n}", "x": x, "y": y} for n, (x, y) in enumerate([(0, -7), (100, -7), (100, -3.5), (0, -3.5)])
    ]
    town["node"] += nodes
    town["polygon"].append(
        {"token": "south area", "exterior_node_tokens": [node["token"] for node in nodes], "holes": []}
    )
    town["lane"].append({**first, "token": "south", "polygon_token": "south area"})
    (path,) = town["arcline_path_3"][first["token"]]
    town["arcline_path_3"]["south"] = [{**path, "start_pose": [0.0, -5.25, 0.0], "end_pose": [100.0, -5.25, 0.0]}]
    for block, polygon in zip(town["road_block"], ("east", "west"), strict=True):
        assert block["road_segment_token"] == town["road_segment"][0]["token"], polygon
    # The block of that direction holds both lanes.
    area = next(each for each in town["polygon"] if each["token"] == town["road_block"][0]["polygon_token"])
    area["exterior_node_tokens"] = ["s0", "s1", *area["exterior_node_tokens"][2:]]
    file = tmp_path / "street.json"
    file.write_text(json.dumps(town))
    return file


def test_neighbours_groups_and_roads(tmp_path: Path) -> None:
    problems: list[object] = []
    file = street(tmp_path)
    network = Network("street", read_expansion(file, lambda *problem: problems.append(problem), Report()))
    assert not problems
    assert network.problems == ()
    east, south, west = (network.laneSectionAt(50, y) for y in (-1.75, -5.25, 1.75))
    assert east is not None
    assert south is not None
    assert west is not None
    assert (east._laneToLeft, east._laneToRight) == (west, south)
    assert (south._laneToLeft, south._laneToRight) == (east, None)
    assert (west._laneToLeft, west._laneToRight) == (east, None)
    assert (south._fasterLane, east._slowerLane, east._fasterLane, west._fasterLane) == (east, south, None, None)
    assert east.group is south.group
    assert east.group is not None
    assert west.group is not None
    assert east.group.opposite is west.group
    assert west.group.opposite is east.group
    assert east.road is west.road
    assert (east.isForward, west.isForward) == (True, False)
    (road,) = network.roads
    assert set(road.lanes) == {east.lane, south.lane, west.lane}
    (crossing,) = network.intersections
    assert (crossing.roads, len(crossing.lanes), crossing.incomingLanes) == ((road,), 1, (east.lane,))
    assert network.crossings[0].properties["road"] == road.id


def test_forks_are_not_beside_each_other(tmp_path: Path) -> None:
    file = street(tmp_path)
    town = json.loads(file.read_text())
    # A lane that leaves the eastward one overlaps with it and is no neighbour.
    town["lane"].append({**town["lane"][0], "token": "fork"})
    town["arcline_path_3"]["fork"] = town["arcline_path_3"][town["lane"][0]["token"]]
    file.write_text(json.dumps(town))
    features = {feature.id: feature for feature in read_expansion(file, lambda *_: None, Report())}
    assert features["fork"].properties["right"] == "south"
    assert town["lane"][0]["token"] not in (features["fork"].properties["left"], features["fork"].properties["right"])


@pytest.mark.parametrize(
    ("location", "left_hand"),
    [
        ("boston-seaport", False),
        ("singapore-onenorth", True),
        ("singapore-hollandvillage", True),
        ("singapore-queenstown", True),
    ],
)
@pytest.mark.one_in(2)
def test_the_side_of_traffic_is_that_of_the_city(tmp_path: Path, location: str, left_hand: bool) -> None:
    root = Path(shutil.copytree(TINY.parents[2], tmp_path / "nuscenes"))
    log = root / "v1.0-tiny" / "log.json"
    log.write_text(log.read_text().replace("tiny-town", location))
    town = json.loads(street(tmp_path).read_text())
    if left_hand:
        # Mirrored, as seen in a mirror that lies along the street.
        for node in town["node"]:
            node["y"] *= -1
        for (path,) in town["arcline_path_3"].values():
            path["start_pose"][1] *= -1
            path["end_pose"][1] *= -1
            path["shape"] = path["shape"].translate(str.maketrans("LR", "RL"))
    (root / "maps" / "expansion" / f"{location}.json").write_text(json.dumps(town))
    ingest(root, tmp_path / "d", strict=True)
    network = open_dataset(tmp_path / "d").network(location)
    side = -1.0 if left_hand else 1.0
    inner, outer = (network.laneSectionAt(50, side * y) for y in (-1.75, -5.25))
    other = network.laneSectionAt(50, side * 1.75)
    assert inner is not None
    assert outer is not None
    assert other is not None
    assert (outer._fasterLane, inner._slowerLane) == (inner, outer)
    assert (inner._laneToRight if left_hand else inner._laneToLeft) is other
    assert inner.group is not None
    assert inner.group.opposite is other.group
    # Both run east, and the curbs are where the outer lanes end.
    assert network.roadDirection.values(50, side * -5.25) == pytest.approx((-math.pi / 2,))
    assert sorted({round(y, 6) for line in network.curbRegion.lines for _, y in line.coords}) == sorted(
        [side * -7.0, side * 3.5]
    )


@pytest.mark.parametrize(
    ("description", "rain", "night"),
    [
        ("Night, rain, drive east", True, True),
        ("Heavy Rain", True, False),
        ("Night, after rain, many peds", False, True),
        ("Parked train, terrain", False, False),
    ],
)
def test_params_of_description_and_log(tmp_path: Path, description: str, rain: bool, night: bool) -> None:
    root = Path(shutil.copytree(TINY.parents[2], tmp_path / "nuscenes"))
    file = root / "v1.0-tiny" / "scene.json"
    scenes = json.loads(file.read_text())
    scenes[0]["description"] = description
    file.write_text(json.dumps(scenes))
    ingest(root, tmp_path / "d")
    label = next(open_dataset(tmp_path / "d").labels())
    assert (label.params["rain"], label.params["night"]) == (rain, night)
    assert label.params["location"] == "tiny-town"
    assert label.params["date"] == "2020-09-13"
    # 12:27:40 of the world is 20:27:40 there.
    assert label.params["time"] == pytest.approx(20 * 60 + 27 + 40 / 60)
    assert label.objects[0].attributes["vehicle"] == "moving"
    assert label.objects[0].attributes["visibility"] == "v80-100"
