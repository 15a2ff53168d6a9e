"""Hidden points that are drawn by going backwards from what is observed: most of them lead there."""

from __future__ import annotations

import random

import numpy as np
import pytest
from hidden_roads import BEND, BENDS, ON_BEND
from scenes import compiled, drawn, label_of

from scenicq.forest.column_domain import ColumnDomain
from scenicq.match.fields import field_solver, witness_search
from scenicq.match.fields.trials import TrialSpace
from scenicq.match.fields.witness_search import QUICK, find_witness
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import parse_tolerance

TIGHT = parse_tolerance("position=0.05,heading=0.5deg")
FOLLOWERS = (
    "new Car following roadDirection from spot for Range(5, 15)\n"
    "new Car following roadDirection from spot for Range(20, 35)"
)
TWO = (
    "model scenic.domains.driving.model\nspot = new OrientedPoint on road\n"
    "ego = new Car following roadDirection from spot for Range(5, 15)\n"
    "new Car following roadDirection from spot for Range(20, 35)"
)
BACK = {
    **BENDS,
    "aside": "new Car right of spot by 0.4, facing Range(16, 37) deg relative to spot.heading",
    "two followers": FOLLOWERS,
}
"""Programs in which a hidden point follows from where a car is observed."""


class Begun(Exception):
    """A search begins: what comes after it does not matter here."""


def spaces(text, monkeypatch, labels, before=ON_BEND):
    """What draws are made of, for some labels of a program."""
    found = []

    def begun(start, *_, **__):
        found.append(TrialSpace(start))
        raise Begun

    with monkeypatch.context() as patched:
        patched.setattr(field_solver, "find_witness", begun)
        patched.setattr(witness_search, "find_witness", begun)
        scenario = compiled(before + text, BEND)
        matcher = Matcher(scenario, MatchOptions(tolerance=TIGHT))
        for seed in range(labels):
            with pytest.raises(Begun):
                matcher.match(label_of(scenario, drawn(scenario, seed), random.Random(seed)))
    return found


@pytest.mark.parametrize("name", BACK)
@pytest.mark.one_in(3)
def test_points_drawn_backwards_lead_to_what_is_observed(name, monkeypatch):
    count, most = 60, 0
    for space in spaces(BACK[name], monkeypatch, 2):
        assert space.ways_back
        for way in space.ways_back:
            search = witness_search._Search(space, QUICK, (), witness_search.trials_left(), 0)
            draws = search._evenly(count)
            ways = way.followed(space, draws, np.random.default_rng(1), 4 * count)
            if not len(ways.draw):
                continue  # another way leads there
            begun = draws.take(ways.draw)
            begun.places[space.hidden[way.leaf.identity].rows] = ways.place.T
            begun.shares[:] = ways.shares
            x, y = space.values(space._steps, begun)[id(way.end)].data
            # a point beside the region is moved into it
            there = np.hypot(x - way.seen[0], y - way.seen[1]) < 1e-6
            most = max(most, len(np.unique(ways.draw[there])))
    assert most >= count / 2


def test_pairs_of_ways_begin_close_to_each_other_and_are_taken_in_turn(monkeypatch):
    apart = []
    for space in spaces(TWO, monkeypatch, 2, before=""):
        search = witness_search._Search(space, QUICK, (), witness_search.trials_left(), 0)
        (pair,) = [part for part in search.back._parts if hasattr(part, "other")]
        draws, found = search._evenly(40), []
        for some in (np.arange(0, 40, 2), np.arange(1, 40, 2)):
            pair.put_into(draws, some)
            known = space.values(space._steps, draws.take(some))
            ends = [(known[id(way.end)].data, way.seen) for way in (pair.one, pair.other)]
            found.append([np.hypot(place[0] - seen[0], place[1] - seen[1]) for place, seen in ends])
        (first, off), (_, later) = found
        apart.append((np.median(off), np.median(later), np.count_nonzero(first < 1e-6)))
    off, later, led = min(apart)
    assert led >= 10, "the first way leads where it should"
    assert off < 1.0, "the other one nearly"
    assert off <= later, "the closest are taken first"


@pytest.mark.slow
def test_two_followers_of_one_hidden_point_are_mostly_found_at_once(monkeypatch):
    found = []

    def noted(*given, **more):
        found.append(find_witness(*given, **more))
        raise Begun

    monkeypatch.setattr(witness_search, "find_witness", noted)
    scenario = compiled(TWO, BEND)
    matcher = Matcher(scenario, MatchOptions(tolerance=TIGHT))
    for seed in range(4):
        with pytest.raises(Begun):
            matcher.match(label_of(scenario, drawn(scenario, seed), random.Random(seed)))
    assert sum(map(bool, found)) > 1, "two of eight are found from draws that lie anywhere"


def test_where_fields_are_known_to_point_they_are_not_asked(monkeypatch):
    (space,) = spaces(FOLLOWERS, monkeypatch, 1)
    search = witness_search._Search(space, QUICK, (), witness_search.trials_left(), 0)
    tried = space.run(search._anywhere(20))

    def asked(*_):
        raise AssertionError("a field is asked")

    monkeypatch.setattr(ColumnDomain, "_direction", asked)
    again = space.run(tried.draws, tried.headings)
    assert np.allclose(again.residuals.each, tried.residuals.each, equal_nan=True)
    assert np.allclose(again.headings, tried.headings, equal_nan=True)
