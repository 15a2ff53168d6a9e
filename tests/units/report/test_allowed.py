"""What is drawn as allowed is what the scenario allows: it holds every scene drawn from the program, and no more."""

import math
import random
from dataclasses import replace

import numpy as np
import pytest
import shapely

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.exporters.sample import sample_labels
from scenicq.geometry.default_street import street
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT
from scenicq.match.verdict import Match
from scenicq.report.backdrop import Backdrop
from scenicq.report.picture import Shot, draw

from .reading import Drawn

HEADER = "model scenic.domains.driving.model\nego = new Car on road\n"
ANY = ", facing Range(-180, 180) deg"
L_SHAPE = "PolygonalRegion([(-40, -40), (40, -40), (40, -20), (-10, -20), (-10, 40), (-40, 40)])"
FREE = {
    "band": f"other = new Car ahead of ego by Range(4, 10){ANY}",
    "box": f"other = new Car offset by (Range(-8, -2), Range(5, 15)){ANY}",
    "not convex": f"other = new Pedestrian in {L_SHAPE}{ANY}",
    "with a hole": f"other = new Pedestrian in CircularRegion(ego, 18).difference(CircularRegion(ego, 9)){ANY}",
    "in pieces": f"other = new Pedestrian offset by (Uniform(-9, 9), Range(3, 12)){ANY}",
    "sector": f"other = new Pedestrian in SectorRegion(ego, 25, ego.heading, 70 deg){ANY}",
    "wide sector": f"other = new Pedestrian in SectorRegion(ego, 25, ego.heading, 290 deg){ANY}",
    "map": f"other = new Pedestrian in crossing{ANY}",
    "rows": f"first = new Car ahead of ego by Range(4, 10){ANY}\nother = new Car left of ego by Range(1, 5){ANY}",
}
"""The position of `other` depends on nothing but the ego, and nothing else is asked of it."""
BOUND = {
    "visible": "ego = new Car on road, with viewAngle 120 deg, with visibleDistance 30\n"
    f"other = new Car on visible road{ANY}",
    "behind": "ego = new Car on road, with viewAngle 300 deg\nother = new Pedestrian in visible road",
    "beyond": "bike = new Bicycle ahead of ego by 5\nother = new Pedestrian beyond bike by Range(2, 8)",
    "turned": "other = new Car ahead of ego by Range(3, 12), facing Range(150, 210) deg relative to ego.heading",
    "with the road": "other = new Car on road, facing Range(-5, 20) deg relative to roadDirection",
    "either way": "other = new Car ahead of ego by 6, facing Uniform(-1, 1) * Range(60, 80) deg",
}
PIXEL_M = 0.06
WHOLE = 400.0
"""Metres from the ego within which the whole map lies."""
SCENES = 4


@pytest.fixture(scope="module")
def world():
    network = street()
    return network, Backdrop(network)


def _scenes(world, program, seed=7):
    """A matcher, and labels that scenes of the program give."""
    network, _ = world
    scenario = compile_scenario(Source("allowed.scenic", HEADER + program + "\n"), network)
    return Matcher(scenario, MatchOptions(tolerance=EXACT)), list(sample_labels(scenario, SCENES, seed))


def _drawn(world, matcher, label):
    verdict = matcher.match(label)
    assert isinstance(verdict, Match), verdict
    shot = Shot(label, matcher.scenario, verdict)
    return shot, Drawn(draw(shot, world[1], half=WHOLE))


@pytest.mark.parametrize("name", [*FREE, *BOUND])
@pytest.mark.one_in(3)
def test_the_drawn_area_holds_every_object(world, name):
    matcher, labels = _scenes(world, (FREE | BOUND)[name])
    for label in labels:
        shot, drawn = _drawn(world, matcher, label)
        other = next(role for role in shot.roles if role.name == "other")
        for role in shot.roles:
            for path in drawn.with_class("place", role.colour):
                assert drawn.area(path).distance(shapely.Point(role.member.x, role.member.y)) < PIXEL_M, role.name
        assert drawn.with_class("place", other.colour)


@pytest.mark.parametrize("name", list(BOUND))
@pytest.mark.one_in(2)
def test_the_drawn_wedges_hold_the_heading(world, name):
    matcher, labels = _scenes(world, BOUND[name])
    wedges = 0
    for label in labels:
        shot, drawn = _drawn(world, matcher, label)
        for role in shot.roles:
            found = drawn.with_class("facing", role.colour)
            if found:
                thing = role.member
                tip = shapely.Point(thing.x - math.sin(thing.heading), thing.y + math.cos(thing.heading))
                lines = (shapely.union_all([*map(shapely.LineString, drawn.pieces(path))]) for path in found)
                reach = shapely.union_all([*map(drawn.area, found), *lines])
                assert reach.distance(tip) < PIXEL_M, role.name
                wedges += 1
    assert wedges


@pytest.mark.parametrize("name", list(FREE))
@pytest.mark.one_in(3)
def test_the_drawn_area_is_exactly_what_matches(world, name):
    """Moved anywhere inside, `other` still matches; moved outside, it does not."""
    matcher, labels = _scenes(world, FREE[name])
    rng = random.Random(3)
    inside = outside = 0
    for label in labels[:2]:
        shot, drawn = _drawn(world, matcher, label)
        other = next(role for role in shot.roles if role.name == "other")
        area = shapely.union_all([drawn.area(path) for path in drawn.with_class("place", other.colour)])
        for _ in range(40):
            west, south, east, north = rng.choice(shapely.get_parts(area).tolist()).buffer(2).bounds
            x, y = rng.uniform(west, east), rng.uniform(south, north)
            away = area.boundary.distance(shapely.Point(x, y))
            if away < 2 * PIXEL_M or (name in ("band", "rows", "in pieces") and away < 0.3):
                continue
            holds = area.covers(shapely.Point(x, y))
            moved = [replace(thing, x=x, y=y) if thing.id == "other" else thing for thing in label.objects]
            verdict = matcher.match(replace(label, objects=tuple(moved)))
            assert isinstance(verdict, Match) == holds, (x, y, verdict)
            inside, outside = inside + holds, outside + (not holds)
    assert outside > 5
    # what is only a line on the map is drawn with a width, inside of which nothing else matches
    assert inside > 5 or name in ("band", "rows", "in pieces")


def test_hidden_points_of_a_witness_are_crosses(world):
    program = (
        "spot = new OrientedPoint on curb\n"
        "parked = new Car left of spot by 0.5, facing Uniform(-1, 1) * Range(10, 20) deg relative to roadDirection"
    )
    matcher, labels = _scenes(world, program)
    crosses = 0
    for label in labels:
        shot, drawn = _drawn(world, matcher, label)
        own = [(role.member.x, role.member.y) for role in shot.roles]
        hidden = [
            value
            for value in shot.verdict.witness.values()
            if isinstance(value, tuple) and all(math.dist(value, at) > 0.05 for at in own)
        ]
        ego = shot.label.ego
        wanted = sorted(v for v in hidden if max(abs(v[0] - ego.x), abs(v[1] - ego.y)) < WHOLE)
        middles = []
        for path in drawn.with_class("hidden-point"):
            x, y = (int(number) + 60 for number in path.get("d")[1:].partition("l")[0].split())
            middles.append(tuple(np.array((x, y)) / (100.0, -100.0) + drawn.origin))
        assert np.allclose(sorted(middles), wanted, atol=PIXEL_M) if wanted else not middles
        crosses += len(wanted)
    assert crosses
