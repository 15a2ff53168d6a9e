"""Runs by values of hidden numbers against those with each value; starts from arrays against those of the matcher."""

import itertools
import random
from dataclasses import dataclass, field, fields

import numpy as np
import pytest
from interval_definition import random_trace, recording_of
from random_dynamics import SOURCE, random_dynamics
from test_ltlf import ATOMS

from scenicq.errors import Source, Span
from scenicq.forest.temporal import (
    Always,
    Atom,
    Dynamics,
    Eventually,
    Not,
    Or,
    TemporalRequirement,
    Termination,
)
from scenicq.limits import LIMITS
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset
from scenicq.store.writer import write_dataset
from scenicq.temporal import run_steps
from scenicq.temporal.hidden_conditions import Cut
from scenicq.temporal.interval_options import IntervalOptions
from scenicq.temporal.run_lanes import follow_runs
from scenicq.temporal.run_machine import RunMachine
from scenicq.temporal.runs import Runs
from scenicq.temporal.starts import StartSearch
from scenicq.temporal.stretches import Timeline
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN


def random_stretches(draw: random.Random) -> Timeline:
    """Stretches of samples half a second apart, with some starts each."""
    lengths = [draw.randint(1, 7) for _ in range(draw.randint(1, 4))]
    bounds = np.cumsum([0, *lengths])
    starts = sorted({0, *(draw.randrange(int(bounds[-1])) for _ in range(6))} | set(bounds[:-1].tolist()))
    seconds = np.concatenate([np.arange(length) / 2 for length in lengths])
    return Timeline(bounds, seconds, np.array(starts))


@dataclass
class HiddenSides:
    """Conditions that hold, or do not, where a hidden number is at least another one at each place."""

    low: np.ndarray
    high: np.ndarray
    cuts: list[Cut] = field(default_factory=list)
    cuts_of: dict[int, tuple[int, ...]] = field(default_factory=dict)
    values: dict[int, np.ndarray] = field(default_factory=dict)

    def truth(self, number, places, sides):
        bits = sum(sides[cut].astype(int) << n for n, cut in enumerate(self.cuts_of[number]))
        return self.values[number][bits, np.arange(self.values[number].shape[1])[places]]

    def with_numbers(self, number: int, numbers: list[float]) -> np.ndarray:
        """The value of a condition at all places, given the hidden numbers."""
        sides = {cut: np.array(numbers[self.cuts[cut].variable] >= self.cuts[cut].at) for cut in self.cuts_of[number]}
        return self.truth(number, slice(None), sides)


def random_sides(draw: random.Random, n: int, hidden: list[int], variables: int) -> HiddenSides:
    found = HiddenSides(np.full(variables, 2.0), np.full(variables, 8.0))
    for number in hidden:
        count = draw.choice([1, 1, 2])
        found.cuts_of[number] = tuple(range(len(found.cuts), len(found.cuts) + count))
        for _ in range(count):
            at = np.array([draw.choice([draw.uniform(0, 10), 4.0, 8.0, 2.0, np.inf]) for _ in range(n)])
            found.cuts.append(Cut(draw.randrange(variables), at))
        found.values[number] = np.array(draw.choices([0, 1, 2], [4, 1, 4], k=n << count)).reshape(1 << count, n)
    return found


def row(runs: Runs, number: int) -> dict[str, object]:
    """What became of a run, without what hidden numbers it is of."""
    names = [each.name for each in fields(runs) if each.name not in ("low", "high")]
    return {name: getattr(runs, name)[number] for name in names}


def compare_pieces(draw: random.Random, programs: int, *, limited: bool = False) -> int:
    """Runs of random programs by pieces against those with each of the values that make a difference.

    Args:
        draw: The source of randomness.
        programs: How many.
        limited: Whether limits may make runs unknown.
    """
    matched = 0
    for _ in range(programs):
        stretches, machine = random_stretches(draw), RunMachine(random_dynamics(draw))
        n, variables = len(stretches), draw.choice([1, 1, 1, 2])
        hidden = random_sides(draw, n, draw.sample(range(ATOMS), draw.randint(1, 2)), variables)
        known = [np.array(draw.choices([0, 1, 2], [4, 1, 4], k=n), dtype=np.int8) for _ in range(ATOMS)]
        pieces = follow_runs(machine, stretches, lambda atom, known=known: known[atom.number], hidden)
        tried: list[list[float]] = []
        for variable in range(variables):
            ends = {2.0, 8.0, *(float(t) for each in hidden.cuts if each.variable == variable for t in each.at)}
            inner = sorted(each for each in ends if 2 <= each <= 8)
            tried.append(sorted({*inner, *((a + b) / 2 for a, b in itertools.pairwise(inner))}))
        rest = list(itertools.product(*tried))
        for numbers in draw.sample(rest, min(len(rest), 60)):
            truth = {number: hidden.with_numbers(number, list(numbers)) for number in hidden.cuts_of}
            alone = follow_runs(machine, stretches, lambda a, t=truth, k=known: t.get(a.number, k[a.number]))
            inside = ((pieces.low <= numbers) & (numbers <= pieces.high)).all(axis=1)
            for start, place in enumerate(stretches.starts.tolist()):
                (mine,) = np.flatnonzero(inside & (pieces.owner == start)).tolist()
                further = limited and (pieces.truth[mine] == UNKNOWN or pieces.open_[mine])
                assert further or row(pieces, mine) == row(alone, start), (machine.dynamics, numbers, place)
                matched += pieces.truth[mine] == TRUE
    return matched


