"""Following a field over a random distance: the number of steps is that of the distance which is drawn."""

from __future__ import annotations

import math
import random
from functools import cache

import numpy as np
import pytest
from drawing import draw_scene
from shapely import LineString

from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenarioError, Source
from scenicq.forest.scenario import Scenario
from scenicq.geometry.features import MapFeature
from scenicq.geometry.network import Network
from scenicq.match.matcher import Matcher
from scenicq.match.verdict import Match, NoMatch
from scenicq.store.labels import Label, LabelObject

RADIUS = 30.0
START = (20.0, 0.0)
"""Inside the bend, where one segment of the centreline is nearest."""


@cache
def bend() -> Network:
    """One lane on most of a circle around the origin, counter-clockwise."""
    line = [(RADIUS * math.cos(angle), RADIUS * math.sin(angle)) for angle in np.linspace(-0.5, 4.5, 24).tolist()]
    area = LineString(line).buffer(12.0, cap_style="flat")
    features = [
        MapFeature("road", "road", area, {"forward": "group"}),
        MapFeature("group", "lane_group", area, {"road": "road"}),
        MapFeature("lane", "lane", area, {"road": "road", "group": "group", "centerline": [line]}),
    ]
    return Network("bend", features)


def end(distance: float, steps: int) -> tuple[float, float, float]:
    """Where Euler's method gets from `START`, and the direction there."""
    x, y = START
    for _ in range(steps):
        heading = bend().roadDirection.values(x, y)[0]
        x, y = x - math.sin(heading) * distance / steps, y + math.cos(heading) * distance / steps
    return x, y, bend().roadDirection.values(x, y)[0]


def steps_of(distance: float) -> int:
    """As Scenic counts them."""
    return max(4, math.ceil(distance / 5.0))


def program(distance: str, version: int = 3) -> Scenario:
    text = (
        f"model scenic.domains.driving.model\nego = new Car at ({START[0]}, {START[1]}), facing 0 deg\n"
        f"base = Range(0, 15)\nway = {distance}\nparam drawn = way\n"
        "other = new Car following roadDirection for way, with requireVisible False\n"
    )
    if version == 1:
        text = f"ego = Car at {START[0]} @ {START[1]}, facing 0 deg\n"
        text += f"Car following roadDirection for {distance}, with requireVisible False\n"
    return compile_scenario(Source("test.scenic", text), bend(), version=version)


def label(distance: float, steps: int) -> Label:
    x, y, heading = end(distance, steps)
    ego = LabelObject("ego", "Car", "Car", *START, 0.0, 2.0, 4.5)
    return Label("frame", "recording", 0, "bend", ego, (LabelObject("other", "Car", "Car", x, y, heading, 2.0, 4.5),))


DISTANCES: dict[str, tuple[float, ...]] = {
    "Range(10, 40)": (19.0, 39.0),
    "base * 2 + 10": (10.0, 38.0),
    "Range(8, 12) + base": (9.0, 26.0),
    "Uniform(12, 27, 38)": (12.0, 27.0, 38.0),
    "TruncatedNormal(25, 5, 10, 40)": (11.0, 31.0),
    "Range(-20, -5)": (-19.0, -6.0),
    "38": (38.0,),
}
"""Distances, and some that may be drawn."""


@pytest.mark.parametrize("distance", DISTANCES)
def test_each_distance_matches_with_its_own_number_of_steps(distance: str) -> None:
    matcher = Matcher(program(distance))
    for drawn in DISTANCES[distance]:
        assert isinstance(matcher.match(label(drawn, steps_of(drawn))), Match), drawn


@pytest.mark.parametrize("distance", ["base * 2 + 10"])
@pytest.mark.slow
def test_another_number_of_steps_does_not_match(distance: str) -> None:
    matcher = Matcher(program(distance))
    for steps in (4, 9):
        assert isinstance(matcher.match(label(36.0, steps)), NoMatch), steps


@pytest.mark.parametrize("distance", ["Range(10, 40)", "base * 2 + 10", "Range(8, 12) + base"])
def test_scenes_are_drawn_with_the_number_of_steps_of_their_distance(distance: str) -> None:
    scenario, seen = program(distance), set[int]()
    for seed in range(6):
        scene = draw_scene(scenario, random.Random(seed))
        assert scene is not None
        drawn = scene.params["drawn"]
        assert isinstance(drawn, float)
        assert scene.values[1, "position"] == pytest.approx(end(drawn, steps_of(drawn))[:2], abs=1e-6)
        seen.add(steps_of(drawn))
    assert len(seen) > 1


def test_the_first_version_always_takes_four_steps() -> None:
    matcher = Matcher(program("(30, 40)", 1))
    assert isinstance(matcher.match(label(36.0, 4)), Match)
    assert isinstance(matcher.match(label(36.0, 8)), NoMatch)


def test_a_way_beyond_the_budget_is_refused() -> None:
    with pytest.raises(ScenarioError) as refusal:
        program("Range(10, 600)")
    assert refusal.value.diagnostics[0].code == "budget-exceeded"


@pytest.mark.parametrize("distance", ["Normal(1000, 20)", "abs(Normal(-1000, 20))", "Normal(Range(1, 9), 100)"])
def test_a_distance_that_is_likely_too_long_is_refused(distance: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        program(distance)
    assert refused.value.diagnostics[0].code == "budget-exceeded"


@pytest.mark.slow
def test_a_distance_that_is_hardly_ever_too_long_is_followed() -> None:
    assert isinstance(Matcher(program("Normal(20, 5)")).match(label(31.0, steps_of(31.0))), Match)
