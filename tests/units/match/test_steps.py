"""A step of matching decides more, or the same sooner: what is decided without it is decided so with it."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "tools/bench"))
from programs import HEADER, PROGRAMS
from scenes import compiled
from steps import CHAINS, STEPS, TOLERANCE, examples

from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, NoMatch, Unknown

SOME = {name: PROGRAMS[name] for name in ("shared", "discrete", "row", "crowd", "visible road", "follow")} | {
    name: CHAINS[name] for name in ("near a junction", "right edge", "platoon, one shift")
}


@pytest.fixture(scope="module")
def decided():
    """Programs with labels and what is decided of them by all steps."""
    found = []
    for text in SOME.values():
        scenario = compiled(HEADER + text)
        labels = list(examples(scenario, 1))
        found.append((scenario, labels, verdicts(scenario, labels, timeout_s=60.0)))  # decided on a busy machine, too
    return found


def verdicts(scenario, labels, timeout_s):
    matcher = Matcher(scenario, MatchOptions(tolerance=TOLERANCE, timeout_s=timeout_s))
    return [type(matcher.match(label)) for label in labels]


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.one_in(16)
def test_nothing_is_decided_otherwise_without_a_step(step, decided):
    for scenario, labels, known in decided:
        with ExitStack() as stack:
            STEPS[step](stack)
            without = verdicts(scenario, labels, timeout_s=0.5)
        for expected, found in zip(known, without, strict=True):
            assert found in (expected, Unknown), scenario.source.text


def test_labels_are_decided_both_ways_by_all_steps(decided):
    assert {each for _, _, known in decided for each in known} == {Match, NoMatch}
