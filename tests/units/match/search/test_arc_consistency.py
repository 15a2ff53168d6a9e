"""Candidates that intervals alone exclude: never one of a drawn scene."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from programs import HEADER, PROGRAMS
from scenes import compiled, drawn, label_of

from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.problem.candidates import prepare_label
from scenicq.match.problem.constraints import relevant_properties
from scenicq.match.search.arc_consistency import arc_consistent
from scenicq.match.tolerance import EXACT, Tolerance
from scenicq.store.labels import Label, LabelObject


@pytest.mark.parametrize("name", PROGRAMS)
@pytest.mark.one_in(3)
def test_thinning_never_removes_a_right_candidate(name):
    scenario = compiled(HEADER + PROGRAMS[name])
    matcher = Matcher(scenario, MatchOptions(tolerance=EXACT))
    removed = 0
    for seed in range(8):
        label = label_of(scenario, drawn(scenario, seed), random.Random(seed), distractors=4)
        cast = prepare_label(scenario, label, 0, matcher.options, {})
        ((signature, candidates),) = cast.signatures(relevant_properties(scenario, matcher.options))
        wanted = {index: numbers for index, numbers in candidates.items() if index != scenario.ego}
        left, failed = arc_consistent(matcher.plans.plan(signature), wanted, cast, scenario.ego, Tolerance())
        assert failed is None
        for index, numbers in left.items():
            assert f"object-{index}" in [label.objects[number - 1].id for number in numbers]
            removed += len(wanted[index]) - len(numbers)
    if name in ("ahead", "left of", "row", "offset", "shared"):
        assert removed


def test_thinning_looks_along_the_ego():
    """On a slant: what lies off the line is inside of the box of all that lies on it."""
    text = "ego = new Car\nother = new Car ahead of ego by Range(0, 20)\nthird = new Car\n"
    scenario = compiled(f"{HEADER}{text}require (distance from other to third) < 40")
    matcher = Matcher(scenario, MatchOptions(tolerance=EXACT))
    car = LabelObject("ego", "Car", "car", 1.75, 50.0, -0.785398, 2.0, 4.5)
    # the middle of a car ahead is half a length of both away
    on, off = replace(car, id="on", x=11.75, y=60.0), replace(car, id="off", x=14.75, y=53.0)
    third = replace(car, id="third", x=20.0, y=60.0, heading=0.0)
    label = Label("frame", "recording", 0, "street", car, (on, off, third))
    cast = prepare_label(scenario, label, 0, matcher.options, {})
    ((signature, candidates),) = cast.signatures(relevant_properties(scenario, matcher.options))
    wanted = {index: numbers for index, numbers in candidates.items() if index != scenario.ego}
    left, _ = arc_consistent(matcher.plans.plan(signature), wanted, cast, scenario.ego, Tolerance())
    (role,) = [owner.index for owner in scenario.objects if owner.name == "other"]
    assert left[role] == (1,)
