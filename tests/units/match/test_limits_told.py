"""A frame that a limit leaves unknown says which limit it was."""

from __future__ import annotations

import random

import pytest
from programs import HEADER, PROGRAMS
from scenes import compiled, drawn, label_of

from scenicq.limits import LIMITS, limit_exceeded
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.search.outcome_tables import tree_of
from scenicq.match.tolerance import EXACT
from scenicq.match.verdict import Unknown

ALTERNATIVES = (
    "gap = Range(0, 20)\nwide = Range(0, 4)\nego = new Car\nother = new Car offset by (wide, gap + 5)\n"
    "require (gap > 5 and (gap < 7 or wide > 2)) or (gap < 2 and (wide < 1 or wide > 3))"
)
LEFT = {
    "signatures": PROGRAMS["picked lane"], "choice_tries": PROGRAMS["picked lane"],
    "nested_outcomes": PROGRAMS["picked lane"], "choice_nesting": ALTERNATIVES,
    "cascade_programs": PROGRAMS["shared"], "cascade_nesting": "n = DiscreteRange(1, 3)\nego = new Car\n"
    "other = new Car offset by (Range(-1, 1) * n, 5 * n), facing Range(-1, 1) * n deg",
}  # fmt: skip


@pytest.mark.parametrize("limit", LEFT)
def test_a_frame_that_a_limit_leaves_unknown_says_which(limit: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = compiled(HEADER + LEFT[limit])
    label = label_of(scenario, drawn(scenario, 1), random.Random(1))
    tree_of.cache_clear()
    monkeypatch.setattr(LIMITS, limit, 0)
    monkeypatch.setattr(LIMITS, "witness_trials", 0)
    verdict = Matcher(scenario, MatchOptions(tolerance=EXACT)).match(label)
    assert isinstance(verdict, Unknown)
    # where boxes are what decides then, these get too small or too many
    told = [(error.reason, error.detail) for error in map(limit_exceeded, (limit, "heading_width", "pruned_boxes"))]
    assert (verdict.reason, verdict.cause.detail) in told
