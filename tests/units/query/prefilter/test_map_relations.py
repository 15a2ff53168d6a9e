"""Look-ups as relations in SQL: what is left out does not match, and what is decided does, on overlapping lanes."""

from __future__ import annotations

import itertools
import math
import random
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from shapely import Point, union_all

from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenarioError, Source
from scenicq.forest.evaluate import evaluate
from scenicq.forest.nodes import GOING, LAST_LANE, Constant, Index, Node, PointIn, Select
from scenicq.forest.walk import leaves
from scenicq.geometry.abstract_map import AbstractNetwork
from scenicq.geometry.features import REFERENCES, MapFeature
from scenicq.geometry.regions import PolygonSet
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.problem.preprocess import prepare_scenario
from scenicq.match.tolerance import EXACT, parse_tolerance
from scenicq.match.verdict import Match, NoMatch
from scenicq.query.execution import run
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.prefilter.map_relations import MapRelations
from scenicq.query.prefilter.regions import RegionNames
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset

sys.path.insert(0, str(Path(__file__).parents[1]))
from nudged_scenes import STREET

HEAD = (
    "from scenic.domains.driving.roads import ManeuverType\nmodel scenic.domains.driving.model\n"
    "ego = new Car in everywhere, facing Range(-180, 180) deg\n"
)
ANY = "in everywhere, facing Range(-180, 180) deg"
TOLERANCES = (EXACT, parse_tolerance("position=0.25,heading=5deg"), parse_tolerance("position=1.5,heading=20deg"))
OWNERS = ("ego.lane", "ego.laneGroup", "ego.road", "ego.laneSection", "network.laneAt(ego)", "ego.oppositeLaneGroup")
PLACES = (
    *OWNERS, "ego.intersection", "ego.crossing", "ego.laneSection.laneToLeft", "ego.laneSection.laneToRight",
    "ego.laneGroup.sidewalk", "ego.lane.group", "ego.lane.road", "ego.lane.lanesAhead(30)", "ego.element",
    "ego.lane.union(ego.road)", "(ego._intersection or ego._road or road)",
)  # fmt: skip
NAMES = (
    "ego._lane",
    "ego._road",
    "ego._laneGroup",
    "ego._intersection",
    "other._lane",
    "other._crossing",
    "other._road",
)
FARTHER = ("intersection", "crossing", "road", "ego.lane", "network.lanes[0]")
LINKED = (
    "ego.lane", "ego.laneGroup", "ego.road", "ego.laneSection", "ego.oppositeLaneGroup", "ego.lane.group",
    "ego.lane.road", "ego.laneSection.laneToLeft", "ego.laneSection.laneToRight", "ego.laneSection.fasterLane",
    "ego.laneSection._slowerLane", "ego.laneSection.lane", "ego.lane.group.opposite", "ego.laneGroup.road",
    "ego.laneSection.laneToLeft.laneToLeft", "ego.laneSection.laneToRight.lane", "ego.laneSection.laneToLeft.group",
    "ego.road.intersection", "ego._lane.group", "(ego.laneSection._laneToLeft or ego.lane)",
)  # fmt: skip
"""Elements that links lead to from where the ego is."""
LISTS = (
    "ego.laneGroup.lanes", "ego.lane.successors", "ego.lane.predecessors", "ego.lane.adjacentLanes", "ego.road.lanes",
    "ego.lane.group.lanes", "ego.intersection.incomingLanes", "ego.intersection.outgoingLanes",
    "ego.intersection.lanes", "ego.laneSection.lane.successors", "ego.laneSection.laneToLeft.lane.successors",
    "ego.lane.group.opposite.lanes", "ego.road.intersection.lanes",
)  # fmt: skip
"""Lists of lanes that elements have."""
AHEAD = (
    "ego.lane.lanesAhead({})", "ego.laneSection.lane.lanesAhead({})",
    "ego.laneSection.laneToRight.lane.lanesAhead({})",
)  # fmt: skip
"""What lies ahead of a lane."""
TURNS = ("LEFT_TURN", "RIGHT_TURN", "STRAIGHT")


