"""Candidates that intervals alone exclude: never one of a drawn scene."""

from __future__ import annotations

import random

import pytest
from programs import HEADER, PROGRAMS
from scenes import compiled, drawn, label_of

from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.problem.candidates import find_candidates
from scenicq.match.search.arc_consistency import arc_consistent
from scenicq.match.search.group_plan import relevant_properties
from scenicq.match.tolerance import EXACT, Tolerance


@pytest.mark.parametrize("name", PROGRAMS)
def test_thinning_never_removes_a_right_candidate(name):
    scenario = compiled(HEADER + PROGRAMS[name])
    matcher = Matcher(scenario, MatchOptions(tolerance=EXACT))
    removed = 0
    for seed in range(8):
        label = label_of(scenario, drawn(scenario, seed), random.Random(seed), distractors=4)
        cast = find_candidates(scenario, label, 0, matcher.options, {})
        ((signature, candidates),) = cast.signatures(relevant_properties(scenario, matcher.options))
        wanted = {index: numbers for index, numbers in candidates.items() if index != scenario.ego}
        left, failed = arc_consistent(matcher.plans.plan(signature), wanted, cast, scenario.ego, Tolerance())
        assert failed is None
        for index, numbers in left.items():
            assert f"object-{index}" in [label.objects[number - 1].id for number in numbers]
            removed += len(wanted[index]) - len(numbers)
    if name in ("ahead", "left of", "row", "offset", "shared"):
        assert removed
