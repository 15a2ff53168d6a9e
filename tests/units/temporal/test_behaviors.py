"""Behaviors against their definition: random ones, on samples with random conditions."""

from __future__ import annotations

import random

import numpy as np
import pytest
from behaviors_definition import ATOMS, N, completions, matching_ends, random_program, text_of, ways
from compiled_processes import compiled, numbers_of

from scenicq.temporal.run_lanes import follow_runs
from scenicq.temporal.run_machine import RunMachine
from scenicq.temporal.stretches import Timeline
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN


@pytest.mark.parametrize("seed", range(150))
@pytest.mark.one_in(12)
def test_behaviors_do_what_scenic_does(seed: int) -> None:
    draw = random.Random(seed)
    dynamics = None
    while dynamics is None:
        program = random_program(draw)
        text = text_of(program)
        dynamics = compiled(text)
    numbers, machine = numbers_of(dynamics), RunMachine(dynamics)
    for _ in range(6):
        times = [float(each) for each in np.cumsum([draw.choice([0.1, 0.1, 0.2]) for _ in range(N)])]
        rows = [[int(draw.choice([FALSE, TRUE])) for _ in range(ATOMS)] for _ in range(N)]
        for _ in range(draw.choice([0, 0, 1, 4])):
            rows[draw.randrange(N)][draw.randrange(ATOMS)] = int(UNKNOWN)
        columns = {atom: np.array([row[number] for row in rows], np.int8) for atom, number in numbers.items()}
        timeline = Timeline(np.array([0, N]), np.array(times), np.arange(N))
        runs = follow_runs(machine, timeline, lambda atom, columns=columns: columns[atom.number].copy())
        for start in range(N):
            mine = runs.some(np.flatnonzero(runs.owner == start))
            assert not mine.undecided.any()
            sure = {int(end) for end, truth in zip(mine.ends, mine.truth, strict=True) if truth == TRUE}
            expected = [
                matching_ends(ways(program, times, trace, start), start, terminates=dynamics.terminates)
                for trace in completions(rows)
            ]
            if len(expected) == 1:
                assert sure == expected[0], (text, start)
                assert set(mine.truth.tolist()) <= {TRUE, FALSE}
            elif not machine.chooses and dynamics.terminates:
                # one end in every case, or none
                assert (sure == expected[0]) if len(set(map(frozenset, expected))) == 1 else not sure, (text, start)
            for end in sure:
                assert all(any(e >= end for e in each) for each in expected), (text, start)
            if (mine.truth == FALSE).all():
                assert not any(expected), (text, start)
