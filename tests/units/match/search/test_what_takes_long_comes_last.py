"""What is cheap is decided first: another group, another candidate or another outcome may make the rest needless."""

import math
import random
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from conditioned_groups import groups
from hidden_roads import CHAIN
from scenes import STREET, compiled, drawn, label_of
from shapely import LineString

from scenicq.geometry.features import MapFeature
from scenicq.geometry.network import Network
from scenicq.match.decide.decomposition import decide_decomposed, search_decomposed
from scenicq.match.fields import field_solver, heading_propagation, witness_search
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.problem.outcome import Patience, Search
from scenicq.match.search import choice_search
from scenicq.match.tolerance import EXACT, parse_tolerance
from scenicq.match.verdict import Match, NoMatch
from scenicq.store.labels import Label, LabelObject

TOLERANCE = parse_tolerance("position=0.05,heading=0.5deg")
FOLLOWERS = """model scenic.domains.driving.model
spot = new OrientedPoint on road
ego = new Car following roadDirection from spot for Range(5, 15)
lead = new Car following roadDirection from spot for Range(20, 35)
"""


@cache
def junction() -> Network:
    """Eight ways over one place: ahead and around a corner, from either side of each of two streets."""
    features: list[MapFeature] = []
    corner = [(20 - 20 * math.cos(a), -20 + 20 * math.sin(a)) for a in np.linspace(0, math.pi / 2, 16).tolist()]
    ways = [[(0.0, -40.0), *corner, (40.0, 0.0)], [(-40.0, 0.0), (40.0, 0.0)]]
    for quarter in range(4):
        cosine, sine = round(math.cos(quarter * math.pi / 2)), round(math.sin(quarter * math.pi / 2))
        for number, way in enumerate(ways):
            line = [(x * cosine - y * sine, x * sine + y * cosine) for x, y in way]
            name, area = f"{quarter}{number}", LineString(line).buffer(3.0, cap_style="flat")
            features += [
                MapFeature(f"road{name}", "road", area, {"forward": f"group{name}"}),
                MapFeature(f"group{name}", "lane_group", area, {"road": f"road{name}"}),
                MapFeature(
                    f"lane{name}", "lane", area,
                    {"road": f"road{name}", "group": f"group{name}", "centerline": [line]},
                ),
            ]  # fmt: skip
    return Network("junction", features)


@pytest.fixture
def cases(monkeypatch):
    """How many cases were looked at of which way fields point."""
    seen = [0]
    propagated = heading_propagation.propagate

    def counted(some):
        seen[0] += some.size
        return propagated(some)

    monkeypatch.setattr(heading_propagation, "propagate", counted)
    return seen


def label(seed: int):
    scenario = compiled(FOLLOWERS, junction())
    return label_of(scenario, drawn(scenario, seed), random.Random(seed))


@pytest.fixture
def matcher():
    return Matcher(compiled(FOLLOWERS, junction()), MatchOptions(tolerance=TOLERANCE, timeout_s=20))


@pytest.mark.slow
def test_where_ways_cross_two_followers_of_one_hidden_point_are_found_by_luck(matcher, cases):
    for seed in (2, 4, 5):
        assert isinstance(matcher.match(label(seed)), Match)
    assert cases[0] < 2000, "most ways are never looked at"


@pytest.mark.slow
def test_what_another_group_excludes_is_not_gone_into(matcher, cases):
    seen = label(2)
    (lead,) = seen.objects
    assert isinstance(matcher.match(replace(seen, objects=(replace(lead, heading=lead.heading + 0.1),))), NoMatch)
    assert cases[0] < 1500, "the heading alone excludes it"


@pytest.mark.slow
def test_more_patience_goes_on_where_less_has_stopped(cases, monkeypatch):
    monkeypatch.setattr(field_solver, "find_witness", lambda *_, **__: None)
    several = 0
    for seed in range(3):
        for items, _ in groups(CHAIN.format(cars=2), seed):
            cases[0] = 0
            outcome = decide_decomposed(items, TOLERANCE)
            whole, cases[0] = cases[0], 0
            search = Search(search_decomposed(items, TOLERANCE))
            found = [search.within(patience) for patience in Patience]
            assert type(found[-1]) is type(outcome)
            assert cases[0] == whole, "nothing is looked at twice"
            several += found[0] is None
    assert several


