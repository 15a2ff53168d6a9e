"""Timelines against what programs do by their definition: which statement each object waits at, from when to when."""

from __future__ import annotations

import random

import numpy as np
import pytest
from behaviors_definition import ATOMS, Doing, N, completions, modes, places_of, random_program, text_of
from compiled_processes import compiled, numbers_of
from modular_definition import ATOMS as CONDITIONS
from modular_definition import all_runs
from modular_definition import random_program as random_scenarios
from modular_definition import text_of as text_of_scenarios

from scenicq.errors import Span
from scenicq.forest.temporal import Activity
from scenicq.temporal.run_lanes import follow_runs
from scenicq.temporal.run_machine import RunMachine
from scenicq.temporal.stretches import Timeline
from scenicq.temporal.timeline import timeline_of
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN

Told = tuple[tuple[tuple[int, str], ...], int]
"""The lines and names of the calls within which something is done, and the line of that."""


def line_of(span: Span) -> int:
    return span.source.position(span.start)[0]


def told(activity: Activity) -> Told:
    return tuple((line_of(each), each.text.partition("(")[0]) for each in activity.calls), line_of(activity.what)


@pytest.mark.parametrize("seed", range(150))
@pytest.mark.one_in(12)
def test_behaviors_are_in_the_modes_of_their_definition(seed: int) -> None:
    draw = random.Random(seed)
    dynamics = None
    while dynamics is None:
        program = random_program(draw)
        text = text_of(program)
        dynamics = compiled(text)
    numbers, machine, places = numbers_of(dynamics), RunMachine(dynamics), places_of(program)
    names = {
        each.object: f"Outer{count}" for count, each in enumerate(p for p in dynamics.processes if p.object is not None)
    }
    lines = {
        name: next(n for n, line in enumerate(text.splitlines(), 1) if line.endswith(f"behavior {name}()"))
        for name in names.values()
    }

    def expected(doing: dict[tuple[str, int], Doing], name: str, at: int) -> Told | None:
        if (name, at) not in doing:
            return None
        calls, said = doing[name, at]
        return tuple(
            (lines.get(each, 0) or places[id(each)], own) if isinstance(each, str) else (places[id(each)], own)
            for each, own in calls
        ), places[id(said)]

    for _ in range(6):
        times = [float(each) for each in np.cumsum([draw.choice([0.1, 0.1, 0.2]) for _ in range(N)])]
        rows = [[int(draw.choice([FALSE, TRUE])) for _ in range(ATOMS)] for _ in range(N)]
        for _ in range(draw.choice([0, 0, 1, 4])):
            rows[draw.randrange(N)][draw.randrange(ATOMS)] = int(UNKNOWN)
        columns = {atom: np.array([row[number] for row in rows], np.int8) for atom, number in numbers.items()}
        samples = Timeline(np.array([0, N]), np.array(times), np.arange(N))
        runs = follow_runs(machine, samples, lambda atom, columns=columns: columns[atom.number].copy())
        for number in np.flatnonzero(runs.truth == TRUE).tolist():
            start, end = int(runs.starts[number]), int(runs.ends[number])
            own = slice(start, end + 1)
            times_us = np.round(np.array(times[own]) * 1e6).astype(np.int64)
            run = timeline_of(dynamics, times_us, {atom: each[own] for atom, each in columns.items()})
            assert run.may_match
            shown: dict[tuple[str, int], Told | None] = {}
            for each in run.segments:
                owner = dynamics.processes[each.process].object
                for at in range(each.first, each.last + 1):
                    key = names[owner], start + at
                    assert key not in shown
                    shown[key] = None if each.activity is None else told(each.activity)
            last = end - dynamics.terminates
            keys = [(name, at) for name in names.values() for at in range(start, last + 1)]
            assert set(shown) <= set(keys), (text, start, end)
            ways = [
                [
                    {key: expected(doing, *key) for key in keys}
                    for ended, reaches, doing in modes(program, times, trace, start)
                    if (ended == end if dynamics.terminates else reaches >= end)
                ]
                for trace in completions(rows)
            ]  # fmt: skip
            known = {key: each for key, each in shown.items() if each is not None}
            for several in ways:
                # one of the ways to choose is told, as far as it is known
                assert any(
                    all(way[key] == known.get(key) or (key in shown and key not in known) for key in keys)
                    for way in several
                ), (text, start, end, shown, several)
            if not machine.chooses:
                for key in keys:
                    if key in shown and key not in known:
                        assert len({way[key] for several in ways for way in several}) > 1, (text, start, key)


@pytest.mark.parametrize("seed", range(200))
@pytest.mark.one_in(12)
def test_scenarios_run_when_their_definition_runs_them(seed: int) -> None:
    draw = random.Random(seed)
    dynamics = None
    while dynamics is None:
        program = random_scenarios(draw)
        text = text_of_scenarios(program)
        dynamics = compiled(text)
    numbers, machine = numbers_of(dynamics), RunMachine(dynamics)
    composes = next(number for number, each in enumerate(dynamics.processes) if each.composes)
    for _ in range(3):
        times = [float(each) for each in np.cumsum([draw.choice([0.1, 0.1, 0.2]) for _ in range(8)])]
        rows = [[draw.random() < 0.6 for _ in range(CONDITIONS)] for _ in range(8)]
        columns = {
            atom: np.array([TRUE if row[number] else FALSE for row in rows], np.int8)
            for atom, number in numbers.items()
        }
        runs = follow_runs(
            machine, Timeline(np.array([0, 8]), np.array(times), np.arange(8)),
            lambda atom, columns=columns: columns[atom.number].copy(),
        )  # fmt: skip
        for number in np.flatnonzero(runs.truth == TRUE).tolist():
            start, end = int(runs.starts[number]), int(runs.ends[number])
            ways = all_runs(program, rows, times, start)
            if ways is None:
                continue
            own = slice(start, end + 1)
            times_us = np.round(np.array(times[own]) * 1e6).astype(np.int64)
            shown: dict[int, set[tuple[str, ...]]] = {at: set() for at in range(start, end + 1)}
            for each in timeline_of(dynamics, times_us, {atom: truth[own] for atom, truth in columns.items()}).segments:
                if each.process == composes:
                    assert each.activity is not None
                    calls = (*each.activity.calls, each.activity.what)
                    for at in range(start + each.first, start + each.last + 1):
                        shown[at].add(tuple(call.text.partition("(")[0] for call in calls))
            # one of the ways to choose is told
            assert any(
                all(running.get(at, set()) == shown[at] for at in range(start, end + 1 - (over and at_end)))
                for ends, over, running in ways
                if end in ends
                for at_end in [over and end == max(ends)]
            ), (text, rows, start, end, shown, [running for ends, _, running in ways if end in ends])
