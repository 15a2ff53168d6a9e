"""Headings that nothing bounds, at hidden points: their direction is pinned as the label observes it."""

from __future__ import annotations

import random

import pytest
from scenes import compiled, drawn, label_of

from scenicq.match.fields import field_solver
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import Tolerance
from scenicq.match.verdict import NoMatch

EGO = "model scenic.domains.driving.model\nego = new Car\n"
SPOT = "spot = new OrientedPoint at (2, Range(-20, 20)), facing Range(-59, 46) deg relative to roadDirection\n"
BEHIND = "new Car behind spot by Range(2, 14), facing {} relative to spot, with regionContainedIn None"


@pytest.mark.parametrize("heading", ["Normal(46, 21) deg", "Normal(0, 1)", "Normal(Range(0, 1), 2)"])
@pytest.mark.one_in(3)
def test_a_heading_without_bounds_is_no_error(heading, monkeypatch):
    monkeypatch.setattr(field_solver, "find_witness", lambda *_, **__: None)
    scenario = compiled(EGO + SPOT + BEHIND.format(heading))
    matcher = Matcher(scenario, MatchOptions(tolerance=Tolerance(position=0.05, heading=0.01), timeout_s=3))
    for seed in range(2):
        label = label_of(scenario, drawn(scenario, seed), random.Random(seed))
        assert not isinstance(matcher.match(label), NoMatch)