def test_what_two_groups_ask_of_the_same_objects_is_looked_for_once(monkeypatch):
    """A second car hangs on the first; the ways of the first are those for any candidate of the second."""
    asked = []

    class Noted(heading_propagation.DirectedCases):
        def __init__(self, start, soon):
            ranges = tuple((key, value.tobytes()) for key, value in start.ranges.items())
            asked.append((tuple((constraint, seen) for constraint, _, seen in start.network.items), ranges))
            super().__init__(start, soon)

    monkeypatch.setattr(field_solver, "DirectedCases", Noted)
    monkeypatch.setattr(field_solver, "find_witness", lambda *_, **__: None)
    scenario = compiled("model scenic.domains.driving.model\n" + CHAIN.format(cars=2), STREET)
    most = 0
    for seed in range(3):
        asked.clear()
        label = label_of(scenario, drawn(scenario, seed), random.Random(seed), distractors=2)
        assert isinstance(Matcher(scenario, MatchOptions(tolerance=EXACT, timeout_s=60)).match(label), Match)
        assert len(set(asked)) == len(asked)
        most = max(most, len(asked))
    assert most > 2


@pytest.mark.slow
def test_unlikely_values_are_looked_at_last(monkeypatch):
    asked = []
    search = field_solver.search_directions
    monkeypatch.setattr(field_solver, "search_directions", lambda *a, **k: asked.append(a) or search(*a, **k))
    text = "model scenic.domains.driving.model\nego = new Car at (0, -35), facing 0 deg\n"
    text += "other = new Car following roadDirection from ego for Normal(16.5, 2.7)\n"
    matcher = Matcher(compiled(text, junction()), MatchOptions(tolerance=TOLERANCE, timeout_s=20))
    ego = LabelObject("ego", "Car", "car", 0.0, -35.0, 0.0, 2.0, 4.5)
    aside = LabelObject("aside", "Car", "car", 1.0, -25.0, 0.0, 2.0, 4.5)
    found = LabelObject("found", "Car", "car", 0.0, -19.0, 0.0, 2.0, 4.5)
    for objects in ((aside, found), (found, aside)):
        verdict = matcher.match(Label("f", "r", 0, "junction", ego, objects))
        assert isinstance(verdict, Match)
        assert verdict.correspondence["other"] == "found"
    assert len(asked) < 30, "the way of one that is aside is not looked for over hundreds of metres"


def test_directions_at_known_places_are_no_matter_of_trial(monkeypatch):
    """Which of several ways that overlap is meant is then decided outcome by outcome, each in no time."""

    def unwanted(*_, **__):
        raise AssertionError("a search")

    monkeypatch.setattr(choice_search, "_SEVERAL", 2)
    monkeypatch.setattr(witness_search, "search_witness", unwanted)
    scenario = compiled("model scenic.domains.driving.model\nego = new Car on Uniform(*network.lanes)\n", junction())
    matcher = Matcher(scenario, MatchOptions(tolerance=TOLERANCE))
    for heading, kind in ((0.0, Match), (-math.pi / 2, Match), (0.4, NoMatch)):
        label = Label("f", "r", 0, "junction", LabelObject("ego", "Car", "", 0.5, 0.5, heading), ())
        assert isinstance(matcher.match(label), kind)
    hidden = "spot = new OrientedPoint on Uniform(*network.lanes)\nego = new Car at spot offset by (0, Range(2, 9))\n"
    with pytest.raises(AssertionError, match="a search"):
        Matcher(
            compiled("model scenic.domains.driving.model\n" + hidden, junction()), MatchOptions(tolerance=TOLERANCE)
        ).match(Label("f", "r", 0, "junction", LabelObject("ego", "Car", "", 0.5, 0.5, 0.0), ()))
