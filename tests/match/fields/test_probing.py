"""Witnesses that are found by trial, and labels that no trial may let pass."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from hidden_roads import BEND, BENDS, ON_BEND
from scenes import compiled, drawn, label_of

from scenicq.match.fields import field_solver
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT
from scenicq.match.verdict import Match, NoMatch

AHEAD = (
    "lane = Uniform(*network.lanes)\nstart = new OrientedPoint on lane.centerline\n"
    "new Car following roadDirection from start for Range(5, 25)"
)


@pytest.fixture
def found(monkeypatch):
    """What trials gave."""
    answers = []

    def noted(start, tolerance):
        answers.append(probed(start, tolerance))
        return answers[-1]

    probed = field_solver.probed
    monkeypatch.setattr(field_solver, "probed", noted)
    return answers


def test_a_spot_on_a_centreline_is_found_by_trial(found):
    scenario = compiled(ON_BEND + AHEAD, BEND)
    matcher = Matcher(scenario, MatchOptions())
    for seed in range(4):
        label = label_of(scenario, drawn(scenario, seed), random.Random(seed))
        assert isinstance(matcher.match(label), Match)
    assert any(found), "most witnesses are found so"


@pytest.mark.parametrize("name", BENDS)
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
    monkeypatch.setattr(field_solver, "probed", lambda start, tolerance: None)
    assert trying == [type(Matcher(scenario, options).match(label)) for label in labels]
    assert {Match, NoMatch} <= set(trying)
