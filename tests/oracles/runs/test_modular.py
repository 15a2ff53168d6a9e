"""Programs made of scenarios against their definition: random ones, on samples with random conditions."""

from __future__ import annotations

import random

import numpy as np
import pytest
from compiled_processes import compiled, numbers_of
from modular_definition import ATOMS, all_ends, random_program, text_of

from scenicq.temporal.run_lanes import follow_runs
from scenicq.temporal.run_machine import RunMachine
from scenicq.temporal.stretches import Timeline
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN

N = 8


@pytest.mark.parametrize("seed", range(300))
@pytest.mark.one_in(12)
def test_scenarios_run_as_scenic_runs_them(seed: int) -> None:
    draw = random.Random(seed)
    dynamics = None
    while dynamics is None:
        program = random_program(draw)
        text = text_of(program)
        dynamics = compiled(text)
    numbers, machine = numbers_of(dynamics), RunMachine(dynamics)
    for _ in range(4):
        times = [float(each) for each in np.cumsum([draw.choice([0.1, 0.1, 0.2]) for _ in range(N)])]
        rows = [[draw.random() < 0.6 for _ in range(ATOMS)] for _ in range(N)]
        columns = {
            atom: np.array([TRUE if row[number] else FALSE for row in rows], np.int8)
            for atom, number in numbers.items()
        }
        runs = follow_runs(
            machine, Timeline(np.array([0, N]), np.array(times), np.arange(N)),
            lambda atom, columns=columns: columns[atom.number].copy(),
        )  # fmt: skip
        for start in range(N):
            mine = runs.some(np.flatnonzero(runs.owner == start))
            assert not mine.undecided.any()
            assert (mine.truth != UNKNOWN).all(), (text, start)
            sure = {int(end) for end, truth in zip(mine.ends, mine.truth, strict=True) if truth == TRUE}
            ways = all_ends(program, rows, times, start)
            if ways is None:
                continue
            expected = {
                end
                for ends, over in ways
                for end in ([max(ends)] if ends and (over or not dynamics.terminates) else [])
            }
            assert sure == expected, (text, rows, start)
