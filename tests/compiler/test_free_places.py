"""What is rewritten for matching only: it matches what the map says, and what scenes are drawn from stays as it is."""

from __future__ import annotations

import random

import pytest
import shapely

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.forest.improvise import Improviser
from scenicq.forest.nodes import DirectionAt
from scenicq.forest.scenario import Scenario
from scenicq.forest.simplify import roots_of
from scenicq.forest.walk import postorder
from scenicq.match.matcher import Matcher
from scenicq.match.verdict import Match
from scenicq.store.labels import Label, LabelObject

from .scenes import network

HEADER = "model scenic.domains.driving.model\nego = new Car facing Range(-180, 180) deg\n"
LANE = "other = new Car on network.laneAt(p), facing Range(-180, 180) deg\n"


def compiled(text: str, *, drawn: bool = False) -> Scenario:
    return compile_scenario(Source("test.scenic", HEADER + text), network(), drawn=drawn)


def fields(scenario: Scenario) -> int:
    return sum(isinstance(node, DirectionAt) for node in postorder(roots_of(scenario)))


def label(x: float, y: float) -> Label:
    ego, other = (
        LabelObject(name, "Car", "Car", *place, 2.0, 4.5)
        for name, place in (("ego", (5.25, 20.0, 0.0)), ("other", (x, y, 1.0)))
    )
    return Label("frame", "recording", 0, "street", ego, (other,))


@pytest.mark.parametrize("area", ["road", "network.lanes[0]"])
def test_an_element_at_a_free_point_is_any_that_some_point_of_its_area_has(area: str) -> None:
    scenario = compiled(f"p = new Point on {area}\n{LANE}")
    assert fields(scenario) == 0
    lanes = network().lanes
    start = shapely.union_all([lane.polygon for lane in lanes]) if area == "road" else lanes[0].polygon
    allowed = shapely.union_all([lane.polygon for lane in lanes if lane.polygon.intersects(start)])
    matcher, rng, seen = Matcher(scenario), random.Random(area), set[bool]()
    for _ in range(30):
        x, y = rng.uniform(-12, 12), rng.uniform(-60, 60)
        if allowed.boundary.distance(shapely.Point(x, y)) < 0.01:
            continue
        inside = bool(allowed.contains(shapely.Point(x, y)))
        assert isinstance(matcher.match(label(x, y)), Match) == inside, (x, y)
        seen.add(inside)
    assert seen == {True, False}


def test_a_point_that_something_else_depends_on_stays() -> None:
    text = f"p = new Point on road\n{LANE}require (distance from ego to p) < 20\n"
    assert fields(compiled(text)) == fields(compiled(text, drawn=True)) > 0


def test_a_picked_lane_keeps_its_probability() -> None:
    lanes = network().lanes
    sizes = [lane.polygon.area for lane in lanes]
    smallest = lanes[sizes.index(min(sizes))].polygon
    drawn = compiled("other = new Object on Uniform(*network.lanes)\n", drawn=True)
    improviser, rng, hits = Improviser(drawn, frozenset()), random.Random(3), 0
    for _ in range(400):
        scene = improviser.draw(rng, 1000)
        assert scene is not None
        hits += bool(smallest.contains(shapely.Point(scene.values[1, "position"])))
    assert hits > 0.6 * 400 / len(lanes)
    assert smallest.area / sum(sizes) < 0.3 / len(lanes)