def question(draw: random.Random) -> str:
    """A program that asks for elements of the map."""
    place = draw.choice(PLACES)
    sort = draw.choice(["Car", "Car", "Pedestrian"])
    facing = draw.choice(["", ", facing Range(-180, 180) deg", ", facing Range(-30, 30) deg relative to ego.heading"])
    placed = draw.choice([f"new {sort} {draw.choice(['on', 'in'])} {place}{facing}", f"new {sort} {ANY}"])
    lines = [f"other = {placed}"]
    for _ in range(draw.choice([0, 1, 1, 2])):
        one, two = draw.sample(NAMES, 2)
        lane = draw.choice(STREET.lanes).id
        lines.append(
            "require "
            + draw.choice([
                f"{one} is {two}", f"{one} is not {two}", f"{one} is None", f"not ({one} is None)",
                f"{one} is not None",
                "ego._laneGroup is other._laneGroup", "ego._intersection is other._intersection",
                "ego.lane is other.lane", "ego.road is other.road", f"ego._lane is network.elements['{lane}']",
                f"not (other._lane is network.elements['{lane}'])", "ego.laneGroup is other._laneGroup",
                "5 < (distance to other) < 20", f"other.position in {place}", "ego.lane is not other._lane",
                f"other in {place}", f"not (other.position in {place})", f"not (other in {place})",
                f"(distance from ego to {draw.choice(FARTHER)}) < {draw.choice([0.5, 3, 10])}",
                f"(distance from other to {draw.choice(FARTHER)}) > {draw.choice([0.5, 3])}",
                f"{draw.choice(['any', 'all'])}([m.type is ManeuverType.{draw.choice(TURNS)} "
                "for m in ego.lane.maneuvers])",
                f"len(ego.lane.maneuvers) {draw.choice(['>', '<', '=='])} {draw.choice([1, 2])}",
            ])
        )  # fmt: skip
    return HEAD + "\n".join(lines) + "\n"


def linked_question(draw: random.Random) -> str:
    """A program that asks how elements of the map hang together."""
    place = draw.choice(LINKED)
    facing = draw.choice(["", ", facing Range(-180, 180) deg", ", facing Range(-30, 30) deg relative to ego.heading"])
    placed = draw.choice([f"new Car {draw.choice(['on', 'in'])} {place}{facing}"] * 3 + [f"new Car {ANY}"])
    lines = [f"other = {placed}"]
    for _ in range(draw.choice([0, 1, 1, 2])):
        side, one = draw.choice(["Left", "Right"]), draw.choice(LINKED)
        lines.append(
            "require "
            + draw.choice([
                "other.lane is ego.lane", "other.laneGroup is ego.laneGroup", "other.road is ego.lane.road",
                "other._laneGroup is ego.lane.group.opposite", "other.lane.group is ego.laneGroup",
                f"other.laneSection is ego.laneSection._laneTo{side}",
                f"other._lane is ego.laneSection.laneTo{side}.lane",
                f"ego.laneSection.laneTo{side} is other.laneSection", "not (other._laneGroup is ego._laneGroup)",
                f"ego.laneSection._laneTo{side} is None", f"ego.laneSection._laneTo{side} is not None",
                f"other.laneSection._laneTo{side} is not None", "other.lane.group.opposite is not None",
                "ego.laneSection.laneToLeft is not ego.laneSection.laneToRight", "ego.laneGroup is ego.lane.group",
                "ego.road.intersection is None", f"other in {one}", f"not (other.position in {one})",
                "5 < (distance to other) < 20",
            ])
        )  # fmt: skip
    return HEAD + "\n".join(lines) + "\n"


