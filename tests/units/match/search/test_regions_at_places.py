"""Cars on what lies at a hidden place: any element that holds the car, as far as the place may lie there."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from scenes import STREET, compiled, drawn, label_of
from shapely import Point, union_all

from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT
from scenicq.match.verdict import Match, NoMatch
from scenicq.store.labels import Label, LabelObject

HEADER = "model scenic.domains.driving.model\nego = new Car facing Range(-180, 180) deg\n"
ANYHOW = "facing Range(-180, 180) deg\n"
NEAR = 20.0


def label(ego, other):
    things = [LabelObject(name, "Car", "Car", x, y, 0.5, 2.0, 4.5) for name, (x, y) in (("ego", ego), ("other", other))]
    return Label("frame", "recording", 0, "street", things[0], tuple(things[1:]))


def inside(rng, area):
    west, south, east, north = area.bounds
    while True:
        place = rng.uniform(west, east), rng.uniform(south, north)
        if area.contains(Point(*place)):
            return place


@pytest.mark.slow
def test_a_car_on_the_lane_at_a_place_near_the_ego_is_on_a_lane_that_comes_near_the_ego(rounds):
    scenario = compiled(
        f"{HEADER}p = new Point on road\nlane = network.laneAt(p, reject=True)\nother = new Car on lane, {ANYHOW}"
        f"require (distance from ego to p) < {NEAR}\nrequire lane is not ego._lane\n",
        STREET,
    )
    matcher, rng, seen = Matcher(scenario, MatchOptions(tolerance=EXACT)), random.Random(1), []
    road, lanes = union_all([lane.polygon for lane in STREET.lanes]), STREET.lanes
    for _ in range(rounds(60)):
        ego = inside(rng, road)
        own = [lane for lane in lanes if lane.polygon.distance(Point(*ego)) < 0.05]
        if len(own) != 1:
            continue
        near = [lane for lane in lanes if lane.polygon.distance(Point(*ego)) < 1.5 * NEAR]
        other = inside(rng, rng.choice(near).polygon)
        holding = [lane for lane in lanes if lane is not own[0] and lane.polygon.distance(Point(*other)) < 1e-3]
        gaps = [lane.polygon.distance(Point(*ego)) for lane in holding]
        if any(abs(gap - NEAR) < 0.1 for gap in gaps):
            continue
        verdict = matcher.match(label(ego, other))
        assert isinstance(verdict, Match if any(gap < NEAR for gap in gaps) else NoMatch), (ego, other, verdict)
        seen.append(type(verdict))
    assert min(seen.count(Match), seen.count(NoMatch)) >= rounds(6)


@pytest.mark.parametrize("area", ["sidewalk", "shoulder"])
def test_what_lies_at_a_free_place_where_elements_overlap_is_decided_without_a_solver(area):
    scenario = compiled(f"{HEADER}p = new Point on {area}\nother = new Car on network.elementAt(p), {ANYHOW}", STREET)
    matcher, rng = Matcher(scenario, MatchOptions(tolerance=EXACT)), random.Random(2)
    elements = STREET.sidewalks if area == "sidewalk" else STREET.shoulders
    for element in rng.sample(list(elements), 3):
        assert isinstance(matcher.match(label((0.0, 0.0), inside(rng, element.polygon))), Match)
    assert isinstance(matcher.match(label((0.0, 0.0), (900.0, 900.0))), NoMatch)


def test_a_field_that_hangs_on_a_choice_is_decided_option_by_option():
    scenario = compiled(
        "model scenic.domains.driving.model\nroad = Uniform(*network.roads)\nlane = Uniform(*road.lanes)\n"
        "ego = new Car on lane.centerline\nspot = new OrientedPoint on lane.rightEdge\n"
        "other = new Car left of spot by 0.5, facing roadDirection\n",
        STREET,
    )
    matcher = Matcher(scenario)
    for seed in range(2):
        drawn_label = label_of(scenario, drawn(scenario, seed), random.Random(seed))
        assert isinstance(matcher.match(drawn_label), Match)
        (car,) = drawn_label.objects
        turned = replace(car, heading=car.heading + 1.0)
        assert isinstance(matcher.match(replace(drawn_label, objects=(turned,))), NoMatch)
