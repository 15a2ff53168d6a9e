"""Hidden places on a bend of many short segments: their directions follow from one another, few have to be tried."""

from __future__ import annotations

import math
import random
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hidden_roads import AREA, BEND, BENDS, ON_BEND
from scenes import compiled, drawn, label_of
from shapely import Point

from scenicq.match.fields import field_solver, heading_propagation
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT
from scenicq.match.verdict import Match, NoMatch

FEW = 5000
"""Cases for six labels: each has four steps or more over some ten directions, ten thousand combinations at least."""


@pytest.fixture
def cases(monkeypatch):
    """How many cases are narrowed; no witness is found by trial before."""
    counts = []
    monkeypatch.setattr(field_solver, "find_witness", lambda *_, **__: None)

    def counted(some):
        counts.append(some.size)
        return propagated(some)

    propagated = heading_propagation.propagate
    monkeypatch.setattr(heading_propagation, "propagate", counted)
    return counts


@pytest.mark.parametrize("name", BENDS)
@pytest.mark.one_in(2)
def test_a_bend_is_followed_without_a_solver_and_without_all_combinations(name, cases):
    scenario = compiled(ON_BEND + BENDS[name], BEND)
    matcher = Matcher(scenario, MatchOptions(tolerance=EXACT))
    for seed in range(2):
        label = label_of(scenario, drawn(scenario, seed), random.Random(seed))
        (car,) = label.objects
        assert isinstance(matcher.match(label), Match)
        # no chain of this length leads out of the lane by more than it bends away
        away = replace(car, x=car.x * 2.0, y=car.y * 2.0)
        assert isinstance(matcher.match(replace(label, objects=(away,))), NoMatch)
        turned = replace(car, heading=car.heading + 1.5)
        assert isinstance(matcher.match(replace(label, objects=(turned,))), NoMatch)
    assert 0 < sum(cases) < FEW


@pytest.mark.slow
def test_a_place_matches_where_walking_back_leads_to_a_spot_on_the_road(rounds):
    scenario = compiled(ON_BEND + BENDS["a known way"], BEND)
    matcher, field = Matcher(scenario, MatchOptions(tolerance=EXACT)), BEND.roadDirection
    base = label_of(scenario, drawn(scenario, 0), random.Random(0))
    rng, seen = np.random.default_rng(4), Counter()
    for _ in range(rounds(40)):
        angle, radius = rng.uniform(0.9, 4.4), rng.uniform(17.0, 25.5)
        x, y = radius * math.cos(angle), radius * math.sin(angle)
        # where the tolerance may tell, at the ends of the road's width and where two segments meet, both will do
        reached = {starts_on_road(x + dx, y + dy) for dx in (-0.002, 0, 0.002) for dy in (-0.002, 0, 0.002)}
        if len(reached) == 1:
            car = replace(base.objects[0], x=x, y=y, heading=field.values(x, y)[0])
            verdict = matcher.match(replace(base, objects=(car,)))
            assert isinstance(verdict, Match if reached == {True} else NoMatch), (x, y)
            seen[type(verdict)] += 1
    assert min(seen[Match], seen[NoMatch]) > rounds(4) - 1


def starts_on_road(x, y):
    """Whether some spot on the road leads to a point by four steps of 3 m along the field."""
    places = np.array([(x, y)])
    headings = np.unique(BEND.followedDirection.headings(np.array([(-30.0, -30.0, 30.0, 30.0)]))[1])
    for field in (*[BEND.followedDirection] * 3, BEND.roadDirection):
        back = 3.0 * np.stack([np.sin(headings), -np.cos(headings)], axis=1)
        places = (places[:, None] + back[None]).reshape(-1, 2)
        wanted = np.tile(headings, len(places) // len(headings)).tolist()
        found = field.values_many(places)
        fits = [any(abs(one - heading) < 1e-8 for one in values) for values, heading in zip(found, wanted, strict=True)]
        places = places[np.array(fits)]
        if not len(places):
            return False
    return any(AREA.covers(Point(*place)) for place in places)
