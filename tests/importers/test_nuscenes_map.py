"""The map expansion of nuScenes."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path

import pytest

from scenicq.geometry.network import Network
from scenicq.importers.fields import InvalidError
from scenicq.importers.nuscenes_map import arcline_points, read_expansion

TINY = Path(__file__).parents[2] / "sample_data" / "nuscenes_tiny" / "maps" / "expansion" / "tiny-town.json"


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
    "path", [[], [piece("LSX", [1, 1, 1])], [piece("SSS", [0, 0, 0])], [{"shape": "LSR"}], [piece("LSR", [1.0])], [7]]
)
def test_unsound_paths(path: list[dict[str, object]]) -> None:
    with pytest.raises(InvalidError):
        arcline_points(path)


def test_tiny_town() -> None:
    problems: list[tuple[str, str]] = []
    features = read_expansion(TINY, lambda id, problem: problems.append((id, problem)))
    assert problems == []
    kinds = sorted(feature.kind for feature in features)
    assert kinds == sorted(
        [
            *["drivable", "road", "intersection", "lane", "lane", "lane", "lane_group", "lane_group"],
            *["crossing", "sidewalk", "stop_line", "carpark_area"],
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
    features = read_expansion(file, problems.__setitem__)
    assert problems["lost"] == "polygon `nowhere` is not there"
    assert problems[content["lane"][0]["token"]] == "the lane has no path, so no direction"
    assert len(problems) == 3
    assert len(features) == 11