def listed_question(draw: random.Random) -> str:
    """A program that asks for lists of elements, for one of a list, or for what lies ahead."""
    place = draw.choice([
        f"Uniform(*{draw.choice(LISTS)})", draw.choice(AHEAD).format(draw.choice([0, 3, 12.5, 40, 100])),
        draw.choice(LINKED), f"Uniform(*{draw.choice(LISTS)}).group",
        "Uniform(*ego.lane.sections)", "Uniform(*ego.laneSection.adjacentLanes)", "Uniform(*ego.intersection.roads)",
    ])  # fmt: skip
    facing = draw.choice(
        ["", "", ", facing Range(-180, 180) deg", ", facing Range(-30, 30) deg relative to ego.heading"]
    )
    placed = draw.choice([f"new Car {draw.choice(['on', 'in'])} {place}{facing}"] * 3 + [f"new Car {ANY}"])
    lines = [f"other = {placed}"]
    if draw.random() < 0.25:
        lines = [f"there = {place}", f"other = new Car on there{facing}", f"third = new Car in there{facing}"]
    for _ in range(draw.choice([0, 1, 1, 2])):
        name, ahead = draw.choice(LISTS), draw.choice(AHEAD).format(draw.choice([0, 8, 30]))
        lines.append(
            "require "
            + draw.choice([
                f"other.lane in {name}", f"other._lane in {name}", f"not (other.lane in {name})",
                f"other.lane not in {name}", f"other in {ahead}", f"not (other.position in {ahead})",
                f"other.lane in {name} or other.lane is ego.lane", "other.laneSection in ego.lane.sections",
                "other.laneSection in ego.laneSection.adjacentLanes", "other.road in ego.intersection.roads",
                f"other.lane is Uniform(*{name})", f"other.lane.group is Uniform(*{name}).group",
                f"ego.lane in other.lane.{draw.choice(['successors', 'predecessors', 'adjacentLanes'])}",
                "5 < (distance to other) < 20", "ego._intersection is None",
            ])
        )  # fmt: skip
    return HEAD + "\n".join(lines) + "\n"


def called_otherwise(features: Sequence[MapFeature], number: int) -> list[MapFeature]:
    """The same map with the names of elements of each kind exchanged."""
    kinds: dict[str, list[str]] = {}
    for each in features:
        kinds.setdefault(each.kind, []).append(each.id)
    names = {
        name: listed[(place + number) % len(listed)] for listed in kinds.values() for place, name in enumerate(listed)
    }

    def renamed(value: object) -> object:
        return [names.get(each, each) for each in value] if isinstance(value, list) else names.get(value, value)

    return [
        replace(
            each,
            id=names[each.id],
            properties={
                key: renamed(value) if key in REFERENCES.get(each.kind, {}) and value is not None else value
                for key, value in each.properties.items()
            },
        )
        for each in features
    ]


def labels(draw: random.Random, count: int) -> list[Label]:
    """Cars and people on lanes and crossings, near their edges, where lanes overlap, and elsewhere."""

    def place() -> tuple[float, float, float]:
        lane = draw.choice(STREET.lanes)
        spot = lane.centerline.lines[0].interpolate(draw.random(), normalized=True) if draw.random() < 0.7 else None
        x, y = (spot.x, spot.y) if spot is not None else (draw.uniform(-9, 9), draw.uniform(-9, 9))
        if draw.random() < 0.4:
            # upon an edge, or within centimetres of it
            ring = lane.polygon.exterior
            spot = ring.interpolate(draw.random() * ring.length)
            x, y = spot.x, spot.y
        off = draw.choice([0.0, 0.0, 1e-7, 0.03, 0.06, 0.24, 0.26, 1.0])
        turn = draw.uniform(0, math.tau)
        flow = STREET.roadDirection.values(x, y)
        heading = draw.choice([*flow, draw.uniform(-3, 3)]) + draw.choice([0.0, draw.uniform(-0.4, 0.4)])
        return x + off * math.cos(turn), y + off * math.sin(turn), math.remainder(heading, math.tau)

    def thing(name: str, sort: str) -> LabelObject:
        return LabelObject(name, sort, sort, *place(), 2.0, 4.5)

    return [
        Label(
            f"{number:04}", "r", number * 500_000, STREET.name, thing("ego", "Car"),
            tuple(thing(f"{k}", draw.choice(["Car", "Car", "Pedestrian"])) for k in range(draw.randint(1, 3))),
        )
        for number in range(count)
    ]  # fmt: skip


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    folder = tmp_path_factory.mktemp("relations") / "d"
    made = labels(random.Random(3), 150)
    write_dataset(folder, iter([Recording("r", STREET.name, tuple(made))]), {STREET.name: STREET.features}, name="d")
    return open_dataset(folder)


