"""Runs against their definition: every completion of what is not observed, one sample after the other."""

from __future__ import annotations

import itertools
import random
from dataclasses import dataclass

import numpy as np
import pytest
from random_dynamics import random_dynamics
from test_ltlf import ATOMS, recursive
from test_run_lanes import random_stretches

from scenicq.forest.temporal import Dynamics, Goto, Reject, Terminate, Test, Wait
from scenicq.limits import LIMITS
from scenicq.temporal.run_lanes import follow_runs
from scenicq.temporal.run_machine import RunMachine
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN

GAPS = 6


@dataclass
class Definition:
    """What a program says of one trace in which everything is known: a list of tuples of truth values."""

    dynamics: Dynamics
    seconds: list[float]
    trace: list[tuple[bool, ...]]

    def holds(self, i: int, j: int) -> bool:
        return all(recursive(each.formula, self.trace[: j + 1], i) for each in self.dynamics.requirements)

    def ends(self, i: int) -> tuple[int | None, bool] | set[int]:
        """The end of the run from i and whether it is a match; of a program without one, every end that is."""
        places: list[int | None] = [0] * len(self.dynamics.processes)
        rejected, found = False, set[int]()
        for k in range(i, len(self.trace)):
            over = False
            for each in self.dynamics.terminations:
                late = each.after_s is not None and self.seconds[k] - self.seconds[i] >= each.after_s - 1e-6
                when = each.condition is not None and not each.simulation and self.trace[k][each.condition.number]
                over = over or late or when
            if not over:
                for number, monitor in enumerate(self.dynamics.processes):
                    place = places[number]
                    places[number] = None
                    while place is not None:
                        step = monitor.steps[place]
                        place = None
                        match step:
                            case Test():
                                place = step.then if self.trace[k][step.condition.number] else step.otherwise
                            case Goto():
                                place = step.then
                            case Wait():
                                places[number] = step.then
                            case Terminate():
                                over = True
                            case Reject():
                                rejected = True
                            case _:
                                pass
                over = over or any(
                    each.simulation and self.trace[k][each.condition.number] for each in self.dynamics.terminations
                )
            if self.dynamics.terminates:
                if over:
                    return k, not rejected and self.holds(i, k)
            elif not rejected and self.holds(i, k):
                found.add(k)
        return (None, False) if self.dynamics.terminates else found


def completions(rows: list[list[int]]) -> list[list[tuple[bool, ...]]]:
    gaps = [(k, a) for k, row in enumerate(rows) for a, value in enumerate(row) if value == UNKNOWN]
    found = []
    for values in itertools.product((False, True), repeat=len(gaps)):
        whole = [[value == TRUE for value in row] for row in rows]
        for (k, a), value in zip(gaps, values, strict=True):
            whole[k][a] = value
        found.append([tuple(row) for row in whole])
    return found


def expected(dynamics: Dynamics, seconds: list[float], rows: list[list[int]], i: int) -> tuple[int, set[int]]:
    """The truth of the run from a sample, and its ends: of an unknown one all that are possible."""
    ways = [Definition(dynamics, seconds, trace).ends(i) for trace in completions(rows)]
    if dynamics.terminates:
        ends = {end for end, matches in ways if matches}
        sure = len(set(ways)) == 1 and ways[0][1]
        return int(TRUE if sure else UNKNOWN if ends else FALSE), ends
    common, some = set.intersection(*ways), set.union(*ways)
    if common:
        return int(TRUE), {max(common)}
    return (int(UNKNOWN), {max(some)}) if some else (int(FALSE), {i})


def is_lost(dynamics: Dynamics, seconds: list[float], rows: list[list[int]], i: int) -> bool:
    """Whether no run from a sample is a match, however up to three more samples come out."""
    draw = random.Random(len(rows))
    for more in range(1, 4):
        times = [*seconds, *(seconds[-1] + 0.5 * k for k in range(1, more + 1))]
        for _ in range(20):
            whole = [[int(draw.choice([FALSE, TRUE])) if v == UNKNOWN else v for v in row] for row in rows]
            whole += [[int(draw.choice([FALSE, TRUE])) for _ in range(ATOMS)] for _ in range(more)]
            if expected(dynamics, times, whole, i)[0] == TRUE:
                return False
    return True


def random_rows(draw: random.Random, n: int) -> list[list[int]]:
    rows = [[int(draw.choice([FALSE, TRUE])) for _ in range(ATOMS)] for _ in range(n)]
    places = [(k, a) for k in range(n) for a in range(ATOMS)]
    for k, a in draw.sample(places, min(draw.choice([0, 1, 3, GAPS]), len(places))):
        rows[k][a] = int(UNKNOWN)
    return rows


def compare(draw: random.Random, programs: int, *, limited: bool = False) -> int:
    """Runs of random programs against the definition; how many are known.

    Args:
        draw: The source of randomness.
        programs: How many.
        limited: Whether limits may make runs unknown.
    """
    decided = 0
    for _ in range(programs):
        stretches, dynamics = random_stretches(draw), random_dynamics(draw)
        machine = RunMachine(dynamics)
        rows: list[list[int]] = []
        for places, _mine in stretches.apart():
            rows += random_rows(draw, places.stop - places.start)
        truth = np.array(rows, dtype=np.int8)
        found = follow_runs(machine, stretches, lambda atom, truth=truth: truth[:, atom.number])
        for places, mine in stretches.apart():
            own, seconds = rows[places], stretches.seconds[places].tolist()
            for number in range(mine.start, mine.stop):
                truth, end = int(found.truth[number]), int(found.ends[number]) - places.start
                start = int(stretches.starts[number]) - places.start
                value, ends = expected(dynamics, seconds, own, start)
                if limited and truth == UNKNOWN:
                    continue
                assert truth == value, (dynamics, own, start)
                decided += value != UNKNOWN
                if value == TRUE or (value == UNKNOWN and not dynamics.terminates):
                    further = limited and found.open_[number] and end < max(ends)
                    assert further or {end} == ends, (dynamics, own, start)
                cut_off, broken = found.cut_off[number], found.broken[number]
                if value == FALSE and not cut_off:
                    assert broken is not None
                if cut_off and broken:
                    assert is_lost(dynamics, seconds, own, start), (dynamics, own, start)
    return decided


def test_runs_are_unknown_only_where_completions_differ():
    assert compare(random.Random(1), 250) > 900


@pytest.mark.parametrize("name", ["formula_clauses", "observation_ways", "run_modes", "run_situations"])
@pytest.mark.parametrize("least", [0, 1, 2])
@pytest.mark.one_in(2)
def test_a_limit_makes_unknown_at_most(monkeypatch: pytest.MonkeyPatch, name: str, least: int):
    monkeypatch.setattr(LIMITS, name, least)
    compare(random.Random(2), 40, limited=True)


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_many_runs_are_unknown_only_where_completions_differ():
    assert compare(random.Random(3), 4000) > 16_000
