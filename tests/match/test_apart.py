"""Groups decided part by part, over narrowed ranges: as the ladder decides them whole, and never a false no."""

from __future__ import annotations

import random

import pytest
from programs import HEADER, PROGRAMS
from scenes import STREET, compiled, drawn, label_of

from scenicq.match.apart import decide_apart
from scenicq.match.attempt import Attempt
from scenicq.match.branches import Branches
from scenicq.match.casting import cast_roles
from scenicq.match.ground import replay
from scenicq.match.ladder import Maybe, No, Yes, decide
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tape import Tape

ROW = """
shift = Range(-0.5, 0.5)
ego = new Car
last = ego
for i in range(3):
    last = new Car at (front of last) offset by (shift, Range(4, 9)), facing Range(-5, 5) deg relative to roadDirection
"""
FOLLOWING = """
ego = new Car
shift = Range(-0.5, 0.5)
spot = new OrientedPoint following roadDirection from ego for Range(5, 12)
other = new Car right of spot by shift
third = new Car ahead of other by 2 + shift
"""
TEXTS = {**PROGRAMS, "a row with one shift": ROW, "following": FOLLOWING}


def groups(text, seed):
    """The groups of a program conditioned on a label drawn from it, for the true roles and for others."""
    scenario = compiled(HEADER + text, STREET)
    rng = random.Random(seed)
    label = label_of(scenario, drawn(scenario, seed), rng, distractors=2)
    options = MatchOptions()
    cast = cast_roles(scenario, label, 0, options, {})
    matcher = Matcher(scenario, options)
    attempt = Attempt(scenario, options, cast, matcher.ask)
    found = {thing.id: number for number, thing in enumerate((label.ego, *label.objects))}
    right = {
        thing.index: 0 if thing.index == scenario.ego else found[f"object-{thing.index}"] for thing in scenario.objects
    }
    for signature, candidates in cast.signatures(matcher._relevant):
        wrong = {index: rng.choice(numbers) for index, numbers in candidates.items()}
        for each in matcher.plan(signature).groups:
            for assignment, true in ((right, True), (wrong | {scenario.ego: 0}, False)):
                yield attempt.items(each.group, assignment), true
                for part in each.parts:
                    yield attempt.items(part.group, assignment), true


@pytest.mark.parametrize("name", TEXTS)
def test_parts_and_narrower_ranges_lose_no_solution(name):
    tolerance = MatchOptions().tolerance
    for seed in range(3):
        for items, true in groups(TEXTS[name], seed):
            outcome = decide_apart(items, tolerance)
            whole = decide(items, tolerance)
            if true:
                assert not isinstance(outcome, No)
                assert Branches.start(Tape(items, tolerance), {}).narrowed().size == 1
            if not isinstance(outcome, Maybe) and not isinstance(whole, Maybe):
                assert type(outcome) is type(whole)
            if isinstance(outcome, Yes):
                assert replay(items, outcome.values, tolerance, 1e-6)


def test_a_row_with_one_shift_is_decided_without_a_solver():
    for seed in range(3):
        outcomes = [decide_apart(items, MatchOptions().tolerance) for items, true in groups(ROW, seed) if true]
        assert all(isinstance(outcome, Yes) for outcome in outcomes)
