"""The referee itself, on maps and labels small enough to check with a pencil."""

import ast
import math
from pathlib import Path
from typing import Any

import five_scenarios
import pytest
import road_map
import scene_conditions
import shapely
from made_scenes import EPS, Item, body, feature, run, street
from road_map import RoadMap
from scene_conditions import Body, Scene, Tolerances


def edge(inside: float, outward: int) -> list[Any]:
    """A value just inside an edge, which must match, and one just outside, which must not."""
    return [pytest.param(inside - outward * EPS, True), pytest.param(inside + outward * EPS, False)]


ADULT = "human.pedestrian.adult"


def test_independence() -> None:
    own = (five_scenarios, road_map, scene_conditions)
    tree = ast.parse("\n".join(Path(str(module.__file__)).read_text() for module in own))
    roots = {alias.name.split(".")[0] for n in ast.walk(tree) if isinstance(n, ast.Import) for alias in n.names}
    roots |= {(n.module or ".").split(".")[0] for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    standard = {"collections", "dataclasses", "itertools", "json", "math", "pathlib", "typing"}
    assert roots <= standard | {"numpy", "shapely"} | {module.__name__ for module in own}


class TestPedestrian:
    def test_match(self, tmp_path: Path) -> None:
        found = run(tmp_path, 1, body("e", 2, 0), body("b", 2, 20, 90, ADULT), body("a", 2, 30, -180, ADULT))
        assert found == [{"ego": "ego", "pedestrian": "a"}, {"ego": "ego", "pedestrian": "b"}]

    @pytest.mark.parametrize(("x", "matches"), edge(8.25, 1) + edge(-4.25, -1))
    def test_pedestrian_on_roadway(self, tmp_path: Path, x: float, matches: bool) -> None:
        assert bool(run(tmp_path, 1, body("e", 2, 0), body("p", x, 20, 90, ADULT))) == matches

    @pytest.mark.parametrize(("x", "matches"), edge(8.25, 1))
    def test_ego_on_roadway(self, tmp_path: Path, x: float, matches: bool) -> None:
        assert bool(run(tmp_path, 1, body("e", x, 0), body("p", 2, 20, 90, ADULT))) == matches

    @pytest.mark.parametrize(("turn", "matches"), edge(20, 1) + edge(-20, -1))
    def test_ego_facing(self, tmp_path: Path, turn: float, matches: bool) -> None:
        assert bool(run(tmp_path, 1, body("e", 2, 0, turn), body("p", 2, 20, 180, ADULT))) == matches

    @pytest.mark.parametrize(("turn", "matches"), edge(70, -1) + edge(-70, 1) + edge(290, 1) + [(180, True)])
    def test_relative_heading(self, tmp_path: Path, turn: float, matches: bool) -> None:
        assert bool(run(tmp_path, 1, body("e", 2, 0), body("p", 2, 20, turn, ADULT))) == matches

    @pytest.mark.parametrize(("y", "matches"), edge(50, 1))
    def test_radius(self, tmp_path: Path, y: float, matches: bool) -> None:
        pedestrian = body("p", 2, y, 90, ADULT)
        assert bool(run(tmp_path, 1, body("e", 2, 0), pedestrian)) == matches
        assert run(tmp_path, 1, body("e", 2, 0), pedestrian, radius=None)

    @pytest.mark.parametrize(("start", "matches"), edge(50, 1))
    def test_region_cut_to_the_radius(self, tmp_path: Path, start: float, matches: bool) -> None:
        features = [street()[1], feature("intersection", "far", (1, start, 3, start + 5))]
        features[0]["geometry"] = shapely.geometry.mapping(shapely.box(0, -10, 4, 10))
        ego, pedestrian = body("e", 2, 0), body("p", 2, 49.9, 90, ADULT)
        assert bool(run(tmp_path, 1, ego, pedestrian, features=features)) == matches
        assert run(tmp_path, 1, ego, pedestrian, features=features, radius=None)

    @pytest.mark.parametrize(
        ("kind", "matches"), [("human.pedestrian.child", True), ("vehicle.car", False), ("animal", False)]
    )
    def test_class(self, tmp_path: Path, kind: str, matches: bool) -> None:
        assert bool(run(tmp_path, 1, body("e", 2, 0), body("p", 2, 20, 90, kind))) == matches

    def test_yaw(self, tmp_path: Path) -> None:
        ego = {"position": [2, 0], "yaw": math.pi / 2}
        pedestrian = {"id": "p", "class": ADULT, "position": [2, 20], "yaw": math.radians(160 - EPS)}
        assert not run(tmp_path, 1, ego, pedestrian, angle="yaw")
        pedestrian["yaw"] = math.radians(160 + EPS)
        assert run(tmp_path, 1, ego, pedestrian, angle="yaw")

    def test_other_class_lists_are_refused(self, tmp_path: Path) -> None:
        with pytest.raises(ValueError, match="neither nuscenes"):
            run(tmp_path, 1, body("e", 2, 0), classes="other.json")


class TestCrossing:
    def test_roles_are_told_apart(self, tmp_path: Path) -> None:
        found = run(tmp_path, 2, body("e", 2, 95), body("a", 0, 104, 90), body("b", 3, 108, -90))
        assert found == [{"ego": "ego", "leftward": "a", "rightward": "b"}]

    def test_correspondences_are_injective(self, tmp_path: Path) -> None:
        assert not run(tmp_path, 2, body("e", 2, 95), body("a", 0, 104, 90))
        assert not run(tmp_path, 2, body("e", 2, 95), body("a", 0, 104, 90), body("b", 3, 108, 90))

    @pytest.mark.parametrize(("turn", "matches"), edge(45, -1) + edge(140, 1) + edge(45 + 360, -1))
    def test_leftward(self, tmp_path: Path, turn: float, matches: bool) -> None:
        assert bool(run(tmp_path, 2, body("e", 2, 95), body("a", 0, 104, turn), body("b", 3, 108, -100))) == matches

    @pytest.mark.parametrize(("turn", "matches"), edge(-45, 1) + edge(-140, -1))
    def test_rightward(self, tmp_path: Path, turn: float, matches: bool) -> None:
        assert bool(run(tmp_path, 2, body("e", 2, 95), body("a", 0, 104, 100), body("b", 3, 108, turn))) == matches

    @pytest.mark.parametrize(("turn", "matches"), [*edge(-50, 1), (-130, True), (-135, True)])
    def test_relative_heading(self, tmp_path: Path, turn: float, matches: bool) -> None:
        assert bool(run(tmp_path, 2, body("e", 2, 95), body("a", 0, 104, 50), body("b", 3, 108, turn))) == matches

    @pytest.mark.parametrize(("y", "matches"), [*edge(90, -1), (100, True)])
    def test_distance_to_intersection(self, tmp_path: Path, y: float, matches: bool) -> None:
        assert bool(run(tmp_path, 2, body("e", 2, y), body("a", 0, 104, 90), body("b", 3, 108, -90))) == matches

    @pytest.mark.parametrize(("y", "matches"), edge(99.75, -1) + edge(112.25, 1))
    def test_on_intersection(self, tmp_path: Path, y: float, matches: bool) -> None:
        for a, b in ((y, 104), (104, y)):
            assert bool(run(tmp_path, 2, body("e", 2, 95), body("a", 0, a, 90), body("b", 3, b, -90))) == matches

    @pytest.mark.parametrize("kind", ["vehicle.truck", "vehicle.bicycle", "vehicle.construction", "vehicle.trailer"])
    def test_coarse(self, tmp_path: Path, kind: str) -> None:
        scene = (body("e", 2, 95), body("a", 0, 104, 90, kind), body("b", 3, 108, -90))
        assert run(tmp_path, 2, *scene)
        assert not run(tmp_path, 2, *scene, coarse=False)


class TestAgainstTraffic:
    @pytest.mark.parametrize(
        ("turn", "matches"), [*edge(85, -1), *edge(-85, 1), (180, True), (-180, True), (540, True)]
    )
    def test_ego_facing(self, tmp_path: Path, turn: float, matches: bool) -> None:
        ahead = math.radians(turn)
        other = body("o", 2 - 5 * math.sin(ahead), 5 * math.cos(ahead))
        other["heading"] = math.pi if other["position"][0] < 0 else 0.0
        assert bool(run(tmp_path, 3, body("e", 2, 0, turn), other)) == matches

    @pytest.mark.parametrize(("y", "matches"), edge(-10, -1))
    def test_distance(self, tmp_path: Path, y: float, matches: bool) -> None:
        assert bool(run(tmp_path, 3, body("e", 2, 0, 180), body("o", 2, y))) == matches

    @pytest.mark.parametrize("side", [-1, 1])
    @pytest.mark.parametrize(("angle", "matches"), edge(67.5, 1))
    def test_view_angle(self, tmp_path: Path, side: int, angle: float, matches: bool) -> None:
        a = math.pi + side * math.radians(angle)
        other = body("o", 6 - 5 * math.sin(a), 5 * math.cos(a))
        found = run(tmp_path, 3, body("e", 6, 0, 180), other, tolerance_x=0.0, tolerance_y=0.0, heading_tolerance=0.0)
        assert bool(found) == matches

    @pytest.mark.parametrize(("y", "matches"), edge(0.25, 1))
    def test_view_within_tolerance(self, tmp_path: Path, y: float, matches: bool) -> None:
        assert bool(run(tmp_path, 3, body("e", 2, 0, 180), body("o", 2, y))) == matches

    @pytest.mark.parametrize(("turn", "matches"), edge(20, 1) + edge(-20, -1))
    def test_other_facing(self, tmp_path: Path, turn: float, matches: bool) -> None:
        assert bool(run(tmp_path, 3, body("e", 2, 0, 180), body("o", 2, -5, turn))) == matches

    @pytest.mark.parametrize(("x", "matches"), edge(12.25, 1))
    def test_on_road(self, tmp_path: Path, x: float, matches: bool) -> None:
        assert bool(run(tmp_path, 3, body("e", x, 0, 180), body("o", 7, -5))) == matches
        assert bool(run(tmp_path, 3, body("e", 7, 0, 180), body("o", x, -5))) == matches


SECOND_EDGES = [(-3.25, 20, 180), (-0.75, 20, 180), (-2, 35.75, 180), (-2, -4.75, 180), (-2, 20, 160), (-2, 20, -160)]


class TestTwoLanes:
    ego = body("e", 2, 0)
    leader, oncoming, second = body("l", 2, 20), body("o", -2, 40, 180), body("s", -2, 20, 180)

    def test_match(self, tmp_path: Path) -> None:
        found = run(tmp_path, 4, self.ego, self.second, self.oncoming, self.leader)
        assert found == [{"ego": "ego", "leader": "l", "oncoming": "o", "second": "s"}]

    @pytest.mark.parametrize(("x", "matches"), edge(3.25, 1) + edge(0.75, -1))
    def test_leader_beside(self, tmp_path: Path, x: float, matches: bool) -> None:
        assert bool(run(tmp_path, 4, self.ego, body("l", x, 20), self.oncoming, self.second)) == matches

    @pytest.mark.parametrize(("y", "matches"), edge(4.25, -1) + edge(44.75, 1))
    def test_leader_ahead(self, tmp_path: Path, y: float, matches: bool) -> None:
        assert bool(run(tmp_path, 4, self.ego, body("l", 2, y), self.oncoming, self.second)) == matches

    @pytest.mark.parametrize(("y", "matches"), edge(5.75, -1) + edge(46.25, 1))
    def test_lengths_of_the_label(self, tmp_path: Path, y: float, matches: bool) -> None:
        ego, leader = body("e", 2, 0, length=5.0), body("l", 2, y, length=7.0)
        assert bool(run(tmp_path, 4, ego, leader, self.oncoming, self.second)) == matches

    @pytest.mark.parametrize(("turn", "matches"), edge(20, 1) + edge(-20, -1))
    def test_leader_facing(self, tmp_path: Path, turn: float, matches: bool) -> None:
        assert bool(run(tmp_path, 4, self.ego, body("l", 2, 20, turn), self.oncoming, self.second)) == matches

    @pytest.mark.parametrize(("x", "matches"), edge(1.25, 1) + edge(-8.25, -1))
    def test_oncoming_beside(self, tmp_path: Path, x: float, matches: bool) -> None:
        second = body("s", x, 20, 180 if x < 0 else 0)
        assert bool(run(tmp_path, 4, self.ego, self.leader, body("o", x, 40, 180), second)) == matches

    @pytest.mark.parametrize(("y", "matches"), edge(-0.25, -1) + edge(50.25, 1))
    def test_oncoming_ahead(self, tmp_path: Path, y: float, matches: bool) -> None:
        second = body("s", -2, y - 20, 180)
        found = run(tmp_path, 4, self.ego, self.leader, body("o", -2, y, 180), second, radius=None)
        assert bool(found) == matches

    @pytest.mark.parametrize(("turn", "matches"), edge(135, -1) + edge(225, 1) + edge(-135, 1))
    def test_oncoming_facing(self, tmp_path: Path, turn: float, matches: bool) -> None:
        h = math.radians(turn)
        second = body("s", -2 - 10 * math.sin(h), 40 + 10 * math.cos(h))
        second["heading"] = math.pi if second["position"][0] < 0 else 0.0
        assert bool(run(tmp_path, 4, self.ego, self.leader, body("o", -2, 40, turn), second)) == matches

    @pytest.mark.parametrize(("x", "y", "turn"), SECOND_EDGES)
    def test_second(self, tmp_path: Path, x: float, y: float, turn: float) -> None:
        scene = (self.ego, self.leader, self.oncoming, body("s", x, y, turn))
        assert run(tmp_path, 4, *scene, slack=EPS)
        assert not run(tmp_path, 4, *scene, slack=-EPS)


class TestCutIn:
    cutting = body("c", 4, 2, 20)

    @pytest.mark.parametrize(("x", "matches"), [*edge(4.25, 1), *edge(-0.25, -1), (6, False)])
    def test_ego_lane(self, tmp_path: Path, x: float, matches: bool) -> None:
        sign, turn = (-1, 180) if x < 0 else (1, 0)
        assert bool(run(tmp_path, 5, body("e", x, 0, turn), body("c", x + sign, 2 * sign, turn + 20))) == matches

    @pytest.mark.parametrize(("turn", "matches"), edge(10, -1) + edge(35, 1) + edge(-10, 1) + edge(-35, -1))
    def test_cutting_facing(self, tmp_path: Path, turn: float, matches: bool) -> None:
        assert bool(run(tmp_path, 5, body("e", 2, 0), body("c", 4, 2, turn))) == matches

    @pytest.mark.parametrize(("x", "matches"), edge(1.75, -1) + edge(6.25, 1))
    def test_cutting_beside(self, tmp_path: Path, x: float, matches: bool) -> None:
        assert bool(run(tmp_path, 5, body("e", 2, 0), body("c", x, 2, 20))) == matches

    @pytest.mark.parametrize(("y", "matches"), edge(-0.25, -1) + edge(5.25, 1))
    def test_cutting_ahead(self, tmp_path: Path, y: float, matches: bool) -> None:
        assert bool(run(tmp_path, 5, body("e", 2, 0), body("c", 4, y, 20))) == matches

    def test_right_must_exist(self, tmp_path: Path) -> None:
        features = street()
        features[1]["properties"]["right"] = "gone"
        assert not run(tmp_path, 5, body("e", 2, 0), self.cutting, features=features)

    @pytest.mark.parametrize(("ahead", "matches"), [(2.0, True), (-2.0, False)])
    def test_sections_replace_their_lane(self, tmp_path: Path, ahead: float, matches: bool) -> None:
        features = [
            *street(),
            feature("lane_section", "lower", (0, -100, 4, 0), lane="west"),
            feature("lane_section", "upper", (0, 0, 4, 100), lane="west", right="east"),
        ]
        found = run(tmp_path, 5, body("e", 2, ahead), body("c", 4, ahead + 2, 20), features=features)
        assert bool(found) == matches


def moved(item: Item, degrees: float) -> Item:
    """An object or a map feature, turned about the origin and carried far away."""

    def place(x: float, y: float) -> list[float]:
        return [x * cos - y * sin + 2000, x * sin + y * cos + 700]

    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    if "geometry" not in item:
        return {**item, "position": place(*item["position"]), "heading": item["heading"] + math.radians(degrees)}
    ring = [place(x, y) for x, y in item["geometry"]["coordinates"][0]]
    lines = [[place(x, y) for x, y in line] for line in item["properties"].get("centerline", [])]
    geometry = {"type": "Polygon", "coordinates": [ring]}
    return {**item, "geometry": geometry, "properties": {**item["properties"], "centerline": lines}}


EGO = body("e", 2, 0)
SCENES: dict[int, list[Item]] = {
    1: [EGO, body("p", 2, 20, 90, ADULT)],
    2: [body("e", 2, 95), body("a", 0, 104, 90), body("b", 3, 108, -90)],
    3: [body("e", 2, 0, 100), body("o", -3, 0, 180)],
    4: [EGO, TestTwoLanes.leader, TestTwoLanes.oncoming, TestTwoLanes.second],
    5: [EGO, TestCutIn.cutting],
}


@pytest.mark.parametrize("degrees", [0.0, 30.0, 130.0, 260.0])
@pytest.mark.parametrize("number", SCENES)
def test_turning_the_world_changes_nothing(tmp_path: Path, number: int, degrees: float) -> None:
    features = [moved(item, degrees) for item in street()]
    scene = [moved(item, degrees) for item in SCENES[number]]
    assert len(run(tmp_path, number, *scene, features=features)) == 1


@pytest.mark.parametrize(("turn", "matches"), edge(20, 1) + edge(-20, -1))
def test_ego_faces_along_the_road(tmp_path: Path, turn: float, matches: bool) -> None:
    leader = body("l", 2 - 5 * math.sin(math.radians(turn)), 5 * math.cos(math.radians(turn)))
    others = {2: SCENES[2][1:], 4: [leader, body("o", -2, 8, 180), body("s", -2, 0, 180)], 5: SCENES[5][1:]}
    for number, objects in others.items():
        ego = {**SCENES[number][0], "heading": math.radians(turn)}
        assert bool(run(tmp_path, number, ego, *objects)) == matches


@pytest.mark.parametrize(("x", "matches"), edge(8.25, 1))
def test_ego_is_on_the_roadway(tmp_path: Path, x: float, matches: bool) -> None:
    assert bool(run(tmp_path, 2, body("e", x, 95), *SCENES[2][1:])) == matches
    others = (body("l", x, 20), body("o", -1.5, 40, 180), body("s", -1.5, 20, 180))
    assert bool(run(tmp_path, 4, body("e", x, 0), *others)) == matches


@pytest.mark.parametrize(
    ("number", "scene", "exactly"),
    [
        pytest.param(1, [EGO, body("p", 8.25, 20, 90, ADULT)], True, id="position"),
        pytest.param(1, [EGO, body("p", 2, 50, 90, ADULT)], True, id="radius"),
        pytest.param(1, [EGO, body("p", 2, 20, 70, ADULT)], False, id="strict angle"),
        pytest.param(2, [body("e", 2, 90), *SCENES[2][1:]], False, id="strict distance to a region"),
        pytest.param(3, [body("e", 2, 0, 180), body("o", 2, -10)], False, id="strict distance"),
        pytest.param(3, [body("e", 2, 0, 180), body("o", 0, -5)], True, id="two nearest lanes"),
        pytest.param(4, [EGO, TestTwoLanes.leader, body("o", -2, 50.25, 180), body("s", -2, 20, 180)], True, id="edge"),
        pytest.param(4, [EGO, body("l", 2, 4.25), *SCENES[4][2:]], True, id="rear edge"),
    ],
)
def test_on_a_boundary(tmp_path: Path, number: int, scene: list[Item], exactly: bool) -> None:
    radius = 50.0 if number == 1 else None
    assert run(tmp_path, number, *scene, radius=radius, slack=EPS)
    assert bool(run(tmp_path, number, *scene, radius=radius)) == exactly
    assert not run(tmp_path, number, *scene, radius=radius, slack=-EPS)


@pytest.mark.parametrize(("turn", "degrees"), [(t, d + q) for t, d in [(45, 0), (30, 30)] for q in (0, 90, 180, 270)])
@pytest.mark.parametrize(("beyond", "meets"), edge(0, 1))
def test_offset_around_a_turned_square(turn: int, degrees: int, beyond: float, meets: bool) -> None:
    x, y = -math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
    reach = (1.0 if turn == 30 else 2**0.5) + 0.25 * abs(x) + 0.5 * abs(y) + beyond
    anchor = Body("a", 3, -4, math.radians(turn), "Car", 4.5)
    placed = Body("b", 3 + x * reach, -4 + y * reach, 0.0, "Car", 4.5)
    scene = Scene(RoadMap([]), anchor, [placed], Tolerances(0.25, 0.5, 0.0, 0.0), None)
    assert scene.offset(placed, anchor, right=(-1, 1), ahead=(-1, 1)) == meets