@pytest.fixture(scope="module")
def mapped(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """The same with three maps that are alike."""
    folder = tmp_path_factory.mktemp("mapped") / "d"
    made = labels(random.Random(3), 150)
    maps = [f"map{number}" for number in range(3)]
    recordings = [
        Recording(f"r{name}", name, tuple(replace(each, recording=f"r{name}", map=name) for each in made[number::3]))
        for number, name in enumerate(maps)
    ]
    write_dataset(folder, iter(recordings), dict.fromkeys(maps, STREET.features), name="d")
    return open_dataset(folder)


@pytest.fixture(scope="module")
def named(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Three maps with the same elements, each of which goes by the name of another."""
    folder = tmp_path_factory.mktemp("named") / "d"
    made = labels(random.Random(5), 150)
    maps = {f"map{number}": called_otherwise(STREET.features, number) for number in range(3)}
    recordings = [
        Recording(f"r{name}", name, tuple(replace(each, recording=f"r{name}", map=name) for each in made[number::3]))
        for number, name in enumerate(maps)
    ]
    write_dataset(folder, iter(recordings), maps, name="d")
    return open_dataset(folder)


def verdicts(dataset: Dataset, text: str, options: MatchOptions, **how: bool) -> dict[str, str]:
    query = Query(dataset, Source("p.scenic", text), QueryOptions(options, **how))
    return {each.frame: type(each.verdict).__name__ for each in query.results()}


def check(dataset: Dataset, seed: int, asked_of: Callable[[random.Random], str] = question) -> int:
    """How many frames match; each way of asking says the same."""
    draw = random.Random(seed)
    text, options = asked_of(draw), MatchOptions(tolerance=draw.choice(TOLERANCES), timeout_s=5.0)
    try:
        scenario = prepare_scenario(compile_scenario(Source("p.scenic", text), STREET))
    except ScenarioError:
        return 0
    matcher = Matcher(scenario, options)
    asked = draw.sample([label.frame for label in dataset.labels()], 40) if seed % 4 else None
    right = {label.frame: matcher.match(label) for label in dataset.labels(asked)}
    for proofs in (False, True):
        found = verdicts(dataset, text, options, proofs=proofs)
        for frame, verdict in right.items():
            if isinstance(verdict, Match):
                assert found.get(frame) == "Match", (text, options.tolerance, frame, proofs)
            elif isinstance(verdict, NoMatch):
                assert frame not in found, (text, options.tolerance, frame, proofs, verdict)
    return sum(isinstance(each, Match) for each in right.values())


def test_something_may_be_meant_where_nothing_lies():
    scenario = compile_scenario(Source("p.scenic", HEAD + "other = new Car on ego.lane\n"), STREET)
    node = scenario.objects[1].properties["position"].value
    assert isinstance(node, PointIn)
    assert isinstance(node.region, Select)
    relations = MapRelations(RegionNames(STREET), 0)

    def condition(region: Select, *required: Node) -> str | None:
        look_up = relations.of_ego(region.index)
        assert look_up is not None
        return relations.in_region(region, look_up, relations.possible_elements(look_up, required), 0.25)

    assert condition(node.region) is not None
    somewhere = next(each for each in node.region.options if isinstance(each.value, PolygonSet))
    options = [each if isinstance(each.value, PolygonSet) else somewhere for each in node.region.options]
    region = replace(node.region, options=tuple(options))
    assert condition(region) is None
    # what is required of the element that is meant excludes it, of another one at the place it does not
    there = (*tuple(Constant(each is not options[-1]) for each in options[:-1]), Constant(False))
    assert condition(region, Select(region.index, there)) is not None
    assert isinstance(region.index, Select)
    another = Select(replace(region.index, index=Index((1.0,) * len(region.index.options))), there)
    assert condition(region, another) is None


@pytest.mark.parametrize("kind", ["lane", "laneGroup", "road", "intersection", "crossing", "laneSection"])
@pytest.mark.parametrize("said", ["ego._{0} is other._{0}", "other._{0} is ego.{0}", "not (ego._{0} is other._{0})"])
@pytest.mark.one_in(24)
@pytest.mark.slow
def test_the_same_element_may_be_none(dataset: Dataset, kind: str, said: str):
    text = f"{HEAD}other = new Car {ANY}\nrequire {said.format(kind)}\n"
    scenario = prepare_scenario(compile_scenario(Source("p.scenic", text), STREET))
    matcher = Matcher(scenario, MatchOptions())
    right = {each.frame for each in dataset.labels() if isinstance(matcher.match(each), Match)}
    for proofs in (False, True):
        assert set(verdicts(dataset, text, MatchOptions(), proofs=proofs)) == right


@pytest.mark.parametrize(
    "said",
    [
        "all([m.type is ManeuverType.RIGHT_TURN for m in ego.lane.maneuvers])",
        "any([m.type is ManeuverType.LEFT_TURN for m in ego.lane.maneuvers])",
        "len(ego.lane.maneuvers) > 1 and not any([m.type is ManeuverType.LEFT_TURN for m in ego.lane.maneuvers])",
        "all([m.type is ManeuverType.STRAIGHT for m in ego.lane.maneuvers]) and len(ego.lane.maneuvers) > 0",
    ],
)
@pytest.mark.one_in(4)
def test_one_of_the_elements_at_a_place_is_meant_throughout(dataset: Dataset, said: str):
    """Plain evaluation, for each of them."""
    scenario = prepare_scenario(compile_scenario(Source("p.scenic", f"{HEAD}require {said}\n"), STREET))
    conditions = tuple(each.condition for each in scenario.requirements if each.built_in is None)
    chosen = {leaf.identity: len(leaf.weights) for leaf in leaves(*conditions) if isinstance(leaf, Index)}
    matcher, several = Matcher(scenario, MatchOptions()), 0
    for label in dataset.labels():
        heading = label.ego.heading
        ego = {(0, "position"): (label.ego.x, label.ego.y), (0, "heading"): heading, (0, GOING): heading}
        ego[0, LAST_LANE] = label.ego.last_lane
        right = any(
            all(evaluate(each, dict(zip(chosen, map(float, ranks), strict=True)), ego) is True for each in conditions)
            for ranks in itertools.product(*map(range, chosen.values()))
        )
        assert isinstance(matcher.match(label), Match) is right, label.frame
        several += right
    assert 0 < several < 150


@pytest.mark.parametrize(
    "said",
    [
        "third = new Car in ego.lane, facing Range(-180, 180) deg\nrequire other.lane is ego.lane",
        f"third = new Car {ANY}\nrequire other.lane is ego.lane\nrequire third.lane is ego.lane",
    ],
)
def test_several_ask_for_one_element(tmp_path: Path, said: str):
    """Two lanes hold the ego, and one car each."""
    lanes = [lane for lane in STREET.lanes if lane.polygon.covers(Point(1.03, -6.57))]
    alone = [lane.polygon.difference(union_all([each.polygon for each in lanes if each is not lane])) for lane in lanes]
    spots = [part.representative_point() for part in alone if part.area > 0.5][:2]
    assert len(spots) == 2
    cars = tuple(LabelObject(f"{k}", "Car", "Car", spot.x, spot.y, 0.0, 2.0, 4.5) for k, spot in enumerate(spots))
    ego = LabelObject("ego", "Car", "Car", 1.03, -6.57, 0.0, 2.0, 4.5)
    made = Recording("r", STREET.name, (Label("0000", "r", 0, STREET.name, ego, cars),))
    write_dataset(tmp_path / "d", iter([made]), {STREET.name: STREET.features}, name="d")
    text = f"{HEAD}other = new Car {ANY}\n{said}\n"
    for proofs in (False, True):
        assert verdicts(open_dataset(tmp_path / "d"), text, MatchOptions(), proofs=proofs) == {}, proofs


def test_sql_says_what_the_matcher_says(dataset: Dataset, rounds):
    asked = [*range(rounds(32)), 27, 1306]
    assert sum(check(dataset, seed) for seed in asked) > len(asked)


def abstract(dataset: Dataset, text: str) -> bool:
    """Whether relations say all of the map that SQL asks for."""
    try:
        return isinstance(Query(dataset, Source("p.scenic", text)).planned_map("map0").network, AbstractNetwork)
    except ScenarioError:
        return False


def test_sql_over_any_map_says_what_the_matcher_says(
    mapped: Dataset, rounds: Callable[[int], int], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(run, "MAPS_KEPT", 1)
    seeds = (seed for seed in itertools.count() if abstract(mapped, question(random.Random(seed))))
    assert sum(check(mapped, seed) for seed in itertools.islice(seeds, rounds(24))) > 0


def test_sql_over_any_map_follows_the_links_of_each(
    named: Dataset, rounds: Callable[[int], int], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(run, "MAPS_KEPT", 1)
    seeds = (seed for seed in itertools.count() if abstract(named, linked_question(random.Random(seed))))
    found = [check(named, seed, linked_question) for seed in itertools.islice(seeds, rounds(60))]
    assert sum(found) > 0


def test_sql_over_any_map_follows_the_lists_of_each(
    named: Dataset, rounds: Callable[[int], int], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(run, "MAPS_KEPT", 1)
    seeds = (seed for seed in itertools.count() if abstract(named, listed_question(random.Random(seed))))
    found = [check(named, seed, listed_question) for seed in itertools.islice(seeds, rounds(60))]
    assert sum(found) > 0


@pytest.mark.parametrize(
    ("said", "known"),
    [
        ("other = new Car on ego.lane, facing Range(-9, 9) deg relative to ego.heading", True),
        ("other = new Car\nrequire other.lane is ego.lane", True),
        ("other = new Car\nrequire other.intersection is ego.intersection", True),
        ("other = new Pedestrian on ego.crossing, facing Range(-180, 180) deg", True),
        ("other = new Car on ego.lane.maneuvers[0].endLane", False),
        ("other = new Car\nrequire (distance from other to ego.lane) < 3", False),
        ("other = new Car on network.lanes[0]", False),
        ("other = new Car on ego.laneGroup", True),
        ("other = new Car on ego.laneSection.laneToLeft", True),
        ("other = new Car on ego.oppositeLaneGroup", True),
        ("other = new Car on ego.lane.group.opposite", True),
        ("other = new Car\nrequire other.road is ego.lane.road", True),
        ("other = new Car\nrequire other.lane is ego.laneSection.laneToLeft.lane", True),
        ("other = new Car\nrequire ego.laneSection._laneToLeft is None", True),
        ("other = new Car on ego.laneGroup.lanes[0]", False),
        ("other = new Car on Uniform(*ego.laneGroup.lanes)", True),
        ("other = new Car on Uniform(*ego.laneGroup.lanes, ego.lane)", False),
        ("other = new Car\nrequire other.lane in ego.lane.successors", True),
        ("other = new Car\nrequire len(ego.lane.successors) > 1", False),
        ("other = new Car\nrequire ego.lane.successors", False),
        ("other = new Car\nrequire max(*ego.laneGroup.lanes) is ego.lane", False),
        ("other = new Car\nrequire any(l is other.lane for l in ego.lane.successors)", False),
        ("other = new Car\nrequire other.lane in (ego.lane.successors + ego.lane.predecessors)", False),
        ("other = new Car in ego.lane.lanesAhead(30)", True),
        ("other = new Car in ego.lane.lanesAhead(300)", False),
        ("other = new Car on Uniform(*ego.lane.maneuvers).endLane", False),
        ("other = new Car on ego.lane.successor", False),
        ("other = new Car on ego.laneGroup.sidewalk", False),
        ("other = new Car on (ego.laneSection._laneToLeft or ego.lane)", True),
        ("other = new Car\nrequire ego.lane.uid == 'lane1'", False),
        ("other = new Car\nrequire ego.lane.orientation[ego.position] == other.lane.orientation[ego.position]", False),
    ],
)
def test_relations_say_all_of_the_map_that_some_programs_ask_for(
    mapped: Dataset, monkeypatch: pytest.MonkeyPatch, said: str, known: bool
):
    monkeypatch.setattr(run, "MAPS_KEPT", 1)
    assert abstract(mapped, f"model scenic.domains.driving.model\nego = new Car\n{said}\n") is known


@pytest.mark.slow
def test_sql_says_of_many_what_the_matcher_says(dataset: Dataset):
    assert sum(check(dataset, seed) for seed in (102, 164, *range(1000, 1060))) > 50
