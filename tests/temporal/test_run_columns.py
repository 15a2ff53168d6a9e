"""Runs of many stretches at once against those of each by itself, hidden numbers against cells of values."""

import random
from pathlib import Path

import numpy as np
import pytest
from interval_definition import random_program, random_trace, recording_of
from test_ltlf import ATOMS, random_formula

from scenicq.errors import Source, Span
from scenicq.forest.temporal import Atom, Dynamics, TemporalRequirement, Termination
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset
from scenicq.store.writer import write_dataset
from scenicq.temporal import hidden_runs
from scenicq.temporal.interval_options import IntervalOptions
from scenicq.temporal.run_columns import RunColumns
from scenicq.temporal.run_lanes import follow_lanes
from scenicq.temporal.starts import StartSearch
from scenicq.temporal.stretches import Stretches

SOURCE = Source("p.scenic", "x" * 100)


def random_stretches(draw: random.Random) -> Stretches:
    """Stretches of samples half a second apart, with some starts each; nothing is read of their places."""
    lengths = [draw.randint(1, 7) for _ in range(draw.randint(1, 4))]
    bounds = np.cumsum([0, *lengths])
    starts = sorted({0, *(draw.randrange(int(bounds[-1])) for _ in range(6))} | set(bounds[:-1].tolist()))
    seconds = np.concatenate([np.arange(length) / 2 for length in lengths])
    return Stretches(None, bounds, np.arange(bounds[-1]), seconds, np.array(starts), np.arange(len(starts)))


def random_dynamics(draw: random.Random) -> Dynamics:
    formulas = [random_formula(draw, 2) for _ in range(draw.randint(1, 2))]
    ends = [Termination(Span(SOURCE, 90, 91), Atom(draw.randrange(ATOMS)))] if draw.random() < 0.4 else []
    ends += [Termination(Span(SOURCE, 92, 93), after_s=draw.choice([1.0, 2.0]))] if draw.random() < 0.4 else []
    requirements = [TemporalRequirement(formula, Span(SOURCE, k, k + 1)) for k, formula in enumerate(formulas)]
    return Dynamics((), tuple(requirements), tuple(ends))


def test_runs_by_clauses_are_those_of_the_machine():
    draw = random.Random(3)
    decided = 0
    for _ in range(600):
        stretches, dynamics = random_stretches(draw), random_dynamics(draw)
        n = len(stretches.labels)
        # each atom is mostly known, and is over where it is not
        truth = [np.array(draw.choices([0, 1, 2], [4, 1, 4], k=n), dtype=np.int8) for _ in range(ATOMS)]
        columns = RunColumns(dynamics)
        decided += columns.clauses is not None
        found = columns.follow(stretches, lambda atom, truth=truth: truth[atom.number])
        alone = follow_lanes(
            columns.machine, stretches, lambda atom, truth=truth: truth[atom.number], np.arange(len(stretches.starts))
        )
        for number, start in enumerate(stretches.starts.tolist()):
            assert found.run(number, start) == alone.run(number, start), dynamics
    assert decided > 200


def found_in(folder: Path, text: str) -> list[tuple[object, ...]]:
    """Every interval: where it is, who plays whom, and what is said of it."""
    options = QueryOptions(time=IntervalOptions(intervals="all"))
    query = Query(open_dataset(folder), Source("p.scenic", text), options)
    return [
        (each.recording, each.frame, each.interval.last, type(each.verdict).__name__, dict(each.verdict.correspondence))
        for each in query.results()
    ]


@pytest.mark.parametrize("gaps", [False, True])
def test_a_hidden_number_by_thresholds_is_one_by_cells(tmp_path, monkeypatch, gaps):
    draw = random.Random(11)
    traces = {f"r{number}": random_trace(draw, gaps=gaps) for number in range(4)}
    write_dataset(tmp_path / "d", [recording_of(*each) for each in traces.items()], {}, name="d")
    compared, by_thresholds = 0, []
    whole = hidden_runs.thresholds_of

    def noted(*args):
        known = whole(*args)
        by_thresholds.append(known is not None and not known.thin.all())
        return known

    while compared < 3:
        program = random_program(draw)
        text = program.text()
        if "D)" not in text or not program.terminates:
            continue
        # half numbers, so that no threshold is an end of the range or another threshold
        text = text.replace("position.x + 1 > D", "position.x + 1.3 > D").replace("Range(-3, 3)", "Range(-2.9, 3.2)")
        by_thresholds.clear()
        monkeypatch.setattr(hidden_runs, "thresholds_of", noted)
        one = found_in(tmp_path / "d", text)
        if not any(by_thresholds):
            continue
        compared += 1
        monkeypatch.setattr(hidden_runs, "thresholds_of", lambda *args: None)
        assert one == found_in(tmp_path / "d", text), text


STARTS = (
    "require (distance from ego to a) < 4\n",
    "b = new Object at (Range(-999, 999), Range(-999, 999)), facing 0\nrequire a.position.x > ego.position.x\n",
    "b = new Object offset by (Range(-3, 3), Range(0, 4))\nrequire (distance from a to b) < 6\n",
)


@pytest.mark.parametrize("more", STARTS)
@pytest.mark.parametrize("prefilter", [False, True])
def test_starts_from_arrays_are_the_matchers(tmp_path, monkeypatch, more, prefilter):
    draw = random.Random(5)
    traces = {f"r{number}": random_trace(draw, gaps=True) for number in range(10)}
    write_dataset(tmp_path / "d", [recording_of(*each) for each in traces.items()], {}, name="d")
    head = "ego = new Object at (Range(-999, 999), Range(-999, 999)), facing 0\n"
    head += "a = new Object at (Range(-999, 999), Range(-999, 999)), facing 0\n"
    options = QueryOptions(prefilter=prefilter, time=IntervalOptions(min_duration_s=0.5))

    def found() -> tuple[list[object], dict[str, int]]:
        query = Query(open_dataset(tmp_path / "d"), Source("p.scenic", head + more), options)
        return list(query.results()), dict(query.funnel.excluded)

    in_arrays = found()
    monkeypatch.setattr(StartSearch, "_odd", staticmethod(lambda block: True))
    assert in_arrays == found()
    assert in_arrays[0]
