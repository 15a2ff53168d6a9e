"""What is rewritten for matching only: it matches what the map says, and scenes are drawn as the program says."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import pytest
import shapely

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.exporters.sample import sample_labels
from scenicq.forest.nodes import DirectionAt
from scenicq.forest.scenario import BuiltIn, Scenario
from scenicq.forest.simplify import roots_of
from scenicq.forest.walk import postorder
from scenicq.geometry.elements import NetworkElement
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.problem.preprocess import prepare_scenario
from scenicq.match.tolerance import EXACT
from scenicq.match.verdict import Match
from scenicq.store.labels import Label, LabelObject

from .scenes import network

HEADER = "model scenic.domains.driving.model\nego = new Car facing Range(-180, 180) deg\n"
AREAS = {
    "road": shapely.union_all([lane.polygon for lane in network().lanes]),
    "network.lanes[0]": network().lanes[0].polygon,
}
Layers = Sequence[Sequence[tuple[NetworkElement, NetworkElement | None]]]
"""Pairs of what lies at a point and what is found there; a later layer counts where the earlier ones have nothing."""


def compiled(text: str) -> Scenario:
    return compile_scenario(Source("test.scenic", HEADER + text), network())


def fields(scenario: Scenario) -> int:
    return sum(isinstance(node, DirectionAt) for node in postorder(roots_of(scenario)))


def label(x: float, y: float) -> Label:
    ego, other = (
        LabelObject(name, "Car", "Car", *place, 2.0, 4.5)
        for name, place in (("ego", (5.25, 20.0, 0.0)), ("other", (x, y, 1.0)))
    )
    return Label("frame", "recording", 0, "street", ego, (other,))


@cache
def layers(name: str) -> Layers:
    """What a look-up finds, said once more."""
    town = network()
    match name:
        case "laneAt":
            return [[(lane, lane) for lane in town.lanes]]
        case "roadAt":
            return [[(lane, lane.road) for lane in town.lanes], [(road, road) for road in town.allRoads]]
        case "laneGroupAt":
            return [[(lane, lane.group) for lane in town.lanes], [(group, group) for group in town.laneGroups]]
        case _:
            kinds = (town.intersections, town.roads, town.shoulders, town.sidewalks, town.crossings)
            return [[(each, each) for each in kind] for kind in kinds]


def at(name: str, point: shapely.Point) -> set[NetworkElement | None]:
    for layer in layers(name):
        found = {element for area, element in layer if area.polygon.distance(point) < 1e-6}
        if found:
            return found
    return set()


def somewhere_in(name: str, area: shapely.Geometry) -> set[NetworkElement]:
    """What is found at some point of an area: at many of them, and where borders cross its own."""
    rng, (west, south, east, north) = random.Random(name), area.bounds
    points = [shapely.Point(rng.uniform(west, east), rng.uniform(south, north)) for _ in range(1000)]
    borders = [each.polygon.boundary.intersection(area.boundary) for layer in layers(name) for each, _ in layer]
    points += [shapely.Point(*corner) for corner in shapely.get_coordinates(borders)]
    found = (at(name, point) for point in points if area.distance(point) < 1e-6)
    return {element for elements in found for element in elements if element is not None}


@pytest.mark.parametrize("area", AREAS)
@pytest.mark.parametrize("name", ["laneAt", "roadAt", "laneGroupAt", "elementAt"])
def test_an_element_at_a_free_point_is_any_that_some_point_of_its_area_has(name: str, area: str) -> None:
    scenario = compiled(f"p = new Point on {area}\nother = new Car on network.{name}(p), facing Range(-180, 180) deg\n")
    matcher, rng, seen = Matcher(scenario, MatchOptions(tolerance=EXACT)), random.Random(area), set[bool]()
    found = somewhere_in(name, AREAS[area])
    assert fields(scenario) > fields(matcher.scenario) == 0
    allowed = shapely.union_all([element.polygon for element in found])
    for _ in range(40):
        x, y = rng.uniform(-12, 12), rng.uniform(-60, 60)
        if allowed.boundary.distance(shapely.Point(x, y)) < 0.01:
            continue
        inside = bool(allowed.contains(shapely.Point(x, y)))
        assert isinstance(matcher.match(label(x, y)), Match) == inside, (x, y)
        seen.add(inside)
    assert seen == {True, False}


def test_a_point_that_something_else_depends_on_stays() -> None:
    scenario = compiled(
        "p = new Point on road\nother = new Car on network.laneAt(p), facing Range(-180, 180) deg\n"
        "require (distance from ego to p) < 20\n"
    )
    assert fields(prepare_scenario(scenario)) == fields(scenario) > 0


def unevenness(scenario: Scenario, first: shapely.Geometry) -> float:
    """The chi-square statistic of how often one of two lanes is picked."""
    number = 300
    labels = sample_labels(scenario, number, 3, frozenset(BuiltIn))
    hits = sum(bool(first.contains(shapely.Point(each.objects[0].x, each.objects[0].y))) for each in labels)
    return 4 * (hits - number / 2) ** 2 / number


def test_lanes_are_drawn_one_as_likely_as_the_other_also_when_made_ready() -> None:
    lanes = network().lanes
    areas = [lane.polygon.area for lane in lanes]
    large, small = (areas.index(end) for end in (max(areas), min(areas)))
    scenario = compiled(f"other = new Object on Uniform(network.lanes[{large}], network.lanes[{small}]), facing 1\n")
    exceeded_once_in_a_thousand = 10.83
    assert unevenness(scenario, lanes[large].polygon) < exceeded_once_in_a_thousand
    matched = Matcher(scenario).scenario
    assert list(sample_labels(matched, 5, 3)) == list(sample_labels(scenario, 5, 3))
    # what is matched itself has the right outcomes only
    assert unevenness(replace(matched, as_written=None), lanes[large].polygon) > exceeded_once_in_a_thousand


def test_a_scenario_is_made_ready_once() -> None:
    scenario = prepare_scenario(compiled("other = new Object on Uniform(*network.lanes)\n"))
    assert prepare_scenario(scenario) is scenario
    assert Matcher(scenario).scenario is scenario
