"""Conditions over time that hang on a hidden point: what the first frame says of it decides them."""

from __future__ import annotations

import itertools
import math

import pytest

from scenicq.errors import Source
from scenicq.forest.nodes import Node, Norm
from scenicq.forest.walk import postorder
from scenicq.match.verdict import Match, NoMatch, Unknown
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset
from scenicq.temporal import hidden_examples
from scenicq.temporal.interval_options import IntervalOptions

PROGRAM = """model scenic.domains.driving.model
spot = new Point on road
ego = new Car
other = new Car at spot offset by (Range(-2, 2), 0)
require 5 < (distance to other) < 30
terminate when (distance to spot) > 40
"""
TOLERANCE = 0.25


@pytest.fixture(scope="module")
def found(crossroads):
    options = QueryOptions(solver="portable", every=True)
    return list(Query(open_dataset(crossroads), Source("a/folder/program.scenic", PROGRAM), options).results())


def farthest(dataset, result):
    """How far the point may be from the ego, at each sample of an interval: the least and the greatest distance."""
    frames = {label.frame: label for label in dataset.labels()}
    mine = [label for label in frames.values() if label.recording == result.recording]
    mine = sorted((each for each in mine if each.timestamp_us >= result.timestamp_us), key=lambda e: e.timestamp_us)
    roles = result.verdict.partial if isinstance(result.verdict, NoMatch) else result.verdict.correspondence
    other = next(each for each in mine[0].objects if roles["other"] in (each.track, each.id))
    spots = [(other.x - n / 10, other.y) for n in range(-20, 21)]
    spans = []
    for label in mine[: result.interval.count]:
        away = [math.dist((label.ego.x, label.ego.y), spot) for spot in spots]
        spans.append((min(away) - TOLERANCE, max(away) + TOLERANCE))
    return mine, spans


@pytest.mark.slow
def test_nothing_is_left_unknown_and_both_verdicts_are_there(found):
    assert {type(each.verdict) for each in found} == {Match, NoMatch}


@pytest.mark.slow
def test_a_match_is_proven_by_its_point(found, crossroads):
    dataset = open_dataset(crossroads)
    for each in found:
        if isinstance(each.verdict, Match):
            mine, _ = farthest(dataset, each)
            spot = each.verdict.witness["program.scenic:2:18"]
            away = [math.dist((label.ego.x, label.ego.y), spot) for label in mine[: each.interval.count]]
            assert away[-1] > 40
            assert max(away[:-1]) <= 40


@pytest.mark.slow
def test_every_end_that_some_point_makes_is_found(crossroads):
    dataset = open_dataset(crossroads)
    options = QueryOptions(solver="portable", time=IntervalOptions(intervals="all"))
    results = list(Query(dataset, Source("program.scenic", PROGRAM), options).results())
    ends: dict[tuple[str, str], set[int]] = {}
    for each in results:
        ends.setdefault((each.frame, each.verdict.correspondence["other"]), set()).add(each.interval.count)
    assert max(map(len, ends.values())) > 1
    labels = sorted(dataset.labels(), key=lambda label: (label.recording, label.timestamp_us))
    for each in results:
        place = next(n for n, label in enumerate(labels) if label.frame == each.frame)
        roles = each.verdict.correspondence
        other = next(thing for thing in labels[place].objects if roles["other"] in (thing.track, thing.id))
        longer = [label for label in labels[place:] if label.recording == each.recording]
        possible = set[int]()
        for offset, aside, along in itertools.product(range(-20, 21), (-0.2, 0.0, 0.2), (-0.1, 0.0, 0.1)):
            spot = other.x - offset / 10 + along, other.y + aside
            away = [math.dist((a.ego.x, a.ego.y), spot) for a in longer]
            possible |= {next(n for n, far in enumerate(away, 1) if far > 40)} if max(away) > 40 else set()
        assert ends[each.frame, roles["other"]] >= possible, each.frame


@pytest.mark.slow
def test_what_is_cut_off_has_no_point_that_ends_it(found, crossroads):
    dataset = open_dataset(crossroads)
    cut = [each for each in found if isinstance(each.verdict, NoMatch)]
    assert cut
    for each in cut:
        assert each.verdict.cause.what == "recording-ends"
        _, spans = farthest(dataset, each)
        assert all(least <= 40 + TOLERANCE for least, _ in spans)


NESTED = """model scenic.domains.driving.model
road = Uniform(*network.roads)
lane = Uniform(*road.lanes)
spot = new OrientedPoint in lane.centerline
ego = new Car at spot
terminate when (distance to spot) > 15 and (distance to lane) < 100
"""


@pytest.mark.slow
def test_choices_that_share_a_place_have_values_of_their_own(crossroads):
    dataset = open_dataset(crossroads)
    options = QueryOptions(solver="portable", every=True)
    results = list(Query(dataset, Source("program.scenic", NESTED), options).results())
    matches = [each for each in results if isinstance(each.verdict, Match)]
    assert matches
    assert not [each for each in results if isinstance(each.verdict, Unknown)]
    for each in matches:
        mine = [label for label in dataset.labels() if label.recording == each.recording]
        mine = sorted(
            (label for label in mine if label.timestamp_us >= each.timestamp_us), key=lambda e: e.timestamp_us
        )
        spot = each.verdict.witness["program.scenic:4:26"]
        away = [math.dist((label.ego.x, label.ego.y), spot) for label in mine[: each.interval.count]]
        assert away[0] <= TOLERANCE
        assert away[-1] > 15 >= max(away[:-1])


FOLLOWED = """model scenic.domains.driving.model
lane = Uniform(*network.lanes)
spot = new OrientedPoint on lane.centerline
ego = new Car following roadDirection from spot for Range(-30, -5)
other = new Car at spot
terminate when (distance to spot) > 40
"""


@pytest.mark.slow
def test_bounds_of_the_point_answer_for_samples_side_by_side(crossroads, monkeypatch):
    """The matcher is asked for them, and hardly ever for one sample and its likes."""
    asked: list[Node] = []
    examine = hidden_examples.InitialScene.examine

    def counted(initial, start, wanted):
        if wanted is not None:
            asked.append(wanted)
        return examine(initial, start, wanted)

    monkeypatch.setattr(hidden_examples.InitialScene, "examine", counted)
    options = QueryOptions(solver="portable", every=True)
    results = list(Query(open_dataset(crossroads), Source("program.scenic", FOLLOWED), options).results())
    assert not [each for each in results if isinstance(each.verdict, Unknown)]
    assert [each for each in results if isinstance(each.verdict, Match)]
    of_samples = [each for each in asked if any(isinstance(node, Norm) for node in postorder((each,)))]
    assert len(of_samples) < len(asked) / 10
