"""Intervals against brute force from the definition, with gaps, hidden variables, monitors and termination."""

import itertools
import random
from pathlib import Path

import pytest
from interval_definition import Program, Trace, bindings, matches, random_program, random_trace, recording_of
from interval_queries import found_by_query

from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions

D_VALUES = [-3 + number / 4 for number in range(25)]
"""Every value of D that makes a difference: positions are whole numbers."""
COMPLETIONS = 6


def truth_of(trace: Trace, binding, d, completion):
    """The value of atoms in a completion: a dictionary that is filled as unknown ones are met, by a generator."""
    memo = {}

    def truth(condition, k):
        key = id(condition), k
        if key not in memo:
            value = condition.value((trace, binding, d), k)
            memo[key] = completion.random() < 0.5 if value is None else value
        return memo[key]

    return truth


def ends_of(program: Program, trace: Trace, binding, completion_seed):
    """For each start the ends that some value of D allows, in one completion for each value."""
    found = {}
    for d in D_VALUES if program.hidden else [0.0]:
        truth = truth_of(trace, binding, d, random.Random(completion_seed))
        for i, j in matches(program, trace, binding, truth):
            found.setdefault(i, set()).add(j)
    return found


def longest(trace: Trace, spans):
    """Of overlapping intervals the longest, the earliest of equals, one after the other."""
    left, kept = set(spans), []
    while left:
        best = max(left, key=lambda span: (round(trace[span[1]].time - trace[span[0]].time, 6), -span[0]))
        kept.append(best)
        left = {span for span in left if span[1] < best[0] or best[1] < span[0]}
    return sorted(kept)


def check_whole(folder: Path, traces: dict[str, Trace], program: Program) -> int:
    """Where everything is observed, the intervals are those of the definition."""
    expected_all, expected_longest = [], []
    for name, trace in traces.items():
        for binding in bindings(program, trace):
            roles = name, tuple(sorted(binding.items())), "Match"
            spans = [(i, j) for i, ends in ends_of(program, trace, binding, 0).items() for j in ends]
            expected_all += [(roles, span) for span in spans]
            expected_longest += [(roles, span) for span in longest(trace, spans)]
    every = found_by_query(folder, program, time=IntervalOptions(intervals="all"))
    assert sorted(every) == sorted(expected_all), program.text()
    assert sorted(found_by_query(folder, program)) == sorted(expected_longest), program.text()
    return len(expected_longest)


def check_gaps(folder: Path, traces: dict[str, Trace], program: Program) -> tuple[int, int]:
    """Where something is not observed: a match is one in every completion, and what matches in one is never a no."""
    matched, unknown = {}, set()
    for roles, (i, j) in found_by_query(folder, program, time=IntervalOptions(intervals="all")):
        if roles[2] == "Match":
            matched.setdefault((roles[:2], i), set()).add(j)
        else:
            unknown.add((roles[:2], i))
    for name, trace in traces.items():
        for binding, seed in itertools.product(bindings(program, trace), range(COMPLETIONS)):
            roles = name, tuple(sorted(binding.items()))
            ends = ends_of(program, trace, binding, seed)
            for i in range(len(trace)):
                for j in matched.get((roles, i), ()):
                    # one that may go on may go on further where more holds, or with another value of D
                    further = not program.terminates or program.hidden
                    held = {end for end in ends.get(i, ()) if end == j or (further and end > j)}
                    assert held, (program.text(), name, i)
                if (roles, i) not in matched and i in ends:
                    assert (roles, i) in unknown, (program.text(), name, i, ends[i])
    return len(matched), len(unknown)


def run(tmp_path: Path, seed: int, programs: int) -> None:
    draw = random.Random(seed)
    for gaps in (False, True):
        traces = {f"r{number}": random_trace(draw, gaps=gaps) for number in range(6)}
        folder = tmp_path / f"d{gaps}"
        write_dataset(folder, [recording_of(*each) for each in traces.items()], {}, name="d")
        total = [0, 0]
        for _ in range(programs // 2):
            program = random_program(draw)
            if program.hidden and gaps:
                program.hidden = any("D)" in atom.text for atom in program.atoms)
            found = check_gaps(folder, traces, program) if gaps else (check_whole(folder, traces, program), 0)
            total = [one + other for one, other in zip(total, found, strict=True)]
        assert total[0] > programs  # the oracle is about something
        assert not gaps or total[1] > 0


def test_random_programs_give_the_intervals_of_the_definition(tmp_path):
    run(tmp_path, 1, 6)


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_many_random_programs_give_the_intervals_of_the_definition(tmp_path):
    for seed in range(2, 5):
        folder = tmp_path / str(seed)
        folder.mkdir()
        run(folder, seed, 52)