def test_runs_by_values_of_hidden_numbers_are_those_with_each_value():
    assert compare_pieces(random.Random(1), 25) > 400


def test_lanes_may_stand_behind_the_last_place_of_all():
    """Several pieces of one start, of which one has run out of the last stretch before the others lead elsewhere."""
    assert compare_pieces(random.Random(0), 60) > 0


@pytest.mark.parametrize("least", [0, 1, 2])
def test_a_limit_of_pieces_makes_unknown_at_most(monkeypatch, least):
    monkeypatch.setattr(LIMITS, "run_pieces", least)
    monkeypatch.setattr(LIMITS, "jump_cuts", least)
    compare_pieces(random.Random(2), 8, limited=True)


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_many_runs_by_values_of_hidden_numbers_are_those_with_each_value():
    assert compare_pieces(random.Random(3), 600) > 9_000


def test_pieces_that_touch_and_stand_alike_are_one():
    n = 40
    stretches = Timeline(np.array([0, n]), np.arange(n) / 10, np.array([0]))
    hidden = HiddenSides(np.array([0.0]), np.array([100.0]), [Cut(0, np.arange(n) + 1.0)], {0: (0,)})
    hidden.values[0] = np.repeat([[2], [0]], n, axis=1)
    formula = Eventually(Atom(0))  # a new value becomes right at each sample
    dynamics = Dynamics(
        (), (TemporalRequirement(formula, Span(SOURCE, 0, 1)),), (Termination(Span(SOURCE, 2, 3), after_s=3.0),)
    )
    pieces = follow_runs(RunMachine(dynamics), stretches, lambda atom: None, hidden)
    # those that become right before the last sample, at it, and not at all
    assert sorted(pieces.truth.tolist()) == [0, 2, 2]
    assert pieces.high[pieces.truth == TRUE].max() == np.nextafter(31.0, 0)


@pytest.mark.parametrize("count", [3, 39, 40, 41, 64])
def test_however_many_conditions_hang_on_a_hidden_number_each_counts(count):
    """One of them decides, wherever it stands among the others."""
    n = 3
    stretches = Timeline(np.array([0, n]), np.arange(n) / 10, np.array([0]))
    spans = [Span(SOURCE, k, k + 1) for k in range(count)]
    for deciding in (0, count // 2, count - 1):
        cuts = [Cut(0, np.full(n, 50.0 if k == deciding else 10.0)) for k in range(count)]
        hidden = HiddenSides(np.array([20.0]), np.array([100.0]), cuts, {k: (k,) for k in range(count)})
        hidden.values = {k: np.array([[FALSE] * n, [TRUE] * n]) for k in range(count)}
        dynamics = Dynamics((), tuple(TemporalRequirement(Eventually(Atom(k)), span) for k, span in enumerate(spans)))
        pieces = follow_runs(RunMachine(dynamics), stretches, lambda atom: None, hidden)
        found = dict(zip(pieces.low[:, 0].tolist(), pieces.truth.tolist(), strict=True))
        assert found == {20.0: FALSE, 50.0: TRUE}
        assert pieces.broken[pieces.truth == FALSE].tolist() == [spans[deciding]]


@pytest.mark.parametrize("after", [None, 1000.0])
def test_work_grows_as_the_samples_of_a_recording(monkeypatch, after):
    """A run of a long recording costs no more than its share of short ones."""
    steps = []
    whole = run_steps.RunSteps.step
    monkeypatch.setattr(
        run_steps.RunSteps,
        "step",
        lambda self, number, lanes, *args: steps.append(len(lanes)) or whole(self, number, lanes, *args),
    )
    made = []
    for count, length in ((50, 20), (1, 1000)):
        n = count * length
        stretches = Timeline(np.arange(count + 1) * length, np.tile(np.arange(length) / 10, count), np.arange(n))
        truth = [np.where(np.arange(n) // k % 2, TRUE, FALSE) for k in (1, 3)]
        formula = Always(Or((Not(Atom(0)), Eventually(Atom(1)))))
        ends = () if after is None else (Termination(Span(SOURCE, 2, 3), Atom(1)),)
        dynamics = Dynamics((), (TemporalRequirement(formula, Span(SOURCE, 0, 1)),), ends)
        steps.clear()
        follow_runs(RunMachine(dynamics), stretches, lambda atom, truth=truth: truth[atom.number])
        made.append(sum(steps))
    assert made[1] < 1.5 * made[0]


STARTS = (
    "require (distance from ego to a) < 4\n",
    "b = new Object at (Range(-999, 999), Range(-999, 999)), facing 0\nrequire a.position.x > ego.position.x\n",
    "b = new Object offset by (Range(-3, 3), Range(0, 4))\nrequire (distance from a to b) < 6\n",
)


@pytest.mark.parametrize("more", STARTS)
@pytest.mark.parametrize("prefilter", [False, True])
@pytest.mark.one_in(3)
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
