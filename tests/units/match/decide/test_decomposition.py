"""Groups decided part by part, over narrowed ranges: as the cascade decides them whole, and never a false no."""

from __future__ import annotations

import pytest
from conditioned_groups import groups
from programs import PROGRAMS

from scenicq.match.decide.cascade import decide
from scenicq.match.decide.decomposition import decide_decomposed
from scenicq.match.fields.constraint_network import ConstraintNetwork
from scenicq.match.fields.contractor import BoxSet
from scenicq.match.options import MatchOptions
from scenicq.match.problem.evaluation import replay
from scenicq.match.problem.outcome import Refuted, Satisfied, Undecided
from scenicq.match.tolerance import EXACT

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


@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.one_in(4)
def test_parts_lose_no_solution(name):
    tolerance = MatchOptions(tolerance=EXACT).tolerance
    for seed in range(3):
        for items, true in groups(TEXTS[name], seed):
            outcome = decide_decomposed(items, tolerance)
            whole = decide(items, tolerance)
            if true:
                assert not isinstance(outcome, Refuted)
                assert BoxSet.start(ConstraintNetwork(items, tolerance), {}).narrowed().size == 1
            if not isinstance(outcome, Undecided) and not isinstance(whole, Undecided):
                assert type(outcome) is type(whole)
            if isinstance(outcome, Satisfied):
                assert replay(items, outcome.values, tolerance, 1e-6)


def test_a_row_with_one_shift_is_decided_without_a_solver():
    for seed in range(3):
        outcomes = [
            decide_decomposed(items, MatchOptions(tolerance=EXACT).tolerance)
            for items, true in groups(ROW, seed)
            if true
        ]
        assert all(isinstance(outcome, Satisfied) for outcome in outcomes)
