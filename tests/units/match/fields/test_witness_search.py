"""Witnesses that are found by trial, and labels that no trial may let pass."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from hidden_roads import BEND, BENDS, ON_BEND
from scenes import compiled, drawn, label_of

from scenicq.match.fields import field_solver, heading_propagation, witness_search
from scenicq.match.fields.witness_search import QUICK, THOROUGH
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT, Tolerance
from scenicq.match.verdict import Match, NoMatch

AHEAD = (
    "lane = Uniform(*network.lanes)\nstart = new OrientedPoint on lane.centerline\n"
    "new Car following roadDirection from start for Range(5, 25)"
)


@pytest.fixture
def found(monkeypatch):
    """What trials gave."""
    answers = []

    def noted(start, effort=QUICK, seed=0):
        answers.append(search(start, effort, seed=seed))
        return answers[-1]

    search = field_solver.find_witness
    monkeypatch.setattr(field_solver, "find_witness", noted)
    monkeypatch.setattr(witness_search, "search_witness", lambda *_, **__: None)
    return answers


def test_a_spot_on_a_centreline_is_found_by_trial(found):
    scenario = compiled(ON_BEND + AHEAD, BEND)
    matcher = Matcher(scenario, MatchOptions())
    for seed in range(4):
        label = label_of(scenario, drawn(scenario, seed), random.Random(seed))
        assert isinstance(matcher.match(label), Match)
    assert any(found), "most witnesses are found so"


class Tried(Exception):
    """A trial is over: what comes after it does not matter here."""


ON_LINES = {
    "ahead": (AHEAD, Tolerance(), 15),
    "whole steps": ("new Car following roadDirection from spot for DiscreteRange(5, 15)", Tolerance(), 14),
    "edges": (
        AHEAD.replace("lane.centerline", "lane.centerline.union(lane.leftEdge)"), Tolerance(x=0.4, y=0.3), 13,
    ),
    "a known way": (BENDS["a known way"], Tolerance(x=0.4, y=0.3), 17),
    "facing as there": (BENDS["facing as there"], Tolerance(), 13),
    "two ways": (BENDS["two ways"], EXACT, 7),
}  # fmt: skip
"""Programs with a tolerance, and of how many of twenty labels trial finds a witness."""


@pytest.mark.parametrize("name", ON_LINES)
@pytest.mark.one_in(8)
def test_trial_finds_most_witnesses(name, monkeypatch):
    text, tolerance, expected = ON_LINES[name]
    answers = []

    def noted(search):
        def first(*given):
            answers.append(search(*given))
            raise Tried

        return first

    # over all outcomes of choices where there are some, else within the one that is left
    monkeypatch.setattr(witness_search, "search_witness", noted(witness_search.search_witness))
    monkeypatch.setattr(field_solver, "find_witness", noted(field_solver.find_witness))
    scenario = compiled(ON_BEND + text, BEND)
    matcher = Matcher(scenario, MatchOptions(tolerance=tolerance))
    for seed in range(20):
        with pytest.raises(Tried):
            matcher.match(label_of(scenario, drawn(scenario, seed), random.Random(seed)))
    # what is drawn is the same each time, but for how a machine rounds
    assert sum(map(bool, answers)) >= expected - 1


@pytest.mark.parametrize("name", BENDS)
@pytest.mark.one_in(4)
def test_with_and_without_trials_the_verdict_is_the_same(name, monkeypatch):
    scenario = compiled(ON_BEND + BENDS[name], BEND)
    labels = []
    for seed in range(2):
        label = label_of(scenario, drawn(scenario, seed), random.Random(seed))
        (car,) = label.objects
        moved = replace(car, x=car.x * 1.2, y=car.y * 1.2)
        labels += [
            label,
            replace(label, objects=(moved,)),
            replace(label, objects=(replace(car, heading=car.heading + 1),)),
        ]
    options = MatchOptions(tolerance=EXACT)
    trying = [type(Matcher(scenario, options).match(label)) for label in labels]
    monkeypatch.setattr(field_solver, "find_witness", lambda *_, **__: None)
    monkeypatch.setattr(witness_search, "search_witness", lambda *_, **__: None)
    assert trying == [type(Matcher(scenario, options).match(label)) for label in labels]
    assert {Match, NoMatch} <= set(trying)


def test_where_ways_are_many_more_draws_find_what_few_have_missed(monkeypatch):
    scenario = compiled(ON_BEND + AHEAD, BEND)
    matcher = Matcher(scenario, MatchOptions())
    search, propagated = field_solver.find_witness, heading_propagation.propagate
    efforts, cases = [], []
    useful = [False, True]

    def noted(start, effort=QUICK, seed=0):
        efforts[-1].append(effort)
        return search(start, effort, seed=seed) if effort is THOROUGH and useful[len(cases) - 1] else None

    def counted(some):
        cases[-1] += some.size
        return propagated(some)

    monkeypatch.setattr(field_solver, "find_witness", noted)
    monkeypatch.setattr(witness_search, "search_witness", lambda *_, **__: None)
    monkeypatch.setattr(heading_propagation, "propagate", counted)
    label = label_of(scenario, drawn(scenario, 1), random.Random(1))
    for _ in useful:
        cases.append(0)
        efforts.append([])
        assert isinstance(matcher.match(label), Match)
    assert efforts[1] == [QUICK, QUICK, THOROUGH], "more draws are made where cases were many"
    assert efforts[0].count(THOROUGH) <= 4, "and again where they are four times as many"
    assert 4 * cases[1] < cases[0], "a witness ends the search"
