"""First fit: the same verdict, correspondence, witness and cause as by the search."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from programs import HEADER, PROGRAMS
from scenes import compiled, drawn, label_of

from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.search.backtracking import SilentReporter
from scenicq.match.search.first_fit import FirstFit
from scenicq.match.verdict import Match

ROWS = """
ego = new Car on road
front = ego
for number in range(4):
    if number % 2 == 0:
        front = new Car ahead of front by Normal(3, 0.5)
    else:
        new Bicycle right of front by Normal(1.5, 0.25)
"""
CROWD = """
ego = new Car on road
for number in range(4):
    new Pedestrian offset by (Range(-5, 5), Range(3, 103)), facing Range(-120, 120) deg relative to ego.heading
"""
CASES = {**PROGRAMS, "rows": ROWS, "crowd": CROWD}
BY_THEMSELVES = ("ahead", "offset", "left of", "facing field", "normal", "rows", "crowd")
"""Programs of which every drawn scene is decided without a search."""


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("radius", [None, 30.0])
@pytest.mark.one_in(12)
def test_a_search_finds_the_same(name, radius, monkeypatch):
    scenario = compiled(HEADER + CASES[name])
    matcher = Matcher(scenario, MatchOptions(radius=radius))
    filled = []
    fill = FirstFit.fill

    def counted(*args):
        batches = list(fill(*args))
        filled.append(len(batches))
        return iter(batches)

    matched = 0
    for seed in range(4):
        rng = random.Random(seed)
        label = label_of(scenario, drawn(scenario, seed), rng, distractors=seed)
        moved = tuple(replace(each, x=each.x + rng.choice([0.0, 4.0])) for each in label.objects)
        for each in (label, replace(label, objects=moved), replace(label, objects=label.objects[1:])):
            given = {scenario.objects[-1].name: each.objects[0].id} if each.objects and seed % 2 else {}
            with monkeypatch.context() as patched:
                patched.setattr(FirstFit, "fill", counted)
                found = matcher.match(each, fixed_roles=given)
            with monkeypatch.context() as patched:
                patched.setattr(FirstFit, "fill", lambda *_: iter(()))
                assert found == matcher.match(each, fixed_roles=given)
            assert found == matcher.match(each, SilentReporter(), fixed_roles=given)
            matched += isinstance(found, Match)
        if name in BY_THEMSELVES and radius is None:
            with monkeypatch.context() as patched:
                patched.setattr(FirstFit, "fill", counted)
                assert isinstance(matcher.match(label), Match)
            assert filled[-1] == 1
    assert matched or radius
