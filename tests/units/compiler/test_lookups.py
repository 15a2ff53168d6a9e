"""What lies at a random place: look-ups are drawn, matched and perturbed, and agree with the map itself."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely
from drawing import draw_scene

from scenicq.compiler.element_lookups import LOOKUPS, Lookups, LookupTable
from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenarioError, Source
from scenicq.forest.nodes import Constant, DirectionAt, PointIn
from scenicq.forest.scenario import Scenario
from scenicq.forest.walk import postorder
from scenicq.geometry.network import Network
from scenicq.geometry.occupancy import ElementAtPoint
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.search import group_plan
from scenicq.match.tolerance import EXACT, parse_tolerance
from scenicq.match.verdict import Match, NoMatch, Verdict
from scenicq.store.labels import Label, LabelObject

from .scenes import compiled, network, refused

HEADER = "model scenic.domains.driving.model\n"
ANY = "ego = new Car facing Range(-180, 180) deg\n"
PROGRAMS = {
    "own lane": "ego = new Car\nnew Car on ego.lane\n",
    "lane to the left": "ego = new Car\nnew Car on ego.laneSection.laneToLeft\n",
    "other direction": "ego = new Car\nnew Car on ego.oppositeLaneGroup\n",
    "road": "ego = new Car\nnew Car\nrequire ego.road is ego.lane.road\n",
    "same lane": f"{ANY}other = new Car facing Range(-180, 180) deg\nrequire ego._lane is other._lane\n",
    "other lanes": "ego = new Car\nother = new Car\nrequire ego.lane is not other.lane\n",
    "on through": "ego = new Car\nway = Uniform(*ego.lane.maneuvers)\nnew Car on way.endLane\n",
    "straight on": (
        "ego = new Car\nways = filter(lambda m: m.type is ManeuverType.STRAIGHT, ego.lane.maneuvers)\n"
        "new Car on Uniform(*ways).connectingLane.centerline\n"
    ),
    "hidden place": "ego = new Car\nspot = new OrientedPoint on road\nnew Car on network.laneAt(spot)\n",
    "beside the curb": "ego = new Car\nspot = new OrientedPoint on ego.laneGroup.curb\nnew Car left of spot by 1\n",
    "sidewalk": "ego = new Car\nnew Pedestrian on ego.laneGroup.sidewalk\n",
    "crossing": f"{ANY}who = new Pedestrian on crossing\nrequire who.crossing is network.crossings[0]\n",
    "ways on from there": (
        "ego = new Car\nspot = new OrientedPoint in network.intersections[0]\n"
        "new Car on Uniform(*network.intersections[0].maneuversAt(spot)).endLane\n"
    ),
    "intersection": f"{ANY}new Car in ego.intersection, facing Range(-180, 180) deg\n",
    "nowhere": f"{ANY}require ego._lane is None and ego._element is ego._intersection\n",
    "part of a choice": (
        "lane = Uniform(*network.lanes)\nego = new Car on lane.centerline\n"
        "require lane.sectionAt(ego) is ego.laneSection\n"
    ),
    "numbers": "ego = new Car\nnew Car at ego offset by (0, ego.lane.centerline.length / 10), facing ego.heading\n",
}


@cache
def scenario(name: str) -> Scenario:
    """One of the programs."""
    return compiled(HEADER + PROGRAMS[name])


def label(things: list[tuple[str, float, float, float]]) -> Label:
    """A label of classes, places and headings, the ego first."""
    found = [
        LabelObject(f"object-{number}", category, category, x, y, heading, 2.0, 4.5)
        for number, (category, x, y, heading) in enumerate(things)
    ]
    return Label("frame", "recording", 0, "street", found[0], tuple(found[1:]))


def drawn(name: str, seed: int) -> Label:
    """A scene as a label, its objects in another order and with one that is not part of it."""
    program = scenario(name)
    scene = draw_scene(program, random.Random(seed))
    assert scene is not None
    things = [
        (each.category, *scene.values[each.index, "position"], scene.values[each.index, "heading"])  # type: ignore[misc]
        for each in program.objects
    ]
    return label([things[0], ("Car", 300.0, 300.0, 1.0), *reversed(things[1:])])


@pytest.mark.parametrize("name", PROGRAMS)
@pytest.mark.one_in(6)
def test_a_drawn_scene_matches(name: str) -> None:
    matcher = Matcher(scenario(name), MatchOptions(tolerance=EXACT))
    for seed in range(4):
        verdict = matcher.match(drawn(name, seed))
        assert isinstance(verdict, Match), (seed, verdict)


IN_LANES: dict[str, tuple[float, float, float]] = {
    "outer": (5.25, 50.0, 0.0),
    "inner": (1.75, 70.0, 0.0),
    "oncoming": (-1.75, 60.0, math.pi),
    "elsewhere": (30.0, -1.75, -math.pi / 2),
}


@pytest.mark.parametrize(
    ("name", "where", "matches"),
    [
        ("own lane", "outer", True),
        ("own lane", "inner", False),
        ("lane to the left", "inner", True),
        ("lane to the left", "outer", False),
        ("other direction", "oncoming", True),
        ("other direction", "inner", False),
        ("same lane", "outer", True),
        ("same lane", "oncoming", False),
        ("other lanes", "inner", True),
        ("other lanes", "outer", False),
        ("on through", "elsewhere", False),
        ("hidden place", "elsewhere", True),
    ],
)
def test_a_scene_pushed_out_of_its_element_does_not_match(name: str, where: str, matches: bool) -> None:
    x, y, heading = IN_LANES[where]
    found = Matcher(scenario(name), MatchOptions(tolerance=EXACT)).match(
        label([("Car", 5.25, 20.0, 0.0), ("Car", x, y, heading)])
    )
    assert isinstance(found, Match if matches else NoMatch), found


def test_every_method_gives_the_same_verdict() -> None:
    places = [("Car", x, y, heading) for x, y, heading in IN_LANES.values()]
    for name in ("own lane", "other lanes", "same lane", "on through"):
        for place in places:
            verdicts = {
                type(
                    Matcher(scenario(name), MatchOptions(tolerance=EXACT, method=method)).match(
                        label([places[0], place])
                    )
                )
                for method in ("auto", "smt", "monolithic")
            }
            assert len(verdicts) == 1, (name, place, verdicts)


def pushed(name: str, rng: random.Random) -> Label:
    """A drawn scene whose objects are moved, by centimetres or metres, some of them into the intersection."""
    scene, far = drawn(name, rng.randrange(40)), rng.choice([0.0, 0.2, 1.0, 5.0])

    def moved(each: LabelObject) -> LabelObject:
        x, y = each.x + rng.uniform(-far, far), each.y + rng.uniform(-far, far)
        if rng.random() < 0.15:
            x, y = rng.uniform(-8, 8), rng.uniform(-8, 8)
        return replace(each, x=x, y=y, heading=each.heading + rng.choice([0.0, 0.0, rng.uniform(-0.1, 0.1)]))

    return replace(scene, ego=moved(scene.ego), objects=tuple(map(moved, scene.objects)))


@pytest.mark.parametrize("name", PROGRAMS)
@pytest.mark.one_in(10)
def test_labels_side_by_side_are_decided_as_each_by_itself(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = random.Random(name)
    labels = [pushed(name, rng) for _ in range(24)]
    options = MatchOptions(tolerance=parse_tolerance("position=0.25,heading=5deg"))
    together = Matcher(scenario(name), options)
    found = list(together.match_all([(each, None) for each in labels]))
    if name in ("own lane", "same lane", "road"):
        assert together.plans.first_fits([(each, None) for each in labels], {})
    monkeypatch.setattr(group_plan, "closed_form_of", lambda *_: None)
    matcher = Matcher(scenario(name), options)
    for each, verdict in zip(labels, found, strict=True):
        right = matcher.match(each)
        assert type(verdict) is type(right), (each, verdict, right)
        if isinstance(verdict, Match) and isinstance(right, Match):
            assert verdict.correspondence == right.correspondence


CROSSED = (1.75, -1.75)
"""A point of the intersection in several lanes."""


def test_overlapping_elements_are_each_allowed_and_one_at_a_time() -> None:
    here = [lane.id for lane in network().lanes if shapely.intersects(lane.polygon, shapely.Point(CROSSED))]
    assert len(here) > 1
    ego = label([("Car", *CROSSED, 0.3)])
    first, second = (f"require ego.lane is network.elements['{name}']\n" for name in here[:2])

    def found(text: str) -> Verdict:
        return Matcher(compiled(HEADER + ANY + text, lanes="any"), MatchOptions(tolerance=EXACT)).match(ego)

    for text, verdict in ((first, Match), (second, Match), (first + second, NoMatch)):
        assert isinstance(found(text), verdict), text
    elsewhere = next(lane.id for lane in network().lanes if lane.id not in here)
    text = f"require ego.lane is network.elements['{elsewhere}']\n"
    assert isinstance(found(text), NoMatch)
    # the road and the section are those of the lane that is meant
    own = "require ego.road is ego.lane.road\nrequire ego.laneSection.lane is ego.lane\n"
    assert isinstance(found(first + own), Match)
    assert isinstance(found(first + f"require ego.road.lanes[0] is network.elements['{here[1]}']\n"), NoMatch)


def fields(lookup: str) -> list[ElementAtPoint]:
    """The fields of a look-up at a random place of the street."""
    program = compiled(f"{HEADER}ego = new Car\nx = network.{lookup}(ego, reject=True)\n")
    return [
        node.field.value
        for requirement in program.requirements
        for node in postorder((requirement.condition,))
        if isinstance(node, DirectionAt)
        and isinstance(node.field, Constant)
        and isinstance(node.field.value, ElementAtPoint)
    ]


@pytest.mark.parametrize("lookup", LOOKUPS)
def test_cells_hold_every_point_with_its_option(lookup: str) -> None:
    rng = np.random.default_rng(1)
    for field in fields(lookup)[:3]:
        for _ in range(6):
            west, south = rng.uniform(-15, 12, 2).tolist()
            bounds = (west, south, west + rng.uniform(0, 6), south + rng.choice([0.0, 5.0]))
            cells = [(shapely.Polygon(cell.polygon), cell) for cell in field.cells(bounds)]
            for x, y in rng.uniform(bounds[:2], bounds[2:], (12, 2)).tolist():
                (value,) = field.values(x, y)
                assert -math.pi < value <= math.pi
                here = [cell for shape, cell in cells if shape.distance(shapely.Point(x, y)) < 1e-9]
                assert any(cell.heading == value for cell in here), (lookup, x, y)
                assert all(
                    cell.heading == value for cell in here if not cell.guards and len(field.options.at(x, y)) == 1
                )


def test_what_is_found_is_what_the_map_says() -> None:
    lookups = Lookups()
    for name in ("laneAt", "roadAt", "laneGroupAt", "intersectionAt", "sidewalkAt", "crossingAt", "elementAt"):
        table = lookups.table(name, lambda name=name: LookupTable.of_network(network(), name))
        for x, y in np.random.default_rng(2).uniform(-40, 40, (200, 2)).tolist():
            known = getattr(network(), name)(x, y)
            found = [(*table.options, None)[number] for number in table.occupancy.at(x, y)]
            assert known in found or shapely.distance(found[0].polygon, shapely.Point(x, y)) <= 0.05, (name, x, y)


def test_the_ways_at_a_place_are_those_that_pass_it() -> None:
    scene, rng = (
        compiled(f"{HEADER}{ANY}require len(network.intersections[0].maneuversAt(ego)) == 1\n"),
        random.Random(4),
    )
    matcher, seen = Matcher(scene, MatchOptions(tolerance=EXACT)), set[int]()
    areas = [way.connectingLane.polygon for way in network().intersections[0].maneuvers]
    west, south, east, north = shapely.total_bounds(areas)
    for _ in range(60):
        x, y = rng.uniform(west, east), rng.uniform(south, north)
        count = max(1, sum(shapely.contains_xy(area, x, y) for area in areas))
        if any(shapely.distance(area.boundary, shapely.Point(x, y)) < 0.06 for area in areas):
            continue
        seen.add(count)
        assert isinstance(matcher.match(label([("Car", x, y, 0.0)])), Match if count == 1 else NoMatch)
    assert seen > {1}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("ego = new Object\nx = ego.lane\n", ("unknown-attribute", "lane")),
        ("ego = new Car\nif ego.lane.isForward:\n    pass\n", ("random-branch", "ego.lane.isForward")),
        ("ego = new Car at (500, 500)\nx = ego.lane\n", ("impossible-requirement", "lane")),
        ("ego = new Car\nx = network.roads[0].sections\nrequire len(x) > 0\n", ("map-lacks", "sections")),
        ("ego = new Car\nx = resample(ego.lane)\n", ("wrong-type", "resample(ego.lane)")),
        ("ego = new Car\nx = network.findPointIn(ego, [1])\n", ("wrong-type", "network.findPointIn(ego, [1])")),
    ],
)
def test_what_is_no_element_is_refused(text: str, expected: tuple[str, str]) -> None:
    code, place = refused(HEADER + text)
    assert code == expected[0]
    assert expected[1] in place


def test_the_course_may_depend_on_the_lane_of_a_known_place() -> None:
    text = (
        f"{HEADER}ego = new Car at (1.75, 50)\nfor maneuver in ego.lane.maneuvers:\n    new Car on maneuver.endLane\n"
        "assert ego.lane is network.laneAt((1.75, 60)) and ego._intersection is None\n"
        "assert ego.laneGroup.laneAt(ego).sectionAt(ego) is ego.laneSection\n"
        "assert ego.width == 2 and ego.position.y > 40\nfor n in range(int(ego.width)):\n    new Pedestrian\n"
    )
    program = compiled(text)
    assert [each.category for each in program.objects].count("Car") == 1 + len(network().laneAt(1.75, 50).maneuvers)
    assert [each.category for each in program.objects].count("Pedestrian") == 2


def test_signals_at_intersections_are_what_the_map_says_of_them():
    text = HEADER + "ego = new Car on Uniform(*filter(lambda i: i.isSignalized, network.intersections))\n"
    place = compiled(text).objects[0].properties["position"].value
    assert isinstance(place, PointIn)
    assert [node.value.name for node in postorder((place,)) if isinstance(node, Constant)] == ["Intersection middle"]
    silent = Network("silent", [replace(each, properties={}) for each in network().features])
    with pytest.raises(ScenarioError) as caught:
        compile_scenario(Source("test.scenic", text), silent)
    (diagnostic,) = caught.value.diagnostics
    assert (diagnostic.code, diagnostic.span.text) == ("map-lacks", "isSignalized")


@pytest.mark.parametrize(
    ("part", "lacked"),
    [("backwardLanes.lanes", "backwardLanes"), ("intersection.maneuvers", "intersection")],
)
def test_what_an_element_of_the_map_lacks_is_said_of_the_map(part: str, lacked: str):
    # where Scenic ends with an error of Python
    text = f"{HEADER}some = [road for road in network.allRoads if len(road.{part}) == 1]\nego = new Car on some[0]\n"
    assert refused(text) == ("map-lacks", lacked)
    assert refused(f"{HEADER}found = [None]\nego = new Car at (found[0].x, 1)\n") == ("unknown-attribute", "x")
